"""The deployment file as a model: what may stand in it. What its names mean is looked at in check.py."""

from __future__ import annotations

import ipaddress
import re
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from sonar_component.middleware.policy import KINDS, MAX_SIZE
from sonar_component.settings.errors import suggest
from sonar_component.settings.quantity import Duration


class _Strict(BaseModel):
    # Only the outermost is compiled, as a whole. So that no other is on the way, a default is constructed, not
    # validated, and values are taken with dict(), not model_dump().
    model_config = ConfigDict(extra="forbid", populate_by_name=True, defer_build=True)


PositiveDuration = Annotated[Duration, Field(gt=0)]
# Above these a bare number was meant as milliseconds: nothing that is watched is a minute between two updates.
Period = Annotated[Duration, Field(gt=0, le=60.0)]
Age = Annotated[Duration, Field(gt=0, le=300.0)]


class PolicyFile(_Strict):
    """``policy: data`` or ``policy: {buffer: 8}``; at most one kind."""

    data: Literal[1] | None = None
    buffer: Annotated[int, Field(ge=1, le=MAX_SIZE)] | None = None
    circular_buffer: Annotated[int, Field(ge=1, le=MAX_SIZE)] | None = None
    reliable: Annotated[int, Field(ge=1, le=MAX_SIZE)] | None = None
    init: bool | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> PolicyFile:
        if len([kind for kind in KINDS if getattr(self, kind) is not None]) != 1:
            raise ValueError(f"must name one of {', '.join(KINDS)}")
        return self

    @property
    def kind(self) -> str:
        """Which kind it names."""
        return next(kind for kind in KINDS if getattr(self, kind) is not None)

    @property
    def size(self) -> int:
        """How many samples it keeps."""
        return int(getattr(self, self.kind))


def _policy_from_word(value: Any) -> Any:
    if value == "data":
        return {"data": 1}
    if isinstance(value, str):
        hint = (
            f"; write {{{value}: 4}}"
            if value in KINDS
            else f"{suggest(value, KINDS)}; allowed: data, {', '.join(f'{{{k}: N}}' for k in KINDS[1:])}"
        )
        raise ValueError(f"must be data, or a kind with its size{hint}, got {value!r}")
    return value


class ConnectionFile(_Strict):
    """One writer, one or more readers."""

    source: str = Field(alias="from")
    to: Annotated[list[str], BeforeValidator(lambda v: [v] if isinstance(v, str) else v), Field(min_length=1)]
    policy: Annotated[PolicyFile, BeforeValidator(_policy_from_word)] = PolicyFile.model_construct(data=1)
    max_age: Age | None = None


class ActivityFile(_Strict):
    """How a task is updated: one of ``periodic``, ``port_driven`` and ``slave``."""

    periodic: Period | None = None
    port_driven: list[str] | None = None
    timeout: PositiveDuration | None = None
    slave: str | None = None

    @model_validator(mode="after")
    def _one_way(self) -> ActivityFile:
        if len([w for w in (self.periodic, self.port_driven, self.slave) if w is not None]) != 1:
            raise ValueError("must name one of periodic, port_driven, slave")
        if self.timeout is not None and self.port_driven is None:
            raise ValueError("timeout goes with port_driven")
        return self


class RestartFile(_Strict):
    """What happens when a process ends or hangs."""

    restart: Literal["never", "on_failure", "always"] = "on_failure"
    max_restarts: Annotated[int, Field(ge=0)] = 5
    restart_window: PositiveDuration = 60.0
    restart_delay: PositiveDuration = 0.1
    hang_timeout: PositiveDuration = 10.0
    critical: bool = False


class RestartOverride(_Strict):
    """The same for one task; what is not given comes from ``defaults``."""

    restart: Literal["never", "on_failure", "always"] | None = None
    max_restarts: Annotated[int, Field(ge=0)] | None = None
    restart_window: PositiveDuration | None = None
    restart_delay: PositiveDuration | None = None
    hang_timeout: PositiveDuration | None = None
    critical: bool | None = None


class TaskFile(RestartOverride):
    """One task."""

    type: str
    process: str | None = None
    host: str | None = None
    config: Annotated[list[str], BeforeValidator(lambda v: [v] if isinstance(v, str) else v)] = []
    properties: dict[str, Any] = {}
    activity: ActivityFile | None = None


def _address(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z0-9]([A-Za-z0-9.-]*[A-Za-z0-9])?", value):
        raise ValueError(f"must be an IPv4 address or the name of a host, got {value!r}")
    return value


class HostFile(_Strict):
    """A machine that runs some of the tasks."""

    address: Annotated[str, AfterValidator(_address)]
    port: Annotated[int, Field(ge=1024, le=65000)] = 7600
    key: str | None = None

    @property
    def is_loopback(self) -> bool:
        """Whether nobody outside the machine can reach it; of a name, other than localhost, that is not known."""
        try:
            return ipaddress.ip_address(self.address).is_loopback
        except ValueError:
            return self.address == "localhost"


class ClockFile(_Strict):
    """Which time the tasks live in."""

    mode: Literal["wall", "sim"] = "wall"
    rate: Annotated[float, Field(gt=0, le=1000)] = 1.0
    lockstep: bool = False
    step: PositiveDuration | None = None
    start: Annotated[Duration, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _fits(self) -> ClockFile:
        if self.mode == "wall" and (self.rate != 1.0 or self.lockstep or self.start):
            raise ValueError("rate, lockstep and start need mode: sim")
        if self.step is not None and not self.lockstep:
            raise ValueError("step goes with lockstep: true")
        return self


class DeploymentFile(_Strict):
    """The whole file."""

    version: Literal[1]
    name: str | None = None
    description: str = ""
    clock: ClockFile = ClockFile.model_construct()
    defaults: RestartFile = RestartFile.model_construct()
    hosts: dict[str, HostFile] = {}
    insecure: bool = False
    tasks: Annotated[dict[str, TaskFile], Field(min_length=1)]
    connections: list[ConnectionFile] = []
