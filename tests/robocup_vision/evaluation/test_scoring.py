"""Errors, NEES and figures hold their laws: symmetric where they should be, and nothing missing ever helps."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.evaluation.scoring import Row, figures, pose_error
from robocup_vision.geometry import Pose2

coordinates = st.floats(-5.0, 5.0)
angles = st.floats(-math.pi, math.pi)
poses = st.builds(Pose2, coordinates, coordinates, angles)
spreads = st.floats(1e-3, 0.5)


@st.composite
def covariances(draw: st.DrawFn) -> np.ndarray:
    lower = np.tril([[draw(st.floats(-0.2, 0.2)) for _ in range(3)] for _ in range(3)], -1)
    lower += np.diag([draw(spreads) for _ in range(3)])
    return lower @ lower.T


def estimate(pose: Pose2, covariance: np.ndarray | None = None) -> PoseEstimate:
    return PoseEstimate(pose, np.diag([4e-4, 1e-4, 9e-4]) if covariance is None else covariance, 0.8, 0.4)


def truth_of(pose: Pose2) -> Truth:
    return Truth(pose.x_m, pose.y_m, pose.theta_rad)


@given(said=poses, true=poses, symmetric=st.booleans())
def test_the_error_is_that_of_the_pose(said: Pose2, true: Pose2, symmetric: bool) -> None:
    error = pose_error(estimate(said), truth_of(true), symmetric=symmetric)
    assert error.theta_rad is not None
    expected = said.error_to(true, symmetric=symmetric)
    assert (error.position_m, abs(error.theta_rad)) == pytest.approx(expected, abs=1e-9)


@given(said=poses, true=poses, covariance=covariances())
def test_the_half_turn_changes_neither_error_nor_nees(said: Pose2, true: Pose2, covariance: np.ndarray) -> None:
    one = estimate(said, covariance)
    first = pose_error(one, truth_of(true), symmetric=True)
    second = pose_error(one.half_turn(), truth_of(true), symmetric=True)
    sums = [sum(pose.error_to(true)) for pose in (said, said.half_turn())]
    if abs(sums[0] - sums[1]) < 1e-9:
        return  # both turns are equally good, either may be taken
    assert second.position_m == pytest.approx(first.position_m, abs=1e-9)
    assert second.nees == pytest.approx(first.nees, rel=1e-6, abs=1e-6)


@given(true=poses, covariance=covariances(), offset=st.tuples(*[st.floats(-0.3, 0.3)] * 3))
def test_nees_is_the_mahalanobis_distance(
    true: Pose2, covariance: np.ndarray, offset: tuple[float, float, float]
) -> None:
    said = Pose2(true.x_m + offset[0], true.y_m + offset[1], true.theta_rad + offset[2])
    error = pose_error(estimate(said, covariance), truth_of(true), symmetric=False)
    assert error.nees == pytest.approx(offset @ np.linalg.inv(covariance) @ offset, rel=1e-4, abs=1e-6)


def test_nees_of_honest_errors_averages_three() -> None:
    rng = np.random.default_rng(3)
    lower = np.array([[0.02, 0, 0], [0.01, 0.03, 0], [-0.02, 0.01, 0.04]])
    rows = []
    for _ in range(2000):
        true = Pose2(*rng.uniform(-1, 1, 2), rng.uniform(-math.pi, math.pi))
        said = Pose2(*(true.array + lower @ rng.standard_normal(3)))
        one, truth = estimate(said, lower @ lower.T), truth_of(true)
        rows.append(Row("a", one, truth, pose_error(one, truth, symmetric=False)))
    got = figures(rows)
    assert got.nees_mean == pytest.approx(3.0, abs=0.2)
    assert got.nees_median == pytest.approx(2.37, abs=0.2)
    assert got.nees_inside_95 == pytest.approx(0.95, abs=0.015)


def test_a_truth_without_heading_is_scored_by_position_alone() -> None:
    one = estimate(Pose2(-1.0, -0.51, 0.3))
    error = pose_error(one, Truth(1.0, 0.5, None), symmetric=True)
    assert (error.x_m, error.y_m) == pytest.approx((0.0, 0.01))
    assert (error.theta_rad, error.nees) == (None, None)
    assert not error.within(1.0, math.pi)
    assert pose_error(one, Truth(1.0, 0.5, None), symmetric=False).position_m > 2.0


def located(x_m: float, truth: Truth | None, time_s: float = 0.01) -> Row:
    one = estimate(Pose2(x_m, 0.0, 0.0))
    return Row("a", one, truth, truth and pose_error(one, truth, symmetric=False), time_s)


def test_figures_are_of_all_images() -> None:
    here = Truth(0.0, 0.0, 0.0)
    rows = [
        located(0.03, here, 0.010),
        located(-0.04, here, 0.020),
        located(0.08, here, 0.030),
        located(2.0, None, 0.040),
        Row("dark", truth=here, time_s=0.050, reason="too dark"),
        Row("torn", truth=here, reason="truncated", failed=True),
        Row("unknown", reason="too dark", time_s=0.060),
        located(0.06, Truth(0.0, 0.0, None), 0.070),
    ]
    got = figures(rows)
    assert (got.images, got.located) == (8, 5)
    assert got.within_5cm_3deg == pytest.approx(2 / 8)
    assert got.within_10cm_5deg == pytest.approx(3 / 8)
    assert got.median_error_m == pytest.approx(0.05)
    assert got.median_error_rad == 0.0
    assert got.rms_x_m == pytest.approx(math.sqrt((0.03**2 + 0.04**2 + 0.08**2 + 0.06**2) / 4))
    assert (got.rms_y_m, got.rms_theta_rad) == (0.0, 0.0)
    assert got.nees_mean == pytest.approx((0.03**2 + 0.04**2 + 0.08**2) / 4e-4 / 3)
    assert got.median_ms == pytest.approx(40.0)


def test_without_truth_there_are_no_error_figures() -> None:
    got = figures([located(1.0, None), Row("b", reason="dark")])
    assert (got.images, got.located) == (2, 1)
    for value in (got.within_5cm_3deg, got.median_error_m, got.rms_x_m, got.rms_theta_rad, got.nees_mean):
        assert value is None


def test_nothing_located_is_nothing_within() -> None:
    got = figures([Row("a", truth=Truth(0, 0, 0.0), reason="dark")])
    assert (got.within_5cm_3deg, got.within_10cm_5deg, got.median_error_m, got.median_ms) == (0.0, 0.0, None, None)


def test_a_singular_covariance_makes_no_mean() -> None:
    one = estimate(Pose2(0.1, 0, 0), np.zeros((3, 3)))
    truth = Truth(0, 0, 0.0)
    row = Row("a", one, truth, pose_error(one, truth, symmetric=False))
    assert row.error is not None
    assert row.error.nees == math.inf
    got = figures([row])
    assert (got.nees_mean, got.nees_median, got.nees_inside_95) == (None, None, 0.0)


def test_the_worst_come_first() -> None:
    here = Truth(0.0, 0.0, 0.0)
    rows = [
        Row("torn", reason="x", failed=True),
        Row("dark", reason="x"),
        located(0.5, here),
        located(0.1, here),
        located(9.0, None),
    ]
    assert sorted(rows, key=lambda row: row.severity, reverse=True) == rows
