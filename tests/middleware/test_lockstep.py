from __future__ import annotations

import hashlib
import itertools
from typing import Any

from sonar_component.middleware import connect
from sonar_component.middleware.deployment.plan import ConnectionPlan, Plan, TaskPlan
from sonar_component.middleware.lockstep import order_of, step_of

CHAIN = """
    version: 1
    clock: {mode: sim, lockstep: true, rate: 50, start: 100 s}
    tasks:
      fls: {type: NoisySonarTask}
      pose: {type: SourceTask, activity: {periodic: 30 ms}}
      slow: {type: SourceTask, activity: {periodic: 50 ms}}
    connections:
      - {from: pose.pose_samples, to: fls.sonar_pose_cmd, policy: {buffer: 10}}
"""
FRAMES = 60


def frames(graph: Any) -> dict[int, str]:
    graph.start(CHAIN)
    seen: dict[int, str] = {}
    with connect("fls.sonar_samples", policy="buffer", size=1000, timeout=20.0) as port:
        for sonar in port:
            seen[sonar.time] = hashlib.sha256(sonar.bins.tobytes()).hexdigest()
            if len(seen) == FRAMES:
                break
    graph.stop()
    return seen


def test_the_same_seed_gives_the_same_bytes_however_fast_the_processes_are(graph: Any) -> None:
    first, second = frames(graph), frames(graph)
    common = sorted(set(first) & set(second))
    assert len(common) > FRAMES / 2  # a reader may join some ticks later the second time
    assert [first[time] for time in common] == [second[time] for time in common]
    assert len(set(first.values())) == FRAMES  # and every frame has its own noise


def test_time_moves_in_steps_and_each_task_runs_at_its_own_period(graph: Any) -> None:
    graph.start(CHAIN)
    for name, period in (("pose", 30_000), ("slow", 50_000)):
        with connect(f"{name}.pose_samples", policy="buffer", size=1000, timeout=20.0) as port:
            times = [port.read().time for _ in range(20)]
        assert {time % 10_000 for time in times} == {0}
        steps = {later - earlier for earlier, later in itertools.pairwise(times)}
        # Due every 30 ms, with ticks of 10 ms: every due time is a tick.
        assert steps == {period}


def a_plan(*tasks: tuple[str, dict[str, Any]], lines: tuple[tuple[str, str], ...] = ()) -> Plan:
    made = [TaskPlan(name, "T", name, {}, activity) for name, activity in tasks]
    return Plan("p", "f", made, [ConnectionPlan(f"{a}.out", f"{b}.in") for a, b in lines])


def test_tasks_run_in_the_order_of_the_data_and_circles_begin_with_the_first() -> None:
    driven: dict[str, Any] = {"port_driven": []}
    chain = a_plan(("c", driven), ("b", driven), ("a", driven), lines=(("a", "b"), ("b", "c")))
    assert order_of(chain) == ["a", "b", "c"]
    circle = a_plan(("x", driven), ("y", driven), lines=(("x", "y"), ("y", "x")))
    assert order_of(circle) == ["x", "y"]
    slave = a_plan(("s", {"slave": "m"}), ("m", {"periodic": 0.1}))
    assert order_of(slave) == ["m", "s"]


def test_the_step_meets_every_period() -> None:
    assert step_of(a_plan(("a", {"periodic": 0.03}), ("b", {"periodic": 0.05}))) == 0.01
    assert step_of(a_plan(("a", {"port_driven": []}))) == 0.1
