"""The page in a real browser: headless Chromium opens it, moves the pointer, presses buttons and reads pixels."""

from __future__ import annotations

import io
import math
import os
import shutil
import signal
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sonar_component.middleware import OutputPort, Policy
from sonar_component.middleware.ports import connect_in_process
from sonar_component.pictures.colours import NO_DATA, colour_table
from sonar_component.pictures.fan import fan_map
from sonar_component.samples import Sonar
from sonar_component.scene import Body, Material, Part, World, shapes
from sonar_component.tasks.viewer import ViewerTask

PATIENCE = 30.0  # [s], for a browser on a busy machine of two cores
SOURCE = "fls.sonar_samples"
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")

pytestmark = pytest.mark.skipif(
    not (CHROMIUM and DRIVER), reason="needs a browser: sudo apt-get install chromium chromium-driver"
)


@pytest.fixture(scope="module")
def driver(tmp_path_factory):
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        "--headless=new",
        "--no-sandbox",  # Chromium refuses to start as root otherwise
        "--disable-gpu",
        "--enable-unsafe-swiftshader",  # WebGL for the 3-D world on the CPU
        "--disable-quic",
        "--no-first-run",
        "--disable-background-networking",  # it asks the internet for updates at every start otherwise
        "--disable-component-update",
        "--disable-sync",
        "--window-size=1400,1000",
        f"--user-data-dir={tmp_path_factory.mktemp('chromium')}",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(PATIENCE)
    yield driver
    driver.quit()


class Browser:
    """One page, and what a person does with it."""

    def __init__(self, driver, folder):
        self.driver, self.folder = driver, folder

    def open(self, port):
        self.driver.get(f"http://127.0.0.1:{port}/")

    def run(self, script, *arguments):
        return self.driver.execute_script(script, *arguments)

    def wait_for(self, script, *arguments):
        """Wait until a script gives something true, and return it."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            if result := self.run(script, *arguments):
                return result
            time.sleep(0.05)
        self.shoot("waited_in_vain")
        raise AssertionError(f"{script} stayed false; the page says: {self.text()}")

    def wait_for_text(self, text, where="body"):
        script = "return document.querySelector(arguments[0])?.innerText.includes(arguments[1])"
        return self.wait_for(script, where, text)

    def text(self, where="body"):
        return self.run("return document.querySelector(arguments[0])?.innerText", where)

    def wait_for_image(self, sonar, source=SOURCE):
        script = "return document.querySelector(`[data-source='${arguments[0]}']`)?.dataset.time === arguments[1]"
        self.wait_for(script, source, str(sonar.time))

    def choose(self, control, value, source=SOURCE):
        self.run(
            """const c = document.querySelector(`[data-source='${arguments[0]}'] .${arguments[1]}`);
            c.value = arguments[2]; c.dispatchEvent(new Event("input")); c.dispatchEvent(new Event("change"));""",
            source,
            control,
            value,
        )

    def press(self, control, source=SOURCE):
        self.run("document.querySelector(`[data-source='${arguments[0]}'] .${arguments[1]}`).click()", source, control)

    def canvas(self, source=SOURCE):
        """Pixels of a picture without its rings, (rows, columns, 4) uint8."""
        width, height, data = self.run(
            """const c = document.querySelector(`[data-source='${arguments[0]}'] .under`);
            const d = c.getContext("2d").getImageData(0, 0, c.width, c.height).data;
            let text = "";
            for (let i = 0; i < d.length; i += 32768) text += String.fromCharCode(...d.subarray(i, i + 32768));
            return [c.width, c.height, btoa(text)];""",
            source,
        )
        import base64

        return np.frombuffer(base64.b64decode(data), np.uint8).reshape(height, width, 4)

    def point_at(self, sonar, distance, bearing_deg, source=SOURCE):
        """Move the pointer to a place in the fan, and return what the page reads there."""
        left, right, bottom, top = fan_map(sonar, 100).extent
        x, y = distance * math.cos(math.radians(bearing_deg)), distance * math.sin(math.radians(bearing_deg))
        return self.run(
            """const panel = document.querySelector(`[data-source='${arguments[0]}']`);
            const under = panel.querySelector(".under"), over = panel.querySelector(".over");
            const d = under.getContext("2d").getImageData(0, 0, under.width, under.height).data;
            let [l, r, t, b] = [under.width, 0, under.height, 0];
            for (let i = 3, p = 0; i < d.length; i += 4, p++) if (d[i]) {
              const column = p % under.width, row = (p - column) / under.width;
              l = Math.min(l, column); r = Math.max(r, column + 1); t = Math.min(t, row); b = Math.max(b, row + 1);
            }
            const scale = over.clientWidth / under.width;
            const at = [(l + arguments[1] * (r - l)) * scale, (t + arguments[2] * (b - t)) * scale];
            const box = over.getBoundingClientRect();
            over.dispatchEvent(new MouseEvent("mousemove", { clientX: box.left + at[0], clientY: box.top + at[1] }));
            return { ...panel.querySelector(".cursor").dataset, text: panel.querySelector(".cursor").innerText };""",
            source,
            (left - y) / (left - right),
            (top - x) / (top - bottom),
        )

    def picture(self):
        """What is on the screen, (rows, columns, 3) uint8."""
        return np.asarray(Image.open(io.BytesIO(self.driver.get_screenshot_as_png())).convert("RGB"))

    def shoot(self, name):
        self.driver.save_screenshot(str(self.folder / f"{name}.png"))

    def complaints(self):
        """Errors that the page's scripts raised."""
        log = self.driver.get_log("browser")
        return [
            entry["message"] for entry in log if entry["level"] == "SEVERE" and "ERR_CONNECTION" not in entry["message"]
        ]


