"""Compiled loops that find white lines in a picture, against plain NumPy and Python twins."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.lines.ridges import (
    floor_mask_by_tone,
    least_of_red_and_blue,
    line_ridge_points,
    line_widths,
)

AXES = ((1, 0), (1, 1), (0, 1), (-1, 1))
seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_floor_mask_agrees_with_numpy(seed):
    rng = np.random.default_rng(seed)
    smooth = rng.integers(0, 256, (20, 30, 3), dtype=np.uint8)
    seen = rng.integers(0, 2, (20, 30), dtype=np.uint8)
    tone = np.array([0.3, 1.1, 0.2, 1.3, 40, 200, 2], dtype=np.float32)
    b, g, r = np.moveaxis(smooth.astype(np.float32), -1, 0)
    expected = (g >= 40) & (g <= 200) & (r >= tone[0] * g - 2) & (r <= tone[1] * g + 2)
    expected &= (b >= tone[2] * g - 2) & (b <= tone[3] * g + 2) & (seen > 0)
    np.testing.assert_array_equal(floor_mask_by_tone(smooth, seen, 0, tone), expected)


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_least_of_red_and_blue_agrees_with_numpy(seed):
    frame = np.random.default_rng(seed).integers(0, 256, (7, 11, 3), dtype=np.uint8)
    least = np.empty((7, 11), np.uint8)
    least_of_red_and_blue(frame, least)
    np.testing.assert_array_equal(least, frame[..., ::2].min(axis=2))


def crossing(profile, level):
    for step in range(1, len(profile)):
        if profile[step] <= level:
            return step - (level - profile[step]) / (profile[step - 1] - profile[step])
    return None


def ridge_twin(whiteness, green, floor, width_units, threshold):
    height, width = whiteness.shape
    found = []
    for y in range(height):
        for x in range(width):
            options = []
            for k, (dx, dy) in enumerate(AXES):
                units = int(width_units[k, y, x])
                reach = math.ceil((0.7 * units / 16 + 1.8) / math.hypot(dx, dy))
                ends = [(x + s * reach * dx, y + s * reach * dy) for s in (1, -1)]
                if not units or not all(0 <= u < width and 0 <= v < height for u, v in ends):
                    continue
                rise = int(whiteness[y, x]) - max(int(whiteness[v, u]) for u, v in ends)
                sides = sum(int(floor[v, u]) for u, v in ends)
                if rise >= threshold and sides:
                    options.append((sides, rise, -k, reach, ends))
            if not options:
                continue
            sides, rise, minus_k, reach, ends = max(options)
            dx, dy = AXES[-minus_k]
            ways = []
            for s, (u, v) in zip((1, -1), ends, strict=True):
                profile = [float(whiteness[y + s * i * dy, x + s * i * dx]) for i in range(reach + 1)]
                ways.append(crossing(profile, (profile[0] + float(whiteness[v, u])) / 2))
            shift, expected = (ways[0] - ways[1]) / 2, width_units[-minus_k, y, x] / 16
            seen = sum(ways) * math.hypot(dx, dy)
            if -0.5 < shift <= 0.5 and 0.5 * expected <= seen <= 1.5 * expected + 1.5:
                ground = max(float(green[v, u]) for u, v in ends if floor[v, u])
                found.append((x + shift * dx, y + shift * dy, rise / max(ground, 1.0), float(sides == 2)))
    return np.array(found).reshape(-1, 4)


def reaches(units):
    """Count the steps to the floor beside a line, as `LineFinder` counts them; 0 where no line is looked for."""
    step = np.array([math.hypot(*axis) for axis in AXES])[:, None, None]
    return np.where(units > 0, np.ceil((0.7 * units / 16 + 1.8) / step), 0).astype(np.uint8)


@given(seeds)
@settings(deadline=None, max_examples=10)
def test_widths_by_cells_find_the_ridges_that_widths_by_pixels_do(seed):
    rng = np.random.default_rng(seed)
    whiteness = rng.integers(20, 60, (24, 28), dtype=np.uint8)
    whiteness[:, 9:12] = 200
    whiteness[14:16] = 180
    green = rng.integers(60, 150, whiteness.shape, dtype=np.uint8)
    seen = rng.integers(0, 2, (6, 7), dtype=np.uint8)
    units = rng.choice([0, 16, 40], (4, 6, 7)).astype(np.uint16)
    fine = np.repeat(np.repeat(units, 4, axis=1), 4, axis=2)
    floor = (rng.random(whiteness.shape) < 0.7).astype(np.uint8)
    by_cells = line_ridge_points(whiteness, green, floor, units, reaches(units), 2, 15, 10_000)
    by_pixels = line_ridge_points(whiteness, green, floor, fine, reaches(fine), 0, 15, 10_000)
    np.testing.assert_array_equal(by_cells, by_pixels)
    smooth = rng.integers(0, 256, (24, 28, 3), dtype=np.uint8)
    tone = np.array([0.3, 1.1, 0.2, 1.3, 40, 200, 2], dtype=np.float32)
    every = np.repeat(np.repeat(seen, 4, axis=0), 4, axis=1)
    np.testing.assert_array_equal(floor_mask_by_tone(smooth, seen, 2, tone), floor_mask_by_tone(smooth, every, 0, tone))


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_ridge_points_agree_with_their_twin(seed):
    rng = np.random.default_rng(seed)
    whiteness = rng.integers(20, 60, (24, 28), dtype=np.uint8)
    for _ in range(3):
        x, y = rng.integers(0, 28), rng.integers(0, 24)
        whiteness[:, x : x + rng.integers(1, 4)] = rng.integers(100, 250)
        whiteness[y : y + rng.integers(1, 4)] = rng.integers(100, 250)
    green = rng.integers(60, 150, whiteness.shape, dtype=np.uint8)
    floor = (rng.random(whiteness.shape) < 0.7).astype(np.uint8)
    units = rng.choice([0, 16, 40, 64], (4, *whiteness.shape)).astype(np.uint16)
    found = line_ridge_points(whiteness, green, floor, units, reaches(units), 0, 15, 10_000)
    np.testing.assert_allclose(found, ridge_twin(whiteness, green, floor, units, 15), atol=1e-9)
    if len(found) > 3:
        np.testing.assert_array_equal(
            line_ridge_points(whiteness, green, floor, units, reaches(units), 0, 15, 3), found[:3]
        )


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_line_widths_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    floor = np.cumsum(np.cumsum(rng.uniform(-0.01, 0.05, (12, 15, 2)), axis=0), axis=1)
    seen = (rng.random((12, 15)) < 0.8).astype(np.uint8)
    widths = np.empty((4, 12, 15), np.uint16)
    line_widths(floor, seen, 0.05, (0.6, 60.0), widths)
    by_v, by_u = np.gradient(floor, axis=(0, 1))
    area = np.abs(by_u[..., 0] * by_v[..., 1] - by_u[..., 1] * by_v[..., 0])
    for found, (du, dv) in zip(widths, AXES, strict=True):
        along = (-by_u * dv + by_v * du) / math.hypot(du, dv)
        expected = 0.05 * np.hypot(along[..., 0], along[..., 1]) / area
        good = (seen > 0) & (expected >= 0.6) & (expected <= 60.0)
        np.testing.assert_allclose(found, np.where(good, expected * 16, 0), atol=0.51)
