"""Make the demo's scene: a broken coaster on a rolling sea floor, a pipeline half buried, and a valve station.

    python tools/make_wreck_scene.py            writes configs/scenes/wreck_site/*.glb and seafloor.png

Everything is parametric and seeded: the same script gives the same bytes. X runs ahead, Y to the left, Z up; the sea's
surface is z = 0 and the floor lies around z = -20 m.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import make_scene_solids as s
import numpy as np
from PIL import Image

OUT = Path(__file__).resolve().parent.parent / "configs" / "scenes" / "wreck_site"
SEED = 1898
FLOOR = -20.0  # [m], mean depth of the floor
EXTENT, SAMPLES, RELIEF = 120.0, 221, 8.0  # [m], [-], [m]: 0.55 m between heights, 96 800 triangles; white is 8 m up
WRECK = (17.0, 4.5)  # [m], where the hull lies
MANIFOLD = (10.5, -11.5)

LENGTH, BREADTH, DEPTH = 24.0, 5.8, 3.2  # [m], hull
STATIONS, GIRTH = 97, 19  # [-], samples along and around the hull
BREAK = (0.53, 0.62)  # [-], where the hull is torn, as a share of its length from the stern


Solids = list[s.Solid]

# ---------------------------------------------------------------- sea floor


def floor_heights() -> np.ndarray:
    """Heights (rows, columns) [m] above FLOOR - RELIEF / 2, first row at greatest Y."""
    rng = np.random.default_rng(SEED)
    heights = s.rough((SAMPLES, SAMPLES), (34, 12, 4.5, 1.6), (0.75, 0.22, 0.09, 0.045), rng)
    axis = np.linspace(-EXTENT / 2, EXTENT / 2, SAMPLES)
    x, y = np.meshgrid(axis, axis[::-1])
    heights += 0.018 * (x - 20)  # the bottom comes up slowly ahead
    ridge = np.exp(-(((y - 24 - 0.25 * x) / 4.5) ** 2))  # a rocky ridge on the left
    heights += ridge * (1.3 + 1.1 * s.rough((SAMPLES, SAMPLES), (5, 1.8), (0.5, 0.25), rng))
    d = np.hypot(x - WRECK[0], (y - WRECK[1]) * 0.6)
    heights += -0.55 * np.exp(-((d - 7.0) ** 2) / 8) + 0.3 * np.exp(-(d**2) / 30)  # scour around the wreck, sand inside
    p = pipeline_path()
    near = np.min([np.hypot(x - a, y - b) for a, b in p[:, :2]], axis=0)
    heights += 0.22 * np.exp(-((near - 1.1) ** 2) / 0.5) - 0.15 * np.exp(-(near**2) / 0.6)  # berms beside the pipeline
    return np.clip(heights + RELIEF / 2, 0, RELIEF)


def ground(heights: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Height of the floor [m] at points."""
    column = (np.asarray(x, float) + EXTENT / 2) / EXTENT * (SAMPLES - 1)
    row = (EXTENT / 2 - np.asarray(y, float)) / EXTENT * (SAMPLES - 1)
    i, j = np.clip(row.astype(int), 0, SAMPLES - 2), np.clip(column.astype(int), 0, SAMPLES - 2)
    a, b = row - i, column - j
    h = heights
    mixed = (h[i, j] * (1 - b) + h[i, j + 1] * b) * (1 - a) + (h[i + 1, j] * (1 - b) + h[i + 1, j + 1] * b) * a
    return mixed + FLOOR - RELIEF / 2


def boulders(heights: np.ndarray) -> list[s.Solid]:
    rng = np.random.default_rng(SEED + 1)
    solids = []
    while len(solids) < 70:
        x, y = rng.uniform(4, 48), rng.uniform(-26, 30)
        radius = 0.18 + 0.75 * rng.random() ** 3.5
        on_ridge = np.exp(-(((y - 24 - 0.25 * x) / 5) ** 2))
        if rng.random() > 0.22 + on_ridge or np.hypot(x - WRECK[0], y - WRECK[1]) < 9 or x < 7:
            continue
        z = ground(heights, x, y) + 0.2 * radius
        stone = s.boulder(radius * (1 + 0.6 * on_ridge), rng, 3 if radius > 0.7 else 2)
        solids.append(s.moved(stone, (x, y, z), rng.uniform(0, 360, 3)))
    return solids


