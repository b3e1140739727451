"""The compiled loops of the line localiser against plain NumPy and Python twins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.kernels.lines.lines import (
    ANYWHERE2,
    DistanceTable,
    PoseGrid,
    floor_mask_by_tone,
    least_of_red_and_blue,
    line_ridge_points,
    line_widths,
    nearest_line,
    nearest_lines,
    refine_line_poses,
    score_pose_grid,
)

AXES = ((1, 0), (1, 1), (0, 1), (-1, 1))
SCALES_M = np.array([0.25, 0.1, 0.06])
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


def nearest_twin(points, lines, arcs):
    feet = []
    for x0, y0, x1, y1 in lines:
        along = np.array([x1 - x0, y1 - y0])
        t = np.clip((points - (x0, y0)) @ along / (along @ along), 0, 1)
        feet.append((x0, y0) + t[:, None] * along)
    for x, y, radius, start, sweep in arcs:
        angles = np.arctan2(points[:, 1] - y, points[:, 0] - x)
        low, high = min(start, start + sweep), max(start, start + sweep)
        options = [low, high] + [np.where((angles + n * math.tau <= high) & (angles + n * math.tau >= low), angles, low)
                                 for n in (-1, 0, 1)]  # fmt: skip
        ends = np.stack([np.broadcast_to(a, angles.shape) for a in options])
        spots = np.stack([x + radius * np.cos(ends), y + radius * np.sin(ends)], axis=-1)
        best = np.argmin(np.linalg.norm(spots - points, axis=-1), axis=0)
        feet.append(spots[best, np.arange(len(points))])
    distance = np.linalg.norm(np.array(feet) - points, axis=-1)
    index = np.argmin(distance, axis=0)
    nearest = distance.min(axis=0)
    return nearest, (points - np.array(feet)[index, np.arange(len(points))]) / nearest[:, None], index


@pytest.mark.parametrize("name", ["msl_6x4", "msl_18x12"])
def test_nearest_lines_agree_with_numpy(name):
    field = load_field(name)
    points = np.random.default_rng(1).uniform(-10, 10, (500, 2))
    distance, normal, _ = nearest_lines(points, field.lines, field.arcs)
    expected, expected_normal, _ = nearest_twin(points, field.lines, field.arcs)
    np.testing.assert_allclose(distance, expected, atol=1e-12)
    np.testing.assert_allclose(np.abs((normal * expected_normal).sum(axis=1)), 1.0, atol=1e-6)
    single = nearest_line(*points[0], field.lines, field.arcs, ANYWHERE2)
    assert single[0] == pytest.approx(expected[0])
    assert abs(np.dot(single[1:3], expected_normal[0])) == pytest.approx(1.0)
    assert nearest_line(*points[0], field.lines, field.arcs, 0.9 * expected[0] ** 2)[3] == -1
    assert nearest_line(*points[0], field.lines, field.arcs, 1.1 * expected[0] ** 2) == single


def test_nearest_lines_have_a_normal_on_the_line_itself():
    field = load_field("msl_6x4")
    points = field.line_points(0.3)
    distance, normal, _ = nearest_lines(points, field.lines, field.arcs)
    assert distance.max() < 1e-9
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0)


def test_pose_grid_agrees_with_numpy():
    rng = np.random.default_rng(3)
    table = rng.integers(0, 256, (40, 50), dtype=np.uint8)
    points, headings = rng.uniform(-2, 2, (30, 2)), np.array([0.0, 0.7, 3.0])
    distances = DistanceTable(table, (-1.0, -1.2), 0.05, 255)
    cost = score_pose_grid(points, distances, PoseGrid(headings, (-12, -8), 4, (6, 5)))
    for k, heading in enumerate(headings):
        c, s = math.cos(heading), math.sin(heading)
        cells = np.floor((points @ [[c, s], [-s, c]] - (-1.0, -1.2)) / 0.05 + 0.5).astype(int)
        for iy in range(5):
            for ix in range(6):
                x, y = (cells + np.array([-12 + 4 * ix, -8 + 4 * iy])).T
                inside = (x >= 0) & (x < 50) & (y >= 0) & (y < 40)
                expected = np.where(inside, table[np.clip(y, 0, 39), np.clip(x, 0, 49)], 255).sum()
                assert cost[k, iy, ix] == expected


def refine_twin(pose, points, noise, weight, field):
    pose = pose.copy()
    for turn in range(len(SCALES_M) + 1):
        scale2 = SCALES_M[min(turn, len(SCALES_M) - 1)] ** 2 + noise**2
        c, s = math.cos(pose[2]), math.sin(pose[2])
        turned = points @ [[c, s], [-s, c]]
        d, n, _ = nearest_twin(turned + pose[:2], field.lines, field.arcs)
        loss = np.average(np.log1p(d**2 / scale2), weights=weight)
        if turn == len(SCALES_M):
            return pose, loss
        jacobian = np.column_stack([n, n[:, 1] * turned[:, 0] - n[:, 0] * turned[:, 1]])
        w = weight / (scale2 + d**2)
        a = (jacobian.T * w) @ jacobian
        a += (1e-3 * (a[0, 0] + a[1, 1]) + 1e-9) * np.eye(3)
        step = -np.linalg.solve(a, jacobian.T @ (w * d))
        pose += step * min(1.0, 0.5 / np.hypot(*step[:2]), 0.2 / abs(step[2]))
    raise AssertionError


def test_refinement_agrees_with_numpy():
    rng = np.random.default_rng(4)
    field = load_field("msl_6x4")
    points = rng.uniform(-2, 2, (60, 2))
    noise, weight = rng.uniform(0.0, 0.1, 60), rng.uniform(0.5, 1.0, 60)
    starts = np.column_stack([rng.uniform(-2, 2, (5, 2)), rng.uniform(-3, 3, 5)])
    poses = starts.copy()
    loss = refine_line_poses(poses, points, noise, weight, field.lines, field.arcs, SCALES_M)
    for k in range(5):
        expected, expected_loss = refine_twin(starts[k], points, noise, weight, field)
        np.testing.assert_allclose(poses[k], expected, atol=1e-7)
        assert loss[k] == pytest.approx(expected_loss)


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