@pytest.fixture
def browser(driver, tmp_path):
    folder = Path(os.environ.get("SONAR_SCREENSHOTS", tmp_path))
    folder.mkdir(parents=True, exist_ok=True)
    browser = Browser(driver, folder)
    yield browser
    assert not [line for line in browser.complaints() if "WebSocket" not in line]
    driver.get("about:blank")


class Bench:
    """A viewer with writers, driven by the test."""

    def __init__(self):
        self.task = ViewerTask("viewer", {"port": 0})
        self.writers = {}
        for name in ("fls", "msis"):
            self.writers[name] = OutputPort(Sonar).own(name, "sonar_samples")
            policy = Policy("circular_buffer", 1000, False)
            connect_in_process(self.writers[name], self.task.sonar_samples, policy)
        assert self.task.configure()
        assert self.task.start(), self.task.lifecycle.reason
        self.port = self.task._server.port

    def show(self, sonar, name="fls"):
        self.writers[name].write(sonar)
        self.task.cycle()


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    if bench.task.lifecycle.running:
        bench.task.stop()


def fan(number=1, bins=None, bearings_deg=None):
    """A dim floor with a bright target at +30 deg, 20 to 22 m, and two silent beams on the right."""
    bearings = np.radians(np.linspace(60, -60, 121) if bearings_deg is None else bearings_deg)
    if bins is None:
        bins = np.random.default_rng(number).uniform(0.001, 0.01, (bearings.size, 150)).astype(np.float32)
        bins[26:35, 100:110] = 0.9
        bins[100:110] = np.nan
    return Sonar(
        time=time.time_ns() // 1000,
        bin_duration=0.2 / 1500,
        beam_width=math.radians(121),
        beam_height=math.radians(20),
        bearings=bearings,
        speed_of_sound=1500.0,
        bin_count=bins.shape[1],
        beam_count=bearings.size,
        bins=bins,
    )


def beam(bearing_deg, value):
    bins = np.full((1, 100), value, np.float32)
    sonar = fan(bins=bins, bearings_deg=np.array([float(bearing_deg)]))
    sonar.beam_width = math.radians(3.0)
    return sonar


def placed(sonar, position):
    """The same image with the pose of its sensor: level, looking along the world's X axis."""
    sonar.sensor_position, sonar.sensor_orientation = position, np.array([1.0, 0.0, 0.0, 0.0])
    return sonar


def same(pixels, colour):
    return (pixels[:, :, :3] == np.asarray(colour)).all(axis=2) & (pixels[:, :, 3] == 255)


def test_a_fan_is_drawn_with_left_on_the_left_and_no_data_in_its_own_colour(bench, browser):
    sonar = fan()
    browser.open(bench.port)
    bench.show(sonar)
    browser.wait_for_image(sonar)
    pixels = browser.canvas()
    target, missing = same(pixels, colour_table("copper")[255]), same(pixels, NO_DATA)
    assert target.sum() > 100
    assert missing.sum() > 1000
    middle = pixels.shape[1] / 2
    assert np.nonzero(target)[1].max() < middle
    assert np.nonzero(missing)[1].min() > middle
    browser.shoot("fan")