# ---------------------------------------------------------------- wreck


def hull_point(station: np.ndarray, girth: np.ndarray, side: float) -> np.ndarray:
    """A point of the hull: station 0 stern to 1 bow, girth 0 keel to 1 rail; X forward, keel at z = 0."""
    bow = np.clip((station - 0.62) / 0.38, 0, 1)
    stern = np.clip((0.24 - station) / 0.24, 0, 1)
    fullness = (1 - bow**2.2) * (1 - 0.38 * stern**2)
    sheer = DEPTH + 1.25 * bow**2 + 0.45 * stern**2
    rise = 0.9 * stern**1.5 + 0.25 * bow**3  # the run under the stern, the forefoot
    sharp = 2.6 - 1.5 * bow - 1.1 * stern  # a round bilge amidships, V sections at the ends
    y = BREADTH / 2 * fullness * np.sin(girth * np.pi / 2) ** (1 / np.maximum(sharp, 0.7))
    z = rise + (sheer - rise) * (1 - np.cos(girth * np.pi / 2)) ** 0.85
    y = np.maximum(y + 0.35 * bow**2 * girth**2, 0.04)  # flare
    x = (station - 0.5) * LENGTH + 1.3 * bow**2 * girth - 0.7 * stern**2 * girth  # raked stem, overhanging stern
    return np.stack([x, side * y, z], -1)


def plating(stations: np.ndarray, holes: list[tuple[float, float, float, float]], side: float, torn: float) -> s.Solid:
    """One side of the shell plating; holes are (station, girth, half length, half height)."""
    girth = np.linspace(0, 1, GIRTH)
    st, gi = np.meshgrid(stations, girth, indexing="ij")
    mid_s, mid_g = (st[1:, 1:] + st[:-1, :-1]) / 2, (gi[1:, 1:] + gi[:-1, :-1]) / 2
    keep = np.ones(mid_s.shape, bool)
    for hs, hg, ls, lg in holes:
        edge = 1 + 0.35 * np.sin(9 * np.arctan2((mid_g - hg) / lg, (mid_s - hs) / ls))
        keep &= ((mid_s - hs) / ls) ** 2 + ((mid_g - hg) / lg) ** 2 > edge
    jagged = 0.018 * np.sin(23 * mid_g + 5 * side) + 0.012 * np.sin(57 * mid_g)
    keep &= (mid_s - torn + jagged) * np.sign(stations.mean() - torn) > 0
    points = hull_point(st, gi, side)
    # Sunken plates between the frames: the sea has pressed them in.
    points[..., 1] -= side * 0.035 * np.sin(st * LENGTH / 0.75 * np.pi) ** 2 * np.sin(gi * np.pi)
    return s.grid(points, keep)


def frames(first: float, last: float) -> list[s.Solid]:
    """Ribs, stringers and keel between two stations."""
    solids = []
    girth = np.linspace(0.02, 1, 15)
    for station in np.arange(first, last, 0.75 / LENGTH):
        for side in (-1, 1):
            p = hull_point(np.full_like(girth, station), girth, side)
            p[:, 1] -= side * np.minimum(0.09, np.abs(p[:, 1]) * 0.5)
            solids.append(s.sweep(p, lambda _s: s.bar(0.11, 0.18)))
    along = np.linspace(first, last, 40)
    for g in (0.42, 0.68, 0.9):
        for side in (-1, 1):
            p = hull_point(along, np.full_like(along, g), side)
            p[:, 1] -= side * np.minimum(0.16, np.abs(p[:, 1]) * 0.5)
            solids.append(s.sweep(p, lambda _s: s.bar(0.12, 0.12)))
    keel = hull_point(along, np.zeros_like(along), 1)
    keel[:, 1] = 0
    solids.append(s.sweep(keel, lambda _s: s.bar(0.35, 0.45)))
    rails = [hull_point(along, np.ones_like(along), side) for side in (-1, 1)]
    return solids + [s.sweep(rail, lambda _s: s.bar(0.22, 0.12)) for rail in rails]


