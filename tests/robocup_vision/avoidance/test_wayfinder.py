"""Ways over the floor seen lately: straight ones, out of pockets, through what opens and not through what is shut."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.avoidance import Wayfinder
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace

RADIUS = 0.1
COUNT = 72
BEARING = (np.arange(COUNT) + 0.5) * math.tau / COUNT - math.pi
STILL = Pose2(0.0, 0.0, 0.0)
ROOM = [((-2, -1.5), (2, -1.5)), ((2, -1.5), (2, 1.5)), ((2, 1.5), (-2, 1.5)), ((-2, 1.5), (-2, -1.5))]
POCKET = [((0.5, -0.4), (0.5, 0.4)), ((0.5, 0.4), (-0.2, 0.4)), ((0.5, -0.4), (-0.2, -0.4))]


def seen_from(pose, walls):
    """Free ranges as a camera gives them: of each sector the nearest."""
    angle = (BEARING[:, None] + np.linspace(-0.5, 0.5, 7) * math.tau / COUNT).ravel() + pose.theta_rad
    reach = np.full(len(angle), np.inf)
    for (ax, ay), (bx, by) in walls:
        ex, ey, ox, oy = bx - ax, by - ay, ax - pose.x_m, ay - pose.y_m
        with np.errstate(divide="ignore", invalid="ignore"):
            across = np.cos(angle) * ey - np.sin(angle) * ex
            t, u = (ox * ey - oy * ex) / across, (ox * np.sin(angle) - oy * np.cos(angle)) / across
        reach = np.where((t > 0) & (u >= 0) & (u <= 1), np.minimum(reach, t), reach)
    return FreeSpace(BEARING, reach.reshape(COUNT, 7).min(axis=1))


def gap(pose, walls):
    """Distance of the robot's centre from the nearest wall."""
    least = math.inf
    for a, b in np.array(walls, dtype=float):
        along = np.clip(np.dot(pose.array[:2] - a, b - a) / np.dot(b - a, b - a), 0, 1)
        least = min(least, float(np.hypot(*(pose.array[:2] - a - along * (b - a)))))
    return least


def walk(start, goal, walls, steps=600, turn_rad=0.02, step_m=0.02):
    """Go where the way leads but into nothing, as steering does; the places, until the goal is reached."""
    way, pose, motion = Wayfinder(RADIUS), start, STILL
    places = [start]
    for _ in range(steps):
        way.update(seen_from(pose, walls), motion)
        there = pose.inverse().transform(goal)
        if np.hypot(*there) < 0.05:
            break
        heading = way.head(math.atan2(there[1], there[0]), float(np.hypot(*there)))
        for aside in (0, 0.3, -0.3, 0.6, -0.6, 1.0, -1.0, 1.4, -1.4):
            angle = heading.bearing_rad + aside
            motion = Pose2(step_m * math.cos(angle), step_m * math.sin(angle), turn_rad)
            if gap(pose.compose(motion), walls) > RADIUS:
                break
        else:
            motion = Pose2(0.0, 0.0, turn_rad)
        pose = pose.compose(motion)
        places.append(pose)
    return places


@given(st.floats(-4, 4), st.floats(0.0, 30.0), st.floats(-4, 4))
def test_over_open_floor_it_is_straight_however_far(bearing, distance, turned):
    way = Wayfinder(RADIUS)
    way.update(FreeSpace(BEARING, np.full(COUNT, np.inf)), Pose2(0.0, 0.0, turned))
    heading = way.head(bearing, distance)
    assert heading.straight
    assert heading.bearing_rad == bearing
    assert heading.distance_m == distance


@pytest.mark.parametrize("turn_rad", [0.0, 0.05])
@pytest.mark.parametrize("y", [-0.1, 0.0, 0.1])
def test_it_leaves_a_pocket_and_arrives(y, turn_rad):
    walls = ROOM + POCKET
    places = walk(Pose2(-1.5, y, 0.3), (1.5, -y), walls, turn_rad=turn_rad)
    assert np.hypot(places[-1].x_m - 1.5, places[-1].y_m + y) < 0.05
    # seen from outside already, or at least never twice
    assert sum(0.2 < p.x_m < 0.5 and abs(p.y_m) < 0.4 for p in places) < 60


