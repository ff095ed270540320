"""Whether ports work here at all: one message over a socket file in the run directory's file system."""

from __future__ import annotations

import tempfile
from pathlib import Path

import zmq

_PATIENCE = 2000  # [ms]


def loopback() -> str:
    """Send a message from a port to a reader on this machine; says what was used.

    Raises
    ------
    RuntimeError, zmq.ZMQError
        If it does not arrive.
    """
    with tempfile.TemporaryDirectory() as folder, zmq.Context() as context:
        with context.socket(zmq.XPUB) as writer, context.socket(zmq.SUB) as reader:
            writer.linger = reader.linger = 0
            endpoint = f"ipc://{Path(folder) / 'port'}"
            writer.bind(endpoint)
            reader.connect(endpoint)
            reader.subscribe(b"check")
            if not writer.poll(_PATIENCE):
                raise RuntimeError("a subscription did not arrive")
            writer.recv()
            writer.send(b"check")
            if not reader.poll(_PATIENCE):
                raise RuntimeError("a message did not arrive")
    return f"ZeroMQ {zmq.zmq_version()} carries messages over socket files"
