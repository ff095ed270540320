"""SDF worlds written in the style of real ones: frames, includes, shapes, materials, limits."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from sonar_component.scene import World, load_world
from sonar_component.scene.pose import from_rpy
from sonar_component.scene.sdf import xml
from sonar_component.settings import SettingsError


@pytest.fixture(autouse=True)
def no_search_path_of_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    from sonar_component.scene.sdf.uri import VARIABLES

    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)


def world_of(folder: Path, inside: str, version: str = "1.9") -> World:
    file = folder / "w.sdf"
    file.write_text(f'<?xml version="1.0"?>\n<sdf version="{version}">\n<world name="w">\n{inside}\n</world>\n</sdf>\n')
    return load_world(file)


def model_in(folder: Path, name: str, inside: str, version: str = "1.6") -> Path:
    """A model's folder with its model.config."""
    home = folder / name
    home.mkdir(parents=True)
    (home / "model.config").write_text(f'<model><name>{name}</name><sdf version="{version}">model.sdf</sdf></model>')
    (home / "model.sdf").write_text(f'<sdf version="{version}"><model name="{name}">{inside}</model></sdf>')
    return home


def link(pose: str = "", name: str = "l", extra: str = "", shape: str = "<box><size>2 2 2</size></box>") -> str:
    return f'<link name="{name}">{pose}<visual name="v">{extra}<geometry>{shape}</geometry></visual></link>'


def place_of(world: World, body: str, part: int = 0) -> np.ndarray:
    found = world.bodies[body]
    return found.X_WB @ found.parts[part].X_BM


def bounds_of(world: World, body: str) -> np.ndarray:
    found = world.bodies[body]
    points = []
    for part in found.parts:
        X = found.X_WB @ part.X_BM
        points.append(part.mesh.vertices @ X[:3, :3].T + X[:3, 3])
    return np.array([np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)])


# ---------------------------------------------------------------- poses and frames


def test_poses_of_model_link_and_visual_follow_each_other(tmp_path: Path) -> None:
    visual = "<pose>0 0 1 0 0.2 0</pose>"
    body = f'<model name="m"><pose>1 2 3 0.1 0.2 0.3</pose>{link("<pose>4 0 0 0 0 0.5</pose>", extra=visual)}</model>'
    world = world_of(tmp_path, body)
    expected = (
        from_rpy((1, 2, 3), (0.1, 0.2, 0.3)) @ from_rpy((4, 0, 0), (0, 0, 0.5)) @ from_rpy((0, 0, 1), (0, 0.2, 0))
    )
    assert place_of(world, "m") == pytest.approx(expected)
    assert world.warnings == []


def test_degrees_and_quaternions_of_sdf_1_9(tmp_path: Path) -> None:
    world = world_of(
        tmp_path,
        f"""<model name="a"><pose degrees="true">1 2 3 0 0 90</pose>{link()}</model>
<model name="b"><pose rotation_format="quat_xyzw">1 2 3  0 0 0.70710678118 0.70710678118</pose>{link()}</model>""",
    )
    assert place_of(world, "a") == pytest.approx(from_rpy((1, 2, 3), (0, 0, np.pi / 2)))
    assert place_of(world, "b") == pytest.approx(place_of(world, "a"), abs=1e-10)  # eleven digits in the file


def test_relative_to_reaches_frames_links_joints_and_the_insides_of_models(tmp_path: Path) -> None:
    world = world_of(
        tmp_path,
        f"""
<frame name="dock"><pose>100 0 0 0 0 1.5707963267948966</pose></frame>
<model name="ship"><pose relative_to="dock">10 0 0 0 0 0</pose>
  <frame name="mast" attached_to="l"><pose>0 0 5 0 0 0</pose></frame>
  {link("<pose>1 0 0 0 0 0</pose>")}
  <joint name="hinge" type="fixed"><child>l2</child><pose>0 0 1 0 0 0</pose></joint>
  {link('<pose relative_to="mast">0 1 0 0 0 0</pose>', "l2")}
  {link('<pose relative_to="hinge">0 0 1 0 0 0</pose>', "l3")}
</model>
<model name="gull"><pose relative_to="ship::mast">0 0 2 0 0 0</pose>{link()}</model>
<model name="fish"><pose relative_to="gull">0 0 -20 0 0 0</pose>{link()}</model>
""",
    )
    # The dock turns X into Y: the ship lies at (100, 10, 0) and its X points along Y.
    assert place_of(world, "ship", 0)[:3, 3] == pytest.approx([100, 11, 0])
    assert place_of(world, "ship", 1)[:3, 3] == pytest.approx([99, 11, 5])
    assert place_of(world, "ship", 2)[:3, 3] == pytest.approx([99, 11, 7])
    assert place_of(world, "gull")[:3, 3] == pytest.approx([100, 11, 7])
    assert place_of(world, "fish")[:3, 3] == pytest.approx([100, 11, -13])
    assert world.warnings == []


