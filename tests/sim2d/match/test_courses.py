"""Obstacle courses: what is drawn, what counts as a way, and drives by what the camera shows."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.avoidance import Steering, SteeringSettings
from robocup_vision.geometry import Pose2
from sim2d.match.courses import PRINTED_PERCEPTION, Course, cube_course, drive_course, nearest_seen_m, pocket_course
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.scene import Box, Scene
from sim2d.robot_link import RobotLimits

FIELD = load_field("ssl_2001")
RADIUS = 0.09
LIMITS = RobotLimits(speed_mps=0.8, acceleration_mps2=1.2)
START, GOAL = Pose2(-1.0, 0.0, 0.4), (1.0, 0.0)


@settings(max_examples=15)
@given(st.integers(0, 2**32 - 1), st.sampled_from([cube_course, pocket_course]))
def test_courses_stand_on_the_field_clear_of_start_and_goal_and_repeat(seed, draw):
    course = draw(FIELD, RADIUS, np.random.default_rng(seed))
    scene = Scene(FIELD, boxes=course.boxes)
    for place in (course.start.array[:2], course.goal):
        assert scene.clearance_m(*place) > RADIUS
    again = draw(FIELD, RADIUS, np.random.default_rng(seed))
    assert (again.boxes, again.start, again.goal) == (course.boxes, course.start, course.goal)
    if draw is cube_course:
        assert 5 <= len(course.boxes) <= 10
        assert all(FIELD.contains(box.corners).all() for box in course.boxes)


def test_a_field_without_room_is_refused():
    small = SimpleNamespace(
        name="small", length_m=0.6, width_m=0.4, contains=lambda points: np.zeros(len(points), bool)
    )
    with pytest.raises(ArgumentError, match="field 'small' has no room for"):
        cube_course(small, RADIUS, np.random.default_rng(1))


@pytest.mark.parametrize("slack_m", [-0.02, 0.02])
def test_a_gap_is_a_route_when_the_robot_fits_with_its_clearance(slack_m):
    gap_m = 2 * (RADIUS + 0.03) + slack_m
    half_m = FIELD.width_m / 2
    length_m = half_m - gap_m / 2
    boxes = tuple(Box(0.0, side * (gap_m + length_m) / 2, 0.0, 0.1, length_m) for side in (-1, 1))
    course = Course(FIELD, boxes, START, GOAL)
    assert course.has_route(RADIUS) == (slack_m > 0)
    assert course.has_route(RADIUS, clearance_m=0.0)


def test_a_drive_goes_round_a_box_without_touching_it():
    course = Course(FIELD, (Box(0.0, 0.02),), START, GOAL)
    camera, seen = sekimori_camera(), []
    radius = nearest_seen_m(FIELD, camera)
    assert RADIUS < radius < RADIUS + 0.03
    pilot = Steering(radius, LIMITS, SteeringSettings(keep_side=False))
    drive = drive_course(course, pilot, camera, LIMITS, np.random.default_rng(3), patience_s=8.0, watch=seen.append)
    assert not drive.collided
    assert drive.seconds is not None
    assert drive.seconds >= (2.0 - 0.05) / LIMITS.speed_mps
    assert 0.0 < drive.clearance_m < 0.3
    assert math.hypot(seen[-1].x_m - GOAL[0], seen[-1].y_m - GOAL[1]) <= 0.05


def test_a_drive_that_remembers_nothing_is_told_the_targets_own_direction():
    course = Course(FIELD, (), START, GOAL)
    told = []

    def steer(free_space, velocity_mps, target_bearing_rad, target_distance_m, pending_mps):
        told.append((len(free_space.range_m), target_bearing_rad, target_distance_m))
        return SimpleNamespace(velocity_mps=np.zeros(2))

    rng = np.random.default_rng(3)
    pilot = SimpleNamespace(steer=steer)
    drive_course(course, pilot, sekimori_camera(), LIMITS, rng, patience_s=0.2, perception=PRINTED_PERCEPTION)
    x, y = START.inverse().transform(GOAL).tolist()
    assert told
    for directions, bearing_rad, distance_m in told:
        assert directions == PRINTED_PERCEPTION.directions
        assert bearing_rad == pytest.approx(math.atan2(y, x), abs=0.02)
        assert distance_m == pytest.approx(math.hypot(x, y), abs=0.02)


def pilot_at(speed_mps):
    """Drives along the field whatever it sees and is told."""

    def steer(free_space, velocity_mps, target_bearing_rad, target_distance_m, pending_mps):
        towards = np.array([math.cos(START.theta_rad), -math.sin(START.theta_rad)])
        return SimpleNamespace(velocity_mps=speed_mps * towards)

    return SimpleNamespace(steer=steer)


def test_a_collision_ends_the_drive_and_so_does_the_end_of_patience():
    course = Course(FIELD, (Box(-0.6, 0.0),), START, GOAL)
    camera = sekimori_camera()
    hit = drive_course(course, pilot_at(1.0), camera, LIMITS, np.random.default_rng(3), patience_s=4.0)
    assert hit.collided
    assert hit.seconds is None
    assert hit.clearance_m <= 0.0
    waiting = drive_course(course, pilot_at(0.0), camera, LIMITS, np.random.default_rng(3), patience_s=0.5)
    assert not waiting.collided
    assert waiting.seconds is None
    assert waiting.clearance_m == pytest.approx(0.4 - 0.065 - RADIUS, abs=0.01)
