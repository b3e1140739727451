"""Proposed poses are aligned with lines and walls alike, and dropping the worst does not change the others."""

from __future__ import annotations

import numpy as np
import pytest

from robocup_vision.arrays import FloatArray
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.align import DROPPED, Alignment, align_poses
from robocup_vision.kernels.model_edges.find import Bank

TILT, ROLL = -0.17, 0.03
CAMERA = PinholeCamera((104, 80), (96.0, 96.0), (51.5, 39.5), 0.185, pan_rad=0.0, tilt_rad=TILT, roll_rad=ROLL)
TRUTH = Pose2(0.5, 0.2, 0.65)
# borders before which the robot stands: two that meet at a corner, and a nearer one parallel to one of them
X_M, NEARER_X_M, Y_M = 1.5, 1.0, 1.0
ORIGIN_M, CELL_M = np.array([-1.0, -1.0]), 0.04
_X, _Y = np.meshgrid(ORIGIN_M[0] + CELL_M * np.arange(80), ORIGIN_M[1] + CELL_M * np.arange(70))
DISTANCE_M = np.minimum.reduce(
    [np.hypot(np.maximum(_X - X_M, 0.0), _Y - Y_M)]
    + [np.hypot(_X - x_m, np.maximum(_Y - Y_M, 0.0)) for x_m in (X_M, NEARER_X_M)]
).astype(np.float32)
NOTHING_M, NONE = np.full_like(DISTANCE_M, 9.0), np.zeros((0, 3))
GATES_PX = np.array([20.0, 10.0, 5.0, 3.0, 3.0])


def seen_rays(count: int) -> FloatArray:
    """Return the rays (N, 3) by which the true camera sees the borders: ahead, left and up along its axes."""
    away = np.linspace(0.0, 0.8, count // 3)
    along = [(X_M - away, 0 * away + Y_M), (0 * away + X_M, Y_M - away), (0 * away + NEARER_X_M, Y_M - away)]
    places = np.hstack(along).T
    pixels = CAMERA.floor_to_pixel(TRUTH.inverse().transform(places))
    return np.ascontiguousarray(np.random.default_rng(4).permutation(CAMERA.pixel_to_camera_ray(pixels)))


def aligned(
    starts: FloatArray, points: FloatArray, ends: FloatArray, *, weight: float = 1.0, likely: int = 100
) -> tuple[FloatArray, FloatArray]:
    """Align with the borders: as lines where there are points, and as walls where there are ends."""
    lines_m, walls_m = (DISTANCE_M if len(given) else NOTHING_M for given in (points, ends))
    bank = Bank(np.zeros((0, 2)), np.zeros(0), lines_m, ORIGIN_M, CELL_M)
    std, uprights = np.array([0.12, 0.12, 0.06, 0.002, 0.002]), np.zeros((0, 8))
    how = Alignment(points, TILT, ROLL, 0.185, std, 1 / 96.0, GATES_PX, uprights, ends, walls_m, weight)
    poses, costs = np.zeros((len(starts), 5)), np.zeros(len(starts))
    align_poses(bank, how, starts, likely, poses, costs)
    return poses, costs


@pytest.mark.parametrize("as_ends", [False, True])
def test_lines_and_walls_lead_to_the_pose_within_a_cell(as_ends: bool) -> None:
    rng, seen = np.random.default_rng(1), seen_rays(60)
    off = rng.uniform(-1.0, 1.0, (12, 3)) * (0.1, 0.1, 0.05)
    elsewhere = TRUTH.array + np.array([(-0.9, -0.7, 0.5)])
    starts = np.vstack([TRUTH.array + off, elsewhere])
    poses, costs = aligned(starts, NONE if as_ends else seen, seen if as_ends else NONE)
    before_m, after_m = (np.hypot(*(one[:12, :2] - TRUTH.array[:2]).T).mean() for one in (starts, poses))
    assert before_m > 1.5 * CELL_M
    assert after_m < CELL_M
    assert costs[-1] > 5 * costs[:-1].max()


def test_the_weight_of_an_end_is_how_often_it_counts() -> None:
    starts, seen = TRUTH.array + np.array([(0.08, -0.06, 0.03)]), seen_rays(30)
    once, once_cost = aligned(starts, NONE, seen, weight=3.0)
    thrice, thrice_cost = aligned(starts, NONE, np.vstack([seen] * 3))
    np.testing.assert_allclose(once, thrice, atol=1e-9)
    np.testing.assert_allclose(once_cost, thrice_cost)


def test_dropping_the_worst_changes_no_other_pose() -> None:
    rng, seen = np.random.default_rng(6), seen_rays(30)
    far = rng.uniform((-0.9, -0.9, -3.0), (2.0, 1.6, 3.0), (39, 3))
    starts = np.vstack([TRUTH.array + np.array((0.06, -0.05, 0.03)), far])
    every, every_costs = aligned(starts, seen, seen)
    few, few_costs = aligned(starts, seen, seen, likely=5)
    kept = few_costs < DROPPED
    assert kept[0]
    assert np.count_nonzero(kept) == 5
    assert (every_costs < DROPPED).all()
    np.testing.assert_array_equal(few[kept], every[kept])
    np.testing.assert_array_equal(few_costs[kept], every_costs[kept])