def deck(
    first: float, last: float, openings: list[tuple[float, float, float]], rng: np.random.Generator
) -> list[s.Solid]:
    """Deck plates with beams below; openings are (station, half length, half width [m])."""
    along, across = np.linspace(first, last, 61), np.linspace(-1, 1, 17)
    st, ac = np.meshgrid(along, across, indexing="ij")
    rail = hull_point(st, np.full_like(st, 0.92), 1)
    points = np.stack([rail[..., 0], rail[..., 1] * ac * 0.99, rail[..., 2] + 0.1 * (1 - ac**2)], -1)
    mid, y = (st[1:, 1:] + st[:-1, :-1]) / 2, (points[1:, 1:, 1] + points[:-1, :-1, 1]) / 2
    keep = np.ones(mid.shape, bool)
    for station, half_length, half_width in openings:
        keep &= (np.abs(mid - station) > half_length) | (np.abs(y) > half_width)
    rotten = s.rough(mid.shape, (3.0,), (1.0,), rng)
    keep &= rotten < 1.25  # planks that have gone
    solids = [s.grid(points, keep)]
    for k in range(2, 60, 4):
        line = points[k].copy()
        line[:, 2] -= 0.14
        if keep[min(k, 59), 8] or k % 8 == 2:
            solids.append(s.sweep(line, lambda _s: s.bar(0.12, 0.22)))
    for station, half_length, half_width in openings:  # coamings
        x0, x1 = (station - half_length - 0.5) * LENGTH, (station + half_length - 0.5) * LENGTH
        z = float(hull_point(np.array(station), np.array(0.92), 1)[2]) + 0.3
        corners = [(x0, -half_width), (x1, -half_width), (x1, half_width), (x0, half_width), (x0, -half_width)]
        for (ax, ay), (bx, by) in itertools.pairwise(corners):
            solids.append(s.beam((ax, ay, z), (bx, by, z), 0.08, 0.6))
    return solids


def house(size: tuple[float, float, float], windows: int) -> list[s.Solid]:
    """A deck house: four walls with window openings, a roof that overhangs."""
    length, width, height = size
    solids = []
    for along, position, turn in (
        (length, (0, width / 2), 0),
        (length, (0, -width / 2), 0),
        (width, (length / 2, 0), 90),
        (width, (-length / 2, 0), 90),
    ):
        columns = 4 * windows + 1
        u, v = np.meshgrid(np.linspace(-along / 2, along / 2, columns), np.linspace(0, height, 9))
        keep = np.ones((8, columns - 1), bool)
        keep[4:7] = (np.arange(columns - 1) % 4 == 0) | (np.arange(columns - 1) % 4 == 3)
        wall = s.grid(np.stack([u, np.zeros_like(u), v], -1), keep)
        solids.append(s.moved(wall, (*position, 0), (0, 0, turn)))
    solids.append(s.box((length + 0.4, width + 0.4, 0.08), (0, 0, height)))
    return solids


def stern_half(rng: np.random.Generator) -> list[s.Solid]:
    stations = np.linspace(0, BREAK[0] + 0.03, 56)
    solids = [plating(stations, [(0.34, 0.72, 0.045, 0.16), (0.15, 0.5, 0.02, 0.12)], 1, BREAK[0])]
    solids += [plating(stations, [(0.30, 0.62, 0.07, 0.24), (0.44, 0.8, 0.03, 0.14)], -1, BREAK[0])]
    solids += frames(0.02, BREAK[0] + 0.02)
    solids += deck(0.01, BREAK[0] - 0.02, [(0.42, 0.07, 1.5)], rng)
    z = DEPTH - 0.05
    cabin = house((4.4, 3.6, 2.0), 4)
    solids += [s.moved(w, (-0.27 * LENGTH, 0, z + 0.3)) for w in cabin]
    bridge = house((2.2, 3.0, 1.7), 3)
    solids += [s.moved(w, (-0.24 * LENGTH, 0, z + 2.35)) for w in bridge]
    funnel = s.tube(np.array([[-8.1, 0, z + 2.2], [-8.25, 0, z + 4.0]]), [0.62, 0.55], 20)
    solids.append(funnel)
    transom = hull_point(np.zeros(GIRTH), np.linspace(0, 1, GIRTH), 1)
    mirror = transom * (1, -1, 1)
    solids.append(s.grid(np.stack([transom, (transom + mirror) / 2, mirror], 0)))
    shaft = np.array([[-9.0, 0, 0.75], [-11.6, 0, 0.75]])
    solids.append(s.tube(shaft, 0.16, 12))
    for a in np.arange(4) * 90:  # propeller
        blade = s.box((0.05, 0.42, 0.95), (0, 0, 0.62), (0, 0, 28))
        solids.append(s.moved(s.moved(blade, (0, 0, 0), (a + 15, 0, 0)), (-11.6, 0, 0.75)))
    solids.append(s.box((0.95, 0.1, 2.0), (-12.5, 0, 1.15), (0, 0, 12)))  # rudder
    return solids


