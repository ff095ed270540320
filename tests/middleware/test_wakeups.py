"""No message waits in a socket while its reader sleeps: bursts that are echoed, so that one lost sign stops everything.

libzmq's descriptors tell of changes only. If a reader ever went to sleep with a message left, the burst's last sample
would not be echoed, and as nothing more is written before it is, nothing would wake the reader again. By hand, longer
and on a machine that is busy: ``python tests/middleware/test_wakeups.py 120``.
"""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware import InputPort, OutputPort, Policy, PortDriven, Task
from sonar_component.middleware import runner as runners
from sonar_component.middleware.policy import WriteStatus
from sonar_component.middleware.reader import PortReader
from sonar_component.middleware.runner import Runner
from sonar_component.middleware.schema import schema_of
from sonar_component.middleware.transport.loop import Bell
from sonar_component.middleware.transport.transport import Transport
from sonar_component.samples import Frame

POLICIES = [Policy("data"), Policy("buffer", 64), Policy("reliable", 2)]
WAYS = [f"{how}_{policy.kind}" for how in ("client", "task") for policy in POLICIES]
SECONDS = 4.0  # about 200 bursts to each of the six readers
PATIENCE = 30.0  # [s], far above what a busy machine makes of a burst
_SHAPES = [(1, 1, 1), (40, 40, 1), (300, 300, 1)]  # float32: within the header, copied, borrowed by libzmq


def test_no_reader_sleeps_while_a_message_waits() -> None:
    bursts, slowest = stress(SECONDS, seed=1)
    assert bursts > 20  # fewer would show nothing
    assert slowest < PATIENCE


def test_a_reliable_port_goes_on_after_its_buffer_was_emptied(tmp_path: Path) -> None:
    address, transport = f"ipc://{tmp_path}/one", Transport()
    out: OutputPort[Frame] = OutputPort(Frame).own("writer", "out")
    port: InputPort[Frame] = InputPort(Frame).own("reader", "in")
    try:
        transport.bind(out, [])
        transport.bind_reliable(out, address)
        transport.connect(port, "writer.out", address, Policy("reliable", 2))
        _wait_for(out.connected)
        for number in range(1, 6):
            while out.write(_frame(number)) is not WriteStatus.SUCCESS:
                time.sleep(0.001)
        _wait_for(lambda: port.pending() == 2)
        port.clear()  # as at the start of a task; three samples wait in the socket still
        _wait_for(lambda: port.pending() == 2)
        assert [sample.time for _ in range(2) if (sample := port.read_new())] == [3, 4]
    finally:
        transport.close()


