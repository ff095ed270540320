"""Headers of one form: what stays the same from one sample of a port to the next, and where the numbers stand in it.

As long as the shapes and the texts of a sample stay, its headers differ in numbers of fixed width only. So a header is
taken apart once, into constants and slots, and each further one is a single call of `struct` for the writer, and for
the reader one that leaves nothing to check but the constants. It is the same msgpack map as `codec.encode` makes.

Packing and reading the map anew for every sample was the alternative. For a pose that takes 26 and 36 us in a loop, and
three to four times as much at a port that rests 4 ms between two samples, since by then the processor has forgotten the
way; this takes 10 and 17 us in a loop, and 60 and 85 us after a rest.
"""

from __future__ import annotations

import math
import struct
import time
from collections.abc import Sequence
from typing import Any

import msgpack
import numpy as np

from sonar_component.middleware.codec import INLINE_BYTES, contiguous, encode
from sonar_component.middleware.schema import DTYPES, Schema

KEYS = ("e", "type", "sv", "sh", "src", "run", "clk", "seq", "t", "tp", "body", "arr")
_ARRAY: Any = np.ndarray  # called as a class, which makes view and shape in one
_NUMBERS = {int: (b"\xd3", "q"), float: (b"\xcb", "d")}  # msgpack's int 64 and float 64


class Layout:
    """Constants and slots of one form of header.

    Parameters
    ----------
    header : an unpacked header with the keys in the order of `KEYS`.

    Raises
    ------
    ValueError, TypeError, struct.error
        If it has another form than those that we write.
    """

    def __init__(self, header: dict[str, Any]) -> None:
        if tuple(header) != KEYS:
            raise ValueError("header with other keys")
        self._constants: tuple[bytes, ...] = ()
        self._format, self._constant = ">", b""
        self._map(header)
        self._end()
        self._struct = struct.Struct(self._format)

    def _map(self, header: dict[str, Any]) -> None:
        self._add(_head(0x80, len(header)))
        for key in KEYS[:7]:
            self._add(msgpack.packb(key), msgpack.packb(header[key]))
        for key in KEYS[7:10]:
            self._add(msgpack.packb(key))
            self._slot(*_NUMBERS[int])
        self._add(msgpack.packb("body"), _head(0x80, len(header["body"])))
        for name, value in header["body"].items():
            self._add(msgpack.packb(name))
            if type(value) in _NUMBERS:
                self._slot(*_NUMBERS[type(value)])
            else:
                self._add(msgpack.packb(value))
        self._add(msgpack.packb("arr"), _head(0x90, len(header["arr"])))
        for entry in header["arr"]:
            self._add(_head(0x90, len(entry)), *(msgpack.packb(part) for part in entry[:3]))
            if len(entry) == 4:
                self._slot(msgpack.packb(entry[3])[: -len(entry[3]) or None], f"{len(entry[3])}s")

    def _add(self, *parts: bytes) -> None:
        self._constant += b"".join(parts)

    def _slot(self, lead: bytes, code: str) -> None:
        self._add(lead)
        self._end()
        self._format += code

    def _end(self) -> None:
        self._format += f"{len(self._constant)}s"
        self._constants, self._constant = (*self._constants, self._constant), b""

    def pack(self, values: Sequence[Any]) -> bytes:
        """The header with these numbers: seq, t, tp, those of the body, the bytes of the small arrays."""
        parts: list[Any] = [None] * (2 * len(values) + 1)
        parts[0::2] = self._constants
        parts[1::2] = values
        return self._struct.pack(*parts)

    def unpack(self, frame: Any) -> tuple[Any, ...] | None:
        """The numbers of a header of this form; None for any other."""
        if len(frame) != self._struct.size:
            return None
        parts = self._struct.unpack(frame)
        return parts[1::2] if parts[0::2] == self._constants else None


def _head(kind: int, count: int) -> bytes:
    """Begin of a map (0x80) or array (0x90): up to 15 items in one byte, then with a count of 16 bits."""
    return bytes([kind + count]) if count < 16 else bytes([{0x80: 0xDE, 0x90: 0xDC}[kind]]) + count.to_bytes(2, "big")