def test_a_visual_may_be_relative_to_another_frame_of_its_model(tmp_path: Path) -> None:
    body = f'<frame name="f"><pose>5 0 0 0 0 0</pose></frame>{link("<pose>1 1 1 0 0 0</pose>", extra=POSE_IN_F)}'
    world = world_of(tmp_path, f'<model name="m">{body}</model>')
    assert place_of(world, "m")[:3, 3] == pytest.approx([5, 0, 2])


POSE_IN_F = '<pose relative_to="f">0 0 2 0 0 0</pose>'


def test_nested_models_are_parts_of_the_outer_one(tmp_path: Path) -> None:
    inner = f'<model name="arm"><pose>0 0 1 0 0 0</pose>{link(name="hand")}</model>'
    world = world_of(tmp_path, f'<model name="rov"><pose>7 0 0 0 0 0</pose>{link()}{inner}</model>')
    assert list(world.bodies) == ["rov"]
    assert {part.name for part in world.bodies["rov"].parts} == {"l::v", "arm::hand::v"}
    arm = next(part for part in world.bodies["rov"].parts if part.name == "arm::hand::v")
    assert (world.bodies["rov"].X_WB @ arm.X_BM)[:3, 3] == pytest.approx([7, 0, 1])


def test_frames_in_a_circle_are_told_and_the_rest_stands(tmp_path: Path) -> None:
    world = world_of(
        tmp_path,
        f"""<model name="a"><pose relative_to="b">1 0 0 0 0 0</pose>{link()}</model>
<model name="b"><pose relative_to="a">1 0 0 0 0 0</pose>{link()}</model>
<model name="c">{link()}</model>""",
    )
    assert list(world.bodies) == ["c"]
    assert "w.sdf:5: <model>: frames are relative to each other in a circle: a -> b -> a; left out" in world.warnings[0]


def test_an_unknown_frame_is_told_with_the_frames_that_there_are(tmp_path: Path) -> None:
    bad = link('<pose relative_to="mats">0 0 0 0 0 0</pose>', "l2")
    world = world_of(tmp_path, f'<model name="a">{link()}\n{bad}</model>')
    assert len(world.bodies["a"].parts) == 1
    assert "no frame 'mats' here; frames: l, l2; left out" in world.warnings[0]
    assert "w.sdf:5:" in world.warnings[0]


# ---------------------------------------------------------------- includes


BLOCK = link(shape="<box><size>1 2 3</size></box>")


def test_includes_take_another_name_pose_and_stillness(tmp_path: Path) -> None:
    model_in(tmp_path / "models", "block", f"<pose>9 9 9 0 0 0</pose>{BLOCK}")
    world = world_of(
        tmp_path,
        """<include><uri>model://block</uri></include>
<include><uri>model://block</uri><name>two</name><pose>1 0 0 0 0 0</pose><static>true</static></include>
<include><uri>file://models/block/model.sdf</uri><name>three</name><pose relative_to="two">0 1 0 0 0 0</pose></include>
<include><uri>https://fuel.gazebosim.org/1.0/someone/models/block</uri><name>four</name></include>""",
        "1.4",
    )
    assert world.warnings == []
    assert place_of(world, "block")[:3, 3] == pytest.approx([9, 9, 9])
    assert place_of(world, "two")[:3, 3] == pytest.approx([1, 0, 0])
    assert place_of(world, "three")[:3, 3] == pytest.approx([1, 1, 0])
    assert [world.bodies[name].moving for name in ("block", "two", "three", "four")] == [True, False, True, True]
    # The same file gives the same mesh: a thousand includes cost one.
    assert len({id(body.parts[0].mesh) for body in world.bodies.values()}) == 1


