"""Two hosts on one machine: two launchers, two instances, TCP between them."""

from __future__ import annotations

import stat
from pathlib import Path
from typing import Any

import pytest

from sonar_component.middleware import connect_task
from sonar_component.middleware.deployment import check_deployment
from sonar_component.settings import SettingsError

TWO = """
    version: 1
    hosts:
      vehicle: {address: 127.0.0.1, port: PORT, key: vehicle.key}
      topside: {address: 127.0.0.1, port: 7900, key: topside.key}
    tasks:
      pose: {type: SourceTask, host: vehicle}
      fls: {type: PoseToSonarTask, host: topside}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd}
"""


@pytest.fixture
def keyed(graph: Any, unused_port: int) -> Any:
    """A graph with keys for two hosts; nobody is allowed yet."""
    graph.environment["SONAR_KEY_DIR"] = str(graph.folder / "keys")
    for name in ("vehicle", "topside"):
        done = graph.sonar("keys", "new", name)
        assert done.returncode == 0, done.stderr
        public = graph.folder / "keys" / f"{name}.key"
        (graph.folder / public.name).write_text(public.read_text())
    graph.text = TWO.replace("PORT", str(unused_port))
    return graph


@pytest.fixture
def unused_port() -> int:
    import socket

    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def received(graph: Any) -> int:
    with connect_task("t/fls") as fls:
        return int(fls.describe()["inputs"]["sonar_pose_cmd"]["connections"][0]["received"])


def start_both(graph: Any) -> None:
    graph.start(graph.text, "--host", "vehicle", "--name", "v")
    graph.start(graph.text, "--host", "topside", "--name", "t")
    graph.wait_until_said("pose: RUNNING")
    graph.wait_until_said("fls: RUNNING")


def test_secret_keys_are_readable_by_their_owner_alone(keyed: Any) -> None:
    mode = (keyed.folder / "keys" / "vehicle.key_secret").stat().st_mode
    assert stat.S_IMODE(mode) == 0o600


def test_keys_stay_in_their_folder(keyed: Any) -> None:
    done = keyed.sonar("keys", "new", "../elsewhere")
    assert (done.returncode, "name of keys must be letters" in done.stderr) == (2, True)
    assert not (keyed.folder / "elsewhere.key").exists()
    own = [Path(file).stem for file in keyed.json("keys", "list")["own"]]
    assert own == ["topside", "vehicle"]


def test_keys_are_never_overwritten(keyed: Any) -> None:
    done = keyed.sonar("keys", "new", "vehicle")
    assert (done.returncode, "there are keys of that name" in done.stderr) == (2, True)


def test_an_allowed_host_reads_over_tcp(keyed: Any) -> None:
    assert keyed.sonar("keys", "allow", keyed.folder / "topside.key").returncode == 0
    start_both(keyed)
    keyed.wait_for(lambda: received(keyed) > 10, "receiving over tcp")


def test_a_host_that_is_not_allowed_gets_nothing_and_is_counted(keyed: Any) -> None:
    start_both(keyed)
    keyed.wait_until_said("handshake failed")
    assert received(keyed) == 0
    with connect_task("v/pose") as pose:
        refused = pose.describe()["outputs"]["pose_samples"]["rejected"]
    assert any("key is not on the allow-list" in reason for reason in refused), refused


def test_a_host_without_its_secret_key_is_told_how_to_make_one(keyed: Any) -> None:
    (keyed.folder / "keys" / "topside.key_secret").unlink()
    done = keyed.sonar("run", keyed.write(keyed.text), "--host", "topside")
    assert (done.returncode, "make one with: sonar keys new topside" in done.stderr) == (2, True)


def test_a_taken_tcp_port_is_named_and_ends_the_run(keyed: Any, unused_port: int) -> None:
    import socket

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", unused_port))
        taken.listen()
        done = keyed.sonar("run", keyed.write(keyed.text), "--host", "vehicle", "--seconds", 20)
    assert done.returncode == 1
    assert f"tcp://127.0.0.1:{unused_port}: cannot listen there: address already in use" in done.stdout
    assert "Traceback" not in done.stdout + done.stderr


@pytest.mark.parametrize(
    ("good", "bad", "message"),
    [
        (
            "address: 127.0.0.1, port: PORT, key: vehicle.key",
            "address: 10.0.0.5",
            "address 10.0.0.5 can be reached by others: give key (sonar keys new vehicle), or insecure: true",
        ),
        ("host: topside", "host: topsid", "no host 'topsid' (did you mean \"topside\"?)"),
        ("to: fls.sonar_pose_cmd", "to: fls.sonar_pose_cmd, policy: {reliable: 2}", "must stay on one host"),
        ("version: 1", "version: 1\n    clock: {mode: sim}", "sim needs all tasks on one host"),
    ],
)
def test_mistakes_about_hosts_are_found_before_anything_starts(graph: Any, good: str, bad: str, message: str) -> None:
    text = TWO.replace(good, bad).replace("PORT", "7800")
    with pytest.raises(SettingsError) as caught:
        check_deployment(graph.write(text))
    assert message in str(caught.value)


def test_an_open_address_is_taken_when_the_file_says_insecure(graph: Any, tmp_path: Path) -> None:
    text = TWO.replace("PORT, key: vehicle.key", "7800").replace("127.0.0.1, port: 7800", "10.0.0.5, port: 7800")
    plan = check_deployment(graph.write(text.replace("version: 1", "version: 1\n    insecure: true")))
    assert plan.addresses == {"pose.pose_samples": "tcp://10.0.0.5:7800"}
    assert plan.insecure
    loopback = TWO.replace("PORT", "7800").replace("version: 1", "version: 1\n    insecure: true")
    assert not check_deployment(graph.write(loopback)).insecure  # nobody can reach it: no reason to warn
