"""A scanning sonar on worlds whose echoes can be written down."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from sonar_component.samples import RigidBodyState
from sonar_component.samples.rigid_body_state import quaternion_from_rpy
from sonar_component.scene import Body, Material, Part, World
from sonar_component.scene.shapes import box, sphere
from sonar_component.sonars.forward_looking import ForwardLookingSonar
from sonar_component.sonars.scanning import ScanningSonar
from sonar_component.sonars.scanning_settings import ScanningSettings
from sonar_component.sonars.settings import ForwardLookingSettings


def pose(position: Any = (0, 0, 0), rpy: Any = (0, 0, 0), time: int = 1) -> RigidBodyState:
    return RigidBodyState(time=time, position=np.array(position, float), orientation=quaternion_from_rpy(*rpy))


def world(*solids: tuple[Any, tuple[float, float, float]]) -> World:
    bodies = []
    for number, (mesh, position) in enumerate(solids):
        X_WB = np.eye(4)
        X_WB[:3, 3] = position
        bodies.append(Body(f"body{number}", [Part(mesh, Material("plain"), np.eye(4))], X_WB))
    return World(bodies)


def ball_at(bearing: float, distance: float) -> World:
    return world((sphere(0.3), (distance * math.cos(bearing), distance * math.sin(bearing), 0.0)))


@pytest.mark.parametrize("degrees", [0, 37, 90, 179, -90, -140])
def test_it_sees_a_ball_where_it_is_and_nowhere_else(context: Any, degrees: float) -> None:
    sonar = ScanningSonar(context, ScanningSettings(range=10.0, bin_count=500, normalization="energy"))
    there = math.radians(degrees)
    scene = ball_at(there, 6.0)
    hit = sonar.ping(scene, pose(), bearing=there)
    # The ball begins at 5.7 m: its first bin, or the one before or after if the edge falls between two samples.
    assert abs(np.flatnonzero(hit.bins[0])[0] - 5.7 / 0.02) <= 1.0
    assert hit.bearings[0] == pytest.approx(there)
    for off in (-0.2, 0.2):  # 11 deg beside it; the ball spans +-2.9 deg and the beam +-1.5
        assert not sonar.ping(scene, pose(), bearing=there + off).bins.any()
    sonar.release()


def test_bearings_are_positive_to_the_left_and_turn_with_the_vehicle(context: Any) -> None:
    sonar = ScanningSonar(context, ScanningSettings(range=10.0, bin_count=100))
    scene = ball_at(math.radians(90), 6.0)
    assert sonar.ping(scene, pose(rpy=(0, 0, math.radians(60))), bearing=math.radians(30)).bins.any()
    assert not sonar.ping(scene, pose(rpy=(0, 0, math.radians(60))), bearing=math.radians(-30)).bins.any()
    sonar.release()


def test_a_head_on_its_side_scans_a_vertical_plane(context: Any) -> None:
    sonar = ScanningSonar(context, ScanningSettings(range=10.0, bin_count=100))
    below = world((sphere(0.3), (0.0, 0.0, -6.0)))
    # Rolled by 90 deg to the right, its left is up and its right is down.
    assert sonar.ping(below, pose(rpy=(math.radians(90), 0, 0)), bearing=math.radians(-90)).bins.any()
    assert not sonar.ping(below, pose(rpy=(math.radians(90), 0, 0)), bearing=math.radians(90)).bins.any()
    sonar.release()


def test_its_beam_is_the_same_as_that_of_a_forward_looking_sonar(context: Any) -> None:
    scene = world((box((0.5, 20.0, 20.0)), (6.0, 1.0, 0.0)), (sphere(0.5), (4.0, 0.4, -0.3)))
    shared: dict[str, Any] = {"range": 10.0, "bin_count": 200, "beam_width": 0.05, "beam_height": 0.5}
    shared["normalization"] = "energy"
    one = ScanningSonar(context, ScanningSettings(**shared))
    fan = ForwardLookingSonar(context, ForwardLookingSettings(beam_count=1, **shared))
    a, b = one.ping(scene, pose()), fan.ping(scene, pose())
    # Each plans its own samples for an energy error of 0.02; the scanning one for all directions.
    assert np.linalg.norm(a.bins - b.bins) <= 0.04 * np.linalg.norm(b.bins)
    assert a.bins.shape == (1, 200)
    one.release()
    fan.release()


def test_samples_are_one_beam_as_a_micron_driver_publishes(context: Any) -> None:
    sonar = ScanningSonar(context, ScanningSettings(range=15.0, bin_count=150, start_bearing=math.radians(20)))
    sample = sonar.ping(ball_at(0.0, 5.0), pose(time=77))
    sample.validate()
    assert (sample.time, sample.beam_count, sample.timestamps.size) == (77, 1, 0)
    assert sample.bearings[0] == pytest.approx(math.radians(20))
    assert (sample.beam_width, sample.beam_height) == pytest.approx((math.radians(3), math.radians(35)))
    assert sample.bin_length == pytest.approx(0.1)
    sonar.release()


def test_a_change_of_range_leaves_the_head_where_it_is_and_a_new_sector_moves_it(context: Any) -> None:
    sonar = ScanningSonar(context, ScanningSettings(start_bearing=math.radians(90)))
    sonar.settings = sonar.settings.model_copy(update={"range": 5.0})
    assert sonar.head.bearing == pytest.approx(math.radians(90))
    narrow = {"continuous": False, "left_limit": "-45 deg", "right_limit": "45 deg", "start_bearing": None}
    sonar.settings = ScanningSettings.model_validate(sonar.settings.model_dump() | narrow)
    assert sonar.head.bearing == pytest.approx(math.radians(45), abs=math.radians(1.8))
    sonar.release()


def test_speckle_off_is_bit_exact_and_the_same_seed_gives_the_same_bits(context: Any) -> None:
    scene = ball_at(0.0, 5.0)
    sonar = ScanningSonar(context, ScanningSettings(range=10.0))
    clean = sonar.ping(scene, pose())
    assert (sonar.ping(scene, pose(), np.random.default_rng(1)).bins == clean.bins).all()  # not enabled
    noisy = ScanningSettings.model_validate({"range": 10.0, "enable_speckle_noise": True})
    sonar.settings = noisy
    assert (sonar.ping(scene, pose()).bins == clean.bins).all()  # no generator
    first, again = (sonar.ping(scene, pose(), np.random.default_rng(1)).bins for _ in range(2))
    assert (first == again).all()
    assert (first != clean.bins).any()
    sonar.release()


def test_the_far_bins_of_a_long_ping_see_the_later_pose(context: Any) -> None:
    # Two walls ahead; the vehicle closes in at 10 m/s. Sound needs r / c to a wall at r.
    speed, c = 10.0, 1500.0
    settings = ScanningSettings(
        range=100.0, bin_count=4000, speed_of_sound=c, in_ping_motion=True, normalization="energy", beam_height=0.2
    )
    sonar = ScanningSonar(context, settings)
    moving = pose()
    moving.velocity, moving.angular_velocity = np.array([speed, 0, 0]), np.zeros(3)
    scene = world((box((0.1, 2.0, 4.0)), (20.05, 3.0, 0.0)), (box((0.1, 60.0, 60.0)), (90.05, 0.0, 0.0)))
    for bearing, wall in ((0.0, 90.0), (math.atan2(3.0, 20.0), 20.0)):
        sample = sonar.ping(scene, moving, bearing=bearing)
        first = np.flatnonzero(sample.bins[0])[0]
        nearest = wall / math.cos(max(abs(bearing) - settings.beam_width / 2, 0.0))
        heard = nearest * (1 - speed / c)  # closed in by v r / c, to first order in v / c
        # 16 poses over 100 m: half of one is 3 m of range, 0.02 m of way; one more bin for the edge.
        assert abs(first * 0.025 - heard) <= 0.025 + 0.021
    still = sonar.ping(scene, pose(), bearing=0.0)
    assert np.flatnonzero(still.bins[0])[0] == pytest.approx(90.0 / 0.025, abs=1)
    sonar.release()


def test_a_turning_vehicle_smears_a_long_ping_only_if_asked(context: Any) -> None:
    rate = math.radians(60)  # per second; 0.053 s to 80 m, so 3.2 deg
    turning = pose()
    turning.velocity, turning.angular_velocity = np.zeros(3), np.array([0, 0, rate])
    settings: dict[str, Any] = {"range": 100.0, "bin_count": 1000, "speed_of_sound": 1500.0}
    post = ball_at(rate * 80 / 1500.0, 80.0)  # where the beam will have turned to when sound reaches it
    for asked in (False, True):
        sonar = ScanningSonar(context, ScanningSettings(in_ping_motion=asked, beam_width=math.radians(2), **settings))
        assert sonar.ping(post, turning, bearing=0.0).bins.any() == asked
        sonar.release()


def test_spreading_and_its_gain_undo_each_other_and_either_alone_shows(context: Any) -> None:
    scene = world((box((0.1, 60.0, 60.0)), (8.05, 0.0, 0.0)))
    settings: dict[str, Any] = {"range": 10.0, "bin_count": 100, "normalization": "energy"}
    images = {}
    for name, more in {
        "none": {},
        "lost": {"spreading": "40 dB"},
        "undone": {"spreading": "40 dB", "time_varying_gain": {"spreading": "40 dB"}},
    }.items():
        sonar = ScanningSonar(context, ScanningSettings.model_validate({**settings, **more}))
        images[name] = sonar.ping(scene, pose()).bins[0]
        sonar.release()
    lit = np.flatnonzero(images["none"])
    ranges = (lit + 0.5) * 0.1
    # 40 dB per decade of amplitude is the square of the range; float32 keeps seven digits.
    assert np.allclose(images["lost"][lit], images["none"][lit] / ranges**2, rtol=1e-6)
    assert np.allclose(images["undone"], images["none"], rtol=1e-6)
