"""The carpet of a frame, and the sizes that balls have in its rows, against plain NumPy."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.camera import PinholeCamera
from robocup_vision.kernels.balls import patterned_carpet as kernel
from robocup_vision.kernels.balls.patterned import BLUE_WEIGHT, DARK_COUNTS, NOISE_COUNTS

LOGS = np.log(np.arange(256) + NOISE_COUNTS)


@settings(deadline=None, max_examples=30)
@given(
    st.integers(0, 2**32 - 1),
    st.floats(-0.4, 0.4),
    st.floats(-0.2, 0.4),
    st.integers(0, 12),
    st.sampled_from([41, 500]),
)
def test_the_carpet_is_measured_as_plainly_defined(seed, max_hue, min_green, first, width):
    blurred = np.random.default_rng(seed).integers(0, 256, (30, width, 3)).astype(np.uint8)
    stride = {41: kernel.STRIDE, 500: 500 // kernel.PER_ROW}[width]
    b, g, r = blurred[first::stride, ::stride].astype(float).reshape(-1, 3).T
    hue = LOGS[r.astype(int)] - LOGS[g.astype(int)] + BLUE_WEIGHT * (LOGS[b.astype(int)] - LOGS[g.astype(int)])
    green = (2 * g - b - r) / (b + g + r + DARK_COUNTS)
    is_carpet = (hue < max_hue) & (green > min_green)
    told = kernel.measure_carpet(blurred, first, LOGS, max_hue, min_green, np.empty((4, len(hue) + 1)))
    assert told[0] == pytest.approx(is_carpet.mean())
    if is_carpet.any():
        expected = *np.quantile(hue[is_carpet], [0.25, 0.5, 0.75]), np.median(green[is_carpet]), np.median(g[is_carpet])
        np.testing.assert_allclose(told[1:], expected, atol=1e-12)


@pytest.mark.parametrize("tilt_rad", [-0.6, -0.1, 0.2, 0.7])
@pytest.mark.parametrize("roll_rad", [0.0, 0.1])
def test_a_ball_seen_by_a_camera_is_within_the_bounds_of_its_row_and_they_are_no_wider_than_needed(tilt_rad, roll_rad):
    camera = PinholeCamera((64, 48), (46.0, 46.0), (31.5, 23.5), 0.46, (), (0.0, 0.0), 0.0, tilt_rad, roll_rad)
    radius_m, rows, slack_rad, size_std = 0.05, 8, 0.03, 0.3
    at = np.minimum(np.arange(0, 48 + rows, rows), 47)
    pixels = np.stack(np.broadcast_arrays([0.0, 31.5, 63.0], at[:, None]), axis=-1)
    bounds = np.empty((48, 2))
    height_m = camera.height_m - radius_m
    top = kernel.bound_radii(
        camera.pixel_to_camera_ray(pixels),
        (tilt_rad, roll_rad),
        46.0,
        radius_m / height_m,
        slack_rad,
        size_std,
        rows,
        3.0,
        bounds,
    )
    reached = [v - kernel.BEYOND * most for v, (_, most) in enumerate(bounds) if most >= 3.0]
    assert top == max(int(min(reached, default=48.0)), 0)

    def radius_px(fall_rad, ahead):
        sine = math.sin(min(max(fall_rad, 0.0), math.pi / 2))
        return math.asin(min(radius_m / height_m * sine, 1.0)) * 46.0 / ahead

    for v in range(48):
        least, most = math.inf, -math.inf
        for u in (0.0, 31.5, 63.0):
            for row in at[v // rows], at[v // rows + 1]:
                ahead = camera.pixel_to_camera_ray((u, row))[0]
                fall = math.asin(-camera.pixel_to_ray((u, row))[2])
                radius = radius_px(fall, ahead)
                below = radius - radius_px(fall - slack_rad, ahead)
                above = radius_px(fall + slack_rad, ahead) - radius
                least = min(least, radius - math.hypot(size_std * radius, below))
                most = max(most, radius + math.hypot(size_std * radius, above))
        assert bounds[v] == pytest.approx((least, most), abs=1e-9)


def test_rows_in_which_the_lens_shows_nothing_have_no_ball():
    bounds = np.empty((8, 2))
    none = np.full((2, 3, 3), np.nan)
    assert kernel.bound_radii(none, (0.0, 0.0), 46.0, 0.1, 0.03, 0.3, 8, 3.0, bounds) == 8
    assert (bounds[:, 0] > bounds[:, 1]).all()
