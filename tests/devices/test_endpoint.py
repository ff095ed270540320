"""Endpoints as tasks: fed by ports, seen from other processes, refused in words."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brping import Ping360
from conftest import WALL

from sonar_component.devices.micron import MicronEndpoint
from sonar_component.devices.oculus import OculusEndpoint
from sonar_component.devices.ping360 import Ping360Endpoint
from sonar_component.middleware.once import run_once
from sonar_component.samples import RigidBodyState
from sonar_component.samples.sonar import SPEED_OF_SOUND

DEPLOY = Path(__file__).parents[2] / "deploy"
PERIOD, SAMPLES, AHEAD = 260, 1000, 200
BIN = PERIOD * 25e-9 * SPEED_OF_SOUND / 2  # [m]
DEPLOYMENT = """
    version: 1
    tasks:
      scene: {{type: SceneTask, properties: {{world: {room}}}}}
      pose: {{type: VehiclePoseTask, activity: {{periodic: 50 ms}}}}
      ping360: {{type: Ping360Endpoint, properties: {{udp: "127.0.0.1:{port}", discovery: ""}}}}
    connections:
      - {{from: pose.pose_samples, to: [ping360.sonar_pose_cmd], policy: data}}
"""


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


@pytest.fixture
def client(port: int) -> Iterator[Any]:
    device = Ping360()
    device.connect_udp("127.0.0.1", port)
    yield device
    device.iodev.close()


def front(reply: Any) -> int:
    data = np.frombuffer(bytes(reply.data), np.uint8)
    return int(np.argmax(data > data.max() / 2)) if data.any() else -1


def test_in_a_deployment_the_echoes_follow_the_pose_port(graph: Any, room: Path, port: int, client: Any) -> None:
    graph.start(DEPLOYMENT.format(room=room, port=port))
    graph.wait_until_said("ping360: RUNNING")

    def ready() -> bool:
        try:
            return bool(client.initialize())
        except ConnectionRefusedError:
            return False

    graph.wait_for(ready, "an answer")
    client.set_gain_setting(1)
    client.set_number_of_samples(SAMPLES)
    client.set_sample_period(PERIOD)
    graph.wait_for(lambda: abs(front(client.transmitAngle(AHEAD)) - WALL / BIN) <= 1, "the wall at its range")
    assert graph.sonar("set", "pose.position", "[1.0, 0.0, 0.0]").returncode == 0
    graph.wait_for(lambda: abs(front(client.transmitAngle(AHEAD)) - (WALL - 1) / BIN) <= 1, "the wall nearer")
    timing = graph.json("call", "ping360.timing")
    assert timing["pings"] >= 2


def pose() -> RigidBodyState:
    return RigidBodyState(time=1, position=np.zeros(3), orientation=np.array([1.0, 0, 0, 0]))


def tasks(folder: Path) -> list[tuple[type, dict[str, Any]]]:
    return [
        (Ping360Endpoint, {"udp": "127.0.0.1:0", "discovery": ""}),
        (OculusEndpoint, {"tcp": "127.0.0.1:0", "status_to": ""}),
        (MicronEndpoint, {"pty": str(folder / "tty")}),
    ]


@pytest.mark.parametrize("index", [0, 1, 2])
def test_without_a_scene_an_endpoint_serves_and_says_what_it_lacks(index: int, tmp_path: Path) -> None:
    cls, properties = tasks(tmp_path)[index]
    task = cls("device", properties)
    run_once(task, {"sonar_pose_cmd": pose()})
    assert task.lifecycle.substate == "NO_SCENE"
    assert task.timing()["pings"] == 0
    task.stop()
    assert not (tmp_path / "tty").exists()
    run_once(task)  # and can be started again
    task.stop()


def test_an_address_in_use_is_a_refusal_in_words(port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", port))
        task = Ping360Endpoint("device", {"udp": f"127.0.0.1:{port}", "discovery": ""})
        with pytest.raises(RuntimeError, match=f"udp: 127.0.0.1:{port}: Address already in use"):
            run_once(task)


@pytest.mark.parametrize(
    ("cls", "properties", "said"),
    [
        (Ping360Endpoint, {"udp": "", "pty": ""}, "udp or pty must be given"),
        (Ping360Endpoint, {"udp": "0.0.0.0:1"}, "udp: must be at 127.0.0.1, or allow_remote"),
        (OculusEndpoint, {"tcp": "0.0.0.0:1"}, "tcp: must be at 127.0.0.1"),
        (OculusEndpoint, {"bin_count": 0}, "bin_count"),
        (MicronEndpoint, {"pty": ""}, "pty"),
    ],
)
def test_wrong_properties_are_refused_by_name(cls: type, properties: dict[str, Any], said: str) -> None:
    task = cls("device", properties)
    assert not task.configure()
    assert said in task.lifecycle.reason


@pytest.mark.parametrize("name", ["ping360", "oculus", "micron"])
def test_the_deployments_of_the_gallery_are_good(graph: Any, name: str) -> None:
    done = graph.sonar("check", DEPLOY / f"{name}.yaml")
    assert (done.returncode, done.stderr) == (0, "")
