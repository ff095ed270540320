"""What a mesh file promises in its header, held against what is there: half a download must not pass as whole.

Readers differ in what they make of half a file: an empty mesh, a mesh with fewer faces, an AssertionError. OBJ and
XML promise nothing beforehand; an OBJ that breaks off between two faces cannot be told from a smaller one.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path

_STL_HEADER, _STL_FACE = 84, 50  # [B], of a binary STL
_TAIL = 1 << 12  # [B], in which an ASCII STL ends
_GLB_HEADER = 12  # [B]
_HEAD = 1 << 16  # [B], more than any header of a PLY
_PLY_ROWS = re.compile(rb"^element\s+(\w+)\s+(\d+)", re.MULTILINE)


def check_whole(path: Path) -> None:
    """Raise ValueError that says what is missing where a file holds less than it promises."""
    kind = path.suffix[1:].lower()
    if kind == "stl":
        _check_stl(path)
    elif kind == "glb":
        _check_glb(path)
    elif kind == "ply":
        _check_ply(path)


def _check_stl(path: Path) -> None:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_STL_HEADER)
        file.seek(max(size - _TAIL, 0))
        tail = file.read().lower()
    faces = struct.unpack_from("<I", head, 80)[0] if len(head) == _STL_HEADER else 0
    held = max(size - _STL_HEADER, 0) // _STL_FACE
    # Binary files may begin with the same word; a line of its own tells ASCII, unless the size is that of a binary one.
    if head.lstrip()[:5].lower() == b"solid" and b"\n" in head and held != faces:
        if b"endsolid" not in tail:
            raise ValueError("it breaks off: its last solid does not end")
    elif len(head) < _STL_HEADER:
        raise ValueError(f"it breaks off: a binary STL begins with {_STL_HEADER} bytes, got {len(head)}")
    elif held < faces:
        raise ValueError(f"it breaks off: it promises {faces} faces and holds {held}")


def _check_glb(path: Path) -> None:
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(_GLB_HEADER)
    if len(head) == _GLB_HEADER and head[:4] == b"glTF":
        (length,) = struct.unpack_from("<I", head, 8)
        if size < length:
            raise ValueError(f"it breaks off: it promises {length} bytes and holds {size}")


def _check_ply(path: Path) -> None:
    with path.open("rb") as file:
        header, end, _ = file.read(_HEAD).partition(b"end_header")
        if not end or b"format ascii" not in header:
            return  # trimesh counts the bytes of a binary one
        rows = sum(int(count) for _, count in _PLY_ROWS.findall(header))
        file.seek(len(header) + len(end))
        held = sum(1 for line in file if line.strip())
    if held < rows:
        raise ValueError(f"it breaks off: it promises {rows} lines of vertices and faces and holds {held}")
