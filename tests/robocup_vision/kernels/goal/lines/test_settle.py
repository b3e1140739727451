"""The search for the best drawing against the same search in plain Python."""

import math

import numpy as np
import pytest
from goal_twins import SCENE, perfect_samples

from robocup_vision.kernels.goal.fit import FitLoss, FitPriors, fit_goal
from robocup_vision.kernels.goal.lines.arc import turn_camera
from robocup_vision.kernels.goal.lines.settle import ArcFit, DrawnPicture, drawn_likelihood, settle_drawing
from robocup_vision.kernels.lines.drawing import MARGIN, LinePen, stroke_table
from robocup_vision.kernels.lines.drawn_light import AROUND, LitCarpet, compare_drawing

TRUTH = np.array([-0.5, 0.4, -0.1, -0.05, 0.0, 0.185, 0.0, 0.0])
FIRST_ROW = 150
STEPS, HALVINGS = 3, 3
SCALES = np.full(3, 0.5)
ALONG = np.linspace(-1.5, 1.5, 101)
POINTS = np.vstack([np.column_stack([np.full(101, x), ALONG]) for x in (1.0, 1.6, 2.2)])
PEN = LinePen(POINTS, np.array([0, 101, 202, 303]), 0.03, stroke_table(0.75))


@pytest.fixture
def picture():
    rng = np.random.default_rng(2)
    shape = (320 - FIRST_ROW, 416)
    on = np.ones(shape, np.float32)
    light = rng.normal(0, 4, shape).astype(np.float32)
    # a light band where a line of the truth lies
    light[20:24, 60:300] += 20.0
    drawing = np.zeros((shape[0] + 2 * MARGIN, shape[1] + 2 * MARGIN), np.float32)
    carpet = LitCarpet(on, np.full(shape, AROUND**-2, np.float32), light)
    return DrawnPicture(carpet, PEN, FIRST_ROW, drawing, float(np.vdot(light, light)), on.size / 25.0)


@pytest.fixture
def arc():
    weight = np.array([0, 0, np.inf, 0, 100.0, np.inf, np.inf, 44.0])
    loss = FitLoss(SCALES, SCALES, False)
    loosest = np.array([[0.01, 0, 0, 0.002, 0, 0, 0, 0], [0, 0.02, 0, 0, 0.003, 0, 0, 0]])
    return ArcFit(SCENE, perfect_samples(TRUTH), FitPriors(TRUTH, weight), loss, TRUTH, loosest)


def plain_likelihood(picture, p):
    own, both = compare_drawing(picture.carpet, PEN, SCENE.camera, p, FIRST_ROW, picture.drawing)
    if own <= 0.0 or both <= 0.0:
        return 0.0
    return -0.5 * picture.pixels * math.log(max(1.0 - both**2 / (own * picture.light_square), 1e-9))


def plain_search(picture, arc, axes, searched):
    def value(place):
        p = np.empty(8)
        turn_camera(SCENE.shape[0], TRUTH, place[0], p)
        cost = fit_goal(SCENE, arc.samples, arc.priors, arc.loss, p, np.empty((8, 8)))
        p = p + place[1:] @ arc.loosest
        return plain_likelihood(picture, p) - (cost + place[1:] @ place[1:]) / 2

    last = searched - 1
    others = range(1 - STEPS, STEPS + 1, 2) if last else (0,)
    unit = np.eye(3)
    at = max(
        (
            k * axes[0] * unit[0] + (m * axes[last] * unit[last] if last else 0.0)
            for k in range(-STEPS, STEPS + 1)
            for m in others
        ),
        key=value,
    )
    for halving in range(1, HALVINGS + 1):
        order = [*range(searched), 0] if last else [0]
        for axis in order:
            step = axes[axis] / 2**halving * unit[axis]
            at = max((at - step, at, at + step), key=value)
    return at, value(at)


@pytest.mark.parametrize("searched", [1, 2, 3])
def test_the_best_place_is_that_of_a_plain_search(picture, arc, searched):
    axes = np.array([0.02, 0.5, 0.5]) * (np.arange(3) < searched)
    place = np.empty(3)
    found = settle_drawing(picture, arc, axes, STEPS, HALVINGS, place)
    expected, value = plain_search(picture, arc, axes, searched)
    assert found == pytest.approx(value, abs=1e-6)
    np.testing.assert_allclose(place, expected, atol=1e-12)
    assert not picture.drawing.any()


def test_lines_are_as_likely_as_the_sums_say(picture):
    for turn in (0.0, 0.01, 0.05):
        p = TRUTH + turn * np.array([0, 0, 1, 0.5, 0, 0, 0, 0])
        expected = plain_likelihood(picture, p)
        assert drawn_likelihood(picture, SCENE.camera, p) == pytest.approx(expected, abs=1e-9)
    p = TRUTH.copy()
    p[2] += np.pi
    assert drawn_likelihood(picture, SCENE.camera, p) == 0.0
