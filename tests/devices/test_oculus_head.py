"""Settings, pace and answers of the Oculus-compatible head, with a clock turned by hand."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from wires import CLIENT, OTHER, Bench

from sonar_component.devices.link import Kind, Peer
from sonar_component.devices.oculus_head import Mode, Model, OculusHead, attitude, digitised
from sonar_component.devices.oculus_messages import HEADER, Fire, Flags, PingRate, Result, parse_result
from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.sonars.settings import ForwardLookingSettings

MODEL = Model(
    Mode(1.2e6, math.radians(130), math.radians(20), 40.0), Mode(2.1e6, math.radians(60), math.radians(12), 10.0)
)
WATCHER = Peer(CLIENT.link, ("127.0.0.1", 52102))
AT_ONCE = 1e-9  # [s], sums of floats near 100 s


@pytest.fixture
def bench() -> Bench:
    bench = Bench(OculusHead(ForwardLookingSettings(bin_count=100), MODEL))
    bench.say(b"", CLIENT, Kind.OPENED)
    return bench


def kinds(bench: Bench) -> list[int]:
    return [HEADER.unpack_from(data)[3] for _, _, data in bench.sent]


def pings(bench: Bench) -> list[tuple[float, Result]]:
    return [(when, parse_result(data)) for when, _, data in bench.sent if HEADER.unpack_from(data)[3] == 0x23]


def fire(bench: Bench, wanted: Fire, seconds: float = 0.5) -> Result:
    bench.say(wanted.message())
    bench.run(seconds)
    return pings(bench)[-1][1]


@pytest.mark.parametrize(
    ("rate", "hertz"),
    [(PingRate.NORMAL, 10), (PingRate.HIGH, 15), (PingRate.HIGHEST, 40), (PingRate.LOW, 5), (PingRate.LOWEST, 2)],
)
def test_pings_come_at_the_rate_asked_for(bench: Bench, rate: int, hertz: float) -> None:
    bench.say(Fire(ping_rate=rate, range=2.0).message())
    bench.run(10.0)
    times = [when for when, _ in pings(bench)]
    assert len(times) in (10 * hertz - 1, 10 * hertz, 10 * hertz + 1)
    assert np.diff(times) == pytest.approx(1 / hertz, abs=AT_ONCE)


def test_sound_from_the_greatest_range_bounds_the_rate(bench: Bench) -> None:
    bench.say(Fire(master_mode=1, ping_rate=PingRate.HIGHEST, range=40.0).message())
    bench.run(2.0)
    times = [when for when, _ in pings(bench)]
    c = ForwardLookingSettings().speed_of_sound
    assert np.diff(times) == pytest.approx(2 * 40.0 / c + MODEL.overhead, abs=AT_ONCE)


def test_echoes_never_leave_before_sound_could_be_back(bench: Bench) -> None:
    bench.say(Fire(ping_rate=PingRate.LOWEST, range=10.0).message())
    began = bench.now
    bench.run(0.4)
    c = ForwardLookingSettings().speed_of_sound
    assert pings(bench)[0][0] - began == pytest.approx(2 * 10.0 / c + MODEL.overhead, abs=AT_ONCE)


def test_nothing_pings_before_the_first_fire_message_and_dummies_keep_the_line(bench: Bench) -> None:
    bench.run(10.0)
    assert set(kinds(bench)) == {0xFF}
    times = [when for when, _, _ in bench.sent]
    assert max(b - a for a, b in itertools.pairwise(times)) <= 1.0


def test_standby_stops_pings_and_sends_dummies(bench: Bench) -> None:
    fire(bench, Fire(ping_rate=PingRate.HIGHEST, range=2.0))
    before = len(bench.sent)
    bench.say(Fire(ping_rate=PingRate.STANDBY).message())
    bench.run(5.0)
    assert set(kinds(bench)[before:]) == {0xFF}
    assert len(bench.sent) - before >= 5
    fire(bench, Fire(range=2.0))
    assert kinds(bench)[-1] == 0x23


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(("flags", "more", "dtype"), [(0, 0, "u1"), (2, 0, "u2"), (0, 0x200, "u4")])
def test_an_answer_has_the_version_and_the_depth_of_its_question(
    bench: Bench, version: int, flags: int, more: int, dtype: str
) -> None:
    if more and version == 1:
        more, dtype = 0, "u1"
    got = fire(bench, Fire(flags=Flags.RANGE_IN_METRES | flags, more_flags=more, version=version))
    assert (got.fire.version, got.image.dtype) == (version, np.dtype(dtype))
    assert got.image.max() == np.iinfo(got.image.dtype).max  # the last bin of the ramp is full scale


@pytest.mark.parametrize(("flags", "beams"), [(0, 256), (Flags.BEAMS_512, 512)])
@pytest.mark.parametrize(("mode", "half", "frequency"), [(1, 65.0, 1.2e6), (2, 30.0, 2.1e6)])
def test_both_fans_have_bearings_of_equal_steps_in_sine(
    bench: Bench, flags: int, beams: int, mode: int, half: float, frequency: float
) -> None:
    got = fire(bench, Fire(mode, flags=Flags.RANGE_IN_METRES | flags))
    assert got.image.shape == (100, beams)
    assert got.frequency == frequency
    assert (got.bearings[0], got.bearings[-1]) == (-half, half)
    steps = np.diff(np.sin(np.radians(got.bearings)))
    # Bearings are rounded to 0.01 deg at both ends of a step, so two steps differ by up to twice that.
    assert np.ptp(steps) <= np.radians(0.0201)
    rock = np.degrees(bench.orders[-1].settings.beam_table().bearings)  # type: ignore[attr-defined]
    np.testing.assert_allclose(rock, -got.bearings, atol=0.00501)


def test_the_recorded_fan_is_met() -> None:
    """A recorded ping of 256 beams over 60 deg has steps of 0.22 deg in the middle and 0.26 deg at the edge."""
    bench = Bench(OculusHead(ForwardLookingSettings(bin_count=10), MODEL))
    bench.say(b"", CLIENT, Kind.OPENED)
    steps = np.diff(fire(bench, Fire()).bearings)
    assert steps[127] == pytest.approx(0.22, abs=0.0101)  # the device's hundredths, rounded at both ends
    assert steps[0] == pytest.approx(0.26, abs=0.0101)


def test_the_gain_of_the_high_frequency_is_told_on_the_devices_scale(bench: Bench) -> None:
    assert fire(bench, Fire(2, gain=50.0)).fire.gain == pytest.approx(70.0)
    assert fire(bench, Fire(1, gain=50.0)).fire.gain == 50.0
    assert bench.orders[-1].settings.gain == 0.5


@pytest.mark.parametrize(
    ("asked", "told"),
    [
        ({"range": 500.0}, {"range": 10.0}),
        ({"range": 0.0}, {"range": 0.3}),
        ({"range": 500.0, "flags": 0}, {"range": 100.0}),
        ({"range": -1.0, "flags": 0}, {"range": 3.0}),
        ({"gain": 900.0}, {"gain": 100.0}),
        ({"gain": -5.0}, {"gain": 40.0}),
        ({"speed_of_sound": 99.0}, {"speed_of_sound": 1300.0}),
        ({"master_mode": 77}, {"master_mode": 2}),
        ({"ping_rate": 0xA5}, {"ping_rate": 0}),
    ],
)
def test_what_is_out_of_range_is_clamped_and_told(
    bench: Bench, asked: dict[str, float], told: dict[str, float]
) -> None:
    got = fire(bench, dataclasses.replace(Fire(), **asked))
    for name, value in told.items():
        assert getattr(got.fire, name) == pytest.approx(value)


def test_range_resolution_times_ranges_is_the_range(bench: Bench) -> None:
    assert fire(bench, Fire(range=4.0)).range_resolution * 100 == pytest.approx(4.0)
    percent = fire(bench, Fire(1, range=25.0, flags=0))
    assert percent.range_resolution * 100 == pytest.approx(10.0)


def test_a_wrong_speed_of_sound_shifts_ranges_as_it_does_on_the_device(bench: Bench) -> None:
    fire(bench, Fire(range=5.0, speed_of_sound=1400.0))
    settings = bench.orders[-1].settings
    # Its 5 m are a time; in the water's own speed sound goes farther in it.
    assert settings.range == pytest.approx(5.0 * settings.speed_of_sound / 1400.0)


def test_status_comes_once_a_second_and_names_the_client() -> None:
    head = OculusHead(ForwardLookingSettings(), MODEL, WATCHER, "127.0.0.1")
    bench = Bench(head)
    bench.run(5.5)
    assert [peer for _, peer, _ in bench.sent] == [WATCHER] * 6
    assert head.status().client == "0.0.0.0"
    bench.say(b"", CLIENT, Kind.OPENED)
    assert head.status().client == "127.0.0.1"
    bench.say(b"", CLIENT, Kind.CLOSED)
    assert head.status().client == "0.0.0.0"


def test_a_client_that_leaves_takes_its_pings_with_it(bench: Bench) -> None:
    fire(bench, Fire(ping_rate=PingRate.HIGHEST, range=2.0))
    bench.say(b"", CLIENT, Kind.CLOSED)
    before = len(bench.sent)
    bench.run(2.0)
    assert len(bench.sent) == before
    bench.say(b"", OTHER, Kind.OPENED)
    bench.run(1.0)
    assert {peer for _, peer, _ in bench.sent[before:]} == {OTHER}
    assert set(kinds(bench)[before:]) == {0xFF}


def test_half_a_message_of_a_client_that_left_is_forgotten(bench: Bench) -> None:
    bench.say(Fire().message()[:20])
    bench.say(b"", CLIENT, Kind.CLOSED)
    bench.say(b"", OTHER, Kind.OPENED)
    bench.say(Fire(range=3.0).message(), OTHER)
    bench.run(0.5)
    assert pings(bench)[-1][1].fire.range == 3.0


def test_ping_numbers_and_start_times_go_on(bench: Bench) -> None:
    bench.say(Fire(ping_rate=PingRate.HIGH, version=2).message())
    bench.run(1.0)
    got = [result for _, result in pings(bench)]
    assert [r.ping_id for r in got] == list(range(1, len(got) + 1))
    assert np.diff([r.start_time for r in got]) == pytest.approx(1 / 15)


def test_gamma_brightens_what_is_dark(bench: Bench) -> None:
    plain = fire(bench, Fire(gamma=255)).image[:, 0].astype(float) / 255
    bright = fire(bench, Fire(gamma=127)).image[:, 0].astype(float) / 255
    np.testing.assert_allclose(bright, plain ** (127 / 255), atol=1.5 / 255 + 0.03)  # 8 bits, steep near 0


@given(hnp.arrays(np.float32, (5, 4), elements=st.floats(0, 1, width=32)), st.sampled_from((1, 2, 4)))
def test_rows_divided_by_the_square_root_of_their_gain_are_the_echoes(shown: np.ndarray, width: int) -> None:
    full = 256.0**width - 1
    plain, none = digitised(shown, width, with_gains=False)
    assert none is None
    image, gains = digitised(shown, width, with_gains=True)
    assert gains is not None
    linear = image / np.sqrt(gains.astype(np.float64))[:, None] / full
    # Half a step of the integers, made finer by the gain, and the 24 bits of a float32.
    np.testing.assert_allclose(linear, shown, atol=0.5 / full + 1e-6)
    np.testing.assert_allclose(plain / full, shown, atol=0.5 / full + 1e-6)
    dim = shown.max(axis=1) < 0.1
    assert (gains[dim] >= 100).all()  # a dim row uses the whole scale


@pytest.mark.parametrize(
    ("rpy", "expected"), [((0, 0, 90), (270, 0, 0)), ((0, 0, -30), (30, 0, 0)), ((0, 20, 0), (0, -20, 0)),
                          ((10, 0, 0), (0, 0, 10)), ((5, -15, 100), (260, 15, 5))],
)  # fmt: skip
def test_heading_grows_to_the_right_and_pitch_upwards(rpy: tuple[float, ...], expected: tuple[float, ...]) -> None:
    assert attitude(quaternion_from_rpy(*np.radians(rpy))) == pytest.approx(expected)
