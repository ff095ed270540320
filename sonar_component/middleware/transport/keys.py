"""Keys for ports that leave the host: CURVE, with a list of who is allowed.

    $SONAR_KEY_DIR | $XDG_CONFIG_HOME/sonar/keys | ~/.config/sonar/keys
        NAME.key          public, to be given to others
        NAME.key_secret   secret, readable by its owner alone
        allowed/*.key     public keys of those who may connect

The files are those of pyzmq's own certificates. Loopback and Unix sockets need no keys: their doors are the kernel's.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import zmq
import zmq.auth
from zmq.auth.thread import ThreadAuthenticator

from sonar_component.middleware.rundir import is_name
from sonar_component.middleware.transport.sockets import Socket
from sonar_component.settings.errors import SettingsError


def key_folder() -> Path:
    """Where this user's keys are, made if need be."""
    config = os.environ.get("XDG_CONFIG_HOME") or str(Path.home() / ".config")
    path = Path(os.environ.get("SONAR_KEY_DIR") or f"{config}/sonar/keys")
    (path / "allowed").mkdir(mode=0o700, parents=True, exist_ok=True)
    return path


def new_keys(name: str) -> Path:
    """Make a pair of keys; the public one's file.

    Raises
    ------
    SettingsError
        If there are keys of that name, which others may rely on, or it is no name, such as a path.
    """
    if not is_name(name):
        raise SettingsError(f"name of keys must be letters, digits, _ and -, from a letter on; got {name!r}")
    folder = key_folder()
    if (folder / f"{name}.key_secret").exists():
        raise SettingsError(f"there are keys of that name; remove {name}.key and {name}.key_secret first", str(folder))
    mask = os.umask(0o077)
    try:
        public, _ = zmq.auth.create_certificates(folder, name)
    finally:
        os.umask(mask)
    return Path(public)


def allow(file: Path) -> Path:
    """Let the owner of a public key connect."""
    public_key(file)
    return Path(shutil.copy(file, key_folder() / "allowed" / file.with_suffix(".key").name))


def public_key(file: Path) -> bytes:
    """Read a public key.

    Raises
    ------
    SettingsError
        If the file is missing or holds none.
    """
    try:
        public, _ = zmq.auth.load_certificate(file)
    except (OSError, ValueError) as error:
        raise SettingsError(f"is not a key file: {error}; make one with: sonar keys new NAME", str(file)) from None
    return bytes(public)


def own_keys(name: str) -> tuple[bytes, bytes]:
    """Public and secret key of that name.

    Raises
    ------
    SettingsError
        If there are none.
    """
    file = key_folder() / f"{name}.key_secret"
    try:
        public, secret = zmq.auth.load_certificate(file)
    except (OSError, ValueError):
        raise SettingsError(f"no secret key for {name!r}; make one with: sonar keys new {name}", str(file)) from None
    if secret is None:
        raise SettingsError("holds no secret key", str(file))
    return public, secret


def own_names() -> list[str]:
    """Names of our own pairs of keys."""
    return sorted(file.stem for file in key_folder().glob("*.key_secret"))


def joining(name: str, server: Path) -> Callable[[Socket], None]:
    """What shows our key of that name to a server whose public key is in a file, before a socket connects.

    Raises
    ------
    SettingsError
        If one of the two keys is missing.
    """
    (public, secret), known = own_keys(name), public_key(server)

    def join(socket: Socket) -> None:
        socket.setsockopt(zmq.CURVE_SECRETKEY, secret)
        socket.setsockopt(zmq.CURVE_PUBLICKEY, public)
        socket.setsockopt(zmq.CURVE_SERVERKEY, known)

    return join


class Guard:
    """Asks for keys on the sockets of one context."""

    def __init__(self, context: zmq.Context[Any], name: str) -> None:
        self._public, self._secret = own_keys(name)
        self._authenticator = ThreadAuthenticator(context)
        self._authenticator.start()
        self._authenticator.configure_curve(domain="*", location=str(key_folder() / "allowed"))

    def serve(self, socket: Socket) -> None:
        """Let only allowed keys in; before bind."""
        socket.setsockopt(zmq.CURVE_SECRETKEY, self._secret)
        socket.setsockopt(zmq.CURVE_PUBLICKEY, self._public)
        socket.setsockopt(zmq.CURVE_SERVER, 1)

    def join(self, socket: Socket, server: bytes) -> None:
        """Show our key to a server that we know; before connect."""
        socket.setsockopt(zmq.CURVE_SECRETKEY, self._secret)
        socket.setsockopt(zmq.CURVE_PUBLICKEY, self._public)
        socket.setsockopt(zmq.CURVE_SERVERKEY, server)

    def close(self) -> None:
        """End the thread that checks keys."""
        self._authenticator.stop()