def test_the_cursor_reads_the_value_that_the_sonar_sent(bench, browser):
    sonar = fan()
    browser.open(bench.port)
    bench.show(sonar)
    browser.wait_for_image(sonar)
    for distance, bearing in ((20.9, 30.2), (12.1, -17.3), (27.05, 55.1), (5.05, 0.3)):
        read = browser.point_at(sonar, distance, bearing)
        beam_, bin_ = int(read["beam"]), int(read["bin"])
        assert float(read["value"]) == float(sonar.bins[beam_, bin_])
        # A pixel is 0.06 m here, and the pointer stands on one: so near to the place that was meant.
        assert sonar.bin_ranges()[bin_] == pytest.approx(distance, abs=0.1 + 0.06)
        assert math.degrees(sonar.bearings[beam_]) == pytest.approx(bearing, abs=0.5 + math.degrees(0.06 / distance))
    assert "no data" in browser.point_at(sonar, 20.0, -45.0)["text"]


@pytest.mark.parametrize(
    "bearings_deg",
    [
        np.linspace(-60, 60, 61),
        np.degrees(np.arcsin(np.linspace(0.86, -0.86, 64))),
        [-50, -31, -30, 4, 20, 70],
        np.arange(90) * 4.0 - 178,
        [10.0],
    ],
)
def test_the_pages_table_is_that_of_the_pictures(bench, browser, bearings_deg):
    sonar = fan(bins=np.zeros((len(bearings_deg), 80), np.float32), bearings_deg=np.asarray(bearings_deg))
    browser.open(bench.port)
    made = browser.driver.execute_async_script(
        """const [bearings, bins, length, width, done] = arguments;
        import("/image.js").then(({ Image, fanTable }) => {
          const image = Object.assign(new Image(), { bearings: Float64Array.from(bearings), beams: bearings.length,
            bins, bin_length: length, beam_width: width, turning: false });
          const table = fanTable(image, 200, 200);
          done([table.height, table.width, Array.from(table.index), table.extent]);
        });""",
        sonar.bearings.tolist(),
        sonar.bin_count,
        sonar.bin_length,
        sonar.beam_width,
    )
    table = fan_map(sonar, 200)
    assert tuple(made[:2]) == table.index.shape
    assert made[3] == pytest.approx(table.extent)
    # Both compute in float64; a pixel exactly on an edge may fall to either side by the last bit of an arc tangent.
    assert np.mean(np.array(made[2]) != table.index.ravel()) < 1e-3


def test_colour_map_gain_and_scale_change_the_picture_at_once(bench, browser):
    sonar = fan()
    browser.open(bench.port)
    bench.show(sonar)
    browser.wait_for_image(sonar)
    seen = [browser.canvas()]
    for control, value in (("map", "viridis"), ("gain", "10"), ("dynamic", "20"), ("law", "linear"), ("view", "polar")):
        browser.choose(control, value)
        pixels = browser.canvas()
        assert pixels.shape != seen[-1].shape or (pixels != seen[-1]).any(), control
        seen.append(pixels)
    browser.shoot("polar")
    target = same(seen[-1], colour_table("viridis")[255])
    assert np.nonzero(target)[1].max() < seen[-1].shape[1] / 2  # polar, too, has left on the left


def test_a_scanning_sonars_turn_fills_and_is_overwritten(bench, browser):
    browser.open(bench.port)

    def share(colour):
        pixels = browser.canvas("msis.sonar_samples")
        return same(pixels, colour).sum() / (pixels[:, :, 3] == 255).sum()

    for i in range(100):
        last = beam(i * 0.9, 0.01)
        bench.show(last, "msis")
    browser.wait_for_image(last, "msis.sonar_samples")
    # A quarter of the turn was seen, and half a beam of 3 deg before its start.
    assert share(NO_DATA) == pytest.approx(0.75, abs=0.02)
    key = "[data-source='msis.sonar_samples'] .gaps"
    assert browser.text(key) == "no data"  # what that colour means
    for i in range(100, 400):
        last = beam(i * 0.9, 0.01)
        bench.show(last, "msis")
    browser.wait_for_image(last, "msis.sonar_samples")
    assert share(NO_DATA) == 0
    assert browser.run("return document.querySelector(arguments[0]).hidden", key)
    browser.run("document.querySelector('.auto').click()")  # holds the brightness, so that colours can be compared
    before = browser.canvas("msis.sonar_samples")
    for i in range(50):
        last = beam(i * 0.9, 1e-5)
        bench.show(last, "msis")
    browser.wait_for_image(last, "msis.sonar_samples")
    changed = (browser.canvas("msis.sonar_samples") != before).any(axis=2)
    assert changed.sum() / (before[:, :, 3] == 255).sum() == pytest.approx(0.125, abs=0.02)  # 45 of 360 deg
    browser.shoot("sweep")


