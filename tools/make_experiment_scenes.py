"""Make the scenes of the six classic experiments and the vehicle that carries the sonars.

    python tools/make_experiment_scenes.py    writes configs/scenes/{auv,materials,target,isolation_valve,...}

Everything is parametric and seeded: the same script gives the same bytes. X ahead, Y left, Z up, in metres.
"""

from __future__ import annotations

from pathlib import Path

import make_scene_solids as s
import numpy as np
from PIL import Image

ROOT = Path(__file__).resolve().parent.parent / "configs" / "scenes"
SEED = 2017
Solids = list[s.Solid]


def save(scene: str, name: str, objects: dict[str, tuple[Solids, str]]) -> None:
    (ROOT / scene).mkdir(parents=True, exist_ok=True)
    file = ROOT / scene / f"{name}.glb"
    triangles = s.save_glb(str(file), objects)
    print(f"{scene}/{file.name}: {triangles} triangles, {file.stat().st_size / 1e3:.0f} kB")


def save_heights(scene: str, heights: np.ndarray, relief: float) -> None:
    """Heights [m] as a grey picture of 16 bits, white is `relief`."""
    (ROOT / scene).mkdir(parents=True, exist_ok=True)
    grey = np.rint(np.clip(heights / relief, 0, 1) * 65535).astype(np.uint16)
    Image.fromarray(grey).save(ROOT / scene / "seafloor.png", optimize=True)


def save_relief(scene: str, name: str, heights: np.ndarray, cell: float) -> None:
    Image.fromarray(s.normal_map(heights, cell)).save(ROOT / scene / f"{name}.png", optimize=True)


# ---------------------------------------------------------------- vehicle


def thruster(radius: float, length: float) -> Solids:
    """A ducted propeller along X."""
    outline = np.array([[-0.5, 1.0], [-0.2, 1.12], [0.3, 1.1], [0.5, 1.0], [0.3, 0.94], [-0.3, 0.94]])
    angle = np.arange(28) * 2 * np.pi / 28
    ring = np.stack(
        [
            np.stack(
                [outline[:, 0] * length, outline[:, 1] * radius * np.cos(a), outline[:, 1] * radius * np.sin(a)], 1
            )
            for a in angle
        ]
    )
    closed = np.concatenate([np.concatenate([ring, ring[:, :1]], 1), np.concatenate([ring, ring[:, :1]], 1)[:1]], 0)
    solids = [s.welded(s.grid(closed)), s.tube(np.array([[-0.9 * length, 0, 0], [0.5 * length, 0, 0]]), radius * 0.24)]
    for a in np.arange(4) * 90:
        blade = s.box((0.015, radius * 0.34, radius * 0.7), (0, 0, radius * 0.55), (0, 0, 35))
        solids.append(s.moved(blade, (0.1 * length, 0, 0), (a, 0, 0)))
    solids += [s.beam((-0.4 * length, 0, 0), (-0.4 * length, *d), 0.03, 0.02) for d in ((radius, 0), (-radius, 0))]
    return solids


