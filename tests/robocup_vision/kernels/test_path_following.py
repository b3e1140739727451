"""Path following against plain NumPy: the path's points, the odometry's covariance, the worst clearance."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steering_twins import plain_positions

from robocup_vision.geometry import Pose2, compose_covariance
from robocup_vision.kernels import path_following as kernels

seeds = st.integers(0, 2**32 - 1)
PATH = np.array([[0.0, 0.0], [1.0, 0.2], [1.0, 0.2], [1.5, -0.4], [3.0, 0.0]])
LENGTH = np.hypot(*np.diff(PATH, axis=0).T).sum()


def fine_path(count=20001):
    ends = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(PATH, axis=0).T))])
    arcs = np.linspace(0.0, LENGTH, count)
    return arcs, np.stack([np.interp(arcs, ends, PATH[:, k]) for k in (0, 1)], axis=1)


@settings(deadline=None, max_examples=50)
@given(st.floats(-1, 4), st.floats(-1, 1))
def test_the_nearest_point_is_nearer_than_all_others(x, y):
    arcs, points = fine_path()
    away = np.hypot(*(points - (x, y)).T)
    arc, nearest, length = kernels.nearest_on_path(PATH, (x, y))
    assert length == pytest.approx(LENGTH)
    assert nearest == pytest.approx(away.min(), abs=1e-4)
    assert np.hypot(*(np.array(kernels.point_on_path(PATH, arc)) - (x, y))) == pytest.approx(nearest)
    index = np.searchsorted(arcs, arc)
    np.testing.assert_allclose(kernels.point_on_path(PATH, arc), points[min(index, len(points) - 1)], atol=2e-4)


def test_the_command_leads_to_the_point_ahead_and_to_rest_at_the_end():
    x, y = kernels.follow(PATH, (0.0, 0.1), 0.8, 0.3, 1.2)
    ahead = np.array(kernels.point_on_path(PATH, kernels.nearest_on_path(PATH, (0.0, 0.1))[0] + 0.3)) - (0.0, 0.1)
    assert math.hypot(x, y) == pytest.approx(0.8)
    assert math.atan2(y, x) == pytest.approx(math.atan2(ahead[1], ahead[0]))
    assert kernels.follow(PATH, (3.0, 0.0), 0.8, 0.3, 1.2) == (0.0, 0.0)
    near = math.hypot(*kernels.follow(PATH, (2.99, 0.0), 0.8, 0.3, 1.2))
    assert 0.0 < near <= 0.1
    # past the end it comes back at a speed from which it can stop there
    assert kernels.follow(PATH, (3.2, 0.0), 0.8, 0.3, 1.2)[0] < -0.3


def test_a_robot_that_follows_arrives_at_rest():
    place, velocity, pending = (0.0, 0.4), (0.0, 0.0), (0.0, 0.0)
    fastest = 0.0
    for _ in range(300):
        target = kernels.follow(PATH, place, 1.0, 0.35, 2.0)
        place, velocity = kernels.drive(place, velocity, pending, target, 2.0, 0.03, 1 / 30)
        pending = target
        fastest = max(fastest, math.hypot(*velocity))
    np.testing.assert_allclose(place, PATH[-1], atol=0.003)
    assert math.hypot(*velocity) < 0.02
    assert 0.95 < fastest <= 1.0 + 1e-9


@settings(deadline=None, max_examples=50)
@given(seeds)
def test_a_period_is_the_dead_time_with_the_old_command_and_the_rest_with_the_new(seed):
    place, velocity, pending, target = map(tuple, np.random.default_rng(seed).uniform(-1, 1, (4, 2)))
    by_old = plain_positions(place, velocity, pending, 1.5, np.array([0.0, 0.0199999, 0.02]))
    then = (by_old[2] - by_old[1]) / 1e-7
    found, moving = kernels.drive(place, velocity, pending, target, 1.5, 0.02, 0.05)
    by_new = plain_positions(tuple(by_old[2]), tuple(then), target, 1.5, np.array([0.03, 0.0299999]))
    np.testing.assert_allclose(found, by_new[0], atol=1e-5)
    np.testing.assert_allclose(moving, (by_new[0] - by_new[1]) / 1e-7, atol=1e-4)


@settings(deadline=None, max_examples=50)
@given(seeds)
def test_the_spread_is_that_of_composed_poses(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(0, 0.1, (3, 3))
    covariance, moved = root @ root.T, rng.uniform(-1, 1, 2)
    way = math.hypot(*moved)
    along = Pose2(0.0, 0.0, math.atan2(moved[1], moved[0]))
    slip = np.diag([(0.05 * way) ** 2, (0.2 * way) ** 2, 0.0])
    turned = compose_covariance(along, np.zeros((3, 3)), Pose2(way, 0.0, 0.0), slip)
    # odometry in the field's directions: the heading only turns the way
    expected = compose_covariance(Pose2(0, 0, 0), covariance, Pose2(*moved, 0.0), turned)
    xx, xy, yy = kernels.spread(covariance, (0.05, 0.2), tuple(moved))
    np.testing.assert_allclose([[xx, xy], [xy, yy]], expected[:2, :2], atol=1e-12)


def plain_clearance(
    path, place, velocity, pending, covariance, speed, ahead, acceleration, dead, period, looks, slip, discs
):
    """Both parts, straight from their definition, three deviations."""
    here, moving, obeyed = place, velocity, pending
    least, at = math.inf, np.zeros((2, 2))
    given = []
    for x, y, radius, a, b, c in discs:
        way = np.subtract((x, y), place)
        unit = way / np.hypot(*way)
        both = np.add(covariance[:2, :2], [[a, b], [b, c]])
        given.append(max(radius + 3 * math.sqrt(unit @ both @ unit) - np.hypot(*way), 0.0))
    for _ in range(max(1, round(looks / period))):
        target = kernels.follow(path, here, speed, ahead, acceleration)
        here, moving = kernels.drive(here, moving, obeyed, target, acceleration, dead, period)
        obeyed = target
        xx, xy, yy = kernels.spread(covariance, slip, tuple(np.subtract(here, place)))
        at = np.array([[xx, xy], [xy, yy]])
        for (x, y, radius, a, b, c), more in zip(discs, given, strict=True):
            way = np.subtract((x, y), here)
            unit = way / np.hypot(*way)
            least = min(
                least, more + np.hypot(*way) - radius - 3 * math.sqrt(unit @ np.add(at, [[a, b], [b, c]]) @ unit)
            )
    values, vectors = np.linalg.eigh(at)
    for sign, at_once in itertools.product((-1, 1), (False, True)):
        worst, worst_moving, worst_obeyed = here + sign * 3 * math.sqrt(values[1]) * vectors[:, 1], moving, obeyed
        worst, back, t = tuple(worst), at_once, 0.0
        while not (back and worst_moving == (0.0, 0.0)):
            back = back or kernels.nearest_on_path(path, worst)[1] <= 0.01 or t >= 3.0
            target = (0.0, 0.0) if back else kernels.follow(path, worst, speed, ahead, acceleration)
            worst, worst_moving = kernels.drive(worst, worst_moving, worst_obeyed, target, acceleration, dead, period)
            worst_obeyed, t = target, t + period
            for (x, y, radius, a, b, c), more in zip(discs, given, strict=True):
                doubt = np.linalg.eigvalsh([[a, b], [b, c]])[1]
                grown = radius + 3 * (math.sqrt(values[1] + doubt) - math.sqrt(values[1]))
                least = min(least, more + math.dist((x, y), worst) - grown)
    return least


@settings(deadline=None, max_examples=25)
@given(seeds)
def test_the_least_clearance_is_that_of_its_definition(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(0, 0.03, (3, 3))
    covariance = root @ root.T
    place, velocity = tuple(rng.uniform(-0.1, 0.1, 2)), tuple(rng.uniform(-0.5, 0.5, 2))
    discs = np.array([(*rng.uniform((0, -0.6), (2.5, 0.6)), 0.18, 4e-4, 1e-4, 2e-4) for _ in range(4)])
    speed = rng.uniform(0.2, 1.2)
    numbers = (speed, 0.4, 1.5, 0.03, 1 / 30, 0.5, (0.05, 0.1))
    found, which = kernels.least_clearance(PATH, place, velocity, velocity, covariance, *numbers, discs, 3.0)
    plain = plain_clearance(PATH, place, velocity, velocity, covariance, *numbers, discs)
    assert found == pytest.approx(plain, abs=1e-9)
    alone = kernels.least_clearance(
        PATH, place, velocity, velocity, covariance, *numbers, discs[which : which + 1], 3.0
    )
    assert alone[0] == pytest.approx(found)


def test_without_discs_there_is_no_end_of_room():
    numbers = (1.0, 0.4, 1.5, 0.03, 1 / 30, 0.5, (0.05, 0.1))
    nothing = kernels.least_clearance(
        PATH, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), np.eye(3), *numbers, np.empty((0, 6)), 3.0
    )
    assert nothing == (math.inf, -1)