def test_a_paused_page_stands_still_until_it_is_told_to_go_on(bench, browser):
    first, second, third = fan(1), fan(2), fan(3)
    browser.open(bench.port)
    bench.show(first)
    browser.wait_for_image(first)
    browser.press("pause")
    time.sleep(0.3)  # the request is on its way to the server
    second.time, third.time = first.time + 1, first.time + 2
    bench.show(second)
    time.sleep(0.5)
    assert browser.run("return document.querySelector('.panel').dataset.time") == str(first.time)
    browser.press("step")
    browser.wait_for_image(second)
    bench.show(third)
    browser.press("pause")
    browser.wait_for_image(third)


def test_a_picture_and_a_raw_image_are_saved(bench, browser):
    sonar = fan()
    browser.open(bench.port)
    bench.show(sonar)
    browser.wait_for_image(sonar)
    browser.press("png")
    browser.wait_for_text(f"saved fls_sonar_samples_{sonar.time}.png", "#notice")
    browser.press("raw")
    browser.wait_for_text(f"saved fls_sonar_samples_{sonar.time}.npz", "#notice")


def test_images_of_another_shape_and_broken_ones_are_said_on_the_page(bench, browser):
    browser.open(bench.port)
    bench.show(fan())
    other = fan(bins=np.full((31, 60), 0.5, np.float32), bearings_deg=np.linspace(30, -30, 31))
    bench.show(other)
    browser.wait_for_image(other)
    browser.wait_for_text("from 121 x 150 to 31 x 60")
    broken = fan()
    broken.beam_count = 5
    bench.show(broken)
    browser.wait_for_text("bins must be (5, 150)")


def test_without_a_sonar_the_page_says_so(bench, browser):
    browser.open(bench.port)
    browser.wait_for_text("No image yet")
    browser.wait_for_text("connected", "#link")


def test_a_viewer_that_goes_is_said_and_one_that_comes_back_is_found(bench, browser):
    browser.open(bench.port)
    browser.wait_for_text("connected", "#link")
    bench.task.stop()
    browser.wait_for_text("connection to the viewer lost", "#link")
    bench.task.given["port"] = bench.port
    assert bench.task.configure()
    assert bench.task.start()
    browser.wait_for_text("connected", "#link")
    sonar = fan()
    bench.show(sonar)
    browser.wait_for_image(sonar)


def test_ten_tabs_are_served(bench, browser):
    first = browser.driver.current_window_handle
    sonar = fan()
    bench.show(sonar)
    opened = []
    for _ in range(10):
        browser.driver.switch_to.new_window("tab")
        opened.append(browser.driver.current_window_handle)
        browser.open(bench.port)
        browser.wait_for_image(sonar)
    assert bench.task._server.clients == 10
    newer = fan(2)
    bench.show(newer)
    for handle in opened:
        browser.driver.switch_to.window(handle)
        browser.wait_for_image(newer)
        browser.driver.close()
    browser.driver.switch_to.window(first)


def test_the_world_shows_sector_trail_scene_and_the_last_image_where_it_belongs(bench, browser):
    """Seen from straight above the sonar, which looks up in the picture: left in the world is left on the screen."""
    pytest.importorskip("viser", reason='needs viser: pip install "sonar-component[viewer]"')
    floor = shapes.plane((60.0, 60.0))
    world = bench.task._server.world
    far = np.array([5e5, 4.65e6, -3.0])  # UTM coordinates: float32 would round them to half a metre
    floor_at = np.eye(4)
    floor_at[:3, 3] = far - np.array([0, 0, 4.0])
    world.show(World([Body("floor", [Part(floor, Material("sand"), np.eye(4))], floor_at)]))
    browser.driver.get(f"http://127.0.0.1:{bench.port}/world/")
    bench.show(placed(fan(), far - np.array([0.5, 0.0, 0.0])))
    client = _wait(lambda: world._viser and next(iter(world._viser.get_clients().values()), None))
    _wait(lambda: world._stage)
    time.sleep(0.5)  # the world looks at the sonars five times a second
    bench.show(placed(fan(), far))
    _wait(lambda: any(name.startswith("/trail") for name in world._stage._nodes))
    client.camera.position, client.camera.look_at, client.camera.up_direction = (
        (15.0, 0.0, 45.0),
        (15.01, 0.0, 0.0),
        (1, 0, 0),
    )
    _wait(lambda: _count(browser, _is_sector) > 200)
    plain = browser.picture()
    world._switches["fan"].value = True
    _wait(lambda: (_changed(plain, browser.picture())).sum() > 20_000)
    browser.shoot("world")
    laid = browser.picture()
    bright = _changed(plain, laid) & (laid.max(axis=2) > 200)  # the target of strength 0.9 among echoes under 0.01
    assert np.nonzero(bright)[1].mean() < laid.shape[1] / 2
    assert sum(name.startswith("/scene/floor") for name in world._stage._nodes) == 1


