"""What a process of a deployment runs: it is given a plan, and two pipes to the launcher.

Orders come in as lines of JSON, events go out the same way; what is printed goes to the launcher too, which keeps it.
"""

from __future__ import annotations

import faulthandler
import json
import logging
import os
import select
import signal
import sys
from typing import Any

from sonar_component.middleware.deployment.plan import Plan, RestartPlan
from sonar_component.middleware.process import Process

BEAT, QUICKEST_BEAT = 0.5, 0.05  # [s], between signs of life
_BEATS = 4  # of them within a hang_timeout: one that comes late on a busy machine is no hang


class _Reports:
    """Events to the supervisor, one line of JSON each."""

    def __init__(self, fd: int) -> None:
        self._fd = fd

    def __call__(self, event: dict[str, Any]) -> None:
        try:
            os.write(self._fd, (json.dumps(event) + "\n").encode())  # below PIPE_BUF, so lines never mix
        except OSError:
            return  # the supervisor is gone; the kernel ends us next


class _WarningsUpwards(logging.Handler):
    """Warnings of tasks are shown by the launcher too."""

    def __init__(self, report: _Reports) -> None:
        super().__init__(logging.WARNING)
        self._report = report

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage().splitlines()[0][:500]
        self._report({"event": "log", "task": record.name, "level": record.levelname.lower(), "text": text})


def main(plan_file: str, name: str, host: str, events: str) -> None:
    """Entry point of a child process."""
    faulthandler.register(signal.SIGUSR1, all_threads=True)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the launcher decides
    report = _Reports(int(events))
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(levelname)s %(name)s: %(message)s")
    logging.getLogger().addHandler(_WarningsUpwards(report))
    with open(plan_file, encoding="utf-8") as file:
        process = Process(Plan.from_json(file.read()), name, host)
    process.report = report
    try:
        process.build()
    except Exception as error:
        logging.getLogger(name).exception("could not be built")
        report({"event": "refused", "reason": str(error)})
        sys.exit(1)
    report({"event": "built"})
    for task in process.tasks:
        process.bring_up(task)
    _obey(process, report)
    sys.exit(0 if process.close() and not process.failed else 1)


def beat_of(process: Process) -> float:
    """Seconds between two signs of life."""
    rules = process.plan.restart.get(process.name, RestartPlan())
    return min(BEAT, max(QUICKEST_BEAT, rules.hang_timeout / _BEATS))


def _obey(process: Process, report: _Reports) -> None:
    """Take orders until told to stop."""
    wake = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
    signal.signal(signal.SIGTERM, lambda *_: os.eventfd_write(wake, 1))
    pending, beat = b"", beat_of(process)
    while True:
        ready, _, _ = select.select([0, wake], [], [], beat)
        if wake in ready:
            return
        if 0 in ready:
            got = os.read(0, 65536)
            if not got:
                return
            *lines, pending = (pending + got).split(b"\n")
            for line in lines:
                order = json.loads(line)
                if order["order"] == "stop":
                    return
                if order["order"] == "bring_up":
                    process.bring_up(order["task"])
        report(process.beat())
