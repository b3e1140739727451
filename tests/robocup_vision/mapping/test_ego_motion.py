"""Ego-motion: what holds of any scene, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.mapping import EgoMotion, EgoMotionSettings, Motion

COUNT, STD = 128, 0.01
# odometry that is off by some centimetres and degrees
LOOSE = np.diag([0.03, 0.03, 0.05]) ** 2
TIGHT = np.diag([0.002, 0.002, 0.004]) ** 2
NOWHERE = Pose2(0.0, 0.0, 0.0)
ROOM = np.array([[-1.5, -1.0], [1.7, -0.9], [1.6, 0.6], [0.9, 1.2], [-1.2, 1.1]])
STANDING = ((0.8, -0.4), (-0.7, 0.5))

seeds = st.integers(0, 2**32 - 1)
errors = st.tuples(st.floats(-0.04, 0.04), st.floats(-0.04, 0.04), st.floats(-0.07, 0.07))
motions = st.builds(Pose2, st.floats(-0.08, 0.08), st.floats(-0.08, 0.08), st.floats(-0.2, 0.2))


def profile(pose, discs=STANDING, count=COUNT, room=ROOM):
    """(count,) inverse range of a room's walls and of discs of 0.09 m, seen from a pose."""
    angle = pose.theta_rad + np.arange(count) * math.tau / count
    ray, at = np.stack([np.cos(angle), np.sin(angle)], axis=1), pose.array[:2]
    inverse = np.zeros(count)
    for start, end in zip(room, np.roll(room, -1, axis=0), strict=True):
        normal = np.array([start[1] - end[1], end[0] - start[0]])
        # of a convex room, the nearest wall is the largest inverse range
        inverse = np.maximum(inverse, ray @ normal / (normal @ (start - at)))
    for disc in discs:
        toward = ray @ (np.array(disc) - at)
        root = toward**2 - np.sum((np.array(disc) - at) ** 2) + 0.09**2
        hit = (root > 0) & (toward > 0)
        inverse[hit] = np.maximum(inverse[hit], 1 / (toward[hit] - np.sqrt(root[hit])))
    return inverse


def off_by(pose, error):
    """Let odometry err."""
    return Pose2(*(pose.array + error))


@given(motions, errors, st.floats(-math.pi, math.pi))
def test_a_motion_is_recovered_from_wrong_odometry_wherever_the_scene_lies(motion, error, heading):
    start = Pose2(0.2, -0.1, heading)
    ego = EgoMotion(COUNT)
    first = ego.update(profile(start), STD, NOWHERE, LOOSE, 0.0)
    assert (first.profiles, first.agreement, first.pose) == (0, 0.0, NOWHERE)
    found = ego.update(profile(start.compose(motion)), STD, off_by(motion, error), LOOSE, 0.1)
    assert found.profiles == 1
    assert found.agreement > 0.8
    way, turn = found.motion.error_to(motion)
    assert way < 0.004
    assert turn < 0.006
    assert found.pose.error_to(motion) == pytest.approx((way, turn))


def test_a_profile_that_odometry_cannot_explain_is_searched_for():
    start, motion = Pose2(0.2, -0.1, 0.4), Pose2(0.10, -0.05, 0.3)
    ego = EgoMotion(COUNT)
    wide = np.diag([0.1, 0.1, 0.3]) ** 2
    ego.update(profile(start), 0.004, NOWHERE, wide, 0.0)
    found = ego.update(profile(start.compose(motion)), 0.004, Pose2(-0.05, 0.1, -0.2), wide, 0.1)
    assert found.agreement > 0.8
    way, turn = found.motion.error_to(motion)
    assert way < 0.004
    assert turn < 0.006


def test_what_drives_along_does_not_take_the_pose_with_it():
    errors = []
    for count in (1, 5):
        ego = EgoMotion(COUNT, EgoMotionSettings(profiles=count, spacing_s=0.0))
        for index in range(12):
            discs = [(0.4 + 0.01 * index, 0.3), (-0.5 + 0.01 * index, -0.4), (0.01 * index, 0.5), (0.01 * index, -0.5)]
            found = ego.update(profile(NOWHERE, discs), STD, NOWHERE, TIGHT, index / 30)
        errors.append(found.pose.error_to(NOWHERE)[0])
    # they have driven 110 mm
    assert max(errors) < 0.02
    assert errors[1] < 0.006


def test_covariance_is_as_large_as_the_errors():
    rng = np.random.default_rng(5)
    squared, spread = [], []
    for _ in range(12):
        pose, ego = (
            Pose2(*rng.uniform(-0.3, 0.3, 2), rng.uniform(-3, 3)),
            EgoMotion(COUNT, EgoMotionSettings(spacing_s=0.1)),
        )
        motion = Pose2(0.012, 0.004, 0.02)
        for index in range(8):
            pose = pose.compose(motion) if index else pose
            odometry = off_by(motion, rng.multivariate_normal(np.zeros(3), TIGHT)) if index else NOWHERE
            noisy = profile(pose) + rng.normal(0, STD, COUNT)
            found = ego.update(noisy, STD, odometry, TIGHT, index / 30)
            if index:
                error = found.motion.array - motion.array
                squared.append(error @ np.linalg.solve(found.covariance, error))
                spread.append(np.trace(found.covariance) / np.trace(TIGHT))
    assert 1.5 < np.mean(squared) < 5.0
    assert np.mean(spread) < 0.8


