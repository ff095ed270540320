"""Mesh files of every kind, sound and broken."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh

from sonar_component.scene import mesh_file
from sonar_component.scene.body import Part
from sonar_component.scene.mesh_file import MeshOptions, read_mesh_file
from sonar_component.settings import SettingsError


def brick() -> trimesh.Trimesh:
    """1 x 2 x 3 m, off the origin, so that axes and signs show."""
    mesh = trimesh.creation.box((1, 2, 3))
    mesh.apply_translation((10, 20, 30))
    return mesh


def corners_of(parts: list[Part]) -> np.ndarray:
    points = [part.mesh.vertices @ part.X_BM[:3, :3].T + part.X_BM[:3, 3] for part in parts]
    return np.concatenate(points)


def bounds_of(parts: list[Part]) -> np.ndarray:
    points = corners_of(parts)
    return np.array([points.min(axis=0), points.max(axis=0)])


BOUNDS = np.array([[9.5, 19, 28.5], [10.5, 21, 31.5]])

COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>{asset}</asset>
  <library_geometries><geometry id="g" name="wedge"><mesh>
    <source id="p"><float_array id="pa" count="9">0 0 0 1 0 0 0 2 0</float_array><technique_common>
      <accessor source="#pa" count="3" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
      <param name="Z" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n"><translate>0 5 0</translate>
    <instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""


@pytest.mark.parametrize("suffix", ["obj", "stl", "ply", "glb", "gltf"])
def test_every_kind_of_file_gives_the_same_brick(tmp_path: Path, suffix: str) -> None:
    if suffix == "gltf":
        for name, data in trimesh.Scene(brick()).export(file_type="gltf").items():
            (tmp_path / ("brick.gltf" if name.endswith(".gltf") else name)).write_bytes(data)
    else:
        brick().export(tmp_path / f"brick.{suffix}")
    parts, warnings = read_mesh_file(tmp_path / f"brick.{suffix}")
    assert bounds_of(parts) == pytest.approx(BOUNDS, abs=1e-5)  # float32 files at 30 m
    assert sum(len(part.mesh.faces) for part in parts) == 12
    assert sum(len(part.mesh.vertices) for part in parts) == 24  # sharp edges
    assert warnings == []


def test_collada_is_turned_from_y_up_and_scaled_by_its_unit(tmp_path: Path) -> None:
    file = tmp_path / "w.dae"
    file.write_text(COLLADA.format(asset='<unit name="inch" meter="0.0254"/><up_axis>Y_UP</up_axis>'))
    parts, _ = read_mesh_file(file)
    # (x, y, z) with Y up is (x, -z, y) with Z up; the node lifts it by 5.
    expected = np.array([[0, 0, 5], [1, 0, 5], [0, 0, 7]]) * 0.0254
    assert corners_of(parts) == pytest.approx(expected, abs=1e-6)  # the grid of 1 um


@pytest.mark.parametrize(
    ("up", "expected"),
    [
        ("Z_UP", [[0, 5, 0], [1, 5, 0], [0, 7, 0]]),
        ("X_UP", [[-5, 0, 0], [-5, 0, 1], [-7, 0, 0]]),
    ],
)
def test_collada_with_other_up_axes(tmp_path: Path, up: str, expected: list[list[float]]) -> None:
    file = tmp_path / "w.dae"
    file.write_text(COLLADA.format(asset=f"<up_axis>{up}</up_axis>"))
    assert corners_of(read_mesh_file(file)[0]) == pytest.approx(np.array(expected, float), abs=1e-6)


def test_collada_with_entities_is_not_read(tmp_path: Path) -> None:
    file = tmp_path / "bomb.dae"
    bomb = COLLADA.format(asset="<up_axis>Z_UP</up_axis>").replace(
        '<?xml version="1.0"?>', '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]>'
    )
    file.write_text(bomb)
    with pytest.raises(SettingsError, match=r"bomb.dae: .*declares a document type"):
        read_mesh_file(file)


def test_collada_objects_keep_the_names_of_their_nodes_and_materials(tmp_path: Path) -> None:
    library = """<library_effects><effect id="e"><profile_COMMON><technique sid="common"><phong>
      <diffuse><color>1 0 0 1</color></diffuse></phong></technique></profile_COMMON></effect></library_effects>
  <library_materials><material id="m-id" name="rust"><instance_effect url="#e"/></material></library_materials>
  <library_geometries>"""
    bind = """<instance_geometry url="#g"><bind_material><technique_common>
      <instance_material symbol="s" target="#m-id"/></technique_common></bind_material></instance_geometry>"""
    node = f'<node id="n1" name="mast"><translate>0 5 0</translate>{bind}</node>'
    twin = f'<node id="n2" name="boom"><rotate>0 0 1 90</rotate>{bind}</node>'
    text = COLLADA.format(asset="<up_axis>Z_UP</up_axis>").replace("<library_geometries>", library)
    text = text.replace('<triangles count="1">', '<triangles count="1" material="s">')
    start, end = text.index('<node id="n">'), text.index("</node>") + len("</node>")
    file = tmp_path / "w.dae"
    file.write_text(text[:start] + node + twin + text[end:])
    parts, warnings = read_mesh_file(file)
    assert [(part.name, part.material.name) for part in parts] == [("mast", "rust"), ("boom", "rust")]
    assert parts[0].mesh is parts[1].mesh
    assert bounds_of(parts[1:]) == pytest.approx(np.array([[-2, 0, 0], [0, 1, 0]]), abs=1e-6)
    assert warnings == []


def test_normals_of_a_collada_file_are_kept(tmp_path: Path) -> None:
    normals = """<source id="q"><float_array id="qa" count="3">0 0.6 0.8</float_array><technique_common>
      <accessor source="#qa" count="1" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
      <param name="Z" type="float"/></accessor></technique_common></source><vertices"""
    text = COLLADA.format(asset="<up_axis>Z_UP</up_axis>").replace("<vertices", normals)
    text = text.replace('offset="0"/><p>0 1 2</p>', 'offset="0"/><input semantic="NORMAL" source="#q" offset="1"/>PPP')
    file = tmp_path / "w.dae"
    file.write_text(text.replace("PPP", "<p>0 0 1 0 2 0</p>"))
    mesh = read_mesh_file(file)[0][0].mesh
    assert mesh.normals == pytest.approx(np.tile([0, 0.6, 0.8], (3, 1)))


def test_a_ruined_object_is_left_out_and_the_others_stay(tmp_path: Path) -> None:
    (tmp_path / "s.obj").write_text(
        "o sound\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\no ruined\nv nan 0 0\nv 0 nan 0\nv 0 0 nan\nf 4 5 6\n"
    )
    parts, warnings = read_mesh_file(tmp_path / "s.obj")
    assert [part.name for part in parts] == ["sound"]
    assert warnings[-1] == "s.obj: 'ruined' has no faces, left out"


def test_too_many_faces_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_file, "MAX_FACES", 11)
    brick().export(tmp_path / "b.stl")
    with pytest.raises(SettingsError, match="has too many faces: at most 11, got 12"):
        read_mesh_file(tmp_path / "b.stl")


def test_a_file_in_millimetres_is_scaled_when_told(tmp_path: Path) -> None:
    trimesh.creation.box((1000, 2000, 3000)).export(tmp_path / "b.stl")
    parts, _ = read_mesh_file(tmp_path / "b.stl", MeshOptions(unit=1e-3))
    assert np.ptp(bounds_of(parts), axis=0) == pytest.approx([1, 2, 3])


def test_a_mirrored_scale_keeps_the_outside_outside(tmp_path: Path) -> None:
    brick().export(tmp_path / "b.ply")
    parts, _ = read_mesh_file(tmp_path / "b.ply", MeshOptions(scale=(-1, 1, 2)))
    mesh = parts[0].mesh
    assert bounds_of(parts) == pytest.approx(np.array([[-10.5, 19, 57], [-9.5, 21, 63]]))
    assert trimesh.Trimesh(mesh.vertices, mesh.faces).volume == pytest.approx(12)


def test_instances_of_a_scene_graph_share_one_mesh(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    ball = trimesh.creation.icosphere(subdivisions=2)
    scene.add_geometry(ball, geom_name="ball", node_name="left")
    turned = trimesh.transformations.euler_matrix(0.3, 0.2, 0.1)
    turned[:3, 3] = 1, 2, 3
    scene.graph.update("right", matrix=turned, geometry="ball")
    (tmp_path / "s.glb").write_bytes(scene.export(file_type="glb"))
    parts, _ = read_mesh_file(tmp_path / "s.glb")
    by_name = {part.name: part for part in parts}
    meshes = {id(part.mesh) for part in parts}
    assert len(parts) == 2
    assert len(meshes) == 1
    assert by_name["right"].X_BM == pytest.approx(turned, abs=1e-6)  # glTF holds float32


def test_a_sheared_node_is_baked_into_the_vertices_with_true_normals(tmp_path: Path) -> None:
    scene = trimesh.Scene()
    ball = trimesh.creation.icosphere(subdivisions=4)
    squeezed = np.diag([1.0, 2.0, 0.5, 1.0])
    scene.add_geometry(ball, node_name="egg", transform=squeezed)
    (tmp_path / "s.glb").write_bytes(scene.export(file_type="glb", include_normals=True))
    parts, _ = read_mesh_file(tmp_path / "s.glb")
    mesh = parts[0].mesh
    gradient = mesh.vertices / np.array([1, 4, 0.25])
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    # Smoothed normals of triangles of 4.4 deg, stretched fourfold, stay within a fifth of a triangle.
    assert np.einsum("ij,ij->i", mesh.normals, gradient).min() > np.cos(np.radians(4.4 * 4 / 5))


def test_objects_of_an_obj_keep_their_names_and_materials(tmp_path: Path) -> None:
    (tmp_path / "s.mtl").write_text("newmtl steel\nKd 1 0 0\nnewmtl sand\nKd 0 1 0\n")
    (tmp_path / "s.obj").write_text(
        "mtllib s.mtl\no plate\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl steel\nf 1 2 3\n"
        "o floor\nv 0 0 5\nv 1 0 5\nv 0 1 5\nusemtl sand\nf 4 5 6\n"
    )
    parts, _ = read_mesh_file(tmp_path / "s.obj")
    assert {(part.name, part.material.name) for part in parts} == {("plate", "steel"), ("floor", "sand")}


def test_a_normal_map_of_a_gltf_comes_with_texture_coordinates(tmp_path: Path) -> None:
    from PIL import Image

    relief = np.random.default_rng(1).integers(0, 255, (8, 16, 3)).astype(np.uint8)
    material = trimesh.visual.material.PBRMaterial(name="plates", normalTexture=Image.fromarray(relief))
    mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
    mesh.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [0, 1]], material=material)
    (tmp_path / "s.glb").write_bytes(trimesh.Scene(mesh).export(file_type="glb"))
    part = read_mesh_file(tmp_path / "s.glb")[0][0]
    assert part.material.name == "plates"
    assert part.material.normal_map is not None
    assert np.array_equal(part.material.normal_map, relief)
    assert part.mesh.uv is not None
    assert part.mesh.uv == pytest.approx(np.array([[0, 0], [1, 0], [0, 1]]))


def test_the_scale_of_a_gltf_normal_map_makes_its_slopes_steeper(tmp_path: Path) -> None:
    from PIL import Image

    slope = np.broadcast_to(np.array([128 + 51, 128, 128 + 116], np.uint8), (4, 4, 3))  # 0.4, 0, 0.916
    file = tmp_path / "s.gltf"
    for name in ("", "plates"):
        material = trimesh.visual.material.PBRMaterial(name=name, normalTexture=Image.fromarray(slope))
        mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False)
        mesh.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [0, 1]], material=material)
        files = trimesh.Scene(mesh).export(file_type="gltf")
        tree = json.loads(files.pop("model.gltf"))
        tree["materials"][0]["normalTexture"]["scale"] = 0.5
        if not name:
            del tree["materials"][0]["name"]
        file.write_text(json.dumps(tree))
        for other, data in files.items():
            (tmp_path / other).write_bytes(data)
        relief = read_mesh_file(file)[0][0].material.normal_map
        assert relief is not None
        x, y, z = (relief[0, 0].astype(float) - 128) / 127
        assert x / z == pytest.approx(0.5 * 51 / 116, abs=0.006)  # 8 bits: half of 1/127 above and below
        assert y == 0
        assert x * x + z * z == pytest.approx(1, abs=0.01)


def test_a_normal_map_of_an_obj_is_found_beside_its_material(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (4, 4), (128, 128, 255)).save(tmp_path / "n.png")
    (tmp_path / "s.mtl").write_text("newmtl plates\nnorm n.png\n")
    (tmp_path / "s.obj").write_text(
        "mtllib s.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl plates\nf 1/1 2/2 3/3\n"
    )
    part = read_mesh_file(tmp_path / "s.obj")[0][0]
    assert part.material.normal_map is not None
    assert part.material.normal_map.shape == (4, 4, 3)
    assert part.mesh.uv is not None


def test_a_quantised_gltf_is_read_at_its_true_size(tmp_path: Path) -> None:
    # KHR_mesh_quantization: positions as normalised int16, scaled back by the node.
    positions = np.array([[0, 0, 0, 0], [32767, 0, 0, 0], [0, 32767, 0, 0]], "<i2").tobytes()
    indices = np.array([0, 1, 2, 0], "<u2").tobytes()
    tree = {
        "asset": {"version": "2.0", "generator": "mikedh/trimesh"},
        "extensionsUsed": ["KHR_mesh_quantization"],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "scale": [4, 4, 4]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5122, "normalized": True, "count": 3, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 24, "byteStride": 8},
            {"buffer": 0, "byteOffset": 24, "byteLength": 8},
        ],
        "buffers": [{"byteLength": 32}],
    }
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    blob = positions + indices
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    (tmp_path / "q.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    parts, _ = read_mesh_file(tmp_path / "q.glb")
    assert bounds_of(parts) == pytest.approx(np.array([[0, 0, 0], [4, 4, 0]]), abs=1e-6)


def test_a_gltf_of_another_tool_says_that_it_may_lie_on_its_side(tmp_path: Path) -> None:
    data = trimesh.Scene(brick()).export(file_type="glb").replace(b"mikedh/trimesh", b"another/toolx1")
    (tmp_path / "b.glb").write_bytes(data)
    _, warnings = read_mesh_file(tmp_path / "b.glb")
    assert "glTF is Y up by its standard" in warnings[0]
    parts, warnings = read_mesh_file(tmp_path / "b.glb", MeshOptions(up="y"))
    assert warnings == []
    assert bounds_of(parts) == pytest.approx(np.array([[9.5, -31.5, 19], [10.5, -28.5, 21]]))


BROKEN = {
    "broken.glb": b"glTF junk",
    "broken.stl": b"\0" * 90,
    "broken.ply": b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nend_header\n",
    "broken.obj": b"no mesh at all\n",
    "points.obj": b"v 0 0 0\nv 1 0 0\n",
    "broken.dae": b"<COLLADA>",
    "broken.gltf": b"{}",
    "empty.stl": b"",
    "half.glb": struct.pack("<4sII", b"glTF", 2, 4096) + struct.pack("<II", 4000, 0x4E4F534A) + b'{"asset":',
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_refused_in_one_line_that_names_it(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(BROKEN[name])
    with pytest.raises(SettingsError) as caught:
        read_mesh_file(tmp_path / name)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_gltf_with_an_extension_that_is_not_read_says_which(tmp_path: Path) -> None:
    tree = {"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}
    (tmp_path / "d.gltf").write_text(json.dumps(tree))
    with pytest.raises(SettingsError, match="it needs the extension KHR_draco_mesh_compression"):
        read_mesh_file(tmp_path / "d.gltf")


def test_a_huge_file_is_refused_before_it_is_read(tmp_path: Path) -> None:
    with (tmp_path / "huge.stl").open("wb") as file:
        file.truncate(2 << 30)  # sparse: takes no room
    with pytest.raises(SettingsError, match=f"is too large: at most {mesh_file.MAX_BYTES >> 20} MiB, got 2048 MiB"):
        read_mesh_file(tmp_path / "huge.stl")


def test_an_unknown_kind_of_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"allowed: \.obj"):
        read_mesh_file(tmp_path / "thing.max")
