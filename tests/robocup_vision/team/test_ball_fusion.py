"""The ball as a team knows it: moved to now, nothing counted twice, and a lost robot left out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.team.ball_fusion import FORGET_S, OWN, TeamBall
from robocup_vision.team.message import BallSighting, TeamMessage


def seen(t_s, x_m, y_m, std_m=0.05, velocity=(0.0, 0.0)):
    return BallSighting(t_s, x_m, y_m, *velocity, std_m**2 * np.eye(2))


def told(sender, sighting, t_s=None):
    return TeamMessage(sender, sighting.t_s if t_s is None else t_s, "support", ball=sighting)


def team_of(*sightings, own=None, start=1):
    team = TeamBall()
    for sender, sighting in enumerate(sightings, start=start):
        team.update(told(sender, sighting), own)
    return team


def test_nobody_knows_the_ball_before_anybody_saw_it():
    assert TeamBall().fuse(None, 0.0) is None


def test_what_others_saw_is_moved_to_now():
    ball = team_of(seen(1.0, 0.5, 0.2, velocity=(1.0, 0.0))).fuse(None, 1.2)
    assert ball.x_m == pytest.approx(0.5 - math.expm1(-0.2), abs=1e-6)
    assert ball.y_m == pytest.approx(0.2)
    assert ball.vx_mps == pytest.approx(math.exp(-0.2))
    assert ball.sources == (1,)
    assert ball.covariance[0, 0] == pytest.approx(0.05**2 + 0.03**2 + (0.3 * 0.2) ** 2)


def test_an_old_sighting_is_forgotten():
    team = team_of(seen(1.0, 0.5, 0.2))
    assert team.fuse(None, 1.0 + FORGET_S) is not None
    assert team.fuse(None, 1.1 + FORGET_S) is None


@given(st.integers(1, 6), st.floats(0.01, 0.5))
def test_the_same_sighting_told_often_is_not_counted_twice(copies, std_m):
    one = seen(1.0, 0.3, -0.2, std_m)
    ball = team_of(*[one] * copies).fuse(None, 1.0)
    alone = team_of(one).fuse(None, 1.0)
    np.testing.assert_allclose(ball.covariance, alone.covariance, rtol=1e-9)
    assert (ball.x_m, ball.y_m) == pytest.approx((0.3, -0.2))


@given(st.lists(st.tuples(st.floats(0.02, 0.4), st.floats(0.02, 0.4), st.floats(0.0, math.pi)), min_size=1, max_size=4))
def test_fused_is_at_least_as_good_as_the_best_and_never_better_than_the_best_direction(shapes):
    sightings = []
    for long_m, short_m, turn in shapes:
        c, s = math.cos(turn), math.sin(turn)
        axes = np.array([[c, -s], [s, c]])
        covariance = axes @ np.diag([long_m**2, short_m**2]) @ axes.T
        sightings.append(BallSighting(1.0, 0.1, 0.1, 0.0, 0.0, 0.5 * (covariance + covariance.T)))
    team = team_of(*sightings)
    ball = team.fuse(None, 1.0)
    single = [team.moved(one, 1.0).covariance for one in sightings]
    assert np.trace(ball.covariance) <= min(map(np.trace, single)) * (1 + 1e-9)
    # no direction is known better than by the one that knows it best
    smallest = min(np.linalg.eigvalsh(one)[0] for one in single)
    assert np.linalg.eigvalsh(ball.covariance)[0] >= smallest * (1 - 1e-9)


def test_crossed_sightings_are_better_together():
    long, short = 0.4**2, 0.03**2
    one = BallSighting(1.0, 0.1, 0.0, 0.0, 0.0, np.diag([long, short]))
    other = BallSighting(1.0, 0.0, 0.1, 0.0, 0.0, np.diag([short, long]))
    ball = team_of(one, other).fuse(None, 1.0)
    assert math.hypot(ball.x_m, ball.y_m) < 0.02
    assert np.trace(ball.covariance) < 0.2 * long


def test_a_robot_that_sees_the_ball_goes_by_what_it_sees():
    team = team_of(seen(1.0, -2.0, -1.0), seen(1.0, -2.0, -1.0))
    ball = team.fuse(seen(1.0, 2.0, 1.0), 1.1)
    assert ball.sources == (OWN,)
    assert (ball.x_m, ball.y_m) == pytest.approx((2.0, 1.0))
    # once it is older the others, who agree with each other, know better
    assert team.fuse(seen(1.0, 2.0, 1.0), 1.5).sources == (1, 2)


def test_a_robot_in_the_wrong_half_is_not_fused():
    right = [seen(1.0, 1.5, 0.5), seen(0.9, 1.45, 0.5)]
    for wrong_place in range(3):
        sightings = [*right]
        sightings.insert(wrong_place, seen(1.0, -1.5, -0.5))
        ball = team_of(*sightings).fuse(None, 1.1)
        assert wrong_place + 1 not in ball.sources
        assert math.dist((ball.x_m, ball.y_m), (1.5, 0.5)) < 0.1


def test_a_robot_that_was_wrong_is_not_believed_alone_until_it_is_right_again():
    own, team = seen(1.0, 1.5, 0.5), TeamBall()
    team.update(told(1, seen(1.0, -1.5, -0.5)), own)
    assert team.trust(1) < 0
    assert team.fuse(None, 1.2) is None
    # two that agree are believed
    team.update(told(2, seen(1.1, -1.5, -0.5)), None)
    assert team.fuse(None, 1.2).sources == (2, 1)
    for k in range(3):
        team.update(told(1, seen(6.0 + k, 1.5, 0.5)), seen(6.0 + k, 1.5, 0.5))
    assert team.trust(1) > 0
    assert team.fuse(None, 8.2).sources == (1,)


def test_an_older_message_and_one_without_a_ball_change_nothing():
    team = team_of(seen(2.0, 1.0, 0.0))
    team.update(told(1, seen(1.0, -1.0, 0.0), t_s=2.5), None)
    team.update(TeamMessage(1, 3.0, "search"), None)
    assert team.fuse(None, 2.0).x_m == 1.0


def test_what_was_seen_before_the_ball_was_put_elsewhere_is_forgotten():
    team = team_of(seen(1.0, 1.0, 0.0))
    team.forget(1.2)
    assert team.fuse(None, 1.2) is None
    # a message of before that comes late
    team.update(told(1, seen(1.1, 1.0, 0.0)), None)
    assert team.fuse(None, 1.3) is None
    team.update(told(1, seen(1.3, 0.0, 0.0)), None)
    assert team.fuse(None, 1.3).x_m == 0.0


def test_what_is_not_there_is_forgotten():
    team = team_of(seen(1.0, 1.0, 0.0), seen(1.0, 1.0, 0.0))
    ball = team.fuse(None, 1.0)
    team.reject(ball.sources)
    assert team.fuse(None, 1.0) is None
    team.update(told(1, seen(1.5, 1.0, 0.0)), None)
    assert team.fuse(None, 1.5).sources == (1,)


def test_a_good_own_sighting_is_enough():
    team = TeamBall()
    assert team.is_own_enough(seen(1.0, 0.0, 0.0), 1.1)
    assert not team.is_own_enough(seen(1.0, 0.0, 0.0), 1.5)
    assert not team.is_own_enough(seen(1.0, 0.0, 0.0, std_m=0.2), 1.1)


def test_stated_errors_hold_for_late_sightings_of_a_ball_that_is_kicked_about():
    rng, within = np.random.default_rng(4), []
    for _ in range(400):
        place, velocity = np.zeros(2), 0.3 * rng.standard_normal(2)
        sightings = []
        for age_s in (0.9, 0.5, 0.2):
            std_m = rng.uniform(0.02, 0.15)
            # where the ball was so long ago, and what a robot saw of it
            then = place - age_s * velocity
            at = then + std_m * rng.standard_normal(2)
            sightings.append(BallSighting(1.0 - age_s, *at, 0.0, 0.0, std_m**2 * np.eye(2)))
        ball = team_of(*sightings).fuse(None, 1.0)
        error = np.array([ball.x_m, ball.y_m])
        within.append(float(error @ np.linalg.solve(ball.covariance, error)))
    # mean of a chi-square of two dimensions is 2; covariance intersection states too much rather than too little
    assert np.mean(within) < 2.0
    assert np.mean(np.array(within) > 9.2) <= 0.02
