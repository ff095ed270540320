"""What our ports cost beside raw pyzmq: both in one run, turn by turn, so that a busy machine treats them alike.

Latency runs from just before packing to a typed array in the reader, between two processes over ipc.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np
import zmq

from sonar_component.middleware.client import connect
from sonar_component.middleware.policy import Policy
from sonar_component.middleware.ports import OutputPort
from sonar_component.middleware.proc import processor_time
from sonar_component.middleware.transport.transport import Transport
from sonar_component.samples import RigidBodyState, Sonar

KINDS = ("frame", "pose")
TARGETS = {"frame": 1.15, "pose": 1.3}  # p50 over that of raw pyzmq
HZ_TARGET = 0.05  # [-], of a core
_TOPIC = b"raw\0"
_ALL = Policy("buffer", 1 << 16)  # as with raw pyzmq, what a busy machine keeps from being read in time is not left out
_PAUSE = 0.004  # [s], between two samples: long enough for the last one to have arrived


def bench_transport(count: int = 300) -> dict[str, Any]:
    """Latency of 1.024 MB frames and of poses, ours beside raw pyzmq, and the cost of reading headers only.

    Returns
    -------
    dict
        For each kind ``ours_us`` and ``raw_us`` (p50, p99), ``ratio`` of the p50s and the ``target``; and ``hz_cpu``,
        the share of a core [-] that a header reader takes on 1 MB at 100 Hz, with ``hz_target``.
    """
    result: dict[str, Any] = {kind: _latency(kind, count) for kind in KINDS}
    result["hz_cpu"], result["hz_target"] = _header_cost(), HZ_TARGET
    return result


def _latency(kind: str, count: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="sb") as folder:
        ours, raw = f"ipc://{folder}/ours", f"ipc://{folder}/raw"
        context = zmq.Context()
        socket = context.socket(zmq.SUB)
        socket.linger = 0
        socket.subscribe(_TOPIC)
        socket.connect(raw)
        with (
            connect("bench.samples", _TYPES[kind], policy=_ALL, endpoint=ours, timeout=20.0) as reader,
            _writer(folder, kind, count),
        ):
            pairs = [(_read_raw(socket), _read_ours(reader)) for _ in range(count)]
        socket.close()
        context.term()
    warm = pairs[count // 10 :]
    raw_us, ours_us = _spread([pair[0] for pair in warm]), _spread([pair[1] for pair in warm])
    return {"raw_us": raw_us, "ours_us": ours_us, "ratio": ours_us["p50"] / raw_us["p50"], "target": TARGETS[kind]}


_TYPES: dict[str, type[Any]] = {"frame": Sonar, "pose": RigidBodyState}


class _writer:  # noqa: N801 - reads as a verb where it is used
    """The other process, for as long as the block lasts."""

    def __init__(self, folder: str, kind: str, count: int) -> None:
        code = "import sys; from sonar_component.middleware.benchmark import write; write(*sys.argv[1:])"
        self._process = subprocess.Popen([sys.executable, "-c", code, folder, kind, str(count)])

    def __enter__(self) -> subprocess.Popen[bytes]:
        return self._process

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


def _read_raw(socket: Any) -> float:
    if not socket.poll(20_000):
        raise TimeoutError("nothing came over the raw socket")
    frames = socket.recv_multipart(copy=False)
    array = np.frombuffer(frames[2].buffer, np.float32)
    return (time.monotonic_ns() - int.from_bytes(frames[1].bytes, "little")) / 1e3 + 0.0 * array.size


def _read_ours(reader: Any) -> float:
    sample = reader.read()
    return float(time.monotonic_ns() - sample.time * 1000) / 1e3


def _spread(values: list[float]) -> dict[str, float]:
    ordered = sorted(values)
    return {"p50": statistics.median(ordered), "p99": ordered[int(len(ordered) * 0.99)]}


def write(folder: str, kind: str, count: str) -> None:
    """The writing process: raw and ours by turns."""
    transport = Transport()
    # As long as raw pyzmq's: with 8, a reader that stands still for 0.1 s misses a frame, and waits for it in vain.
    port: OutputPort[Any] = OutputPort(_TYPES[kind], queue=1000).own("bench", "samples")
    transport.bind(port, [f"ipc://{folder}/ours"])
    socket = transport.context.socket(zmq.XPUB)
    socket.bind(f"ipc://{folder}/raw")
    socket.recv()
    while not port.connected():
        time.sleep(0.001)
    for _ in range(int(count)):
        payload = _sample(kind)
        time.sleep(_PAUSE)
        array = payload.bins if kind == "frame" else np.zeros(50, np.float32)  # 200 bytes, as a packed pose
        socket.send_multipart([_TOPIC, time.monotonic_ns().to_bytes(8, "little"), array], copy=kind != "frame")
        payload = _sample(kind)
        time.sleep(_PAUSE)
        payload.time = time.monotonic_ns() // 1000
        port.write(payload)
    time.sleep(5)


def _sample(kind: str) -> Any:
    """A fresh one each time, as a sonar makes it."""
    if kind == "pose":
        return RigidBodyState(position=np.zeros(3), orientation=np.array([1.0, 0.0, 0.0, 0.0]))
    bins = np.ones((256, 1000), np.float32)
    return Sonar(bearings=np.zeros(256), bin_count=1000, beam_count=256, bins=bins, bin_duration=1e-5)


def _header_cost(seconds: float = 3.0) -> float:
    """Share of a core that `sonar hz` takes on a port of 1 MB at 100 Hz."""
    code = "import sys; from sonar_component.middleware.benchmark import read_headers; read_headers(sys.argv[1])"
    with tempfile.TemporaryDirectory(prefix="sb") as folder:
        transport = Transport()
        port: OutputPort[Any] = OutputPort(Sonar, queue=8).own("bench", "samples")
        transport.bind(port, [f"ipc://{folder}/ours"])
        reader = subprocess.Popen([sys.executable, "-c", code, f"ipc://{folder}/ours"])
        try:
            while not port.connected():
                time.sleep(0.01)
            used, began = processor_time(reader.pid), time.monotonic()
            while (elapsed := time.monotonic() - began) < seconds:
                port.write(_sample("frame"))
                time.sleep(max(0.0, 0.01 - (time.monotonic() - began - elapsed)))
            return (processor_time(reader.pid) - used) / elapsed
        finally:
            reader.kill()
            reader.wait()
            transport.close()


def read_headers(endpoint: str) -> None:
    """The reading process of `_header_cost`: what `sonar hz` does."""
    with connect("bench.samples", endpoint=endpoint, timeout=30.0, decoder=lambda header, _: None) as reader:
        while True:
            reader.receive()
