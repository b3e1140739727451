"""Blocked stretches become things with a place and a width."""

import dataclasses
import math

import numpy as np
import pytest

from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor.stretches import stands_free
from robocup_vision.perception.obstacles import join_places
from robocup_vision.vision import Vision
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import Box, Scene
from sim2d.rendering.sensor import Sensor

COUNT, COLUMNS = 160, 40
ANGLES = np.arange(COUNT) * math.tau / COUNT
RANGES = np.linspace(0.1, 2.05, COLUMNS)
FLOOR = np.stack([np.cos(ANGLES)[:, None] * RANGES, np.sin(ANGLES)[:, None] * RANGES], axis=-1)
NO_WALL = np.zeros(COUNT, dtype=bool)


def find_obstacles(floor_m, column, is_wall, gap_m):
    """Join what stands free; a wall is predicted before everything where one is known."""
    places = floor_m[np.arange(COUNT), np.minimum(column, COLUMNS - 1)]
    free = np.empty(COUNT, dtype=bool)
    stands_free(column, np.arange(1.0, COLUMNS + 1), np.where(is_wall, 0.0, np.nan), 0.5, places, free)
    return join_places(places, free, gap_m, math.tau / COUNT)


def blocked(*stretches):
    column = np.full(COUNT, COLUMNS)
    for first, last, m in stretches:
        column[np.arange(first, last) % COUNT] = m
    return column


def test_a_stretch_is_one_thing_in_its_middle():
    (found,) = find_obstacles(FLOOR, blocked((10, 21, 18)), NO_WALL, 0.05)
    assert found.bearing_rad == pytest.approx(ANGLES[15])
    assert found.range_m == pytest.approx(RANGES[18], rel=0.02)
    assert found.width_m == pytest.approx(RANGES[18] * 11 * math.tau / COUNT, rel=0.03)
    assert (found.x_m, found.y_m) == pytest.approx(
        (found.range_m * math.cos(found.bearing_rad), found.range_m * math.sin(found.bearing_rad))
    )


def test_a_stretch_across_row_zero_is_one_thing():
    (found,) = find_obstacles(FLOOR, blocked((-5, 6, 18)), NO_WALL, 0.05)
    assert found.bearing_rad == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("turn", [0, 37, 155])
def test_things_turn_with_the_picture(turn):
    column = blocked((10, 20, 18), (20, 30, 30), (60, 70, 5))
    before = find_obstacles(FLOOR, column, NO_WALL, 0.05)
    after = find_obstacles(FLOOR, np.roll(column, turn), NO_WALL, 0.05)
    assert len(before) == len(after) == 3
    turned = sorted((o.range_m, o.width_m) for o in after)
    np.testing.assert_allclose(turned, sorted((o.range_m, o.width_m) for o in before))


def test_walls_and_open_floor_are_no_things():
    assert find_obstacles(FLOOR, blocked(), NO_WALL, 0.05) == ()
    assert find_obstacles(FLOOR, blocked((10, 20, 18)), ~NO_WALL, 0.05) == ()
    wall = NO_WALL.copy()
    wall[:15] = True
    (left,) = find_obstacles(FLOOR, blocked((10, 20, 18)), wall, 0.05)
    assert left.bearing_rad == pytest.approx(ANGLES[15:20].mean())


def test_places_beyond_the_horizon_are_no_things():
    sky = FLOOR.copy()
    sky[:, 30:] = np.nan
    assert find_obstacles(sky, blocked((10, 20, 35)), NO_WALL, 0.05) == ()


def test_a_ring_all_around_is_one_thing():
    (found,) = find_obstacles(FLOOR, blocked((0, COUNT, 10)), NO_WALL, 0.05)
    assert math.hypot(found.x_m, found.y_m) < 0.01


def test_a_rendered_box_is_found_where_it_stands(ssl_field, paper_camera):
    pose, box = Pose2(-0.3, -0.1, 0.5), Box(0.3, 0.2, 0.4, color_bgr=(40, 40, 200))
    light = MirrorRenderer(paper_camera, 2).render(Scene(ssl_field, boxes=(box,)), pose)
    frame = Sensor(noise_sigma=6.0, blur_px=0.7).expose(light, np.random.default_rng(0))
    view = Vision(ssl_field, paper_camera).look(frame)
    x, y = pose.inverse().transform([box.x_m, box.y_m])
    near = [o for o in view.obstacles if math.hypot(o.x_m - x, o.y_m - y) < 0.15]
    assert 0.08 < max(o.width_m for o in near) < 0.3
    assert len(near) == len(view.obstacles)
    empty = dataclasses.replace(view, marks=np.ones_like(view.marks))
    assert empty.obstacles == ()
