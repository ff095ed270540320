"""The Oculus-compatible endpoint in a process of its own: raw sockets, an independent parser, misbehaving clients."""

from __future__ import annotations

import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import PILLAR, WALL, Emulated, same_echoes

from sonar_component.devices.oculus_messages import HEADER, Fire, Flags, PingRate, Result, header, parse_result
from sonar_component.samples.sonar import SPEED_OF_SOUND

NOT_THERE = 'needs the interop extra, 350 MB: pip install "sonar-component[interop]"'
BINS = 200
FAST = Fire(ping_rate=PingRate.HIGHEST, range=5.0)


@pytest.fixture(scope="module")
def watcher() -> Iterator[socket.socket]:
    """Who is told the status."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(5)
        yield sock


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("log") / "room.oculus"


@pytest.fixture(scope="module")
def endpoint(emulate: Callable[..., Emulated], room: Path, watcher: socket.socket, log: Path) -> Emulated:
    told = "{}:{}".format(*watcher.getsockname())
    places = ("--tcp", "127.0.0.1:0", "--status-to", told, "--log", log)
    # Nodding 12 deg to the right leaves the wall ahead and brings the pillar into the wide fan.
    return emulate("oculus", "--scene", room, *places, "--rpy-deg", 0, 0, -40, "--set", f"bin_count={BINS}")


class Client:
    """A plain client: fires, and reads whole messages."""

    def __init__(self, endpoint: Emulated) -> None:
        deadline = time.monotonic() + 5
        while True:  # the place of the client before may be free a moment later
            self.sock = socket.create_connection(endpoint.address(), timeout=5)
            self.file = self.sock.makefile("rb")
            try:
                if self.file.peek(1):
                    return
            except ConnectionResetError:
                pass
            self.close()
            assert time.monotonic() < deadline, "the endpoint turned every client away"
            time.sleep(0.02)

    def message(self) -> bytes:
        head = self.file.read(HEADER.size)
        assert len(head) == HEADER.size, "the endpoint hung up"
        mark, _, _, _, _, size, _ = HEADER.unpack(head)
        assert mark == 0x4F53
        return bytes(head + self.file.read(size))

    def ping(self, fire: Fire, passed_over: int = 1) -> bytes:
        """The first ping with these settings after a few that may have older ones."""
        self.sock.sendall(fire.message())
        while True:
            message = self.message()
            if HEADER.unpack_from(message)[3] != 0x23:
                continue
            told = parse_result(message)
            if told.fire.flags == fire.flags and told.fire.master_mode == fire.master_mode:
                passed_over -= 1
                if passed_over < 0:
                    return message

    def close(self) -> None:
        self.file.close()
        self.sock.close()


@pytest.fixture
def client(endpoint: Emulated) -> Iterator[Client]:
    client = Client(endpoint)
    yield client
    client.close()


def linear(result: Result) -> np.ndarray:
    gains = np.ones(len(result.image)) if result.gains is None else result.gains.astype(np.float64)
    return result.image / np.sqrt(gains)[:, None] / np.iinfo(result.image.dtype).max


def beam_at(result: Result, degrees: float) -> int:
    return int(np.abs(result.bearings - degrees).argmin())


def front(column: np.ndarray) -> int:
    return int(np.argmax(column > column.max() / 2))


def test_the_status_tells_where_to_connect_once_a_second(endpoint: Emulated, watcher: socket.socket) -> None:
    first = watcher.recv(4096)
    began = time.monotonic()
    second = watcher.recv(4096)
    assert len(first) == len(second) == 142
    assert time.monotonic() - began < 3  # a second, on a busy machine; clients give up after 5
    assert first[2:4] == second[2:4]
    assert int.from_bytes(first[24:28], "little") & 0b111 == 3


@pytest.mark.parametrize("mode", [1, 2])
@pytest.mark.parametrize("depth", [0, Flags.DATA_16_BIT])
def test_a_wall_stands_at_its_range_and_on_its_side(client: Client, mode: int, depth: int) -> None:
    flags = Flags.RANGE_IN_METRES | Flags.SEND_GAIN | Flags.SIMPLE_RETURN | depth
    got = parse_result(client.ping(Fire(mode, PingRate.HIGH, range=8.0, flags=flags, version=2)))
    image, bin_length = linear(got), got.range_resolution
    # The sonar looks 40 deg to the right, so what is ahead in the room stands 40 deg to the left of it.
    left = beam_at(got, -28.0)  # 12 deg to the right of the wall's normal, if the fan reaches that far
    expected = WALL / np.cos(np.radians(got.bearings[left] + 40)) / bin_length
    assert abs(front(image[:, left]) - int(expected)) <= 1
    if mode == 1:
        pillar = beam_at(got, 50.0)  # 90 deg to the right of what is ahead in the room
        assert abs(front(image[:, pillar]) - PILLAR / bin_length) <= 1
        assert image[:, beam_at(got, 20.0)].max() == 0  # between the two


def test_the_echoes_are_those_of_sonar_ping(client: Client, room: Path, tmp_path: Path) -> None:
    got = parse_result(client.ping(Fire(2, PingRate.HIGH, flags=Flags.RANGE_IN_METRES | Flags.DATA_16_BIT, range=8.0)))
    sines = np.linspace(0.5, -0.5, 256)
    bearings = ", ".join(f"{angle!r}" for angle in np.arcsin(sines).tolist())
    sonar, out = tmp_path / "fan.yaml", tmp_path / "ping.npz"
    sonar.write_text(
        f"range: 8 m\nbin_count: {BINS}\nbeam_height: 12 deg\nbearings: [{bearings}]\nbeam_count: 256\n"
        "beam_width: 60 deg\naccuracy: 0.02\n"
        "enable_attenuation: true\nattenuation_properties: {frequency: 1 MHz, salinity: 35}\n"
    )
    command = ["ping", "--scene", room, "--sonar", sonar, "--rpy-deg", 0, 0, -40, "--out", out]
    subprocess.run([sys.executable, "-m", "sonar_component", *map(str, command)], check=True, capture_output=True)
    with np.load(out) as ping:
        expected = ping["bins"]
    assert same_echoes(linear(got).T, expected, 1 / 65535)


def test_pings_come_at_the_rate_asked_for(client: Client) -> None:
    client.ping(FAST)
    times = []
    while len(times) < 40:
        if HEADER.unpack_from(client.message())[3] == 0x23:
            times.append(time.monotonic())
    rate = (len(times) - 1) / (times[-1] - times[0])
    assert rate <= 40 * 1.02  # never faster than asked for, but the first of them may have been late
    assert rate > 20  # on a machine that does other things too


def test_standby_sends_dummies_only(client: Client) -> None:
    client.ping(FAST)
    client.sock.sendall(Fire(ping_rate=PingRate.STANDBY).message())
    while HEADER.unpack_from(client.message())[3] == 0x23:
        pass
    assert [HEADER.unpack_from(client.message())[3] for _ in range(2)] == [0xFF, 0xFF]


def test_a_second_client_is_turned_away_and_the_first_goes_on(endpoint: Emulated, client: Client) -> None:
    client.ping(FAST)
    with socket.create_connection(endpoint.address(), timeout=5) as second:
        assert second.recv(10) == b""
    assert client.ping(FAST)


def test_a_client_that_dies_in_a_message_makes_room_for_the_next(endpoint: Emulated) -> None:
    for cut in (5, 16, 30):
        first = Client(endpoint)
        first.sock.sendall(Fire().message()[:cut])
        first.close()
        second = Client(endpoint)
        assert second.ping(FAST)
        second.close()


def test_unknown_messages_and_garbage_are_passed_over(client: Client) -> None:
    client.sock.sendall(header(0x77, 5) + b"12345" + b"garbage" + header(0x55, 12) + bytes(12))
    assert client.ping(FAST)


def test_a_fire_message_in_single_bytes_and_two_in_one_piece_are_read(client: Client) -> None:
    for byte in Fire(range=3.0).message():
        client.sock.sendall(bytes([byte]))
    client.sock.sendall(Fire(range=3.0).message() + Fire(1, range=6.0).message())
    while True:
        message = client.message()
        if HEADER.unpack_from(message)[3] == 0x23 and parse_result(message).fire.range == 6.0:
            break


def test_a_client_that_does_not_read_gets_whole_messages_or_none(endpoint: Emulated) -> None:
    lazy = Client(endpoint)
    big = Fire(ping_rate=PingRate.HIGHEST, range=5.0, flags=Flags.RANGE_IN_METRES | Flags.BEAMS_512 | Flags.DATA_16_BIT)
    lazy.sock.sendall(big.message())
    time.sleep(2.5)  # 80 pings of 0.2 MB: more than the sockets hold
    ids = []
    for _ in range(40):
        message = lazy.message()  # asserts that each begins where the one before ended
        if HEADER.unpack_from(message)[3] == 0x23:
            ids.append(parse_result(message).ping_id)
    assert ids == sorted(set(ids))
    lazy.close()


def test_1000_clients_one_after_another_leave_memory_flat(endpoint: Emulated) -> None:
    def visit(count: int) -> None:
        for number in range(count):
            with socket.create_connection(endpoint.address(), timeout=5) as sock:
                if number % 2:
                    sock.sendall(Fire().message()[: number % 60])

    visit(100)
    before = endpoint.memory()
    visit(1000)
    client = Client(endpoint)
    assert client.ping(FAST)
    client.close()
    assert endpoint.memory() - before < 10  # [MB]; a leaked connection costs 5 kB and more


def test_10000_malformed_messages_leave_memory_flat_and_the_endpoint_serving(
    endpoint: Emulated, client: Client
) -> None:
    rng = np.random.default_rng(1)
    client.ping(FAST)

    def flood(count: int) -> None:
        for number in range(count):
            damaged = bytearray(FAST.message())
            damaged[rng.integers(0, 8)] ^= rng.integers(1, 256)
            client.sock.sendall((bytes(damaged), rng.bytes(64), header(0x77, 4))[number % 3])
        client.sock.sendall(bytes(8192))  # ends whatever the damage has begun
        assert client.ping(FAST, 5)

    flood(1000)
    before = endpoint.memory()
    flood(10_000)
    assert endpoint.memory() - before < 10  # [MB]


@pytest.mark.parametrize("beams", [256, 512])
def test_an_independent_parser_reads_our_pings(client: Client, beams: int) -> None:
    # Of version 2 only: its class for version 1 cannot be made. That one is compared with the known structure instead.
    core = pytest.importorskip("bps_oculus.core", reason=NOT_THERE)
    flags = Flags.RANGE_IN_METRES | Flags.SEND_GAIN | Flags.SIMPLE_RETURN
    flags |= Flags.BEAMS_512 if beams == 512 else 0
    message = client.ping(Fire(1, PingRate.HIGH, range=8.0, flags=flags, version=2))
    theirs, image, _ = core.unpack_data_entry(message)
    ours = parse_result(message)
    assert (theirs.nRanges, theirs.nBeams) == image.polar_image.shape == (BINS, beams)
    np.testing.assert_array_equal(image.polar_image, ours.image)
    np.testing.assert_array_equal(image.gain_table, ours.gains)
    np.testing.assert_allclose(image.bearing_table, np.radians(ours.bearings))
    assert image.ranging_table[-1] == pytest.approx(8.0)
    assert theirs.speedOfSoundUsed == SPEED_OF_SOUND


def test_an_independent_reader_reads_our_log(endpoint: Emulated, client: Client, log: Path) -> None:
    io = pytest.importorskip("bps_oculus.io", reason=NOT_THERE)
    client.ping(Fire(flags=Flags.RANGE_IN_METRES | Flags.SEND_GAIN))
    entries = read_log(io, log)
    assert len(entries) > 2
    assert b"".join(entries)[:2] == b"\x53\x4f"
    assert parse_result(entries[-1]).image.shape == (BINS, 256)


def read_log(io: Any, log: Path) -> list[bytes]:
    from bps_oculus.logger import LoggerVersion, check_oculus_log_version, v1

    assert check_oculus_log_version(log) == LoggerVersion.BPSv1
    data, place, found = log.read_bytes(), v1.RmLogHeader.size(), []
    while place + v1.RmLogItem.size() <= len(data):
        item = v1.RmLogItem.unpack(data[place : place + v1.RmLogItem.size()])
        place += v1.RmLogItem.size()
        assert (item.itemHeader, item.type) == (v1.s_itemHeader, v1.eRecordTypes.rt_oculusSonar)
        if place + item.payloadSize <= len(data):  # the last one may be on its way
            found.append(data[place : place + item.payloadSize])
        place += item.payloadSize
    return found