def test_a_sample_that_cannot_be_sent_costs_its_late_joiner_alone(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    transport = Transport()
    out: OutputPort[Frame] = OutputPort(Frame).own("writer", "out")
    port: InputPort[Frame] = InputPort(Frame).own("reader", "in")
    try:
        transport.bind(out, [f"ipc://{tmp_path}/one"])
        out.write(Frame(1, "no array"))  # type: ignore[arg-type]
        transport.connect(port, "writer.out", f"ipc://{tmp_path}/one", Policy())
        _wait_for(out.connected)
        _wait_for(lambda: "cannot be sent" in caplog.text)
        out.write(_frame(2))
        _wait_for(port.pending)
    finally:
        transport.close()


def test_what_raises_in_the_sockets_thread_is_logged_and_served_again(caplog: pytest.LogCaptureFixture) -> None:
    transport, tries = Transport(), []

    class _Failing:
        fd = os.eventfd(0, os.EFD_NONBLOCK)

        def serve(self) -> None:
            tries.append(1)
            if len(tries) < 3:
                raise ZeroDivisionError("of the test")

    failing = _Failing()
    try:
        transport.loop.add(failing)
        _wait_for(lambda: len(tries) == 3)
        assert caplog.text.count("could not be served") == 2
        transport.loop.remove(failing)
    finally:
        transport.close()
        os.close(failing.fd)


def test_a_bell_rung_at_any_moment_wakes_its_waiter() -> None:
    bell, rings, seen = Bell(), 20_000, 0
    answered = threading.Semaphore(1)

    def ring() -> None:
        rng = random.Random(2)
        for _ in range(rings):
            assert answered.acquire(timeout=PATIENCE)
            _dawdle(rng, 2e-5)
            bell.ring()

    ringer = threading.Thread(target=ring)
    ringer.start()
    while seen < rings and bell.wait(PATIENCE):
        seen += 1
        answered.release()
    ringer.join()
    bell.close()
    assert seen == rings


def stress(seconds: float, seed: int, busy: int = 0) -> tuple[int, float]:
    """Bursts sent, and the longest time until one was echoed [s]; TimeoutError where one was not."""
    rng, bursts, slowest = random.Random(seed), 0, 0.0
    with TemporaryDirectory(prefix="wu") as folder, ExitStack() as stack:
        stack.enter_context(_child("echo", folder, str(seed)))
        transport = Transport()
        stack.callback(transport.close)
        ports = {way: _open_port(transport, folder, "out", way) for way in WAYS}
        echoes = {way: stack.enter_context(_reader(folder, "echo", way, rng.choice(POLICIES[:2]))) for way in WAYS}
        _wait_for(lambda: all(port.connected() for port in ports.values()), PATIENCE)
        stack.enter_context(_child("join", folder, str(seed)))
        slow = stack.enter_context(_child("read", folder, str(seed)))
        for _ in range(busy):
            stack.enter_context(_child("busy", folder, str(seed)))
        end = time.monotonic() + seconds
        while (began := time.monotonic()) < end:
            if rng.random() < 0.02:
                slow.send_signal(rng.choice([signal.SIGSTOP, signal.SIGCONT]))
            _burst(rng, ports, bursts * 100)
            for way in rng.sample(WAYS, len(WAYS)):
                last = bursts * 100 + 99
                while echoes[way].read().time != last:
                    continue
                _dawdle(rng, 3e-4)
            bursts, slowest = bursts + 1, max(slowest, time.monotonic() - began)
    return bursts, slowest


def _burst(rng: random.Random, ports: dict[str, OutputPort[Frame]], first: int) -> None:
    """One to five samples to everyone; the last one's time ends in 99."""
    more = rng.randrange(5)
    for number in [*range(first, first + more), first + 99]:
        for way in rng.sample(WAYS, len(WAYS)):
            _dawdle(rng, 1e-4)
            while ports[way].write(_frame(number, rng.choice(_SHAPES))) is WriteStatus.FAILURE:
                time.sleep(1e-4)


def _dawdle(rng: random.Random, most: float) -> None:
    """Sleep, work or go on at once: so the other side is met at every step of its way to sleep."""
    kind, duration = rng.randrange(3), rng.random() * most
    if kind == 1:
        time.sleep(duration)
    end = time.monotonic() + duration * (kind == 2)
    while time.monotonic() < end:
        continue


def _frame(number: int, shape: tuple[int, int, int] = (1, 1, 1)) -> Frame:
    return Frame(number, np.zeros(shape, np.float32))


def _wait_for(what: Any, patience: float = 5.0) -> None:
    end = time.monotonic() + patience
    while not what():
        assert time.monotonic() < end, f"did not happen within {patience} s"
        time.sleep(0.002)


def _policy(way: str) -> Policy:
    return next(policy for policy in POLICIES if policy.kind == way.partition("_")[2])


def _endpoint(folder: str, side: str, way: str, reliable: bool = False) -> str:
    return f"ipc://{folder}/{side}.{way}{'.reliable' * reliable}"


def _open_port(transport: Transport, folder: str, side: str, way: str) -> OutputPort[Frame]:
    port: OutputPort[Frame] = OutputPort(Frame).own(side, way)
    transport.bind(port, [_endpoint(folder, side, way)])
    if side == "out" and _policy(way).kind == "reliable":
        transport.bind_reliable(port, _endpoint(folder, side, way, reliable=True))
    return port


def _reader(folder: str, side: str, way: str, policy: Policy) -> PortReader[Frame]:
    endpoint = _endpoint(folder, side, way, policy.kind == "reliable")
    return PortReader(f"{side}.{way}", endpoint, "Frame", schema_of(Frame), policy, PATIENCE)


@contextmanager
def _child(role: str, folder: str, seed: str) -> Iterator[subprocess.Popen[bytes]]:
    process = subprocess.Popen([sys.executable, __file__, role, folder, seed])
    try:
        yield process
    finally:
        process.kill()
        process.wait()


class EchoTask(Task):
    """Gives back the last sample of each burst."""

    activity = PortDriven(("samples",))
    samples: InputPort[Frame] = InputPort(Frame)
    echo: OutputPort[Frame] = OutputPort(Frame)
    rng = random.Random(3)

    def update_hook(self) -> None:
        sample = self.samples.read_new()
        if sample is not None and sample.time % 100 == 99:
            self.echo.write(_frame(sample.time))
        _dawdle(self.rng, 3e-4)


def _echo(folder: str, seed: int) -> None:
    """The readers: three as other programs read, three as tasks do."""
    runners._IDLE = 10 * PATIENCE  # or a task that missed a sign would find it by looking around now and then
    transport = Transport()
    for way in WAYS:
        port = _open_port(transport, folder, "echo", way)
        if way.startswith("client"):
            threading.Thread(target=_echo_client, args=(folder, way, port, random.Random(seed)), daemon=True).start()
        else:
            _echo_task(transport, folder, way, port)


def _echo_client(folder: str, way: str, port: OutputPort[Frame], rng: random.Random) -> None:
    with _reader(folder, "out", way, _policy(way)) as reader:
        while True:
            with suppress(TimeoutError):
                sample = reader.read(rng.choice([0.0005, 0.003, None]))
                if sample.time % 100 == 99:
                    port.write(_frame(sample.time))
            _dawdle(rng, 3e-4)


def _echo_task(transport: Transport, folder: str, way: str, port: OutputPort[Frame]) -> None:
    task, policy = EchoTask(way), _policy(way)
    task.echo = port
    runner = Runner(task, EchoTask.activity, transport.loop)
    endpoint = _endpoint(folder, "out", way, policy.kind == "reliable")
    runner.bell.attend(transport.connect(task.samples, f"out.{way}", endpoint, policy))
    runner.start()
    runner.call(task.configure)
    runner.call(task.start)


def _join(folder: str, seed: int) -> None:
    """Comes and goes."""
    rng = random.Random(seed)
    while True:
        with _reader(folder, "out", rng.choice(WAYS), rng.choice(POLICIES[:2])) as reader, suppress(TimeoutError):
            reader.read(rng.random() * 0.02)


def _read(folder: str, seed: int) -> None:
    """Reads one port, and is stopped by signals now and then."""
    with _reader(folder, "out", WAYS[seed % len(WAYS)], POLICIES[0]) as reader:
        while True:
            with suppress(TimeoutError):
                reader.read(1.0)


def _busy(folder: str, seed: int) -> None:
    while True:
        continue


if __name__ == "__main__":
    if len(sys.argv) == 2:
        bursts, slowest = stress(float(sys.argv[1]), seed=int(time.time()), busy=2)
        sys.stdout.write(f"{bursts} bursts to each of {len(WAYS)} readers, the slowest took {slowest:.3f} s\n")
    else:
        {"echo": _echo, "join": _join, "read": _read, "busy": _busy}[sys.argv[1]](sys.argv[2], int(sys.argv[3]))
        signal.pause()
