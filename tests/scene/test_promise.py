"""Mesh files that break off are told from whole ones by what they promise themselves."""

import json
from pathlib import Path

import pytest
import trimesh

from sonar_component.scene.mesh_file import read_mesh_file
from sonar_component.settings import SettingsError


def ball() -> trimesh.Trimesh:
    """320 faces."""
    return trimesh.creation.icosphere(2, 1.0)


def written(folder: Path, kind: str) -> Path:
    suffix = kind.split()[-1]
    path = folder / f"ball.{suffix}"
    options = {"ascii stl": {"file_type": "stl_ascii"}, "ascii ply": {"encoding": "ascii"}}.get(kind, {})
    ball().export(path, **options)
    return path


@pytest.mark.parametrize("kept", [0.01, 0.5, 0.97])
@pytest.mark.parametrize("kind", ["stl", "ascii stl", "ply", "ascii ply", "glb"])
def test_a_file_that_breaks_off_is_refused_and_says_so(tmp_path: Path, kind: str, kept: float) -> None:
    path = written(tmp_path, kind)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * kept)])
    with pytest.raises(SettingsError, match=r"is not a readable \w+ file: ."):
        read_mesh_file(path)


def test_it_says_how_much_is_missing(tmp_path: Path) -> None:
    path = written(tmp_path, "stl")
    path.write_bytes(path.read_bytes()[: 84 + 50 * 200 + 7])
    with pytest.raises(SettingsError, match="it promises 320 faces and holds 200"):
        read_mesh_file(path)


@pytest.mark.parametrize("kind", ["stl", "ascii stl", "ply", "ascii ply", "glb"])
def test_a_whole_file_is_read(tmp_path: Path, kind: str) -> None:
    parts, _ = read_mesh_file(written(tmp_path, kind))
    assert sum(len(part.mesh.faces) for part in parts) == 320


def test_a_binary_file_may_begin_like_text(tmp_path: Path) -> None:
    path = written(tmp_path, "stl")
    path.write_bytes(b"solid of\nsome CAD".ljust(80) + path.read_bytes()[80:])
    parts, _ = read_mesh_file(path)
    assert len(parts[0].mesh.faces) == 320


def gltf(folder: Path) -> tuple[Path, Path]:
    """A glTF and its buffer."""
    for name, data in trimesh.Scene(ball()).export(file_type="gltf").items():
        (folder / name).write_bytes(data)
    return next(folder.glob("*.gltf")), sorted(folder.glob("*.bin"))[0]


def test_a_gltf_without_its_buffer_names_it(tmp_path: Path) -> None:
    path, buffer = gltf(tmp_path)
    buffer.unlink()
    with pytest.raises(SettingsError, match=f"it needs '{buffer.name}' beside it, which is not there"):
        read_mesh_file(path)


def test_a_gltf_whose_buffer_breaks_off_names_it(tmp_path: Path) -> None:
    path, buffer = gltf(tmp_path)
    buffer.write_bytes(buffer.read_bytes()[:100])
    with pytest.raises(SettingsError, match=f"its '{buffer.name}' breaks off: \\d+ bytes are promised, it holds 100"):
        read_mesh_file(path)


def test_a_buffer_with_a_space_in_its_name_is_found(tmp_path: Path) -> None:
    path, buffer = gltf(tmp_path)
    tree = json.loads(path.read_bytes())
    names = {entry["uri"]: entry["uri"].replace("_", "%20") for entry in tree["buffers"]}
    for entry in tree["buffers"]:
        (tmp_path / entry["uri"]).rename(tmp_path / entry["uri"].replace("_", " "))
        entry["uri"] = names[entry["uri"]]
    path.write_text(json.dumps(tree))
    assert not buffer.exists()
    assert len(read_mesh_file(path)[0][0].mesh.faces) == 320


def test_a_buffer_outside_the_folder_is_not_read(tmp_path: Path) -> None:
    (tmp_path / "models").mkdir()
    path, buffer = gltf(tmp_path / "models")
    buffer.rename(tmp_path / buffer.name)
    path.write_text(path.read_text().replace(buffer.name, f"../{buffer.name}"))
    with pytest.raises(SettingsError, match="lies outside its folder"):
        read_mesh_file(path)
