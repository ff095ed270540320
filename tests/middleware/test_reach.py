"""Asking tasks of another host: two loopback addresses, a run directory each, and nothing but TCP between them."""

from __future__ import annotations

import shutil
import socket
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from sonar_component.middleware import connect, connect_task
from sonar_component.middleware.deployment import check_deployment
from sonar_component.samples import RigidBodyState
from sonar_component.settings import SettingsError

TWO = """
    version: 1
    name: two
    hosts:
      vehicle: {address: 127.0.0.2, port: PORT}
      topside: {address: 127.0.0.1, port: PORT}
    tasks:
      pose: {type: SourceTask, host: vehicle}
      fls: {type: PoseToSonarTask, host: topside}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd}
"""


@pytest.fixture
def port() -> int:
    """The first of two TCP ports that are free on both addresses."""
    while True:
        with socket.socket() as probe:
            probe.bind(("127.0.0.2", 0))
            first = int(probe.getsockname()[1])
        if first < 65000:
            return first


@pytest.fixture
def hosts(graph: Any, port: int) -> Iterator[Any]:
    """Starts the two hosts; the vehicle has a run directory that we do not see."""
    far = Path(tempfile.mkdtemp(prefix="sn", dir="/tmp"))
    file = graph.write(TWO.replace("PORT", str(port)))

    def start() -> Path:
        near = dict(graph.environment)
        graph.environment["SONAR_RUN_DIR"] = str(far)
        graph.start(file.read_text(), "--host", "vehicle")
        graph.environment = near
        graph.start(file.read_text(), "--host", "topside")
        graph.wait_until_said("pose: RUNNING")
        graph.wait_until_said("fls: RUNNING")
        return Path(file)

    graph.start_hosts, graph.file = start, file
    yield graph
    graph.stop()
    shutil.rmtree(far, ignore_errors=True)


def keyed(graph: Any) -> None:
    """Give both hosts and a laptop a pair of keys; the vehicle is asked for them."""
    graph.environment["SONAR_KEY_DIR"] = str(graph.folder / "keys")
    for name in ("vehicle", "topside", "laptop"):
        assert graph.sonar("keys", "new", name).returncode == 0
        assert graph.sonar("keys", "allow", graph.folder / "keys" / f"{name}.key").returncode == 0
    shutil.copy(graph.folder / "keys" / "vehicle.key", graph.folder / "vehicle.key")
    text = graph.file.read_text()
    graph.file.write_text(text.replace("address: 127.0.0.2,", "address: 127.0.0.2, key: vehicle.key,"))


def test_every_verb_reaches_a_task_of_another_host(hosts: Any) -> None:
    file = hosts.start_hosts()
    where = ("--deployment", file)
    assert [task["task"] for task in hosts.json("list")["tasks"]] == ["fls"]
    found = hosts.json("list", *where)["tasks"]
    assert [(t["task"], t["host"], t["state"]) for t in found] == [
        ("pose", "vehicle", "RUNNING"),
        ("fls", "", "RUNNING"),
    ]
    assert hosts.json("get", "pose.gain", *where) == 0.5
    assert hosts.sonar("set", "pose.gain", "0.25", *where).returncode == 0
    assert hosts.json("get", "pose.gain", *where) == 0.25
    assert hosts.json("call", "pose.rendered_count", *where) == 0
    assert hosts.json("state", "pose", "stop", *where)["state"] == "STOPPED"
    assert hosts.json("state", "pose", "start", *where)["state"] == "RUNNING"
    assert hosts.json("inspect", "pose", *where)["outputs"]["pose_samples"]["endpoint"].startswith("tcp://127.0.0.2:")
    assert abs(hosts.json("hz", "pose.pose_samples", "--seconds", 1, *where)["hz"] - 50) < 5
    assert hosts.json("echo", "pose.pose_samples", "-n", 1, *where)["position"] == [0, 0, 0]
    (edge,) = hosts.json("graph", "--seconds", 1, *where)["connections"]
    assert (edge["source"], edge["target"], edge["lost"]) == ("pose.pose_samples", "fls.sonar_pose_cmd", 0)
    rows = hosts.json("top", *where)
    assert [(row["host"], row["memory_mb"] > 5) for row in rows] == [("vehicle", True), ("", True)]


