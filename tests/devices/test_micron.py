"""The Micron-compatible endpoint in a process of its own, on a serial line."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import serial
from conftest import PILLAR, WALL, Emulated, same_echoes

from sonar_component.devices.seanet_messages import Control, HeadCommand, HeadData, parse_alive, parse_head_data
from sonar_component.devices.seanet_protocol import MessageId, SeaNetMessage, SeaNetParser
from sonar_component.samples.sonar import SPEED_OF_SOUND

BINS, INTERVAL = 400, 26  # [-], [640 ns]: 5 m
ROUND = Control.ADC_8_BIT | Control.CONTINUOUS | Control.SCAN_RIGHT
COMMAND = HeadCommand(0x1D, ROUND, left=1, right=6399, step=160, ad_interval=INTERVAL, bin_count=BINS, more=bytes(16))


@pytest.fixture(scope="module")
def endpoint(emulate: Callable[..., Emulated], room: Path, tmp_path_factory: pytest.TempPathFactory) -> Emulated:
    line = tmp_path_factory.mktemp("line") / "tty"
    return emulate("micron", "--scene", room, "--pty", line, "--set", "overhead=0 s", "--set", "turn_time=0.1 s")


class Client:
    """A plain client of the serial line."""

    def __init__(self, name: str) -> None:
        self.line = serial.Serial(name, 115200, timeout=0.05, exclusive=True)
        self.parser = SeaNetParser(4096)
        self.waiting: list[SeaNetMessage] = []

    def say(self, kind: MessageId, payload: bytes = b"") -> None:
        self.line.write(SeaNetMessage(kind, payload).encode())

    def wait(self, kind: MessageId, patience: float = 5.0) -> SeaNetMessage:
        end = time.monotonic() + patience
        while time.monotonic() < end:
            self.waiting += self.parser.feed(self.line.read(self.line.in_waiting or 1))
            while self.waiting:
                message = self.waiting.pop(0)
                if message.message_id == kind:
                    return message
        raise AssertionError(f"no message {kind.name} within {patience} s")

    def configure(self, command: HeadCommand) -> None:
        """As Rock's driver does it: version, user data, settings, then wait until the head has them."""
        assert self.wait(MessageId.ALIVE)
        self.say(MessageId.SEND_VERSION)
        assert self.wait(MessageId.VERSION_DATA)
        self.say(MessageId.SEND_BB_USER)
        assert self.wait(MessageId.BB_USER_DATA)
        self.say(MessageId.HEAD_COMMAND, command.payload())
        while not parse_alive(self.wait(MessageId.ALIVE).payload).head & 0x80:
            pass

    def ping(self) -> HeadData:
        self.say(MessageId.SEND_DATA, bytes(4))
        return parse_head_data(self.wait(MessageId.HEAD_DATA).payload)


@pytest.fixture
def client(endpoint: Emulated) -> Iterator[Client]:
    client = Client(endpoint.places[0])
    client.say(MessageId.REBOOT)
    client.configure(COMMAND)
    yield client
    client.line.close()


def front(data: bytes) -> int:
    samples = np.frombuffer(data, np.uint8)
    return int(np.argmax(samples > samples.max() / 2))


def test_a_scan_finds_the_wall_ahead_and_the_pillar_to_the_right(client: Client) -> None:
    scan = {(data := client.ping()).bearing: data for _ in range(21)}
    bin_length = INTERVAL * 640e-9 * SPEED_OF_SOUND / 2
    assert abs(front(scan[3200].data) - WALL / bin_length) <= 1
    assert abs(front(scan[4800].data) - PILLAR / bin_length) <= 1  # 90 deg clockwise
    assert max(scan[4000 + 160].data) == 0  # between them


