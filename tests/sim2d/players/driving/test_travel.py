"""What planning makes of a player's belief: ways round others, speeds near them, reasons in words."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.belief import MapPicture, Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE, UNDECIDED
from sim2d.match.match import Match
from sim2d.match.setups import setup_for
from sim2d.players.catalog import player_factory
from sim2d.players.driving.travel import TravelPlanner
from sim2d.players.plan import Surroundings
from sim2d.robot_link import Command, RobotLimits
from sim2d.world.world import World

FIELD = load_field("ssl_2001")
LIMITS = RobotLimits()
KNOWN = PoseEstimate(Pose2(-0.6, 0.0, 0.0), np.diag([1e-4, 1e-4, 1e-4]), 1.0, 0.0)
TARGET = (0.6, 0.0)


def track(number, x_m, y_m, std_m=0.01, vx_mps=0.0, vy_mps=0.0):
    covariance = np.diag([std_m**2, std_m**2, 0.02**2, 0.02**2])
    return Track(number, x_m, y_m, vx_mps, vy_mps, covariance, 0.99, 20, 0)


def around(*tracks, floor=None, t_s=1.0, velocity=(0.0, 0.0), robot=KNOWN):
    return Surroundings(t_s, robot, velocity, velocity, tracks, 0.0, floor)


def planner(looks=3):
    return TravelPlanner(FIELD, LIMITS, looks)


def said(travel, topic):
    return next(reason for reason in travel.reasons if reason.topic == topic)


def test_with_nobody_in_the_way_it_goes_straight_at_full_speed():
    travel = planner().plan(around(track(1, 0.0, 0.6)), TARGET)
    assert (travel.waypoint, travel.speed_mps, travel.gap) == (TARGET, LIMITS.speed_mps, None)
    assert [reason.choice for reason in travel.reasons] == ["straight", "full speed"]


def test_who_stands_in_the_way_is_passed_on_the_wider_side():
    for y, side in ((0.08, -1), (-0.08, 1)):
        travel = planner().plan(around(track(1, 0.0, y)), TARGET)
        assert math.copysign(1, travel.waypoint[1]) == side
        assert abs(travel.waypoint[1]) > 2 * LIMITS.radius_m
        # from the opponent's edge to the field's border
        ends = sorted(abs(y) for _, y in travel.gap)
        assert ends == pytest.approx([LIMITS.radius_m - abs(y), FIELD.width_m / 2])


def test_a_wide_gap_between_two_is_taken_and_a_narrow_one_is_not():
    wide = planner().plan(around(track(1, 0.0, 0.29), track(2, 0.0, -0.29)), TARGET)
    assert said(wide, "gap").choice == "through"
    assert wide.waypoint == pytest.approx((0.0, 0.0), abs=1e-9)
    narrow = planner().plan(around(track(1, 0.0, 0.15), track(2, 0.0, -0.15)), TARGET)
    assert said(narrow, "gap").choice == "detour"
    assert abs(narrow.waypoint[1]) > 0.3
    assert "gap" in said(narrow, "gap").text


def test_a_gap_that_may_be_too_narrow_is_the_gate_planners():
    pair = track(1, 0.0, 0.26, 0.03), track(2, 0.0, -0.26, 0.03)
    plan = planner().plan(around(*pair), TARGET)
    assert [reason.choice for reason in plan.reasons] == ["look first", "slow: to look"]
    assert said(plan, "gap").text.startswith("look from here: gap 0.34 m, sigma 0.05 m, expected")
    assert 0 < plan.speed_mps < 0.5 * LIMITS.speed_mps
    # now it knows, either way
    for width, choice in ((0.29, "through"), (0.23, "detour")):
        pair = track(1, 0.0, width, 0.005), track(2, 0.0, -width, 0.005)
        assert said(planner().plan(around(*pair), TARGET), "gap").choice == choice


def test_a_choice_is_kept_where_another_gap_saves_nothing():
    p = planner()
    first = p.plan(around(track(1, 0.0, 0.02)), TARGET)
    later = p.plan(around(track(1, 0.0, -0.01), t_s=1.2), TARGET)
    assert math.copysign(1, first.waypoint[1]) == math.copysign(1, later.waypoint[1]) == -1
    assert "as before" in said(later, "gap").text
    # now the other side saves much
    much = p.plan(around(track(1, 0.0, -0.4), track(2, 0.0, -0.2), t_s=1.4), TARGET)
    assert much.waypoint[1] > 0


def test_a_plan_stands_for_a_tenth_of_a_second():
    p = planner()
    first = p.plan(around(track(1, 0.0, 0.02)), TARGET)
    assert p.plan(around(t_s=1.05), TARGET) is first
    assert p.plan(around(t_s=1.11), TARGET).gap is None
    straight = p.plan(around(t_s=1.12), (0.62, 0.0))
    assert straight.waypoint == (0.62, 0.0)


def test_those_that_move_are_placed_where_they_will_be():
    crossing = planner().plan(around(track(1, 0.0, 0.45, vy_mps=-0.75)), TARGET)
    assert said(crossing, "gap").choice != "straight"
    leaving = planner().plan(around(track(1, 0.0, 0.1, vy_mps=0.9)), TARGET)
    assert said(leaving, "gap").choice == "straight"


def test_it_slows_down_where_it_would_pass_close():
    pair = track(1, -0.15, 0.24), track(2, -0.15, -0.24)
    travel = planner().plan(around(*pair, velocity=(0.9, 0.0)), TARGET)
    reason = said(travel, "speed")
    assert travel.speed_mps < LIMITS.speed_mps
    assert reason.choice in ("slow: opponents", "creep: opponents")
    assert "gap" in reason.text or "opponent" in reason.text


def test_floor_that_is_not_decided_slows_it_down():
    state = np.full((80, 80), FREE, dtype=np.uint8)
    floor = MapPicture(state, (-2.2, -1.6), 0.04)
    assert planner().plan(around(floor=floor), TARGET).speed_mps == LIMITS.speed_mps
    # from x = -0.2 on
    state = state.copy()
    state[50:] = UNDECIDED
    travel = planner().plan(around(floor=MapPicture(state, (-2.2, -1.6), 0.04)), TARGET)
    assert 0.2 <= travel.speed_mps < LIMITS.speed_mps
    assert said(travel, "speed").choice.endswith("undecided floor")
    assert "3 looks" in said(travel, "speed").text


def test_to_the_ball_it_goes_no_faster_than_it_can_stop_before_others():
    p = planner()
    free = p.approach(around(track(1, -0.6, 0.4)), (-0.3, 0.0), (-0.3, 0.0))
    assert (free.speed_mps, free.reasons[0].choice) == (LIMITS.speed_mps, "full speed")
    assert p.approach(around(track(1, 0.9, 0.0)), (0.6, 0.0), None).speed_mps == LIMITS.speed_mps
    speeds = [p.approach(around(track(1, x, 0.0)), (-0.3, 0.0), None).speed_mps for x in (-0.1, -0.2, -0.3, -0.4)]
    assert speeds == sorted(speeds, reverse=True)
    assert 0 < speeds[-1] < speeds[0] < LIMITS.speed_mps


def test_a_ball_that_others_may_reach_is_raced_for():
    travel = planner().race(TARGET)
    assert (travel.waypoint, travel.speed_mps, travel.gap, travel.presses) == (TARGET, LIMITS.speed_mps, None, True)
    assert said(travel, "speed").text == "to the ball"


def test_a_ball_is_carried_straight_and_as_fast_as_it_can_be_held():
    p = planner()
    travel = p.carry(TARGET)
    assert (travel.waypoint, travel.speed_mps, travel.gap) == (TARGET, LIMITS.speed_mps, None)
    assert said(travel, "speed").text == "with the ball"
    assert travel.turn_rps == p.holding_rps < LIMITS.turn_rps
    assert travel.presses


@pytest.mark.parametrize("name", ["ssl_2001", "ssl_division_b", "msl_18x12", "four_legged_2007", "spl_2020"])
def test_a_ball_stays_in_the_mouth_of_a_robot_that_drives_and_turns_as_planned(name):
    field = load_field(name)
    robot = setup_for(field).robot
    fastest_rps = TravelPlanner(field, robot.limits, 3).holding_rps
    for way_rad, turn_rps in ((0.0, 0.0), (0.0, fastest_rps), (0.5, -fastest_rps)):
        world = World(field, 1, robot.limits, np.random.default_rng(2), robot.physics)
        while world.state.phase != "play":
            world.step({})
        start = Pose2(-0.4 * field.length_m, 0.0, 0.0)
        world.place(0, start)
        world.place_ball(start.x_m + robot.limits.radius_m + field.ball_radius_m, 0.0)
        for _ in range(40):
            way = way_rad - world.state.robots[0].pose.theta_rad
            speed_mps = robot.limits.speed_mps
            world.step({0: Command(speed_mps * math.cos(way), speed_mps * math.sin(way), turn_rps, dribble=True)})
            assert world.ball_in_mouth(0)


@pytest.mark.slow
def test_a_planning_team_plays_and_says_why():
    """Only this finds a planner that a real match stops, or that decides without a reason."""
    # the one without the ball plans ways to where it supports
    match = Match(FIELD, 3, 5, ours=player_factory("planning"))
    topics, seen = set(), []
    for moment in match.play(6.0):
        ours, theirs = moment.robots[:3], moment.robots[3:]
        assert not any(robot.stopped for robot in moment.robots)
        assert all(not robot.status.reasons for robot in theirs)
        topics |= {reason.topic for robot in ours for reason in robot.status.reasons}
        seen += [robot.status for robot in ours if robot.status.waypoint_in_field is not None]
        if topics == {"gap", "speed", "shot"}:
            break
    assert seen
    assert topics == {"gap", "speed", "shot"}
    assert all(0 < belief.speed_mps <= LIMITS.speed_mps for belief in seen)


def test_one_that_has_the_ball_is_left_room_from_behind_only():
    p = planner()
    # it stands before the robot, its ball on its other side
    travel = p.approach(around(track(1, -0.4, 0.0)), (-0.35, 0.0), (-0.28, 0.0))
    assert travel.reasons[0].choice == "leave room"
    assert travel.ends_there
    assert travel.waypoint == pytest.approx((-0.4 - 2 * LIMITS.radius_m - 0.06, 0.0))
    # a ball beside it, between the two, or in the own mouth is fought for
    assert not p.approach(around(track(1, -0.4, 0.0)), (-0.41, 0.1), (-0.41, 0.115)).ends_there
    assert not p.approach(around(track(1, -0.36, 0.0)), (-0.48, 0.0), (-0.48, 0.0)).ends_there
    assert not p.approach(around(track(1, -0.4, 0.0)), (-0.35, 0.0), None).ends_there


@pytest.mark.slow
def test_a_head_that_turns_looks_where_the_plan_says():
    """Only this finds a planned look that the head does not take."""
    match = Match(load_field("four_legged_2007"), 1, 3, ours=player_factory("planning"))
    robots = [moment.robots[0] for moment in match.play(3.0)]
    assert not any(robot.stopped for robot in robots)
    planned = [robot for robot in robots if robot.status.gaze_rad is not None]
    assert planned
    for robot in planned:
        reason = next(reason for reason in robot.status.reasons if reason.topic == "gaze")
        assert robot.command.pan_rad == pytest.approx(robot.status.gaze_rad)
        assert reason.choice == ("sweep" if reason.text.startswith("sweep") else "planned")
    assert any(reason.choice == "planned" for robot in planned for reason in robot.status.reasons)