def auv() -> None:
    """A flat hovering AUV, 2.2 m long, with six thrusters; the sonars sit on posts and brackets and are left out.

    Sonar frames in the vehicle: forward-looking (1.16, 0, -0.10); top scanning (0.55, 0, 0.62); back scanning
    (-1.22, 0, 0.10), which turns about the vehicle's X axis. None of them lies inside the model.
    """
    x = np.concatenate([np.linspace(-1.1, -0.8, 8), np.linspace(-0.7, 0.55, 10), np.linspace(0.65, 1.1, 12)])
    nose = np.clip((x - 0.55) / 0.56, 0, 1)
    tail = np.clip((-0.75 - x) / 0.36, 0, 1)
    width = 0.50 * np.sqrt(1 - 0.93 * nose**2.4) * (1 - 0.35 * tail**2)
    height = 0.24 * np.sqrt(1 - 0.9 * nose**2.4) * (1 - 0.4 * tail**2)
    a = np.arange(48) * 2 * np.pi / 48
    c, d = np.cos(a), np.sin(a)
    y, z = np.sign(c) * np.abs(c) ** 0.55, np.sign(d) * np.abs(d) ** 0.7  # a rounded rectangle
    hull = np.stack([np.repeat(x[:, None], 48, 1), width[:, None] * y, height[:, None] * z], -1)
    body: Solids = [s.loft(hull)]
    body += [s.box((1.5, 0.05, 0.3), (-0.1, side * 0.52, 0.0)) for side in (-1, 1)]  # fairings
    body.append(s.sweep(np.array([[-1.0, 0, 0.2], [-0.62, 0, 0.46]]), lambda _t: s.bar(0.03, 0.3)))  # fin
    body += [s.box((0.12, 0.36, 0.2), (1.08, 0, -0.1))]  # bracket of the forward-looking sonar
    body.append(s.rod((0.55, 0, 0.2), (0.55, 0, 0.55), 0.035, 16))  # post of the top scanning sonar
    body.append(s.rod((-1.0, 0, 0.10), (-1.15, 0, 0.10), 0.035, 16))  # and of the back one
    for side in (-1, 1):
        body.append(s.rod((0.95, side * 0.22, 0.02), (1.1, side * 0.22, 0.02), 0.05, 16))  # cameras
        body.append(s.rod((0.98, side * 0.33, -0.1), (1.06, side * 0.33, -0.1), 0.045, 14))  # lamps
        body += [s.rod((px, side * 0.36, -0.15), (px, side * 0.42, -0.42), 0.025, 10) for px in (-0.5, 0.5)]
        runner = [(-0.8, side * 0.42, -0.42), (0.7, side * 0.42, -0.42), (0.85, side * 0.42, -0.32)]
        body.append(s.tube(s.bend(runner, 0.1), 0.028, 10))  # skids
    body.append(s.rod((-0.55, 0, 0.2), (-0.55, 0, 0.85), [0.02, 0.008], 8))  # antenna
    body += [s.rod((-0.25, 0, -0.2), (-0.25, 0, -0.32), 0.11, 24), s.ring((-0.25, 0, -0.32), (0, 0, 1), 0.1, 0.015)]
    drives: Solids = []
    for side in (-1, 1):
        aft = [s.moved(p, (-1.0, side * 0.62, 0)) for p in thruster(0.11, 0.2)]
        slanted = [s.moved(p, (0.72, side * 0.63, 0.02), (0, 0, side * 40)) for p in thruster(0.09, 0.16)]
        upright = [s.moved(p, (-0.35, side * 0.66, 0), (0, 90, 0)) for p in thruster(0.11, 0.2)]
        drives += aft + slanted + upright
        drives += [s.beam((px, side * 0.4, 0), (px, side * 0.6, 0), 0.05, 0.04) for px in (-1.0, 0.68, -0.35)]
    save("auv", "auv", {"hull": (body, "glass_fibre"), "thrusters": (drives, "aluminium")})


# ---------------------------------------------------------------- 1 target on the sea floor


def rippled(samples: int, extent: float, seed: int, height: float = 0.05) -> np.ndarray:
    """Sand with ripples that wander, around 0.5 m above zero."""
    rng = np.random.default_rng(seed)
    axis = np.linspace(-extent / 2, extent / 2, samples)
    x, y = np.meshgrid(axis, axis[::-1])
    bent = s.rough((samples, samples), (20, 7), (0.5, 0.12), rng)
    ripples = height * np.sin(2 * np.pi * (x * 0.9 + y * 0.25) / 1.3 + 2.2 * bent)
    return 0.5 + ripples * (0.6 + 0.4 * bent) + 0.14 * bent


def target() -> None:
    """A mine of the old kind on its sinker, dented and overgrown: the ball itself comes from the scene file."""
    save_heights("target", rippled(201, 40, SEED), 1.5)
    horns: Solids = []
    directions = [(0, 0, 1)] + [
        (np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e))
        for e, n in ((0.62, 4), (0.0, 5))
        for a in np.arange(n) * 2 * np.pi / n + e
    ]
    for direction in directions:
        p = np.asarray(direction)
        horns += [s.rod(p * 0.73, p * 0.80, 0.10, 16), s.rod(p * 0.80, p * 0.96, [0.055, 0.045], 12)]
    horns.append(s.ring((0, 0, 0), (0, 0, 1), 0.755, 0.02, 48))  # the seam
    sinker: Solids = [s.box((1.1, 1.1, 0.5), (0, 0, -1.15)), s.rod((0, 0, -0.9), (0, 0, -0.7), 0.22, 20)]
    for k in range(5):  # what is left of the chain
        turn = (90 * (k % 2), 0, 20 * k)
        link = s.moved(s.ring((0, 0, 0), (0, 0, 1), 0.09, 0.02, 16), (0, 0, 0), turn)
        sinker.append(s.moved(link, (0.7 + 0.15 * k, 0.25 + 0.07 * k, -1.28)))
    save("target", "mine", {"horns": (horns, "iron"), "sinker": (sinker, "concrete")})
    rng = np.random.default_rng(SEED)
    relief = s.rough((256, 512), (10, 4, 1.5), (0.012, 0.006, 0.0015), rng)
    save_relief("target", "corroded", relief, 2 * np.pi * 0.75 / 512)


