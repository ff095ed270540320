"""Make the meshes of the SDF world in configs/scenes/harbour: a quay, a jetty's boat, mooring blocks, a seabed.

    python tools/make_harbour_scene.py      writes configs/scenes/harbour/seabed.png and models/*/meshes/*

Each mesh is of another kind, as worlds from several hands have them: glTF with texture coordinates and a normal map
inside (quay), COLLADA in centimetres with Y up (boat), STL in millimetres (mooring block). The same script gives the
same bytes.
"""

from __future__ import annotations

from pathlib import Path

import make_scene_solids as s
import numpy as np
import trimesh
from PIL import Image

OUT = Path(__file__).resolve().parent.parent / "configs" / "scenes" / "harbour"
SEED = 1907


def seabed() -> None:
    """129 x 129 heights: mud, a dredged channel, a scour below the quay."""
    n = 129
    rng = np.random.default_rng(SEED)
    axis = np.linspace(-32, 32, n)
    x, _ = np.meshgrid(axis, axis[::-1])
    heights = 1.0 + s.rough((n, n), (14, 4, 1.6), (0.25, 0.09, 0.035), rng)
    heights -= 0.6 * np.exp(-(((x - 2) / 7) ** 2)) + 0.45 * np.exp(-(((x - 14.5) / 1.6) ** 2))
    heights = np.clip(heights / heights.max(), 0, 1)
    Image.fromarray(np.rint(heights * 65535).astype(np.uint16)).save(OUT / "seabed.png", optimize=True)


def quay() -> None:
    """A wall of sheet piles along Y with a capping beam and fenders; its face lies at x = 0 and looks along -X."""
    y = np.arange(-20, 20.001, 0.125)
    wave = 0.21 * np.clip(1.6 * np.sin(2 * np.pi * y / 1.4), -1, 1)
    z = np.linspace(-10, 0.2, 15)
    Y, Z = np.meshgrid(y, z)
    # Rows run up, columns to the right seen from the water: from +Y to -Y.
    points = np.stack([np.broadcast_to(wave, Y.shape), Y, Z], -1)[:, ::-1]
    wall = s.grid(points)
    wall_mesh = trimesh.Trimesh(wall.vertices.astype(np.float32), wall.faces, process=False)
    rng = np.random.default_rng(SEED + 1)
    relief = s.rough((256, 256), (9, 3, 1.1), (0.010, 0.007, 0.002), rng)  # barnacles and rust, 2 m a side
    picture = Image.fromarray(s.normal_map(relief, 2.0 / 256))
    material = trimesh.visual.material.PBRMaterial(name="rusty_sheet_pile", normalTexture=picture)
    uv = np.stack([-wall.vertices[:, 1] / 2.0, wall.vertices[:, 2] / 2.0], 1)
    wall_mesh.visual = trimesh.visual.TextureVisuals(uv=uv, material=material)
    solids: list[s.Solid] = [s.box((1.4, 40.4, 1.1), (0.35, 0, 0.6))]
    solids += [s.rod((-0.42, py, -2.6), (-0.42, py, 0.8), 0.28, 20) for py in np.arange(-18, 18.1, 6)]
    for py in np.arange(-15, 15.1, 10):  # ladders
        solids += [s.rod((-0.38, py + side, -6.0), (-0.38, py + side, 0.9), 0.035, 10) for side in (-0.22, 0.22)]
        solids += [s.rod((-0.38, py - 0.22, pz), (-0.38, py + 0.22, pz), 0.02, 8) for pz in np.arange(-5.8, 0.8, 0.3)]
    rest = s.welded(s.join(solids))
    rest_mesh = trimesh.Trimesh(rest.vertices.astype(np.float32), rest.faces, process=False)
    rest_mesh.visual = trimesh.visual.TextureVisuals(material=trimesh.visual.material.PBRMaterial(name="concrete"))
    scene = trimesh.Scene()
    scene.add_geometry(wall_mesh, geom_name="wall", node_name="wall")
    scene.add_geometry(rest_mesh, geom_name="cap_and_fenders", node_name="cap_and_fenders")
    write("quay", "quay.glb", scene.export(file_type="glb"))


