"""One obstacle for each thing that stands on the floor, and none for what is the field's own."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.walls import wall_range_m
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.obstacles import ObstacleFinder, join_places
from robocup_vision.perception.polar_view import PolarView
from robocup_vision.vision import Vision
from sim2d.match.setups import CAMERAS
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import Box, Robot, Scene
from sim2d.rendering.sensor import Sensor

FIELD = load_field("ssl_division_b")
RADIUS = FIELD.robot_radius_m
FINDER = ObstacleFinder(FIELD)
MIRROR = PolarView(CAMERAS["ssl_mirror"]())
AHEAD = FloorView(
    PinholeCamera((320, 240), (300.0, 300.0), (159.5, 119.5), 0.2, pan_rad=0.0, tilt_rad=-0.25, roll_rad=0.0)
)
LOST = NotLocated("none")


def marks_of(view, range_m):
    """Block all from a range on, (K,) metres from the robot, inf: nothing; as tall things do."""
    away = np.hypot(view.floor_m[..., 0], view.floor_m[..., 1])
    blocked = ~(away < range_m[:, None])
    return np.ascontiguousarray(np.where(blocked & np.isfinite(range_m)[:, None], 0, 1).astype(np.uint8))


def bearings_of(view):
    middle = view.floor_m[:, view.columns_in_use // 2]
    return np.arctan2(middle[:, 1], middle[:, 0])


def disc_ranges(view, *discs, behind=math.inf):
    """Range of the first of upright discs (x, y) on each bearing, before what stands `behind`."""
    bearing = bearings_of(view)
    range_m = np.broadcast_to(np.asarray(behind, dtype=np.float64), bearing.shape).copy()
    for x, y in discs:
        along, aside = x * np.cos(bearing) + y * np.sin(bearing), y * np.cos(bearing) - x * np.sin(bearing)
        hit = (np.abs(aside) < RADIUS) & (along > 0)
        near = along - np.sqrt(np.maximum(RADIUS**2 - aside**2, 0))
        range_m = np.where(hit, np.minimum(range_m, near), range_m)
    return range_m


def near_side(x, y):
    away = math.hypot(x, y)
    return np.array([x, y]) * (1 - math.pi / 4 * RADIUS / away)


@given(st.lists(st.tuples(st.integers(0, 7), st.floats(0.35, 0.9)), max_size=6, unique_by=lambda one: one[0]))
def test_discs_that_stand_apart_are_as_many_obstacles(placed):
    discs = [(r * math.cos(n * math.tau / 8), r * math.sin(n * math.tau / 8)) for n, r in placed]
    found = FINDER.find(MIRROR, marks_of(MIRROR, disc_ranges(MIRROR, *discs)), LOST)
    assert len(found) == len(discs)
    for disc in discs:
        nearest = min(found, key=lambda one: math.dist((one.x_m, one.y_m), disc))
        assert math.dist((nearest.x_m, nearest.y_m), near_side(*disc)) < 0.06
        assert nearest.width_m == pytest.approx(2 * RADIUS, abs=2.5 * math.hypot(*disc) * MIRROR.row_step_rad)


@given(st.integers(1, 159), st.floats(0.35, 1.2), st.floats(0.35, 1.2))
def test_obstacles_turn_with_the_picture(turn, first_m, second_m):
    marks = marks_of(MIRROR, disc_ranges(MIRROR, (first_m, 0.0), (-0.2, second_m)))
    before = FINDER.find(MIRROR, marks, LOST)
    after = FINDER.find(MIRROR, np.ascontiguousarray(np.roll(marks, turn, axis=0)), LOST)
    assert len(before) == len(after) == 2
    by = turn * MIRROR.row_step_rad
    for one in before:
        x, y = Pose2(0.0, 0.0, by).transform((one.x_m, one.y_m))
        same = min(after, key=lambda other: math.dist((other.x_m, other.y_m), (x, y)))
        assert (same.x_m, same.y_m) == pytest.approx((x, y), abs=1e-9)
        assert same.width_m == pytest.approx(one.width_m)


def test_an_obstacle_tells_the_bearings_of_its_ends():
    (found,) = FINDER.find(MIRROR, marks_of(MIRROR, disc_ranges(MIRROR, (-0.6, 0.0))), LOST)
    right, left = found.interval_rad
    assert right < found.bearing_rad < left
    assert left - right == pytest.approx(2 * math.asin(RADIUS / 0.6), abs=1.5 * MIRROR.row_step_rad)


@pytest.mark.parametrize("pose", [LOST, PoseEstimate(Pose2(2.5, 1.2, 0.4), np.diag([1e-6] * 3), 1.0, 0.0)])
def test_boards_and_goals_are_none_and_a_robot_before_them_is_one(pose):
    robot = Pose2(2.5, 1.2, 0.4)
    boards = wall_range_m(FIELD.walls, robot, bearings_of(MIRROR))
    assert FINDER.find(MIRROR, marks_of(MIRROR, boards), pose) == ()
    disc = (0.7, -0.5)
    (found,) = FINDER.find(MIRROR, marks_of(MIRROR, disc_ranges(MIRROR, disc, behind=boards)), pose)
    assert math.dist((found.x_m, found.y_m), near_side(*disc)) < 0.04


@pytest.mark.parametrize("slope", [0.0, 0.6, -1.5])
def test_a_camera_that_looks_ahead_sees_robots_before_a_wall_and_no_wall(slope):
    bearing = bearings_of(AHEAD)
    wall = 1.5 / (np.cos(bearing) + slope * np.sin(bearing))
    assert FINDER.find(AHEAD, marks_of(AHEAD, wall), LOST) == ()
    discs = [(0.6, 0.13), (0.7, -0.2)]
    found = FINDER.find(AHEAD, marks_of(AHEAD, disc_ranges(AHEAD, *discs, behind=wall)), LOST)
    assert len(found) == 2
    for disc, one in zip(discs, found, strict=True):
        assert math.dist((one.x_m, one.y_m), near_side(*disc)) < 0.03


def test_one_behind_another_is_a_second_obstacle():
    found = FINDER.find(AHEAD, marks_of(AHEAD, disc_ranges(AHEAD, (0.5, 0.0), (0.8, 0.16))), LOST)
    assert [round(one.x_m, 1) for one in found] == [0.4, 0.7]


def test_paint_specks_and_open_floor_are_none():
    marks = marks_of(AHEAD, np.full(AHEAD.bearings, math.inf))
    assert FINDER.find(AHEAD, marks, LOST) == ()
    # a stripe across, behind which floor is seen, and a post narrower than a quarter of a robot
    marks[:, 60:64] = 0
    marks[80:82, 30:] = 0
    assert FINDER.find(AHEAD, marks, LOST) == ()


def test_paint_that_leads_up_to_a_robot_makes_no_second_one():
    marks = marks_of(AHEAD, disc_ranges(AHEAD, (0.7, 0.0)))
    middle = int(np.argmin(np.abs(bearings_of(AHEAD))))
    marks[middle - 1 : middle + 2, 20:] = 0
    (found,) = FINDER.find(AHEAD, marks, LOST)
    assert math.dist((found.x_m, found.y_m), near_side(0.7, 0.0)) < 0.03


def test_what_is_too_far_to_be_measured_is_left_out():
    far = 0.9 * float(AHEAD.range_m[AHEAD.columns_in_use - 1])
    steps = np.diff(AHEAD.range_m[: AHEAD.columns_in_use])
    assert steps[-1] > 2 * RADIUS
    assert FINDER.find(AHEAD, marks_of(AHEAD, disc_ranges(AHEAD, (far, 0.0))), LOST) == ()


@pytest.mark.parametrize("away_m", [0.8, 4.0])
def test_places_that_are_near_are_joined_and_gaps_part_them(away_m):
    angle = np.arange(160) * math.tau / 160
    places = away_m * np.column_stack([np.cos(angle), np.sin(angle)])
    seen = np.zeros(160, dtype=bool)
    seen[[*range(10, 21), *range(155, 160), *range(3)]] = True
    first, second = sorted(join_places(places, seen, 0.05, math.tau / 160), key=lambda one: one.bearing_rad)
    assert first.bearing_rad == pytest.approx(-1.5 * angle[1])
    assert second.bearing_rad == pytest.approx(angle[15])
    assert second.width_m == pytest.approx(away_m * 11 * math.tau / 160, rel=0.03)


def test_a_rendered_box_is_found_where_it_stands(ssl_field, paper_camera):
    pose, box = Pose2(-0.3, -0.1, 0.5), Box(0.3, -0.25, 0.4, color_bgr=(40, 40, 200))
    light = MirrorRenderer(paper_camera, 2).render(Scene(ssl_field, boxes=(box,)), pose)
    frame = Sensor(noise_sigma=6.0, blur_px=0.7).expose(light, np.random.default_rng(0))
    view = Vision(ssl_field, paper_camera).look(frame)
    (found,) = view.obstacles
    x, y = pose.inverse().transform([box.x_m, box.y_m])
    assert math.hypot(found.x_m - x, found.y_m - y) < 0.1
    assert 0.1 < found.width_m < 0.3
    empty = dataclasses.replace(view, marks=np.ones_like(view.marks))
    assert empty.obstacles == ()


@pytest.mark.parametrize("away_m", [0.5, 0.7, 0.9])
def test_a_dark_robot_in_a_picture_stands_where_it_is(ssl_field, paper_camera, away_m):
    pose = Pose2(-0.5, 0.0, 0.3)
    robot = Robot(pose.x_m + away_m, pose.y_m, RADIUS)
    light = MirrorRenderer(paper_camera, 2).render(Scene(ssl_field, robots=(robot,)), pose)
    frame = Sensor(noise_sigma=6.0, blur_px=0.7).expose(light, np.random.default_rng(0))
    place = pose.inverse().transform([robot.x_m, robot.y_m])
    obstacles = Vision(ssl_field, paper_camera).look(frame).obstacles
    found = min(obstacles, key=lambda one: math.dist((one.x_m, one.y_m), place))
    # a sample is 0.02 to 0.06 m deep there
    assert math.dist((found.x_m, found.y_m), near_side(*place)) < 0.025
