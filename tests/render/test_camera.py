"""The underwater camera against closed forms of light in water."""

from __future__ import annotations

import numpy as np
import pytest

from sonar_component.render.camera import Camera, View, Water
from sonar_component.samples.rigid_body_state import quaternion_from_rpy, rotation_from_quaternion
from sonar_component.scene import Body, Material, Mesh, Part, World

CLEAR = Water(absorption=(0.3, 0.05, 0.01), scattering=0.0, surface=0.0)
VIEW = View(width=81, height=61, field_of_view=float(np.radians(60)))  # odd: one pixel looks along the axis


def pose(position, rpy_deg=(0.0, 0.0, 0.0)):
    X_WC = np.eye(4)
    X_WC[:3, :3] = rotation_from_quaternion(quaternion_from_rpy(*np.radians(rpy_deg)))
    X_WC[:3, 3] = position
    return X_WC


def wall(x, y=(-50.0, 50.0), z=(-80.0, 80.0), name="wall"):
    """A rectangle across the X axis, facing back along it."""
    corners = np.array([[x, y[0], z[0]], [x, y[1], z[0]], [x, y[1], z[1]], [x, y[0], z[1]]])
    normals = np.tile(np.array([[-1, 0, 0]], np.float32), (4, 1))
    mesh = Mesh(corners, normals, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    return Body(name, [Part(mesh, Material("plain"), np.eye(4))], np.eye(4))


def light(context, world, X_WC, water=CLEAR):
    camera = Camera(context, VIEW, water)
    picture = camera.draw_linear(world, X_WC)
    camera.release()
    return picture


def test_colours_fade_with_distance_by_their_own_absorption(context):
    at = pose([0, 0, -10])
    middle = (VIEW.height // 2, VIEW.width // 2)
    near = light(context, World([wall(4.0)]), at)[middle]
    far = light(context, World([wall(9.0)]), at)[middle]
    # float32 in the shader, whose exp() is good to some 20 units in the last place.
    assert far / near == pytest.approx(np.exp(-5.0 * np.array(CLEAR.absorption)), rel=1e-5)


def test_daylight_fades_with_depth_by_the_same_absorption(context):
    middle = (VIEW.height // 2, VIEW.width // 2)
    shallow = light(context, World([wall(4.0)]), pose([0, 0, -5]))[middle]
    deep = light(context, World([wall(4.0)]), pose([0, 0, -12]))[middle]
    assert deep / shallow == pytest.approx(np.exp(-7.0 * np.array(CLEAR.absorption)), rel=1e-5)  # as above


def test_a_floor_below_is_lit_from_above_and_a_wall_from_the_side_only(context):
    middle = (VIEW.height // 2, VIEW.width // 2)
    facing = light(context, World([wall(4.0)]), pose([0, 0, -5]))[middle]
    # The same rectangle turned with the camera by 90 deg, so that only its direction to the light differs.
    floor = wall(4.0)
    floor.X_WB = pose([0, 0, -5], (0, 90, 0))
    down = light(context, World([floor]), pose([0, 0, -5], (0, 90, 0)))[middle]
    deeper = np.exp(-4.0 * np.array(CLEAR.absorption))  # of the floor, 4 m below the camera
    assert down / facing / deeper == pytest.approx(np.full(3, 1 / 0.4), rel=1e-5)  # all light over the diffuse share


def test_far_away_a_wall_is_open_water(context):
    murky = Water(absorption=(0.3, 0.2, 0.2), scattering=0.3, surface=0.0)
    at = pose([0, 0, -5])
    hidden, water = light(context, World([wall(60.0)]), at, murky), light(context, World(), at, murky)
    middle = (VIEW.height // 2, VIEW.width // 2)
    # 30 optical lengths hide the wall: e^-30 is below float32; exp() as above.
    assert hidden[middle] == pytest.approx(water[middle], rel=1e-5)


def test_left_is_left_and_up_is_up(context):
    box = wall(6.0, y=(1.0, 2.0), z=(0.5, 1.5))  # to the left of the axis and above it, in the world's frame
    box.X_WB = pose([0, 0, -10])
    picture = light(context, World([box]), pose([0, 0, -10]))
    rows, columns = np.nonzero(picture.sum(axis=2))
    assert columns.max() < VIEW.width / 2
    assert rows.max() < VIEW.height / 2


def test_far_from_the_origin_the_picture_is_the_same(context):
    def picture(origin):
        body = wall(6.0, y=(-1.0, 2.0), z=(-1.0, 1.5))
        body.X_WB = pose(np.array([0, 0, -10.0]) + origin)
        return light(context, World([body]), pose(np.array([0, 0, -10.0]) + origin))

    assert np.array_equal(picture(np.zeros(3)), picture(np.array([5e5, 4.65e6, 0.0])))


def test_a_picture_is_exposed_so_that_little_of_it_is_white(context):
    camera = Camera(context, VIEW, Water())
    picture = camera.draw(World([wall(5.0)]), pose([0, 0, -40]))
    camera.release()
    assert picture.shape == (61, 81, 3)
    assert 150 < picture.max(axis=2).mean() < 255  # 0.7 of full scale is 217 in sRGB; the wall fills the picture
    assert np.mean(picture == 255) < 0.02
