"""What frames make of several places: outliers, halves of the field, kidnapping, shoves, and what each is worth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_frames import DT, STD, STILL, noisy, random_drive, run, seeds, told
from strategies import numbers, poses

from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import FrameErrors, PoseFilter


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


def test_frames_without_a_pose_after_a_contradiction_leave_the_most_probable_pose_a_prior():
    filter_, truth, wrong_s = run(Pose2(0.4, -0.3, 1.0), 20, np.random.default_rng(2))
    filter_.update(told(Pose2(truth.x_m + 0.07, truth.y_m, truth.theta_rad + 0.1)), wrong_s)
    for step in range(1, 60):
        t_s = wrong_s + step * DT
        filter_.predict(STILL, t_s)
        prior = filter_.prior(t_s)
        if step * DT < FrameErrors().spell_s - 1e-6:
            assert prior is None
        elif step * DT > FrameErrors().spell_s + 1e-6:
            assert prior == filter_.belief.pose
            assert prior.error_to(truth)[0] < 0.03


@pytest.mark.slow
@given(poses(1.2), poses(1.2), seeds, st.booleans())
def test_a_kidnapped_robot_is_found_within_a_second_though_a_third_of_the_frames_are_lost(start, place, seed, half):
    """Only this finds a belief that holds out against most of a second's frames."""
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


@pytest.mark.slow
@given(poses(1.2), seeds)
def test_frames_that_disagree_with_each_other_found_no_belief(start, seed):
    """Only this finds a belief that wrong frames carry away although no two agree."""
    rng = np.random.default_rng(seed)
    filter_, truth, t_s = run(start, 30, rng)
    for _ in range(40):
        t_s += DT
        filter_.predict(STILL, t_s)
        filter_.update(told(Pose2(*rng.uniform(2.0, 9.0, 2), rng.uniform(-3, 3))), t_s)
    assert filter_.belief.pose.error_to(truth)[0] < 0.05


@settings(max_examples=12)
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


def test_the_half_is_open_until_a_frame_reports_it_and_then_turned_only_by_many():
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
    for _ in range(9):
        see(truth.half_turn(), True)
        assert filter_.belief.pose.error_to(truth)[0] < 0.01
    for _ in range(15):
        see(truth.half_turn(), True)
    assert filter_.belief.pose.error_to(truth.half_turn())[0] < 0.01


@settings(max_examples=15)
@given(seeds)
def test_hypotheses_have_probabilities_that_sum_to_one_and_honest_matrices(seed):
    steps, frames = random_drive(np.random.default_rng(seed))
    filter_ = PoseFilter()
    assert filter_.hypotheses == ()
    for index, step in enumerate(steps):
        filter_.predict(step, index * DT)
        for at, estimate in frames:
            if at == index:
                filter_.update(estimate, at * DT)
        told_ = filter_.hypotheses
        chances = [h.probability for h in told_]
        assert sum(chances) == pytest.approx(1.0, abs=1e-12)
        assert chances == sorted(chances, reverse=True)
        assert min(chances) > 0
        assert filter_.belief.pose == told_[0].pose
        for hypothesis in told_:
            np.testing.assert_allclose(hypothesis.covariance, hypothesis.covariance.T, atol=1e-15)
            assert np.linalg.eigvalsh(hypothesis.covariance).min() > 0
            with pytest.raises(ValueError, match="read-only"):
                hypothesis.covariance[0, 0] = 1.0


def test_bayes_weighs_the_half_by_how_often_frames_tell_it_wrongly():
    truth = Pose2(0.4, 0.3, 1.0)
    filter_ = PoseFilter(frames=FrameErrors(half_error_rate=0.1))
    for seconds, odds in ((0.0, 9.0), (10.0, 81.0), (20.0, 729.0), (30.0, 6561.0), (40.0, 9999.0)):
        filter_.predict(STILL, seconds)
        filter_.update(told(truth), seconds)
        first, second = filter_.hypotheses
        assert first.probability / second.probability == pytest.approx(odds, rel=1e-6)
        assert second.pose == first.pose.half_turn()
    # at once after one that told a half, another like it says little more
    filter_ = PoseFilter(frames=FrameErrors(half_error_rate=0.1))
    for seconds in (0.0, 0.001):
        filter_.predict(STILL, seconds)
        filter_.update(told(truth), seconds)
    assert filter_.hypotheses[0].probability == pytest.approx(0.9, abs=0.001)


@pytest.mark.parametrize("rate_hz", [5, 10, 30, 60])
def test_a_spell_of_the_wrong_half_is_outlived_at_any_frame_rate_and_a_turned_robot_is_noticed_in_a_second(rate_hz):
    truth, filter_ = Pose2(0.4, 0.3, 1.0), PoseFilter()
    for k in range(5 * rate_hz):
        filter_.predict(STILL, k / rate_hz)
        filter_.update(told(truth), k / rate_hz)
    for k in range(rate_hz + 1):
        filter_.predict(STILL, 5 + k / rate_hz)
        filter_.update(told(truth.half_turn()), 5 + k / rate_hz)
        if k / rate_hz < 0.25:
            assert filter_.belief.pose.error_to(truth)[0] < 0.01
    assert filter_.belief.pose.error_to(truth.half_turn())[0] < 0.01


