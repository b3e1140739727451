"""The pose filter: odometry carries, frames correct, late ones count for when they were taken; no way is special."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pose_frames import DT, STD, STEP, STILL, noisy, random_drive, run, seeds, told
from strategies import numbers, poses

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import FrameErrors, OdometryNoise, PoseFilter, PoseFilterSettings


def test_nothing_is_believed_before_the_first_frame():
    filter_ = PoseFilter()
    filter_.predict(STILL, 0.0)
    filter_.update(NotLocated("dark"), 0.0)
    assert not filter_.belief
    assert "no frame has had a pose yet" in filter_.belief.reason
    assert filter_.prior(0.0) is None


@settings(max_examples=15)
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


@given(poses(1.5), seeds)
def test_without_frames_odometry_carries_the_belief_and_its_doubt_grows(start, seed):
    filter_, _, t_s = run(start, 1, np.random.default_rng(seed))
    before, step = filter_.belief, Pose2(0.01, -0.02, 0.05)
    place = before.pose
    for k in range(30):
        filter_.predict(step, t_s + (k + 1) * DT)
        place = place.compose(step)
    after = filter_.belief
    np.testing.assert_allclose(after.pose.array, place.array, atol=1e-9)
    assert np.all(after.std > before.std)
    assert np.linalg.eigvalsh(after.covariance).min() > 0


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


@given(poses(1.5), seeds, st.integers(1, 4), st.floats(0.0, 1.0))
def test_a_late_frame_is_expected_where_the_robot_was_believed_to_be_then(start, seed, late, fraction):
    rng = np.random.default_rng(seed)
    # wheels that turn a quarter too far: much of what is known is slip
    filter_, _, t_s = run(start, 10, rng, scale=1.25)
    without, _, _ = run(start, 10, np.random.default_rng(seed), scale=1.25)
    for step in range(1, late + 1):
        filter_.predict(STEP, t_s + step * DT)
    at_s = t_s + fraction * DT
    without.predict(Pose2(*(fraction * STEP.array)), at_s)
    then = filter_.prior_estimate(at_s)
    assert filter_.prior(at_s) == then.pose
    np.testing.assert_allclose(then.pose.array, without.belief.pose.array, atol=1e-9)
    np.testing.assert_allclose(then.covariance, without.belief.covariance, atol=1e-9)


@given(poses(1.5), poses(0.1))
def test_the_first_odometry_after_a_frame_counts(start, step):
    filter_ = PoseFilter()
    filter_.update(told(start), 0.0)
    filter_.predict(step, 1.0)
    truth = start.compose(step)
    assert filter_.belief.pose.error_to(truth) == pytest.approx((0.0, 0.0), abs=1e-9)
    # with the errors that odometry has, and for what happened between the two
    assert np.linalg.det(filter_.belief.covariance) > np.linalg.det(told(start).covariance)
    assert filter_.prior(0.0).error_to(start) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert filter_.motion_since(0.0).error_to(step) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_odometry_that_no_robot_can_do_since_the_first_frame_is_not_believed():
    filter_, start = PoseFilter(), Pose2(0.4, -0.2, 1.0)
    filter_.update(told(start), 0.0)
    assert not filter_.can_move(Pose2(3.0, 0.0, 0.0), 0.04)
    filter_.predict(Pose2(3.0, 0.0, 0.0), 0.04)
    assert filter_.belief.pose.error_to(start)[0] < 1e-9
    assert filter_.belief.std[0] > 0.05


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


def drive(frames, steps, *, filter_=None, late=()):
    """Feed odometry, and frames (index of their step, estimate) in the order given, those of `late` at the end."""
    filter_ = filter_ or PoseFilter()
    for index, step in enumerate(steps):
        filter_.predict(step, index * DT)
        for at, estimate in frames:
            if at == index:
                filter_.update(estimate, at * DT)
    for at, estimate in late:
        filter_.update(estimate, at * DT)
    return filter_


def assert_same(left, right, *, move=None, turn=None):
    """Both say the same, the second after a motion of the field."""
    assert len(left) == len(right)
    # hypotheses of the same probability come in any order
    for one in left:
        place = one.pose if move is None else move(one.pose)
        other = min(right, key=lambda h: sum(h.pose.error_to(place)))
        assert other.probability == pytest.approx(one.probability, abs=1e-9)
        assert other.pose.error_to(place) == pytest.approx((0.0, 0.0), abs=1e-9)
        expected = one.covariance if turn is None else turn @ one.covariance @ turn.T
        np.testing.assert_allclose(other.covariance, expected, atol=1e-12, rtol=1e-7)


@settings(max_examples=15)
@given(seeds)
def test_frames_turned_by_half_make_a_belief_turned_by_half(seed):
    steps, frames = random_drive(np.random.default_rng(seed))
    straight = drive(frames, steps).hypotheses
    turned = drive([(at, estimate.half_turn()) for at, estimate in frames], steps).hypotheses
    assert_same(straight, turned, move=Pose2.half_turn, turn=np.diag([-1.0, -1.0, 1.0]))


@settings(max_examples=15)
@given(seeds, numbers(-3.1, 3.1))
def test_no_direction_of_the_field_is_special(seed, angle):
    steps, frames = random_drive(np.random.default_rng(seed))
    by = Pose2(0.0, 0.0, angle)
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])

    def turned(estimate):
        poses_ = tuple(by.compose(pose) for pose in estimate.candidates)
        return PoseEstimate(poses_[0], turn @ estimate.covariance @ turn.T, 0.9, 0.3, poses_)

    skewed = [(at, PoseEstimate(e.pose, e.covariance + 1e-5, 0.9, 0.3, e.candidates)) for at, e in frames]
    assert_same(
        drive(skewed, steps).hypotheses,
        drive([(at, turned(e)) for at, e in skewed], steps).hypotheses,
        move=by.compose,
        turn=turn,
    )


@settings(max_examples=15)
@given(poses(1.0), numbers(-0.5, 0.5), numbers(-0.5, 0.5), seeds)
def test_no_place_of_the_field_is_special_to_frames_that_tell_the_half(start, dx, dy, seed):
    rng = np.random.default_rng(seed)
    errors = STD * rng.standard_normal((15, 3))

    def believed(x, y):
        truth, frames, steps = Pose2(start.x_m + x, start.y_m + y, start.theta_rad), [], [STILL]
        for index, error in enumerate(errors):
            frames.append((index, told(Pose2(*(truth.array + error)))))
            steps.append(STEP)
            truth = truth.compose(STEP)
        return drive(frames, steps).belief

    here, there = believed(0.0, 0.0), believed(dx, dy)
    assert there.pose.error_to(Pose2(here.pose.x_m + dx, here.pose.y_m + dy, here.pose.theta_rad))[0] < 1e-9
    np.testing.assert_allclose(there.covariance, here.covariance, rtol=1e-7)


@pytest.mark.slow
@settings(max_examples=12)
@given(seeds)
def test_the_order_in_which_frames_come_does_not_matter(seed):
    """Only this finds late frames whose order changes the belief."""
    rng = np.random.default_rng(seed)
    steps, frames = random_drive(rng)
    frames += [(at, told(noisy(estimate.pose, rng))) for at, estimate in frames[::5]]
    # between two steps, too
    frames = [(at + float(rng.choice([0.0, 0.3, 0.7])), estimate) for at, estimate in frames]
    results = []
    for _ in range(3):
        results.append(drive([], steps, late=frames).hypotheses)
        rng.shuffle(frames)
    assert_same(results[0], results[1])
    assert_same(results[0], results[2])


@pytest.mark.slow
@settings(max_examples=15)
@given(seeds)
def test_a_late_frame_is_worth_what_it_would_have_been_in_time(seed):
    """Only this finds late frames that count less, or more, than punctual ones."""
    rng = np.random.default_rng(seed)
    steps, frames = random_drive(rng)
    # the first founds the belief; before it nothing is
    late = [frame for frame in frames[1:] if rng.random() < 0.5]
    punctual = [frame for frame in frames if not any(frame is other for other in late)]
    assert_same(drive(frames, steps).hypotheses, drive(punctual, steps, late=late[::-1]).hypotheses)


def test_frames_before_the_first_odometry_count_and_those_of_the_future_are_of_now():
    truth = Pose2(0.4, 0.3, 1.0)
    filter_ = PoseFilter()
    filter_.update(told(truth), 5.0)
    assert filter_.belief.pose == truth
    filter_.update(told(truth), 4.0)
    filter_.predict(Pose2(0.5, 0.0, 0.0), 4.9)
    assert filter_.belief.pose == truth
    filter_.update(told(truth), 100.0)
    filter_.predict(STEP, 5.0)
    assert filter_.belief.pose.error_to(truth.compose(STEP)) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_step_of_odometry_is_as_uncertain_in_pieces():
    start = Pose2(0.1, -0.2, 0.7)
    stds = []
    for pieces in (1, 2, 7):
        filter_ = PoseFilter()
        filter_.predict(STILL, 0.0)
        filter_.update(told(start), 0.0)
        for k in range(pieces):
            filter_.predict(Pose2(0.3 / pieces, 0.1 / pieces, 0.0), (k + 1) * 0.3 / pieces)
        stds.append(filter_.belief.std)
    # the heading's doubt, which comes during the step, bends the way a little more when it is cut
    for std in stds[1:]:
        np.testing.assert_allclose(std[:2], stds[0][:2], rtol=0.02)
        assert std[2] == pytest.approx(stds[0][2], rel=1e-9)


@pytest.mark.parametrize(("bias_ratio", "worse_rate"), [(0.0, 0.0), (0.5, 0.0), (0.9, 0.0), (0.2, 0.5), (0.5, 0.5)])
def test_covariance_is_honest_when_errors_last_as_long_as_was_said(bias_ratio, worse_rate):
    rng = np.random.default_rng(4)
    nees = []
    for _ in range(12):
        filter_ = PoseFilter(
            frames=FrameErrors(bias_ratio=bias_ratio),
            odometry=OdometryNoise(slip_ratio=1e-3, push_m=1e-4, push_rad=1e-4),
        )
        truth = Pose2(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3, 3))
        lasting, on_top = rng.standard_normal((2, 3))
        for k in range(60):
            filter_.predict(STILL, k * DT)
            worse = 3.0 if rng.random() < worse_rate else 1.0
            bias = lasting + math.sqrt(worse**2 - 1) * on_top
            error = STD * (math.sqrt(bias_ratio) * bias + math.sqrt(1 - bias_ratio) * worse * rng.standard_normal(3))
            filter_.update(told(Pose2(*(truth.array + error)), std=worse * STD), k * DT)
        offset = filter_.belief.pose.array - truth.array
        offset[2] = math.remainder(offset[2], math.tau)
        nees.append(offset @ np.linalg.solve(filter_.belief.covariance, offset))
        # a robot that stands does not learn what its frames get wrong together
        assert filter_.belief.std[0] >= 0.99 * math.sqrt(bias_ratio) * STD[0]
    # a mean of 12 is chi squared with 36 degrees of freedom, over 12: 99.8 % lie within
    assert 1.3 < np.mean(nees) < 5.5


def test_a_camera_that_looks_ahead_errs_anew_when_the_robot_has_turned():
    stds = []
    for turn_rad in (math.inf, 0.5):
        filter_, truth = PoseFilter(frames=FrameErrors(bias_ratio=0.5, bias_turn_rad=turn_rad)), Pose2(0.4, -0.2, 1.0)
        for k in range(60):
            filter_.predict(Pose2(0.0, 0.0, 0.1), k * DT)
            truth = truth.compose(Pose2(0.0, 0.0, 0.1)) if k else truth
            filter_.update(told(truth), k * DT)
        stds.append(filter_.belief.std[0])
    assert stds[1] < 0.8 * stds[0]


def test_the_common_error_comes_back_on_a_long_way_without_frames_and_stays_finite():
    filter_ = PoseFilter(frames=FrameErrors(bias_ratio=0.5))
    filter_.update(told(Pose2(0.0, 0.0, 0.0)), 0.0)
    for k in range(400):
        filter_.predict(Pose2(0.2, 0.0, 0.0), k / 30)
    for k in range(400, 430):
        filter_.predict(STILL, k / 30)
        filter_.update(told(Pose2(79.8, 0.0, 0.0)), k / 30)
    assert filter_.belief
    assert filter_.belief.std[0] == pytest.approx(math.sqrt(0.5) * STD[0], rel=0.3)


def test_the_same_calls_give_the_same_belief_bit_for_bit():
    steps, frames = random_drive(np.random.default_rng(9))
    first, second = (drive(frames, steps).hypotheses for _ in range(2))
    assert [(h.pose, h.probability) for h in first] == [(h.pose, h.probability) for h in second]
    assert all(np.array_equal(a.covariance, b.covariance) for a, b in zip(first, second, strict=True))


def blind_turn(scale, noise, seed, carried_away=False):
    """Turn to and fro with frames, then on without any; return how far the heading is off, and its doubt."""
    rng = np.random.default_rng(seed)
    filter_, truth, t_s = PoseFilter(odometry=noise), Pose2(0.4, -0.2, 1.0), 0.0
    for k in range(390):
        turn = 0.08 if k % 60 < 30 or k >= 360 else -0.08
        slip = 0.1 * turn * float(rng.standard_normal())
        filter_.predict(Pose2(0.01, 0.0, turn), t_s)
        truth = truth.compose(Pose2(scale * 0.01, 0.0, scale * turn + slip))
        if carried_away and k == 300:
            truth = Pose2(-1.0, 0.5, 2.0)
        if k < 360:
            filter_.update(told(noisy(truth, rng)), t_s)
        t_s += DT
    off_rad = math.remainder(filter_.belief.pose.theta_rad - truth.theta_rad, math.tau)
    return off_rad, filter_.belief.std[2]


@pytest.mark.parametrize(
    ("scale", "carried_away"),
    [(0.85, False), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((1.0, False), (1.15, True)))],
)
def test_what_lasts_of_the_odometrys_errors_is_learnt_and_carries_a_robot_that_turns_blindly(scale, carried_away):
    """The slow cases alone find a scale that is learnt where there is none, or of a robot that was carried."""
    calibrated, legs = OdometryNoise(slip_ratio=0.1), OdometryNoise(slip_ratio=0.1, gain_std=0.05)
    learnt = [blind_turn(scale, legs, seed, carried_away) for seed in range(2)]
    assert max(abs(off) for off, _ in learnt) < 0.12
    # and it knows how well it knows
    assert max(abs(off) / std for off, std in learnt) < 4.0
    if scale != 1.0:
        assert abs(blind_turn(scale, calibrated, 0, carried_away)[0]) > 0.2


@settings(max_examples=12)
@given(seeds, st.sampled_from([(3.0, 0.0, 0.0), (0.0, -40.0, 0.0), (0.0, 0.0, 3.1)]))
def test_odometry_that_no_robot_can_do_widens_and_moves_nothing(seed, glitch):
    rng = np.random.default_rng(seed)
    filter_, truth, t_s = run(Pose2(-0.3, 0.1, 0.4), 20, rng)
    before = filter_.belief
    filter_.predict(Pose2(*glitch), t_s + DT)
    assert sum(filter_.belief.pose.error_to(before.pose)) < 1e-9
    assert (filter_.belief.std > before.std).all()
    assert filter_.hypotheses[0].probability > 0.5
    # the frame decides: at once
    filter_.update(told(noisy(truth, rng)), t_s + DT)
    assert filter_.belief.pose.error_to(truth)[0] < 0.03
    assert filter_.belief.std[0] < 0.02


def test_a_late_frame_within_a_doubted_step_counts_at_its_time():
    truth = Pose2(-0.3, 0.1, 0.4)
    orders = []
    for late in (False, True):
        filter_ = PoseFilter()
        filter_.predict(STILL, 0.0)
        filter_.update(told(truth), 0.0)
        if late:
            filter_.predict(Pose2(30.0, 0.0, 0.0), 0.2)
            filter_.update(told(truth), 0.1)
        else:
            filter_.predict(STILL, 0.1)
            filter_.update(told(truth), 0.1)
            filter_.predict(Pose2(30.0, 0.0, 0.0), 0.2)
        orders.append(filter_.belief)
    assert orders[0].pose.error_to(orders[1].pose)[0] < 1e-3
    assert orders[0].std[0] == pytest.approx(orders[1].std[0], rel=0.05)


def test_limits_of_a_slow_robot_doubt_more():
    slow = PoseFilterSettings(max_speed_mps=0.6, jitter_s=0.0)
    assert slow.is_possible(Pose2(0.019, 0.0, 0.0), DT)
    assert not slow.is_possible(Pose2(0.021, 0.0, 0.0), DT)
    assert PoseFilterSettings().is_possible(Pose2(0.19, 0.0, 0.9), DT)
    with pytest.raises(ArgumentError, match="jitter_s must not be negative, got -1"):
        PoseFilterSettings(jitter_s=-1.0)


def test_within_walls_no_pose_is_beyond_them():
    field = load_field("ssl_2001")
    filter_ = PoseFilter(field=field)
    filter_.update(told(Pose2(1.2, 0.5, 0.0)), 0.0)
    filter_.predict(STILL, 0.0)
    for step in range(1, 40):
        filter_.predict(Pose2(0.03, 0.0, 0.0), step * DT)
        for hypothesis in filter_.hypotheses:
            assert field.is_on_floor(hypothesis.pose.x_m, hypothesis.pose.y_m)
