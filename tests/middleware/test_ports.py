from __future__ import annotations

import numpy as np
import pytest

from sonar_component.middleware import FlowStatus, InputPort, InvalidSampleError, OutputPort, Policy, WriteStatus
from sonar_component.middleware.ports import connect_in_process
from sonar_component.samples import Frame, RigidBodyState


def joined(policy: Policy) -> tuple[OutputPort[Frame], InputPort[Frame]]:
    writer: OutputPort[Frame] = OutputPort(Frame).own("writer", "out")
    reader: InputPort[Frame] = InputPort(Frame).own("reader", "in")
    connect_in_process(writer, reader, policy)
    return writer, reader


def write(writer: OutputPort[Frame], *times: int) -> list[WriteStatus]:
    return [writer.write(Frame(time)) for time in times]


def read_all(reader: InputPort[Frame]) -> list[int]:
    found = []
    while (sample := reader.read_new()) is not None:
        found.append(sample.time)
    return found


def test_reading_tells_no_data_new_data_and_old_data() -> None:
    writer, reader = joined(Policy.of("data"))
    assert reader.read() == (FlowStatus.NO_DATA, None)
    write(writer, 1)
    assert reader.read()[0] is FlowStatus.NEW_DATA
    status, sample = reader.read()
    assert (status, sample and sample.time) == (FlowStatus.OLD_DATA, 1)


@pytest.mark.parametrize(
    ("policy", "read", "counted"),
    [
        (Policy.of("data"), [5], {"replaced": 4, "dropped": 0}),
        (Policy.of("buffer", 3), [1, 2, 3], {"replaced": 0, "dropped": 2}),
        (Policy.of("circular_buffer", 3), [3, 4, 5], {"replaced": 0, "dropped": 2}),
        (Policy.of("reliable", 3), [1, 2, 3], {"replaced": 0, "dropped": 2}),
    ],
    ids=lambda value: getattr(value, "kind", None),
)
def test_each_policy_keeps_its_own_and_counts_the_rest(
    policy: Policy, read: list[int], counted: dict[str, int]
) -> None:
    writer, reader = joined(policy)
    write(writer, 1, 2, 3, 4, 5)
    assert read_all(reader) == read
    account = reader.connections[0].mailbox.account.as_dict()
    assert {key: account[key] for key in counted} == counted
    assert account["received"] == 5


def test_a_reliable_connection_tells_the_writer_when_it_is_full() -> None:
    writer, _ = joined(Policy.of("reliable", 2))
    assert write(writer, 1, 2, 3) == [WriteStatus.SUCCESS, WriteStatus.SUCCESS, WriteStatus.FAILURE]


def test_writing_to_nobody_says_so() -> None:
    writer: OutputPort[Frame] = OutputPort(Frame).own("writer", "out")
    assert not writer.connected()
    assert write(writer, 1) == [WriteStatus.NOT_CONNECTED]


@pytest.mark.parametrize(("policy", "seen"), [(Policy.of("data"), [7]), (Policy.of("buffer", 4), [])])
def test_a_late_reader_is_given_the_last_value_on_data_connections(policy: Policy, seen: list[int]) -> None:
    writer: OutputPort[Frame] = OutputPort(Frame).own("writer", "out")
    write(writer, 6, 7)
    reader: InputPort[Frame] = InputPort(Frame).own("reader", "in")
    connect_in_process(writer, reader, policy)
    assert read_all(reader) == seen


def test_within_a_process_the_same_object_arrives_and_its_arrays_are_read_only() -> None:
    writer, reader = joined(Policy.of("data"))
    sample = Frame(1, np.zeros((2, 2, 1), np.float32))
    writer.write(sample)
    assert reader.read_new() is sample
    with pytest.raises(ValueError, match="read-only"):
        sample.image[0, 0, 0] = 1


def test_two_writers_are_read_in_turn() -> None:
    first, reader = joined(Policy.of("buffer", 9))
    second: OutputPort[Frame] = OutputPort(Frame).own("second", "out")
    connect_in_process(second, reader, Policy.of("buffer", 9))
    write(first, 1, 2)
    write(second, 10, 20)
    assert read_all(reader) == [1, 10, 2, 20]


def test_a_sample_of_another_type_cannot_be_written() -> None:
    writer, _ = joined(Policy.of("data"))
    with pytest.raises(TypeError, match=r"writer\.out takes Frame, got RigidBodyState"):
        writer.write(RigidBodyState())  # type: ignore[arg-type]


def test_an_unusable_sample_is_reported_once_and_counted() -> None:
    writer: OutputPort[RigidBodyState] = OutputPort(RigidBodyState).own("pose", "pose_samples")
    reader: InputPort[RigidBodyState] = InputPort(RigidBodyState).own("fls", "sonar_pose_cmd")
    connect_in_process(writer, reader, Policy.of("data"))
    writer.write(RigidBodyState(position=np.zeros(3), orientation=np.array([2.0, 0, 0, 0])))
    with pytest.raises(
        InvalidSampleError, match=r"fls\.sonar_pose_cmd: orientation must be a unit quaternion, got length 2"
    ):
        reader.read()
    assert reader.read() == (FlowStatus.NO_DATA, None)
    assert reader.invalid == 1


def test_starting_empties_buffers_and_keeps_the_value_of_data_connections() -> None:
    for policy, kept in ((Policy.of("data"), [3]), (Policy.of("buffer", 4), [])):
        writer, reader = joined(policy)
        write(writer, 1, 2, 3)
        reader.clear()
        assert read_all(reader) == kept
