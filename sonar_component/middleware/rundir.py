"""Where a running graph is found: a folder per instance, a record per task, a lock held as long as its owner lives.

    $SONAR_RUN_DIR | $XDG_RUNTIME_DIR/sonar | /tmp/sonar-<uid>
        <instance>/instance.lock    held by `sonar run`
                   <task>.lock      held by the task's process
                   <task>.json      endpoints, ports and types
                   <task>.<port>    Unix sockets

No daemon and no multicast: name servers go stale and discovery is the first complaint of their users. A lock is
released by the kernel however its owner dies. libzmq itself lets a second process bind the same path and steal new
subscribers, so nothing binds without the lock.
"""

from __future__ import annotations

import fcntl
import json
import os
import re
import stat
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from sonar_component.settings.errors import SettingsError, suggest

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_-]{0,63}\Z")
MAX_SOCKET_PATH = 107  # [bytes], what a Unix socket address holds


def is_name(text: str) -> bool:
    """Whether a text may name an instance, a task or a process: letters, digits, _ and -, from a letter on."""
    return bool(_NAME.match(text))


def root() -> Path:
    """The folder of all instances of this user, made if need be.

    Raises
    ------
    SettingsError
        If it belongs to somebody else or others may write there.
    """
    given, runtime = os.environ.get("SONAR_RUN_DIR"), os.environ.get("XDG_RUNTIME_DIR")
    if given:
        path = Path(given)
    elif runtime and os.access(runtime, os.W_OK):
        path = Path(runtime) / "sonar"
    else:
        path = Path(tempfile.gettempdir()) / f"sonar-{os.getuid()}"
    try:
        path.mkdir(mode=0o700, parents=True, exist_ok=True)
    except OSError as error:
        raise SettingsError(f"run directory cannot be made: {error.strerror}; set SONAR_RUN_DIR", str(path)) from None
    status = path.stat()
    if status.st_uid != os.getuid() or status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        raise SettingsError(
            "run directory must belong to you and be writable by you alone; set SONAR_RUN_DIR", str(path)
        )
    return path


def logs(instance: str) -> Path:
    """Where the processes of an instance write what they print: it outlives the run."""
    state = os.environ.get("SONAR_LOG_DIR") or os.environ.get("XDG_STATE_HOME") or str(Path.home() / ".local/state")
    path = Path(state) / ("" if os.environ.get("SONAR_LOG_DIR") else "sonar") / instance
    path.mkdir(mode=0o700, parents=True, exist_ok=True)
    return path


class Lock:
    """A lock file: exclusive, and gone with its owner."""

    def __init__(self, path: Path, what: str) -> None:
        self.path = path
        while True:
            self._fd = self._take(path, what)
            try:
                if os.stat(path).st_ino == os.fstat(self._fd).st_ino:
                    break
            except FileNotFoundError:
                pass
            os.close(self._fd)  # the former owner removed the file between our open and our lock
        os.truncate(self._fd, 0)
        os.write(self._fd, str(os.getpid()).encode())

    @staticmethod
    def _take(path: Path, what: str) -> int:
        path.parent.mkdir(mode=0o700, exist_ok=True)
        fd = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(fd, 32).decode(errors="replace").strip()
            os.close(fd)
            by = f" (process {owner})" if owner.isdigit() else ""
            raise SettingsError(f"{what} is running already{by}; a name belongs to one at a time") from None
        return fd

    def release(self, remove: bool = True) -> None:
        """Give the name back."""
        if remove:
            self.path.unlink(missing_ok=True)
        os.close(self._fd)


def held(path: Path) -> bool:
    """Whether a living process holds this lock file."""
    try:
        fd = os.open(path, os.O_RDWR | os.O_CLOEXEC)
    except OSError:
        return False
    try:
        fcntl.flock(fd, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    finally:
        os.close(fd)
    return False


class Instance:
    """The folder of one running deployment."""

    def __init__(self, name: str) -> None:
        if not is_name(name):
            raise SettingsError(f"instance name must be letters, digits, _ and -, from a letter on; got {name!r}")
        self.name, self.path = name, root() / name

    def create(self) -> Lock:
        """Take the name; leftovers of a killed instance are cleared away.

        Raises
        ------
        SettingsError
            If the name is taken.
        """
        lock = Lock(self.path / "instance.lock", f"instance {self.name!r}")
        for path in self.path.iterdir():
            if path.name != "instance.lock" and not (path.suffix == ".lock" and held(path)):
                path.unlink(missing_ok=True)
        return lock

    def remove(self) -> None:
        """Clear the folder away; only for the owner of its lock."""
        for path in self.path.iterdir() if self.path.is_dir() else ():
            path.unlink(missing_ok=True)
        if self.path.is_dir():
            self.path.rmdir()

    @property
    def alive(self) -> bool:
        """Whether its launcher or any of its tasks lives."""
        return any(held(path) for path in self.path.glob("*.lock"))

    def endpoint(self, name: str) -> str:
        """The ipc address of a port or a process.

        Raises
        ------
        SettingsError
            If the path is longer than a Unix socket may have.
        """
        path = str(self.path / name)
        if len(path.encode()) > MAX_SOCKET_PATH:
            message = f"socket path is {len(path.encode())} bytes long, at most {MAX_SOCKET_PATH}: shorten the names"
            raise SettingsError(f"{message} or set SONAR_RUN_DIR to a shorter folder", path)
        return f"ipc://{path}"

    def write_record(self, task: str, record: dict[str, Any]) -> None:
        """Publish what a task offers; whole or not at all."""
        draft = self.path / f".{task}.json"
        draft.write_text(json.dumps(record))
        draft.rename(self.path / f"{task}.json")

    def records(self) -> dict[str, dict[str, Any]]:
        """Task -> record, of tasks whose process lives."""
        found = {}
        for path in sorted(self.path.glob("*.json")):
            if path.name.startswith(".") or not held(path.with_suffix(".lock")):
                continue
            try:
                record = json.loads(path.read_text())
            except (OSError, ValueError):
                continue  # gone or half cleared between two looks
            if isinstance(record, dict):
                found[path.stem] = record
        return found


def instances() -> Iterator[Instance]:
    """Every instance that lives; dead ones are cleared away on the way."""
    for path in sorted(root().iterdir()):
        if not path.is_dir() or not is_name(path.name):
            continue
        instance = Instance(path.name)
        if instance.alive:
            yield instance
        else:
            _clear(instance)


def _clear(instance: Instance) -> None:
    try:
        lock = Lock(instance.path / "instance.lock", instance.name)
    except (SettingsError, OSError):
        return  # somebody starts it just now
    instance.remove()
    lock.release()


def find_task(name: str, instance: str | None = None) -> tuple[Instance, dict[str, Any]]:
    """The record of a running task, ``task`` or ``instance/task``.

    Raises
    ------
    SettingsError
        If there is none, or more than one; names the nearest or all.
    """
    if "/" in name:
        instance, _, name = name.partition("/")
    running = [i for i in instances() if instance in (None, i.name)]
    if not running:
        what = f"instance {instance!r}" if instance else "deployment"
        raise SettingsError(f"no {what} is running (looked in {root()}); start one with: sonar run FILE")
    found = [(i, records[name]) for i in running if name in (records := i.records())]
    if len(found) > 1:
        names = ", ".join(f"{i.name}/{name}" for i, _ in found)
        raise SettingsError(f"task {name!r} runs in several instances; say which: {names}")
    if not found:
        known = [task for i in running for task in i.records()]
        raise SettingsError(f"no task {name!r} is running{suggest(name, known)}; running: {', '.join(known) or 'none'}")
    return found[0]
