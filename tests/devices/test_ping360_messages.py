"""Messages of the scanning sonar: against bytes seen on the wire, and against the maker's own client."""

from __future__ import annotations

import dataclasses

import pytest
from brping import PingMessage
from brping.pingmessage import PingParser as TheirParser
from hypothesis import given
from hypothesis import strategies as st

from sonar_component.devices import ping360_messages as msg
from sonar_component.devices.ping_protocol import PingParser

# Recorded between the maker's client and a throwaway device.
RECORDED = {
    "42 52 02 00 06 00 00 00 05 00 a1 00": msg.GeneralRequest(5),
    "42 52 04 00 05 00 02 00 01 00 00 00 a0 00": msg.ProtocolVersion(1, 0, 0),
    "42 52 02 00 06 00 00 00 fc 08 a0 01": msg.GeneralRequest(2300),
    "42 52 0e 00 fc 08 02 00 01 00 00 00 20 00 50 00 e4 02 00 04 00 00 03 03": msg.DeviceData(
        1, 0, 0, 32, 80, 740, 1024
    ),
    "42 52 06 00 04 00 02 00 02 01 03 03 08 00 b1 00": msg.DeviceInformation(2, 1, 3, 3, 8),
    "42 52 0e 00 29 0a 00 00 00 01 01 00 0b 00 58 00 ee 02 b0 04 01 00 df 02": msg.Transducer(
        0, 1, 1, 11, 88, 750, 1200, 1
    ),
    "42 52 10 00 2a 0a 00 00 01 00 0b 00 58 00 ee 02 b0 04 00 00 8f 01 01 00 71 03": msg.AutoTransmit(
        1, 0, 11, 88, 750, 1200, 0, 399, 1, 0
    ),
}  # fmt: skip
_SIZES = {"B": 255, "H": 65535}


def messages() -> st.SearchStrategy[msg.Message]:
    return st.sampled_from(sorted(msg.MESSAGES)).flatmap(lambda number: fields_of(msg.MESSAGES[number]))


def fields_of(kind: type[msg.Message]) -> st.SearchStrategy[msg.Message]:
    values: list[st.SearchStrategy[object]] = [
        st.integers(0, _SIZES[letter]) for letter in kind.layout.format.lstrip("<")
    ]
    return st.builds(kind, *values, *([st.binary(max_size=100)] if kind.tail else []))


@pytest.mark.parametrize(("recorded", "message"), RECORDED.items())
def test_messages_are_those_seen_on_the_wire(recorded: str, message: msg.Message) -> None:
    source = bytes.fromhex(recorded)[6]
    assert message.frame(source) == bytes.fromhex(recorded)


@given(messages())
def test_what_is_packed_is_read_again(message: msg.Message) -> None:
    assert type(message).parse(message.payload()) == message


@given(messages())
def test_a_payload_of_another_length_is_refused(message: msg.Message) -> None:
    kind, payload = type(message), message.payload()
    cuts = range(kind.layout.size if kind.tail == "text" else len(payload))
    for cut in cuts:
        with pytest.raises(ValueError, match=f"of message {kind.message_id} must have"):
            kind.parse(payload[:cut])
    if kind.tail != "text":
        with pytest.raises(ValueError, match="must have"):
            kind.parse(payload + b"\0")


@given(messages())
def test_the_makers_client_reads_the_same_values(message: msg.Message) -> None:
    parser = TheirParser()
    frame = message.frame(source=2)
    results = [parser.parse_byte(byte) for byte in frame]
    assert results[-1] == TheirParser.NEW_MESSAGE
    theirs = parser.rx_msg
    assert (theirs.message_id, theirs.src_device_id) == (message.message_id, 2)
    numbers = [v for f in dataclasses.fields(message) if isinstance(v := getattr(message, f.name), int)]
    names = [name for name in theirs.payload_field_names if not name.endswith(("data", "data_length", "message"))]
    assert [getattr(theirs, name) for name in names] == numbers
    if message.tail == "counted":
        assert bytes(theirs.data) == message.data  # type: ignore[attr-defined]


def test_frames_of_the_makers_client_are_read() -> None:
    theirs = PingMessage(msg.Transducer.message_id)
    wanted = msg.Transducer(1, 2, 300, 20, 100, 760, 600, 1, 0)
    for name, value in zip(theirs.payload_field_names, dataclasses.astuple(wanted), strict=True):
        setattr(theirs, name, value)
    theirs.pack_msg_data()
    (frame,) = PingParser().feed(bytes(theirs.msg_data))
    assert msg.Transducer.parse(frame.payload) == wanted  # type: ignore[union-attr]


@pytest.mark.parametrize(("field", "limits"), msg.LIMITS.items())
def test_the_limits_of_the_definitions_are_taken_and_one_beyond_is_refused(field: str, limits: tuple[int, int]) -> None:
    transducer = msg.Transducer(1, 0, 0, 32, 80, 740, 1024, 0)
    auto = msg.AutoTransmit(1, 0, 32, 80, 740, 1024, 0, 399, 1, 0)
    for message in (transducer, auto, msg.SetDeviceId(2)):
        if not hasattr(message, field):
            continue
        for value in limits:
            assert msg.out_of_range(dataclasses.replace(message, **{field: value})) == ""
        beyond = dataclasses.replace(message, **{field: limits[1] + 1})
        low, high = limits
        assert f"out of range: {low} to {high}, got {high + 1}" in msg.out_of_range(beyond)
