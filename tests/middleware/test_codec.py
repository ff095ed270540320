from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from sonar_component.middleware.codec import WireError, decode, decode_untyped, encode, envelope_of, unpack
from sonar_component.middleware.schema import DTYPES, schema_of
from sonar_component.samples import Frame, RigidBodyState, Sonar

ENVELOPE: dict[str, Any] = {
    "e": 1, "type": "Sonar", "sv": [1, 0], "sh": "0", "src": "fls.sonar_samples", "run": "r", "seq": 7, "t": 5, "tp": 6,
    "clk": "wall",
}  # fmt: skip


@dataclass
class Everything:
    whole: int = 0
    real: float = 0.0
    text: str = ""
    yes: bool = False
    image: NDArray[np.generic] = field(default_factory=lambda: np.zeros(0, np.uint8))
    doubles: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))


def through_the_wire(sample: Any, **envelope: Any) -> Any:
    frames = encode(sample, {**ENVELOPE, "type": type(sample).__name__, **envelope})
    received = [bytes(frames[0]), *(memoryview(f).cast("B") for f in frames[1:])]
    return decode(schema_of(type(sample)), unpack(received[0]), received[1:])


def a_sonar() -> Sonar:
    bins = np.arange(12, dtype=np.float32).reshape(3, 4)
    return Sonar(time=11, bearings=np.array([0.1, 0.0, -0.1]), bin_count=4, beam_count=3, bins=bins, bin_duration=1e-4)


@settings(max_examples=200, deadline=None)
@given(
    whole=st.integers(-(2**63), 2**63 - 1),
    real=st.floats(),
    text=st.text(max_size=50),
    yes=st.booleans(),
    image=st.sampled_from(sorted(DTYPES)).flatmap(
        lambda name: hnp.arrays(DTYPES[name], hnp.array_shapes(min_dims=0, min_side=0, max_side=12))
    ),
)
def test_every_sample_comes_back_as_it_was(whole: int, real: float, text: str, yes: bool, image: Any) -> None:
    back = through_the_wire(Everything(whole, real, text, yes, image, np.array([real])))
    assert (back.whole, back.text, back.yes) == (whole, text, yes)
    assert back.real == real or (real != real and back.real != back.real)
    assert back.image.dtype == image.dtype
    assert back.image.shape == image.shape
    assert back.image.tobytes() == image.tobytes()  # bit for bit, also NaN


def test_a_pose_travels_in_one_frame_behind_its_topic() -> None:
    assert len(encode(RigidBodyState(), ENVELOPE)) == 1


def test_large_arrays_are_sent_as_they_lie_in_memory() -> None:
    sonar = a_sonar()
    sonar.bins = np.zeros((3, 1000), np.float32)
    assert encode(sonar, ENVELOPE)[1] is sonar.bins


def test_an_array_of_the_wrong_order_or_byte_order_is_laid_out_anew() -> None:
    image = np.arange(6, dtype=">i4").reshape(2, 3).T
    assert np.array_equal(through_the_wire(Everything(image=image)).image, image)


def test_received_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        through_the_wire(a_sonar()).bins[0, 0] = 1


def test_the_envelope_is_read_without_the_arrays() -> None:
    header = envelope_of(unpack(encode(a_sonar(), ENVELOPE)[0]))
    assert (header.type, header.source, header.seq, header.time, header.version) == (
        "Sonar",
        "fls.sonar_samples",
        7,
        5,
        (1, 0),
    )


def test_a_field_that_the_reader_does_not_know_is_skipped() -> None:
    header = unpack(encode(a_sonar(), ENVELOPE)[0])
    header["body"]["new_field"] = 3
    header["arr"].append(["new_array", "<f4", [1], b"abcd"])
    assert decode(schema_of(Sonar), header, []).beam_count == 3


def test_a_field_that_did_not_come_keeps_its_default() -> None:
    header = unpack(encode(a_sonar(), ENVELOPE)[0])
    del header["body"]["speed_of_sound"]
    assert decode(schema_of(Sonar), header, []).speed_of_sound == 1497.0