def test_includes_nest_and_merge_and_stand_on_a_placement_frame(tmp_path: Path) -> None:
    models = tmp_path / "models"
    model_in(models, "bolt", f'<frame name="tip"><pose>0 0 -1 0 0 0</pose></frame>{link(name="shank")}', "1.9")
    model_in(
        models,
        "plate",
        """<include><uri>model://bolt</uri><name>left</name><pose>-1 0 0 0 0 0</pose></include>
<include merge="true"><uri>model://bolt</uri><pose>1 0 0 0 0 0</pose></include>
<link name="tag"><pose relative_to="left::tip">0 0 0 0 0 0</pose>
  <visual name="v"><geometry><sphere><radius>0.1</radius></sphere></geometry></visual></link>
<link name="other"><pose relative_to="tip">0 0 0 0 0 0</pose>
  <visual name="v"><geometry><sphere><radius>0.1</radius></sphere></geometry></visual></link>""",
        "1.9",
    )
    world = world_of(
        tmp_path,
        """<include><uri>model://plate</uri><pose>0 0 10 0 0 0</pose></include>
<include><uri>model://bolt</uri><placement_frame>tip</placement_frame><pose>5 5 0 0 0 0</pose></include>""",
    )
    assert world.warnings == []
    parts = {
        part.name: (world.bodies["plate"].X_WB @ part.X_BM)[:3, 3].tolist() for part in world.bodies["plate"].parts
    }
    assert parts == {"left::shank::v": [-1, 0, 10], "shank::v": [1, 0, 10], "tag::v": [-1, 0, 9], "other::v": [1, 0, 9]}
    assert place_of(world, "bolt")[:3, 3] == pytest.approx([5, 5, 1])  # its tip stands at (5, 5, 0)


def test_a_model_merged_into_a_world_leaves_its_models_there_as_bodies_of_their_own(tmp_path: Path) -> None:
    model_in(tmp_path / "models", "bolt", link(), "1.10")
    model_in(
        tmp_path / "models",
        "field",
        """<frame name="corner"><pose>0 0 3 0 0 0</pose></frame>
<include><uri>model://bolt</uri><name>east</name><pose>4 0 0 0 0 0</pose></include>
<include><uri>model://bolt</uri><name>up</name><pose relative_to="corner"/><static>1</static></include>""",
        "1.10",
    )
    world = world_of(
        tmp_path,
        """<include merge="true"><uri>model://field</uri><pose>0 10 0 0 0 0</pose></include>
<include><uri>model://bolt</uri><name>mine</name><pose relative_to="corner">1 0 0 0 0 0</pose></include>
<include><uri>model://bolt</uri><name>east</name></include>""",
        "1.10",
    )
    assert list(world.bodies) == ["east", "up", "mine", "east_1"]
    assert [place_of(world, name)[:3, 3].tolist() for name in world.bodies] == [
        [4, 10, 0], [0, 10, 3], [1, 10, 3], [0, 0, 0],
    ]  # fmt: skip
    assert [body.moving for body in world.bodies.values()] == [True, False, True, True]
    assert len(world.warnings) == 1
    assert "the name 'east' is taken; called 'east_1' here" in world.warnings[0]


def test_joints_that_could_move_are_told_once(tmp_path: Path) -> None:
    def jointed(name: str, kind: str) -> str:
        joint = f'<joint name="j" type="{kind}"><parent>l</parent><child>m</child></joint>'
        return f'<model name="{name}">{link()}{link(name="m")}{joint}</model>'

    assert world_of(tmp_path, jointed("a", "fixed")).warnings == []
    world = world_of(tmp_path, jointed("a", "revolute") + jointed("b", "prismatic"))
    assert len(world.warnings) == 1
    assert "w.sdf:4: <joint>: does not move here" in world.warnings[0]