def boat() -> None:
    """A small fishing boat afloat: hull, keel, rudder, propeller, wheelhouse; waterline at z = 0."""
    station, girth = np.meshgrid(np.linspace(0, 1, 41), np.linspace(-1, 1, 25), indexing="ij")
    bow = np.clip((station - 0.55) / 0.45, 0, 1)
    stern = np.clip((0.2 - station) / 0.2, 0, 1)
    half = 1.7 * (1 - bow**2.3) * (1 - 0.25 * stern**2)
    bottom = -1.15 + 0.55 * bow**2 + 0.7 * stern**2
    top = 0.75 + 0.65 * bow**2
    y = half * np.sign(girth) * np.abs(np.sin(girth * np.pi / 2)) ** 0.75
    z = bottom + (top - bottom) * (1 - np.cos(girth * np.pi / 2)) ** 0.9
    x = (station - 0.5) * 9.5 + 0.6 * bow**2 * np.abs(girth)
    hull = s.grid(np.stack([x, y, z], -1))
    solids = [hull, s.box((7.6, 0.16, 0.5), (-0.3, 0, -1.25)), s.box((0.5, 0.07, 1.0), (-4.75, 0, -0.75))]
    solids.append(s.grid(np.stack([x[0], y[0], z[0]], -1)[:, None] * np.array([[1, 1, 1], [1, 0, 1]])[None]))
    solids += [s.box((2.0, 2.0, 1.7), (-1.8, 0, 1.45)), s.rod((1.5, 0, 0.3), (1.5, 0, 4.6), [0.09, 0.05], 12)]
    for a in (0, 120, 240):
        blade = s.moved(s.box((0.05, 0.22, 0.4), (0, 0, 0.28), (0, 0, 30)), (0, 0, 0), (a, 0, 0))
        solids.append(s.moved(blade, (-4.45, 0, -0.8)))
    whole = s.welded(s.join(solids))
    vertices = np.round(whole.vertices[:, [0, 2, 1]] * (100, 100, -100), 1)  # centimetres, Y up
    a, b, c = (vertices[whole.faces[:, k]] for k in range(3))
    faces = whole.faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0]  # the keel line closes on itself
    write("boat", "boat.dae", collada(vertices, faces, "boat", "glass_fibre").encode())


def collada(vertices: np.ndarray, faces: np.ndarray, node: str, material: str) -> str:
    """A COLLADA file in centimetres with Y up, by hand: short, and with the names that a modeller would give."""
    numbers = " ".join(f"{value:.1f}".removesuffix(".0") for value in vertices.ravel())
    indices = " ".join(map(str, faces.ravel()))
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset>
    <created>2026-01-01T00:00:00</created><modified>2026-01-01T00:00:00</modified>
    <unit name="centimeter" meter="0.01"/><up_axis>Y_UP</up_axis>
  </asset>
  <library_effects><effect id="fx"><profile_COMMON><technique sid="common"><lambert>
    <diffuse><color>0.8 0.8 0.8 1</color></diffuse></lambert></technique></profile_COMMON></effect></library_effects>
  <library_materials><material id="m" name="{material}"><instance_effect url="#fx"/></material></library_materials>
  <library_geometries><geometry id="g" name="{node}"><mesh>
    <source id="p"><float_array id="pa" count="{vertices.size}">{numbers}</float_array><technique_common>
      <accessor source="#pa" count="{len(vertices)}" stride="3"><param name="X" type="float"/>
        <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles count="{len(faces)}" material="s"><input semantic="VERTEX" source="#v" offset="0"/>
      <p>{indices}</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="scene"><node id="n" name="{node}"><instance_geometry url="#g">
    <bind_material><technique_common><instance_material symbol="s" target="#m"/></technique_common></bind_material>
  </instance_geometry></node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#scene"/></scene>
</COLLADA>
"""


def mooring_block() -> None:
    """A concrete block with an eye and chain, in millimetres; its foot is z = 0."""
    x, y = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]).T * 0.75
    rings = [(1.0, 0.0), (1.0, 0.45), (0.72, 0.8)]
    sections = np.stack([np.stack([x * k, y * k, np.full(4, z)], 1) for k, z in rings])
    solids = [s.loft(sections), s.ring((0, 0, 0.95), (0, 1, 0), 0.2, 0.045, 24)]
    for k in range(9):
        p = (0.12 * k, 0.03 * k, 1.15 + 0.12 * k)
        solids.append(s.moved(s.ring((0, 0, 0), (0, 1, 0), 0.11, 0.025, 16), p, (0, -45, 90 * (k % 2))))
    whole = s.join(solids)
    mesh = trimesh.Trimesh(whole.vertices * 1000, whole.faces, process=False)
    write("mooring_block", "mooring_block.stl", mesh.export(file_type="stl"))


def write(model: str, name: str, data: bytes) -> None:
    file = OUT / "models" / model / "meshes" / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_bytes(data)
    print(f"{file.relative_to(OUT)}: {len(data) / 1e3:.0f} kB")


if __name__ == "__main__":
    OUT.mkdir(parents=True, exist_ok=True)
    for make in (seabed, quay, boat, mooring_block):
        make()
