"""Registers, scan, pace and answers of the Ping360-compatible head, with a clock turned by hand."""

from __future__ import annotations

import dataclasses
import itertools
import math

import pytest
from wires import CLIENT, OTHER, SERIAL, Bench

from sonar_component.devices import ping360_messages as msg
from sonar_component.devices.link import Kind
from sonar_component.devices.ping360_head import Ping360Head, Ping360Timing
from sonar_component.devices.ping_protocol import PingFrame, PingParser, encode
from sonar_component.sonars.scanning_settings import ScanningSettings

TRANSDUCER = msg.Transducer(0, 1, 0, 11, 88, 750, 1200, 1)
AUTO = msg.AutoTransmit(1, 0, 80, 80, 750, 200, 0, 399, 1, 0)
TIMING = Ping360Timing(overhead=20e-3, motor_step=6e-3)
AT_ONCE = 1e-9  # [s], sums of floats near 100 s


@pytest.fixture
def bench() -> Bench:
    return Bench(Ping360Head(ScanningSettings(), TIMING))


def read(data: bytes) -> msg.Message:
    (frame,) = PingParser(payload_max=4096).feed(data)
    assert isinstance(frame, PingFrame)
    return msg.MESSAGES[frame.message_id].parse(frame.payload)


def replies(bench: Bench) -> list[msg.Message]:
    return [read(data) for _, _, data in bench.sent]


def angles(bench: Bench) -> list[int]:
    return [m.angle for m in replies(bench) if isinstance(m, msg.AutoDeviceData)]


def test_at_power_up_the_registers_are_the_firmwares_defaults(bench: Bench) -> None:
    (data,) = bench.say(msg.GeneralRequest(2300).frame())
    assert data == bytes.fromhex("42 52 0e 00 fc 08 02 00 01 00 00 00 20 00 50 00 e4 02 00 04 00 00 03 03")


def test_device_and_protocol_tell_themselves(bench: Bench) -> None:
    (data,) = bench.say(msg.GeneralRequest(4).frame())
    assert data == bytes.fromhex("42 52 06 00 04 00 02 00 02 01 03 03 08 00 b1 00")
    (data,) = bench.say(msg.GeneralRequest(5).frame())
    assert data == bytes.fromhex("42 52 04 00 05 00 02 00 01 00 00 00 a0 00")


def test_the_reported_firmware_is_what_was_asked_for() -> None:
    bench = Bench(Ping360Head(ScanningSettings(), firmware=(3, 2, 1)))
    (data,) = bench.say(msg.GeneralRequest(4).frame())
    assert read(data) == msg.DeviceInformation(2, 1, 3, 2, 1)


def test_one_ping_takes_its_samples_and_the_overhead_and_echoes_its_settings(bench: Bench) -> None:
    bench.say(TRANSDUCER.frame())
    began = bench.now
    bench.run(1.0)
    ((when, peer, data),) = bench.sent
    assert peer == CLIENT
    assert when - began == pytest.approx(1200 * 88 * 25e-9 + 20e-3, abs=AT_ONCE)
    reply = read(data)
    assert isinstance(reply, msg.DeviceData)
    assert dataclasses.astuple(reply)[:7] == (0, 1, 0, 11, 88, 750, 1200)
    assert (len(reply.data), reply.data[0], reply.data[-1]) == (1200, 0, 255)
    assert len(data) == 1224


def test_settings_drive_the_sonar(bench: Bench) -> None:
    c = ScanningSettings().speed_of_sound
    bench.say(TRANSDUCER.frame())
    bench.run(0.5)
    settings = bench.orders[0].settings
    assert settings.range == pytest.approx(1200 * 88 * 25e-9 * c / 2)
    assert (settings.bin_count, settings.gain) == (1200, 0.5)
    assert settings.attenuation_properties.frequency == 750e3
    for gain, expected in ((0, 0.25), (2, 1.0)):
        bench.say(dataclasses.replace(TRANSDUCER, gain_setting=gain).frame())
        bench.run(0.5)
        assert bench.orders[-1].settings.gain == expected


def test_angle_0_looks_back_and_100_more_is_90_degrees_clockwise(bench: Bench) -> None:
    for angle, degrees in ((0, 180), (100, 90), (200, 0), (300, -90)):
        bench.say(dataclasses.replace(TRANSDUCER, angle=angle).frame())
        bench.run(3.0)
        assert math.degrees(bench.orders[-1].bearing) % 360 == pytest.approx(degrees % 360)