def test_a_client_reaches_another_host_by_the_deployment_file(hosts: Any) -> None:
    file = hosts.start_hosts()
    with connect("pose.pose_samples", RigidBodyState, deployment=file) as port:
        assert port.read().position.tolist() == [0, 0, 0]
    with connect_task("pose", deployment=file) as pose:
        pose.set("gain", 0.75)
        assert pose.get("gain") == 0.75
    for name, options, message in (
        (
            "pose.sonar_samples",
            {},
            "pose.sonar_samples does not leave host 'vehicle': no task of another host reads it",
        ),
        ("pose.pose_samples", {"policy": "reliable"}, "a reliable connection must stay on one host"),
        ("poes.pose_samples", {"timeout": 0.0}, "no task 'poes' (did you mean \"pose\"?)"),
    ):
        with pytest.raises(SettingsError) as caught:
            connect(name, deployment=file, **options)
        assert message in str(caught.value)


def test_a_host_that_is_not_there_is_one_line(hosts: Any) -> None:
    done = hosts.sonar("get", "pose.gain", "--deployment", hosts.file, "--timeout", 0.2)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "task 'pose' on host 'vehicle' (tcp://127.0.0.2:" in done.stderr
    assert "is it running there (sonar run graph.yaml --host vehicle)?" in done.stderr
    found = hosts.json("list", "--deployment", hosts.file)["tasks"]
    assert {task["state"] for task in found} == {"NO_ANSWER"}


def test_a_guarded_host_answers_those_whose_key_it_allows(hosts: Any) -> None:
    keyed(hosts)
    for name in ("laptop", "topside"):
        done = hosts.sonar("get", "pose.gain", "--deployment", hosts.file, "--key", name, "--timeout", 0.1)
        assert (done.returncode, "does it allow our key" in done.stderr) == (2, True)
    file = hosts.start_hosts()
    assert hosts.json("get", "pose.gain", "--deployment", file, "--key", "laptop", "--timeout", 5) == 0.5
    assert hosts.json("list", "--deployment", file)["tasks"][0]["state"] == "RUNNING"
    assert hosts.json("hz", "pose.pose_samples", "--seconds", 1, "--deployment", file, "--key", "laptop")["hz"] > 40
    hosts.sonar("keys", "new", "stranger")
    done = hosts.sonar("set", "pose.gain", "1", "--deployment", file, "--key", "stranger", "--timeout", 1)
    assert (done.returncode, "key is not on the allow-list" in done.stderr) == (2, True), done.stderr
    # Without a key, libzmq's handshake does not even begin.
    without = hosts.folder / "without.yaml"
    without.write_text(file.read_text().replace("key: vehicle.key,", ""))
    done = hosts.sonar("get", "pose.gain", "--deployment", without, "--timeout", 1)
    assert (done.returncode, "no answer" in done.stderr) == (2, True), done.stderr
    refused = hosts.json("inspect", "pose", "--deployment", file, "--key", "laptop", "--timeout", 5)["refused_requests"]
    assert any("key is not on the allow-list" in reason for reason in refused), refused


def test_a_stranger_on_the_control_port_is_counted_and_changes_nothing(hosts: Any, port: int) -> None:
    file = hosts.start_hosts()
    for _ in range(20):
        with socket.create_connection(("127.0.0.2", port + 1)) as stranger:
            stranger.sendall(b"GET / HTTP/1.1\r\n\r\n" * 100)
    with connect_task("pose", deployment=file) as pose:
        refused = hosts.wait_for(lambda: pose.describe()["refused_requests"], "counting")
    assert sum(refused.values()) >= 1, refused
    assert all("127.0.0.2" in reason for reason in refused), refused


def test_addresses_follow_each_other_and_never_meet(graph: Any) -> None:
    plan = check_deployment(graph.write(TWO.replace("PORT", "7600")))
    assert plan.addresses == {"pose.pose_samples": "tcp://127.0.0.2:7600"}
    assert plan.controls == {"vehicle/pose": "tcp://127.0.0.2:7601", "topside/fls": "tcp://127.0.0.1:7600"}
    with pytest.raises(SettingsError) as caught:
        check_deployment(graph.write(TWO.replace("PORT", "7600").replace("127.0.0.2", "127.0.0.1")))
    assert "hosts.topside: tcp://127.0.0.1:7600 is taken by pose.pose_samples" in str(caught.value)


def test_a_host_without_a_key_that_others_could_reach_opens_no_control_port(graph: Any) -> None:
    text = TWO.replace("PORT", "7600").replace("topside: {address: 127.0.0.1", "topside: {address: 10.0.0.5")
    file = graph.write(text)
    assert check_deployment(file).controls == {"vehicle/pose": "tcp://127.0.0.2:7601"}
    with pytest.raises(SettingsError, match="host 'topside' can be asked from itself alone: give it a key"):
        connect_task("fls", deployment=file, timeout=0.1)
    file = graph.write(text.replace("version: 1", "version: 1\n    insecure: true"))
    assert check_deployment(file).controls["topside/fls"] == "tcp://10.0.0.5:7600"
