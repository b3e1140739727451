"""The pose filter: odometry carries, frames correct, late ones count for when they were taken, halves, kidnapping."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import numbers, poses

from field_models.errors import ArgumentError
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.pose_filter import PoseFilter

STD = np.array([0.005, 0.005, 0.01])
DT = 1 / 30
STILL = Pose2(0.0, 0.0, 0.0)
STEP = Pose2(0.02, 0.0, 0.03)
seeds = st.integers(0, 2**32 - 1)


def told(pose, *, half=True, std=STD):
    return PoseEstimate(pose, np.diag(std**2), 0.9, 0.3, (pose,) if half else (pose, pose.half_turn()))


def noisy(pose, rng):
    x, y, theta = pose.array + STD * rng.standard_normal(3)
    return Pose2(x, y, theta)


def run(truth, steps, rng, *, scale=1.0, filter_=None, start_s=0.0, half=True):
    """Drive on with odometry of this scale, a frame a step; return the filter, the truth and the time at the end."""
    filter_ = filter_ or PoseFilter()
    felt = Pose2(scale * STEP.x_m, scale * STEP.y_m, scale * STEP.theta_rad)
    for _ in range(steps):
        start_s += DT
        filter_.predict(felt, start_s)
        truth = truth.compose(STEP) if filter_.belief else truth
        filter_.update(told(noisy(truth, rng), half=half), start_s)
    return filter_, truth, start_s


def test_nothing_is_believed_before_the_first_frame():
    filter_ = PoseFilter()
    filter_.predict(STILL, 0.0)
    filter_.update(NotLocated("dark"), 0.0)
    assert not filter_.belief
    assert "no frame has told a pose yet" in filter_.belief.reason
    assert filter_.prior(0.0) is None


@settings(deadline=None, max_examples=30)
@given(poses(1.5), seeds, st.sampled_from([0.8, 1.0, 1.2]))
def test_belief_stays_with_a_driving_robot_though_odometry_is_a_fifth_off(start, seed, scale):
    filter_, truth, _ = run(start, 60, np.random.default_rng(seed), scale=scale)
    offset = filter_.belief.pose.array - truth.array
    offset[2] = math.remainder(offset[2], math.tau)
    assert filter_.belief.candidates == (filter_.belief.pose,)
    assert math.hypot(*offset[:2]) < 0.03
    assert abs(offset[2]) < 0.05
    # and it knows how well it knows: 25 is beyond one in ten thousand
    assert offset @ np.linalg.solve(filter_.belief.covariance, offset) < 25.0


@settings(deadline=None, max_examples=30)
@given(poses(1.5), seeds)
def test_without_frames_odometry_carries_the_belief_and_its_doubt_grows(start, seed):
    filter_, _, t_s = run(start, 10, np.random.default_rng(seed))
    before, step = filter_.belief, Pose2(0.01, -0.02, 0.05)
    place = before.pose
    for k in range(30):
        filter_.predict(step, t_s + (k + 1) * DT)
        place = place.compose(step)
    after = filter_.belief
    np.testing.assert_allclose(after.pose.array, place.array, atol=1e-9)
    assert np.all(after.std > before.std)
    assert np.linalg.eigvalsh(after.covariance).min() > 0


@settings(deadline=None, max_examples=30)
@given(poses(1.5), st.lists(st.tuples(numbers(-0.03, 0.03), numbers(-0.03, 0.03), numbers(-0.2, 0.2)), min_size=4))
def test_a_late_frame_counts_for_when_it_was_taken(start, steps):
    steps = [Pose2(*step) for step in steps[:12]]
    filter_, truth, places = PoseFilter(), start, [start]
    filter_.predict(STILL, 0.0)
    filter_.update(told(start), 0.0)
    for k, step in enumerate(steps):
        filter_.predict(step, (k + 1) * DT)
        truth = truth.compose(step)
        places.append(truth)
    for late in (1, 3):
        index = len(steps) - late
        np.testing.assert_allclose(filter_.prior(index * DT).array[:2], places[index].array[:2], atol=1e-6)
        filter_.update(told(places[index]), index * DT)
        assert filter_.belief.pose.error_to(truth) == pytest.approx((0.0, 0.0), abs=1e-6)
    # halfway between two steps; and from before anything is remembered
    between = filter_.prior((len(steps) - 0.5) * DT)
    assert sum(between.error_to(places[-2])) <= sum(places[-1].error_to(places[-2])) + 1e-6
    unchanged = filter_.belief.pose
    filter_.update(told(Pose2(9.0, 9.0, 0.0)), -5.0)
    assert filter_.belief.pose == unchanged


@settings(deadline=None, max_examples=20)
@given(poses(1.2), seeds)
def test_one_wrong_frame_changes_nothing(start, seed):
    filter_, truth, t_s = run(start, 20, np.random.default_rng(seed))
    wrong = Pose2(truth.x_m + 0.7, truth.y_m - 0.6, truth.theta_rad + 1.0)
    filter_.predict(STILL, t_s + DT)
    before = filter_.belief.pose
    filter_.update(told(wrong), t_s + DT)
    assert filter_.belief.pose == before
    # in doubt the next frame is to stand alone
    assert filter_.prior(t_s) is None
    filter_, *_ = run(truth, 2, np.random.default_rng(seed), filter_=filter_, start_s=t_s + DT)
    assert filter_.prior(t_s) is not None


@settings(deadline=None, max_examples=30)
@given(poses(1.2), poses(1.2), seeds, st.booleans())
def test_a_kidnapped_robot_is_found_within_a_second_though_a_third_of_the_frames_are_lost(start, place, seed, half):
    rng = np.random.default_rng(seed)
    filter_, _, t_s = run(start, 30, rng, half=half)
    truth = place
    for _ in range(30):
        t_s += DT
        step = Pose2(0.01, 0.0, 0.02)
        filter_.predict(step, t_s)
        truth = truth.compose(step)
        if rng.random() > 0.3:
            filter_.update(told(noisy(truth, rng), half=half), t_s)
    error, turn = filter_.belief.pose.error_to(truth, symmetric=not half)
    assert error < 0.05
    assert turn < math.radians(3)


@settings(deadline=None, max_examples=20)
@given(poses(1.2), seeds)
def test_frames_that_disagree_with_each_other_found_no_belief(start, seed):
    rng = np.random.default_rng(seed)
    filter_, truth, t_s = run(start, 30, rng)
    for _ in range(40):
        t_s += DT
        filter_.predict(STILL, t_s)
        filter_.update(told(Pose2(*rng.uniform(2.0, 9.0, 2), rng.uniform(-3, 3))), t_s)
    assert filter_.belief.pose.error_to(truth)[0] < 0.05


@settings(deadline=None, max_examples=30)
@given(poses(1.2), seeds)
def test_frames_that_do_not_tell_the_half_keep_it(start, seed):
    rng = np.random.default_rng(seed)
    filter_, truth, t_s = run(start, 5, rng)
    for _ in range(60):
        t_s += DT
        filter_.predict(STILL, t_s)
        seen = noisy(truth, rng)
        filter_.update(told(seen.half_turn() if rng.random() < 0.5 else seen, half=False), t_s)
    assert filter_.belief.pose.error_to(truth)[0] < 0.03
    assert len(filter_.belief.candidates) == 1


def test_where_the_robot_was_put_orders_what_the_first_frame_allows():
    truth = Pose2(0.4, 0.3, 1.0)
    for expected, believed in ((truth, truth), (truth.half_turn(), truth.half_turn())):
        filter_ = PoseFilter()
        filter_.expect(Pose2(expected.x_m + 0.1, expected.y_m, expected.theta_rad))
        filter_.predict(STILL, 0.0)
        filter_.update(told(truth, half=False), 0.0)
        assert filter_.belief.pose.error_to(believed) == pytest.approx((0.0, 0.0), abs=1e-9)
        # but a frame that tells the half is believed
        filter_.update(told(truth), 0.0)
        assert filter_.belief.pose.error_to(truth)[0] < 1e-6


def test_the_half_is_open_until_a_frame_tells_it_and_then_turned_only_by_many():
    truth = Pose2(0.4, 0.3, 1.0)
    filter_ = PoseFilter()

    def see(pose, half):
        filter_.predict(STILL, see.t_s)
        filter_.update(told(pose, half=half), see.t_s)
        see.t_s += DT

    see.t_s = 0.0
    see(truth.half_turn(), False)
    assert len(filter_.belief.candidates) == 2
    see(truth, True)
    assert filter_.belief.pose.error_to(truth)[0] < 0.01
    assert len(filter_.belief.candidates) == 1
    for _ in range(20):
        see(truth, True)
    for _ in range(6):
        see(truth.half_turn(), True)
        assert filter_.belief.pose.error_to(truth)[0] < 0.01
    see(truth.half_turn(), True)
    assert filter_.belief.pose.error_to(truth.half_turn())[0] < 0.01


def test_a_robot_too_long_without_frames_is_lost_and_found_again_by_the_next():
    filter_, truth, t_s = run(Pose2(0.0, 0.0, 0.0), 5, np.random.default_rng(1))
    for _ in range(400):
        t_s += DT
        filter_.predict(Pose2(0.2, 0.0, 0.3), t_s)
    assert not filter_.belief
    assert "too long" in filter_.belief.reason
    assert filter_.prior(t_s) is None
    place = Pose2(0.5, -0.2, 2.0)
    filter_.update(told(place), t_s)
    assert filter_.belief.pose == place
    filter_.forget()
    assert not filter_.belief
    assert truth != place


def test_what_is_not_finite_never_enters():
    filter_, _, t_s = run(Pose2(0.1, 0.2, 0.3), 5, np.random.default_rng(1))
    before = filter_.belief.pose
    filter_.update(told(Pose2(math.nan, 0.0, 0.0)), t_s)
    filter_.update(told(Pose2(0.0, 0.0, 0.0), std=np.array([math.nan, 1.0, 1.0])), t_s)
    filter_.update(told(Pose2(0.0, 0.0, 0.0)), math.nan)
    assert filter_.belief.pose == before
    with pytest.raises(ArgumentError, match="odometry and its time must be finite"):
        filter_.predict(Pose2(math.nan, 0.0, 0.0), t_s + DT)
    with pytest.raises(ArgumentError, match="time must not run backwards"):
        filter_.predict(STILL, t_s - DT)
