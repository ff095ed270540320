"""Bytes that are no ZeroMQ, thrown at a port that other hosts can reach; on the loopback only, a bounded number."""

from __future__ import annotations

import random
import resource
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware import InputPort, OutputPort, Policy
from sonar_component.middleware.transport.transport import Transport
from sonar_component.samples import Frame

CONNECTIONS = 300
# ZMTP 3.0, section 3.1: signature, version 3.0, mechanism NULL, no server, filler.
GREETING = b"\xff" + b"\0" * 8 + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + b"\0" * 32
HUGE = b"\x06" + (1 << 62).to_bytes(8, "big")  # a command whose length is a quarter of all memory there could be
REASONS = ("handshake failed", "message is not a subscription", "subscription to a topic that is not this port's")


@pytest.fixture
def transport() -> Iterator[Transport]:
    transport = Transport()
    yield transport
    transport.close()


def noise(chance: random.Random) -> bytes:
    """What port scanners, browsers and broken peers send."""
    some = chance.randbytes(chance.randrange(1, 4096))
    kinds = [some, b"GET / HTTP/1.1\r\n\r\n", GREETING + some, GREETING[: len(some) % 64], GREETING + HUGE + some]
    return chance.choice(kinds)


def throw(port: int, data: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port), timeout=2.0) as peer:
        try:
            peer.sendall(data)
            peer.settimeout(0.005)
            peer.recv(64)
        except OSError:
            return  # cut off, or kept waiting: both are right


def test_noise_on_a_tcp_port_is_counted_and_takes_neither_memory_nor_readers(
    transport: Transport, tmp_path: Path
) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        number = int(probe.getsockname()[1])
    port: OutputPort[Any] = OutputPort(Frame).own("cam", "frames")
    transport.bind(port, [f"ipc://{tmp_path}/p"])
    transport.bind_remote(port, f"tcp://127.0.0.1:{number}", "wall", None)
    reader: InputPort[Any] = InputPort(Frame).own("viewer", "frames")
    transport.connect(reader, "cam.frames", f"tcp://127.0.0.1:{number}", Policy.of("buffer", 8))
    wait_for(port.connected)
    chance = random.Random(1)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(CONNECTIONS):
        throw(number, noise(chance))
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before  # [kB]
    assert grown < 20 * 1024  # the project's bound for all malformed input; libzmq keeps 8 kB for each open connection
    rejected = transport.publishers["cam.frames"].rejected
    assert wait_for(lambda: rejected.total) > 0
    # libzmq takes bytes without a signature for the protocol's first version, and hands them on as messages.
    assert all(any(words in reason for words in REASONS) for reason in rejected.as_dict())
    port.write(Frame(time=1, image=np.zeros((4, 4, 3), np.uint8), channels="red,green,blue"))
    assert wait_for(reader.read_new).time == 1
    assert port.listeners() == 1


def wait_for(what: Any, patience: float = 5.0) -> Any:
    end = time.monotonic() + patience
    while not (found := what()) and time.monotonic() < end:
        time.sleep(0.005)
    return found
