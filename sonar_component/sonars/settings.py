"""What a user sets on a sonar: Rock's property names, with units and limits."""

from __future__ import annotations

import math
from typing import Annotated, Literal

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
    """Settings that every imaging sonar has.

    Attributes
    ----------
    range, min_range : float
        End of the last bin, and where echoes begin [m].
    max_range : float
        The greatest range that the device can be set to [m].
    gain : float
        0.5 is unity [-].
    bin_count : int
    beam_width, beam_height : float
        Opening of the fan in azimuth and in elevation [rad].
    normalization : "mean" or "energy"
        The paper's mean over the surface in a bin, or the energy that it returns.
    transfer : "sigmoid", "linear" or None
        What becomes of the strength of a sample; None takes the paper's sigmoid for "mean", linear for "energy".
    sigmoid_slope, sigmoid_centre : float
        Constants of that sigmoid [-].
    accuracy : float
        Energy error to aim for [-].
    speed_of_sound : float
        [m/s]
    seed : int
        Of the noise.
    reduction : "auto", "cpu" or "gpu"
        Where samples become bins; auto takes the faster way for the driver.
    speckle_properties : SpeckleProperties
        Law, correlation and persistence of the speckle, or the name of a preset.
    spreading : float
        Loss by spreading, there and back [dB per decade of range]; 0 for a receiver that makes up for it.
    time_varying_gain : TimeVaryingGain
        What the receiver sets against losses.
    in_ping_motion : bool
        Whether the far bins of a ping see the later pose, from the velocities that come with the pose.
    frame : str
        Name of the sensor's frame in its samples.
    unverified : list of str
        Names of properties whose value in the file no source confirms.
    """

    model_config = ConfigDict(extra="forbid", defer_build=True, validate_assignment=True, validate_default=True)

    range: Length = 50.0
    min_range: Length = 0.0
    max_range: Length = 1000.0
    gain: Ratio = 0.5
    bin_count: Annotated[int, Field(ge=1, le=4096)] = 750
    beam_width: Angle = 120 * _DEG
    beam_height: Angle = 20 * _DEG
    normalization: Literal["mean", "energy"] = "mean"
    transfer: Literal["sigmoid", "linear"] | None = None
    sigmoid_slope: Annotated[float, Field(gt=0, le=1000)] = 18.0
    sigmoid_centre: Annotated[float, Field(ge=0, le=10)] = 2 / 3
    accuracy: Ratio = 0.02
    speed_of_sound: Speed = SPEED_OF_SOUND
    seed: Annotated[int, Field(ge=0)] = 0
    enable_attenuation: bool = False
    attenuation_properties: AttenuationProperties = AttenuationProperties()
    enable_speckle_noise: bool = False
    speckle_properties: SpeckleProperties = SpeckleProperties()
    spreading: Annotated[Level, Field(ge=0, le=80)] = 0.0
    time_varying_gain: TimeVaryingGain = TimeVaryingGain()
    in_ping_motion: bool = False
    reduction: Literal["auto", "cpu", "gpu"] = "auto"
    frame: str = "sonar"
    unverified: list[str] = []

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
        names = ", ".join(self.unverified)
        return [f"no source confirms the values of: {names}"] if names else []

    @property
    def sigmoid(self) -> tuple[float, float] | None:
        """Slope and centre of the transfer in force, or None for a linear one."""
        transfer = self.transfer or ("sigmoid" if self.normalization == "mean" else "linear")
        return (self.sigmoid_slope, self.sigmoid_centre) if transfer == "sigmoid" else None


class ForwardLookingSettings(SonarSettings):
    """Settings of a forward-looking sonar.

    Attributes
    ----------
    beam_count : int
    kind : str
        Tells a settings file for this sonar from others.
    bearings : "equal_angle", "equal_sine" or list of float
        Beam centres [rad], left positive. A list sets beam_count and beam_width.
    """

    kind: Literal["forward_looking"] = "forward_looking"
    beam_count: Annotated[int, Field(ge=1, le=4096)] = 256
    bearings: Literal["equal_angle", "equal_sine"] | list[Angle] = "equal_angle"

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