def test_earlier_profiles_are_taken_as_far_apart_as_asked():
    ego = EgoMotion(COUNT, EgoMotionSettings(profiles=3, spacing_s=0.1))
    used = [ego.update(profile(NOWHERE), STD, NOWHERE, TIGHT, index * 0.05).profiles for index in range(7)]
    # the last frame's, and those 0.1 s and 0.2 s before that
    assert used == [0, 1, 1, 2, 2, 3, 3]


def test_a_frame_that_shows_nothing_leaves_odometry_alone():
    ego = EgoMotion(COUNT)
    ego.update(profile(NOWHERE), 0.003, NOWHERE, TIGHT, 0.0)
    odometry = Pose2(0.02, 0.01, 0.1)
    blind = ego.update(np.full(COUNT, np.nan), 0.003, odometry, TIGHT, 0.1)
    assert (blind.motion, blind.profiles, blind.agreement) == (odometry, 0, 0.0)
    np.testing.assert_array_equal(blind.covariance, TIGHT)
    with pytest.raises(ValueError, match="read-only"):
        blind.covariance[0, 0] = 1.0
    # the frame after is compared with the one before it, and takes back what odometry drifted meanwhile
    found = ego.update(profile(Pose2(0.024, 0.006, 0.106)), 0.003, NOWHERE, TIGHT, 0.2)
    assert found.profiles == 1
    assert found.pose.error_to(Pose2(0.024, 0.006, 0.106))[0] < 0.002
    assert found.pose.error_to(odometry.compose(found.motion)) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_another_scene_is_not_taken_for_this_one():
    ego = EgoMotion(COUNT)
    ego.update(profile(NOWHERE), STD, NOWHERE, TIGHT, 0.0)
    found = ego.update(profile(NOWHERE, room=0.6 * ROOM, discs=()), STD, NOWHERE, TIGHT, 0.1)
    assert found.profiles == 0
    assert found.motion == NOWHERE


def test_the_first_frame_is_the_origin_whatever_the_wheels_did_before():
    ego = EgoMotion(COUNT)
    first = ego.update(profile(NOWHERE), STD, Pose2(0.5, 0.0, 1.0), LOOSE, 0.0)
    assert (first.motion, first.pose) == (Pose2(0.5, 0.0, 1.0), NOWHERE)


def test_forgetting_begins_anew():
    ego = EgoMotion(COUNT)
    ego.update(profile(NOWHERE), STD, NOWHERE, TIGHT, 5.0)
    ego.update(profile(NOWHERE), STD, Pose2(0.1, 0.0, 0.0), LOOSE, 5.1)
    ego.forget()
    again = ego.update(profile(NOWHERE), STD, NOWHERE, TIGHT, 0.0)
    assert isinstance(again, Motion)
    assert (again.profiles, again.pose) == (0, NOWHERE)


def test_too_few_bearings_are_refused():
    with pytest.raises(ArgumentError, match="bearings must be at least 8, got 7"):
        EgoMotion(7)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({0: np.ones(COUNT - 1)}, r"inverse_range_per_m must be \(128,\), got \(127,\)"),
        ({1: np.ones(3)}, r"std_per_m must be one number or \(128,\), got \(3,\)"),
        ({1: 0.0}, "std_per_m must be positive wherever there is a range"),
        ({1: math.nan}, "std_per_m must be positive wherever there is a range"),
        ({2: Pose2(math.nan, 0.0, 0.0)}, "odometry must be finite"),
        ({3: np.eye(2)}, r"odometry_covariance must be \(3, 3\) and positive definite"),
        ({3: np.zeros((3, 3))}, r"odometry_covariance must be \(3, 3\) and positive definite"),
        ({3: np.full((3, 3), math.inf)}, r"odometry_covariance must be \(3, 3\) and positive definite"),
        ({4: 1.0}, "t_s must be finite and later than the frame before, got 1.0"),
        ({4: math.nan}, "t_s must be finite and later than the frame before, got nan"),
    ],
)
def test_bad_input_is_refused_in_one_line_and_changes_nothing(wrong, message):
    ego = EgoMotion(COUNT)
    ego.update(profile(NOWHERE), STD, NOWHERE, TIGHT, 1.0)
    given = [profile(NOWHERE), STD, NOWHERE, TIGHT, 1.1]
    for place, value in wrong.items():
        given[place] = value
    with pytest.raises(ArgumentError, match=message) as refused:
        ego.update(*given)
    assert "\n" not in str(refused.value)
    assert ego.update(profile(NOWHERE), STD, NOWHERE, TIGHT, 1.2).profiles == 1


def test_zero_infinite_and_negative_ranges_mean_that_nothing_is_there():
    ego = EgoMotion(COUNT)
    inverse = profile(NOWHERE)
    ego.update(inverse, STD, NOWHERE, TIGHT, 0.0)
    inverse[::9], inverse[4::9], inverse[7::9] = 0.0, math.inf, -1.0
    std = np.where(inverse > 0, STD, 0.0)
    found = ego.update(inverse, np.where(np.isfinite(inverse), std, math.nan), NOWHERE, TIGHT, 0.1)
    assert found.profiles == 1
    assert found.pose.error_to(NOWHERE)[0] < 0.002