# ---------------------------------------------------------------- reflectance and relief


def materials() -> None:
    """The relief for a ball of the material scene; the balls themselves come from the scene file."""
    v, u = np.mgrid[0:256, 0:512]
    knobs = np.cos(2 * np.pi * u / 32) * np.cos(2 * np.pi * v / 32)
    (ROOT / "materials").mkdir(parents=True, exist_ok=True)
    save_relief("materials", "knobs", 0.035 * knobs, 2 * np.pi * 0.8 / 512)


# ---------------------------------------------------------------- 2 subsea isolation valve


def isolation_valve() -> None:
    """A subsea isolation valve on its skid: ball valve with actuator, bypass, spools, control panel, roof."""
    save_heights("isolation_valve", rippled(181, 60, SEED + 1, 0.03), 1.5)
    frame: Solids = []
    lx, ly, h = 4.2, 2.6, 3.4
    for x in (-lx, -lx / 3, lx / 3, lx):
        for y in (-ly, ly):
            lean = 0.35 if abs(x) == lx else 0
            foot = (x + np.sign(x) * lean, y + np.sign(y) * 0.5, 0)
            frame.append(s.rod(foot, (x, y, h), 0.14, 14))
        frame.append(s.rod((x, -ly, h), (x, ly, h), 0.12, 12))
    for y in (-ly, ly):
        frame += [
            s.rod((-lx, y, h), (lx, y, h), 0.12, 12),
            s.rod((-lx - 0.3, y * 1.17, 0.3), (lx + 0.3, y * 1.17, 0.3), 0.1),
        ]
        for x0, x1 in ((-lx, -lx / 3), (lx / 3, lx)):
            frame += [s.rod((x0, y, h), (x1, y * 1.15, 0.3), 0.07, 10)]
    frame += s.lattice((-lx, -ly, h + 0.1), (lx * 0.62, 0, 0), (0, 2 * ly, 0), (6, 11), 0.03)  # roof hatches
    frame += s.lattice((lx * 0.38, -ly, h + 0.1), (lx * 0.62, 0, 0), (0, 2 * ly, 0), (6, 11), 0.03)
    frame.append(s.box((2 * lx + 2.4, 2 * ly + 2.2, 0.16), (0, 0, 0)))
    for x in (-lx - 0.6, lx + 0.6):
        for y in (-ly - 0.5, ly + 0.5):  # suction piles
            frame.append(s.rod((x, y, -0.4), (x, y, 0.7), 0.55, 28))
    piping: Solids = [s.tube(np.array([[-9.0, 0, 1.1], [-1.0, 0, 1.1]]), 0.25, 20)]
    piping += [s.tube(np.array([[1.0, 0, 1.1], [9.0, 0, 1.1]]), 0.25, 20)]
    piping += s.valve((0, 0, 1.1), (1, 0, 0), (0, 0, 1), 0.34)
    piping += [s.rod((0, 0.3, 2.0), (0, 2.1, 2.0), 0.3, 24), s.rod((0, 2.1, 2.0), (0, 2.2, 2.0), 0.36, 24)]  # actuator
    for x in (-3.2, 3.2):
        piping += s.flange((x, 0, 1.1), (1, 0, 0), 0.5, 0.1, 16)
    bypass = s.bend([(-2.4, 0, 1.1), (-2.4, -1.5, 1.1), (2.4, -1.5, 1.1), (2.4, 0, 1.1)], 0.5)
    piping.append(s.tube(bypass, 0.11, 14))
    for x in (-1.2, 1.2):
        piping += s.valve((x, -1.5, 1.1), (1, 0, 0), (0, 0, 1), 0.14)
    for x in (-9, 9):  # spools that rise and turn away
        side = np.sign(x)
        spool = s.bend(
            [(x, 0, 1.1), (x + side * 1.5, 0, 1.1), (x + side * 1.5, 3 * side, 0.35), (x + side * 1.5, 14 * side, 0.3)],
            0.9,
        )
        piping.append(s.tube(spool, 0.25, 18))
        piping += s.flange((x, 0, 1.1), (1, 0, 0), 0.45, 0.1, 14)
    panel: Solids = [s.box((2.2, 0.25, 1.5), (2.4, 2.3, 1.5))]
    for k, x in enumerate(np.linspace(1.6, 3.2, 5)):
        for z in (1.1, 1.6, 2.0):
            panel += [
                s.rod((x, 2.42, z), (x, 2.55, z), 0.09, 14),
                s.beam((x - 0.06, 2.57, z), (x + 0.06, 2.57, z), 0.03, 0.03),
            ]
        panel.append(s.tube(s.bend([(x, 2.2, 0.8), (x, 1.7, 0.5), (0.3 + 0.1 * k, 1.2, 1.9)], 0.3), 0.025, 8))
    place = (0, 0, 0.45)
    objects = {"frame": (frame, "painted_steel"), "piping": (piping, "painted_steel"), "panel": (panel, "steel_plate")}
    save("isolation_valve", "valve", {n: ([s.moved(p, place) for p in parts], m) for n, (parts, m) in objects.items()})