def bow_half(rng: np.random.Generator) -> list[s.Solid]:
    stations = np.linspace(BREAK[1] - 0.03, 1.0, 48)
    solids = [plating(stations, [(0.75, 0.7, 0.045, 0.2)], 1, BREAK[1])]
    solids += [plating(stations, [(0.70, 0.55, 0.04, 0.3), (0.84, 0.75, 0.03, 0.15)], -1, BREAK[1])]
    solids += frames(BREAK[1] - 0.02, 0.975)
    solids += deck(BREAK[1] + 0.03, 0.955, [(0.72, 0.05, 1.3)], rng)
    z = DEPTH + 0.75
    solids += [s.rod((8.0, -0.9, z), (8.0, 0.9, z), 0.28, 16), s.box((0.9, 0.15, 0.8), (8, 1.0, z - 0.1))]
    solids += [s.box((0.9, 0.15, 0.8), (8, -1.0, z - 0.1))]  # anchor winch
    for y in (-0.9, 0.9):  # bollards
        for x in (6.7, 7.1):
            solids.append(s.rod((x, y * 1.3, z - 0.6), (x, y * 1.3, z), 0.13, 10))
    solids.append(s.rod((10.2, 0, 4.4), (13.6, 0, 5.0), [0.12, 0.06], 10))  # what is left of the bowsprit
    anchor = [s.rod((0, 0, 0), (0, 0, -1.5), 0.08, 8), s.beam((-0.5, 0, -0.1), (0.5, 0, -0.1), 0.09, 0.09)]
    arms = s.bend([(-0.75, 0, -0.85), (-0.5, 0, -1.5), (0.5, 0, -1.5), (0.75, 0, -0.85)], 0.4)
    anchor.append(s.tube(arms, 0.08, 8))
    solids += [s.moved(part, (9.9, -1.25, 3.2), (0, 0, 40)) for part in anchor]
    return solids


def mast() -> list[s.Solid]:
    """The main mast with crosstree, derrick and stays, along X, before it is laid down."""
    solids = [s.rod((0, 0, 0), (11.5, 0, 0), [0.24, 0.11], 14)]
    solids.append(s.beam((8.2, -1.1, 0), (8.2, 1.1, 0), 0.12, 0.12))
    solids.append(s.rod((1.0, 0.1, 0.3), (7.4, 2.3, 0.9), [0.15, 0.09], 12))
    for y in (-1.0, 1.0):
        solids.append(s.rod((8.2, y, 0), (0.4, y * 2.4, -0.2), 0.025, 5))
        for x in np.linspace(1.5, 7.2, 10):  # ratlines
            w = 2.4 - 1.4 * (x - 0.4) / 7.8
            solids.append(s.rod((x, y * w, 0), (x, 0.1 * y, 0.05), 0.018, 5))
    solids.append(s.ring((9.6, 0, 0), (1, 0, 0), 0.45, 0.06, 20))  # the crow's nest's hoops
    solids.append(s.ring((10.4, 0, 0), (1, 0, 0), 0.45, 0.05, 20))
    for a in np.arange(8) * np.pi / 4:
        p = (0.45 * np.cos(a), 0.45 * np.sin(a))
        solids.append(s.rod((9.6, *p), (10.4, *p), 0.03, 5))
    return solids


