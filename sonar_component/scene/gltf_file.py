"""What trimesh leaves out of glTF: extensions that nobody reads, integers that stand for fractions, scales of relief.

trimesh takes quantised attributes (KHR_mesh_quantization) at face value, also where the file calls them normalised, so
a mesh came out 32 767 times too large. Here those attributes become float32 before trimesh sees the file.
"""

from __future__ import annotations

import base64
import io
import json
import struct
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

READABLE = (
    "KHR_mesh_quantization",
    "KHR_texture_transform",
    "KHR_materials_",
    "EXT_texture_webp",
    "KHR_lights_punctual",
)
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_JSON, _BIN = 0x4E4F534A, 0x004E4942


def readable_gltf(path: Path) -> tuple[io.BytesIO, dict[str, float], list[str]]:
    """Return the file as trimesh can read it, the scale of each material's normal map where it is not 1, and warnings.

    Materials with such a scale get a name of their own where they have none or share it.

    Raises
    ------
    ValueError
        When the file is not glTF 2.0, or needs an extension that is not read here; says which.
    """
    tree, binary = _parsed(path)
    missing = [name for name in tree.get("extensionsRequired", []) if not str(name).startswith(READABLE)]
    if missing:
        raise ValueError(f"it needs the extension {' and '.join(missing)}, which is not read here")
    _decode_names(tree, path)
    _check_buffers(tree, path)
    warnings = []
    if "KHR_texture_transform" in tree.get("extensionsUsed", []):
        warnings.append("its texture transform is not read: normal maps may lie elsewhere")
    _unquantise(tree, binary, path)
    scales = _normal_scales(tree)
    text = json.dumps(tree).encode()
    if path.suffix.lower() == ".gltf":
        return io.BytesIO(text), scales, warnings
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", len(binary), _BIN) + binary
    return io.BytesIO(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks), scales, warnings


def _normal_scales(tree: dict[str, Any]) -> dict[str, float]:
    materials = tree.get("materials", [])
    names = [material.get("name") for material in materials]
    scales = {}
    for number, material in enumerate(materials):
        scale = float(material.get("normalTexture", {}).get("scale", 1.0))
        if scale != 1.0:
            if not names[number] or names.count(names[number]) > 1:
                material["name"] = f"{names[number] or 'material'}_{number}"
            scales[str(material["name"])] = scale
    return scales


def _parsed(path: Path) -> tuple[dict[str, Any], bytes]:
    """Return the JSON tree and the binary chunk (empty for a .gltf)."""
    data = path.read_bytes()
    binary = b""
    if path.suffix.lower() == ".glb":
        if len(data) < 20 or data[:4] != b"glTF" or struct.unpack_from("<I", data, 4)[0] != 2:
            raise ValueError("it does not begin like a glTF 2.0 file")
        length, kind = struct.unpack_from("<II", data, 12)
        if kind != _JSON or 20 + length > len(data):
            raise ValueError("its JSON chunk is cut off")
        data, rest = data[20 : 20 + length], data[20 + length :]
        if len(rest) >= 8 and struct.unpack_from("<I", rest, 4)[0] == _BIN:
            binary = rest[8 : 8 + struct.unpack_from("<I", rest, 0)[0]]
    tree = json.loads(data)
    if not isinstance(tree, dict) or not str(tree.get("asset", {}).get("version", "")).startswith("2"):
        raise ValueError("it does not say that it is glTF 2.0")
    return tree, binary


def _decode_names(tree: dict[str, Any], path: Path) -> None:
    """Write names of files as they are on the disk: in a URI a space is %20, which trimesh takes at face value."""
    for entry in [*tree.get("buffers", []), *tree.get("images", [])]:
        uri = str(entry.get("uri", "data:"))
        if not uri.startswith("data:") and not (path.parent / uri).exists():
            entry["uri"] = unquote(uri)


def _check_buffers(tree: dict[str, Any], path: Path) -> None:
    """Raise ValueError for a buffer in a file of its own that is not there, breaks off or lies outside its folder."""
    for buffer in tree.get("buffers", []):
        uri = str(buffer.get("uri", "data:"))
        if uri.startswith("data:"):
            continue
        target = _beside(uri, path)
        if not target.is_file():
            raise ValueError(f"it needs {uri!r} beside it, which is not there")
        promised, held = int(buffer.get("byteLength", 0)), target.stat().st_size
        if held < promised:
            raise ValueError(f"its {uri!r} breaks off: {promised} bytes are promised, it holds {held}")


def _unquantise(tree: dict[str, Any], binary: bytes, path: Path) -> None:
    """Replace normalised integer positions and texture coordinates by float32 in a buffer of their own."""
    data = b""
    for index in sorted(_normalised(tree)):
        accessor = tree["accessors"][index]
        values = _values(tree, accessor, binary, path)
        view = {"buffer": len(tree["buffers"]), "byteOffset": len(data), "byteLength": values.nbytes}
        tree["bufferViews"].append(view)
        accessor.update(bufferView=len(tree["bufferViews"]) - 1, byteOffset=0, componentType=5126, normalized=False)
        data += values.tobytes()
    if data:
        uri = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        tree["buffers"].append({"byteLength": len(data), "uri": uri})


def _normalised(tree: dict[str, Any]) -> set[int]:
    found = set()
    for mesh in tree.get("meshes", []):
        for primitive in mesh.get("primitives", []):
            for name, index in primitive.get("attributes", {}).items():
                if name == "POSITION" or name.startswith("TEXCOORD"):
                    accessor = tree["accessors"][index]
                    if accessor.get("normalized") and accessor["componentType"] != 5126 and "bufferView" in accessor:
                        found.add(index)
    return found


def _values(tree: dict[str, Any], accessor: dict[str, Any], binary: bytes, path: Path) -> np.ndarray[Any, Any]:
    """Return the fractions of an accessor (count, width) float32: max(c / max, -1) by glTF 2.0, section 3.11."""
    view = tree["bufferViews"][accessor["bufferView"]]
    buffer = tree["buffers"][view["buffer"]]
    data = binary if "uri" not in buffer else _fetched(buffer["uri"], path)
    dtype, width = np.dtype(_COMPONENTS[accessor["componentType"]]), _WIDTH[accessor["type"]]
    stride = view.get("byteStride", dtype.itemsize * width)
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    raw = np.ndarray((accessor["count"], width), dtype, data, start, (stride, dtype.itemsize))
    return np.maximum(raw / np.iinfo(dtype).max, -1.0).astype("<f4")


def _fetched(uri: str, path: Path) -> bytes:
    if uri.startswith("data:"):
        return base64.b64decode(uri.split(",", 1)[1])
    return _beside(uri, path).read_bytes()


def _beside(uri: str, path: Path) -> Path:
    """Where a URI points to; ValueError where that is not in the folder of the file."""
    target = (path.parent / uri).resolve()
    if not target.is_relative_to(path.parent.resolve()):
        raise ValueError(f"its buffer {uri!r} lies outside its folder")
    return target
