"""Real sockets: what goes through, what is refused, and what a slow or hostile peer can do."""

from __future__ import annotations

import os
import random
import signal
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
import zmq

from sonar_component.middleware import InputPort, OutputPort, Policy
from sonar_component.middleware.codec import encode
from sonar_component.middleware.ports import WriteStatus
from sonar_component.middleware.transport.control import ControlServer
from sonar_component.middleware.transport.transport import Transport
from sonar_component.samples import Frame, Sonar

ENVELOPE: dict[str, Any] = {
    "e": 1, "type": "Sonar", "sv": [1, 0], "sh": "0", "src": "fls.sonar_samples", "run": "r", "seq": 7, "t": 5, "tp": 6,
    "clk": "wall",
}  # fmt: skip
TOPIC = b"fls.sonar_samples\0"


@pytest.fixture
def transport() -> Iterator[Transport]:
    transport = Transport()
    yield transport
    transport.close()


@pytest.fixture
def strange() -> Iterator[Any]:
    """Opens sockets that follow no rule of ours."""
    context = zmq.Context()
    sockets: list[Any] = []

    def open_socket(kind: int) -> Any:
        sockets.append(context.socket(kind))
        return sockets[-1]

    yield open_socket
    context.destroy(linger=0)


@pytest.fixture
def address(tmp_path: Path) -> str:
    return f"ipc://{tmp_path}/port"


def a_frame(time: int = 1, size: int = 4) -> Frame:
    return Frame(time, np.zeros((size, 1, 1), np.float32))


def writer(transport: Transport, address: str, queue: int = 64) -> OutputPort[Frame]:
    port: OutputPort[Frame] = OutputPort(Frame, queue=queue).own("writer", "out")
    transport.bind(port, [address])
    return port


def reader(transport: Transport, address: str, policy: Policy) -> InputPort[Frame]:
    port: InputPort[Frame] = InputPort(Frame).own("reader", "in")
    transport.connect(port, "writer.out", address, policy)
    return port


def wait_for(what: Any, patience: float = 5.0) -> Any:
    end = time.monotonic() + patience
    while time.monotonic() < end:
        if result := what():
            return result
        time.sleep(0.005)
    raise AssertionError(f"did not happen within {patience} s")


