"""Shots at a goal: their chances against drawn kicks, laws over places and defenders, and what is chosen."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.planning import Disc, MotionLimits, ShotPlanner

LINE_M, HALF_M, BALL_M = 1.37, 0.3, 0.0215
POSTS = ((LINE_M, HALF_M), (LINE_M, -HALF_M))
RUNNERS = MotionLimits(1.0, 1.2, 0.15)
# they stay where they are
STATUES = MotionLimits(1.0, 1e-6, 0.0)
KICK_RAD = 0.03


def planner(defenders: MotionLimits = RUNNERS, kick_std_rad: float = KICK_RAD) -> ShotPlanner:
    return ShotPlanner(POSTS, BALL_M, 1.43, kick_std_rad, defenders, 0.5, 2.0, 2.0, 8.0)


def at(x_m: float, y_m: float, std_m: float = 0.02, v_mps: tuple[float, float] = (0.0, 0.0)) -> Disc:
    return Disc(x_m, y_m, 0.09, np.eye(2) * std_m**2, vx_mps=v_mps[0], vy_mps=v_mps[1])


balls = st.tuples(st.floats(-1.0, 1.2), st.floats(-0.6, 0.6))
headings = st.floats(-math.pi, math.pi)
stds = st.floats(0.0, 0.1)
defenders = st.lists(
    st.builds(
        at,
        st.floats(-1.0, 1.4),
        st.floats(-0.7, 0.7),
        st.floats(1e-3, 0.1),
        st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)),
    ),
    max_size=4,
)


def chance(
    shots: ShotPlanner, ball: tuple[float, float], heading_rad: float, who: list[Disc], std_m: float, std_rad: float
) -> float:
    return float(shots.chances(np.array(ball), np.array(heading_rad), who, std_m, std_rad))


@given(balls, headings, defenders, stds, stds)
def test_more_defenders_never_help_and_the_other_side_is_alike(ball, heading_rad, who, std_m, std_rad):
    shots = planner()
    there = chance(shots, ball, heading_rad, who, std_m, std_rad)
    assert 0.0 <= there <= 1.0
    assert there <= chance(shots, ball, heading_rad, who[1:], std_m, std_rad)
    mirrored = [Disc(d.x_m, -d.y_m, d.radius_m, d.covariance, vx_mps=d.vx_mps, vy_mps=-d.vy_mps) for d in who]
    assert chance(shots, (ball[0], -ball[1]), -heading_rad, mirrored, std_m, std_rad) == pytest.approx(there, abs=1e-9)


@given(balls, headings, defenders, stds, stds)
def test_plan_is_never_worth_less_than_a_kick_now(ball, heading_rad, who, std_m, std_rad):
    shots = planner()
    plan = shots.plan(ball, heading_rad, who, std_m, std_rad)
    assert plan.chance_now == pytest.approx(chance(shots, ball, heading_rad, who, std_m, std_rad))
    if plan.action == "kick":
        assert plan.chance == plan.chance_now
    assert plan.chance >= plan.chance_now
    assert (plan.action == "go nearer") == (plan.place_m != ball)
    assert f"{plan.chance:.0%}" in plan.reason
    if plan.action == "kick":
        assert plan.heading_rad == heading_rad


@pytest.mark.parametrize("ball", [(0.9, 0.0), (0.5, 0.3), (0.0, -0.4)])
@pytest.mark.parametrize("off_rad", [-0.25, 0.0, 0.1])
def test_chance_between_the_posts_is_that_of_drawn_kicks(ball, off_rad):
    rng = np.random.default_rng(3)
    heading_rad = math.atan2(-ball[1], LINE_M - ball[0]) + off_rad
    drawn = heading_rad + 0.05 * rng.standard_normal(20000)
    y = ball[1] + (LINE_M - ball[0]) * np.tan(drawn)
    # the whole ball passes beside each post
    clear_m = HALF_M - BALL_M / np.cos(drawn)
    expected = float(np.mean((np.abs(y) < clear_m) & (np.abs(drawn) < 1.5)))
    assert chance(planner(kick_std_rad=0.03), ball, heading_rad, [], 0.0, 0.04) == pytest.approx(expected, abs=0.02)


@pytest.mark.parametrize("y_m", [0.0, 0.12, 0.2])
def test_chance_past_a_defender_is_that_of_drawn_places(y_m):
    rng = np.random.default_rng(4)
    places = np.array([1.0, y_m]) + 0.04 * rng.standard_normal((20000, 2))
    expected = float(np.mean(np.abs(places[:, 1]) > 0.09 + BALL_M))
    shots = planner(STATUES, kick_std_rad=1e-6)
    assert chance(shots, (0.5, 0.0), 0.0, [at(1.0, y_m, 0.04)], 0.0, 0.0) == pytest.approx(expected, abs=0.02)


def test_who_runs_for_the_ball_covers_more_of_a_goal_that_is_farther():
    keeper = [at(1.25, 0.0)]
    heading = [math.atan2(0.24, LINE_M - x) for x in (0.9, 0.1)]
    near, far = (chance(planner(), (x, 0.0), h, keeper, 0.01, 0.01) for x, h in zip((0.9, 0.1), heading, strict=True))
    assert near > 0.8 > 0.2 > far


def test_one_that_moves_is_met_where_it_will_be():
    shots = planner(STATUES)
    comes, goes = (chance(shots, (0.0, 0.0), 0.0, [at(1.0, 0.35, 0.02, (0.0, v))], 0.0, 0.0) for v in (-0.5, 0.5))
    assert comes < 0.05 < 0.95 < goes


@given(balls, headings, defenders, stds, st.floats(0.0, 3.0))
def test_chances_after_a_while_are_chances_too(ball, heading_rad, who, std_m, after_s):
    shots = planner()
    later = float(shots.chances(np.array(ball), np.array(heading_rad), who, std_m, 0.01, after_s))
    assert 0.0 <= later <= 1.0
    assert later <= float(shots.chances(np.array(ball), np.array(heading_rad), [], std_m, 0.01))


@pytest.mark.parametrize("away_m", [0.2, 0.3])
def test_a_keeper_that_has_left_its_goal_is_back_after_a_while(away_m):
    shots, ball, keeper = planner(), (0.9, 0.0), [at(1.25, away_m)]
    at_once, later, never = (
        float(shots.chances(np.array(ball), np.array(0.0), keeper, 0.01, 0.01, after_s)) for after_s in (0.0, 2.0, 0.1)
    )
    assert at_once > 0.9 > 0.05 > later
    # sooner than it sees anything it is where it was
    assert never == pytest.approx(at_once)


def test_faces_an_open_goal_kicks():
    plan = planner().plan((0.8, 0.0), 0.0, [], 0.01, 0.01)
    assert plan.action == "kick"
    assert plan.chance > 0.99


def test_does_not_kick_at_a_keeper_that_leaves_a_corner():
    plan = planner().plan((0.9, 0.0), 0.0, [at(1.27, -0.12)], 0.01, 0.01)
    assert plan.action != "kick"
    assert plan.place_m[1] + (LINE_M - plan.place_m[0]) * math.tan(plan.heading_rad) > 0.03


def test_who_is_pressed_does_not_go_far():
    ball, keeper = (0.4, 0.0), at(1.27, 0.0)
    runners = [at(0.45, 0.3), at(0.45, -0.3), at(0.2, 0.0, v_mps=(0.8, 0.0))]
    alone, pressed = (planner().plan(ball, 0.0, who, 0.01, 0.01) for who in ([keeper], [keeper, *runners]))
    assert math.dist(pressed.place_m, ball) < 0.75 * math.dist(alone.place_m, ball)


def test_what_promises_little_more_is_not_waited_for():
    ball, keeper = (0.85, 0.0), [at(1.27, -0.12)]
    heading_rad = math.atan2(0.2, LINE_M - 0.85)
    patient, hasty = (
        dataclasses.replace(planner(), slips_s=slips_s).plan(ball, heading_rad, keeper, 0.02, 0.02)
        for slips_s in (1e6, 0.5)
    )
    assert patient.action != "kick"
    assert patient.chance > patient.chance_now > 0.8
    assert hasty.action == "kick"


def test_goes_nearer_and_aside_of_one_that_stands_before_it():
    plan = planner().plan((0.2, 0.0), 0.0, [at(0.45, 0.0), at(1.25, 0.0)], 0.01, 0.01)
    assert plan.action == "go nearer"
    way = math.atan2(plan.place_m[1], plan.place_m[0] - 0.2)
    assert abs(way) > 0.3


@pytest.mark.parametrize(
    "name", ["ball_radius_m", "ball_mps", "kick_std_rad", "dribble_mps", "turn_rps", "lost_s", "slips_s"]
)
def test_refuses_what_is_not_positive(name):
    with pytest.raises(ArgumentError, match=f"{name} must be positive, got 0.0"):
        dataclasses.replace(planner(), **{name: 0.0})


def test_refuses_a_goal_too_narrow_for_the_ball():
    with pytest.raises(ArgumentError, match=r"a ball of 0.0215 m does not fit between the posts"):
        ShotPlanner(((1.0, 0.02), (1.0, -0.02)), BALL_M, 1.4, 0.03, RUNNERS, 0.5, 2.0, 2.0, 8.0)