# ---------------------------------------------------------------- 3 docking structure


def docking() -> None:
    """A garage for a hovering AUV: funnel, rails, grating, roof, legs on mud mats, guide posts."""
    save_heights("docking", rippled(181, 60, SEED + 2, 0.03), 1.5)
    frame: Solids = []
    length, half, low, high = 4.0, 1.3, 1.6, 3.6
    for x in (0.0, length / 2, length):
        for y in (-half, half):
            frame += [s.rod((x, y, 0.1), (x, y, high), 0.11, 14), s.box((1.1, 1.1, 0.12), (x, y * 1.12, 0.06))]
        frame += [s.rod((x, -half, z), (x, half, z), 0.09, 12) for z in (low, high)]
    for y in (-half, half):
        frame += [s.rod((0, y, z), (length, y, z), 0.09, 12) for z in (low, (low + high) / 2, high)]
        frame += [
            s.rod((0, y, low), (length / 2, y, high), 0.05, 10),
            s.rod((length / 2, y, high), (length, y, low), 0.05, 10),
        ]
        frame += [
            s.rod((0, y, 0.2), (length / 2, y, low), 0.05, 10),
            s.rod((length / 2, y, low), (length, y, 0.2), 0.05, 10),
        ]
    frame += s.lattice((0, -half, low + 0.05), (length, 0, 0), (0, 2 * half, 0), (20, 13), 0.018)  # grating
    frame += s.lattice((0, -half, high), (length, 0, 0), (0, 2 * half, 0), (8, 5), 0.035)
    mouth = [(0, -half, low), (0, half, low), (0, half, high), (0, -half, high)]
    wide = [
        (-1.6, -half - 1.2, low - 0.7),
        (-1.6, half + 1.2, low - 0.7),
        (-1.6, half + 1.2, high + 1.0),
        (-1.6, -half - 1.2, high + 1.0),
    ]
    funnel: Solids = []
    for k in range(4):
        a, b, c, d = (np.asarray(p, float) for p in (mouth[k], mouth[(k + 1) % 4], wide[k], wide[(k + 1) % 4]))
        funnel.append(s.rod(c, d, 0.08, 12))
        for t in np.linspace(0, 1, 9):
            funnel.append(s.rod(a + (b - a) * t, c + (d - c) * t, 0.035, 8))
        funnel += [s.rod(a + (c - a) * t, b + (d - b) * t, 0.03, 8) for t in (0.35, 0.7)]
    for y in (-0.42, 0.42):  # rails that take the skids
        frame.append(
            s.tube(
                s.bend([(-0.9, y * 1.5, low - 0.1), (0.2, y, low + 0.16), (length - 0.3, y, low + 0.16)], 0.4), 0.05, 12
            )
        )
    frame += [
        s.box((0.3, 1.6, 0.9), (length - 0.2, 0, low + 0.7)),
        s.rod((length - 0.5, 0, low + 0.7), (length, 0, low + 0.7), 0.2),
    ]
    for y in (-half - 1.2, half + 1.2):  # posts with marker balls
        funnel += [s.rod((-1.6, y, 0.05), (-1.6, y, high + 2.2), 0.06, 12), s.box((0.8, 0.8, 0.1), (-1.6, y, 0.05))]
        funnel.append(s.ring((-1.6, y, high + 2.2), (1, 0, 0), 0.2, 0.05, 20))
    place = (0, 0, 0.45)
    objects = {"frame": (frame, "painted_steel"), "funnel": (funnel, "plastic")}
    save("docking", "dock", {n: ([s.moved(p, place) for p in parts], m) for n, (parts, m) in objects.items()})


