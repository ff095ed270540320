"""What a client has asked a process for; asked again now and then, since a process that starts again forgets it."""

from __future__ import annotations

import logging
import threading
from typing import Any

from sonar_component.middleware.badge import Badge
from sonar_component.middleware.transport.control import ControlClient
from sonar_component.middleware.transport.transport import Transport
from sonar_component.settings.errors import SettingsError

_AGAIN = 0.5  # [s], between two times of asking
_log = logging.getLogger("client")


class Visit:
    """One request, repeated until `end`.

    Parameters
    ----------
    transport : of the client.
    control : address of the process.
    op : ``reserve`` or ``admit``.
    arguments : task, port and what else the request takes.

    Attributes
    ----------
    client : our name.
    answer : the latest.
    refused : why the process refuses us since it started again; empty while it does not.
    """

    def __init__(self, transport: Transport, control: str, op: str, timeout: float | None, **arguments: Any) -> None:
        self._badge = Badge()
        self.client, self.refused = self._badge.name, ""
        self._op, self._arguments = op, {**arguments, "client": self.client}
        self._control = ControlClient(transport.context, control)
        self._stop = threading.Event()
        self.answer: dict[str, Any] = {}
        self._timeout = 5.0 if timeout is None else max(timeout, 0.1)
        self._thread = threading.Thread(target=self._run, name="visit", daemon=True)

    def begin(self) -> dict[str, Any]:
        """Ask for the first time, then keep asking.

        Raises
        ------
        SettingsError
            If the process refuses; its reason.
        TimeoutError
            If it does not answer.
        """
        try:
            self.answer = self._control.ask(self._op, self._timeout, **self._arguments)
        except BaseException as error:
            self._control.close()
            self._badge.release()
            if isinstance(error, RuntimeError):
                raise SettingsError(str(error)) from None
            raise
        self._thread.start()
        return self.answer

    def _run(self) -> None:
        while not self._stop.wait(_AGAIN):
            self._ask_again()

    def _ask_again(self) -> None:
        try:
            self.answer = self._control.ask(self._op, **self._arguments)
            self.refused = ""
        except TimeoutError:
            return  # it is starting again, or gone
        except RuntimeError as error:
            if not self.refused:
                _log.warning("%s", error)
            self.refused = str(error)

    def end(self, seq: int = 0) -> None:
        """Take leave; `seq` is the number of the last sample that was written."""
        self._stop.set()
        self._thread.join(3.0)  # above the 2 s of one question
        try:
            self._control.ask("leave", 1.0, **self._arguments, seq=seq)
        except (TimeoutError, RuntimeError):
            _log.debug("the process that we leave is gone already")
        self._control.close()
        self._badge.release()
