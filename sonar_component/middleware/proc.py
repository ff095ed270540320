"""What the kernel says of a process."""

from __future__ import annotations

import os
from pathlib import Path

_TICK = os.sysconf("SC_CLK_TCK")  # [1/s]
_PAGE = os.sysconf("SC_PAGE_SIZE")  # [bytes]


def processor_time(pid: int) -> float:
    """User and system time of a process [s]; 0 if it is gone."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(") ")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / _TICK


def resident(pid: int) -> int:
    """Memory of a process [bytes]; 0 if it is gone."""
    try:
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * _PAGE
    except OSError:
        return 0
