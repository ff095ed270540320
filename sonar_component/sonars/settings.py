"""What a user sets on a sonar: Rock's property names, with units and limits."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, PrivateAttr, ValidationError, field_validator, model_validator

from sonar_component.acoustics.absorption import absorption, nepers_per_metre
from sonar_component.echo import beams
from sonar_component.noise.properties import SpeckleProperties
from sonar_component.samples.sonar import SPEED_OF_SOUND
from sonar_component.settings.errors import suggest
from sonar_component.settings.quantity import (
    Angle,
    Frequency,
    Length,
    Level,
    Ratio,
    Salinity,
    Speed,
    Temperature,
    describe,
)
from sonar_component.sonars.receiver_settings import TimeVaryingGain

_DEG = math.pi / 180
_LIMITS: dict[str, tuple[str, float, float]] = {  # property -> dimension, least, greatest
    "range": ("length", 0.1, 1000.0),
    "min_range": ("length", 0.0, 1000.0),
    "max_range": ("length", 0.1, 1000.0),
    "gain": ("ratio", 0.0, 1.0),
    "beam_width": ("angle", 0.05 * _DEG, 360 * _DEG),
    "beam_height": ("angle", 0.05 * _DEG, 150 * _DEG),
    "accuracy": ("ratio", 0.001, 0.2),
    "speed_of_sound": ("speed", 1300.0, 1700.0),
}


class AttenuationProperties(BaseModel):
    """The water, for the absorption of sound; defaults as in the original simulator."""

    model_config = ConfigDict(extra="forbid", defer_build=True)

    frequency: Annotated[Frequency, Field(ge=100, le=1e6)] = 300e3
    temperature: Annotated[Temperature, Field(ge=267.15, le=308.15)] = 298.15
    salinity: Annotated[Salinity, Field(ge=0, le=50)] = 0.0
    acidity: Annotated[Ratio, Field(ge=7.7, le=8.3)] = 8.0
    depth: Annotated[Length, Field(ge=0, le=7000)] = 0.0

    def nepers_per_metre(self) -> float:
        """Absorption of the amplitude, one way [Np/m]."""
        decibels = absorption(self.frequency, self.temperature, self.salinity, self.acidity, self.depth)
        return nepers_per_metre(decibels)


class SonarSettings(BaseModel):
    """Settings that every imaging sonar has; what each means is said once, where people see it: in its description."""

    model_config = ConfigDict(extra="forbid", defer_build=True, validate_assignment=True, validate_default=True)
    limits: ClassVar = _LIMITS

    range: Length = Field(default=50.0, description="end of the last bin")
    min_range: Length = Field(default=0.0, description="where echoes begin")
    max_range: Length = Field(default=1000.0, description="the greatest range that the device can be set to")
    gain: Ratio = Field(default=0.5, description="brightness; 0.5 is unity")
    bin_count: Annotated[int, Field(ge=1, le=4096)] = Field(default=750, description="bins along the range")
    beam_width: Angle = Field(default=120 * _DEG, description="opening of the fan in azimuth")
    beam_height: Angle = Field(default=20 * _DEG, description="opening in elevation")
    normalization: Literal["mean", "energy"] = Field(
        default="mean", description="the paper's mean over the surface in a bin, or the energy that it returns"
    )
    transfer: Literal["sigmoid", "linear"] | None = Field(
        default=None, description="what becomes of a sample's strength; none: sigmoid for mean, linear for energy"
    )
    sigmoid_slope: Annotated[float, Field(gt=0, le=1000)] = Field(
        default=18.0, description="slope of the sigmoid transfer [-]"
    )
    sigmoid_centre: Annotated[float, Field(ge=0, le=10)] = Field(
        default=2 / 3, description="centre of the sigmoid transfer [-]"
    )
    accuracy: Ratio = Field(default=0.02, description="error of the energy to aim for; a smaller one takes longer")
    speed_of_sound: Speed = Field(default=SPEED_OF_SOUND, description="of the water, all the way")
    seed: Annotated[int, Field(ge=0)] = Field(default=0, description="of the noise: the same one gives the same pings")
    enable_attenuation: bool = Field(default=False, description="let the water absorb sound")
    attenuation_properties: AttenuationProperties = Field(
        default=AttenuationProperties(),
        description="the water, for its absorption: frequency, temperature, salinity, acidity, depth",
    )
    enable_speckle_noise: bool = Field(default=False, description="let bins fluctuate from ping to ping")
    speckle_properties: SpeckleProperties = Field(
        default=SpeckleProperties(),
        description="law, correlation and persistence of the speckle, or the name of a preset",
    )
    spreading: Annotated[Level, Field(ge=0, le=80)] = Field(
        default=0.0,
        description="loss by spreading, there and back [dB per decade of range]; 0: the receiver makes up for it",
    )
    time_varying_gain: TimeVaryingGain = Field(
        default=TimeVaryingGain(), description="what the receiver sets against losses"
    )
    in_ping_motion: bool = Field(
        default=False, description="far bins of a ping see the later pose, from the velocities that come with it"
    )
    reduction: Literal["auto", "cpu", "gpu"] = Field(
        default="auto", description="where samples become bins; auto: the faster way for the driver"
    )
    frame: str = Field(default="sonar", description="name of the sensor's frame in its samples")
    unverified: list[str] = Field(default=[], description="names of properties whose value no source confirms")

    @field_validator("unverified")
    @classmethod
    def _unverified_names_properties(cls, names: list[str]) -> list[str]:
        for name in names:
            if name not in cls.model_fields:
                raise ValueError(f"must name properties: there is no {name!r}{suggest(name, cls.model_fields)}")
        return names

    @field_validator(*_LIMITS)
    @classmethod
    def _within_limits(cls, value: float, info: object) -> float:
        dimension, least, greatest = _LIMITS[info.field_name]  # type: ignore[attr-defined]
        if not least <= value <= greatest:
            low, high = describe(least, dimension), describe(greatest, dimension)
            raise ValueError(f"must be {low} to {high}, got {describe(value, dimension)}")
        return value

    @model_validator(mode="after")
    def _min_range_is_below_range(self) -> SonarSettings:
        if self.range > self.max_range:
            raise ValueError(f"range must be at most max_range ({self.max_range:g} m), got {self.range:g} m")
        if self.min_range >= self.range:
            raise ValueError(f"min_range must be below range ({self.range:g} m), got {self.min_range:g} m")
        return self

    _changes: int = PrivateAttr(0)

    @property
    def changes(self) -> int:
        """How often a property was assigned: tells a sonar that its settings are not those that it took over."""
        return self._changes

    def __setattr__(self, name: str, value: object) -> None:
        """Assign a property, or refuse it and keep the old value."""
        kept = dict(self.__dict__)
        try:
            super().__setattr__(name, value)
            if name != "_changes":
                self._changes += 1
        except ValidationError:
            # pydantic checks how properties go together only after it has stored the new value.
            self.__dict__.update(kept)
            raise

    def doubts(self) -> list[str]:
        """What no source confirms, in words."""
        if not self.unverified:
            return []
        are = "are our estimates" if len(self.unverified) > 1 else "is our estimate"
        return [f"{', '.join(self.unverified)} {are}: no source states the device's own"]

    @property
    def sigmoid(self) -> tuple[float, float] | None:
        """Slope and centre of the transfer in force, or None for a linear one."""
        transfer = self.transfer or ("sigmoid" if self.normalization == "mean" else "linear")
        return (self.sigmoid_slope, self.sigmoid_centre) if transfer == "sigmoid" else None


class ForwardLookingSettings(SonarSettings):
    """Settings of a forward-looking sonar."""

    kind: Literal["forward_looking"] = Field(
        default="forward_looking", description="tells a settings file for this sonar from others"
    )
    beam_count: Annotated[int, Field(ge=1, le=4096)] = Field(default=256, description="beams across the fan")
    bearings: Literal["equal_angle", "equal_sine"] | list[Angle] = Field(
        default="equal_angle",
        description="beam centres [rad], left positive; a list of them sets beam_count and beam_width",
    )

    @model_validator(mode="after")
    def _bearings_make_a_fan(self) -> ForwardLookingSettings:
        self.beam_table()
        return self

    def beam_table(self) -> beams.BeamTable:
        """Where each beam looks; beam 0 is the leftmost unless a list says otherwise."""
        if isinstance(self.bearings, list):
            return beams.from_list(np.array(self.bearings), self.beam_height)
        make = beams.equal_angle if self.bearings == "equal_angle" else beams.equal_sine
        return make(self.beam_count, self.beam_width, self.beam_height)
