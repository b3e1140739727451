"""A camera found again by a goal and by points on lines."""

import math

import numpy as np
import pytest
from goal_twins import SCENE, SHAPE, VIEW, floor_px, perfect_samples, some_camera

from field_models import load_field
from robocup_vision.kernels.goal.fit import FitLoss, FitPriors
from robocup_vision.kernels.goal.lines.fit import AssociatedMarks, LinePlaces, fit_to_points
from robocup_vision.localization.lines.line_map import LineMap

MAP = LineMap(load_field("four_legged_2007"))


def room(count):
    return AssociatedMarks(np.empty(count, np.int64), *(np.empty((count, 2)) for _ in range(3)))


def places_at(pixels):
    return LinePlaces(np.ascontiguousarray(pixels), np.ones(len(pixels)), MAP.lines, MAP.arcs)


@pytest.mark.parametrize("seed", range(8))
def test_a_camera_is_found_again_by_goal_and_points(seed):
    rng = np.random.default_rng(seed)
    p = some_camera(rng)
    lines = np.concatenate(
        [np.linspace(line[:2], line[2:], 60) for line in MAP.lines if np.linalg.norm(line[2:] - line[:2]) > 1.0]
    )
    pixels = floor_px(VIEW, p, lines)
    pixels = pixels[np.isfinite(pixels).all(axis=1) & (np.abs(pixels - VIEW.center_px) < (208, 160)).all(axis=1)]
    goal = perfect_samples(p)
    goal = goal._replace(
        mark_m=np.empty((0, 2)), mark_uv=np.empty((0, 2)), mark_direction=np.empty((0, 2)), sigma=goal.sigma[:66]
    )
    priors = FitPriors(p, np.full(8, 1e-3))
    loss = FitLoss(np.full(12, 3.0), np.full(12, 3.0), True)
    start = p + np.array([0.03, -0.03, 0.01, 0.005, 0.005, 0.002, 0.002, 0.1])
    cost = fit_to_points(SCENE, goal, places_at(pixels), priors, loss, room(len(pixels)), start)
    assert cost < 1e-3
    np.testing.assert_allclose(start, p, atol=1e-3)


def test_a_goal_behind_the_camera_has_no_fit():
    p = some_camera(np.random.default_rng(1))
    goal = perfect_samples(p)
    goal = goal._replace(
        mark_m=np.empty((0, 2)), mark_uv=np.empty((0, 2)), mark_direction=np.empty((0, 2)), sigma=goal.sigma[:66]
    )
    p[0], p[2] = SHAPE.line_x_m - 1.0, math.pi
    priors, loss = FitPriors(p.copy(), np.full(8, 1e-3)), FitLoss(np.full(3, 3.0), np.full(3, 3.0), True)
    assert fit_to_points(SCENE, goal, places_at(np.empty((0, 2))), priors, loss, room(0), p) == np.inf
