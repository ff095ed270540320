"""Pictures of what the viewer saw, written into a folder: the first image, one every few seconds, the last one.

A figure takes 0.3 s to draw, so a thread of its own draws them: while one is drawn, images that fall due are passed
over, and nothing else waits.
"""

from __future__ import annotations

import logging
import threading
import time
from pathlib import Path

from sonar_component.pictures.figure import save_png
from sonar_component.samples import Sonar
from sonar_component.tasks.page.board import Board

_MAX_NUMBER = 999  # [-], a viewer left running for days must not fill the disk
_PATIENCE = 10.0  # [s], for the pictures at stop: a figure per sonar


class Snapshots:
    """Writes pictures of all channels of a board.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
    period : float
        [s] between two pictures of one sonar.

    Raises
    ------
    OSError
        If the folder cannot be made or written.
    """

    def __init__(self, board: Board, folder: Path, period: float, colour_map: str, log: logging.Logger) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".write-test"
        probe.touch()
        probe.unlink()
        self._board, self._folder, self._period, self._colour_map, self._log = board, folder, period, colour_map, log
        self._number: dict[str, int] = {}
        self._due: dict[str, float] = {}
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="snapshots", daemon=True)
        self._thread.start()

    def finish(self) -> None:
        """Begin to write the last pictures."""
        self._stop.set()

    def wait(self) -> None:
        """Wait until they are written."""
        self._thread.join(_PATIENCE)

    def _run(self) -> None:
        while not self._stop.wait(0.1):
            now = time.monotonic()
            for source, sonar in self._pictures().items():
                if now >= self._due.get(source, 0.0) and self._number.get(source, 0) <= _MAX_NUMBER:
                    self._due[source] = now + self._period
                    number = self._number[source] = self._number.get(source, -1) + 1
                    self._write(source, "first" if number == 0 else f"{number:03d}", sonar)
        for source, sonar in self._pictures().items():
            self._write(source, "last", sonar)

    def _pictures(self) -> dict[str, Sonar]:
        with self._board.lock:
            seen = [channel for channel in self._board.channels.values() if channel.latest is not None]
            return {channel.source: channel.picture() for channel in seen}

    def _write(self, source: str, which: str, sonar: Sonar) -> None:
        path = self._folder / f"{source.replace('.', '_')}_{which}.png"
        try:
            save_png(sonar, path, colour_map=self._colour_map, name=source)
        except (OSError, ValueError) as error:
            self._log.error("picture %s not written: %s", path, error)