@settings(max_examples=15)
@given(poses(1.0), seeds, numbers(-3.1, 3.1))
def test_a_shoved_robot_is_found_in_a_fifth_of_a_second_in_its_own_half(start, seed, direction):
    rng = np.random.default_rng(seed)
    filter_, truth, t_s = run(start, 20, rng)
    shoved = Pose2(truth.x_m + 0.04 * math.cos(direction), truth.y_m + 0.04 * math.sin(direction), truth.theta_rad)
    for _ in range(6):
        t_s += DT
        filter_.predict(STILL, t_s)
        # no frame tells the half any more; none is an outlier
        x, y, theta = shoved.array + STD * np.clip(rng.standard_normal(3), -2, 2)
        filter_.update(told(Pose2(x, y, theta), half=False), t_s)
    assert filter_.belief.pose.error_to(shoved)[0] < 0.02
    assert all(candidate.error_to(shoved)[0] < 0.1 for candidate in filter_.belief.candidates)
    assert abs(math.remainder(filter_.belief.pose.theta_rad - shoved.theta_rad, math.tau)) < 0.1


@pytest.mark.slow
@given(poses(1.0), seeds)
def test_wheels_that_spin_do_not_carry_the_belief_away(start, seed):
    """Only this finds odometry that outweighs two seconds of frames."""
    rng = np.random.default_rng(seed)
    filter_, truth, t_s = run(start, 20, rng)
    errors = []
    for _ in range(60):
        t_s += DT
        filter_.predict(Pose2(0.5 * DT, 0.0, 0.0), t_s)
        x, y, theta = truth.array + STD * np.clip(rng.standard_normal(3), -2, 2)
        filter_.update(told(Pose2(x, y, theta)), t_s)
        errors.append(filter_.belief.pose.error_to(truth)[0])
    assert max(errors) < 0.08
    assert np.mean(errors[15:]) < 0.02


def test_a_frame_with_two_places_is_held_open_until_one_is_seen_no_more():
    here, there = Pose2(0.4, 0.3, 1.0), Pose2(-0.9, 0.5, -2.0)
    filter_ = PoseFilter()
    filter_.predict(STILL, 0.0)
    filter_.update(PoseEstimate(there, np.diag(STD**2), 0.9, 0.3, (there, here)), 0.0)
    assert {h.pose for h in filter_.hypotheses[:2]} == {here, there}
    assert filter_.hypotheses[0].probability == pytest.approx(filter_.hypotheses[1].probability)
    assert len(filter_.belief.candidates) == 2
    for k in range(20):
        filter_.predict(STILL, (k + 1) * DT)
        filter_.update(told(here), (k + 1) * DT)
    assert filter_.belief.pose.error_to(here)[0] < 1e-3
    assert filter_.belief.candidates == (filter_.belief.pose,)
    # of several, the one nearest to where the robot was put is believed
    filter_ = PoseFilter()
    filter_.expect(here)
    filter_.update(PoseEstimate(there, np.diag(STD**2), 0.9, 0.3, (there, here)), 0.0)
    assert filter_.belief.pose == here


def test_hypotheses_that_come_to_the_same_place_become_one():
    truth = Pose2(0.4, 0.3, 1.0)
    rival = Pose2(0.4 + 6 * STD[0], 0.3, 1.0)
    filter_ = PoseFilter()
    filter_.predict(STILL, 0.0)
    filter_.update(PoseEstimate(truth, np.diag(STD**2), 0.9, 0.3, (truth, rival)), 0.0)
    assert len(filter_.hypotheses) == 4
    middle = Pose2(0.4 + 3 * STD[0], 0.3, 1.0)
    for k in range(20):
        filter_.predict(STILL, (k + 1) * DT)
        filter_.update(told(middle), (k + 1) * DT)
    assert len(filter_.hypotheses) == 2
    assert filter_.belief.pose.error_to(middle)[0] < STD[0]


def test_covariances_that_are_none_tell_nothing_and_those_of_zero_are_taken():
    filter_, truth, t_s = run(Pose2(0.1, 0.2, 0.3), 5, np.random.default_rng(1))
    before = filter_.belief.pose
    for wrong in (np.diag([1e-4, -1e-4, 1e-4]), np.array([[1e-4, 5e-5, 0], [0, 1e-4, 0], [0, 0, 1e-4]])):
        filter_.update(PoseEstimate(Pose2(0.0, 0.0, 0.0), wrong, 0.9, 0.3), t_s)
    assert filter_.belief.pose == before
    filter_.update(told(truth, std=np.zeros(3)), t_s)
    filter_.update(told(truth, std=np.zeros(3)), t_s)
    assert filter_.belief.pose.error_to(truth)[0] < 1e-5
