"""The ball of which the picture shows a part."""

import math

import numpy as np
import pytest

from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.balls.blobs import BallSize
from robocup_vision.kernels.balls.cut_ball import fit_cut_ball

WIDTH, HEIGHT = 80, 60
GRID = np.linspace(-1, 1, 33)
DISC = np.array([(x, y) for x in GRID for y in GRID if x * x + y * y <= 1])


def ball_size(axis, slope):
    """Return a size that changes with the distance from the axis."""
    place = np.arange(300.0)
    return BallSize(*axis, 0.0, 4.0 + slope * place, 5.0 + slope * place, np.full(300, 0.1), 0.1)


def plain_points(center, size):
    ray = center - (size.axis_u, size.axis_v)
    radius = math.hypot(*ray)
    index = min(round(radius), len(size.along_px) - 1)
    ray = ray / max(radius, 1e-9)
    ways = np.array([size.along_px[index] * ray, size.across_px[index] * np.array([-ray[1], ray[0]])])
    points = center + DISC @ ways
    return points, points[((points >= -0.5) & (points <= (WIDTH - 0.5, HEIGHT - 0.5))).all(axis=1)]


@pytest.mark.parametrize(("u", "v"), [(2.0, 30.0), (77.0, 55.0), (40.0, -3.0), (40.0, 30.0)])
def test_the_part_that_is_shown_of_the_fitted_ball_is_the_one_that_was_seen(u, v):
    size = ball_size((40.0, 200.0), 0.03)
    _, shown = plain_points(np.array((u, v)), size)
    part = shown.mean(axis=0)
    center_u, center_v, ratio, count, _, _ = fit_cut_ball(*part, WIDTH, HEIGHT, plain(size))
    assert math.hypot(center_u - u, center_v - v) < 1.0
    assert ratio == pytest.approx(len(shown) / len(DISC), abs=0.05)
    assert count == pytest.approx(ratio * len(DISC))


def test_a_ball_beyond_the_picture_shows_nothing():
    assert fit_cut_ball(-40.0, 30.0, WIDTH, HEIGHT, plain(ball_size((40.0, 200.0), 0.0)))[3] == 0
