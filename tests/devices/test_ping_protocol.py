"""Frames of the Ping protocol: bytes seen on the wire of the maker's client, and what a parser does with damage."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sonar_component.devices.ping_protocol import PAYLOAD_MAX, LineBreak, PingFrame, PingParser, encode

_U8, _U16 = st.integers(0, 255), st.integers(0, 0xFFFF)
frames = st.builds(PingFrame, _U16, st.binary(max_size=PAYLOAD_MAX), _U8, _U8)


def good(events: list[PingFrame | LineBreak]) -> list[PingFrame]:
    return [event for event in events if isinstance(event, PingFrame)]


def test_a_request_for_the_protocol_version_is_what_the_makers_client_sends() -> None:
    recorded = bytes.fromhex("42 52 02 00 06 00 00 00 05 00 a1 00")
    assert encode(PingFrame(6, b"\x05\x00")) == recorded
    assert PingParser().feed(recorded) == [PingFrame(6, b"\x05\x00")]


@given(frames)
def test_what_is_encoded_is_read_again(frame: PingFrame) -> None:
    assert PingParser().feed(encode(frame)) == [frame]


@given(st.lists(frames, max_size=4), st.data())
def test_frames_are_found_wherever_the_stream_is_cut(sent: list[PingFrame], data: st.DataObject) -> None:
    stream, parser, found = b"".join(map(encode, sent)), PingParser(), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        found += parser.feed(stream[:cut])
        stream = stream[cut:]
    assert found == sent


@given(frames)
def test_a_frame_truncated_at_any_byte_gives_nothing_and_breaks_nothing(frame: PingFrame) -> None:
    whole = encode(frame)
    for cut in range(len(whole)):
        parser = PingParser()
        assert good(parser.feed(whole[:cut])) == []
        parser.reset()
        assert parser.feed(whole) == [frame]


@given(frames, st.data())
def test_a_frame_with_a_changed_byte_is_dropped_or_is_another_frame_with_a_good_sum(
    frame: PingFrame, data: st.DataObject
) -> None:
    whole = bytearray(encode(frame))
    place = data.draw(st.integers(0, len(whole) - 1))
    whole[place] ^= data.draw(st.integers(1, 255))
    for found in good(PingParser().feed(bytes(whole))):
        assert found != frame
        assert encode(found) in bytes(whole)  # its own sum is right: nothing could have told


@given(st.binary(max_size=600), frames)
def test_after_any_garbage_a_line_break_brings_the_parser_back(garbage: bytes, frame: PingFrame) -> None:
    parser = PingParser()
    parser.feed(garbage)
    parser.reset()
    assert parser.feed(encode(frame)) == [frame]


@given(st.binary(max_size=100).filter(lambda b: b"B" not in b), frames)
def test_garbage_in_front_of_a_frame_is_passed_over(garbage: bytes, frame: PingFrame) -> None:
    assert good(PingParser().feed(garbage + encode(frame))) == [frame]


def test_a_bad_checksum_drops_that_frame_only() -> None:
    bad = bytearray(encode(PingFrame(6, b"\x05\x00")))
    bad[-1] ^= 1
    parser = PingParser()
    assert parser.feed(bytes(bad) + encode(PingFrame(2903))) == [PingFrame(2903)]
    assert parser.dropped == 1


def test_a_length_beyond_the_buffer_is_forgotten_right_after_the_length() -> None:
    parser = PingParser()
    assert parser.feed(b"BR\xff\xff" + encode(PingFrame(2903))) == [PingFrame(2903)]


def test_a_truncated_frame_waits_and_swallows_the_next_one() -> None:
    parser, request = PingParser(), encode(PingFrame(6, b"\x05\x00"))
    assert parser.feed(request[:-3]) == []
    assert parser.feed(request) == []  # its first bytes end the frame that waits, with a sum that is wrong
    assert parser.feed(request) == [PingFrame(6, b"\x05\x00")]


@pytest.mark.parametrize("noise", [b"U", b"UUU", b"\x00U\xff"])
def test_a_u_outside_of_a_frame_is_a_line_break(noise: bytes) -> None:
    frame = PingFrame(2903)
    assert PingParser().feed(encode(frame) + noise) == [frame, LineBreak()]


def test_a_u_inside_of_a_frame_is_data() -> None:
    frame = PingFrame(3, b"UUU")
    assert PingParser().feed(encode(frame)) == [frame]


def test_a_parser_keeps_no_more_than_one_frame_of_whatever_comes() -> None:
    parser = PingParser()
    for _ in range(1000):
        parser.feed(b"BR\x00\x02garbage without end")
    assert len(parser._buffer) <= PAYLOAD_MAX + 10  # header and checksum