def debris(heights: np.ndarray) -> list[s.Solid]:
    """Plates, beams and a boiler between and beside the halves."""
    rng = np.random.default_rng(SEED + 2)
    solids = []
    for _ in range(46):
        x, y = np.asarray(WRECK) + rng.normal(0, (4.2, 4.6))
        z = float(ground(heights, x, y))
        turn = rng.uniform(-1, 1, 3) * (18, 18, 180)
        if rng.random() < 0.55:
            n = 7
            u, v = np.meshgrid(np.linspace(-0.5, 0.5, n), np.linspace(-0.5, 0.5, n))
            bent = 0.25 * (u * u) + 0.12 * u * v + 0.02 * rng.standard_normal(u.shape)
            plate = s.grid(np.stack([u * rng.uniform(0.8, 2.2), v * rng.uniform(0.5, 1.4), bent], -1))
            solids.append(s.moved(plate, (x, y, z + 0.12), turn))
        else:
            length = rng.uniform(1.0, 3.0)
            solids.append(s.moved(s.box((length, 0.14, 0.2)), (x, y, z + 0.12), turn))
    boiler = [s.rod((-1.5, 0, 0), (1.5, 0, 0), 1.05, 32)]
    boiler += [s.rod((1.5, 0.45 * a, -0.3), (1.58, 0.45 * a, -0.3), 0.28, 16) for a in (-1, 1)]
    boiler += [s.ring((x, 0, 0), (1, 0, 0), 1.05, 0.05, 40) for x in (-1.45, -0.5, 0.5, 1.45)]
    x, y = WRECK[0] - 5.2, WRECK[1] + 1.2
    solids += [s.moved(b, (x, y, float(ground(heights, x, y)) + 0.75), (0, 4, 52)) for b in boiler]
    return solids


def wreck(heights: np.ndarray) -> dict[str, tuple[list[s.Solid], str]]:
    rng = np.random.default_rng(SEED + 3)
    x, y = WRECK
    z = float(ground(heights, x, y))
    # The stern half lies broadside to the sonar, heeled away; the bow half has turned and fallen on its side.
    stern = [s.moved(part, (x + 2.0, y + 4.2, z - 0.75), (13, -3, -68)) for part in stern_half(rng)]
    bow = [s.moved(part, (x - 1.3, y - 0.4, z - 0.35), (22, 3, -104)) for part in bow_half(rng)]
    fallen = [s.moved(part, (x + 1.2, y + 2.4, z + 2.5), (0, 12, -152)) for part in mast()]
    return {
        "stern": (stern, "rusted_steel"),
        "bow": (bow, "rusted_steel"),
        "mast": (fallen, "wood"),
        "debris": (debris(heights), "rusted_steel"),
    }


# ---------------------------------------------------------------- pipeline and valve station


def pipeline_path() -> np.ndarray:
    """The pipeline's way over the floor (n, 2), from the valve station to far right ahead, and back to the left."""
    corners = [(MANIFOLD[0] + 3.2, MANIFOLD[1] - 0.6, 0), (20, -13, 0), (31, -8, 0), (44, -16, 0), (58, -18, 0)]
    path = s.bend(corners, 9.0, 14)
    length = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    even = np.arange(0, length[-1], 0.5)
    return np.stack([np.interp(even, length, path[:, k]) for k in range(2)], 1)


def pipeline(heights: np.ndarray) -> dict[str, tuple[list[s.Solid], str]]:
    xy = pipeline_path()
    z = ground(heights, xy[:, 0], xy[:, 1])
    # A pipe is stiff: it follows the floor only over tens of metres, so it is buried here and spans there.
    kernel = np.hanning(25) / np.hanning(25).sum()
    z = np.convolve(np.pad(z, 12, mode="edge"), kernel, "valid")
    path = np.column_stack([xy, z + 0.16])
    path[:6, 2] += np.linspace(0.5, 0, 6)
    solids = [s.tube(path, 0.36, 20)]
    solids += [s.tube(path[k - 1 : k + 1], 0.42, 20) for k in range(4, len(path) - 4, 24)]  # field joints
    solids += [s.tube(path[k : k + 2], 0.40, 20) for k in range(14, len(path) - 4, 24)]  # bracelet anodes
    supports = []
    for k in range(9, len(path) - 2, 22):
        p, t = path[k], path[k + 1] - path[k - 1]
        yaw = np.degrees(np.arctan2(t[1], t[0]))
        foot = float(ground(heights, p[0], p[1]))
        parts = [s.box((0.5, 2.2, 0.25), (0, 0, foot - p[2] + 0.05)), s.box((0.35, 0.2, 1.1), (0, 0.55, -0.2))]
        parts += [s.box((0.35, 0.2, 1.1), (0, -0.55, -0.2)), s.box((0.35, 1.3, 0.16), (0, 0, 0.42))]
        supports += [s.moved(part, p, (0, 0, yaw)) for part in parts]
    for k in (33, 36):  # a concrete mattress: blocks on ropes over the pipe
        p, t = path[k], path[k + 1] - path[k - 1]
        yaw = np.degrees(np.arctan2(t[1], t[0]))
        for i in np.arange(-6, 7):
            for j in np.arange(-1, 2):
                sag = 0.42 - 0.105 * abs(i) ** 1.25
                supports.append(s.moved(s.box((0.42, 0.3, 0.2), (j * 0.48, i * 0.36, max(sag, -0.5))), p, (0, 0, yaw)))
    return {"pipe": (solids, "coated_steel"), "supports": (supports, "concrete")}