def test_models_are_found_by_property_and_by_environment(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model_in(tmp_path / "far", "near", BLOCK)
    model_in(tmp_path / "env", "wide", BLOCK)
    (tmp_path / "w").mkdir()
    file = tmp_path / "w" / "w.sdf"
    file.write_text(
        '<sdf version="1.6"><world name="w"><include><uri>model://near</uri></include>'
        "<include><uri>model://wide</uri></include></world></sdf>"
    )
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", str(tmp_path / "env"))
    world = load_world(file, search_path=[tmp_path / "far"])
    assert sorted(world.bodies) == ["near", "wide"]


def test_a_model_folder_is_read_in_its_newest_readable_version(tmp_path: Path) -> None:
    home = model_in(tmp_path, "m", BLOCK)
    (home / "old.sdf").write_text("<sdf version='1.4'><model name='old'/></sdf>")
    (home / "model.config").write_text(
        "<model><sdf version='1.4'>old.sdf</sdf><sdf version='1.6'>model.sdf</sdf>"
        "<sdf version='1.99'>x.sdf</sdf></model>"
    )
    assert list(load_world(home).bodies) == ["m"]


def test_includes_in_a_circle_end_with_a_warning(tmp_path: Path) -> None:
    models = tmp_path / "models"
    model_in(models, "a", f"{BLOCK}<include><uri>model://b</uri></include>")
    model_in(models, "b", f"{BLOCK}<include><uri>model://a</uri></include>")
    world = world_of(tmp_path, "<include><uri>model://a</uri></include>")
    assert len(world.bodies["a"].parts) == 2  # a's own and b's; a inside b is where it ends
    assert len(world.warnings) == 1
    assert (
        "models/b/model.sdf:1: <uri>: models include each other in a circle: a -> b -> a; left out" in world.warnings[0]
    )


def test_includes_that_double_at_each_level_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sonar_component.scene.sdf.world.MAX_INCLUDES", 500)  # to be quick
    models = tmp_path / "models"
    for k in range(20):  # 2^20 models if nobody counts
        twice = "".join(f"<include><uri>model://m{k + 1}</uri><name>{s}</name></include>" for s in "ab")
        model_in(models, f"m{k}", twice)
    model_in(models, "m20", BLOCK)
    world = world_of(tmp_path, "<include><uri>model://m0</uri></include>")
    assert len(world.bodies["m0"].parts) < 500
    assert any("too many includes: at most 500" in line for line in world.warnings)


def test_a_missing_model_is_told_and_the_rest_stands(tmp_path: Path) -> None:
    world = world_of(tmp_path, f'<include><uri>model://gone</uri></include><model name="m">{link()}</model>')
    assert list(world.bodies) == ["m"]
    assert "w.sdf:4: <uri>: 'model://gone' is not there; looked in" in world.warnings[0]


@pytest.mark.parametrize(
    "uri", ["file:///etc/passwd", "../../../etc/passwd", "model://../../secret.stl", "file://../secret.stl", "link.stl"]
)
def test_a_path_outside_the_search_path_is_not_read(tmp_path: Path, uri: str) -> None:
    trimesh.creation.box().export(tmp_path / "secret.stl")
    home = tmp_path / "a" / "b"
    home.mkdir(parents=True)
    (home / "link.stl").symlink_to(tmp_path / "secret.stl")
    mesh = link(shape=f"<mesh><uri>{uri}</uri></mesh>")
    world = world_of(home, f'<model name="m">{link()}{mesh}</model>')
    assert len(world.bodies["m"].parts) == 1
    assert "outside the search path" in world.warnings[0] or "is not there" in world.warnings[0]


# ---------------------------------------------------------------- shapes

SHAPES = {
    "box": ("<box><size>1 2 3</size></box>", [[-0.5, -1, -1.5], [0.5, 1, 1.5]]),
    "sphere": ("<sphere><radius>2</radius></sphere>", [[-2, -2, -2], [2, 2, 2]]),
    "cylinder": ("<cylinder><radius>1</radius><length>4</length></cylinder>", [[-1, -1, -2], [1, 1, 2]]),
    "capsule": ("<capsule><radius>1</radius><length>4</length></capsule>", [[-1, -1, -3], [1, 1, 3]]),
    "ellipsoid": ("<ellipsoid><radii>1 2 3</radii></ellipsoid>", [[-1, -2, -3], [1, 2, 3]]),
    "plane": ("<plane><normal>0 0 1</normal><size>4 6</size></plane>", [[-2, -3, 0], [2, 3, 0]]),
    "polyline": (
        "<polyline><point>0 0</point><point>4 0</point><point>4 1</point><point>1 1</point><point>1 3</point>"
        "<point>0 3</point><height>2</height></polyline>",
        [[0, 0, 0], [4, 3, 2]],
    ),
}


@pytest.mark.parametrize("name", SHAPES)
def test_every_shape_has_its_size(tmp_path: Path, name: str) -> None:
    text, bounds = SHAPES[name]
    world = world_of(tmp_path, f'<model name="m">{link(shape=text)}</model>')
    # Round shapes of 24 sides and more touch their extremes within 1 - cos(pi / 24) = 0.9 %.
    assert bounds_of(world, "m") == pytest.approx(np.array(bounds, float), abs=0.02)
    assert world.warnings == []


def test_an_l_shaped_polyline_is_a_closed_solid_of_its_volume(tmp_path: Path) -> None:
    world = world_of(tmp_path, f'<model name="m">{link(shape=SHAPES["polyline"][0])}</model>')
    mesh = world.bodies["m"].parts[0].mesh
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    solid.merge_vertices()
    assert solid.is_watertight
    assert solid.volume == pytest.approx((4 * 1 + 1 * 2) * 2)


def test_a_polyline_inside_another_is_a_hole_and_inside_that_an_island(tmp_path: Path) -> None:
    def ring(x: float, y: float, half: float) -> str:
        corners = [(x - half, y - half), (x - half, y + half), (x + half, y + half), (x + half, y - half)]
        points = "".join(f"<point>{a} {b}</point>" for a, b in corners)
        return f"<polyline>{points}<height>2</height></polyline>"

    shape = ring(0, 0, 5) + ring(-2, 1, 1.5) + ring(3, 0, 1) + ring(-2, 1, 0.5) + ring(20, 0, 1)
    world = world_of(tmp_path, f'<model name="m">{link(shape=shape)}</model>')
    mesh = world.bodies["m"].parts[0].mesh
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    solid.merge_vertices()
    assert solid.is_watertight
    assert solid.volume == pytest.approx(2 * (100 - 9 - 4 + 1 + 4))
    assert world.warnings == []


def test_a_heightmap_gives_its_height_to_its_brightest_pixel(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 100], [50, 0]], np.uint8)).save(tmp_path / "h.png")
    shape = "<heightmap><uri>file://h.png</uri><size>20 10 5</size><pos>1 2 -30</pos></heightmap>"
    world = world_of(tmp_path, f'<model name="m"><static>1</static>{link(shape=shape)}</model>')
    assert bounds_of(world, "m") == pytest.approx(np.array([[-9, -3, -30], [11, 7, -25]]))
    assert not world.bodies["m"].moving


