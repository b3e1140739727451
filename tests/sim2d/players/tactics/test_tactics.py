"""Tactics: what each role decides in plain situations."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from situations import situation

from field_models import load_field
from robocup_vision.geometry import Pose2
from robocup_vision.planning import ShotPlan
from robocup_vision.team.roles import ChosenRole
from sim2d.match.setups import setup_for
from sim2d.players.driving.motion import CALM_RPS, TURN_TIME_S
from sim2d.players.tactics.ball_holder import dash_m
from sim2d.players.tactics.tactics import Tactics
from sim2d.players.tactics.team_field import TacticsSettings
from sim2d.robot_link import RobotLimits

FIELD = load_field("ssl_2001")
LIMITS = RobotLimits()
DEFAULTS = TacticsSettings()
BLOCKS = TacticsSettings(block_widths=4 / 3)


def decide(number=1, players=2, settings=DEFAULTS, pose=Pose2(-0.5, 0.0, 0.0), **changes):
    return Tactics(FIELD, LIMITS, number, players, settings).decide(situation(pose, **changes))


def test_the_attacker_fetches_the_ball_and_goes_round_it_where_it_lies_on_the_wrong_side():
    assert decide().intent == "fetch"
    assert decide(pose=Pose2(0.3, 0.0, math.pi)).intent == "get behind"
    assert decide(pose=Pose2(0.3, 0.0, math.pi)).avoid_ball
    # at a wall nobody gets behind it
    assert decide(pose=Pose2(0.3, 0.6, math.pi), ball=(0.1, 0.74)).intent == "fetch"


def test_a_held_ball_is_turned_to_where_the_goal_is_open_and_shot_there():
    turning = decide(pose=Pose2(0.6, 0.0, 0.0), in_mouth=True)
    assert turning.intent == "dribble"
    aimed = decide(pose=Pose2(0.6, 0.0, turning.heading_rad), in_mouth=True)
    assert aimed.intent == "shoot"
    assert aimed.kick_mps == LIMITS.kick_speed_mps
    # past a keeper that stands in one half of the goal: by the other
    keeper = ((1.25, 0.1),)
    wanted = decide(pose=Pose2(0.6, 0.0, 0.0), in_mouth=True, obstacles=keeper).heading_rad
    assert wanted < -0.15
    assert decide(pose=Pose2(0.6, 0.0, wanted), in_mouth=True, obstacles=keeper).intent == "shoot"
    assert decide(pose=Pose2(0.6, 0.0, -wanted), in_mouth=True, obstacles=keeper).intent == "dribble"
    wall_of_robots = tuple((0.9, 0.1 * k) for k in range(-6, 7))
    blocked = decide(pose=Pose2(0.6, 0.0, 0.0), in_mouth=True, obstacles=wall_of_robots)
    assert blocked.kick_mps == 0.0


def test_a_ball_that_gets_no_farther_is_not_held_for_ever_and_one_with_free_way_is():
    wall_of_robots = tuple((0.9, 0.1 * k) for k in range(-6, 7))
    far = tuple((1.2, y) for _, y in wall_of_robots)
    pose = Pose2(0.6, 0.0, 0.0)
    assert decide(pose=pose, in_mouth=True, held_s=3.5, obstacles=wall_of_robots).intent == "shoot"
    assert decide(pose=pose, in_mouth=True, held_s=3.5, obstacles=far).intent == "dribble"
    # in a corner, or without end
    assert decide(pose=Pose2(-0.6, 0.6, 2.5), in_mouth=True, held_s=5.0).intent == "clear"
    assert decide(pose=Pose2(-0.6, 0.0, 2.5), in_mouth=True, held_s=5.0).intent == "dribble"
    assert decide(pose=Pose2(-0.6, 0.0, 2.5), in_mouth=True, held_s=7.0).intent == "clear"


def test_a_shot_is_taken_from_where_a_keeper_does_not_get_to_the_ball_in_time():
    field, limits = load_field("four_legged_2007"), setup_for(load_field("four_legged_2007")).robot.limits
    tactics = Tactics(field, limits, 1, 4)
    line_m, reach_m = field.length_m / 2, limits.radius_m + field.ball_radius_m

    def shoots(way_m, keeper):
        ball = (line_m - way_m, 0.0)
        place = (ball[0] - reach_m, 0.0)
        now = situation(Pose2(*place, 0.0), ball=place, in_mouth=True, obstacles=keeper)
        wanted = tactics.decide(now).heading_rad
        return tactics.decide(replace(now, pose=Pose2(*place, wanted))).kick_mps > 0.0

    # one that is not seen stands in the middle
    for keeper in ((), ((line_m - 1.3 * limits.radius_m, 0.0),)):
        assert shoots(0.8, keeper)
        assert not shoots(1.6, keeper)
    # one at a post leaves the other side open
    assert shoots(1.6, ((line_m - 1.3 * limits.radius_m, 0.3),))


def test_nobody_runs_for_the_kick_of_a_keeper_and_it_goes_wherever_the_way_is_free():
    before = ((0.0, 0.1),)
    aimed = decide(number=0, pose=Pose2(-1.2, 0.0, 0.0), in_mouth=True, obstacles=before)
    assert aimed.intent == "dribble"
    kick = decide(number=0, pose=Pose2(-1.2, 0.0, aimed.heading_rad), in_mouth=True, obstacles=before)
    assert kick.intent == "shoot"
    assert decide(number=1, pose=Pose2(-1.2, 0.0, aimed.heading_rad), in_mouth=True, obstacles=before).kick_mps == 0.0


@given(st.floats(0.01, 3.0), st.floats(0.2, 3.0), st.floats(0.2, 3.0))
def test_a_dash_gets_as_far_as_speed_and_acceleration_allow(time_s, speed_mps, acceleration_mps2):
    limits = RobotLimits(speed_mps, acceleration_mps2)
    step_s, gone_m, now_mps = time_s / 1000, 0.0, 0.0
    for _ in range(1000):
        faster_mps = min(now_mps + acceleration_mps2 * step_s, speed_mps)
        gone_m, now_mps = gone_m + (now_mps + faster_mps) / 2 * step_s, faster_mps
    assert dash_m(time_s, limits) == pytest.approx(gone_m, abs=3e-3)
    assert dash_m(-time_s, limits) == 0.0


def planned(action, place=(0.6, 0.0), heading_rad=0.0, chance=0.8):
    return ShotPlan(action, place, heading_rad, chance, 0.3, "goal in 80%")


def test_a_planned_shot_is_kicked_turned_for_or_gone_nearer_for():
    pose = Pose2(0.5, 0.0, 0.2)
    kick = decide(pose=pose, in_mouth=True, shot=planned("kick"))
    assert (kick.intent, kick.kick_mps) == ("shoot", LIMITS.kick_speed_mps)
    assert (kick.why.topic, kick.why.choice, kick.why.text) == ("shot", "kick", "goal in 80%")
    nearer = decide(pose=pose, in_mouth=True, shot=planned("go nearer", (0.8, 0.2), 0.5))
    assert (nearer.intent, nearer.heading_rad, nearer.kick_mps) == ("dribble", 0.5, 0.0)
    # the ball, not the robot, shall be there
    reach = LIMITS.radius_m + FIELD.ball_radius_m
    assert math.dist(nearer.target, (0.8, 0.2)) == pytest.approx(reach)
    before_wall = decide(pose=Pose2(0.2, 0.6, math.pi / 2), in_mouth=True, shot=planned("turn", (0.2, 0.7), 0.0))
    assert before_wall.intent == "draw back"


def test_a_shot_that_promises_nothing_and_a_ball_held_for_long_are_left_to_the_plain_rules():
    pose = Pose2(0.6, 0.0, 0.0)
    keeper = ((1.25, 0.28),)
    for changes in ({"shot": planned("kick", chance=0.01)}, {"shot": planned("turn"), "held_s": 3.5}):
        plan = decide(pose=pose, in_mouth=True, obstacles=keeper, **changes)
        assert plan.why is None
        assert plan.intent == "shoot"


def test_before_a_wall_the_ball_is_drawn_back():
    plan = decide(pose=Pose2(0.2, 0.6, math.pi / 2), in_mouth=True)
    assert plan.intent == "draw back"
    assert plan.target[1] < 0.6


def test_the_keeper_stands_between_ball_and_goal_and_fetches_what_lies_before_it():
    for y in (-0.5, 0.0, 0.5):
        plan = decide(0, pose=Pose2(-1.2, 0.0, 0.0), ball=(0.5, y))
        assert plan.intent == "keep"
        assert plan.target[0] < -1.1
        assert plan.target[1] * y >= 0.0
    rolling = decide(0, pose=Pose2(-1.2, 0.0, 0.0), ball=(0.0, 0.0), ball_velocity_mps=(-1.0, 0.15))
    assert rolling.target[1] == pytest.approx(0.15 * (FIELD.length_m / 2 - 1.3 * LIMITS.radius_m), abs=1e-6)
    assert decide(0, pose=Pose2(-1.2, 0.0, 0.0), ball=(-1.0, 0.2)).intent == "fetch"
    assert decide(1, ball=(-1.0, 0.2)).intent == "leave it to the keeper"
    assert decide(0, pose=Pose2(-1.2, 0.0, 0.0), ball=None).intent == "keep"


def test_further_players_take_the_ball_in_their_own_strip_only():
    intents = [decide(number, 4, ball=(0.3, 0.6)).intent for number in (2, 3)]
    assert intents == ["fetch", "support"]
    assert decide(ball=None).intent == "search"


def test_number_1_gives_way_to_whoever_is_nearer_to_a_ball_in_anothers_strip():
    tactics, ball = Tactics(FIELD, LIMITS, 1, 4), (0.0, 0.6)

    def intent(t_s, obstacles=(), ball=ball):
        return tactics.decide(situation(Pose2(-0.5, 0.6, 0.0), ball=ball, obstacles=obstacles, t_s=t_s)).intent

    nearer, farther, far_off = (-0.2, 0.6), (-0.6, 0.6), (0.45, 0.6)
    assert intent(0.0) == "fetch"
    assert intent(0.1, (farther, far_off)) == "fetch"
    assert intent(0.2, (nearer,)) == "support"
    # a head that looks elsewhere has not seen it leave
    assert intent(1.5) == "support"
    assert intent(1.8) == "fetch"
    # not in its own strip
    assert intent(1.9, ((-0.2, 0.0),), ball=(0.0, 0.0)) == "fetch"
    # the one whose strip it is gives way to nobody
    assert decide(2, 4, ball=ball, pose=Pose2(-0.5, 0.6, 0.0), obstacles=(nearer,)).intent == "fetch"


def test_at_a_kick_off_everybody_is_in_the_own_half_and_outside_the_circle_but_for_who_kicks_off():
    for number in range(3):
        plan = decide(number, 3, phase="kick_off")
        assert plan.intent == "kick-off"
        assert math.hypot(*plan.target) > 0.25 + LIMITS.radius_m
        assert plan.target[0] < 0
    assert math.hypot(*decide(1, 3, phase="kick_off", own_turn=True).target) < 0.25


@given(st.integers(1, 3), st.floats(0.01, 1.3), st.floats(-0.7, 0.7))
def test_for_a_kick_off_everybody_goes_home_straight_and_then_to_its_place(number, x, y):
    away = decide(number, 4, pose=Pose2(x, y, 0.0), phase="kick_off")
    assert away.target[0] < 0.0
    assert away.target[1] == pytest.approx(y, abs=0.1)
    home = decide(number, 4, pose=Pose2(-x, y, 0.0), phase="kick_off")
    assert home.target == decide(number, 4, phase="kick_off").target


@given(st.floats(0.0, 100.0))
def test_those_that_leave_the_ball_to_the_keeper_wait_beside_each_other(t_s):
    # from the right, as they stand at a kick-off
    waiting = [decide(number, 4, ball=(-1.2, 0.0), t_s=t_s) for number in (3, 1, 2)]
    assert {plan.intent for plan in waiting} == {"leave it to the keeper"}
    across = [plan.target[1] for plan in waiting]
    assert min(b - a for a, b in pairwise(across)) > 2 * LIMITS.radius_m


places = st.tuples(st.floats(-1.3, 1.3), st.floats(-0.7, 0.7))


@settings(max_examples=50)
@given(
    st.sampled_from([(0, 1), (0, 2), (1, 2), (2, 3)]),
    places,
    st.floats(-3.0, 3.0),
    st.none() | places,
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0)),
    st.booleans(),
    st.floats(0.0, 6.0),
    st.lists(places, max_size=3),
)
def test_every_plan_is_a_place_on_the_floor(role, place, heading, ball, velocity, in_mouth, held_s, obstacles):
    plan = decide(
        *role,
        pose=Pose2(*place, heading),
        ball=ball,
        ball_velocity_mps=velocity,
        in_mouth=in_mouth,
        held_s=held_s,
        obstacles=tuple(obstacles),
    )
    assert FIELD.is_on_floor(*plan.target)
    assert math.isfinite(plan.heading_rad)
    assert 0.0 <= plan.kick_mps <= LIMITS.kick_speed_mps


@pytest.mark.parametrize("ball", [(-1.1, -0.11), (-0.9, 0.3), (-1.0, 0.0), (-1.1, 0.15)])
def test_the_keeper_blocks_a_ball_that_another_one_has(ball):
    pose = Pose2(-1.25, 0.1, 0.0)
    holder = (ball[0] + 0.1, ball[1])
    plan = decide(0, settings=BLOCKS, pose=pose, ball=ball, others=(holder, (0.9, 0.9)))
    assert plan.intent == "block"
    assert (plan.why.topic, plan.why.choice) == ("shot", "block")
    # between the ball and the goal, off the ball
    assert -FIELD.length_m / 2 < plan.target[0] < ball[0]
    assert math.dist(plan.target, ball) > LIMITS.radius_m + FIELD.ball_radius_m
    assert decide(0, pose=pose, ball=ball, others=(holder, (0.9, 0.9))).intent != "block"
    # a ball that nobody is nearer to is fetched where it lies before the goal
    assert decide(0, settings=BLOCKS, pose=pose, ball=ball, others=((0.9, 0.9),)).intent in (
        "fetch",
        "keep",
        "get behind",
    )


@pytest.mark.parametrize("y_m", [-0.6, -0.4, 0.4, 0.6])
def test_the_keeper_stays_before_its_goal_where_the_ball_is_in_a_corner(y_m):
    ball = (-1.33, y_m)
    plan = decide(0, settings=BLOCKS, pose=Pose2(-1.25, 0.0, 0.0), ball=ball, others=((-1.25, y_m),))
    assert plan.intent == "block"
    assert abs(plan.target[1]) <= FIELD.goals[0].width_m / 2
    assert plan.target[1] * y_m > 0


def test_a_keeper_that_is_pressed_clears_the_ball_away_from_its_goal_only():
    pose = Pose2(-1.2, 0.0, 0.3)
    pressed = {"pose": pose, "in_mouth": True, "others": ((-0.99, 0.1),)}
    assert (decide(0, **pressed).intent, decide(0, **pressed).kick_mps) == ("clear", LIMITS.kick_speed_mps)
    assert decide(0, **pressed | {"others": ((0.5, 0.0),)}).intent != "clear"
    assert decide(0, **pressed | {"pose": Pose2(-1.2, 0.0, math.pi)}).kick_mps == 0.0
    # who is no keeper thinks of shots
    assert decide(1, **pressed).intent != "clear"


def test_settings_are_followed():
    eager = TacticsSettings(straight_rad=4.0)
    assert decide(settings=eager, pose=Pose2(0.3, 0.0, math.pi)).intent == "fetch"
    far_out = TacticsSettings(keeper_depth_radii=15.0)
    assert decide(0, settings=far_out, pose=Pose2(-1.2, 0.0, 0.0), ball=(-0.5, 0.2)).intent == "fetch"
    alone = TacticsSettings(fetches_in_strip=False)
    assert decide(2, 4, settings=alone, ball=(0.3, 0.6)).intent == "support"


@pytest.mark.parametrize("number", [1, 2, 3])
def test_the_agreed_role_decides_who_fetches(number):
    for y_m in (-0.5, 0.0, 0.5):
        for role, intent in (("fetch", "fetch"), ("support", "support")):
            chosen = ChosenRole(role, 0, 2, is_agreed=True)
            assert decide(number, 4, ball=(0.0, y_m), role=chosen).intent == intent
    # alone it decides by its strip, as players that do not speak do
    alone = ChosenRole("fetch", is_agreed=False)
    for y_m in (-0.5, 0.0, 0.5):
        assert decide(number, 4, ball=(0.0, y_m), role=alone) == decide(number, 4, ball=(0.0, y_m))


def test_supporters_divide_the_field_among_themselves():
    places = [decide(1, 5, role=ChosenRole("support", place, 3, is_agreed=True)).target[1] for place in range(3)]
    assert places == pytest.approx([-2 / 3 * FIELD.width_m / 2, 0.0, 2 / 3 * FIELD.width_m / 2])
    # one alone stays on the side where the ball is not
    alone = decide(1, 3, ball=(0.2, 0.4), role=ChosenRole("support", 0, 1, is_agreed=True))
    assert alone.target[1] == pytest.approx(-0.2)


def test_a_search_turns_no_faster_than_pictures_stay_sharp():
    plan = decide(ball=None, pose=Pose2(0.0, 0.0, 1.0))
    assert 0.5 < (plan.heading_rad - 1.0) / TURN_TIME_S < CALM_RPS


def test_those_that_search_together_begin_at_different_corners():
    targets = {decide(ball=None, role=ChosenRole("search", place, 3)).target for place in range(3)}
    assert len(targets) == 3
    assert decide(ball=None, role=ChosenRole("search")).target == decide(ball=None).target
    # those that do not speak, too
    assert len({decide(number, 4, ball=None).target for number in (1, 2, 3)}) == 3


def test_a_supporter_leaves_room_for_two_that_fight_for_the_ball():
    plan = decide(2, 3, ball=(0.1, -0.4), role=ChosenRole("support", 1, 2, is_agreed=True))
    assert plan.intent == "support"
    assert 0.1 - plan.target[0] == pytest.approx(4 * (LIMITS.radius_m + FIELD.ball_radius_m))


def test_who_is_not_near_the_ball_yet_touches_nobody_on_its_way_round():
    assert decide(pose=Pose2(0.2, 0.0, math.pi)).close
    far = decide(pose=Pose2(0.5, 0.0, math.pi))
    assert (far.intent, far.close) == ("get behind", False)