def manifold(heights: np.ndarray) -> dict[str, tuple[list[s.Solid], str]]:
    """A valve station: mud mat, frame with braces, headers, six gate valves with hand wheels."""
    frame, piping = [], []
    le, w, h = 2.4, 1.7, 2.5
    frame.append(s.box((2 * le + 1.2, 2 * w + 1.0, 0.18), (0, 0, 0)))
    for x in (-le, 0, le):
        frame += [s.rod((x, y, 0), (x, y, h), 0.11, 12) for y in (-w, w)]
        frame.append(s.rod((x, -w, h), (x, w, h), 0.09, 12))
    for y in (-w, w):
        frame += [s.rod((-le, y, z), (le, y, z), 0.09, 12) for z in (0.3, h)]
        frame += [s.rod((-le, y, 0.3), (0, y, h), 0.06, 10), s.rod((0, y, h), (le, y, 0.3), 0.06, 10)]
    for x in (-le, le):
        frame += [s.rod((x, -w, 0.3), (x, w, h), 0.06, 10)]
    for x in np.arange(-le, le + 0.01, 0.6):  # the roof's bars against trawls
        frame.append(s.rod((x, -w, h), (x, w, h), 0.035, 8))
    for side, y in ((-1, -0.75), (1, 0.75)):
        header = s.bend(
            [(-le - 0.9, y, 0.75), (le - 0.3, y, 0.75), (le - 0.3, y, 1.6), (le - 0.3, 0.1 * side, 1.6)], 0.35
        )
        piping.append(s.tube(header, 0.16, 16))
        piping += s.flange((-le - 0.9, y, 0.75), (1, 0, 0), 0.3, 0.07)
        for x in (-1.4, 0.2):
            piping += s.valve((x, y, 0.75), (1, 0, 0), (0, 0, 1), 0.17)
    for x in (-0.6, 1.1):
        piping.append(
            s.tube(s.bend([(x, -0.75, 0.75), (x, -0.75, 1.35), (x, 0.75, 1.35), (x, 0.75, 0.75)], 0.3), 0.12, 14)
        )
        piping += s.valve((x, 0, 1.35), (0, 1, 0), (0, 0, 1), 0.13)
    out = s.bend([(le - 0.3, 0.1, 1.6), (le - 0.3, -0.6, 1.6), (le + 0.5, -0.6, 1.5), (le + 0.9, -0.6, 0.9)], 0.35)
    piping.append(s.tube(out, 0.2, 16))
    piping += s.flange((le + 0.9, -0.6, 0.85), (0.4, 0, -1), 0.42, 0.08)
    x, y = MANIFOLD
    place = (x, y, float(ground(heights, x, y)) + 0.1)
    return {
        "frame": ([s.moved(p, place, (0, 0, 8)) for p in frame], "painted_steel"),
        "piping": ([s.moved(p, place, (0, 0, 8)) for p in piping], "painted_steel"),
    }


def main() -> None:
    OUT.mkdir(parents=True, exist_ok=True)
    heights = floor_heights()
    Image.fromarray(np.rint(heights / RELIEF * 65535).astype(np.uint16)).save(OUT / "seafloor.png", optimize=True)
    for name, objects in (
        ("wreck", wreck(heights)),
        ("pipeline", pipeline(heights)),
        ("valve_station", manifold(heights)),
        ("boulders", {"boulders": (boulders(heights), "rock")}),
    ):
        file = OUT / f"{name}.glb"
        triangles = s.save_glb(str(file), objects)
        print(f"{file.name}: {triangles} triangles, {file.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
