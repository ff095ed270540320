"""What each feature of an image costs on a scene: drawn with it and without it, turn by turn, and timed.

A table of costs measured once lost: the same normal map costs nothing where it covers a bolt and a third of the frame
where it covers the sea floor.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sonar_component.gl import Context
from sonar_component.scene import Body, Material, Part, World, shapes
from sonar_component.scene.terrain import terrain
from sonar_component.sonars.imager import FanImager, Pose
from sonar_component.sonars.settings import ForwardLookingSettings

ROUNDS = 15  # [images], with and without each
_WARM_UP = 3  # [images], which plan and compile


@dataclass(frozen=True)
class FeatureCost:
    """One feature of an image.

    Attributes
    ----------
    name : as the shaders' #define has it.
    on : bool
    why : what in settings or scene put it on or leaves it off.
    cost : float
        Of drawing and reading the samples of one image [s]; 0 where it is off.
    uncertainty : float
        Two standard deviations of that [s], from the quartiles of the single differences.
    whole : float
        Drawing and reading with all features [s].
    """

    name: str
    on: bool
    why: str
    cost: float = 0.0
    uncertainty: float = 0.0
    whole: float = 0.0

    def line(self) -> str:
        """In words."""
        name = self.name.lower().replace("_", " ")
        if not self.on:
            return f"{name}: off, {self.why}: no code, no texture, no column"
        cost, uncertainty, whole = (1e3 * t for t in (self.cost, self.uncertainty, self.whole))
        return f"{name}: on, {self.why}: {cost:.2f} +- {uncertainty:.2f} of {whole:.2f} ms of drawing"

    def data(self) -> dict[str, Any]:
        """For JSON."""
        times = {"cost_ms": self.cost, "uncertainty_ms": self.uncertainty, "whole_ms": self.whole}
        return {"name": self.name, "on": self.on, "why": self.why} | {key: 1e3 * t for key, t in times.items()}


def feature_costs(imager: FanImager, world: World, X_WS: Pose, rounds: int = ROUNDS) -> list[FeatureCost]:
    """Measure every feature of the image from a pose; takes two times `rounds` images for each that is on."""
    imager.seconds(world, X_WS)  # plans, so that view count and features are those of this image
    used, costs = imager.features, []
    for name, why in _reasons(imager, world).items():
        on = name in used
        if on:
            imager.seconds(world, X_WS, name)  # compiles the program without it
            times = np.array([(imager.seconds(world, X_WS), imager.seconds(world, X_WS, name)) for _ in range(rounds)])
            low, middle, high = np.percentile(times[:, 0] - times[:, 1], [25, 50, 75])
            uncertainty = 2 * 1.25 * (high - low) / 1.35 / np.sqrt(rounds)  # of a median, if normally distributed
            whole = float(np.median(times[:, 0]))
            costs.append(FeatureCost(name, on, why, max(float(middle), 0.0), float(uncertainty), whole))
        else:
            costs.append(FeatureCost(name, on, why))
    return costs


def _reasons(imager: FanImager, world: World) -> dict[str, str]:
    """#define of every feature, and what puts it on or leaves it off."""
    s, views = imager.settings, imager.view_count
    materials = [part.material for body in world.bodies.values() for part in body.parts]
    decibels = s.attenuation_properties.nepers_per_metre() * 20 / np.log(10)
    return {
        "WIDE_FAN": f"{np.degrees(imager.beams.width):.3g} deg in {views} view{'s' if views > 1 else ''}",
        "SIGMOID": f"normalization {s.normalization}, transfer {'linear' if s.sigmoid is None else 'sigmoid'}",
        "ATTENUATION": f"{decibels:.3g} dB/m" if s.enable_attenuation else "enable_attenuation is false",
        "NORMAL_MAP": _named("a normal map", (m.name for m in materials if m.normal_map is not None)),
        "REFLECTANCE_MAP": _named("a reflectance map", (m.name for m in materials if m.reflectance_map is not None)),
        "TRUTH": "only where truth is asked for",
    }


def _named(what: str, owners: Iterable[str]) -> str:
    found = list(dict.fromkeys(owners))
    if not found:
        return f"no material has {what}"
    more = f" and {len(found) - 3} more" if len(found) > 3 else ""
    return f"{what} in {', '.join(found[:3])}{more}"


def benchmark(context: Context, frames: int = 50, tick: Callable[[], None] = lambda: None) -> list[dict[str, Any]]:
    """What each feature costs while it is on, and that it costs nothing before and after.

    Returns
    -------
    list of {"feature", "off_ms", "on_ms", "off_again_ms", "off_bytes", "on_bytes", "off_again_bytes"}
        Medians of whole clean images, and bytes of the world and of one draw in GPU memory.
    """
    # A relief of one tilt: a rough one would be given more samples, and that is not the feature's cost.
    relief = np.broadcast_to(np.array([150, 128, 253], np.uint8), (256, 256, 3)).copy()
    plain = Material("plain")
    cases: dict[str, tuple[bool, Material]] = {
        "ATTENUATION": (True, plain),
        "NORMAL_MAP": (False, Material("relief", normal_map=relief)),
        "REFLECTANCE_MAP": (False, Material("spotted", reflectance_map=relief[..., 0].copy())),
    }
    rows = []
    for name, (attenuated, material) in cases.items():
        off = ForwardLookingSettings(range=30.0, bin_count=500, enable_attenuation=False)
        imager = FanImager(context, off, off.beam_table())
        row: dict[str, Any] = {"feature": name}
        for phase in ("off", "on", "off_again"):
            on = phase == "on"
            imager.adopt(off.model_copy(update={"enable_attenuation": attenuated and on}), imager.beams)
            row[f"{phase}_ms"] = _median_ms(imager, _ground(material if on else plain), frames)
            row[f"{phase}_bytes"] = imager.gpu_bytes
            tick()
        imager.release()
        rows.append(row)
    return rows


def _ground(material: Material) -> World:
    """A sea floor of 51 200 triangles with a ball on it, 3 m below a sonar at the origin."""
    X, ball = np.eye(4), np.eye(4)
    X[2, 3], ball[:3, 3] = -3.0, (12.0, -3.0, -1.5)
    floor = terrain(np.zeros((161, 161)), (80.0, 80.0, 1.0))
    bodies = [("floor", floor, X), ("ball", shapes.sphere(1.5), ball)]
    return World([Body(name, [Part(mesh, material, np.eye(4))], pose) for name, mesh, pose in bodies])


def _median_ms(imager: FanImager, world: World, frames: int) -> float:
    durations = []
    for _ in range(frames + _WARM_UP):
        began = time.perf_counter()
        imager.echoes(world, np.eye(4))
        durations.append(time.perf_counter() - began)
    return 1e3 * float(np.median(durations[_WARM_UP:]))
