"""The compiled fit of a pose to line points against plain NumPy, for an upright body and for one that sways."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.projection import camera_rotation
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.lines.pose_fit import (
    AROUND_PX,
    NOWHERE_PX,
    TURN_RAD,
    PointFitRules,
    PointRows,
    SeenPoints,
    fit_points,
    loss_of,
    measure_points,
    spread_px,
)
from robocup_vision.localization.lines.line_map import LineMap

FIELD = load_field("ssl_division_b")
MAP = LineMap(FIELD)
CAMERA = PinholeCamera((640, 480), (640.0, 640.0), (319.5, 239.5), 0.17, offset_m=(0.09, 0.0), tilt_rad=-0.29)
RULES = PointFitRules(0.1, 15, 4)
AROUND = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]) * AROUND_PX
seeds = st.integers(0, 2**32 - 1)


def seen_by(rng, sways):
    """Return a pose (3,) or (5,) and points seen from near it, some of them beyond the horizon of a body that sways."""
    truth = np.array([rng.uniform(-4, 4), rng.uniform(-2.7, 2.7), rng.uniform(-3, 3), *rng.normal(0, 0.01, 2)])
    held = CAMERA.with_orientation(None, CAMERA.tilt_rad + truth[3], truth[4]) if sways else CAMERA
    floor = Pose2(*truth[:3]).inverse().transform(FIELD.line_points(0.02))
    floor = floor[(floor[:, 0] > 0.2) & (np.hypot(*floor.T) < 4.0)]
    pixels = held.floor_to_pixel(floor) + rng.normal(0, 0.5, floor.shape)
    pixels = np.vstack([pixels, rng.uniform((0, 0 if sways else 150), CAMERA.size_px, (40, 2))])
    rays = np.ascontiguousarray(CAMERA.pixel_to_camera_ray(pixels[:, None] + AROUND))
    mount = np.array([0.0, CAMERA.tilt_rad, 0.0, CAMERA.height_m, *CAMERA.offset_m])
    around = CAMERA.pixel_to_floor(pixels[:, None] + AROUND)
    per_px = np.stack([around[:, 1] - around[:, 2], around[:, 3] - around[:, 4]], axis=-1) / (2 * AROUND_PX)
    if sways:
        return truth, SeenPoints(np.empty((0, 2)), np.empty((0, 2, 2)), rays, mount, MAP.lines, MAP.arcs)
    shown = np.isfinite(around).all(axis=(1, 2))
    points = np.ascontiguousarray(around[shown, 0]), np.ascontiguousarray(per_px[shown])
    return truth[:3], SeenPoints(*points, np.empty((0, 5, 3)), mount, MAP.lines, MAP.arcs)


def room(seen, size):
    count = max(len(seen.floor_m), len(seen.rays))
    return PointRows(np.empty(count), np.empty((count, size)), np.empty((count, 2)), np.empty(count, dtype=np.int64))


def floor_twin(rays, mount, tilt, roll):
    turned = rays @ camera_rotation(mount[0], mount[1] + tilt, mount[2] + roll).T
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(turned[..., 2] < -1e-3, -mount[3] / turned[..., 2], np.nan)
    return mount[4:] + turned[..., :2] * reach[..., None]


def measure_twin(unknowns, seen):
    floor, per_px, shown = seen.floor_m, seen.floor_per_px, np.ones(len(seen.floor_m), dtype=bool)
    by_sway: list[np.ndarray] = []
    if len(unknowns) > 3:
        tilt, roll = unknowns[3:]
        around = floor_twin(seen.rays, seen.mount, tilt, roll)
        floor = around[:, 0]
        per_px = np.stack([around[:, 1] - around[:, 2], around[:, 3] - around[:, 4]], axis=-1) / (2 * AROUND_PX)
        turned = (tilt + TURN_RAD, roll), (tilt, roll + TURN_RAD)
        by_sway = [(floor_twin(seen.rays[:, 0], seen.mount, *by) - floor) / TURN_RAD for by in turned]
        shown = np.isfinite(around).all(axis=(1, 2)) & np.isfinite(by_sway[0] + by_sway[1]).all(axis=1)
        floor, per_px = np.where(shown[:, None], floor, 0.0), np.where(shown[:, None, None], per_px, 1.0)
    c, s = math.cos(unknowns[2]), math.sin(unknowns[2])
    turned_m = floor @ np.array([[c, s], [-s, c]])
    near = MAP.nearest(turned_m + unknowns[:2])
    slope = np.einsum("ni,nij->nj", near.normal @ np.array([[c, -s], [s, c]]), per_px)
    m_per_px = np.maximum(np.hypot(*slope.T), 1e-9)
    by_theta = near.normal[:, 1] * turned_m[:, 0] - near.normal[:, 0] * turned_m[:, 1]
    jacobian = np.column_stack([near.normal, by_theta]) / m_per_px[:, None]
    across = jacobian[:, :2] @ np.array([[c, -s], [s, c]])
    jacobian = np.column_stack([jacobian, *((across * by).sum(axis=1) for by in by_sway)])
    residual = np.where(shown, near.distance_m / m_per_px, NOWHERE_PX)
    return PointRows(residual, np.where(shown[:, None], jacobian, 0.0), slope / m_per_px[:, None], near.index)


def spread_twin(residual, within):
    good = residual <= 2 * within
    return 1.48 * float(np.median(residual[good])) if good.any() else within


def loss_twin(residual, weight, scale):
    return float(np.sum(weight * residual**2 / (1 + residual**2 / scale**2)))


def fit_twin(start, seen, weights, expected, information, shared, start_px, rules):
    """As `fit_points`; returns the unknowns, what was measured there and the scale."""

    def offset_of(at):
        off = at - expected
        off[2] = wrap_angle(off[2])
        return off

    unknowns, rows, scale = start.copy(), measure_twin(start, seen), start_px
    for _ in range(rules.max_steps):
        sigma2 = max(spread_twin(rows.residual, scale), rules.min_noise_px) ** 2
        weight = weights / (sigma2 + shared**2)
        robust = weight / (1 + (rows.residual / scale) ** 2) ** 2
        offset = offset_of(unknowns)
        hessian = (rows.jacobian.T * robust) @ rows.jacobian + information
        gradient = rows.jacobian.T @ (robust * rows.residual) + information @ offset
        step = -np.linalg.solve(hessian + 1e-9 * np.trace(hessian) * np.eye(len(start)), gradient)
        step *= min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12))
        loss = loss_twin(rows.residual, weight, scale) + float(offset @ information @ offset)
        for _ in range(rules.max_halvings):
            tried, offset = measure_twin(unknowns + step, seen), offset_of(unknowns + step)
            if loss_twin(tried.residual, weight, scale) + float(offset @ information @ offset) <= loss:
                unknowns, rows = unknowns + step, tried
                break
            step = step / 2
        narrow = max(3 * math.sqrt(sigma2), 1.0)
        if scale <= narrow and float(np.abs(step).max()) < 1e-5:
            break
        scale = max(0.6 * scale, narrow) if scale > narrow else narrow
    return unknowns, rows, scale


@settings(deadline=None, max_examples=25)
@given(seeds, st.booleans())
def test_points_are_measured_as_numpy_does(seed, sways):
    rng = np.random.default_rng(seed)
    truth, seen = seen_by(rng, sways)
    unknowns = truth + rng.normal(0, 0.02, len(truth))
    rows, expected = room(seen, len(truth)), measure_twin(unknowns, seen)
    measure_points(unknowns, seen, rows)
    np.testing.assert_allclose(rows.residual, expected.residual, rtol=1e-7, atol=1e-7)
    # of a point on the very line, or as near to two lines, rounding decides
    clear = (expected.residual > 1e-6) & (rows.nearest == expected.nearest)
    assert clear.mean() > 0.95
    np.testing.assert_allclose(rows.jacobian[clear], expected.jacobian[clear], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(rows.normal_px[clear], expected.normal_px[clear], atol=1e-7)


@pytest.mark.parametrize("sways", [False, True])
def test_derivatives_are_those_of_the_distances(sways):
    rng = np.random.default_rng(5)
    truth, seen = seen_by(rng, sways)
    unknowns = truth + rng.normal(0, 0.01, len(truth))
    here, there = room(seen, len(truth)), room(seen, len(truth))
    measure_points(unknowns, seen, here)
    for i in range(len(unknowns)):
        step = 1e-6 * np.eye(len(unknowns))[i]
        measure_points(unknowns + step, seen, there)
        same = (here.nearest == there.nearest) & (here.residual > 0.01) & (here.residual < 0.5)
        change = (there.residual - here.residual)[same] / 1e-6
        # how large a pixel is on the floor changes, too: that matters far from the line
        off = np.abs(change - here.jacobian[same, i]) / np.maximum(np.abs(here.jacobian[same, i]), 10.0)
        assert np.median(off) < 0.02


@given(st.lists(st.floats(0.0, 100.0), max_size=60), st.floats(0.1, 60.0))
def test_the_spread_is_the_scaled_median_of_what_is_near(residual, within):
    found = spread_px(np.array(residual), within, np.empty((2, len(residual) + 1)))
    assert found == pytest.approx(spread_twin(np.array(residual), within), rel=1e-12, abs=1e-12)


@given(st.lists(st.floats(0.0, 100.0), max_size=60), st.floats(0.1, 60.0))
def test_the_loss_is_the_sum_of_bounded_squares(residual, scale):
    weight = np.linspace(0.5, 2.0, len(residual))
    expected = loss_twin(np.array(residual), weight, scale)
    assert loss_of(np.array(residual), weight, scale) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@settings(deadline=None, max_examples=20)
@given(seeds, st.booleans(), st.booleans())
def test_fits_agree_with_numpy(seed, sways, is_expected):
    rng = np.random.default_rng(seed)
    truth, seen = seen_by(rng, sways)
    size, rows = len(truth), room(seen, len(truth))
    std = np.array([0.05, 0.05, 0.04, 0.01, 0.01])[:size]
    start = truth + rng.normal(0, std)
    # without any expectation tilt would be open where one line is in view
    information = np.diag(std**-2) if is_expected or sways else np.zeros((size, size))
    weights, shared = rng.uniform(0.5, 1.0, len(rows.residual)), rng.uniform(0.0, 2.0, len(rows.residual))
    given_to = seen, weights, start.copy(), information, shared, 30.0, RULES
    unknowns = start.copy()
    scale = fit_points(unknowns, *given_to, rows)
    expected, expected_rows, expected_scale = fit_twin(start, *given_to)
    np.testing.assert_allclose(unknowns, expected, atol=1e-6)
    assert scale == pytest.approx(expected_scale, rel=1e-5)
    np.testing.assert_allclose(rows.residual, expected_rows.residual, rtol=1e-4, atol=1e-4)


def test_points_that_fix_nothing_say_so():
    _, seen = seen_by(np.random.default_rng(1), False)
    nothing = replace_points(seen, 0)
    rows, unknowns = room(nothing, 3), np.zeros(3)
    empty = np.empty(0)
    assert math.isnan(fit_points(unknowns, nothing, empty, np.zeros(3), np.zeros((3, 3)), empty, 8.0, RULES, rows))


def replace_points(seen, count):
    return seen._replace(floor_m=seen.floor_m[:count].copy(), floor_per_px=seen.floor_per_px[:count].copy())


def test_a_line_above_the_horizon_is_nowhere():
    rng = np.random.default_rng(2)
    truth, seen = seen_by(rng, True)
    rows = room(seen, 5)
    up = truth + np.array([0.0, 0.0, 0.0, 0.6, 0.0])
    measure_points(up, seen, rows)
    assert (rows.residual == NOWHERE_PX).mean() > 0.3
    assert (rows.jacobian[rows.residual == NOWHERE_PX] == 0.0).all()