# ---------------------------------------------------------------- 4 tank


def tank() -> None:
    """What stands in the tank, and the plaster of its walls; walls and floor are planes of the scene file."""
    inside: Solids = []
    for y in (-0.25, 0.25):  # a ladder on the far wall
        inside.append(s.rod((9.75, 3 + y, -5.0), (9.75, 3 + y, 0.4), 0.04, 12))
    inside += [s.rod((9.75, 2.75, z), (9.75, 3.25, z), 0.025, 10) for z in np.arange(-4.8, 0.2, 0.32)]
    inside.append(s.tube(s.bend([(-9.8, -4.5, 0.3), (-9.8, -4.5, -3.6), (-8.4, -4.5, -3.6)], 0.5), 0.16, 18))  # inlet
    inside += s.flange((-8.4, -4.5, -3.6), (1, 0, 0), 0.3, 0.07)
    inside += [s.rod((x, 5.85, -5.0), (x, 5.85, 0.2), 0.09, 14) for x in (-5, 5)]  # columns before the left wall
    inside.append(s.rod((4.0, -3.5, -5.0), (4.0, -3.5, -1.2), 0.3, 28))  # a target post
    inside += [
        s.box((0.9, 0.9, 0.9), (-4.5, 2.5, -4.55), (0, 0, 25)),
        s.ring((-4.5, -2.2, -2.4), (1, 0.3, 0), 0.7, 0.08, 40),
    ]
    inside.append(s.rod((-4.5, -2.2, -5.0), (-4.5, -2.2, -3.1), 0.05, 10))
    save("tank", "furniture", {"furniture": (inside, "steel")})
    rng = np.random.default_rng(SEED + 3)
    y, x = np.mgrid[0:256, 0:512] / 256.0 * 5.0  # a wall of 10 x 5 m, mirrored on both halves
    joints = np.minimum(np.abs((x + 1) % 2 - 1), np.abs((y + 0.5) % 1.0 - 0.5))
    relief = s.rough((256, 512), (9, 3, 1.2), (0.02, 0.008, 0.002), rng) - 0.04 * np.exp(-((joints / 0.05) ** 2))
    save_relief("tank", "plaster", relief, 5.0 / 256)


# ---------------------------------------------------------------- 5 grid


def grid() -> None:
    """A square cage of bars around the vehicle, with one corner marked so that a turn can be told."""
    half, low, high = 8.0, -6.0, -1.0
    bars: Solids = []
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
        bars += s.lattice((ax, ay, low), (bx - ax, by - ay, 0), (0, 0, high - low), (8, 5), 0.06)
    mark: Solids = [s.box((0.5, 0.5, 5.0), (half - 0.5, half - 0.5, -3.5), (0, 0, 45))]
    save("grid", "cage", {"bars": (bars, "steel"), "mark": (mark, "steel")})


# ---------------------------------------------------------------- 6 structures on a slope


