"""Grids of heights as sea floors."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sonar_component.scene.terrain import read_heights, terrain
from sonar_component.settings import SettingsError


def test_a_slope_has_the_heights_the_size_and_the_normal_of_its_plane() -> None:
    heights = np.tile(np.linspace(0, 1, 11), (6, 1))  # rises along X
    mesh = terrain(heights, (20.0, 10.0, 4.0))
    assert mesh.bounds == pytest.approx(np.array([[-10, -5, 0], [10, 5, 4]]))
    assert mesh.vertices[:, 2] == pytest.approx((mesh.vertices[:, 0] + 10) / 20 * 4)
    up = np.array([-0.2, 0, 1]) / np.hypot(0.2, 1)
    assert mesh.normals == pytest.approx(np.tile(up, (66, 1)), abs=1e-6)


def test_the_first_row_of_a_picture_lies_at_the_far_left(tmp_path: Path) -> None:
    picture = np.zeros((3, 3), np.uint8)
    picture[0, 2] = 255
    Image.fromarray(picture).save(tmp_path / "h.png")
    mesh = terrain(read_heights(tmp_path / "h.png"), (2.0, 2.0, 5.0))
    assert mesh.vertices[mesh.vertices[:, 2].argmax()] == pytest.approx([1, 1, 5])  # +X, +Y


@pytest.mark.parametrize(("dtype", "white"), [(np.uint8, 255), (np.uint16, 65535), (np.float32, 1.0)])
def test_white_is_one_at_every_depth(tmp_path: Path, dtype: type, white: float) -> None:
    file = tmp_path / "h.tiff"
    Image.fromarray(np.array([[0, white], [white, 0]], dtype)).save(file)
    assert read_heights(file) == pytest.approx(np.array([[0, 1], [1, 0]]))


def test_an_array_keeps_its_own_numbers(tmp_path: Path) -> None:
    np.save(tmp_path / "h.npy", np.array([[0, 2.5], [-7, 1]]))
    assert read_heights(tmp_path / "h.npy") == pytest.approx(np.array([[0, 2.5], [-7, 1]]))


def test_a_picture_of_one_pixel_is_refused(tmp_path: Path) -> None:
    Image.fromarray(np.zeros((1, 1), np.uint8)).save(tmp_path / "h.png")
    with pytest.raises(SettingsError, match=r"h.png: a grid of heights must be at least 2 x 2, got 1 x 1"):
        read_heights(tmp_path / "h.png")


def test_a_file_that_is_no_picture_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "h.png").write_text("no picture")
    with pytest.raises(SettingsError, match=r"is not a readable picture") as caught:
        read_heights(tmp_path / "h.png")
    assert "\n" not in str(caught.value)


def test_heights_that_are_not_numbers_are_refused() -> None:
    with pytest.raises(ValueError, match="1 heights are NaN"):
        terrain(np.array([[0, np.nan], [0, 0]]), (1, 1, 1))
