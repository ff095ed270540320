"""`connect` to a port that another host guards with keys; both ends on the loopback."""

from __future__ import annotations

import socket
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware import OutputPort, connect
from sonar_component.middleware.transport import keys
from sonar_component.middleware.transport.transport import Transport
from sonar_component.samples import Frame
from sonar_component.settings import SettingsError


def test_a_client_with_an_allowed_key_reads_and_one_without_does_not(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("SONAR_KEY_DIR", str(tmp_path))
    server, client, _ = (keys.new_keys(name) for name in ("vehicle", "laptop", "stranger"))
    keys.allow(client)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{probe.getsockname()[1]}"
    transport = Transport()
    guard = keys.Guard(transport.context, "vehicle")
    try:
        port: OutputPort[Any] = OutputPort(Frame).own("cam", "frames")
        transport.bind(port, [f"ipc://{tmp_path}/p"])
        transport.bind_remote(port, address, "wall", guard)
        port.write(Frame(time=7, image=np.zeros((2, 2, 3), np.uint8), channels="red,green,blue"))
        with connect("cam.frames", Frame, endpoint=address, keys=("laptop", server), timeout=10.0) as reader:
            assert reader.read().time == 7
        for wrong in (None, ("stranger", server)):
            with connect("cam.frames", Frame, endpoint=address, keys=wrong, timeout=0.5) as reader:
                with pytest.raises(TimeoutError):
                    reader.read()
        with pytest.raises(SettingsError, match="no secret key for 'nobody'"):
            connect("cam.frames", Frame, endpoint=address, keys=("nobody", server))
    finally:
        guard.close()
        transport.close()