def test_another_major_version_is_refused_naming_both() -> None:
    with pytest.raises(WireError, match="'Sonar' version 2, this port takes Sonar version 1"):
        through_the_wire(a_sonar(), sv=[2, 0])


def test_another_type_is_refused_naming_both() -> None:
    header = unpack(encode(a_sonar(), ENVELOPE)[0])
    with pytest.raises(WireError, match="sample is 'Sonar' version 1, this port takes Frame"):
        decode(schema_of(Frame), header, [])


def test_a_type_that_is_not_installed_is_read_as_a_namespace() -> None:
    header = unpack(encode(a_sonar(), ENVELOPE)[0])
    assert decode_untyped(header, []).bins.shape == (3, 4)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"arr": [["bins", "|O", [3, 4], b""]]}, "dtype '|O' is not allowed"),
        ({"arr": [["bins", "<M8[s]", [1], b"01234567"]]}, "is not allowed"),
        ({"arr": [["bins", "<f4", [3, 5], bytes(48)]]}, "takes 60 bytes, 48 came"),
        ({"arr": [["bins", "<f4", [-1, 4], bytes(48)]]}, "shape .* is not allowed"),
        ({"arr": [["bins", "<f4", [1] * 9, bytes(4)]]}, "shape .* is not allowed"),
        ({"arr": [["bins", "<f4", [2**62, 2**62], bytes(48)]]}, "bytes, 48 came"),
        ({"arr": [["bins", "<f8", [6], bytes(48)]]}, "array 'bins' must be <f4, got float64|must be <f4, got <f8"),
        ({"arr": [["bins", "<f4", [3, 4]]]}, "has no buffer: 0 came"),
        ({"arr": 7}, "must be a list"),
        ({"arr": [[]] * 300}, "at most 256"),
        ({"body": []}, "'body' must be dict"),
        ({"body": {"beam_count": "3"}}, "field 'beam_count' must be int, got '3'"),
        ({"body": {"beam_count": True}}, "must be int, got True"),
        ({"seq": -1.5}, "'seq' must be int"),
        ({"e": 2}, "envelope version 2, this reader knows 1"),
        ({"sv": [1]}, r"\[major, minor\]"),
    ],
)
def test_a_broken_message_is_refused_with_its_reason(change: dict[str, Any], reason: str) -> None:
    header = {**msgpack.unpackb(encode(a_sonar(), ENVELOPE)[0]), **change}
    with pytest.raises(WireError, match=reason):
        decode(schema_of(Sonar), unpack(msgpack.packb(header)), [])


def test_an_array_bomb_and_half_a_header_are_refused() -> None:
    for frame in (b"\xdd\xff\xff\xff\xff", encode(a_sonar(), ENVELOPE)[0][:50], b"", b"\xc1", b"\x81" * 5000):
        with pytest.raises(WireError):
            unpack(frame)


@settings(max_examples=500, deadline=None)
@given(st.binary(max_size=300))
def test_random_bytes_are_refused_and_nothing_else_happens(data: bytes) -> None:
    with pytest.raises(WireError):
        decode(schema_of(Sonar), unpack(data), [])


@settings(max_examples=500, deadline=None)
@given(position=st.integers(0, 10_000), value=st.integers(0, 255))
def test_a_flipped_byte_gives_a_sample_or_a_reason(position: int, value: int) -> None:
    frame = bytearray(encode(a_sonar(), ENVELOPE)[0])
    frame[position % len(frame)] = value
    try:
        decode(schema_of(Sonar), unpack(bytes(frame)), [])
    except WireError:
        pass


def test_a_sample_type_holds_only_what_can_travel() -> None:
    @dataclass
    class Bad:
        thing: object = None

    with pytest.raises(TypeError, match=r"Bad\.thing: a sample holds int, float, str, bool and arrays"):
        schema_of(Bad)
