"""The Ping360-compatible endpoint in a process of its own, with the maker's client, raw sockets and a serial line."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import serial
from brping import Ping360
from brping import definitions as theirs
from conftest import PILLAR, WALL, Emulated, same_echoes

from sonar_component.devices import ping360_messages as msg
from sonar_component.devices.ping_protocol import PingFrame, PingParser, encode
from sonar_component.samples.sonar import SPEED_OF_SOUND

AHEAD, RIGHT, PERIOD, SAMPLES = 200, 300, 260, 1000  # [gradians], [gradians], [25 ns], [-]: 4.9 m
AUTO = msg.AutoTransmit(1, 1, 32, 80, 740, 200, 0, 399, 1, 0)
JITTER = 2e-3  # [s], of a client's own clock and of waking up on a busy machine


@pytest.fixture(scope="module")
def endpoint(emulate: Callable[..., Emulated], room: Path, tmp_path_factory: pytest.TempPathFactory) -> Emulated:
    line = tmp_path_factory.mktemp("line") / "tty"
    free = ("--udp", "127.0.0.1:0", "--discovery", "127.0.0.1:0", "--pty", line)
    return emulate("ping360", "--scene", room, *free, "--set", "overhead=2 ms", "--set", "motor_step_time=0.1 ms")


@pytest.fixture
def client(endpoint: Emulated) -> Iterator[Any]:
    """The maker's client, in the same state for each test."""
    device = Ping360()
    device.connect_udp(*endpoint.address())
    device.control_motor_off()
    device.control_reset(0, 0)
    assert device.initialize()
    device.set_gain_setting(1)
    device.set_number_of_samples(SAMPLES)
    device.set_sample_period(PERIOD)
    yield device
    device.control_motor_off()
    device.iodev.close()


@pytest.fixture
def raw(endpoint: Emulated) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.connect(endpoint.address())
        sock.settimeout(3)
        yield sock
        sock.send(msg.MotorOff().frame())


def echoes(reply: Any) -> np.ndarray:
    return np.frombuffer(bytes(reply.data), np.uint8)


def front(data: np.ndarray) -> int:
    """First sample of the first surface."""
    return int(np.argmax(data > data.max() / 2))


def heard(sock: socket.socket, seconds: float) -> list[bytes]:
    end, found = time.monotonic() + seconds, []
    while (left := end - time.monotonic()) > 0:
        sock.settimeout(left)
        try:
            found.append(sock.recv(4096))
        except TimeoutError:
            break
    return found


def test_the_makers_client_finds_its_device(client: Any) -> None:
    information = client.get_device_information()
    assert (information["device_type"], client._src_device_id) == (2, 2)
    assert client.get_protocol_version()["version_major"] == 1


def test_what_the_client_sets_is_told_back(client: Any) -> None:
    assert client.set_number_of_samples(1200).number_of_samples == 1200
    assert client.set_sample_period(88).sample_period == 88
    assert client.set_transmit_frequency(750).transmit_frequency == 750
    assert client.set_transmit_duration(11).transmit_duration == 11
    assert client.set_gain_setting(2).gain_setting == 2
    for angle in range(20):
        reply = client.transmitAngle(angle)
        assert (reply.angle, len(reply.data), reply.sample_period) == (angle, 1200, 88)


def test_an_angle_of_450_gets_a_no_and_the_state_stays(client: Any) -> None:
    client.set_angle(7)
    reply = client.transmitAngle(450)
    assert (reply.message_id, reply.nacked_id) == (theirs.COMMON_NACK, 2601)
    assert b"Angle" in reply.nack_message
    assert client.get_device_data()["angle"] == 7


def test_a_wall_stands_at_its_range_and_doubling_the_period_halves_its_sample(client: Any) -> None:
    expected = WALL / (PERIOD * 25e-9 * SPEED_OF_SOUND / 2)
    assert abs(front(echoes(client.transmitAngle(AHEAD))) - expected) <= 1
    client.set_sample_period(2 * PERIOD)
    assert abs(front(echoes(client.transmitAngle(AHEAD))) - expected / 2) <= 1


def test_100_gradians_more_is_90_degrees_clockwise(client: Any) -> None:
    expected = PILLAR / (PERIOD * 25e-9 * SPEED_OF_SOUND / 2)
    assert abs(front(echoes(client.transmitAngle(AHEAD + 100))) - expected) <= 1
    assert echoes(client.transmitAngle(AHEAD - 100)).max() == 0  # nothing stands to the left
    assert echoes(client.transmitAngle(0)).max() == 0


