"""What a user sets on speckle: a preset, and whatever differs from it."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from sonar_component.noise.law import LEAST_LOOKS, Law, gamma, normal, rayleigh
from sonar_component.settings.quantity import Angle, Length, Ratio

LawName = Literal["normal", "folded-normal", "gamma", "rayleigh"]

PRESETS: dict[str, dict[str, Any]] = {
    # The original simulator: of the paper's time (2017), and as it was left (2020). Both are fresh in every bin.
    "cerqueira-2017": {"law": "normal", "mean": 0.4, "deviation": 0.15},
    "cerqueira-2020": {"law": "folded-normal", "mean": 0.95, "deviation": 0.30, "floor": 0.03},
    # Textbook speckle, fresh in every bin.
    "gamma": {"law": "gamma", "looks": 1.0},
    "rayleigh": {"law": "rayleigh", "looks": 1.0},
    # Three pings of an Oculus M1200d at 2.1 MHz (liboculus, test/data/three_pings_8bit.raw), each bin divided by the
    # mean of the 31 x 31 around it: contrast 0.35, correlation between neighbouring beams 0.68, bins 0.29, pings 0.62
    # and 0.59 over two pings, so most of what stays from one ping to the next stays for good. One scene, after the
    # device's own gain and gamma.
    "oculus-like": {
        "law": "gamma",
        "looks": 8.0,
        "beam_correlation_length": 2.65,
        "bin_correlation_length": 0.82,
        "ping_correlation": 0.62,
    },
}
_OF_LAW = {"normal": ("mean", "deviation"), "folded-normal": ("mean", "deviation"), "gamma": ("looks",),
           "rayleigh": ("looks",)}  # fmt: skip


def _or_a_preset(schema: dict[str, Any]) -> None:
    """Tell editors that a preset's name alone will do."""
    whole = dict(schema)
    schema.clear()
    schema["anyOf"] = [{"enum": sorted(PRESETS)}, whole]


class SpeckleProperties(BaseModel):
    """Multiplicative noise, y = x n (Eq. 2 of Cerqueira et al. 2017).

    Attributes
    ----------
    preset : str
        What everything else is where it is not given.
    law : str
        Distribution of n: "normal" cut at 0, "folded-normal" (its absolute value), "gamma" (intensity of `looks` looks)
        or "rayleigh" (amplitude of the same); the last two have mean 1.
    mean, deviation : float
        Of the normal laws [-].
    looks : float
        Of the others [-]; gamma's contrast is looks ** -0.5.
    floor : float
        Echo strength that stands in for anything weaker, before n [-].
    beam_correlation_length, bin_correlation_length : float
        Distance at which the correlation has fallen to 1/e [beams, bins]; 0 leaves neighbours independent.
    ping_correlation : float
        Between pings while the sonar stands still [-]: 0 is fresh in every ping, 1 is frozen.
    decorrelation_length, decorrelation_angle : float
        How far the sonar moves [m] and turns [rad] until what stays has fallen to 1/e.
    """

    model_config = ConfigDict(extra="forbid", defer_build=True, frozen=True, json_schema_extra=_or_a_preset)

    preset: Literal["cerqueira-2017", "cerqueira-2020", "gamma", "rayleigh", "oculus-like"] = "cerqueira-2017"
    law: LawName = "normal"
    mean: Annotated[Ratio, Field(ge=0, le=10)] | None = None
    deviation: Annotated[Ratio, Field(ge=0, le=10)] | None = None
    looks: Annotated[Ratio, Field(ge=LEAST_LOOKS, le=10_000)] | None = None
    floor: Annotated[Ratio, Field(ge=0, le=1)] = 0.0
    beam_correlation_length: Annotated[Ratio, Field(ge=0, le=1000)] = 0.0
    bin_correlation_length: Annotated[Ratio, Field(ge=0, le=1000)] = 0.0
    ping_correlation: Annotated[Ratio, Field(ge=0, le=1)] = 0.0
    # No source gives these two for an imaging sonar; they are of the size of its array and of one of its beams.
    decorrelation_length: Annotated[Length, Field(gt=0, le=1000)] = 0.05
    decorrelation_angle: Annotated[Angle, Field(gt=0, le=2 * math.pi)] = math.radians(0.5)

    @model_validator(mode="before")
    @classmethod
    def _fill_from_preset(cls, data: Any) -> Any:
        if isinstance(data, str):
            data = {"preset": data}
        if not isinstance(data, dict):
            return data
        preset = PRESETS.get(str(data.get("preset", "cerqueira-2017")), {})
        of_preset = _OF_LAW.get(str(preset.get("law")), ())
        if data.get("law", preset.get("law")) != preset.get("law"):  # another law has numbers of its own
            preset = {name: value for name, value in preset.items() if name not in of_preset}
        return {**preset, **data}

    @model_validator(mode="after")
    def _numbers_fit_the_law(self) -> SpeckleProperties:
        needed = _OF_LAW[self.law]
        for name in ("mean", "deviation", "looks"):
            given = getattr(self, name) is not None
            if given and name not in needed:
                raise ValueError(f"law {self.law} has no {name}; it has {' and '.join(needed)}")
            if not given and name in needed:
                raise ValueError(f"law {self.law} needs {name}")
        return self

    def distribution(self) -> Law:
        """The law with its numbers."""
        if self.looks is not None:
            return gamma(self.looks) if self.law == "gamma" else rayleigh(self.looks)
        assert self.mean is not None
        assert self.deviation is not None
        return normal(self.mean, self.deviation, self.law == "folded-normal")