def test_the_echoes_are_those_of_sonar_ping(client: Client, room: Path, tmp_path: Path) -> None:
    sonar, out = tmp_path / "beam.yaml", tmp_path / "ping.npz"
    reach = BINS * INTERVAL * 640e-9 * SPEED_OF_SOUND / 2
    sonar.write_text(
        f"kind: scanning\nrange: {reach!r} m\nbin_count: {BINS}\nbeam_width: 3 deg\nbeam_height: 35 deg\n"
        "enable_attenuation: true\naccuracy: 0.02\nattenuation_properties: {frequency: 700 kHz, salinity: 35}\n"
    )
    command = ["ping", "--scene", room, "--sonar", sonar, "--bearing-deg", 0, "--out", out]
    subprocess.run([sys.executable, "-m", "sonar_component", *map(str, command)], check=True, capture_output=True)
    with np.load(out) as ping:
        expected = ping["bins"][0]
    data = client.ping()
    assert data.bearing == 3200
    assert same_echoes(np.frombuffer(data.data, np.uint8) / 255, expected, 1 / 255)


def test_a_ping_is_never_faster_than_its_samples_and_the_line(client: Client) -> None:
    model = BINS * INTERVAL * 640e-9 + (BINS + 45) * 10 / 115200
    for _ in range(5):
        began = time.monotonic()
        client.ping()
        assert time.monotonic() - began >= model


def test_the_line_is_closed_and_opened_again_and_the_settings_are_still_there(endpoint: Emulated) -> None:
    first = Client(endpoint.places[0])
    first.say(MessageId.REBOOT)
    first.configure(COMMAND)
    before = first.ping().bearing
    first.line.close()
    time.sleep(0.2)
    second = Client(endpoint.places[0])
    assert parse_alive(second.wait(MessageId.ALIVE).payload).head & 0x80
    assert second.ping().bearing == before + 160
    second.line.close()


@pytest.mark.parametrize("cut", [1, 6, 20, 80])
def test_a_client_that_dies_in_a_message_harms_nobody(endpoint: Emulated, cut: int) -> None:
    first = Client(endpoint.places[0])
    first.line.write(SeaNetMessage(MessageId.HEAD_COMMAND, COMMAND.payload()).encode()[:cut])
    first.line.close()
    time.sleep(0.1)
    second = Client(endpoint.places[0])
    second.configure(COMMAND)
    assert len(second.ping().data) == BINS
    second.line.close()


def test_a_second_client_cannot_open_the_line_of_the_first(client: Client, endpoint: Emulated) -> None:
    with pytest.raises(serial.SerialException):
        serial.Serial(endpoint.places[0], exclusive=True)
    assert client.ping()


def test_10000_malformed_messages_leave_memory_flat(endpoint: Emulated, client: Client) -> None:
    rng = np.random.default_rng(1)
    good = SeaNetMessage(MessageId.SEND_VERSION).encode()

    def flood(count: int) -> None:
        for number in range(count):
            damaged = bytearray(good)
            damaged[rng.integers(1, 7)] ^= rng.integers(1, 256)
            client.line.write((bytes(damaged), rng.bytes(16), good[: rng.integers(1, 13)])[number % 3])
        client.line.write(bytes(600))  # ends whatever the damage has begun
        client.say(MessageId.SEND_VERSION)
        assert client.wait(MessageId.VERSION_DATA)

    flood(1000)
    before = endpoint.memory()
    flood(10_000)
    assert endpoint.memory() - before < 5  # [MB]
    assert client.ping()


def test_the_line_opened_and_closed_1000_times_leaves_memory_flat(endpoint: Emulated) -> None:
    def visit(count: int) -> None:
        for _ in range(count):
            line = os.open(endpoint.places[0], os.O_RDWR | os.O_NOCTTY)
            os.write(line, b"@00")
            os.close(line)

    visit(100)
    before = endpoint.memory()
    visit(1000)
    assert endpoint.memory() - before < 5  # [MB]
    client = Client(endpoint.places[0])
    assert client.wait(MessageId.ALIVE)
    client.line.close()