@pytest.mark.parametrize(("width_m", "through"), [(0.3, True), (0.17, False)])
def test_it_goes_through_what_is_wide_enough_and_round_what_is_not(width_m, through):
    post = width_m / 2
    walls = [*ROOM, ((0.0, post), (0.0, 0.9)), ((0.0, -post), (0.0, -1.5))]
    places = walk(Pose2(-1.2, 0.0, 0.0), (1.2, 0.0), walls)
    assert np.hypot(places[-1].x_m - 1.2, places[-1].y_m) < 0.05
    crossing = next(p.y_m for p in places if p.x_m > 0.0)
    assert (abs(crossing) < post) == through


def test_far_is_forgotten_and_near_goes_along():
    way = Wayfinder(RADIUS, window_m=2.0)

    def see(view, motion):
        # of three views it reads one
        for moved in (motion, STILL, STILL):
            way.update(view, moved)

    see(seen_from(STILL, [((0.4, -0.5), (0.4, 0.5))]), STILL)
    assert not way.head(0.0, 0.9).straight
    blind = FreeSpace(BEARING, np.full(COUNT, np.nan))
    # to its other side, by which the window has moved on
    see(blind, Pose2(0.0, 0.6, 0.0))
    see(blind, Pose2(0.8, -0.6, math.pi))
    assert not way.head(0.0, 0.9).straight
    assert way.head(math.pi, 0.9).straight
    see(blind, Pose2(-2.0, 0.0, 0.0))
    see(blind, Pose2(2.0, 0.0, 0.0))
    assert way.head(0.0, 0.9).straight


def test_forgetting_opens_all_ways():
    way = Wayfinder(RADIUS)
    way.update(seen_from(STILL, [((0.4, -0.5), (0.4, 0.5))]), STILL)
    assert not way.head(0.0, 0.9).straight
    way.forget()
    assert way.head(0.0, 0.9).straight


def test_a_place_that_is_not_got_through_is_given_up_for_another():
    """Something that no view shows stops the robot in the nearer of two gaps."""
    walls = [*ROOM, ((0.0, 0.14), (0.0, 0.9)), ((0.0, -0.14), (0.0, -1.5))]
    way, pose = Wayfinder(RADIUS), Pose2(-0.15, 0.0, 0.0)
    bearings = []
    for _ in range(300):
        way.update(seen_from(pose, walls), STILL)
        bearings.append(way.head(0.0, 1.2).bearing_rad)
    assert abs(bearings[0]) < 0.3
    assert max(abs(bearing) for bearing in bearings) > 1.0


def test_who_goes_another_way_or_comes_to_a_turn_slows_down_first():
    way = Wayfinder(RADIUS)
    way.update(FreeSpace(BEARING, np.full(COUNT, np.inf)), STILL)
    assert way.head(0.0, 3.0, (0.4, 0.0)).distance_m == 3.0
    assert way.head(0.0, 3.0, (0.0, 0.4)).distance_m == pytest.approx(RADIUS / math.sqrt(2))
    assert way.head(0.0, 3.0, (-0.4, 0.0)).distance_m == pytest.approx(RADIUS / 2)
    way.forget()
    way.update(seen_from(STILL, [((0.4, -0.5), (0.4, 0.5))]), STILL)
    round_it = way.head(0.0, 0.9)
    assert 0.4 < abs(round_it.bearing_rad) < 1.6
    assert 0.4 < round_it.distance_m < 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"robot_radius_m": 0.0}, "robot_radius_m must be at least 1e-06, got 0.0"),
        ({"robot_radius_m": math.nan}, "robot_radius_m must be finite, got nan"),
        ({"window_m": 0.5}, "window_m must be at least 8 radii of the robot, got 0.5"),
    ],
)
def test_bad_parameters_of_a_wayfinder_are_named(change, message):
    with pytest.raises(ArgumentError, match=message):
        Wayfinder(**{"robot_radius_m": RADIUS, **change})


def test_bad_views_and_goals_are_named():
    way = Wayfinder(RADIUS)
    for bearing, reach in ((np.zeros(1), np.zeros(1)), (np.zeros(4), np.zeros(3))):
        with pytest.raises(ArgumentError, match="free space needs"):
            way.update(SimpleNamespace(bearing_rad=bearing, range_m=reach), STILL)
    for bearing, distance, message in (
        (math.nan, 1.0, "target_bearing_rad must be finite"),
        (45.0, 1.0, "45 degrees are 0.7854 rad"),
        (0.0, -1.0, "target_distance_m must not be negative"),
        (0.0, math.inf, "target_distance_m must be finite"),
    ):
        with pytest.raises(ArgumentError, match=message):
            way.head(bearing, distance)
