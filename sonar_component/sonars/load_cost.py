"""What a large world costs before its first ping: reading, describing for other processes, going into GPU memory.

Each file is read in a process of its own, since a peak of memory cannot be taken back.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sonar_component.scene.terrain import terrain

KINDS = ("ply", "stl", "npy")


def load_costs(
    triangles: int = 500_000, kinds: Sequence[str] = KINDS, tick: Callable[[], None] = lambda: None
) -> list[dict[str, Any]]:
    """Load a rolling sea floor of so many triangles from each kind of file.

    Returns
    -------
    list of {"file", "triangles", "file_mb", "load_s", "peak_mb", "held_mb", "describe_s", "upload_s", "gpu_mb"}
        Memory beyond what the process had when all was imported: its peak while loading, and what is held after it.
    """
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for kind in kinds:
            path, count, size = write_floor(Path(folder), kind, triangles)
            command = [sys.executable, "-m", __name__, str(path)]
            found = subprocess.run(command, capture_output=True, text=True, check=True)
            rows.append({"file": kind, "triangles": count, "file_mb": size / 1e6, **json.loads(found.stdout)})
            tick()
    return rows


def write_floor(folder: Path, kind: str, triangles: int) -> tuple[Path, int, int]:
    """Write a rolling floor as a mesh file ("ply", "stl") or as a scene with heights ("npy").

    Returns
    -------
    What to load, its number of triangles, and the size of the file that holds them [B].
    """
    side = round(np.sqrt(triangles / 2)) + 1
    y, x = np.mgrid[0:side, 0:side] * (200.0 / side)
    heights = np.sin(x / 7) * np.cos(y / 5) + 0.1 * np.sin(x * 1.7)
    data = folder / f"floor.{kind}"
    if kind == "npy":
        np.save(data, heights)
        scene = folder / "scene.yaml"
        scene.write_text("version: 1\nbodies:\n  floor: {terrain: {heights: floor.npy, size: [200 m, 200 m, 1 m]}}\n")
        return scene, 2 * (side - 1) ** 2, data.stat().st_size
    mesh = terrain(heights, (200.0, 200.0, 1.0))
    corners = mesh.vertices[mesh.faces].astype("<f4")
    if kind == "stl":
        rows = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
        rows["corners"] = corners
        data.write_bytes(b"\0" * 80 + np.uint32(len(rows)).tobytes() + rows.tobytes())
    else:
        faces = np.zeros(len(mesh.faces), [("count", "u1"), ("corners", "<i4", 3)])
        faces["count"], faces["corners"] = 3, mesh.faces
        head = (
            "ply\nformat binary_little_endian 1.0\n"
            f"element vertex {len(mesh.vertices)}\nproperty float x\nproperty float y\nproperty float z\n"
            f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
        )
        data.write_bytes(head.encode() + mesh.vertices.astype("<f4").tobytes() + faces.tobytes())
    return data, len(mesh.faces), data.stat().st_size


def load_cost(path: Path) -> dict[str, float]:
    """Load a world in this process and say what it took."""
    import sonar_component.scene.trimesh_file  # noqa: F401  (the half second of its import is not the world's)
    from sonar_component.gl import create_context
    from sonar_component.render.geometry import Geometry
    from sonar_component.scene import load_world

    context = create_context()
    geometry = Geometry(context)
    Path("/proc/self/clear_refs").write_text("5", encoding="ascii")  # the peak begins anew from here
    before, clock = _memory("VmRSS"), time.perf_counter()
    world = load_world(path)
    loaded = time.perf_counter()
    peak, held = _memory("VmHWM") - before, _memory("VmRSS") - before
    world.to_description(0)
    described = time.perf_counter()
    geometry.update(world)
    context.finish()
    uploaded = time.perf_counter()
    assert geometry.loaded is not None
    gpu = geometry.loaded.bytes / 1e6
    return {
        "load_s": loaded - clock, "peak_mb": peak, "held_mb": held, "describe_s": described - loaded,
        "upload_s": uploaded - described, "gpu_mb": gpu,
    }  # fmt: skip


def _memory(which: str) -> float:
    """Memory of this process now, VmRSS, or at its peak, VmHWM [MB]."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{which}:")) * 1024 / 1e6


if __name__ == "__main__":
    sys.stdout.write(json.dumps(load_cost(Path(sys.argv[1]))))
