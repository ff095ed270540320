"""Messages of the Oculus multibeam sonars: places of the known structures, and what a parser does with damage."""

from __future__ import annotations

import dataclasses
import struct

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from sonar_component.devices.oculus_messages import (
    DATA_32_BIT,
    HEADER,
    Fire,
    Flags,
    Result,
    Status,
    header,
    parse_fire,
    parse_result,
)
from sonar_component.devices.oculus_protocol import OculusParser, Unknown

# The structures as independent programs read them: of these the sizes are known to be checked.
RESULT_1 = "<HHHHHIH BBBBBdddd IIddddIBdHHIII"
RESULT_2 = "<HHHHHIH BBBBBdddd I8I IIddddddddBdHHIIIIIII"
STATUS = "<HHHHHIH IHHI6I III6B8dd"
_U8, _FLOAT = st.integers(0, 255), st.floats(allow_nan=False, allow_infinity=False)


@st.composite
def fires(draw: st.DrawFn) -> Fire:
    version = draw(st.sampled_from((1, 2)))
    more = draw(st.integers(0, 2**32 - 1)) if version == 2 else 0
    return Fire(*(draw(_U8) for _ in range(5)), *(draw(_FLOAT) for _ in range(4)), more, version)


@st.composite
def results(draw: st.DrawFn) -> Result:
    fire = draw(fires())
    ranges, beams = draw(st.integers(0, 6)), draw(st.integers(1, 5))
    dtype = draw(st.sampled_from(("<u1", "<u2", "<u4")))
    image = draw(hnp.arrays(np.dtype(dtype), (ranges, beams)))
    with_gains = bool(fire.flags & Flags.SEND_GAIN)
    gains = draw(hnp.arrays(np.dtype("<u4"), ranges)) if with_gains else None
    bearings = np.array(draw(st.lists(st.integers(-9000, 9000), min_size=beams, max_size=beams))) / 100
    return Result(fire, draw(st.integers(0, 2**32 - 1)), draw(_FLOAT), 0.0, draw(_FLOAT), bearings, image, gains)


@given(fires())
def test_a_fire_message_is_read_again(fire: Fire) -> None:
    assert OculusParser().feed(fire.message()) == [fire]


@given(st.lists(fires(), max_size=4), st.data())
def test_fire_messages_are_found_wherever_the_stream_is_cut(sent: list[Fire], data: st.DataObject) -> None:
    stream, parser, found = b"".join(fire.message() for fire in sent), OculusParser(), []
    while stream:
        cut = data.draw(st.integers(1, len(stream)))
        found += parser.feed(stream[:cut])
        stream = stream[cut:]
    assert found == sent


@given(fires())
def test_a_fire_message_truncated_at_any_byte_gives_nothing(fire: Fire) -> None:
    whole = fire.message()
    for cut in range(len(whole)):
        assert OculusParser().feed(whole[:cut]) == []


@given(st.binary(max_size=300).filter(lambda b: b"S" not in b), fires())
def test_garbage_in_front_of_a_message_is_passed_over(garbage: bytes, fire: Fire) -> None:
    assert OculusParser().feed(garbage + fire.message()) == [fire]


@given(st.binary(max_size=5000))
def test_garbage_is_never_kept_without_end(garbage: bytes) -> None:
    parser = OculusParser()
    for _ in range(4):
        parser.feed(garbage)
    assert len(parser._buffer) <= HEADER.size + 4096  # one message of the greatest size that is waited for


@pytest.mark.parametrize("version", [1, 2])
def test_a_fire_message_that_claims_no_payload_is_measured_by_its_version(version: int) -> None:
    fire = Fire(range=3.0, version=version)
    whole = header(0x15, 0, version) + fire.body()
    assert OculusParser().feed(whole + fire.message()) == [fire, fire]


def test_an_unknown_message_is_skipped_with_its_payload() -> None:
    stream = header(0x77, 9) + b"123456789" + Fire().message()
    assert OculusParser().feed(stream) == [Unknown(0x77, b"123456789"), Fire()]


def test_a_payload_size_that_no_client_sends_is_taken_for_garbage() -> None:
    assert OculusParser().feed(header(0x77, 1 << 30) + Fire().message()) == [Fire()]


@pytest.mark.parametrize("number", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["range", "gain", "speed_of_sound", "salinity"])
def test_numbers_that_are_not_finite_make_no_fire_message(name: str, number: float) -> None:
    fire = dataclasses.replace(Fire(), **{name: number})
    with pytest.raises(ValueError, match="not finite"):
        parse_fire(fire.body())
    assert OculusParser().feed(fire.message() + Fire().message()) == [Fire()]


