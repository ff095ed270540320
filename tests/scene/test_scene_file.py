"""The scene YAML: what it makes, and where it says that it is wrong."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from sonar_component.scene import load_world
from sonar_component.scene.scene_settings import SceneSettings
from sonar_component.settings import SettingsError, load_yaml, validate


def write(folder: Path, text: str) -> Path:
    (folder / "scene.yaml").write_text(text)
    return folder / "scene.yaml"


def mistakes(file: Path) -> list[str]:
    with pytest.raises(SettingsError) as caught:
        load_world(file)
    return [line.replace(str(file), "scene.yaml") for line in str(caught.value).splitlines()]


@pytest.fixture
def brick(tmp_path: Path) -> Path:
    trimesh.creation.box((1000, 2000, 3000)).export(tmp_path / "brick.stl")
    return tmp_path


def test_bodies_stand_where_their_poses_say(brick: Path) -> None:
    world = load_world(
        write(
            brick,
            """
version: 1
materials:
  steel: {reflectance: 1.4}
bodies:
  brick: {mesh: brick.stl, unit: mm, pose: {position: [10 m, 0, -50 cm], rpy: [0, 0, 90 deg]}, material: steel}
  ball: {sphere: {radius: 0.4 m}, material: {reflectance: 0.3}, moving: true}
  seabed: {plane: {}, pose: {quaternion: [0.70710678, 0.70710678, 0, 0]}}
""",
        )
    )
    body = world.bodies["brick"]
    points = body.parts[0].mesh.vertices @ body.X_WB[:3, :3].T + body.X_WB[:3, 3]
    assert np.ptp(points, axis=0) == pytest.approx([2, 1, 3])  # turned by 90 deg about Z
    assert body.X_WB[:3, 3] == pytest.approx([10, 0, -0.5])
    assert body.parts[0].material.reflectance == 1.4
    assert world.bodies["ball"].moving
    assert world.bodies["ball"].parts[0].material.reflectance == 0.3
    assert world.bodies["seabed"].X_WB[:3, 2] == pytest.approx([0, -1, 0], abs=1e-7)  # eight digits in the file


def test_materials_are_given_by_the_names_in_the_mesh_file(tmp_path: Path) -> None:
    (tmp_path / "s.mtl").write_text("newmtl hull\nnewmtl deck\n")
    (tmp_path / "s.obj").write_text(
        "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\no side\nusemtl hull\nf 1 2 3\no top\nusemtl deck\nf 1 3 2\n"
    )
    world = load_world(
        write(
            tmp_path,
            """
version: 1
materials: {steel: {reflectance: 2}}
bodies:
  ship: {mesh: s.obj, material: {reflectance: 0.5}, materials: {hull: steel, top: {reflectance: 3}}}
  other: {mesh: s.obj, material: {reflectance: 0.5}, materials: {hull: steel}}
""",
        )
    )
    found = {(name, part.name): part.material.reflectance for name, body in world.bodies.items() for part in body.parts}
    assert found == {("ship", "side"): 2, ("ship", "top"): 3, ("other", "side"): 2, ("other", "top"): 0.5}


def test_a_terrain_and_a_normal_map_are_found_beside_the_scene(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 65535], [0, 65535]], np.uint16)).save(tmp_path / "h.png")
    Image.new("RGB", (4, 2), (128, 128, 255)).save(tmp_path / "n.png")
    world = load_world(
        write(
            tmp_path,
            """
version: 1
materials: {sand: {normal_map: n.png, reflectance_map: n.png}}
bodies: {floor: {terrain: {heights: h.png, size: [10 m, 20 m, 3 m]}, material: sand}}
""",
        )
    )
    part = world.bodies["floor"].parts[0]
    assert part.mesh.bounds == pytest.approx(np.array([[-5, -10, 0], [5, 10, 3]]))
    assert part.mesh.uv is not None
    assert part.material.normal_map is not None
    assert part.material.normal_map.shape == (2, 4, 3)
    assert part.material.reflectance_map is not None
    assert part.material.reflectance_map.shape == (2, 4)


def test_a_texture_size_lays_pictures_on_in_metres(brick: Path) -> None:
    Image.new("RGB", (4, 2), (128, 128, 255)).save(brick / "n.png")
    world = load_world(
        write(
            brick,
            """
version: 1
materials: {sand: {normal_map: n.png, texture_size: 50 cm}, bare: {normal_map: n.png}}
bodies:
  floor: {plane: {size: [10 m, 20 m]}, material: sand}
  once: {plane: {size: [10 m, 20 m]}, material: bare}
  brick: {mesh: brick.stl, unit: mm, material: bare}
