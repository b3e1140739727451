"""Laws of angles, poses and the covariances that travel with them."""

import math

import numpy as np
import pytest
from hypothesis import given
from strategies import covariances, numbers, poses

from field_models.errors import ArgumentError
from robocup_vision.arrays import read_only
from robocup_vision.geometry import Pose2, compose_covariance, half_turn_covariance, wrap_angle

IDENTITY = Pose2(0.0, 0.0, 0.0)


def assert_same_pose(a: Pose2, b: Pose2) -> None:
    assert (a.x_m, a.y_m) == pytest.approx((b.x_m, b.y_m), abs=1e-9)
    assert wrap_angle(a.theta_rad - b.theta_rad) == pytest.approx(0.0, abs=1e-9)


@given(numbers(-1e6, 1e6))
def test_wrap_angle_keeps_the_direction_and_the_range(angle: float):
    wrapped = wrap_angle(angle)
    assert -math.pi < wrapped <= math.pi
    assert wrap_angle(wrapped) == wrapped
    assert (math.cos(wrapped), math.sin(wrapped)) == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-9)


@pytest.mark.parametrize("angle", [math.pi, -math.pi, 3 * math.pi, -3 * math.pi])
def test_half_turn_wraps_to_plus_pi(angle: float):
    assert abs(wrap_angle(angle)) == pytest.approx(math.pi)
    assert wrap_angle(math.pi) == wrap_angle(-math.pi) == math.pi


def test_pose_wraps_its_heading():
    assert Pose2(1.0, 2.0, math.tau + 0.5).theta_rad == pytest.approx(0.5)
    np.testing.assert_allclose(Pose2(1.0, 2.0, -0.5).array, [1.0, 2.0, -0.5])


@given(poses(), poses(), poses())
def test_composition_is_a_group(a: Pose2, b: Pose2, c: Pose2):
    assert_same_pose(a.compose(b).compose(c), a.compose(b.compose(c)))
    assert_same_pose(a.compose(IDENTITY), a)
    assert_same_pose(IDENTITY.compose(a), a)
    assert_same_pose(a.compose(a.inverse()), IDENTITY)
    assert_same_pose(a.inverse().compose(a), IDENTITY)
    assert_same_pose(a.compose(b).inverse(), b.inverse().compose(a.inverse()))


@given(poses(), poses(), numbers(-5, 5), numbers(-5, 5))
def test_transform_is_the_groups_action(a: Pose2, b: Pose2, x: float, y: float):
    point = np.array([x, y])
    np.testing.assert_allclose(a.compose(b).transform(point), a.transform(b.transform(point)), atol=1e-9)
    np.testing.assert_allclose(a.inverse().transform(a.transform(point)), point, atol=1e-9)
    np.testing.assert_allclose(a.transform([0.0, 0.0]), [a.x_m, a.y_m])


def test_transform_by_example():
    # a robot at (1, 2) that looks to the field's left: what is ahead of it lies at larger y, its left at smaller x
    pose = Pose2(1.0, 2.0, math.pi / 2)
    np.testing.assert_allclose(pose.transform([[0.5, 0.0], [0.0, 0.5]]), [[1.0, 2.5], [0.5, 2.0]], atol=1e-12)
    assert pose.transform(np.zeros((2, 3, 2))).shape == (2, 3, 2)
    assert_same_pose(pose.compose(Pose2(0.5, 0.0, -math.pi / 2)), Pose2(1.0, 2.5, 0.0))


@given(poses(), poses())
def test_half_turn_is_an_involution_of_the_field_frame(a: Pose2, b: Pose2):
    assert_same_pose(a.half_turn().half_turn(), a)
    assert_same_pose(a.half_turn(), Pose2(0.0, 0.0, math.pi).compose(a))
    assert_same_pose(a.half_turn().compose(b), a.compose(b).half_turn())


@given(poses(), poses())
def test_error_is_symmetric_and_modulo_a_half_turn_if_asked(a: Pose2, b: Pose2):
    assert a.error_to(b) == pytest.approx(b.error_to(a), abs=1e-9)
    assert a.error_to(a) == (0.0, 0.0)
    assert 0.0 <= a.error_to(b)[1] <= math.pi
    symmetric = sum(a.error_to(b, symmetric=True))
    assert symmetric <= sum(a.error_to(b)) + 1e-12
    assert symmetric == pytest.approx(sum(b.error_to(a, symmetric=True)), abs=1e-9)
    assert symmetric == pytest.approx(sum(a.half_turn().error_to(b, symmetric=True)), abs=1e-9)
    assert sum(a.half_turn().error_to(a, symmetric=True)) == pytest.approx(0.0, abs=1e-9)


def test_error_by_example():
    assert Pose2(3.0, 4.0, 3.1).error_to(Pose2(0.0, 0.0, -3.1)) == pytest.approx((5.0, math.tau - 6.2))
    # near the centre only the heading tells the halves apart
    assert Pose2(0.0, 0.01, 3.0).error_to(Pose2(0.0, 0.01, 0.0), symmetric=True) == pytest.approx((0.02, math.pi - 3))


@given(poses(), covariances(), poses(), covariances())
def test_composed_covariance_is_that_of_the_numeric_jacobian(
    first: Pose2, first_cov: np.ndarray, second: Pose2, second_cov: np.ndarray
):
    def moved(step: np.ndarray) -> np.ndarray:
        a, b = Pose2(*(first.array + step[:3])), Pose2(*(second.array + step[3:]))
        difference = a.compose(b).array - first.compose(second).array
        difference[2] = wrap_angle(difference[2])
        return difference

    h = 1e-6
    jacobian = np.stack([(moved(h * e) - moved(-h * e)) / (2 * h) for e in np.eye(6)], axis=1)
    joint = np.block([[first_cov, np.zeros((3, 3))], [np.zeros((3, 3)), second_cov]])
    expected = jacobian @ joint @ jacobian.T
    actual = compose_covariance(first, first_cov, second, second_cov)
    np.testing.assert_allclose(actual, expected, atol=1e-5 * max(1.0, np.abs(expected).max()))


@given(covariances())
def test_half_turn_covariance_is_that_of_the_turned_pose(covariance: np.ndarray):
    turned = half_turn_covariance(covariance)
    about_centre = compose_covariance(Pose2(0.0, 0.0, math.pi), np.zeros((3, 3)), Pose2(1.0, 2.0, 0.3), covariance)
    np.testing.assert_allclose(turned, about_centre, atol=1e-12)
    np.testing.assert_allclose(half_turn_covariance(turned), covariance)


def test_read_only_is_a_copy_nobody_writes_to():
    source = np.array([1, 2])
    frozen = read_only(source)
    source[0] = 7
    assert frozen.dtype == np.float64
    assert frozen[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        frozen[0] = 3.0


@pytest.mark.parametrize("theta_rad", [math.inf, -math.inf, "1", None, 1j])
def test_a_heading_that_is_no_finite_number_is_refused(theta_rad):
    with pytest.raises(ArgumentError, match="theta_rad must be a finite number, got"):
        Pose2(0.0, 0.0, theta_rad)