def test_messages_seen_on_the_wire_have_these_sizes() -> None:
    assert [len(Fire(version=v).body()) for v in (1, 2)] == [37, 73]
    assert [struct.calcsize(s) for s in (RESULT_1, RESULT_2, STATUS)] == [122, 202, 142]
    assert len(Status(1, 1042, "127.0.0.1").message(1)) == 142


@given(results())
def test_a_result_is_read_again(result: Result) -> None:
    read = parse_result(result.message(7))
    assert read.fire == result.fire
    for name in ("ping_id", "frequency", "range_resolution"):
        assert getattr(read, name) == getattr(result, name)
    np.testing.assert_array_equal(read.image, result.image)
    np.testing.assert_allclose(read.bearings, result.bearings, atol=1e-9)
    if result.gains is not None:
        np.testing.assert_array_equal(read.gains, result.gains)


@given(results())
def test_a_result_truncated_at_any_byte_is_refused(result: Result) -> None:
    whole = result.message(7)
    for cut in range(len(whole)):
        with pytest.raises(ValueError):  # noqa: PT011  # every cut has its own reason
            parse_result(whole[:cut])


@given(results(), st.data())
def test_a_result_with_a_changed_byte_is_read_or_refused_but_never_breaks(result: Result, data: st.DataObject) -> None:
    whole = bytearray(result.message(7))
    whole[data.draw(st.integers(0, len(whole) - 1))] ^= data.draw(st.integers(1, 255))
    try:
        read = parse_result(bytes(whole))
    except ValueError:
        return
    assert read.image.nbytes <= len(whole)


@pytest.mark.parametrize(("version", "layout"), [(1, RESULT_1), (2, RESULT_2)])
def test_fields_of_a_result_stand_where_clients_look_for_them(version: int, layout: str) -> None:
    fire = Fire(2, 1, 25, 127, Flags.RANGE_IN_METRES | Flags.SEND_GAIN, 2.0, 70.0, 1500.0, 35.0, 0, version)
    image, gains = np.arange(12, dtype="<u2").reshape(3, 4), np.array([1, 2, 3], "<u4")
    result = Result(fire, 9, 2.1e6, 1.5, 0.25, np.array([-1.0, -0.5, 0.5, 1.0]), image, gains, 1490.0, 20.0, 2.5,
                    90.0, -3.0, 4.0)  # fmt: skip
    whole = result.message(0xF001)
    n = struct.unpack_from(layout, whole)
    assert n[:6] == (0x4F53, 0xF001, 0, 0x23, version, len(whole) - 16)
    assert n[7:16] == (2, 1, 25, 127, 5, 2.0, 70.0, 1500.0, 35.0)
    ranges, beams = (n[-5], n[-4]) if version == 1 else (n[-9], n[-8])
    offset, size, message_size = n[-3:]
    assert (ranges, beams, size) == (3, 4, 3 * (4 + 2 * 4))
    assert offset + size == message_size == len(whole)
    if version == 1:
        assert n[16:25] == (9, 0, 2.1e6, 20.0, 2.5, 1490.0, 1_500_000_000, 1, 0.25)
    else:
        assert n[25:37] == (9, 0, 2.1e6, 20.0, 2.5, 90.0, -3.0, 4.0, 1490.0, 1.5, 1, 0.25)
    bearings = np.frombuffer(whole, "<i2", 4, struct.calcsize(layout))
    assert bearings.tolist() == [-100, -50, 50, 100]
    row = struct.unpack_from("<I4H", whole, offset + 12)
    assert row == (2, 4, 5, 6, 7)


def test_the_status_tells_addresses_with_their_first_octet_in_the_low_byte() -> None:
    status = Status(0xF001, 1042, "192.168.2.3", "10.0.0.9", temperature=12.5, pressure=1.25)
    n = struct.unpack(STATUS, status.message(0xF001))
    assert n[0] == 0x4F53
    assert n[7:11] == (0xF001, 1, 1042, 3)
    assert [v & 0xFF for v in n[17:20]] == [192, 255, 10]
    assert n[20] & 0b11 == 0b10  # the MAC is locally administered, of one device
    assert n[26:] == (*[12.5] * 8, 1.25)


def test_samples_are_as_wide_as_the_flags_say() -> None:
    assert Fire().sample_bytes == 1
    assert Fire(flags=Flags.DATA_16_BIT).sample_bytes == 2
    assert Fire(flags=Flags.DATA_16_BIT, more_flags=DATA_32_BIT, version=2).sample_bytes == 4
    assert [Fire().beam_count, Fire(flags=Flags.BEAMS_512).beam_count] == [256, 512]
