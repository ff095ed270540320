"""`sonar ping` as a user types it, on real OpenGL."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from sonar_component.cli.app import main

FORMATS = ("obj", "stl", "ply", "glb", "gltf", "dae")

# The scene on which the original simulator (its state of 2017) was run for comparison.
COMPARISON_SCENE = """\
version: 1
bodies:
  floor: {plane: {size: [200 m, 200 m]}}
  ball: {sphere: {radius: 1.5 m}, pose: {position: [12 m, -3 m, 1.5 m]}}
  box: {box: {size: [3 m, 2 m, 2 m]}, pose: {position: [15 m, 4 m, 1 m]}}
"""
COMPARISON_SONAR = """\
range: 30 m
bin_count: 500
beam_count: 256
beam_width: 120 deg
beam_height: 20 deg
"""
COMPARISON_POSE = ("--position", "0", "0", "3", "--rpy-deg", "0", "15", "0")


class Ping:
    """Runs the verb in a folder of its own."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self.capsys = folder, capsys

    def write(self, name: str, text: str) -> Path:
        (self.folder / name).write_text(text)
        return self.folder / name

    def __call__(self, *arguments: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as caught:
            main(["ping", *map(str, arguments)])
        printed = self.capsys.readouterr()
        assert isinstance(caught.value.code, int)
        return caught.value.code, printed.out, printed.err

    def arrays(self, *arguments: object, out: str = "ping.npz") -> dict[str, Any]:
        code, _, err = self(*arguments, "--out", self.folder / out)
        assert code == 0, err
        with np.load(self.folder / out) as file:
            return dict(file)


@pytest.fixture
def ping(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Ping:
    monkeypatch.chdir(tmp_path)
    return Ping(tmp_path, capsys)


def box_at(x: float, y: float, z: float) -> trimesh.Trimesh:
    box = trimesh.creation.box(extents=(1.0, 2.0, 1.5))
    box.apply_translation((x, y, z))
    return box


@pytest.fixture
def compared(context: Any, ping: Ping) -> dict[str, Any]:
    ping.write("scene.yaml", COMPARISON_SCENE)
    ping.write("sonar.yaml", COMPARISON_SONAR)
    return ping.arrays("--scene", "scene.yaml", "--sonar", "sonar.yaml", *COMPARISON_POSE)


def extent(bins: np.ndarray, beams: slice, cells: slice) -> tuple[int, int, int, int]:
    """First and last beam and bin of the strong echoes within a window."""
    beam, cell = np.nonzero(bins[beams, cells] > 0.3)
    return (
        int(beam.min()) + beams.start, int(beam.max()) + beams.start,
        int(cell.min()) + cells.start, int(cell.max()) + cells.start,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("what", "window", "original"),
    [
        ("sphere", (slice(120, 200), slice(150, 215)), (146, 169, 182, 190)),
        ("box", (slice(60, 120), slice(215, 270)), (84, 101, 230, 244)),
    ],
)
def test_echoes_stand_where_the_original_simulator_put_them(
    compared: dict[str, Any], what: str, window: tuple[slice, slice], original: tuple[int, int, int, int]
) -> None:
    # Its frame bins with range / (bins - 1) and its sphere is a polyhedron: each shifts an edge by at most one cell.
    assert np.abs(np.subtract(extent(compared["bins"], *window), original)).max() <= 1


def test_bearings_are_centres_and_positive_to_the_left(compared: dict[str, Any]) -> None:
    # 256 beams tile 120 deg from the left edge to the right: centres half a beam inside, in steps of one beam.
    degrees = np.degrees(compared["bearings"])
    np.testing.assert_allclose(degrees, 60 - (np.arange(256) + 0.5) * 120 / 256, atol=1e-12)
    sphere, box = np.degrees(np.arctan2([-3, 4], [12 * np.cos(np.radians(15)), 15 * np.cos(np.radians(15))]))
    first, last, _, _ = extent(compared["bins"], slice(120, 200), slice(150, 215))
    assert degrees[last] < sphere < degrees[first] < 0  # to the right, as in the world
    first, last, _, _ = extent(compared["bins"], slice(60, 120), slice(215, 270))
    assert 0 < degrees[last] < box < degrees[first]


def test_the_npz_holds_what_is_promised(compared: dict[str, Any]) -> None:
    shapes = {name: (array.shape, array.dtype.str) for name, array in compared.items()}
    assert shapes == {
        "bins": ((256, 500), "<f4"), "bearings": ((256,), "<f8"), "bin_duration": ((), "<f8"),
        "speed_of_sound": ((), "<f8"), "beam_width": ((), "<f8"), "beam_height": ((), "<f8"), "time": ((), "<i8"),
    }  # fmt: skip
    assert compared["bin_duration"] * compared["speed_of_sound"] * 500 == pytest.approx(30, rel=1e-14)  # one way
    np.testing.assert_allclose(np.degrees([compared["beam_width"], compared["beam_height"]]), [120, 20])
    assert np.isfinite(compared["bins"]).all()
    assert (compared["bins"] >= 0).all()
    assert (compared["bins"] <= 1).all()


def test_truth_adds_what_stands_behind_each_bin(context: Any, ping: Ping) -> None:
    ping.write("scene.yaml", COMPARISON_SCENE)
    ping.write("sonar.yaml", COMPARISON_SONAR)
    arrays = ping.arrays("--scene", "scene.yaml", "--sonar", "sonar.yaml", *COMPARISON_POSE, "--truth")
    for name in ("clean", "elevation", "range", "object_id", "hit_weight"):
        assert arrays[name].shape == (256, 500), name
    np.testing.assert_array_equal(arrays["clean"], arrays["bins"])  # nothing noisy was asked for
    lit = arrays["bins"] > 0.3
    bin_of_truth = np.floor(arrays["range"][lit] / 0.06)
    # The sample behind a bin has its middle there or in the next one, where its footprint spills over.
    assert np.abs(bin_of_truth - np.nonzero(lit)[1]).max() <= 1
    ball = 1 + arrays["object_names"].tolist().index("ball")  # 0 stands for nothing
    behind = arrays["object_id"][146:170, 182:191][lit[146:170, 182:191]]
    assert (behind == ball).mean() > 0.95  # a bin on its outline is shared with the floor


@pytest.fixture(scope="module")
def boxes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One box ahead in every mesh format, metres, Z up."""
    folder = tmp_path_factory.mktemp("boxes")
    for ending in FORMATS:
        box = box_at(6, 1, -0.5)
        if ending == "gltf":
            for name, data in trimesh.exchange.gltf.export_gltf(trimesh.Scene(box)).items():
                (folder / ("box.gltf" if name == "model.gltf" else name)).write_bytes(data)
        elif ending == "dae":
            box.unmerge_vertices()  # trimesh writes normals into it, and those of shared corners would be round
            text = trimesh.exchange.dae.export_collada(box).decode()
            (folder / "box.dae").write_text(text.replace("Y_UP", "Z_UP"))  # its word for any mesh; this one is Z up
        else:
            box.export(folder / f"box.{ending}")
    return folder


@pytest.mark.parametrize("ending", FORMATS)
def test_a_bare_mesh_gives_the_image_of_the_shape_whatever_its_format(
    context: Any, ping: Ping, boxes: Path, ending: str
) -> None:
    ping.write("box.yaml", "version: 1\nbodies: {b: {box: {size: [1 m, 2 m, 1.5 m]}, pose: {position: [6, 1, -0.5]}}}")
    settings = ("--set", "range=10 m", "--set", "bin_count=200", "--set", "beam_count=64")
    shape = ping.arrays("--scene", "box.yaml", *settings)
    mesh = ping.arrays("--scene", boxes / f"box.{ending}", *settings)
    assert (shape["bins"] > 0.3).any()
    # The same eight corners in float64, in another order of triangles: only roundings of float32 differ.
    np.testing.assert_allclose(mesh["bins"], shape["bins"], atol=1e-3)


def test_settings_on_the_command_line_win_over_the_sonar_file(context: Any, ping: Ping, boxes: Path) -> None:
    ping.write("sonar.yaml", COMPARISON_SONAR)
    arrays = ping.arrays("--scene", boxes / "box.stl", "--sonar", "sonar.yaml", "--set", "bin_count=123")
    assert arrays["bins"].shape == (256, 123)


def test_a_quaternion_says_the_same_as_the_angles_it_stands_for(context: Any, ping: Ping, boxes: Path) -> None:
    small = ("--scene", boxes / "box.stl", "--set", "range=10 m", "--set", "beam_count=32", "--set", "bin_count=100")
    half = np.radians(10) / 2
    turned = ping.arrays(*small, "--quaternion", 2 * np.cos(half), 0, 0, 2 * np.sin(half))  # its length is divided out
    np.testing.assert_array_equal(turned["bins"], ping.arrays(*small, "--rpy-deg", 0, 0, 10)["bins"])
    assert (turned["bins"] != ping.arrays(*small)["bins"]).any()


def test_a_picture_is_written_for_people(context: Any, ping: Ping, boxes: Path) -> None:
    code, out, err = ping("--scene", boxes / "box.stl", "--set", "range=10 m", "--out", "box.png")
    assert (code, err) == (0, "")
    assert "256 beams x 750 bins" in out
    with Image.open("box.png") as picture:
        assert picture.format == "PNG"
        assert min(picture.size) >= 300
        assert len(picture.convert("RGB").getcolors(1 << 24) or []) > 50  # a picture, not a blank sheet


def test_a_summary_for_machines(context: Any, ping: Ping, boxes: Path) -> None:
    code, out, _ = ping("--scene", boxes / "box.stl", "--set", "range=10 m", "--out", "box.npz", "--json")
    summary = json.loads(out)
    assert code == 0
    assert (summary["file"], summary["beam_count"], summary["bin_count"]) == ("box.npz", 256, 750)
    assert 0 < summary["lit"] < 1


def test_explain_lists_each_feature_with_its_reason_and_cost(context: Any, ping: Ping, boxes: Path) -> None:
    Image.new("L", (4, 4), 128).save(ping.folder / "grey.png")
    scene = ping.write(
        "scene.yaml",
        "version: 1\nmaterials: {rust: {reflectance_map: grey.png}}\n"
        "bodies: {ball: {sphere: {radius: 1}, pose: {position: [5, 0, 0]}, material: rust}}\n",
    )
    small = ("--scene", scene, "--set", "range=10 m", "--set", "beam_count=16", "--out", "b.npz", "--explain")
    code, out, _ = ping(*small)
    assert code == 0
    assert "  normal map: off, no material has a normal map: no code, no texture, no column\n" in out
    line = next(line for line in out.splitlines() if line.startswith("  reflectance map: on"))
    assert line.startswith("  reflectance map: on, a reflectance map in rust: ")
    assert line.endswith(" ms of drawing")
    summary = json.loads(ping(*small, "--json")[1])
    used = {feature["name"]: feature for feature in summary["features"] if feature["on"]}
    assert set(used) == {"WIDE_FAN", "SIGMOID", "REFLECTANCE_MAP"}
    assert all(0 <= feature["cost_ms"] <= feature["whole_ms"] for feature in used.values())


def test_a_black_image_says_why(context: Any, ping: Ping, boxes: Path) -> None:
    code, _, err = ping("--scene", boxes / "box.stl", "--rpy-deg", 0, 0, 180, "--out", "box.npz")
    assert (code, err) == (0, "warning: no surface lies in the sector within 50 m: the image is black\n")


def test_what_comes_with_the_package_is_found_from_any_folder(context: Any, ping: Ping) -> None:
    arrays = ping.arrays(
        "--scene", "configs/scenes/wreck_site/scene.yaml", "--sonar", "configs/sonars/gemini_720i.yaml",
        "--position", -3, -1, -11.5, "--rpy-deg", 0, 22, 0,
    )  # fmt: skip
    assert 0.1 < (arrays["bins"] > 0).mean() < 0.9  # wreck and sand, and shadows


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scene", "gone.obj"], "gone.obj: no such file"),
        (["--scene", "box.stl", "--sonar", "gone.yaml"], "gone.yaml: no such file"),
        (["--scene", "box.stl", "--sonar", "typo.yaml"], 'typo.yaml:2:1: beam_widht: is not a known key (did you mean'),
        (["--scene", "box.stl", "--set", "range=0"], "--set: range: must be 0.1 m to 1000 m, got 0 m"),
        (["--scene", "box.stl", "--set", "range=30 deg"], "--set: range: must be of length"),
        (["--scene", "box.stl", "--set", "beam_width=120"], '(did you mean "120 deg"?)'),
        (["--scene", "box.stl", "--position", "0", "nan", "0"], "position must be 3 finite numbers [m], got [0.0"),
        (["--scene", "box.stl", "--rpy-deg", "0", "inf", "0"], "orientation must be 4 finite numbers"),
        (["--scene", "box.stl", "--quaternion", "0", "0", "0", "0"], "--quaternion must be 4 finite numbers that are"),
        (["--scene", "box.stl", "--rpy-deg", "0", "0", "0", "--quaternion", "1", "0", "0", "0"], "not both"),
        (["--scene", "scene.yaml"], "scene.yaml:3:"),
        (["--scene", "words.obj"], "words.obj: has no faces"),
        (["--scene", "words.xyz"], "is not a scene known here; allowed: "),
        (["--scene", "."], "is a folder"),
    ],
)  # fmt: skip
def test_bad_input_gets_one_line_and_no_file(
    ping: Ping, boxes: Path, arguments: list[str], message: str, recwarn: pytest.WarningsRecorder
) -> None:
    ping.write("box.stl", "").write_bytes((boxes / "box.stl").read_bytes())
    ping.write("typo.yaml", "range: 30 m\nbeam_widht: 120 deg\n")
    ping.write("scene.yaml", "version: 1\nbodies:\n  wreck: {mesh: gone.glb}\n")
    ping.write("words.obj", "no mesh")
    ping.write("words.xyz", "no mesh")
    code, out, err = ping(*arguments, "--out", "never.npz")
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
    assert not Path("never.npz").exists()


@pytest.mark.parametrize(
    ("out", "message"),
    [
        ("ping.jpg", "--out must end in .npz or .png, got 'ping.jpg'"),
        ("nowhere/ping.npz", "--out: there is no folder nowhere"),
        ("folder.npz", "--out: folder.npz is a folder"),
    ],
)
def test_a_place_where_nothing_can_be_written_is_refused_before_rendering(
    ping: Ping, boxes: Path, out: str, message: str
) -> None:
    Path("folder.npz").mkdir()
    assert ping("--scene", boxes / "box.stl", "--out", out) == (2, "", f"{message}\n")


def test_without_egl_one_line_says_how_to_get_it(ping: Ping, boxes: Path) -> None:
    # libglvnd asks the files in this folder for drivers: an empty one is a machine without Mesa.
    done = subprocess.run(
        [sys.executable, "-m", "sonar_component", "ping", "--scene", str(boxes / "box.stl"), "--out", "never.npz"],
        env={**os.environ, "__EGL_VENDOR_LIBRARY_DIRS": str(ping.folder)},
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (2, "")
    assert "sudo apt-get install libegl1" in done.stderr
    assert done.stderr.count("\n") == 1