@pytest.mark.parametrize(("from_", "to", "further"), [(0, 1, 0), (0, 10, 9), (0, 200, 199), (390, 10, 19), (5, 5, 0)])
def test_a_longer_way_takes_its_time_the_shorter_way_round(bench: Bench, from_: int, to: int, further: int) -> None:
    bench.say(dataclasses.replace(TRANSDUCER, angle=from_).frame())
    bench.run(3.0)
    bench.say(dataclasses.replace(TRANSDUCER, angle=to).frame())
    began = bench.now
    bench.run(3.0)
    ping = 1200 * 88 * 25e-9 + TIMING.overhead
    assert bench.sent[-1][0] - began == pytest.approx(ping + further * TIMING.motor_step, abs=AT_ONCE)


def test_without_transmit_the_head_turns_and_answers_without_echoes(bench: Bench) -> None:
    bench.say(dataclasses.replace(TRANSDUCER, transmit=0, angle=10).frame())
    began = bench.now
    bench.run(1.0)
    ((when, _, data),) = bench.sent
    assert when - began == pytest.approx(10 * TIMING.motor_step, abs=AT_ONCE)
    assert read(data) == msg.DeviceData(0, 1, 10, 11, 88, 750, 1200)
    assert bench.orders == []


def test_requests_that_come_while_a_ping_lasts_are_answered_in_order_and_none_is_dropped(bench: Bench) -> None:
    for angle in range(20):
        bench.say(dataclasses.replace(TRANSDUCER, angle=angle).frame(), (CLIENT, OTHER)[angle % 2])
    bench.run(2.0)
    assert [m.angle for m in replies(bench)] == list(range(20))  # type: ignore[attr-defined]
    assert [peer for _, peer, _ in bench.sent] == [CLIENT, OTHER] * 10


def test_a_scan_steps_in_order_at_its_pace_and_is_not_acknowledged(bench: Bench) -> None:
    assert bench.say(AUTO.frame()) == []
    began, period = bench.now, 200 * 80 * 25e-9 + 20e-3
    bench.run(100.5 * period)
    assert angles(bench) == list(range(100))
    times = [began, *(when for when, _, _ in bench.sent)]
    assert [b - a for a, b in itertools.pairwise(times)] == pytest.approx([period] * 100, abs=AT_ONCE)
    first = replies(bench)[0]
    assert dataclasses.astuple(first)[:-1] == (1, 0, 0, 80, 80, 750, 0, 399, 1, 0, 200)
    assert len(first.data) == 200  # type: ignore[attr-defined]


def test_delay_and_larger_steps_add_to_the_pace(bench: Bench) -> None:
    bench.say(dataclasses.replace(AUTO, delay=50, num_steps=10).frame())
    bench.run(2.0)
    (a, _, _), (b, _, _) = bench.sent[1:3]
    assert b - a == pytest.approx(200 * 80 * 25e-9 + 20e-3 + 50e-3 + 9 * 6e-3, abs=AT_ONCE)


@pytest.mark.parametrize(
    ("start", "stop", "step", "expected"),
    [
        (0, 399, 100, [0, 100, 200, 300, 0]),
        (390, 10, 10, [390, 0, 10, 0, 390, 0]),
        (0, 25, 10, [0, 10, 20, 10, 0, 10]),
        (350, 349, 8, [350, 358, 366]),
        (7, 7, 1, [7, 7, 7]),
        (7, 9, 5, [7, 7, 7]),
    ],
)
def test_sectors_turn_back_at_their_ends_and_full_turns_go_on(
    start: int, stop: int, step: int, expected: list[int]
) -> None:
    bench = Bench(Ping360Head(ScanningSettings(), Ping360Timing(0.0, 0.0)))
    if step == 100:
        for a, b in itertools.pairwise(expected):
            assert (b - a) % 400 == step
        step, expected = 10, [*range(0, 400, 10), 0]
    bench.say(dataclasses.replace(AUTO, start_angle=start, stop_angle=stop, num_steps=step).frame())
    bench.run((len(expected) + 0.5) * 200 * 80 * 25e-9)
    assert angles(bench) == expected


def test_motor_off_is_acknowledged_and_silence_follows(bench: Bench) -> None:
    bench.say(AUTO.frame())
    bench.run(0.2)
    (data,) = bench.say(msg.MotorOff().frame())
    assert read(data) == msg.Ack(2903)
    before = len(bench.sent)
    bench.run(5.0)
    assert len(bench.sent) == before


@pytest.mark.parametrize(
    ("kind", "data", "peer", "stops"),
    [
        (Kind.BREAK, b"", CLIENT, True),  # an empty datagram
        (Kind.DATA, b"U", SERIAL, True),
        (Kind.DATA, b"UUU", SERIAL, True),
        (Kind.DATA, b"U", CLIENT, False),  # on UDP it is noise
        (Kind.DATA, b"\x00\xff", CLIENT, False),
        (Kind.OPENED, b"", SERIAL, False),
        (Kind.CLOSED, b"", SERIAL, False),  # the device goes on without anybody
    ],
)
def test_a_line_break_stops_a_scan(bench: Bench, kind: Kind, data: bytes, peer: object, stops: bool) -> None:
    bench.say(AUTO.frame(), SERIAL if peer == SERIAL else CLIENT)
    bench.run(0.2)
    before = len(bench.sent)
    assert bench.say(data, peer, kind) == []  # type: ignore[arg-type]
    bench.run(0.2)
    assert (len(bench.sent) == before) is stops


