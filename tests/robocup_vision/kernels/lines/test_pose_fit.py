"""The compiled fit of a pose to line points: derivatives, what is found, and what is left open."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.lines.pose_fit import (
    PointFitRules,
    PointRows,
    SeenPoints,
    fit_points,
    measure_points,
    spread_px,
)
from robocup_vision.localization.lines.fit import seen_points
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LinePoints

FIELD = load_field("ssl_division_b")
MAP = LineMap(FIELD)
CAMERA = PinholeCamera((640, 480), (640.0, 640.0), (319.5, 239.5), 0.17, offset_m=(0.09, 0.0), tilt_rad=-0.29)
RULES = PointFitRules(0.1, 15, 4)
seeds = st.integers(0, 2**32 - 1)


def seen_from(truth, rng, noise_px):
    """Return the line points seen from a pose (3,)."""
    floor = Pose2(*truth).inverse().transform(FIELD.line_points(0.02))
    floor = floor[(floor[:, 0] > 0.2) & (np.hypot(*floor.T) < 4.0)]
    pixels = CAMERA.floor_to_pixel(floor)
    pixels = pixels[np.isfinite(pixels).all(axis=1)]
    return seen_points(LinePoints.from_pixels(CAMERA, pixels + rng.normal(0, noise_px, pixels.shape)), MAP)


def measured(unknowns, seen):
    count = len(seen.floor_m)
    rows = PointRows(np.empty(count), np.empty((count, 3)), np.empty((count, 2)), np.empty(count, dtype=np.int64))
    measure_points(np.array(unknowns), seen, rows)
    return rows


def somewhere(rng):
    return np.array([rng.uniform(-4, 4), rng.uniform(-2.7, 2.7), rng.uniform(-3, 3)])


@given(seeds)
def test_residuals_are_pixels_across_the_line_and_their_derivatives_are_right(seed):
    rng = np.random.default_rng(seed)
    truth = somewhere(rng)
    exact = measured(truth, seen_from(truth, rng, 0.0))
    assert exact.residual.max(initial=0.0) < 1e-6
    # near the lines, as the scale of a pixel is held fixed
    seen = seen_from(truth, rng, 0.01)
    rows = measured(truth, seen)
    np.testing.assert_allclose(np.hypot(*rows.normal_px.T), 1.0, rtol=1e-9)
    for i in range(3):
        step = np.zeros(3)
        step[i] = 1e-7
        more, less = measured(truth + step, seen), measured(truth - step, seen)
        # not where the nearest line changes, nor where a point crosses its line
        smooth = (more.nearest == rows.nearest) & (less.nearest == rows.nearest)
        smooth &= rows.residual > 1e-6 * np.abs(rows.jacobian[:, i])
        slope = (more.residual - less.residual) / 2e-7
        # beyond a line's end the direction to it turns, too
        is_right = np.isclose(rows.jacobian[smooth, i], slope[smooth], rtol=0.02, atol=1.0)
        assert is_right.mean() > 0.98


@given(seeds)
def test_a_pose_is_found_from_near_it_among_points_that_are_no_lines(seed):
    rng = np.random.default_rng(seed)
    truth = np.array([2.0, 1.0, 0.4])
    seen = seen_from(truth, rng, 0.3)
    strays = LinePoints.from_pixels(CAMERA, rng.uniform((0, 150), CAMERA.size_px, (len(seen.floor_m) // 5, 2)))
    more = seen_points(strays, MAP)
    seen = SeenPoints(
        np.vstack([seen.floor_m, more.floor_m]), np.vstack([seen.floor_per_px, more.floor_per_px]), MAP.lines, MAP.arcs
    )
    found, rows = truth + rng.normal(0.0, (0.02, 0.02, 0.01)), measured(truth, seen)
    scale = fit_points(found, seen, np.ones(len(seen.floor_m)), 8.0, RULES, rows)
    assert math.isfinite(scale)
    assert np.abs(found - truth).max() < 0.02
    np.testing.assert_allclose(rows.residual, measured(found, seen).residual)


def test_weights_of_nothing_fix_nothing():
    truth = np.array([2.0, 1.0, 0.4])
    seen = seen_from(truth, np.random.default_rng(1), 0.3)
    rows = measured(truth, seen)
    assert math.isnan(fit_points(truth.copy(), seen, np.zeros(len(seen.floor_m)), 8.0, RULES, rows))


def test_the_spread_is_a_standard_deviation_that_strays_do_not_move():
    rng = np.random.default_rng(3)
    residual = np.abs(np.concatenate([rng.normal(0, 0.7, 4000), rng.uniform(20, 50, 400)]))
    assert abs(spread_px(residual, 5.0, np.empty((2, len(residual) + 1))) - 0.7) < 0.03
    assert spread_px(residual + 100.0, 5.0, np.empty((2, len(residual) + 1))) == 5.0
