"""Settings, sector, pace and answers of the Micron-compatible head, with a clock turned by hand."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from wires import SERIAL, Bench

from sonar_component.devices.link import Kind
from sonar_component.devices.micron_head import MicronHead
from sonar_component.devices.seanet_messages import Control, HeadCommand, HeadData, parse_alive, parse_head_data
from sonar_component.devices.seanet_protocol import MessageId, SeaNetMessage, SeaNetParser
from sonar_component.sonars.scanning_settings import ScanningSettings

ROUND = Control.ADC_8_BIT | Control.CONTINUOUS | Control.SCAN_RIGHT
COMMAND = HeadCommand(0x1D, ROUND, left=1, right=6399, step=32, ad_interval=209, bin_count=300, more=bytes(range(16)))
SEND = SeaNetMessage(MessageId.SEND_DATA, bytes(4)).encode()
AT_ONCE = 1e-9  # [s], sums of floats near 100 s


@pytest.fixture
def bench() -> Bench:
    bench = Bench(MicronHead(ScanningSettings(), turn_time=4.0))
    bench.say(b"", SERIAL, Kind.OPENED)
    bench.run(0.01)
    return bench


def told(bench: Bench) -> list[SeaNetMessage]:
    return SeaNetParser(4096).feed(b"".join(data for _, _, data in bench.sent))


def signs(bench: Bench) -> list[int]:
    return [parse_alive(m.payload).head for m in told(bench) if m.message_id == MessageId.ALIVE]


def echoes(bench: Bench) -> list[HeadData]:
    return [parse_head_data(m.payload) for m in told(bench) if m.message_id == MessageId.HEAD_DATA]


def configure(bench: Bench, command: HeadCommand = COMMAND) -> None:
    bench.say(SeaNetMessage(MessageId.HEAD_COMMAND, command.payload()).encode(), SERIAL)
    bench.run(0.01)


def scan(bench: Bench, count: int) -> list[int]:
    """Bearings of the next pings."""
    before = len(echoes(bench))
    for _ in range(count):
        bench.say(SEND, SERIAL)
        bench.run(6.0)
    return [data.bearing for data in echoes(bench)[before:]]


def test_it_is_alive_once_a_second_and_says_that_it_has_no_settings(bench: Bench) -> None:
    bench.run(5.5)
    assert signs(bench) == [0x42] * 6
    times = [when for when, _, _ in bench.sent]
    assert [b - a for a, b in itertools.pairwise(times)] == pytest.approx([1.0] * 5, abs=AT_ONCE)


def test_after_settings_it_says_so_in_the_bits_that_rocks_driver_waits_for(bench: Bench) -> None:
    configure(bench)
    state = signs(bench)[-1]
    assert state & 0x80  # configured
    assert not state & 0x40  # not without parameters
    assert state & 0x02  # centred, which Rock's driver takes for ready


def test_version_and_user_data_have_the_sizes_that_drivers_expect(bench: Bench) -> None:
    (version,) = bench.say(SeaNetMessage(MessageId.SEND_VERSION).encode(), SERIAL)
    (user,) = bench.say(SeaNetMessage(MessageId.SEND_BB_USER).encode(), SERIAL)
    assert (len(version), version[10]) == (25, 1)
    assert (len(user), user[10], user[146]) == (175, 6, 0)  # the last one: a full-duplex line


def test_a_ping_tells_every_setting_back_as_it_came(bench: Bench) -> None:
    command = dataclasses.replace(
        COMMAND, left=2400, right=4000, step=16, ad_low=13, ad_span=77, gain_1=99, slope_1=120, range_scale=250, tx_1=7
    )
    configure(bench, command)
    scan(bench, 1)
    (data,) = echoes(bench)
    for name in ("control", "left", "right", "step", "ad_low", "ad_span", "ad_interval", "range_scale"):
        assert getattr(data, name) == getattr(command, name), name
    assert (data.gain, data.slope, data.tx) == (99, 120, 7)
    assert (data.head_status, len(data.data), data.data[0], data.data[-1]) == (0, 300, 0, 255)
    (whole,) = [d for _, _, d in bench.sent if d[10] == MessageId.HEAD_DATA]
    assert (len(whole), int.from_bytes(whole[13:15], "little")) == (345, 331)


def test_settings_drive_the_sonar(bench: Bench) -> None:
    configure(bench, dataclasses.replace(COMMAND, gain_1=210, tx_1=round(700e3 * 2**32 / 32e6), tx_2=0))
    scan(bench, 1)
    settings = bench.orders[-1].settings
    assert settings.range == pytest.approx(300 * 209 * 640e-9 * settings.speed_of_sound / 2)
    assert (settings.bin_count, settings.gain) == (300, 1.0)
    assert settings.attenuation_properties.frequency == pytest.approx(350e3, rel=1e-6)  # the mean of its two channels


def test_a_ping_takes_its_samples_the_motor_and_the_line(bench: Bench) -> None:
    configure(bench)
    bench.say(SEND, SERIAL)
    began = bench.now
    bench.run(0.5)
    when = next(when for when, _, data in bench.sent if data[10] == MessageId.HEAD_DATA)
    assert when - began == pytest.approx(300 * 209 * 640e-9 + 10e-3 + 345 * 10 / 115200, abs=AT_ONCE)


def test_ahead_is_3200_and_a_larger_number_is_farther_to_the_right(bench: Bench) -> None:
    configure(bench, dataclasses.replace(COMMAND, step=160))
    assert scan(bench, 4) == [3200, 3360, 3520, 3680]
    bearings = [math.degrees(order.bearing) for order in bench.orders]
    assert bearings == pytest.approx([0, -9, -18, -27])


def test_hung_upside_down_right_and_left_change_places(bench: Bench) -> None:
    configure(bench, dataclasses.replace(COMMAND, control=ROUND | Control.INVERTED, step=160))
    scan(bench, 2)
    assert math.degrees(bench.orders[-1].bearing) == pytest.approx(9)


@pytest.mark.parametrize(
    ("control", "changes", "expected"),
    [
        (ROUND, {"step": 255}, [(3200 + 255 * i) % 6400 for i in range(30)]),  # on and on, through 0
        (ROUND & ~Control.SCAN_RIGHT, {"step": 255}, [(3200 - 255 * i) % 6400 for i in range(30)]),
        (Control.SCAN_RIGHT, {"left": 3100, "right": 3300, "step": 100}, [3200, 3300, 3200, 3100, 3200]),
        (Control.SCAN_RIGHT, {"left": 6300, "right": 100, "step": 100}, [6300, 0, 100, 0, 6300, 0]),
        (Control(0), {"left": 100, "right": 300, "step": 100}, [300, 200, 100, 200]),
        (ROUND | Control.MOTOR_OFF, {}, [3200, 3200, 3200]),
        (Control.SCAN_RIGHT, {"left": 3200, "right": 3210, "step": 32}, [3200, 3200]),
    ],
)  # fmt: skip
def test_the_head_steps_over_its_sector(
    bench: Bench, control: Control, changes: dict[str, int], expected: list[int]
) -> None:
    configure(bench, dataclasses.replace(COMMAND, control=int(control), **changes))
    assert scan(bench, len(expected)) == expected


def test_the_way_to_a_sector_takes_the_motors_time(bench: Bench) -> None:
    control = Control.ADC_8_BIT | Control.SCAN_RIGHT
    configure(bench, dataclasses.replace(COMMAND, control=int(control), left=0, right=800))
    bench.say(SEND, SERIAL)
    began = bench.now
    bench.run(6.0)
    when = next(when for when, _, data in bench.sent if data[10] == MessageId.HEAD_DATA)
    ping = 300 * 209 * 640e-9 + 10e-3 + 345 * 10 / 115200
    assert when - began == pytest.approx(2.0 + ping, abs=AT_ONCE)  # half a turn of 4 s


def test_samples_of_4_bits_show_the_window_the_first_in_the_high_half(bench: Bench) -> None:
    command = dataclasses.replace(COMMAND, control=int(Control.CONTINUOUS), ad_low=51, ad_span=102, bin_count=301)
    configure(bench, command)
    scan(bench, 1)
    (data,) = echoes(bench)
    assert len(data.data) == 151
    halves = np.array([half for byte in data.data for half in (byte >> 4, byte & 15)])
    full = np.rint(np.linspace(0, 1, 301, dtype=np.float32) * 255)
    np.testing.assert_array_equal(halves[:301], np.clip(np.rint((full - 51) * 15 / 102), 0, 15))
    assert halves[301] == 0


@pytest.mark.parametrize(
    "changes",
    [
        {"ad_interval": 0},
        {"ad_interval": 65535},
        {"step": 0},
        {"left": 6400},
        {"right": 60000},
        {"bin_count": 1, "ad_interval": 1},
    ],
)
def test_settings_that_no_ping_can_be_made_with_are_not_taken(bench: Bench, changes: dict[str, int]) -> None:
    configure(bench, dataclasses.replace(COMMAND, **changes))
    bench.say(SEND, SERIAL)
    bench.run(2.5)
    assert echoes(bench) == []
    assert set(signs(bench)) == {0x42}


def test_more_bins_than_the_device_has_are_clamped(bench: Bench) -> None:
    configure(bench, dataclasses.replace(COMMAND, bin_count=60000, ad_interval=20))
    scan(bench, 1)
    assert len(echoes(bench)[0].data) == 1500


def test_a_command_of_a_wrong_length_changes_nothing(bench: Bench) -> None:
    bench.say(SeaNetMessage(MessageId.HEAD_COMMAND, COMMAND.payload()[:-1]).encode(), SERIAL)
    bench.run(1.5)
    assert set(signs(bench)) == {0x42}


def test_reboot_forgets_the_settings(bench: Bench) -> None:
    configure(bench)
    bench.say(SeaNetMessage(MessageId.REBOOT).encode(), SERIAL)
    bench.say(SEND, SERIAL)
    bench.run(1.5)
    assert echoes(bench) == []
    assert signs(bench)[-1] == 0x42


def test_requests_ahead_are_answered_one_by_one_in_order(bench: Bench) -> None:
    configure(bench)
    bench.say(SEND * 5, SERIAL)
    bench.run(2.0)
    assert [data.bearing for data in echoes(bench)] == [3200 + 32 * i for i in range(5)]


def test_unknown_messages_are_met_with_silence(bench: Bench) -> None:
    before = len(bench.sent)
    assert bench.say(SeaNetMessage(99, b"x").encode() + b"@0000garbage", SERIAL) == []
    bench.run(0.5)
    assert len(bench.sent) == before


def test_nobody_is_told_anything_once_the_line_is_closed(bench: Bench) -> None:
    bench.say(b"", SERIAL, Kind.CLOSED)
    before = len(bench.sent)
    bench.run(3.0)
    assert len(bench.sent) == before
    bench.say(b"", SERIAL, Kind.OPENED)
    bench.run(0.1)
    assert len(bench.sent) == before + 1