class Encoder:
    """Turns the samples of one port into frames: the packed header, then one buffer for each large array.

    Parameters
    ----------
    schema : of the samples.
    envelope : the header without ``seq``, ``t``, ``tp``, ``body`` and ``arr``.
    """

    def __init__(self, schema: Schema, envelope: dict[str, Any]) -> None:
        self._plan, self._envelope = schema.plan, envelope
        # Texts, and shapes of the arrays, with the layout that was made for them: one value, since the thread that
        # greets a late joiner with the last sample may come between two steps of the one that writes the next.
        self._known: tuple[list[Any], Layout | None] = ([], None)

    def encode(self, sample: Any, data_time: int, seq: int) -> list[Any]:
        """Frames of one sample with its data time [us]."""
        values = sample.__dict__
        form: list[Any] = []
        slots: list[Any] = [seq, data_time, time.time_ns() // 1000]
        small: list[bytes] = []
        frames: list[Any] = [b""]
        for name, kind, dtype, _ in self._plan:  # one loop: what runs again within a sample is fast, also after a rest
            value = values[name]
            if kind is None:
                if type(value) is not np.ndarray or value.dtype is not dtype:
                    value = contiguous(value, dtype)
                    form.append(value.dtype)
                form.append(value.shape)
                if value.nbytes <= INLINE_BYTES:
                    small.append(value.tobytes())
                else:
                    frames.append(contiguous(value, dtype))
            elif kind in _NUMBERS:
                slots.append(value)
            else:
                form.append(value)
        known, layout = self._known
        if layout is None or form != known:
            layout = self._layout_of(sample)
            self._known = form, layout
        try:
            frames[0] = layout.pack(slots + small)
        except struct.error:  # a number of more than 64 bits, or none at all
            return encode(sample, {**self._envelope, "seq": seq, "t": data_time, "tp": slots[2]})
        return frames

    def _layout_of(self, sample: Any) -> Layout:
        frame = encode(sample, {**self._envelope, "seq": 0, "t": 0, "tp": 0})[0]
        return Layout(msgpack.unpackb(frame))


class Decoder:
    """Knows again the headers that have the form of the last one that `codec.decode` found good."""

    def __init__(self, schema: Schema) -> None:
        self._schema = schema
        self._foreign = ""  # run of a sender whose headers are not laid out as ours
        self._layout: Layout | None = None

    def learn(self, frame: Any, header: dict[str, Any]) -> None:
        """Take the form of a good header."""
        if header["run"] == self._foreign:
            return
        self._layout, self._foreign = None, header["run"]
        body, arrays = header["body"], header["arr"]
        given = [(name, type(value)) for name, value in body.items()] + [(entry[0], None) for entry in arrays]
        kinds = {name: kind for name, kind, *_ in self._schema.plan}
        if len(dict(given)) < len(given) or any(kinds.get(name, "none") is not kind for name, kind in given):
            return  # a newer sender, with fields that are not ours, or one of another language
        try:
            layout = Layout(header)
        except (ValueError, TypeError, OverflowError):
            return
        if layout.unpack(frame) is not None:
            self._layout, self._foreign = layout, ""
            self._take_form(body, sorted(arrays, key=lambda entry: -len(entry)))

    def _take_form(self, body: dict[str, Any], arrays: list[Any]) -> None:
        """What the slots mean; small arrays, which stand in the header, come before large ones."""
        numbers = [name for name, value in body.items() if type(value) in _NUMBERS]
        texts = {name: value for name, value in body.items() if type(value) not in _NUMBERS}
        self._names = [*texts, *numbers, *(entry[0] for entry in arrays)]
        self._texts, self._end = tuple(texts.values()), 3 + len(numbers)
        self._dtypes = [DTYPES[entry[1]] for entry in arrays]
        self._shapes = [tuple(entry[2]) for entry in arrays]
        self._sizes = [DTYPES[entry[1]].itemsize * math.prod(entry[2]) for entry in arrays if len(entry) == 3]

    def decode(self, frame: Any, buffers: Sequence[Any]) -> tuple[int, int, Any] | None:
        """Sequence, data time [us] and sample of a message of the learned form; None for all others."""
        if self._layout is None:
            return None
        values = self._layout.unpack(frame)
        if values is None or list(map(len, buffers)) != self._sizes:
            return None
        arrays = map(_ARRAY, self._shapes, self._dtypes, (*values[self._end :], *buffers))
        fields = dict(zip(self._names, (*self._texts, *values[3 : self._end], *arrays), strict=True))
        return values[0], values[1], self._schema.cls(**fields)