def slope_height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The slope [m], 14 deg down along Y with a terrace."""
    down = -0.25 * np.asarray(y, float)
    return 10.0 + down + 0.7 * np.tanh((np.asarray(y, float) + 3) / 2.0) + 0.12 * np.sin(np.asarray(x, float) / 5.0)


def slope() -> None:
    """Wellhead with tree, manifold, three pipelines and a mattress on a slope."""
    samples, extent = 181, 60.0
    axis = np.linspace(-extent / 2, extent / 2, samples)
    x, y = np.meshgrid(axis, axis[::-1])
    rng = np.random.default_rng(SEED + 4)
    save_heights("slope", slope_height(x, y) + s.rough((samples, samples), (9, 2.5), (0.08, 0.03), rng), 20.0)

    def on_ground(px: float, py: float) -> float:
        return float(slope_height(np.array(px), np.array(py)))

    lines: Solids = []
    for k, py in enumerate((-9.0, -7.4, 6.0)):
        px = np.arange(-30, 30.1, 0.5)
        way = py + 0.5 * np.sin(px / 9 + k)
        lines.append(s.tube(np.column_stack([px, way, slope_height(px, way) + 0.2]), (0.3, 0.22, 0.4)[k], 18))
    for i in np.arange(-5, 6):  # a mattress over the thick line
        for j in np.arange(-3, 4):
            px, py = j * 0.55 - 6.0, i * 0.42 + 6.0 + 0.5 * np.sin(-6 / 9 + 2)
            lift = 0.75 - 0.12 * abs(i) ** 1.2
            lines.append(s.box((0.48, 0.36, 0.22), (px, py, on_ground(px, py) + max(lift, 0.1))))
    tree: Solids = []
    base = np.array([2.0, 0.5, on_ground(2.0, 0.5)])
    tree += [s.rod((0, 0, -0.5), (0, 0, 1.0), 0.5, 28), s.rod((0, 0, 1.0), (0, 0, 3.4), 0.28, 24)]
    tree += [s.rod((0, 0, z), (0, 0, z + 0.18), 0.62, 28) for z in (1.0, 1.8, 2.6, 3.4)]
    for a in np.arange(4) * 90:
        corner = [s.rod((1.2, 1.2, -0.4), (1.2, 1.2, 3.8), 0.1, 12), s.rod((1.2, 1.2, 3.8), (1.2, -1.2, 3.8), 0.09, 12)]
        corner += [
            s.rod((1.2, 1.2, 0.4), (1.2, -1.2, 0.4), 0.08, 12),
            s.rod((1.2, 1.2, 0.4), (1.2, -1.2, 3.8), 0.05, 10),
        ]
        tree += [s.moved(p, (0, 0, 0), (0, 0, a)) for p in corner]
    for z, turn in ((1.5, 0), (2.3, 180)):
        wing = [
            s.tube(np.array([[0.2, 0, 0], [1.9, 0, 0]]), 0.13, 14),
            *s.valve((0.85, 0, 0), (1, 0, 0), (0, 1, 0), 0.13),
        ]
        tree += [s.moved(p, (0, 0, z), (0, 0, turn)) for p in wing]
    jumper = s.bend([(1.9, 0, 1.5), (3.2, 0, 1.5), (3.2, 0, 2.8), (5.5, -2.0, 2.8), (5.5, -2.0, 0.4)], 0.5)
    tree.append(s.tube(jumper, 0.12, 14))
    tree = [s.moved(p, base) for p in tree]
    manifold: Solids = []
    at = np.array([-8.0, -2.0, on_ground(-8.0, -2.0)])
    manifold += [
        s.box((4.4, 3.0, 0.25), (0, 0, 0.1)),
        *s.lattice((-2.1, -1.4, 2.2), (4.2, 0, 0), (0, 2.8, 0), (7, 5), 0.04),
    ]
    for px in (-2.1, 0, 2.1):
        manifold += [s.rod((px, py, 0), (px, py, 2.2), 0.1, 12) for py in (-1.4, 1.4)]
    for py in (-0.7, 0.7):
        manifold.append(s.tube(np.array([[-2.6, py, 0.9], [2.6, py, 0.9]]), 0.18, 16))
        for px in (-1.3, 0.2, 1.5):
            manifold += s.valve((px, py, 0.9), (1, 0, 0), (0, 0, 1), 0.16)
    manifold = [s.moved(p, at, (-12, 0, 0)) for p in manifold]
    save(
        "slope",
        "structures",
        {
            "pipelines": (lines, "coated_steel"),
            "tree": (tree, "painted_steel"),
            "manifold": (manifold, "painted_steel"),
        },
    )


if __name__ == "__main__":
    for make in (auv, materials, target, isolation_valve, docking, tank, grid, slope):
        make()
