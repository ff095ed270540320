"""One process of a deployment as the launcher holds it: what runs now, its pipes, and what became of those before."""

from __future__ import annotations

import fcntl
import json
import os
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from sonar_component.middleware.deployment.plan import RestartPlan
from sonar_component.middleware.ladder import Ladder
from sonar_component.middleware.proc import processor_time
from sonar_component.middleware.process_log import ProcessLog

_STARTUP = 60.0  # [s] without a sign of life that imports, configuration and a first cycle that compiles may take
_COMING_UP = ("configure_hook", "start_hook")
_PIPE_BYTES = 1 << 20  # of what it prints: so much waits while the launcher itself is held up
_PROGRAM = (
    "import sys; from sonar_component.middleware.lifeline import die_with; die_with(int(sys.argv[1]));"
    "from sonar_component.middleware.process_main import main; main(*sys.argv[2:])"
)
# glibc gives a megabyte back to the kernel at each free() unless told otherwise; measured: 58 % more frames over tcp.
_MALLOC = {"MALLOC_MMAP_THRESHOLD_": str(32 << 20), "MALLOC_TRIM_THRESHOLD_": str(64 << 20)}


@dataclass
class Child:
    """A process and its history.

    Attributes
    ----------
    events : what it tells us, one line of JSON each; ``output`` is what it prints.
    young : no task has finished a second cycle yet.
    restarts, delay, due : times of past restarts, the present delay between two, when the next one is due.
    mending : task -> when it is to be brought up again.
    given_up, hung, refused : not started again; why it is killed; could not be built.
    """

    name: str
    tasks: list[str]
    rules: RestartPlan
    log: ProcessLog
    process: subprocess.Popen[bytes] | None = None
    events: IO[bytes] | None = None
    output: IO[bytes] | None = None
    pending: bytes = b""
    started: float = 0.0
    last_beat: float = 0.0
    young: bool = True
    restarts: deque[float] = field(default_factory=deque)
    delay: float = 0.0
    due: float | None = None
    mending: dict[str, float] = field(default_factory=dict)
    ladder: Ladder | None = None
    given_up: bool = False
    hung: str = ""
    refused: bool = False

    @property
    def stopping(self) -> bool:
        """Whether it was ordered to stop."""
        return self.ladder is not None

    def patience(self, hook: str = "") -> float:
        """Seconds after which it hangs: without a sign of life, or in one hook or operation."""
        coming_up = self.young or hook in _COMING_UP
        return max(_STARTUP, self.rules.hang_timeout) if coming_up else self.rules.hang_timeout

    def start(self, plan: Path, host: str) -> None:
        """Begin a process."""
        read, write = os.pipe()
        command = [sys.executable, "-c", _PROGRAM, str(os.getpid()), str(plan), self.name, host, str(write)]
        self.process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, bufsize=0,
            pass_fds=[write], start_new_session=True, env={**_MALLOC, **os.environ},
        )  # fmt: skip
        os.close(write)
        self.log.begin(f"process {self.name} starts, pid {self.process.pid}")
        self.events, self.output = os.fdopen(read, "rb", buffering=0), self.process.stdout
        for pipe in self.pipes():
            os.set_blocking(pipe.fileno(), False)
            with suppress(OSError):  # a system may allow less
                fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
        self.pending, self.young, self.due, self.hung = b"", True, None, ""
        self.mending.clear()
        self.started = self.last_beat = time.monotonic()

    def pipes(self) -> list[IO[bytes]]:
        """Those that are open."""
        return [pipe for pipe in (self.events, self.output) if pipe is not None and not pipe.closed]

    def told(self) -> list[dict[str, Any]] | None:
        """Events that have come; None where none will any more."""
        got = b"" if self.events is None else self.events.read(1 << 16)
        if got == b"":
            return None
        *lines, self.pending = (self.pending + (got or b"")).split(b"\n")
        return [json.loads(line) for line in lines]

    def keep_output(self) -> bool:
        """Put what it has printed into its log; False where nothing will come any more."""
        got = b"" if self.output is None else self.output.read(1 << 16)
        if got:
            self.log.write(got)
        return got != b""

    def keep_rest(self) -> None:
        """The same with all that an ended process has left."""
        while self.output is not None and (got := self.output.read(1 << 16)):
            self.log.write(got)

    def order(self, order: dict[str, Any]) -> None:
        """Tell it what to do."""
        if self.process is None or self.process.stdin is None:
            return
        with suppress(OSError):  # it has just ended; the next look sees that
            self.process.stdin.write((json.dumps(order) + "\n").encode())

    def stop(self) -> None:
        """Order it to end, and set up the ladder."""
        self.due = None
        self.ladder = Ladder(self._used)
        self.order({"order": "stop"})

    def _used(self) -> float:
        return processor_time(self.process.pid) if self.process is not None else 0.0

    def kill(self, number: int) -> None:
        """Send it a signal."""
        if self.process is not None and self.process.poll() is None:
            self.process.send_signal(number)

    def close(self, forget: Callable[[IO[bytes]], object]) -> None:
        """Close the pipes, after `forget` has looked at each."""
        for pipe in self.pipes():
            forget(pipe)
            pipe.close()
        if self.process is not None and self.process.stdin is not None:
            with suppress(OSError):
                self.process.stdin.close()
        self.events = self.output = None
