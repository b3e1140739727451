"""The compiled loops of the line localiser against plain NumPy and Python twins."""

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.kernels.lines.lines import (
    ANYWHERE2,
    DistanceTable,
    PoseGrid,
    nearest_line,
    nearest_lines,
    refine_line_poses,
    score_pose_grid,
)

SCALES_M = np.array([0.25, 0.1, 0.06])


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