def test_a_single_ping_ends_a_scan(bench: Bench) -> None:
    bench.say(AUTO.frame())
    bench.run(0.1)
    bench.say(TRANSDUCER.frame())
    before = len(bench.sent)
    bench.run(2.0)
    assert [type(m) for m in replies(bench)[before:]] == [msg.DeviceData]


def test_a_scan_goes_on_for_whoever_spoke_last(bench: Bench) -> None:
    bench.say(AUTO.frame(), CLIENT)
    bench.run(0.1)
    bench.say(msg.GeneralRequest(4).frame(), OTHER)
    before = len(bench.sent)
    bench.run(0.1)
    assert {peer for _, peer, _ in bench.sent[before:]} == {OTHER}


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(msg.Transducer) if f.name in msg.LIMITS])
def test_a_setting_out_of_range_gets_a_no_with_a_reason_and_changes_nothing(bench: Bench, field: str) -> None:
    (before,) = bench.say(msg.GeneralRequest(2300).frame())
    value = msg.LIMITS[field][1] + 1
    (data,) = bench.say(dataclasses.replace(TRANSDUCER, **{field: value}).frame())
    reply = read(data)
    assert isinstance(reply, msg.Nack)
    assert reply.nacked_id == 2601
    assert reply.text.endswith(f"got {value}".encode())
    assert bench.say(msg.GeneralRequest(2300).frame()) == [before]
    bench.run(1.0)
    assert bench.orders == []


@pytest.mark.parametrize("field", [f.name for f in dataclasses.fields(msg.AutoTransmit) if f.name in msg.LIMITS])
def test_a_scan_out_of_range_gets_a_no_and_the_old_scan_goes_on(bench: Bench, field: str) -> None:
    bench.say(AUTO.frame())
    (data,) = bench.say(dataclasses.replace(AUTO, **{field: msg.LIMITS[field][1] + 1}).frame())
    reply = read(data)
    assert isinstance(reply, msg.Nack)
    assert (reply.nacked_id, bool(reply.text)) == (2602, True)
    bench.run(0.2)
    assert angles(bench)[:5] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize(
    "frame",
    [
        encode(PingFrame(4711, b"abc")),
        encode(PingFrame(1100)),  # of the echosounder
        msg.GeneralRequest(4711).frame(),
        encode(PingFrame(6, b"\x05")),  # too short
        msg.Ack(2601).frame(),
        msg.AutoDeviceData(*([0] * 11)).frame(),
        msg.MotorOff().frame()[:-1] + b"\x01",
    ],
)
def test_what_is_unknown_or_damaged_is_met_with_silence(bench: Bench, frame: bytes) -> None:
    assert bench.say(frame) == []
    bench.run(1.0)
    assert bench.sent == []
    assert len(bench.say(msg.GeneralRequest(5).frame())) == 1


def test_a_setting_of_a_wrong_length_gets_a_no(bench: Bench) -> None:
    (data,) = bench.say(encode(PingFrame(2601, b"\x00\x01")))
    assert read(data) == msg.Nack(2601, b"payload of message 2601 must have 14 bytes, got 2")


def test_half_a_frame_of_one_client_does_not_swallow_the_frames_of_another(bench: Bench) -> None:
    bench.say(msg.GeneralRequest(5).frame()[:-3], CLIENT)
    assert len(bench.say(msg.GeneralRequest(5).frame(), OTHER)) == 1


def test_the_id_can_be_changed_and_reset_brings_everything_back(bench: Bench) -> None:
    (data,) = bench.say(msg.SetDeviceId(9).frame())
    assert (read(data), data[6]) == (msg.Ack(2000), 9)
    bench.say(AUTO.frame())
    bench.run(0.2)
    before = len(bench.sent)
    assert bench.say(msg.Reset(0).frame()) == []
    bench.run(0.5)
    assert len(bench.sent) == before
    (data,) = bench.say(msg.GeneralRequest(2300).frame())
    assert read(data) == msg.DeviceData(1, 0, 0, 32, 80, 740, 1024)
    assert data[6] == 2


def test_many_clients_with_half_frames_are_forgotten_one_by_one(bench: Bench) -> None:
    for port in range(1000):
        bench.say(b"BR\x02\x00", dataclasses.replace(CLIENT, address=("127.0.0.1", port)))
    assert len(bench.head._parsers) <= 16