def test_more_gain_is_a_brighter_image(client: Any) -> None:
    means = []
    for gain in (0, 1, 2):
        client.set_gain_setting(gain)
        means.append(echoes(client.transmitAngle(RIGHT)).mean())
    assert means[0] < means[1] < means[2]


def test_the_echoes_are_those_of_sonar_ping(client: Any, room: Path, tmp_path: Path) -> None:
    sonar, out = tmp_path / "beam.yaml", tmp_path / "ping.npz"
    reach = SAMPLES * PERIOD * 25e-9 * SPEED_OF_SOUND / 2
    sonar.write_text(
        f"kind: scanning\nrange: {reach!r} m\nbin_count: {SAMPLES}\nbeam_width: 2 deg\nbeam_height: 25 deg\n"
        "enable_attenuation: true\naccuracy: 0.02\nattenuation_properties: {frequency: 740 kHz, salinity: 35}\n"
    )
    command = ["ping", "--scene", room, "--sonar", sonar, "--bearing-deg", -90, "--out", out]
    subprocess.run([sys.executable, "-m", "sonar_component", *map(str, command)], check=True, capture_output=True)
    with np.load(out) as ping:
        expected = ping["bins"][0]
    assert same_echoes(echoes(client.transmitAngle(RIGHT)) / 255, expected, 1 / 255)


def test_a_scan_comes_in_order_and_never_faster_than_the_model(raw: socket.socket) -> None:
    raw.send(AUTO.frame())
    began, times, angles = time.monotonic(), [], []
    while len(times) < 100:
        data = raw.recv(4096)
        times.append(time.monotonic())
        angles.append(int.from_bytes(data[10:12], "little"))
        assert int.from_bytes(data[4:6], "little") == 2301
    assert angles == list(range(100))
    period = 200 * 80 * 25e-9 + 2e-3
    first = 200 * 0.1e-3  # [s], at most: the way to the start of the scan
    passed = np.array(times) - began
    assert (passed >= (np.arange(100) + 1) * period).all()
    assert passed[-1] < 100 * period + first + 2.0  # late, but not by more than a busy machine explains


def test_motor_off_ends_a_scan_with_an_ack_and_silence(client: Any) -> None:
    client.control_auto_transmit(1, 0, 80, 80, 750, 200, 0, 399, 1, 0)
    assert client.wait_message([theirs.PING360_AUTO_DEVICE_DATA], 4.0) is not None
    client.control_motor_off()
    ack = client.wait_message([theirs.COMMON_ACK], 4.0)
    assert ack.acked_id == 2903
    assert client.wait_message([theirs.PING360_AUTO_DEVICE_DATA], 1.0) is None


def test_an_empty_datagram_stops_a_scan(raw: socket.socket) -> None:
    raw.send(AUTO.frame())
    assert raw.recv(4096)
    raw.send(b"")
    heard(raw, 0.2)
    assert heard(raw, 0.3) == []


REQUEST = msg.GeneralRequest(5).frame()
ANSWER = bytes.fromhex("42 52 04 00 05 00 02 00 01 00 00 00 a0 00")


@pytest.mark.parametrize(
    ("datagrams", "answers"),
    [
        ([REQUEST[:-1] + b"\xff", REQUEST], 1),  # a bad checksum is dropped silently
        ([b"BR\xff\xff", REQUEST], 1),  # a length beyond the buffer
        ([REQUEST[:-3], REQUEST], 0),  # a truncated frame swallows the next
        ([REQUEST[:-3], REQUEST, REQUEST], 1),  # and no further one
        ([REQUEST[:3], REQUEST[3:7], REQUEST[7:]], 1),  # one frame in three datagrams
        ([REQUEST + REQUEST], 2),  # two frames in one
        ([b"\x00\xff", REQUEST], 1),  # what a test program of the maker's sends first
        ([encode(PingFrame(4711, b"x")), msg.GeneralRequest(4711).frame()], 0),  # unknown: silence
        ([b"garbage" + REQUEST], 1),
    ],
)
def test_damage_is_met_as_the_device_meets_it(raw: socket.socket, datagrams: list[bytes], answers: int) -> None:
    for datagram in datagrams:
        raw.send(datagram)
    assert b"".join(heard(raw, 0.25)) == ANSWER * answers


