"""Layouts against the codec, whose reading of a header is the plain one."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Any

import msgpack
import numpy as np
import pytest
from numpy.typing import NDArray

from sonar_component.middleware.codec import ENVELOPE, WireError, decode, encode, unpack
from sonar_component.middleware.layout import Decoder, Encoder
from sonar_component.middleware.schema import schema_of
from sonar_component.middleware.task import TaskState
from sonar_component.samples import RigidBodyState, Sonar


@dataclass
class Wide:
    """More fields than fit a short map or array of msgpack, and an array of any kind of number."""

    numbers: NDArray[Any] = field(default_factory=lambda: np.arange(3, dtype=np.uint16))
    good: bool = True
    a: int = -1
    b: int = 2
    c: int = 3
    d: int = 4
    e: int = 5
    f: int = 6
    g: int = 7
    h: int = 8
    i: int = 9
    j: int = 10
    k: int = 11
    l: int = 12  # noqa: E741 - a row of names
    m: int = 13
    n: float = float("inf")
    o: float = -0.0


def a_sonar(beams: int = 600) -> Sonar:
    return Sonar(
        time=5, bearings=np.linspace(-1, 1, beams), beam_count=beams, bin_count=4, bins=np.ones((beams, 4), np.float32)
    )


def envelope(cls: type, run: str = "r1") -> dict[str, Any]:
    schema = schema_of(cls)
    return {
        "e": ENVELOPE, "type": schema.name, "sv": [schema.major, schema.minor], "sh": schema.hash, "src": "t.p",
        "run": run, "clk": "wall",
    }  # fmt: skip


def encoder(cls: type, run: str = "r1") -> Encoder:
    return Encoder(schema_of(cls), envelope(cls, run))


def plain(frames: list[Any]) -> tuple[bytes, list[Any]]:
    return bytes(frames[0]), [memoryview(buffer).cast("B") for buffer in frames[1:]]


def read_plainly(cls: type, frame: bytes, buffers: list[Any]) -> tuple[int, int, Any]:
    header = unpack(frame)
    return header["seq"], header["t"], decode(schema_of(cls), header, buffers)


def learned(cls: type, frames: list[Any]) -> Decoder:
    decoder = Decoder(schema_of(cls))
    frame, buffers = plain(frames)
    header = unpack(frame)
    decode(schema_of(cls), header, buffers)
    decoder.learn(frame, header)
    return decoder


def same(one: tuple[int, int, Any], other: tuple[int, int, Any]) -> bool:
    fields = [(vars(one[2])[name], value) for name, value in vars(other[2]).items()]
    return one[:2] == other[:2] and all(
        type(a) is type(b) and np.array_equal(a, b, equal_nan=not isinstance(a, str | bool)) for a, b in fields
    )


SAMPLES = [RigidBodyState(), a_sonar(), a_sonar(3), TaskState(time=7, state="RUNNING"), Wide()]


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: type(sample).__name__)
def test_a_header_is_the_map_that_the_codec_makes(sample: Any) -> None:
    frames = encoder(type(sample)).encode(sample, 5, 9)
    header = msgpack.unpackb(frames[0])
    expected = encode(sample, {**envelope(type(sample)), "seq": 9, "t": 5, "tp": header["tp"]})
    # Packed once more, since NaN is not equal to itself.
    assert msgpack.packb(header) == msgpack.packb(msgpack.unpackb(expected[0]))
    assert len(frames) == len(expected)
    assert all(one is other for one, other in zip(frames[1:], expected[1:], strict=True))


@pytest.mark.parametrize("sample", SAMPLES, ids=lambda sample: type(sample).__name__)
def test_what_is_known_again_is_what_is_read_plainly(sample: Any) -> None:
    cls = type(sample)
    writer = encoder(cls)
    decoder = learned(cls, writer.encode(sample, 5, 1))
    for seq, time in ((2, 6), (3, -1), (2**63 - 1, -(2**63))):
        frame, buffers = plain(writer.encode(sample, time, seq))
        found = decoder.decode(frame, buffers)
        assert found is not None
        assert found[:2] == (seq, time)
        assert same(found, read_plainly(cls, frame, buffers))


def test_arrays_that_are_known_again_are_read_only() -> None:
    writer = encoder(RigidBodyState)
    decoder = learned(RigidBodyState, writer.encode(RigidBodyState(), 0, 1))
    found = decoder.decode(*plain(writer.encode(RigidBodyState.at([1, 2, 3]), 0, 2)))
    assert found is not None
    np.testing.assert_array_equal(found[2].position, [1, 2, 3])
    assert not found[2].position.flags.writeable


@pytest.mark.parametrize("sample", [RigidBodyState(), Wide()], ids=lambda sample: type(sample).__name__)
def test_no_changed_byte_is_taken_for_something_that_a_plain_reading_would_not_find(sample: Any) -> None:
    cls = type(sample)
    writer = encoder(cls)
    decoder = learned(cls, writer.encode(sample, 5, 1))
    frame = plain(writer.encode(sample, 6, 2))[0]
    known = 0
    for place in range(len(frame)):
        for flip in (0x01, 0x80, 0xFF):
            changed = frame[:place] + bytes([frame[place] ^ flip]) + frame[place + 1 :]
            found = decoder.decode(changed, [])
            if found is not None:
                known += 1
                assert same(found, read_plainly(cls, changed, []))
    numbers, arrays = (15, 2 * 3) if cls is Wide else (1, 8 * (3 * 3 + 4 + 4 * 9))  # in the body; bytes of arrays
    assert known == 3 * (8 * (3 + numbers) + arrays)  # none but the bytes in slots may vary


@pytest.mark.parametrize(
    "other",
    [a_sonar(4), Sonar(**{**vars(a_sonar(3)), "frame": "sonar"}), Sonar(**{**vars(a_sonar(3)), "bin_count": 5})],
    ids=["shape", "text", "number"],
)
def test_another_form_is_not_known_until_it_is_learned(other: Sonar) -> None:
    writer = encoder(Sonar)
    decoder = learned(Sonar, writer.encode(a_sonar(3), 0, 1))
    frame, buffers = plain(writer.encode(other, 0, 2))
    same_form = other.bin_count == 5  # a number is what a slot is for
    assert (decoder.decode(frame, buffers) is not None) == same_form
    decoder.learn(frame, unpack(frame))
    found = decoder.decode(frame, buffers)
    assert found is not None
    assert same(found, read_plainly(Sonar, frame, buffers))


def test_buffers_of_another_size_or_number_are_not_known() -> None:
    writer = encoder(Sonar)
    frames = writer.encode(a_sonar(), 0, 1)
    decoder = learned(Sonar, frames)
    frame, buffers = plain(frames)
    assert decoder.decode(frame, buffers) is not None
    for wrong in ([], buffers[:1], [*buffers, b""], [buffers[0], buffers[1][:-4]], [buffers[0], bytes(9700)]):
        assert decoder.decode(frame, wrong) is None
        with pytest.raises(WireError):
            read_plainly(Sonar, frame, wrong)


def test_a_sender_with_headers_of_its_own_is_read_plainly_and_asked_once() -> None:
    decoder = Decoder(schema_of(RigidBodyState))
    frame = encode(RigidBodyState(), {**envelope(RigidBodyState), "seq": 1, "t": 2, "tp": 3})[0]  # numbers in one byte
    decoder.learn(frame, unpack(frame))
    assert decoder.decode(frame, []) is None
    ours = encoder(RigidBodyState).encode(RigidBodyState(), 2, 1)[0]
    decoder.learn(ours, unpack(ours))  # the same run: it is not tried again
    assert decoder.decode(ours, []) is None
    again = encoder(RigidBodyState, "r2").encode(RigidBodyState(), 2, 1)[0]
    decoder.learn(again, unpack(again))
    assert decoder.decode(again, []) is not None


@pytest.mark.parametrize(
    "change",
    [
        lambda header: header["body"].update(new=1),  # a field of a later version
        lambda header: header["body"].update(position=1),
        lambda header: header["arr"].append(["time", "<f8", [1], bytes(8)]),
        lambda header: header["arr"].append(header["arr"][0]),
        lambda header: header["body"].update(sourceFrame=2**64),
    ],
)
def test_a_header_with_other_fields_is_not_learned(change: Any) -> None:
    decoder = Decoder(schema_of(RigidBodyState))
    header = msgpack.unpackb(encoder(RigidBodyState).encode(RigidBodyState(), 2, 1)[0])
    change(header)
    frame = struct.pack("0s", b"") + encoder(RigidBodyState).encode(RigidBodyState(), 2, 1)[0]
    decoder.learn(frame, header)
    assert decoder.decode(frame, []) is None


def test_numbers_of_more_than_64_bits_travel_as_the_codec_sends_them() -> None:
    frames = encoder(RigidBodyState).encode(RigidBodyState(time=2**63), 2**63, 1)
    assert unpack(frames[0])["t"] == 2**63


def test_arrays_and_numbers_of_another_kind_are_converted() -> None:
    sample = Sonar(
        bins=np.ones((3, 4), order="F"),
        bearings=[1, 2, 3],
        bin_count=np.int32(4),
        beam_count=3,
        bin_duration=1,  # type: ignore[arg-type]
    )
    frame, buffers = plain(encoder(Sonar).encode(sample, 0, 1))
    found = read_plainly(Sonar, frame, buffers)[2]
    assert found.bins.dtype == np.float32
    assert found.bearings.dtype == np.float64
    assert found.bearings.tolist() == [1, 2, 3]
    assert (found.bin_count, found.bin_duration) == (4, 1.0)
