"""What a user sets on the receiver's time-varying gain."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

from sonar_component.settings.quantity import Attenuation, Level


class TimeVaryingGain(BaseModel):
    """Gain that grows with range, against losses: see acoustics/spreading.py.

    Attributes
    ----------
    spreading : float
        Against spreading, there and back [dB per decade of range].
    absorption : float
        Against absorption, one way [dB/m].
    limit : float
        Greatest gain of the amplifier [dB].
    """

    model_config = ConfigDict(extra="forbid", defer_build=True, frozen=True)

    spreading: Annotated[Level, Field(ge=0, le=80)] = 0.0
    absorption: Annotated[Attenuation, Field(ge=0, le=10)] = 0.0
    limit: Annotated[Level, Field(ge=0, le=200)] = 100.0
