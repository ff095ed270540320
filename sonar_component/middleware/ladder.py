"""How a process is brought to its end: an order, SIGTERM after `GRACE`, SIGKILL after `TERM_GRACE` more.

One that is still at work, since it compiles a shader or draws a last picture on a busy machine, is given longer: while
it uses the processor, up to `MOST_GRACE`. A hung one waits for something and uses none, so for it nothing changes.
To ask the tasks was the alternative: one that is inside a compiler cannot answer, and one that hangs would lie.
"""

from __future__ import annotations

import signal
import time
from collections.abc import Callable

GRACE, TERM_GRACE = 2.0, 1.0  # [s]
MOST_GRACE = 20.0  # [s], for one that works on
_WINDOW = 0.25  # [s], between two looks at the processor time
_LEAST = 0.019  # [s] of processor time within a window that count as work: two ticks of /proc, 8 % of a window


class Progress:
    """For how long a process has done nothing.

    Parameters
    ----------
    used : gives the processor time that it has used [s].
    """

    def __init__(self, used: Callable[[], float]) -> None:
        self._used = used
        self._looked = self._worked = time.monotonic()
        self._before = used()

    def idle(self, now: float) -> float:
        """Seconds since it was last seen at work."""
        if now - self._looked >= _WINDOW:
            used = self._used()
            if used - self._before >= _LEAST:
                self._worked = now
            self._looked, self._before = now, used
        return now - self._worked


class Ladder:
    """Says which signal is due next for one process that was ordered to stop."""

    def __init__(self, used: Callable[[], float]) -> None:
        self._progress = Progress(used)
        self._since = time.monotonic()
        self._sent: list[signal.Signals] = []

    def due(self, now: float) -> signal.Signals | None:
        """The signal to be sent now, if any."""
        waited, sent = now - self._since, len(self._sent)
        if sent == 0 and (self._progress.idle(now) > GRACE or waited > MOST_GRACE):
            return self._send(signal.SIGTERM, now)
        if sent == 1 and waited > TERM_GRACE:
            return self._send(signal.SIGKILL, now)
        return None

    def _send(self, number: signal.Signals, now: float) -> signal.Signals:
        self._since = now
        self._sent.append(number)
        return number
