"""Ports and tasks of a running graph, for other programs and notebooks.

    with connect("fls.sonar_samples") as port:
        for sonar in port:
            print(sonar.bins.shape)

    with connect("fls.sonar_pose_cmd", write=True) as port:
        port.write(RigidBodyState(time=now, position=..., orientation=...))

    with connect_task("fls") as fls:
        fls.set("range", "30 m")

Only the run directory is needed. For another host, `deployment` names the file that both sides have, or `endpoint` says
where the port is.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, TypeVar, overload

from sonar_component.middleware.codec import decode_untyped
from sonar_component.middleware.policy import KINDS, Policy
from sonar_component.middleware.proxy import TaskProxy
from sonar_component.middleware.reach import Place, Reach
from sonar_component.middleware.reader import Decoder, PortReader
from sonar_component.middleware.schema import Schema, schema_of
from sonar_component.middleware.transport.keys import joining
from sonar_component.middleware.writer import PortWriter
from sonar_component.settings.errors import SettingsError, suggest

T = TypeVar("T")
_SIZE = 16  # samples that a buffer keeps where no size is given
AnyPolicy = str | Mapping[str, Any] | Policy
Keys = str | tuple[str, str | Path]
File = str | Path


@overload
def connect(
    name: str, sample_type: type[T], *, write: Literal[True], policy: AnyPolicy = ..., size: int | None = ...,
    shared: bool = ..., timeout: float | None = ..., instance: str | None = ..., deployment: File | None = ...,
) -> PortWriter[T]: ...  # fmt: skip
@overload
def connect(
    name: str, sample_type: None = ..., *, write: Literal[True], policy: AnyPolicy = ..., size: int | None = ...,
    shared: bool = ..., timeout: float | None = ..., instance: str | None = ..., deployment: File | None = ...,
) -> PortWriter[Any]: ...  # fmt: skip
@overload
def connect(
    name: str, sample_type: type[T], *, write: Literal[False] = ..., policy: AnyPolicy = ..., size: int | None = ...,
    timeout: float | None = ..., instance: str | None = ..., deployment: File | None = ..., endpoint: str | None = ...,
    keys: Keys | None = ..., decoder: Decoder | None = ...,
) -> PortReader[T]: ...  # fmt: skip
@overload
def connect(
    name: str, sample_type: None = ..., *, write: Literal[False] = ..., policy: AnyPolicy = ..., size: int | None = ...,
    timeout: float | None = ..., instance: str | None = ..., deployment: File | None = ..., endpoint: str | None = ...,
    keys: Keys | None = ..., decoder: Decoder | None = ...,
) -> PortReader[Any]: ...  # fmt: skip


def connect(
    name: str,
    sample_type: type[Any] | None = None,
    *,
    write: bool = False,
    policy: AnyPolicy = "data",
    size: int | None = None,
    shared: bool = False,
    timeout: float | None = 5.0,
    instance: str | None = None,
    deployment: File | None = None,
    endpoint: str | None = None,
    keys: Keys | None = None,
    decoder: Decoder | None = None,
) -> PortReader[Any] | PortWriter[Any]:
    """Read an output port of a running task, or write to an input port.

    Parameters
    ----------
    name : ``task.port`` or ``instance/task.port``.
    sample_type : the expected dataclass, for type checkers and as a check; found by its name otherwise.
    write : to an input port, on this host, as long as nobody else writes to it.
    policy, size : as in a deployment: ``data`` for the latest sample; ``buffer``, ``circular_buffer`` or ``reliable``
        with a size (16 by default), also as ``{"buffer": 8}``. With ``reliable`` the one who writes is told when there
        is no room; it needs both on one host.
    shared : write beside others, whose samples then take turns with ours.
    timeout : seconds to wait for the task and for each sample; None for ever.
    instance : which, where several run here.
    deployment : file whose hosts are reached, for tasks that do not run here.
    endpoint : ZeroMQ address, where there is neither a run directory nor a deployment in common.
    keys : name of our own pair (``sonar keys new NAME``) for a deployment's hosts; for an endpoint that another host
        guards, with the file of the server's public key.
    decoder : replaces the sample type; for tools that look at headers only.

    Raises
    ------
    SettingsError
        If there is no such port, its type is another, or it is taken; names the nearest and what is allowed.
    """
    wanted = _policy(policy, size)
    if endpoint is not None:
        return _read_at(name, sample_type, endpoint, wanted, timeout, keys, decoder, write)
    task, dot, _ = name.rpartition(".")
    if not dot:
        raise SettingsError(f"must be TASK.PORT, got {name!r}")
    key = keys if isinstance(keys, str) or keys is None else keys[0]
    place = Reach(instance, deployment, key).find(task, timeout)
    if write:
        return _writer(name, sample_type, place, wanted, timeout, shared)
    return _reader(name, sample_type, place, wanted, timeout, decoder)


def connect_task(
    name: str, *, timeout: float = 5.0, instance: str | None = None, deployment: File | None = None,
    keys: str | None = None,
) -> TaskProxy:  # fmt: skip
    """Talk to a running task, ``task`` or ``instance/task``; on another host by the deployment file.

    Raises
    ------
    SettingsError
        If no such task runs; names the nearest.
    """
    place = Reach(instance, deployment, keys).find(name, timeout)
    return TaskProxy(place.record, timeout, place.join)


def _reader(
    name: str, sample_type: type[Any] | None, place: Place, policy: Policy, timeout: float | None,
    decoder: Decoder | None,
) -> PortReader[Any]:  # fmt: skip
    name, port = _port(name, place, "out")
    if not port["endpoint"]:
        raise SettingsError(f"{name} does not leave host {place.host!r}: no task of another host reads it")
    if policy.kind == "reliable" and place.host:
        raise SettingsError(f"a reliable connection must stay on one host; {name} is on host {place.host!r}")
    cls = _type(name, port, sample_type, "gives")
    control = place.record["control"] if policy.kind == "reliable" else None
    reads = decoder or _decoder(cls)
    return PortReader(name, port["endpoint"], port["type"], reads, policy, timeout, place.join, control)


def _writer(
    name: str, sample_type: type[Any] | None, place: Place, policy: Policy, timeout: float | None, shared: bool
) -> PortWriter[Any]:
    name, port = _port(name, place, "in")
    if place.host:
        raise SettingsError(f"{name} is on host {place.host!r}: a client writes on its own host only")
    cls = _type(name, port, sample_type, "takes")
    if cls is None:
        raise SettingsError(f"{name} takes {port['type']}, which is not installed here: give its class as sample_type")
    return PortWriter(name, cls, place.record["control"], policy, timeout, shared)


def _read_at(
    name: str, cls: type[Any] | None, endpoint: str, policy: Policy, timeout: float | None, keys: Keys | None,
    decoder: Decoder | None, write: bool,
) -> PortReader[Any]:  # fmt: skip
    if write or policy.kind == "reliable":
        what = "writing" if write else "a reliable connection"
        raise SettingsError(f"{what} needs the task's process on this host; leave endpoint out")
    if isinstance(keys, str):
        raise SettingsError("keys of an endpoint are a pair: our own name and the file of the server's public key")
    join = None if keys is None else joining(keys[0], Path(keys[1]))
    type_name = cls.__name__ if cls else ""
    return PortReader(name, endpoint, type_name, decoder or _decoder(cls), policy, timeout, join)


def _policy(given: AnyPolicy, size: int | None) -> Policy:
    from pydantic import ValidationError

    from sonar_component.middleware.deployment.file import PolicyFile
    from sonar_component.settings.validation import explain

    if isinstance(given, Policy):
        return given
    if isinstance(given, str):
        if given not in KINDS:
            raise SettingsError(f"policy must be one of {', '.join(KINDS)}, got {given!r}{suggest(given, KINDS)}")
        given = {given: 1 if given == "data" else _SIZE if size is None else size}
    try:
        wanted = PolicyFile.model_validate(dict(given))
    except ValidationError as error:
        mistakes = explain(PolicyFile, dict(given), error.errors())
        words = [": ".join([".".join(map(str, ("policy", *place))), words]) for place, words in mistakes]
        raise SettingsError("; ".join(words)) from None
    # A client wants the last value at once, whatever the kind: it has just come.
    return Policy(wanted.kind, wanted.size, True if wanted.init is None else wanted.init)


def _port(name: str, place: Place, direction: str) -> tuple[str, dict[str, Any]]:
    port, ports = name.rpartition(".")[2], place.record["ports"]
    fitting = {key: value for key, value in ports.items() if value["direction"] == direction}
    if port not in fitting:
        task, side = place.record["task"], "output" if direction == "out" else "input"
        other = "; it is an input: to write to it, say write=True" if side == "output" else "; it is an output"
        hint = other if port in ports else suggest(port, fitting)
        raise SettingsError(f"{task} has no {side} port {port!r}{hint}; it has: {', '.join(fitting) or 'none'}")
    return f"{place.record['task']}.{port}", fitting[port]


def _type(name: str, port: dict[str, Any], given: type[Any] | None, does: str) -> type[Any] | None:
    if given is not None and given.__name__ != port["type"]:
        raise SettingsError(f"{name} {does} {port['type']}, not {given.__name__}")
    return given or known_type(port["type"])


def _decoder(cls: type | None) -> Decoder | Schema:
    if cls is None:
        return decode_untyped
    return schema_of(cls)


def known_type(name: str) -> type | None:
    """The sample type of that name, if it is installed here."""
    from sonar_component import samples
    from sonar_component.middleware.task import TaskState
    from sonar_component.samples import scene_description

    if name == TaskState.__name__:
        return TaskState
    for module in (samples, scene_description):
        found = getattr(module, name, None)
        if isinstance(found, type) and hasattr(found, "__dataclass_fields__"):
            return found
    return None
