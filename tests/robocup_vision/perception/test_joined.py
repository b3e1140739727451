"""What several cameras show together: free floor of the one that sees it, and each ball and each thing once."""

import math

import numpy as np
import pytest

from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.perception.joined import (
    SeenFloor,
    join_balls,
    join_free_space,
    join_obstacles,
    move_ball,
    move_obstacle,
)
from robocup_vision.perception.obstacles import Obstacle


def floor(first, last, count, range_m, nearest_m, farthest_m=5.0):
    step = (last - first) / count
    bearing = first + (np.arange(count) + 0.5) * step
    space = FreeSpace(bearing, np.full(count, range_m))
    return SeenFloor(space, np.full(count, nearest_m), np.full(count, farthest_m))


def at(space, bearing_rad):
    return space.range_m[np.argmin(np.abs(space.bearing_rad - bearing_rad))]


def test_each_direction_is_of_the_camera_that_sees_it_and_unknown_where_none_does():
    ahead, left = floor(-0.7, 0.7, 60, 2.0, 0.3), floor(0.9, 2.2, 60, 1.0, 0.3)
    space = join_free_space([ahead, left], 80)
    assert np.all(np.diff(space.bearing_rad) > 0)
    assert at(space, 0.0) == 2.0
    assert at(space, 1.5) == 1.0
    assert math.isnan(at(space, -2.0))


def test_where_two_see_the_nearer_end_counts():
    space = join_free_space([floor(-1, 1, 60, 2.0, 0.3), floor(-1, 1, 60, 1.2, 0.3)], 80)
    assert at(space, 0.0) == 1.2


def test_a_camera_that_sees_nearer_floor_tells_how_near_a_thing_stands():
    # the far-sighted one only knows that its nearest floor, at half a metre, is hidden
    near, far = floor(-1, 1, 60, 0.45, 0.2), floor(-1, 1, 60, 0.0, 0.5)
    assert at(join_free_space([near, far], 80), 0.0) == 0.45
    assert at(join_free_space([far, near], 80), 0.0) == 0.45
    # and what the near-sighted one alone can see blocks
    assert at(join_free_space([floor(-1, 1, 60, 0.3, 0.2), floor(-1, 1, 60, 3.0, 0.5)], 80), 0.0) == 0.3
    # without another one nothing is free
    assert at(join_free_space([far], 80), 0.0) == 0.0


def test_a_picture_that_ends_does_not_end_the_floor():
    short = floor(-1, 1, 60, 1.4, 0.2, farthest_m=1.4)
    assert at(join_free_space([short, floor(-1, 1, 60, 2.6, 0.2)], 80), 0.0) == 2.6
    assert at(join_free_space([short, floor(-1, 1, 60, 1.1, 0.2)], 80), 0.0) == 1.1
    assert at(join_free_space([short], 80), 0.0) == 1.4


def test_the_rim_of_a_picture_counts_where_no_other_one_reaches():
    rim = floor(-0.02, 2.0, 60, 2.0, 0.3)
    rim.free_space.range_m[0] = 0.9
    other = floor(-1.0, 1.0, 60, 2.0, 0.3)
    assert at(join_free_space([rim, other], 80), 0.0) == 2.0
    assert at(join_free_space([rim, floor(-1.0, -0.1, 60, 2.0, 0.3)], 80), 0.0) == 0.9


def test_a_picture_that_reaches_across_the_back_goes_around():
    space = join_free_space([floor(math.pi - 0.5, math.pi + 0.5, 60, 1.5, 0.2)], 80)
    assert at(space, 3.0) == at(space, -3.0) == 1.5


def ball(x, y, nats, std=0.05):
    return Ball(x, y, np.diag([std**2, std**2]), 10.0, 20.0, nats)


def test_a_ball_that_two_cameras_show_is_one():
    (one,) = join_balls([[ball(1.0, 0.0, 9.0)], [ball(1.06, 0.02, 12.0)]])
    assert one.log_likelihood_ratio == 12.0
    assert (one.x_m, one.y_m) == (pytest.approx(1.03), pytest.approx(0.01))
    assert one.covariance[0, 0] == pytest.approx(0.05**2 / 2, rel=0.02)


def test_balls_whose_error_lies_along_the_ray_alone_are_joined():
    ray = np.array([1.0, 0.0])
    one = Ball(1.0, 0.0, 0.01 * np.outer(ray, ray), 10.0, 20.0, 9.0)
    (both,) = join_balls([[one], [Ball(1.05, 0.0, 0.01 * np.outer(ray, ray), 10.0, 20.0, 8.0)]])
    assert both.x_m == pytest.approx(1.025)


def test_balls_apart_and_two_of_one_camera_stay_two_the_likeliest_first():
    assert [b.x_m for b in join_balls([[ball(1.0, 0.0, 9.0)], [ball(2.0, 0.0, 12.0)]])] == [2.0, 1.0]
    assert len(join_balls([[ball(1.0, 0.0, 9.0), ball(1.02, 0.0, 8.0)], []])) == 2


def thing(x, y, width=0.3):
    return Obstacle(x, y, width, math.atan2(y, x), math.hypot(x, y))


def test_a_thing_that_two_pictures_cut_is_one_from_end_to_end():
    (one,) = join_obstacles([[thing(1.0, 0.1, 0.3)], [thing(1.02, -0.1, 0.3)]], 0.25)
    assert one.width_m == pytest.approx(0.5, abs=0.03)
    assert one.y_m == pytest.approx(0.0, abs=0.02)


def test_things_apart_stay_two_the_nearest_first():
    assert [t.range_m for t in join_obstacles([[thing(2.0, 0.0)], [thing(1.0, 0.0)]], 0.25)] == [1.0, 2.0]
    assert len(join_obstacles([[thing(1.0, 0.5)], [thing(1.0, -0.5)]], 0.25)) == 2
    # also behind the robot, where bearings jump
    assert len(join_obstacles([[thing(-1.0, 0.01)], [thing(-1.0, -0.01)]], 0.25)) == 1


def test_a_robot_that_moves_sees_the_same_place():
    robot = Pose2(0.3, -0.2, 0.7)
    here, before = move_ball(ball(1.0, 0.4, 9.0), robot), np.array([1.0, 0.4])
    assert robot.transform((here.x_m, here.y_m)) == pytest.approx(before)
    obstacle = move_obstacle(thing(1.0, 0.4), robot)
    assert robot.transform((obstacle.x_m, obstacle.y_m)) == pytest.approx(before)
    assert obstacle.range_m == pytest.approx(math.hypot(obstacle.x_m, obstacle.y_m))