def _wait(what):
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        if result := what():
            return result
        time.sleep(0.2)
    raise AssertionError("waited in vain")


def _count(browser, which):
    return which(browser.picture()).sum()


def _is_sector(picture):
    red, green, blue = (picture[:, :, c].astype(int) for c in range(3))
    return (red > 150) & (green > 100) & (blue < 0.7 * green)  # yellow lines; sand and steel are duller


def _changed(before, after):
    return np.abs(before.astype(int) - after.astype(int)).max(axis=2) > 10


DEPLOYMENT = """
version: 1
tasks:
  scene: {type: SceneTask, properties: {world: SCENE}}
  pose:
    type: VehiclePoseTask
    activity: {periodic: 100 ms}
    properties: {position: [0 m, 0 m, -3 m], rpy: [0 deg, 15 deg, 0 deg]}
  fls:
    type: MultibeamSonarTask
    properties: {range: 20 m, beam_count: 64, bin_count: 200}
  viewer: {type: ViewerTask, properties: {port: 0}}
connections:
  - {from: pose.pose_samples, to: [fls.sonar_pose_cmd], policy: data}
  - {from: fls.sonar_samples, to: [viewer.sonar_samples], policy: {circular_buffer: 4}}
"""
SCENE = """
version: 1
materials: {plain: {reflectance: 1.0}}
bodies:
  floor: {plane: {size: [80 m, 80 m]}, pose: {position: [0, 0, -6 m]}, material: plain}
  rock: {sphere: {radius: 1 m}, pose: {position: [10 m, 3 m, -5 m]}, material: plain}
"""


def test_a_whole_graph_is_steered_from_the_page(graph, browser):
    scene = graph.write(SCENE, "scene.yaml")
    graph.start(DEPLOYMENT.replace("SCENE", str(scene)))
    page = graph.wait_for(lambda: _page(graph), "a page")
    browser.driver.get(page)
    browser.wait_for_text("20 m", f"[data-source='{SOURCE}'] h2")
    browser.shoot("graph_20_m")

    assert not browser.run("return document.querySelector(\"[data-task='fls'] details\").open")
    browser.press("settings")
    assert browser.run("return document.querySelector(\"[data-task='fls'] details\").open")
    _set(browser, "fls", "range", "12 m")
    browser.wait_for_text("12 m", f"[data-source='{SOURCE}'] h2")
    assert graph.json("inspect", "fls")["properties"]["range"]["value"] == 12.0
    browser.shoot("graph_12_m")

    assert (_shown(browser, "fls", "range"), _shown(browser, "fls", "beam_width")) == ("12 m", "120 deg")
    _set(browser, "fls", "range", "5000 m")
    browser.wait_for_text("refused", "[data-task='fls']")
    assert "range" in browser.text("[data-task='fls']")
    browser.shoot("refused")

    pid = next(task["pid"] for task in graph.json("list")["tasks"] if task["task"] == "fls")
    os.kill(pid, signal.SIGSTOP)  # as one that is busy for a while
    _set(browser, "fls", "range", "15 m")
    browser.wait_for_text("no answer", "[data-task='fls']")
    os.kill(pid, signal.SIGCONT)
    browser.wait_for_text("15 m", f"[data-source='{SOURCE}'] h2")

    os.kill(pid, signal.SIGKILL)
    browser.wait_for(
        "return /process has ended|restarted 1 time/.test(document.querySelector(\"[data-task='fls']\").innerText)"
    )
    browser.shoot("killed")
    browser.wait_for_text("restarted 1 time", "[data-task='fls']")


def _page(graph):
    done = graph.sonar("view", "--json")
    import json

    return json.loads(done.stdout)["page"] if done.returncode == 0 else None


def _shown(browser, task, name):
    return browser.run(f"return document.querySelector(\"[data-task='{task}'] input[name='{name}']\").value")


def _set(browser, task, name, value):
    browser.wait_for(f"return document.querySelector(\"[data-task='{task}'] input[name='{name}']\") !== null")
    browser.run(
        """const field = document.querySelector(`[data-task='${arguments[0]}'] input[name='${arguments[1]}']`);
        field.closest("details").open = true; field.value = arguments[2]; field.dispatchEvent(new Event("change"));""",
        task,
        name,
        value,
    )