""",
        )
    )
    spans = {name: np.ptp(body.parts[0].mesh.uv, axis=0).tolist() for name, body in world.bodies.items()}
    assert spans == {"floor": [20, 40], "once": [1, 1], "brick": pytest.approx([2, 3])}


def test_every_mistake_is_told_at_once_with_its_line(brick: Path) -> None:
    (brick / "points.obj").write_text("v 0 0 0\n")
    told = mistakes(
        write(
            brick,
            """version: 1
materials: {steel: {normal_map: gone.png}}
bodies:
  a: {mesh: bric.stl}
  b: {mesh: points.obj}
  c: {mesh: brick.stl, material: stel}
  d: {mesh: brick.stl, materials: {rust: steel}}
""",
        )
    )
    assert len(told) == 5
    assert told[0].startswith("scene.yaml:2:13: materials.steel: gone.png: no such file")
    assert told[1].startswith('scene.yaml:4:7: bodies.a.mesh: bric.stl: no such file (did you mean "brick.stl"?)')
    assert told[2].startswith("scene.yaml:5:7: bodies.b.mesh:")
    assert told[2].endswith(
        "has no faces that a sonar can see: 'points.obj': holds no faces (points or lines only), left out"
    )
    assert told[3] == 'scene.yaml:6:24: bodies.c.material: no material "stel" in this file (did you mean "steel"?)'
    assert told[4].startswith("scene.yaml:7:36: bodies.d.materials.rust: no material or part of that name in it")


@pytest.mark.parametrize(
    ("body", "told"),
    [
        ("{mesch: brick.stl}", 'bodies.a.mesch: is not a known key (did you mean "mesh"?)'),
        ("{}", "bodies.a: must have exactly one of mesh, box,"),
        ("{sphere: {radius: 1}, box: {size: [1, 1, 1]}}", "got box and sphere"),
        ("{sphere: {radius: 0 m}}", "bodies.a.sphere.radius: must be greater than 0"),
        ("{sphere: {radius: 1 kg}}", "bodies.a.sphere.radius: must be of length"),
        ("{sphere: {radius: 1}, pose: {position: [.nan, 0, 0]}}", "bodies.a.pose.position.0: must be a finite number"),
        ("{sphere: {radius: 1}, pose: {rpy: [0, 0, 0], quaternion: [1, 0, 0, 0]}}", "give rpy or quaternion, got both"),
        ("{sphere: {radius: 1}, pose: {quaternion: [1, 1, 0, 0]}}", "quaternion (w, x, y, z) must have length 1"),
        ("{sphere: {radius: 1}, material: {reflectance: 0}}", "must be greater than 0"),
        ("{plane: {normal: [0, 0, 0]}}", "bodies.a.plane.normal: must have a direction"),
    ],
)
def test_a_wrong_body_is_told_with_what_is_allowed(brick: Path, body: str, told: str) -> None:
    lines = mistakes(write(brick, f"version: 1\nbodies:\n  a: {body}\n"))
    assert any(told in line for line in lines), lines
    assert all(line.startswith("scene.yaml:3:") for line in lines), lines


def test_a_bare_mesh_file_is_a_world_of_one_body(brick: Path) -> None:
    world = load_world(brick / "brick.stl")
    assert list(world.bodies) == ["brick"]


def test_an_unknown_kind_of_scene_is_refused(tmp_path: Path) -> None:
    (tmp_path / "scene.blend").touch()
    with pytest.raises(SettingsError, match=r"scene.blend: is not a scene known here; allowed: \.yaml"):
        load_world(tmp_path / "scene.blend")


def test_the_example_in_the_readme_is_valid() -> None:
    readme = Path(__file__).parents[2] / "configs" / "scenes" / "README.md"
    example = readme.read_text().split("```yaml\n")[1].split("```")[0]
    scene = validate(SceneSettings, load_yaml(readme, example))
    assert set(scene.bodies) == {"wreck", "buoy", "floor"}


SCENES = sorted(
    file
    for kind in ("scene.yaml", "*.sdf")
    for file in (Path(__file__).parents[2] / "configs" / "scenes").glob(f"*/{kind}")
)


@pytest.mark.parametrize("file", SCENES, ids=[file.parent.name for file in SCENES])
def test_every_scene_that_comes_with_the_program_loads_without_a_warning(file: Path) -> None:
    world = load_world(file)
    assert world.bodies
    assert world.warnings == []
