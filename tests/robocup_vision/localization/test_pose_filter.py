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
from robocup_vision.localization.pose_filter import FrameErrors, OdometryNoise, PoseFilter

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
    for _ in range(9):
        see(truth.half_turn(), True)
        assert filter_.belief.pose.error_to(truth)[0] < 0.01
    for _ in range(15):
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


def random_drive(rng, count=25):
    """Odometry, and frames of a robot that drives: some open, some wrong, some of the wrong half, some missing."""
    truth, steps, frames = Pose2(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3, 3)), [STILL], []
    for index in range(count):
        seen = noisy(truth, rng)
        kind = rng.random()
        if kind < 0.1:
            seen = Pose2(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3, 3))
        elif kind < 0.2:
            seen = seen.half_turn()
        if kind < 0.8 or index == 0:
            frames.append((index, told(seen, half=bool(rng.random() < 0.5), std=STD * rng.uniform(0.5, 2.0))))
        steps.append(Pose2(*rng.uniform(-0.02, 0.02, 2), rng.uniform(-0.1, 0.1)))
        truth = truth.compose(steps[-1])
    return steps, frames


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


@settings(deadline=None, max_examples=15)
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


@settings(deadline=None, max_examples=15)
@given(seeds)
def test_frames_turned_by_half_make_a_belief_turned_by_half(seed):
    steps, frames = random_drive(np.random.default_rng(seed))
    straight = drive(frames, steps).hypotheses
    turned = drive([(at, estimate.half_turn()) for at, estimate in frames], steps).hypotheses
    assert_same(straight, turned, move=Pose2.half_turn, turn=np.diag([-1.0, -1.0, 1.0]))


@settings(deadline=None, max_examples=15)
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


@settings(deadline=None, max_examples=15)
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


@settings(deadline=None, max_examples=12)
@given(seeds)
def test_the_order_in_which_frames_come_does_not_matter(seed):
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


@settings(deadline=None, max_examples=15)
@given(seeds)
def test_a_late_frame_is_worth_what_it_would_have_been_in_time(seed):
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


@settings(deadline=None, max_examples=20)
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


@settings(deadline=None, max_examples=20)
@given(poses(1.0), seeds)
def test_wheels_that_spin_do_not_carry_the_belief_away(start, seed):
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


@pytest.mark.parametrize("lasting_share", [0.0, 0.5, 0.9])
def test_covariance_is_honest_when_errors_last_as_long_as_was_said(lasting_share):
    rng = np.random.default_rng(4)
    nees = []
    for _ in range(12):
        filter_ = PoseFilter(
            frames=FrameErrors(lasting_share=lasting_share),
            odometry=OdometryNoise(slip_share=1e-3, push_m=1e-4, push_rad=1e-4),
        )
        lasting = rng.standard_normal(3)
        truth = Pose2(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3, 3))
        for k in range(30):
            filter_.predict(STILL, k * DT)
            white = rng.standard_normal(3)
            error = STD * (math.sqrt(lasting_share) * lasting + math.sqrt(1 - lasting_share) * white)
            filter_.update(told(Pose2(*(truth.array + error))), k * DT)
        offset = filter_.belief.pose.array - truth.array
        offset[2] = math.remainder(offset[2], math.tau)
        nees.append(offset @ np.linalg.solve(filter_.belief.covariance, offset))
        # a robot that stands does not learn what its frames get wrong together
        assert filter_.belief.std[0] >= 0.99 * math.sqrt(lasting_share) * STD[0]
    # a mean of 12 is chi squared with 36 degrees of freedom, over 12: 99.8 % lie within
    assert 1.3 < np.mean(nees) < 5.5


def test_the_same_calls_give_the_same_belief_bit_for_bit():
    steps, frames = random_drive(np.random.default_rng(9))
    first, second = (drive(frames, steps).hypotheses for _ in range(2))
    assert [(h.pose, h.probability) for h in first] == [(h.pose, h.probability) for h in second]
    assert all(np.array_equal(a.covariance, b.covariance) for a, b in zip(first, second, strict=True))


def test_covariances_that_are_none_tell_nothing_and_those_of_zero_are_taken():
    filter_, truth, t_s = run(Pose2(0.1, 0.2, 0.3), 5, np.random.default_rng(1))
    before = filter_.belief.pose
    for wrong in (np.diag([1e-4, -1e-4, 1e-4]), np.array([[1e-4, 5e-5, 0], [0, 1e-4, 0], [0, 0, 1e-4]])):
        filter_.update(PoseEstimate(Pose2(0.0, 0.0, 0.0), wrong, 0.9, 0.3), t_s)
    assert filter_.belief.pose == before
    filter_.update(told(truth, std=np.zeros(3)), t_s)
    filter_.update(told(truth, std=np.zeros(3)), t_s)
    assert filter_.belief.pose.error_to(truth)[0] < 1e-5


@pytest.mark.parametrize("name", ["slip_share", "slip_s", "push_m", "push_rad", "shove_per_s", "kidnap_per_s"])
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_odometry_noise_of_no_sense_is_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name} of the odometry must"):
        OdometryNoise(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("lasting_share", 1.0),
        ("lasting_share", -0.1),
        ("lasting_m", 0.0),
        ("outlier_rate", 0.0),
        ("half_error_rate", 0.5),
        ("spell_s", math.nan),
    ],
)
def test_frame_errors_of_no_sense_are_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name} of the frames must"):
        FrameErrors(**{name: value})
