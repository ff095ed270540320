"""World <-> SceneDescription: bodies laid out as flat arrays, and back.

The content hash leaves out the poses of bodies and whether they move: a body that moves does not change what must be
loaded.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sonar_component.samples.scene_description import BodyPoses, SceneDescription
from sonar_component.scene.body import Body, Part
from sonar_component.scene.material import Material
from sonar_component.scene.mesh import Mesh

_NOT_HASHED = ("time", "content_hash", "body_poses", "body_moving")


def from_bodies(bodies: Sequence[Body], warnings: Sequence[str], time: int) -> SceneDescription:
    """Lay the bodies out as flat arrays; meshes, materials and textures that are shared are written once."""
    parts = [(i, part) for i, body in enumerate(bodies) for part in body.parts]
    meshes = _Shared([part.mesh for _, part in parts])
    materials = _Shared([part.material for _, part in parts])
    normal_maps = [m.normal_map for m in materials.items]
    reflectance_maps = [m.reflectance_map for m in materials.items]
    textures = _Shared([t for t in [*normal_maps, *reflectance_maps] if t is not None])
    names = {
        "bodies": [body.name for body in bodies],
        "parts": [part.name for _, part in parts],
        "materials": [material.name for material in materials.items],
        "warnings": list(warnings),
    }
    sample = SceneDescription(
        time=time,
        content_hash="",
        text=json.dumps(names),
        body_poses=np.array([body.X_WB for body in bodies], np.float64).reshape(-1, 4, 4),
        body_moving=np.array([body.moving for body in bodies], np.int64),
        part_body=np.array([i for i, _ in parts], np.int64),
        part_mesh=np.array([meshes.index(part.mesh) for _, part in parts], np.int64),
        part_material=np.array([materials.index(part.material) for _, part in parts], np.int64),
        part_poses=np.array([part.X_BM for _, part in parts], np.float64).reshape(-1, 4, 4),
        vertex_start=_starts([len(mesh.vertices) for mesh in meshes.items]),
        face_start=_starts([len(mesh.faces) for mesh in meshes.items]),
        vertices=_stack([mesh.vertices for mesh in meshes.items], 3, np.float64),
        normals=_stack([mesh.normals for mesh in meshes.items], 3, np.float32),
        uv=_stack([_uv_or_nan(mesh) for mesh in meshes.items], 2, np.float32),
        faces=_stack([mesh.faces for mesh in meshes.items], 3, np.int32),
        reflectance=np.array([material.reflectance for material in materials.items], np.float64),
        normal_map=np.array([textures.index(t) for t in normal_maps], np.int64),
        reflectance_map=np.array([textures.index(t) for t in reflectance_maps], np.int64),
        texture_shape=np.array([(*t.shape, 1)[:3] for t in textures.items], np.int64).reshape(-1, 3),
        texture_start=_starts([t.size for t in textures.items]),
        texels=np.concatenate([np.zeros(0, np.uint8), *(t.ravel() for t in textures.items)]),
    )
    sample.content_hash = _hash(sample)
    return sample


def to_bodies(sample: SceneDescription) -> tuple[list[Body], list[str]]:
    """Build the bodies again; ValueError when arrays contradict each other or the content hash."""
    sample.validate()
    if sample.content_hash != _hash(sample):
        raise ValueError("the scene description was damaged on its way: its content hash does not match its arrays")
    names = json.loads(sample.text)
    meshes = [_mesh(sample, i) for i in range(len(sample.vertex_start) - 1)]
    textures = [_texture(sample, i) for i in range(len(sample.texture_shape))]
    materials = [
        Material(name, float(sample.reflectance[i]), _pick(textures, sample.normal_map[i]),
                 _pick(textures, sample.reflectance_map[i]))
        for i, name in enumerate(names["materials"])
    ]  # fmt: skip
    bodies = [
        Body(name, [], sample.body_poses[i].copy(), bool(sample.body_moving[i]))
        for i, name in enumerate(names["bodies"])
    ]
    for i, name in enumerate(names["parts"]):
        mesh, material = meshes[sample.part_mesh[i]], materials[sample.part_material[i]]
        bodies[sample.part_body[i]].parts.append(Part(mesh, material, sample.part_poses[i].copy(), name))
    return bodies, list(names["warnings"])


def poses_of(bodies: Sequence[Body], content_hash: str, time: int) -> BodyPoses:
    """Gather X_WB of all bodies."""
    poses = np.array([body.X_WB for body in bodies], np.float64).reshape(-1, 4, 4)
    return BodyPoses(time, content_hash, poses)


class _Shared:
    """Distinct objects in order of first sight, by identity."""

    def __init__(self, items: Sequence[Any]) -> None:
        self.items: list[Any] = list({id(item): item for item in items}.values())
        self._index = {id(item): i for i, item in enumerate(self.items)}

    def index(self, item: object | None) -> int:
        return -1 if item is None else self._index[id(item)]


def _starts(lengths: Sequence[int]) -> NDArray[np.int64]:
    return np.concatenate([[0], np.cumsum(lengths, dtype=np.int64)]).astype(np.int64)


def _stack(arrays: Sequence[NDArray[Any]], columns: int, dtype: Any) -> NDArray[Any]:
    return np.concatenate([np.zeros((0, columns), dtype), *arrays]).astype(dtype, copy=False)


def _uv_or_nan(mesh: Mesh) -> NDArray[np.float32]:
    return mesh.uv if mesh.uv is not None else np.full((len(mesh.vertices), 2), np.nan, np.float32)


def _mesh(sample: SceneDescription, i: int) -> Mesh:
    rows = slice(sample.vertex_start[i], sample.vertex_start[i + 1])
    uv = sample.uv[rows]
    faces = sample.faces[sample.face_start[i] : sample.face_start[i + 1]]
    has_uv = len(uv) > 0 and not np.isnan(uv).any()
    return Mesh(sample.vertices[rows], sample.normals[rows], faces, uv if has_uv else None)


def _texture(sample: SceneDescription, i: int) -> NDArray[np.uint8]:
    h, w, channels = (int(n) for n in sample.texture_shape[i])
    texels = sample.texels[sample.texture_start[i] : sample.texture_start[i + 1]]
    return texels.reshape((h, w, channels) if channels > 1 else (h, w))


def _pick(textures: Sequence[NDArray[np.uint8]], index: int) -> NDArray[np.uint8] | None:
    return None if index < 0 else textures[index]


def _hash(sample: SceneDescription) -> str:
    digest = hashlib.sha256()
    for name, value in vars(sample).items():
        if name in _NOT_HASHED:
            continue
        digest.update(name.encode())
        if isinstance(value, str):
            digest.update(value.encode())
        else:
            digest.update(str(value.shape).encode())
            digest.update(np.ascontiguousarray(value).tobytes())
    return digest.hexdigest()