def test_a_mesh_in_millimetres_is_scaled_and_a_submesh_centred(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box((1000, 2000, 3000)), node_name="hull")
    ball = trimesh.creation.icosphere(radius=500)
    ball.apply_translation((9000, 0, 0))
    scene.add_geometry(ball, node_name="dome")
    (tmp_path / "s.glb").write_bytes(scene.export(file_type="glb"))
    mesh = "<mesh><uri>s.glb</uri><scale>0.001 0.001 0.001</scale>{}</mesh>"
    centred = mesh.format("<submesh><name>dome</name><center>true</center></submesh>")
    wrong = mesh.format("<submesh><name>doom</name></submesh>")
    world = world_of(
        tmp_path,
        "".join(
            f'<model name="{name}">{link(shape=shape)}</model>'
            for name, shape in (("all", mesh.format("")), ("dome", centred), ("wrong", wrong))
        ),
    )
    assert bounds_of(world, "all") == pytest.approx(np.array([[-0.5, -1, -1.5], [9.5, 1, 1.5]]), abs=1e-6)
    assert bounds_of(world, "dome") == pytest.approx(np.array([[-0.5] * 3, [0.5] * 3]), abs=1e-6)
    assert "the mesh has no object 'doom'; objects: dome, hull; left out" in world.warnings[0]


def test_collisions_are_drawn_where_there_is_no_visual(tmp_path: Path) -> None:
    both = '<collision name="c"><geometry><box><size>9 9 9</size></box></geometry></collision>'
    only = f'<link name="l">{both}</link>'
    world = world_of(
        tmp_path,
        f'<model name="a">{link().replace("</link>", both + "</link>")}</model><model name="b">{only}</model>',
    )
    assert np.ptp(bounds_of(world, "a"), axis=0) == pytest.approx([2, 2, 2])
    assert np.ptp(bounds_of(world, "b"), axis=0) == pytest.approx([9, 9, 9])


# ---------------------------------------------------------------- materials


