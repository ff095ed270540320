"""The viewer over real sockets: HTTP and WebSocket on loopback, samples handed over as ports do."""

from __future__ import annotations

import contextlib
import dataclasses
import http.client
import io
import json
import logging
import math
import socket
import time

import numpy as np
import pytest
from PIL import Image
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

from sonar_component.middleware import OutputPort, Policy
from sonar_component.middleware.lifecycle import State
from sonar_component.middleware.ports import connect_in_process
from sonar_component.samples import Frame, Sonar
from sonar_component.tasks.viewer import PORT_IN_USE, ViewerTask

PATIENCE = 10.0  # [s], for a message over loopback on a busy machine


def image(number=1, beams=8, bins=16, value=None):
    values = np.random.default_rng(number).random((beams, bins), np.float32) if value is None else value
    return Sonar(
        time=time.time_ns() // 1000,
        bin_duration=0.1 / 1500,
        beam_width=math.radians(120),
        beam_height=math.radians(20),
        bearings=np.radians(np.linspace(52.5, -52.5, beams)),
        speed_of_sound=1500.0,
        bin_count=bins,
        beam_count=beams,
        bins=np.asarray(values, np.float32),
    )


def beam(bearing_deg, value, bins=16):
    return dataclasses.replace(
        image(beams=1, bins=bins, value=np.full((1, bins), value)),
        bearings=np.radians([float(bearing_deg)]),
        beam_width=math.radians(3.0),
    )


class Bench:
    """A running viewer with a writer for each sonar, driven by hand."""

    def __init__(self, **properties):
        self.task = ViewerTask("viewer", {"port": 0, **properties})
        self.writers = {}
        self.sockets = []

    def writer(self, name="fls", size=4):
        if name not in self.writers:
            self.writers[name] = OutputPort(Sonar).own(name, "sonar_samples")
            connect_in_process(self.writers[name], self.task.sonar_samples, Policy("circular_buffer", size, False))
        return self.writers[name]

    def start(self):
        assert self.task.configure(), self.task.lifecycle.reason
        assert self.task.start(), self.task.lifecycle.reason
        return self

    def show(self, sonar, name="fls"):
        self.writer(name).write(sonar)
        self.task.cycle()

    @property
    def port(self):
        return self.task._server.port

    def get(self, path, **headers):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        body = answer.read()
        connection.close()
        return answer.status, body

    def open(self, **options):
        page = Page(connect(f"ws://127.0.0.1:{self.port}/live", max_size=None, compression=None, **options))
        self.sockets.append(page.socket)
        return page

    def stop(self):
        for opened in self.sockets:
            opened.close()
        if self.task.lifecycle.running:
            self.task.stop()


