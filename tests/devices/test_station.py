"""A device at work: never early, late rather than dropped, and what it says of itself."""

from __future__ import annotations

import logging
import math
import os
import socket
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sonar_component.devices import ping360_messages as msg
from sonar_component.devices.echoes import PingOrder
from sonar_component.devices.ping360_head import Ping360Head, Ping360Timing
from sonar_component.devices.pty import PtyLink
from sonar_component.devices.station import Station
from sonar_component.devices.tcp import TcpServer
from sonar_component.devices.udp import UdpLink
from sonar_component.samples import RigidBodyState, Sonar
from sonar_component.scene import World
from sonar_component.sonars.scanning_settings import ScanningSettings

LOG = logging.getLogger("device")
ORIGIN = RigidBodyState(position=np.zeros(3), orientation=np.array([1.0, 0, 0, 0]))
PING = msg.Transducer(0, 1, 0, 11, 80, 750, 200, 1)
MODEL = 200 * 80 * 25e-9 + 20e-3


class Imager:
    """Echoes after a while, or a failure, instead of a picture: what is tested here is time."""

    def __init__(self) -> None:
        self.takes, self.fails = 0.0, False

    def ping(self, order: PingOrder, world: World, pose: RigidBodyState) -> Sonar:
        time.sleep(self.takes)
        if self.fails:
            raise ZeroDivisionError("a picture that cannot be made")
        bins = np.full((1, order.settings.bin_count), 0.5, np.float32)
        return Sonar(bins=bins, bin_count=bins.shape[1], beam_count=1)

    def release(self) -> None:
        pass


@pytest.fixture
def work() -> Iterator[tuple[Station, Imager, socket.socket]]:
    imager, link = Imager(), UdpLink("127.0.0.1:0")
    head = Ping360Head(ScanningSettings(), Ping360Timing())
    station = Station(head, [(link, head.receive)], lambda context: imager, LOG)
    station.start()
    station.echoes.look_at(World())
    station.echoes.pose = ORIGIN
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(("127.0.0.1", link.port))
        client.settimeout(5)
        yield station, imager, client
    station.stop()


def ask(client: socket.socket, request: msg.Message) -> tuple[float, bytes]:
    began = time.monotonic()
    client.send(request.frame())
    return began, client.recv(4096)


def test_a_reply_is_never_early(work: Any) -> None:
    _, _, client = work
    for _ in range(20):
        began, data = ask(client, PING)
        assert time.monotonic() - began >= MODEL
        assert data[22:-2] == bytes([128]) * 200


def test_a_picture_that_is_late_makes_replies_late_and_none_is_dropped(work: Any) -> None:
    station, imager, client = work
    imager.takes = 2 * MODEL
    for angle in range(5):
        client.send(msg.Transducer(0, 1, angle, 11, 80, 750, 200, 1).frame())
    angles = [int.from_bytes(client.recv(4096)[10:12], "little") for _ in range(5)]
    assert angles == list(range(5))
    timing = station.timing()
    assert (timing.pings, timing.late) == (5, 5)
    assert timing.lateness_p50 >= MODEL * 0.99  # the clock of the sleep may differ a little


def test_other_requests_are_answered_while_a_picture_is_made(work: Any) -> None:
    _, imager, client = work
    imager.takes = 0.5
    client.send(PING.frame())
    time.sleep(0.1)
    began, data = ask(client, msg.GeneralRequest(5))
    assert data[4:6] == b"\x05\x00"
    assert time.monotonic() - began < 0.35  # before the picture is there
    assert client.recv(4096)[4:6] == b"\xfc\x08"


def test_a_picture_that_fails_is_sent_empty_and_counted(work: Any, caplog: pytest.LogCaptureFixture) -> None:
    station, imager, client = work
    imager.fails = True
    _, data = ask(client, PING)
    assert data[22:-2] == bytes(200)
    assert station.timing().failed == 1
    assert "a picture that cannot be made" in caplog.text
    imager.fails = False
    assert ask(client, PING)[1][22:-2] == bytes([128]) * 200


def test_the_next_ping_sees_the_newest_pose(work: Any) -> None:
    station, imager, client = work
    seen: list[RigidBodyState] = []
    plain = imager.ping
    imager.ping = lambda order, world, pose: seen.append(pose) or plain(order, world, pose)  # type: ignore[func-returns-value]
    for x in range(3):
        station.echoes.pose = RigidBodyState(position=np.array([x, 0.0, 0.0]), orientation=ORIGIN.orientation)
        ask(client, PING)
    assert [pose.position[0] for pose in seen[-3:]] == [0, 1, 2]


def test_without_a_scene_replies_come_empty(tmp_path: Path) -> None:
    link = UdpLink("127.0.0.1:0")
    head = Ping360Head(ScanningSettings(), Ping360Timing())
    station = Station(head, [(link, head.receive)], lambda context: Imager(), LOG)
    station.start()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as client:
        client.connect(("127.0.0.1", link.port))
        client.settimeout(5)
        assert ask(client, PING)[1][22:-2] == bytes(200)
    station.stop()


def test_stop_ends_its_threads_and_closes_its_files(work: Any) -> None:
    before = {thread.name for thread in threading.enumerate()}
    assert {"device", "echoes"} <= before
    files = len(os.listdir("/proc/self/fd"))
    head = Ping360Head(ScanningSettings())
    station = Station(head, [(UdpLink("127.0.0.1:0"), head.receive)], lambda context: Imager(), LOG)
    station.start()
    station.stop()
    assert len([t for t in threading.enumerate() if t.name == "device"]) == 1  # the one of the fixture
    assert len(os.listdir("/proc/self/fd")) <= files + 2  # a GL driver may keep its device open


@pytest.mark.parametrize(
    ("make", "text"),
    [(UdpLink, "udp 127.0.0.1:"), (TcpServer, "tcp 127.0.0.1:"), (PtyLink, "serial line ")],
)
def test_a_wire_says_where_it_is(make: Callable[[str], Any], text: str, tmp_path: Path) -> None:
    link = make(str(tmp_path / "tty") if make is PtyLink else "localhost:0")
    assert link.describe().startswith(text)
    link.close()


def test_a_file_that_is_no_link_is_left_alone(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("mine")
    with pytest.raises(FileExistsError):
        PtyLink(file)
    assert file.read_text() == "mine"


def test_an_address_in_use_is_an_error_that_leaves_nothing_open() -> None:
    first = UdpLink("127.0.0.1:0")
    files = len(os.listdir("/proc/self/fd"))
    with pytest.raises(OSError, match="in use"):
        UdpLink(f"127.0.0.1:{first.port}")
    assert len(os.listdir("/proc/self/fd")) == files
    first.close()


def test_no_order_is_due_before_it_began() -> None:
    head = Ping360Head(ScanningSettings())
    assert head.begin(0.0) is None
    assert head.next_tick() == math.inf