def test_reflectance_comes_from_the_innermost_element(tmp_path: Path) -> None:
    r = "<sonar:reflectance>{}</sonar:reflectance>"
    world = world_of(
        tmp_path,
        f"""<model name="m" xmlns:sonar="https://example.org/sonar">{r.format(0.5)}
{link(name="a")}
{link(name="b", extra="<material>" + r.format(1.4) + "</material>")}
{link(name="c", extra=r.format(2.1))}
{link(pose=r.format(3), name="d")}
</model><model name="n">{link(name="e")}</model>""",
    )
    found = {p.name[0]: p.material.reflectance for body in world.bodies.values() for p in body.parts}
    assert found == {"a": 0.5, "b": 1.4, "c": 2.1, "d": 3, "e": 1}
    assert world.warnings == []


def test_a_normal_map_and_the_name_of_a_script_are_kept(tmp_path: Path) -> None:
    Image.new("RGB", (4, 4), (128, 128, 255)).save(tmp_path / "n.png")
    pbr = "<material><pbr><metal><normal_map>n.png</normal_map></metal></pbr></material>"
    script = "<material><script><name>Gazebo/Wood</name></script></material>"
    world = world_of(tmp_path, f'<model name="m">{link(name="a", extra=pbr)}{link(name="b", extra=script)}</model>')
    a, b = world.bodies["m"].parts
    assert a.material.normal_map is not None
    assert a.mesh.uv is not None
    assert b.material.name == "Gazebo/Wood"
    assert world.warnings == []


def test_a_reflectance_map_is_our_own_element_and_stays_under_a_reflectance_of_the_scene(tmp_path: Path) -> None:
    Image.fromarray(np.arange(12, dtype=np.uint8).reshape(3, 4)).save(tmp_path / "rust.png")
    rust = "<material><sonar:reflectance_map>rust.png</sonar:reflectance_map></material>"
    lost = rust.replace("rust.png", "lost.png")
    world = world_of(tmp_path, f'<model name="m">{link(name="a", extra=rust)}{link(name="b", extra=lost)}</model>')
    (part,) = world.bodies["m"].parts
    assert part.material.reflectance_map is not None
    assert part.material.reflectance_map.tolist() == np.arange(12).reshape(3, 4).tolist()
    assert len(world.warnings) == 1
    assert "<sonar:reflectance_map>: 'lost.png' is not there" in world.warnings[0]
    (tmp_path / "scene.yaml").write_text("version: 1\nbodies: {hull: {sdf: w.sdf, material: {reflectance: 2}}}\n")
    over = load_world(tmp_path / "scene.yaml").bodies["hull"].parts[0].material
    assert over.reflectance == 2
    assert over.reflectance_map is not None


def test_a_scene_file_includes_a_world_and_dresses_it_by_material_name(tmp_path: Path) -> None:
    script = "<material><script><name>Gazebo/Wood</name></script></material>"
    world_of(tmp_path, f'<model name="m"><pose>1 0 0 0 0 0</pose>{link(extra=script)}{link(name="k")}</model>')
    model_in(tmp_path, "crate", BLOCK)
    (tmp_path / "scene.yaml").write_text(
        """version: 1
materials: {Gazebo/Wood: {reflectance: 0.4}}
include: [w.sdf]
bodies:
  box: {sdf: crate, pose: {position: [0, 0, 5 m]}, material: {reflectance: 2}}
"""
    )
    world = load_world(tmp_path / "scene.yaml")
    assert [part.material.reflectance for part in world.bodies["m"].parts] == [0.4, 1.0]
    assert world.bodies["box"].parts[0].material.reflectance == 2
    assert place_of(world, "box")[:3, 3] == pytest.approx([0, 0, 5])


# ---------------------------------------------------------------- bad files


def refused(file: Path) -> str:
    with pytest.raises(SettingsError) as caught:
        load_world(file)
    return str(caught.value)


def test_an_entity_bomb_is_refused_before_it_grows(tmp_path: Path) -> None:
    file = tmp_path / "bomb.sdf"
    entities = "".join(f'<!ENTITY l{k + 1} "{f"&l{k};" * 10}">' for k in range(9))
    file.write_text(
        f'<?xml version="1.0"?>\n<!DOCTYPE sdf [<!ENTITY l0 "lol">{entities}]>\n<sdf version="1.6">&l9;</sdf>'
    )
    assert refused(file) == f"{file}:2: declares a document type, which is not read because it can hold an entity bomb"