class Page:
    """What the page's script does with its socket."""

    def __init__(self, socket):
        self.socket = socket

    def say(self, **message):
        self.socket.send(json.dumps(message))

    def hear(self, kind, **wanted):
        """The next message of a kind; others are passed over."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            message = unpack(self.socket.recv(timeout=PATIENCE))
            if message["kind"] == kind and all(message.get(k) == v for k, v in wanted.items()):
                return message
        raise AssertionError(f"no {kind} message")

    def hears_nothing(self, kind, seconds=0.4):
        """Whether no message of a kind comes; the wait is many times what one takes on loopback."""
        end = time.monotonic() + seconds
        with contextlib.suppress(TimeoutError):
            while unpack(self.socket.recv(timeout=max(end - time.monotonic(), 0)))["kind"] != kind:
                pass
            return False
        return True


def unpack(message):
    if isinstance(message, str):
        return json.loads(message)
    length = int.from_bytes(message[:4], "little")
    header = json.loads(message[4 : 4 + length])
    at = 4 + length
    for name, dtype, shape in header["arrays"]:
        count = math.prod(shape)
        assert at % 8 == 0
        header[name] = np.frombuffer(message, dtype, count, at).reshape(shape)
        at += -(-count * np.dtype(dtype).itemsize // 8) * 8
    return header


@pytest.fixture
def bench():
    bench = Bench()
    bench.writer()
    yield bench.start()
    bench.stop()


def test_the_page_and_its_scripts_are_served(bench):
    status, page = bench.get("/")
    assert status == 200
    assert b"main.js" in page
    for name in (
        "main.js",
        "panel.js",
        "grid.js",
        "image.js",
        "link.js",
        "tasks.js",
        "style.css",
        "icon.svg",
        "colours.json",
    ):
        assert bench.get(f"/{name}")[0] == 200


@pytest.mark.parametrize("path", ["/../server.py", "/%2e%2e/server.py", "/static/index.html", "//etc/passwd", "/x"])
def test_nothing_else_is_served(bench, path):
    assert bench.get(path)[0] == 404


def test_a_page_of_another_site_gets_nothing(bench):
    assert bench.get("/", Host="evil.example:80")[0] == 403
    with pytest.raises(InvalidStatus, match="403"):
        bench.open(origin="http://evil.example")


def test_a_browser_is_sent_the_values_as_they_are(bench):
    sonar = image()
    sonar.bins[3, 5] = np.nan
    bench.show(sonar)
    got = bench.open().hear("image")
    assert np.array_equal(got["values"], sonar.bins, equal_nan=True)
    assert np.array_equal(got["bearings"], sonar.bearings)
    assert (got["source"], got["time"], got["bins"]) == ("fls.sonar_samples", sonar.time, 16)


def test_a_page_that_draws_nothing_is_sent_two_images_and_then_the_newest(bench):
    page = bench.open()
    for number in range(20):
        bench.show(image(number))
        time.sleep(0.01)
    first, second = page.hear("image"), page.hear("image")
    assert first["version"] < second["version"]
    assert page.hears_nothing("image")
    page.say(kind="drawn", source="fls.sonar_samples")
    assert np.array_equal(page.hear("image")["values"], image(19).bins)


def test_a_page_in_the_background_is_sent_nothing(bench):
    page = bench.open()
    page.say(kind="visible", visible=False)
    time.sleep(0.1)
    bench.show(image())
    assert page.hears_nothing("image")
    page.say(kind="visible", visible=True)
    assert page.hear("image")


def test_an_image_that_was_drawn_has_an_age(bench):
    page = bench.open()
    bench.show(image())
    page.hear("image")
    page.say(kind="drawn", source="fls.sonar_samples")
    age = page.hear("age")["age"]
    assert 0 <= age < PATIENCE


def test_a_paused_page_stands_still_and_steps_and_saves_what_it_shows(bench):
    page = bench.open()
    bench.show(image(1))
    page.hear("image")
    page.say(kind="drawn", source="fls.sonar_samples")
    page.say(kind="pause", source="fls.sonar_samples")
    page.hear("age")
    time.sleep(0.1)
    bench.show(image(2))
    assert page.hears_nothing("image")
    page.say(kind="save", what="raw", source="fls.sonar_samples")
    saved = page.hear("file")
    with np.load(io.BytesIO(saved["content"].tobytes())) as arrays:
        assert np.array_equal(arrays["bins"], image(1).bins)
        assert set(arrays.files) >= {"bearings", "bin_duration", "speed_of_sound", "beam_width", "beam_height", "time"}
    page.say(kind="step", source="fls.sonar_samples")
    assert np.array_equal(page.hear("image")["values"], image(2).bins)
    bench.show(image(3))
    page.say(kind="drawn", source="fls.sonar_samples")
    assert page.hears_nothing("image")
    page.say(kind="go", source="fls.sonar_samples")
    assert np.array_equal(page.hear("image")["values"], image(3).bins)


def test_a_picture_is_saved_as_a_figure(bench):
    page = bench.open()
    bench.show(image())
    page.hear("image")
    page.say(kind="save", what="png", source="fls.sonar_samples", ceiling=1.0, dynamic_range=40, colour_map="gray")
    saved = page.hear("file")
    assert saved["name"].endswith(".png")
    with Image.open(io.BytesIO(saved["content"].tobytes())) as picture:
        assert picture.text["Title"] == "fls.sonar_samples"


@pytest.mark.parametrize(
    "request_",
    [
        {},
        {"what": "exe"},
        {"what": "png"},
        {"what": "png", "ceiling": -1, "dynamic_range": 0},
        {"what": "png", "ceiling": math.inf, "dynamic_range": 40},
        {"what": "png", "ceiling": 1, "dynamic_range": math.nan},
        {"what": "png", "ceiling": 1, "dynamic_range": 40, "colour_map": {"copper": 1}},
    ],
)
def test_what_cannot_be_saved_is_said(bench, request_):
    page = bench.open()
    bench.show(image())
    page.hear("image")
    page.say(kind="save", source="fls.sonar_samples", **request_)
    assert "not saved" in page.hear("notice")["text"]


@pytest.mark.parametrize(
    "nonsense", ["", "[]", "{}", '{"kind": 7}', "null", '{"kind": "pause", "source": "nobody"}', "\x00", "[" * 5000]
)
def test_nonsense_from_a_page_is_passed_over(bench, nonsense):
    page = bench.open()
    page.socket.send(nonsense)
    bench.show(image())
    assert page.hear("image")


def test_a_scanning_head_sends_only_the_rows_that_changed(bench):
    page = bench.open()
    bench.show(beam(0.0, 1.0), "msis")
    first = page.hear("image")
    assert first["beams"] == 800
    assert len(first["rows"]) == 800  # a new page has nothing yet
    page.say(kind="drawn", source="msis.sonar_samples")
    page.hear("age")
    bench.show(beam(90.0, 2.0), "msis")
    second = page.hear("image")
    assert 0 < len(second["rows"]) < 10
    assert (second["values"] == 2.0).all()
    assert math.degrees(second["head"]) == pytest.approx(90.0)


def test_every_beam_of_a_scanning_head_counts_though_the_page_draws_few(bench):
    page = bench.open()
    bench.writer("msis", size=400)
    for i in range(400):
        bench.show(beam(i * 0.9, float(i)), "msis")
    got = np.full(800, np.nan)
    while np.isnan(got).any():
        message = page.hear("image")
        got[message["rows"]] = message["values"][:, 0]
        page.say(kind="drawn", source="msis.sonar_samples")
    assert len(set(got.tolist())) == 400


def test_several_sonars_share_a_page(bench):
    bench.show(image(1))
    bench.show(image(2, beams=4), "other")
    page = bench.open()
    shown = {message["source"]: message for message in (page.hear("image"), page.hear("image"))}
    assert shown["fls.sonar_samples"]["beams"] == 8
    assert shown["other.sonar_samples"]["beams"] == 4


def test_a_change_of_shape_is_said_and_drawn(bench, caplog):
    bench.show(image(1))
    bench.show(image(2, beams=4, bins=8))
    bench.show(image(3, beams=4, bins=8))
    said = [record.getMessage() for record in caplog.records]
    assert said == ["fls.sonar_samples: shape changed from 8 x 16 to 4 x 8 beams x bins"]
    page = bench.open()
    assert page.hear("image")["beams"] == 4
    status = page.hear("status", pages=1)
    assert "from 8 x 16 to 4 x 8" in status["sonars"]["fls.sonar_samples"]["notice"]


def test_an_image_that_cannot_be_drawn_is_said_once_and_counted_and_hides_no_other(bench, caplog):
    broken = dataclasses.replace(image(), beam_count=9)
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            bench.show(broken)
    bench.show(image(5), "other")
    assert bench.task.lifecycle.state is State.RUNNING
    assert [r.getMessage() for r in caplog.records] == [
        "fls.sonar_samples: bins must be (9, 16) beams x bins, got (8, 16)"
    ]
    page = bench.open()
    assert page.hear("image")["source"] == "other.sonar_samples"
    status = page.hear("status", pages=1)["sonars"]["fls.sonar_samples"]
    assert status["invalid"] == 3
    assert "bins must be" in status["notice"]


def test_the_status_tells_rate_and_drops_and_the_viewers_own_state(bench):
    writer = bench.writer()
    for number in range(10):
        writer.write(image(number))  # into a buffer of 4: six do not fit
    bench.task.cycle()
    page = bench.open()
    status = page.hear("status", pages=1)
    assert status["sonars"]["fls.sonar_samples"]["dropped"] == 6
    own = next(task for task in status["tasks"] if task["name"] == "viewer")
    assert (own["state"], own["type"]) == ("RUNNING", "ViewerTask")


def test_a_setting_that_is_refused_comes_with_its_reason(bench):
    page = bench.open()
    page.say(kind="set", task="nobody", name="range", value="30 m")
    assert page.hear("set")["refused"] == "nobody is not running"


def test_a_camera_frame_reaches_the_page(bench):
    camera = OutputPort(Frame).own("camera", "camera_samples")
    connect_in_process(camera, bench.task.camera_samples, Policy())
    picture = np.arange(4 * 5 * 3, dtype=np.uint8).reshape(4, 5, 3)
    camera.write(Frame(time=1, image=picture, channels="red,green,blue"))
    bench.task.cycle()
    assert np.array_equal(bench.open().hear("camera")["image"], picture)


def test_a_port_in_use_is_an_error_state_with_one_line_and_heals():
    with socket.create_server(("127.0.0.1", 0)) as other:
        bench = Bench(port=other.getsockname()[1])
        bench.writer()
        bench.start()
        life = bench.task.lifecycle
        assert (life.state, life.substate) == (State.RUNTIME_ERROR, PORT_IN_USE)
        assert life.reason.startswith(f"http://127.0.0.1:{bench.task.properties.port}: ")
        assert "\n" not in life.reason
        bench.show(image())
        assert bench.task.board.channels["fls.sonar_samples"].latest is not None
    time.sleep(1.1)  # it asks for the port again once a second
    bench.task.cycle()
    assert life.state is State.RUNNING
    assert bench.open().hear("image")
    bench.stop()


def test_other_computers_are_served_only_if_that_is_meant():
    task = ViewerTask("viewer", {"address": "0.0.0.0"})
    assert not task.configure()
    assert "allow_remote" in task.lifecycle.reason
    assert ViewerTask("viewer", {"address": "0.0.0.0", "allow_remote": True}).read_properties() == []


def test_pictures_of_the_first_and_the_last_image_are_kept(tmp_path):
    bench = Bench(snapshot_dir=str(tmp_path / "new" / "folder"), snapshot_period="0.2 s")
    bench.writer()
    bench.start()
    for number in range(5):
        bench.show(image(number))
        time.sleep(0.1)
    bench.show(beam(0.0, 1.0), "msis")
    bench.stop()
    names = sorted(path.name for path in (tmp_path / "new" / "folder").iterdir())
    assert "fls_sonar_samples_first.png" in names
    assert "fls_sonar_samples_last.png" in names
    assert "msis_sonar_samples_last.png" in names


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").touch()
    bench = Bench(snapshot_dir=str(tmp_path / "file"))
    assert bench.task.configure()
    assert not bench.task.start()
    assert f"snapshot_dir: {tmp_path / 'file'} cannot be written" in bench.task.lifecycle.reason


def test_it_can_be_started_again_on_the_same_port():
    bench = Bench()
    bench.writer()
    bench.start()
    port = bench.port
    bench.stop()
    bench.task.given["port"] = port
    assert bench.task.cleanup()
    bench.start()
    bench.show(image())
    assert bench.port == port
    assert bench.open().hear("image")
    bench.stop()
