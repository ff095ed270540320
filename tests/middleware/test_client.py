"""What another program can do at a running graph: read with every policy, and write to input ports."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.middleware import InvalidSampleError, WriteStatus, connect, connect_task
from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.settings import SettingsError

CHAIN = """
    version: 1
    tasks:
      pose: {type: SourceTask}
      fls: {type: PoseToSonarTask}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd}
"""
OPEN = """
    version: 1
    defaults: {restart_delay: 50 ms}
    tasks:
      recorder: {type: NumbersTask}
"""


def pose(number: float) -> RigidBodyState:
    return RigidBodyState(
        time=round(number) + 1, position=np.array([number, 0, 0]), orientation=np.array([1.0, 0, 0, 0])
    )


def numbers(graph: Any, count: int) -> list[float]:
    """What the recorder has read, once there are so many."""
    with connect_task("recorder") as task:
        return list(graph.wait_for(lambda: len(got := task.call("numbers")) >= count and got, f"reading {count} poses"))


@pytest.fixture
def open_graph(graph: Any) -> Any:
    graph.start(OPEN)
    graph.wait_until_said("recorder: RUNNING")
    return graph


def test_a_reliable_client_that_is_slow_loses_nothing_unnoticed(graph: Any) -> None:
    # Frames of half a megabyte: the kernel itself has room for some 200 kB, so small ones would wait there.
    graph.start(
        CHAIN.replace("pose: {type: SourceTask}", "pose: {type: SourceTask, properties: {beams: 256, bins: 500}}")
    )
    graph.wait_until_said("pose: RUNNING")
    with connect("pose.sonar_samples", Sonar, policy="reliable", size=2) as port:
        values = []
        for _ in range(10):
            time.sleep(0.1)
            values.append(float(port.read().bins[0, 0]))
        with connect_task("pose") as task:
            failures = task.describe()["outputs"]["sonar_samples"]["failures"]
        # 50 Hz into 10 Hz: four of five find no room, the writer knows of each, and the rest comes in order.
        assert failures > 10
        assert values == sorted(set(values))
        assert port.account.dropped == port.account.replaced == 0
        assert port.account.lost > 0
    with connect_task("pose") as task:
        graph.wait_for(lambda: task.describe()["outputs"]["sonar_samples"]["listeners"] == 0, "parting")


def test_a_reliable_client_reads_on_after_its_writer_was_killed(graph: Any) -> None:
    graph.start(CHAIN.replace("version: 1", "version: 1\n    defaults: {restart_delay: 50 ms}"))
    graph.wait_until_said("pose: RUNNING")
    with connect("pose.pose_samples", RigidBodyState, policy={"reliable": 64}, timeout=20.0) as port:
        port.read()
        with connect_task("pose") as task:
            os.kill(task.record["pid"], signal.SIGKILL)
        graph.wait_for(lambda: port.read() and port.account.restarts == 1, "reading from the new process")


@pytest.mark.parametrize("policy", ["data", {"buffer": 3}, {"circular_buffer": 3}, {"reliable": 3}])
def test_every_policy_of_a_deployment_is_there_for_a_client(graph: Any, policy: Any) -> None:
    graph.start(CHAIN)
    with connect("pose.pose_samples", RigidBodyState, policy=policy, timeout=20.0) as port:
        port.read()
        time.sleep(0.5)  # 25 samples, of which 1 or 3 are kept
        size = 1 if policy == "data" else 3
        assert port.waiting == size
        account = port.account
        counts = {"data": account.replaced, "buffer": account.dropped, "circular_buffer": account.dropped}
        assert counts.get(port.policy.kind, 1) > 0
        assert f"received {account.received}" in repr(port)


@pytest.mark.parametrize(
    ("policy", "message"),
    [
        ("relyable", "got 'relyable' (did you mean \"reliable\"?)"),
        ({"buffer": 0}, "policy.buffer: must be at least 1, got 0"),
        ({"buffer": 1, "reliable": 2}, "must name one of data, buffer, circular_buffer, reliable"),
        ({"bufer": 1}, "policy.bufer"),
    ],
)
def test_a_wrong_policy_is_refused_before_anything_is_asked(policy: Any, message: str) -> None:
    with pytest.raises(SettingsError) as caught:
        connect("pose.pose_samples", policy=policy)
    assert message in str(caught.value)


def test_what_a_client_writes_is_read_by_the_task(open_graph: Any) -> None:
    with connect("recorder.poses", RigidBodyState, write=True, policy={"buffer": 100}) as port:
        assert [port.write(pose(number)) for number in range(20)] == [WriteStatus.SUCCESS] * 20
        open_graph.wait_for(lambda: port.account.received == 20, "telling what became of the samples")
        assert (port.written, port.account.lost, port.account.dropped) == (20, 0, 0)
    assert numbers(open_graph, 20) == list(range(20))


def test_a_single_sample_written_at_leaving_is_still_read(open_graph: Any) -> None:
    for number in range(5):
        with connect("recorder.poses", write=True) as port:
            port.write(pose(number))
    assert numbers(open_graph, 5) == list(range(5))


def test_an_input_port_belongs_to_one_writer_unless_it_is_shared(graph: Any, open_graph: Any) -> None:
    with connect("recorder.poses", write=True) as first:
        with pytest.raises(SettingsError, match=r"connected to client_\d+_\w+.poses already.*shared=True"):
            connect("recorder.poses", write=True)
        with connect("recorder.poses", write=True, shared=True) as second:
            first.write(pose(1))
            second.write(pose(2))
            assert sorted(numbers(open_graph, 2)) == [1, 2]
        drawn = open_graph.sonar("graph", "--seconds", 0.1).stdout
        assert drawn.count("(client, process elsewhere)") == 1
        assert f"recorder.poses <- {first._visit.client}.poses  [data" in drawn
    with connect("recorder.poses", write=True) as third:  # at once: both have left
        assert third.connected()


def test_a_port_that_the_deployment_connects_is_not_taken_from_it(graph: Any) -> None:
    graph.start(CHAIN)
    graph.wait_until_said("fls: RUNNING")
    with pytest.raises(SettingsError) as caught:
        connect("fls.sonar_pose_cmd", write=True)
    assert str(caught.value) == (
        "fls.sonar_pose_cmd is connected to pose.pose_samples already, and two writers would take turns; allowed: a "
        "port that nobody writes to, or sharing it (shared=True, --shared)"
    )


def test_a_killed_writer_gives_its_port_back(open_graph: Any) -> None:
    program = (
        "import time; from sonar_component.middleware import connect\n"
        "with connect('recorder.poses', write=True): print('there', flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "there\n"
        other.kill()
    with connect("recorder.poses", write=True) as port:  # at once: the kernel has released its lock
        port.write(pose(7))
        assert numbers(open_graph, 1) == [7]
    left = [path.name for path in (Path(os.environ["SONAR_RUN_DIR"]) / ".clients").iterdir()]
    assert left == []


def test_a_writer_is_heard_again_after_the_task_was_killed(open_graph: Any) -> None:
    with connect("recorder.poses", write=True, policy={"buffer": 100}) as port:
        with connect_task("recorder") as task:
            os.kill(task.record["pid"], signal.SIGKILL)
        open_graph.wait_until_said("recorder: RUNNING", times=2)
        open_graph.wait_for(port.connected, "listening again")
        port.write(pose(3))
        assert numbers(open_graph, 1) == [3]


def test_a_reliable_writer_is_told_that_there_is_no_room(open_graph: Any) -> None:
    with connect_task("recorder") as task, connect("recorder.poses", write=True, policy={"reliable": 2}) as port:
        task.command("stop")  # nobody reads now
        statuses: list[WriteStatus] = []
        while len(statuses) < 500 and WriteStatus.FAILURE not in statuses:
            statuses.append(port.write(pose(len(statuses))))
            time.sleep(0.001)
        assert statuses[-1] is WriteStatus.FAILURE
        assert port.failures == 1
        assert task.describe()["inputs"]["poses"]["connections"][0]["dropped"] == 0


def test_what_cannot_be_written_is_refused_in_words(open_graph: Any) -> None:
    for name, options, message in (
        ("recorder.pose", {}, "recorder has no input port 'pose' (did you mean \"poses\"?); it has: poses"),
        ("recorder.state", {}, "recorder has no input port 'state'; it is an output; it has: poses"),
        ("recorder.poses", {"sample_type": Sonar}, "recorder.poses takes RigidBodyState, not Sonar"),
    ):
        with pytest.raises(SettingsError) as caught:
            connect(name, write=True, **options)  # type: ignore[call-overload]
        assert str(caught.value) == message
    with connect("recorder.poses", write=True) as port:
        with pytest.raises(TypeError, match=r"recorder\.poses takes RigidBodyState, got Sonar"):
            port.write(Sonar())
        with pytest.raises(InvalidSampleError, match=r"recorder\.poses: orientation"):
            port.write(RigidBodyState(time=1, position=np.zeros(3), orientation=np.zeros(4)))
        assert port.written == 0


def test_a_stranger_cannot_have_the_task_connect_elsewhere(open_graph: Any) -> None:
    with connect_task("recorder") as task:
        for name in ("../../etc", "nobody_1", "", 7):
            with pytest.raises(RuntimeError, match=r"client name must be|no client"):
                task._ask("admit", port="poses", client=name, type="RigidBodyState", major=1)


def test_nonsense_requests_are_answered_with_reasons_and_change_nothing(open_graph: Any) -> None:
    """Known requests with made-up arguments: those that are no requests at all are in test_transport.py."""
    chance = random.Random(6)
    words: list[Any] = [
        "recorder",
        "poses",
        "state",
        "",
        "..",
        "x" * 300,
        None,
        -1,
        2**63,
        0.5,
        True,
        [],
        {},
        [["a"]],
        b"\0",
    ]
    ops = ["state", "describe", "record", "get", "set", "call", "command", "reserve", "admit", "leave", "step", "tasks"]
    keys = ["port", "client", "type", "major", "policy", "size", "name", "value", "arguments", "seq"]
    with connect_task("recorder") as task:
        before = memory(task.record["pid"])
        reasons = []
        for _ in range(3000):
            request = {key: chance.choice(words) for key in chance.sample(keys, 4)}
            try:
                task._client.ask(chance.choice(ops), 5.0, task=chance.choice(["recorder", *words]), **request)
            except RuntimeError as error:
                reasons.append(str(error))
        assert len(reasons) > 1000
        assert all(reasons)
        assert task.state()["state"] == "RUNNING"
        assert task.describe()["inputs"]["poses"]["connections"] == []
        assert memory(task.record["pid"]) - before < 20  # [MB], the issue's


def memory(pid: int) -> float:
    """Resident memory [MB]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