def test_a_bomb_in_an_included_model_costs_that_model_only(tmp_path: Path) -> None:
    home = model_in(tmp_path, "bomb", "")
    (home / "model.sdf").write_text('<!DOCTYPE sdf [<!ENTITY a "b">]><sdf version="1.6"/>')
    world = world_of(tmp_path, f'<include><uri>model://bomb</uri></include><model name="m">{link()}</model>')
    assert list(world.bodies) == ["m"]
    assert "declares a document type" in world.warnings[0]


def test_what_is_not_xml_or_not_sdf_is_refused_with_its_line(tmp_path: Path) -> None:
    file = tmp_path / "w.sdf"
    file.write_text("<sdf version='1.6'>\n<world>\n</sdf>")
    assert refused(file) == f"{file}:3:3: is not XML: mismatched tag"
    file.write_text("<robot/>")
    assert "is not SDF: the file must begin with <sdf>" in refused(file)
    file.write_text("")
    assert "is not XML: no element found" in refused(file)
    file.write_text("<a>" * (xml.MAX_DEPTH + 1))
    assert f"is nested deeper than {xml.MAX_DEPTH} elements" in refused(file)


def test_a_world_with_nothing_to_see_is_refused_with_the_reasons(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="holds nothing that a sonar can see") as caught:
        world_of(tmp_path, "<include><uri>model://gone</uri></include>")
    assert "'model://gone' is not there" in str(caught.value)


BAD_PARTS = {
    "<box><size>1 2</size></box>": "<size>: must be three lengths, got '1 2'",
    "<box><size>1 2 -3</size></box>": "<size>: must be three lengths greater than 0, got '1 2 -3'",
    "<box/>": "<box>: must hold <size>",
    "<sphere><radius>nan</radius></sphere>": "<radius>: must be a radius, got 'nan'",
    "<cone><radius>1</radius></cone>": "<cone>: is not a shape known here; allowed: box, sphere,",
    "<mesh><uri>broken.stl</uri></mesh>": "broken.stl: has no faces",
    "<mesh/>": "<mesh>: must hold <uri>",
    "<heightmap><uri>dot.png</uri></heightmap>": "a grid of heights must be at least 2 x 2, got 1 x 1",
    "<plane><normal>0 0 0</normal></plane>": "<normal>: must have a direction",
    "<polyline><point>0 0</point><height>1</height></polyline>": "an outline must have at least 3 different points",
}


@pytest.mark.parametrize("shape", BAD_PARTS)
def test_a_bad_part_is_told_with_file_and_line_and_the_rest_stands(tmp_path: Path, shape: str) -> None:
    (tmp_path / "broken.stl").write_bytes(b"\0" * 90)
    Image.fromarray(np.zeros((1, 1), np.uint8)).save(tmp_path / "dot.png")
    world = world_of(tmp_path, f'<model name="m">\n{link()}\n{link(shape=shape)}</model>')
    assert len(world.bodies["m"].parts) == 1
    assert "w.sdf:6: " in world.warnings[0]
    assert BAD_PARTS[shape] in world.warnings[0]


def test_what_is_not_read_is_listed_once_with_its_line(tmp_path: Path) -> None:
    twice = f'<model name="a">{link()}<skin/></model>\n<model name="b">{link()}<skin/></model>'
    world = world_of(
        tmp_path,
        f"""<physics type="ode"/><light name="sun"/><gui/>
<population name="p"/>
<stat/>
{twice}<gz:thing xmlns:gz="x"/>""",
        "1.12",
    )
    told = [line.split("w.sdf:")[1] for line in world.warnings]
    assert told == [
        "2: <sdf>: version must be 1.4 to 1.11, got '1.12'; read as if it were",
        "5: <population>: is not read: its copies are not in the picture",
        "6: <stat>: is not known inside <world> and not read",
        "7: <skin>: is not known inside <model> and not read",
    ]


def test_models_of_one_name_are_all_there(tmp_path: Path) -> None:
    world = world_of(tmp_path, f'<model name="a">{link()}</model><model name="a">{link()}</model>')
    assert list(world.bodies) == ["a", "a_1"]
    assert "the name 'a' is taken; called 'a_1' here" in world.warnings[0]