def test_discovery_is_answered_in_the_form_that_the_viewer_takes_apart(endpoint: Emulated) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.settimeout(3)
        sock.sendto(b"nonsense", endpoint.address(2))
        sock.sendto(b"SetSS1IP 192.168.2.9", endpoint.address(2))
        sock.sendto(b"Discovery", endpoint.address(2))
        parts = sock.recv(4096).decode().split("\r\n")
    assert len(parts) == 5
    assert "PING360" in parts[0]
    mac, ip = parts[2].split(":- ")[1], parts[3].split(":- ")[1]
    assert ip == "127.000.000.001"
    assert int(mac[:2], 16) & 0b11 == 0b10  # locally administered, of one device
    assert parts[4] == ""


def test_two_clients_are_both_answered(endpoint: Emulated, client: Any) -> None:
    second = Ping360()
    second.connect_udp(*endpoint.address())
    assert second.initialize()
    assert client.initialize()
    second.iodev.close()


def read_for(line: serial.Serial, seconds: float) -> list[PingFrame]:
    parser, end, found = PingParser(4096), time.monotonic() + seconds, []
    while time.monotonic() < end:
        found += [event for event in parser.feed(line.read(line.in_waiting or 1)) if isinstance(event, PingFrame)]
    return found


def test_a_serial_line_serves_is_closed_and_serves_again(endpoint: Emulated) -> None:
    name = endpoint.places[1]
    for _ in range(2):
        device = Ping360()
        device.connect_serial(name)
        assert device.initialize()
        device.set_number_of_samples(SAMPLES)
        device.set_sample_period(PERIOD)
        assert len(device.transmitAngle(AHEAD).data) == SAMPLES
        device.iodev.close()


def test_a_scan_on_a_line_that_nobody_reads_goes_on_and_what_was_said_to_nobody_is_lost(endpoint: Emulated) -> None:
    name = endpoint.places[1]
    with serial.Serial(name, timeout=0.05) as line:
        line.write(AUTO.frame())
        assert len(read_for(line, 0.5)) > 5
    time.sleep(0.5)
    with serial.Serial(name, timeout=0.05) as line:
        angles = [int.from_bytes(f.payload[2:4], "little") for f in read_for(line, 0.3)]
        assert len(angles) > 5
        steps = np.diff(angles) % 400
        assert (steps == 1).all()  # no old ones in front
        line.write(b"U")
        read_for(line, 0.1)
        assert read_for(line, 0.3) == []


def test_a_client_of_the_line_that_dies_in_a_message_harms_nobody(endpoint: Emulated) -> None:
    name = endpoint.places[1]
    with serial.Serial(name, timeout=0.05) as line:
        line.write(REQUEST[:7])
    time.sleep(0.1)
    with serial.Serial(name, timeout=0.05) as line:
        line.write(b"U" + REQUEST)
        assert [f.message_id for f in read_for(line, 0.3)] == [5]


def test_10000_malformed_messages_leave_memory_flat_and_the_endpoint_serving(
    endpoint: Emulated, client: Any, raw: socket.socket
) -> None:
    rng = np.random.default_rng(1)
    good = msg.Transducer(0, 1, 0, 11, 88, 750, 1200, 1).frame()

    def flood(count: int) -> None:
        for number in range(count):
            damaged = bytearray(good)
            damaged[rng.integers(2, len(good))] ^= rng.integers(1, 256)
            raw.send((bytes(damaged), rng.bytes(64), good[: rng.integers(1, 24)])[number % 3])
            if number % 100 == 0:
                time.sleep(0.001)  # so that the kernel does not drop them unseen

    flood(1000)
    before = endpoint.memory()
    flood(10_000)
    assert client.initialize()
    assert endpoint.memory() - before < 5  # [MB]; one copy of each message alone would be 0.5
    assert client.transmitAngle(AHEAD).angle == AHEAD


def test_1000_clients_one_after_another_leave_memory_flat(endpoint: Emulated) -> None:
    def visit(count: int) -> None:
        for _ in range(count):
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
                sock.connect(endpoint.address())
                sock.settimeout(3)
                sock.send(REQUEST)
                assert sock.recv(100) == ANSWER

    visit(100)
    before = endpoint.memory()
    visit(1000)
    assert endpoint.memory() - before < 5  # [MB]


def test_the_name_of_the_line_goes_with_the_endpoint(
    emulate: Callable[..., Emulated], room: Path, tmp_path: Path
) -> None:
    name = tmp_path / "tty"
    name.symlink_to("/nowhere")  # left behind by one that was killed
    endpoint = emulate("ping360", "--scene", room, "--pty", name)
    assert os.path.exists(name)
    timing = endpoint.end()
    assert endpoint.process.returncode == 0
    assert timing["pings"] == 0
    assert not os.path.lexists(name)
