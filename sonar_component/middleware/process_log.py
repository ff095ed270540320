"""What a process prints, kept in a bounded number of files: NAME.log, and NAME.log.1 (newer) to NAME.log.3.

The launcher writes it, from a pipe. Handing the file to the process was the alternative: nobody could then turn it over
while C libraries and the interpreter itself print into it, and a restless task would fill the disk.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import IO

MAX_BYTES, OLDER = 2_000_000, 3  # of one file; files beside the newest: 8 MB for each process
_TAIL = 1000  # [bytes] that are remembered
_MAX_LINE = 200  # characters of the last line that are shown


class ProcessLog:
    """Appends to a file and turns it over when it is full.

    Attributes
    ----------
    error : why it could not be written, such as a full disk; the process runs on without.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.error = path, ""
        self._file: IO[bytes] | None = None
        self._tail = b""

    def begin(self, words: str) -> None:
        """Mark where a new process begins."""
        self._tail = b""
        self._put(f"--- {time.strftime('%Y-%m-%d %H:%M:%S')} {words}\n".encode())

    def write(self, got: bytes) -> None:
        """Keep what was printed."""
        self._tail = (self._tail + got)[-_TAIL:]
        self._put(got)

    @property
    def last_line(self) -> str:
        """The last line that was printed."""
        lines = self._tail.decode(errors="replace").strip().splitlines()
        return lines[-1][:_MAX_LINE] if lines else ""

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _put(self, got: bytes) -> None:
        try:
            file = self._room(len(got))
            file.write(got)
        except OSError as error:
            self.error = error.strerror or str(error)

    def _room(self, size: int) -> IO[bytes]:
        if self._file is None:
            self._file = open(self.path, "ab", buffering=0)
        if 0 < self._file.tell() > MAX_BYTES - size:
            self._turn_over()
        return self._file

    def _turn_over(self) -> None:
        self.close()
        for number in range(OLDER, 0, -1):
            younger = self.path.with_name(f"{self.path.name}.{number - 1}") if number > 1 else self.path
            if younger.exists():
                younger.replace(self.path.with_name(f"{self.path.name}.{number}"))
        self._file = open(self.path, "wb", buffering=0)
