"""Cameras along a goal's arc against single fits, and what they are made of against plain NumPy."""

import numpy as np
import pytest
from goal_twins import SCENE, SHAPE, perfect_samples, some_camera

from robocup_vision.kernels.goal.fit import FitLoss, FitPriors, fit_goal
from robocup_vision.kernels.goal.lines.arc import ArcCameras, ArcLimits, invert_information, trace_arc, turn_camera

SCALES = np.full(4, 0.3)
LOSS = FitLoss(SCALES, SCALES, False)
# the heading, the height and the focal length are held
HELD = np.array([0, 0, np.inf, 0, 100.0, np.inf, np.inf, 44.0])


def noisy(seed):
    rng = np.random.default_rng(seed)
    p = some_camera(rng)
    p[[5, 6, 7]] = 0.185, 0.0, 0.0
    samples = perfect_samples(p)
    return p, samples._replace(uv=samples.uv + rng.normal(0, 0.1, samples.uv.shape))


def turned(p, turn_rad):
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    middle = np.array([SHAPE.line_x_m, 0.0])
    place = middle + np.array([[c, -s], [s, c]]) @ (p[:2] - middle)
    return np.array([*place, p[2] + turn_rad, *p[3:]])


def fitted(samples, start):
    p, information = start.copy(), np.zeros((8, 8))
    cost = fit_goal(SCENE, samples, FitPriors(np.zeros(8), HELD), LOSS, p, information)
    return p, cost, information


def inverted(information):
    covariance = np.linalg.inv(information)
    covariance[np.isinf(HELD)] = 0.0
    covariance[:, np.isinf(HELD)] = 0.0
    return covariance


def plain_arc(samples, start, limits):
    distance = np.hypot(SHAPE.line_x_m - start[0], start[1])
    middle = fitted(samples, start)
    least, cameras = middle[1], [middle]
    for sign in (-1.0, 1.0):
        at, step, rotated = middle, limits.first_step_m, 0.0
        while True:
            step = min(limits.max_step_m, step)
            rotated += step / distance
            at = fitted(samples, turned(at[0], sign * step / distance))
            if rotated > limits.max_turn_rad or at[0][0] > SHAPE.line_x_m or at[1] > least + limits.max_rise:
                break
            least = min(least, at[1])
            cameras.append(at)
            step *= limits.growth
    return sorted(cameras, key=lambda camera: camera[0][2])


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("max_rise", [12.0, 1e6])
def test_an_arc_is_that_of_single_fits(seed, max_rise):
    p, samples = noisy(seed)
    limits = ArcLimits(max_rise, 1.2, 0.05, 1.2, 0.25)
    room = ArcCameras(np.empty((129, 8)), np.empty((129, 8, 8)), np.empty(129))
    begin, end = trace_arc(SCENE, samples, FitPriors(np.zeros(8), HELD), LOSS, p, limits, room)
    plain = plain_arc(samples, p, limits)
    assert end - begin == len(plain)
    np.testing.assert_allclose(room.unknowns[begin:end], [camera[0] for camera in plain], atol=1e-8)
    np.testing.assert_allclose(room.cost[begin:end], [camera[1] for camera in plain], rtol=1e-6)
    covariance = np.array([inverted(camera[2]) for camera in plain])
    np.testing.assert_allclose(room.covariance[begin:end], covariance, atol=1e-6 * np.abs(covariance).max())


def test_what_is_held_has_no_variance_and_what_is_open_no_inverse():
    information = fitted(*reversed(noisy(1)))[2]
    covariance = np.empty((8, 8))
    assert invert_information(information, HELD, covariance)
    np.testing.assert_allclose(covariance, inverted(information), atol=1e-9 * np.abs(covariance).max())
    assert not covariance[np.isinf(HELD)].any()
    assert not invert_information(np.zeros((8, 8)), HELD, covariance)


def test_a_camera_turns_about_the_goal_s_middle():
    p, result = some_camera(np.random.default_rng(3)), np.empty(8)
    turn_camera(SHAPE.line_x_m, p, 0.3, result)
    np.testing.assert_allclose(result, turned(p, 0.3))
