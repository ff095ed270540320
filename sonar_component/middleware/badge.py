"""A client's name in the run directory, held as long as the client lives: how a process knows that a guest is gone.

    <run directory>/.clients/<name>.lock    held by the client
                             <name>         Unix socket of a client that writes

A lease that the client has to renew was the alternative: it would take a client that is stopped in a debugger for dead.
"""

from __future__ import annotations

import os
from pathlib import Path

from sonar_component.middleware.rundir import Lock, held, is_name, root


class Badge:
    """One client's name and lock.

    Attributes
    ----------
    name : not used by any other client.
    """

    def __init__(self) -> None:
        _clear_dead()
        self.name = f"client_{os.getpid()}_{os.urandom(3).hex()}"
        self._lock = Lock(_folder() / f"{self.name}.lock", self.name)

    def release(self) -> None:
        """Give the name back."""
        Path(_folder() / self.name).unlink(missing_ok=True)
        self._lock.release()


def worn(name: str) -> bool:
    """Whether the client of that name lives."""
    return held(_folder() / f"{name}.lock")


def client_endpoint(name: str) -> str:
    """Where a client of that name offers what it writes; nothing but names leads there.

    Raises
    ------
    ValueError
        If it is no name, such as a path that leads elsewhere.
    """
    if not is_name(name):
        raise ValueError(f"client name must be letters, digits, _ and -, got {name[:60]!r}")
    return f"ipc://{_folder() / name}"


def _folder() -> Path:
    return root() / ".clients"


def _clear_dead() -> None:
    for lock in _folder().glob("*.lock"):
        if not held(lock):
            lock.with_suffix("").unlink(missing_ok=True)
            lock.unlink(missing_ok=True)
