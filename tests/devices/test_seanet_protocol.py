"""Messages of SeaNet heads: bytes and sizes seen on the wire, and what a parser does with damage."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_component.devices.seanet_messages import (
    Alive,
    HeadCommand,
    HeadData,
    parse_alive,
    parse_head_command,
    parse_head_data,
)
from sonar_component.devices.seanet_protocol import NODE, PC, SeaNetMessage, SeaNetParser

_U8, _U16, _U32 = st.integers(0, 255), st.integers(0, 0xFFFF), st.integers(0, 2**32 - 1)
messages = st.builds(SeaNetMessage, _U8, st.binary(max_size=200), _U8, _U8, _U8)
_WIDTHS = [*"BHBIIIIHHHHBBBBHHBBHHHHHBBH"]
_NUMBER = {"B": _U8, "H": _U16, "I": _U32}


@st.composite
def commands(draw: st.DrawFn) -> HeadCommand:
    more = draw(st.booleans())
    values = [draw(_NUMBER[width]) for width in _WIDTHS[1:]]
    return HeadCommand(0x1D if more else 0x01, *values, more=draw(st.binary(min_size=16, max_size=16)) if more else b"")


@st.composite
def echoes(draw: st.DrawFn) -> HeadData:
    values = [draw(_NUMBER[width]) for width in "BBHHIBHBBHHHHBH"]
    return HeadData(*values, draw(st.binary(max_size=300)))


def test_a_sign_of_life_is_what_was_seen_on_the_wire() -> None:
    message = SeaNetMessage(4, Alive(0x01020304, 3200, 0x42).payload(), source=NODE, destination=PC).encode()
    assert message[:13] == bytes.fromhex("40 30 30 31 30 10 00 02 ff 0b 04 80 02")
    assert message[13:] == bytes.fromhex("01 04 03 02 01 80 0c 42 0a")


def test_messages_have_the_sizes_seen_on_the_wire() -> None:
    assert len(SeaNetMessage(25, bytes(4)).encode()) == 18
    assert len(SeaNetMessage(19, HeadCommand(0x1D, more=bytes(16)).payload()).encode()) == 82
    assert len(HeadCommand().payload()) == 52
    data = HeadData(*([0] * 15), bytes(300))  # type: ignore[call-arg]
    whole = SeaNetMessage(2, data.payload(), NODE, PC).encode()
    assert len(whole) == 345
    assert whole[9] == 0
    assert int.from_bytes(whole[13:15], "little") == 345 - 14


@given(messages)
def test_a_message_is_read_again(message: SeaNetMessage) -> None:
    assert SeaNetParser().feed(message.encode()) == [message]


@given(st.lists(messages, max_size=4), st.data())
def test_messages_are_found_wherever_the_stream_is_cut(sent: list[SeaNetMessage], data: st.DataObject) -> None:
    stream, parser, found = b"".join(m.encode() for m in sent), SeaNetParser(), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        found += parser.feed(stream[:cut])
        stream = stream[cut:]
    assert found == sent


@given(messages)
def test_a_message_truncated_at_any_byte_gives_nothing(message: SeaNetMessage) -> None:
    whole = message.encode()
    for cut in range(len(whole)):
        assert SeaNetParser().feed(whole[:cut]) == []


@given(messages, st.integers(1, 6), _U8)
def test_two_lengths_that_differ_make_no_message_and_the_next_is_found(
    message: SeaNetMessage, place: int, byte: int
) -> None:
    damaged = bytearray(message.encode())
    if damaged[place] == byte or (place < 5 and bytes([byte]).upper() == bytes([damaged[place]])):
        return
    damaged[place] = byte
    good = SeaNetMessage(23)
    assert SeaNetParser().feed(bytes(damaged) + good.encode())[-1:] == [good]


@given(st.binary(max_size=300).filter(lambda b: b"@" not in b), messages)
def test_garbage_in_front_of_a_message_is_passed_over(garbage: bytes, message: SeaNetMessage) -> None:
    assert SeaNetParser().feed(garbage + message.encode()) == [message]


@given(st.binary(max_size=2000))
def test_garbage_is_never_kept_without_end(garbage: bytes) -> None:
    parser = SeaNetParser()
    for _ in range(4):
        parser.feed(garbage)
    assert len(parser._buffer) <= 512 + 6  # one message of the greatest length that is waited for


@given(commands())
def test_a_head_command_is_read_again(command: HeadCommand) -> None:
    assert parse_head_command(command.payload()) == command


@given(commands())
def test_a_head_command_of_another_length_is_refused(command: HeadCommand) -> None:
    payload = command.payload()
    for cut in range(len(payload)):
        with pytest.raises(ValueError, match="has"):
            parse_head_command(payload[:cut])
    with pytest.raises(ValueError, match="has"):
        parse_head_command(payload + b"\0")


@given(echoes())
def test_echoes_are_read_again_and_refused_when_cut(data: HeadData) -> None:
    payload = data.payload()
    assert parse_head_data(payload) == data
    for cut in range(len(payload)):
        with pytest.raises(ValueError, match="echoes"):
            parse_head_data(payload[:cut])


def test_a_sign_of_life_is_read_again() -> None:
    alive = Alive(123456, 6399, 0x8A)
    assert parse_alive(alive.payload()) == alive
    with pytest.raises(ValueError, match="sign of life"):
        parse_alive(alive.payload()[:-1])


def test_fields_of_a_head_command_stand_where_the_head_looks_for_them() -> None:
    command = HeadCommand(left=0x0102, right=0x0304, step=0x20, ad_interval=0x0506, bin_count=300)
    payload = command.payload()
    # Places counted from 0 in the payload, which begins at byte 14 of a message counted from 1.
    assert payload[24:28] == bytes.fromhex("02 01 04 03")
    assert payload[37] == 0x20
    assert payload[38:42] == bytes.fromhex("06 05 2c 01")