def resident() -> int:
    """Memory of this process [bytes]."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def test_samples_arrive_in_order_with_nothing_lost(transport: Transport, address: str) -> None:
    out = writer(transport, address, queue=1000)
    port = reader(transport, address, Policy("buffer", 1000, False))
    wait_for(out.connected)
    for number in range(1, 501):
        out.write(a_frame(number))
    wait_for(lambda: port.pending() == 500)
    assert [port.read_new().time for _ in range(500)] == list(range(1, 501))  # type: ignore[union-attr]
    assert port.connections[0].mailbox.account.lost == 0


def test_listeners_are_counted_exactly(transport: Transport, address: str) -> None:
    out = writer(transport, address)
    others = [Transport() for _ in range(3)]
    for number, other in enumerate(others, 1):
        reader(other, address, Policy())
        wait_for(lambda number=number: out.listeners() == number)
    for number, other in enumerate(others, 1):
        other.close()
        wait_for(lambda number=number: out.listeners() == 3 - number)


def test_a_late_joiner_alone_is_given_the_last_sample_whatever_its_size(transport: Transport, address: str) -> None:
    out = writer(transport, address)
    first = reader(transport, address, Policy())
    wait_for(out.connected)
    out.write(a_frame(7, size=1_000_000))
    wait_for(first.pending)
    late = reader(transport, address, Policy())
    asked = time.monotonic()
    wait_for(late.pending)
    assert time.monotonic() - asked < 1.0
    assert late.read_new().image.shape == (1_000_000, 1, 1)  # type: ignore[union-attr]
    assert first.connections[0].mailbox.account.received == 1


def test_a_reliable_reader_that_stops_reading_is_felt_by_the_writer_and_by_nobody_else(
    transport: Transport, address: str
) -> None:
    out = writer(transport, address, queue=1000)
    free = reader(transport, address, Policy("buffer", 2000, False))
    lazy: InputPort[Frame] = InputPort(Frame).own("lazy", "in")
    transport.bind_reliable(out, f"{address}.lazy")
    transport.connect(lazy, "writer.out", f"{address}.lazy", Policy("reliable", 2, False))
    wait_for(lambda: out.listeners() == 2)
    statuses = [out.write(a_frame(number, size=50_000)) for number in range(1, 201)]
    assert WriteStatus.FAILURE in statuses
    delivered = statuses.count(WriteStatus.SUCCESS)
    wait_for(lambda: free.pending() == 200)
    seen = []
    while len(seen) < delivered:
        wait_for(lazy.pending)
        seen.append(lazy.read_new())
    assert [frame.time for frame in seen] == [n for n, s in enumerate(statuses, 1) if s is WriteStatus.SUCCESS]  # type: ignore[union-attr]


def test_a_data_connection_to_a_slow_reader_stays_fresh_and_memory_flat(transport: Transport, address: str) -> None:
    out = writer(transport, address, queue=8)
    port = reader(transport, address, Policy())
    wait_for(out.connected)
    stop = threading.Event()

    def produce() -> None:  # 30 Hz of 1 MB
        while not stop.wait(1 / 30):
            out.write(a_frame(time.monotonic_ns() // 1000, size=256_000))

    thread = threading.Thread(target=produce)
    thread.start()
    ages, memory = [], []
    try:
        for _ in range(20):  # 5 Hz
            time.sleep(0.2)
            sample = port.read_new()
            assert sample is not None
            ages.append(time.monotonic_ns() / 1e6 - sample.time / 1e3)
            memory.append(resident())
    finally:
        stop.set()
        thread.join()
    assert statistics.median(ages) <= 35  # [ms], the issue's; one period of 33 ms is the oldest that the latest can be
    assert memory[-1] - memory[4] < 20e6  # 20 frames; a queue would have kept 75
    account = port.connections[0].mailbox.account
    assert account.received == account.replaced + 20 + port.pending()


def test_a_reader_that_stands_still_disturbs_no_other(transport: Transport, address: str) -> None:
    out = writer(transport, address, queue=64)
    script = (
        "import sys, time; from sonar_component.middleware import *; from sonar_component.samples import Frame\n"
        "with connect('writer.out', Frame, endpoint=sys.argv[1], timeout=None) as port:\n"
        "    for _ in port: print('x', flush=True)\n"
    )
    other = subprocess.Popen([sys.executable, "-c", script, address], stdout=subprocess.PIPE)
    try:
        wait_for(out.connected, 20.0)
        port = reader(transport, address, Policy("buffer", 1000, False))
        wait_for(lambda: out.listeners() == 2)
        other.send_signal(signal.SIGSTOP)
        for number in range(1, 301):  # far more than the queue and the pipes to the other hold
            out.write(a_frame(number, size=50_000))
            time.sleep(0.001)
        wait_for(lambda: port.pending() == 300)
        assert port.connections[0].mailbox.account.lost == 0
    finally:
        other.kill()
        other.wait()
        other.stdout.close()  # type: ignore[union-attr]


def malformed(chance: random.Random) -> list[bytes]:
    """One message that breaks the format in one of the ways that the issue names."""
    sonar = Sonar(
        bearings=np.zeros(3), bin_count=999, beam_count=3, bins=np.zeros((3, 999), np.float32), bin_duration=1.0
    )
    frames = [bytes(frame) for frame in encode(sonar, ENVELOPE)]
    header = msgpack.unpackb(frames[0])
    kind = chance.randrange(9)
    if kind == 0:
        return [TOPIC, chance.randbytes(chance.randrange(300))]
    if kind == 1:
        return [TOPIC, frames[0][: chance.randrange(len(frames[0]))], *frames[1:]]
    if kind == 2:
        return [TOPIC, b"\xdd\xff\xff\xff\xff"]
    if kind == 3:
        return [TOPIC, frames[0]]  # half a message
    if kind == 4:
        return [TOPIC]
    if kind == 5:
        return [TOPIC + b"x", *frames]
    if kind == 6:
        return [TOPIC, frames[0], frames[1], b"more"]
    entry = header["arr"][-1]
    while len(entry) == 4:
        entry = chance.choice(header["arr"])
    entry[1 if kind == 7 else 2] = chance.choice(["|O", "<M8[s]", "<f8"]) if kind == 7 else [chance.randrange(2**40), 5]
    return [TOPIC, msgpack.packb(header), frames[1]]


def test_ten_thousand_malformed_samples_are_counted_and_do_no_harm(
    transport: Transport, address: str, strange: Any
) -> None:
    hostile = strange(zmq.XPUB)
    hostile.setsockopt(zmq.XPUB_NODROP, 1)
    hostile.bind(address)
    port: InputPort[Sonar] = InputPort(Sonar).own("reader", "in")
    transport.connect(port, "fls.sonar_samples", address, Policy("buffer", 10, False))
    assert hostile.recv() == b"\x01" + TOPIC
    chance = random.Random(6)
    rejected = transport.subscribers[0].rejected
    for number in range(10_000):
        send_all(hostile, malformed(chance))
        if number == 1000:
            before = resident()
    wait_for(lambda: rejected.total == 10_000, 20.0)
    assert resident() - before < 20e6
    assert port.pending() == 0
    send_all(hostile, [TOPIC, *encode(Sonar(bin_duration=1.0), ENVELOPE)])  # the port still works
    wait_for(port.pending)


def send_all(socket: Any, frames: list[bytes]) -> None:
    assert socket.poll(5000, zmq.POLLOUT)
    socket.send_multipart(frames)


def test_ten_thousand_malformed_subscriptions_are_counted_and_do_no_harm(
    transport: Transport, address: str, strange: Any
) -> None:
    out = writer(transport, address)
    publisher = transport.publishers["writer.out"]
    hostile = strange(zmq.XSUB)
    hostile.setsockopt(zmq.SNDHWM, 0)  # XSUB drops what does not fit
    hostile.connect(address)
    chance = random.Random(6)
    sent = 0
    for number in range(10_000):
        kind = chance.randrange(3)
        if kind == 0:  # a subscription to something that is not here
            frames = [b"\1" + chance.randbytes(1 + chance.randrange(100)).replace(b"@", b"a")]
        elif kind == 1:
            frames = [bytes([2 + chance.randrange(250)]) + chance.randbytes(chance.randrange(190))]
        else:
            frames = [b"hello", b"world"]
        send_all(hostile, frames)
        sent += 1
        if number == 1000:
            before = resident()
    wait_for(lambda: publisher.rejected.total >= sent, 20.0)
    assert resident() - before < 20e6
    assert out.listeners() == 0
    port = reader(transport, address, Policy())
    wait_for(out.connected)
    out.write(a_frame())
    wait_for(port.pending)


def test_ten_thousand_malformed_requests_are_counted_and_do_no_harm(
    transport: Transport, address: str, strange: Any
) -> None:
    server = ControlServer(transport.context, [address], transport.loop, lambda request: request["op"])
    hostile = strange(zmq.DEALER)
    hostile.connect(address)
    chance = random.Random(6)
    shapes: list[list[bytes]] = [
        [b""],
        [b"", b"", b""],
        [b"x", b"\x80"],
        [b"", b"\x80"],
        [b"", b"\xdd\xff\xff\xff\xff"],
        [b"", b"\x81\xa2op\x01"],
    ]
    for number in range(10_000):
        send_all(hostile, chance.choice([*shapes, [b"", b"\xc1" + chance.randbytes(chance.randrange(300))]]))
        if number == 1000:
            before = resident()
    wait_for(lambda: server.rejected.total == 10_000, 20.0)
    assert resident() - before < 20e6
    hostile.send_multipart([b"", msgpack.packb({"id": 1, "op": "echo"})])
    assert hostile.poll(2000)
    assert msgpack.unpackb(hostile.recv_multipart()[1]) == {"id": 1, "result": "echo"}
    server.close()


def test_a_frame_above_the_limit_is_cut_off_and_the_next_is_read(
    transport: Transport, address: str, strange: Any
) -> None:
    hostile = strange(zmq.PUB)
    hostile.bind(address)
    port: InputPort[Sonar] = InputPort(Sonar, max_bytes=1 << 20).own("reader", "in")
    transport.connect(port, "fls.sonar_samples", address, Policy("buffer", 10, False))
    before = resident()
    good = [TOPIC, *encode(Sonar(bin_duration=1.0), ENVELOPE)]

    def arrives() -> int:
        hostile.send_multipart(good)
        return port.pending()

    wait_for(arrives)
    port.read()
    for _ in range(5):
        hostile.send_multipart([TOPIC, b"\x80", bytes(5 << 20)])  # above 4 MB, the limit of headers
        time.sleep(0.05)
    good[:] = [TOPIC, *encode(Sonar(bin_duration=1.0), {**ENVELOPE, "seq": 8})]
    wait_for(arrives)
    assert any("a frame above the limit" in reason for reason in port.connections[0].mailbox.account.rejected)
    assert resident() - before < 60e6  # what the sender itself holds is in it
