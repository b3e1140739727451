"""The world's laws: limits, walls, ball, kicker, odometry, rules, and the same run from the same seed."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import numbers

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from sim2d.kick_off import center_circle_radius_m, kick_off_pose, kick_off_row
from sim2d.rendering.scene import Box
from sim2d.robot_link import CONTROL_PERIOD_S, Command, RobotLimits
from sim2d.world.ball_physics import BallSettings
from sim2d.world.physics import STEP_S
from sim2d.world.world import World, WorldSettings

FIELD = load_field("ssl_2001")
CARPET = load_field("msl_6x4")
LIMITS = RobotLimits()
CENTER = Pose2(0.0, 0.0, 0.0)
NUMB = RobotLimits(dead_time_s=0.0)


def lone_robot(start=CENTER, limits=NUMB, boxes=(), seed=1, field=FIELD):
    return World.course(field, boxes, [start], limits, np.random.default_rng(seed))


def in_play(field=FIELD, players=1):
    """Return a world whose kick-off is over; robots far from the centre."""
    world = World(field, players, LIMITS, np.random.default_rng(2))
    while world.state.phase == "kick_off":
        world.step({})
    return world


@given(numbers(-3, 3), numbers(-3, 3), numbers(-20, 20))
def test_speed_and_acceleration_stay_within_the_limits(forward, left, turn):
    world = lone_robot(limits=replace(NUMB, acceleration_mps2=2.0))
    before = (0.0, 0.0)
    for _ in range(15):
        world.step({0: Command(forward, left, turn)})
        robot = world.state.robots[0]
        # slip comes on top of what the wheels do
        assert math.hypot(*robot.velocity_mps) < 1.0 * 1.3
        assert abs(robot.turn_rps) < 6.0 * 1.4
        c, s = math.cos(robot.pose.theta_rad), math.sin(robot.pose.theta_rad)
        wheels = (
            c * robot.velocity_mps[0] + s * robot.velocity_mps[1],
            c * robot.velocity_mps[1] - s * robot.velocity_mps[0],
        )
        change = math.hypot(wheels[0] - before[0], wheels[1] - before[1])
        assert change < 2.0 * CONTROL_PERIOD_S + 0.2 * math.hypot(*wheels) + abs(robot.turn_rps) * 0.1
        before = wheels


def test_acceleration_takes_the_time_it_must():
    world = lone_robot(Pose2(-1.0, 0.0, 0.0))
    for _ in range(15):
        world.step({0: Command(forward_mps=1.0)})
    assert world.state.robots[0].velocity_mps[0] == pytest.approx(1.2 * 0.5, rel=0.15)
    assert world.state.robots[0].pose.x_m + 1.0 == pytest.approx(0.5 * 1.2 * 0.25, rel=0.1)


def test_commands_are_obeyed_after_the_dead_time():
    world = lone_robot(limits=replace(LIMITS, dead_time_s=0.1))
    for _ in range(3):
        world.step({0: Command(forward_mps=1.0)})
        assert world.state.robots[0].velocity_mps == (0.0, 0.0)
    world.step({0: Command()})
    assert world.state.robots[0].velocity_mps[0] > 0.02


def test_odometry_is_nearly_right():
    errors = []
    for seed in range(20):
        world = lone_robot(Pose2(-1.2, -0.4, 0.0), seed=seed)
        believed = Pose2(-1.2, -0.4, 0.0)
        for k in range(60):
            world.step({0: Command(forward_mps=0.8, turn_rps=0.5 * math.sin(k / 10))})
            believed = believed.compose(world.odometry(0))
        errors.append(believed.error_to(world.state.robots[0].pose))
    way_m = 1.3
    assert 0.002 * way_m < np.median([e[0] for e in errors]) < 0.06 * way_m
    assert 0.0 < np.median([e[1] for e in errors]) < 0.1


def test_wheels_do_not_notice_hands():
    world = lone_robot()
    world.push(0, 0.1, -0.3, 1.0)
    moved = Pose2(0.0, 0.0, 0.0)
    for _ in range(8):
        world.step({0: Command()})
        moved = moved.compose(world.odometry(0))
    assert world.state.robots[0].pose.error_to(Pose2(0.1, -0.3, 1.0)) == pytest.approx((0.0, 0.0), abs=1e-6)
    world.place(0, Pose2(1.0, 0.5, 2.0))
    world.step({})
    moved = moved.compose(world.odometry(0))
    assert moved.error_to(Pose2(0.0, 0.0, 0.0)) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_wheels_stall_at_a_wall():
    world = lone_robot(Pose2(1.1, 0.6, 0.0))
    for _ in range(60):
        world.step({0: Command(forward_mps=1.0)})
    assert world.state.robots[0].pose.x_m <= FIELD.length_m / 2 - LIMITS.radius_m + 1e-3
    assert world.odometry(0).x_m < 0.002


@settings(max_examples=15)
@given(numbers(-1.0, 1.0), numbers(-0.6, 0.6), numbers(-math.pi, math.pi), st.integers(0, 100))
def test_nothing_leaves_a_walled_field(x, y, heading, seed):
    world = World(FIELD, 1, LIMITS, np.random.default_rng(seed))
    for _ in range(35):
        world.step({})
    world.place(0, Pose2(x, y, heading))
    world.place_ball(-x, -y, 4 * math.cos(heading), 4 * math.sin(heading))
    for _ in range(45):
        world.step({0: Command(forward_mps=1.0)})
        state = world.state
        assert FIELD.contains([state.ball.x_m, state.ball.y_m])
        assert all(FIELD.contains([robot.pose.x_m, robot.pose.y_m]) for robot in state.robots)


def test_a_kicked_ball_slides_then_rolls_at_five_sevenths_and_stops():
    world = in_play(load_field("ssl_division_b"))
    world.place(0, Pose2(-4.0, 1.0, 0.0))
    world.place_ball(-4.0 + LIMITS.radius_m + world.field.ball_radius_m, 1.0)
    assert world.ball_in_mouth(0)
    world.step({0: Command(kick_mps=5.0)})
    kick = next(event for event in world.state.events if event.kind == "kick")
    world.step({})
    assert kick.robots == (0,)
    assert kick.speed_mps == pytest.approx(LIMITS.kick_speed_mps, rel=0.25)
    speeds = []
    for _ in range(60):
        world.step({})
        speeds.append(math.hypot(world.state.ball.vx_mps, world.state.ball.vy_mps))
    assert speeds == sorted(speeds, reverse=True)
    losses = -np.diff(speeds)
    assert losses[0] > 5 * losses[-1]
    rolling = next(speed for speed, loss in zip(speeds, losses, strict=False) if loss < 0.02)
    assert rolling == pytest.approx(5 / 7 * kick.speed_mps, rel=0.06)
    for _ in range(300):
        world.step({})
    assert (world.state.ball.vx_mps, world.state.ball.vy_mps) == (0.0, 0.0)


def test_a_dribbler_holds_the_ball_through_a_turn_and_a_robot_without_loses_it():
    held = []
    for dribble in (True, False):
        world = in_play()
        world.place(0, Pose2(-1.0, 0.0, 0.0))
        world.place(1, Pose2(1.0, -0.5, 0.0))
        world.place_ball(-1.0 + LIMITS.radius_m + FIELD.ball_radius_m, 0.0)
        for _ in range(60):
            world.step({0: Command(forward_mps=0.3, turn_rps=1.0, dribble=dribble)})
        held.append(world.ball_in_mouth(0))
    assert held == [True, False]


def test_a_goal_counts_once_and_leads_to_a_kick_off():
    world = in_play()
    world.place_ball(1.2, 0.2, 2.0, 0.0)
    goals = []
    for _ in range(30):
        world.step({})
        goals += [event for event in world.state.events if event.kind == "goal"]
    assert [goal.side for goal in goals] == [1]
    state = world.state
    assert (state.score, state.phase, state.kick_off_side) == ((1, 0), "kick_off", -1)
    assert (state.ball.x_m, state.ball.y_m) == (0.0, 0.0)
    while world.state.phase == "kick_off":
        world.step({})
    assert [event.kind for event in world.state.events] == ["whistle"]


def test_kick_off_waits_for_robots_in_the_wrong_half_but_not_for_ever():
    world = World(FIELD, 1, LIMITS, np.random.default_rng(0))
    world.place(0, Pose2(0.8, 0.3, 0.0))
    for _ in range(90):
        world.step({})
    assert world.state.phase == "kick_off"
    for _ in range(150):
        world.step({})
    assert world.state.phase == "play"


@pytest.mark.parametrize("field_name", ["msl_6x4", "ssl_division_b", "spl_2020"])
def test_a_ball_that_is_out_comes_back_where_a_robot_can_reach_it(field_name):
    field = load_field(field_name)
    for x, y in ((0.3, 1.0), (1.0, 0.9), (-1.0, -0.95), (0.0, -1.0)):
        world = in_play(field)
        world.place_ball(x * (field.length_m / 2 + 0.2), y * (field.width_m / 2 + 0.25))
        world.step({})
        assert [event.kind for event in world.state.events] == ["ball_out"]
        ball = world.state.ball
        assert abs(ball.x_m) < field.length_m / 2 - 2 * LIMITS.radius_m
        assert abs(ball.y_m) < field.width_m / 2 - 2 * LIMITS.radius_m
        assert (ball.vx_mps, ball.vy_mps) == (0.0, 0.0)


def test_a_ball_is_not_put_on_a_robot():
    world = in_play(CARPET)
    inset = 3 * LIMITS.radius_m
    world.place(0, Pose2(0.5, CARPET.width_m / 2 - inset, 0.0))
    world.place_ball(0.5, CARPET.width_m / 2 + 0.2)
    world.step({})
    ball = world.state.ball
    assert math.hypot(ball.x_m - 0.5, ball.y_m - (CARPET.width_m / 2 - inset)) > LIMITS.radius_m + CARPET.ball_radius_m


def test_a_ball_that_lies_still_is_dropped_elsewhere():
    world = in_play()
    world.place_ball(1.3, 0.7)
    kinds = set()
    for _ in range(12 * 30):
        world.step({})
        kinds |= {event.kind for event in world.state.events}
    assert "drop" in kinds
    assert world.state.ball.x_m < 1.2


def test_a_robot_that_strays_is_carried_back():
    world = in_play(CARPET)
    world.place(1, Pose2(0.5, 3.0, 0.0))
    world.step({})
    assert [(event.kind, event.robots) for event in world.state.events] == [("carried_back", (1,))]
    assert world.state.robots[1].pose.y_m == CARPET.width_m / 2


def test_a_course_has_boxes_and_no_rules():
    box = Box(0.4, 0.0)
    world = lone_robot(Pose2(0.0, 0.0, 0.0), boxes=(box,))
    kinds = []
    for _ in range(60):
        world.step({0: Command(forward_mps=0.5)})
        kinds += [event.kind for event in world.state.events]
    assert kinds[0] == "collision"
    assert world.state.robots[0].pose.x_m < 0.4 - box.width_m / 2 - LIMITS.radius_m + 2e-3
    assert world.state.ball is None
    assert not world.ball_in_mouth(0)
    with pytest.raises(ArgumentError, match="this world has no ball"):
        world.place_ball(0.0, 0.0)


def test_a_head_pans_at_its_own_speed_within_its_range():
    limits = replace(LIMITS, pan_rps=3.0, pan_limit_rad=0.7)
    world = World.course(FIELD, (), [Pose2(0.0, 0.0, 0.0)], limits, np.random.default_rng(0))
    pans = []
    for _ in range(12):
        world.step({0: Command(pan_rad=5.0)})
        pans.append(world.state.robots[0].pan_rad)
    # the neck hears of it after the dead time
    assert pans[0] == pytest.approx(3.0 * (CONTROL_PERIOD_S - limits.dead_time_s), abs=3.0 * STEP_S)
    assert np.diff(pans[:6]) == pytest.approx(3.0 * CONTROL_PERIOD_S)
    assert pans[-1] == pytest.approx(0.7)
    for _ in range(3):
        world.step({0: Command()})
    assert world.state.robots[0].pan_rad == pytest.approx(0.7)


@pytest.mark.parametrize("players", [1, 2, 3, 5])
@pytest.mark.parametrize("field", [FIELD, CARPET])
def test_line_ups_are_each_others_half_turn_without_overlap(players, field):
    world = World(field, players, LIMITS, np.random.default_rng(0))
    robots = world.state.robots
    assert [robot.side for robot in robots] == [1] * players + [-1] * players
    for number in range(players):
        ours, theirs = (kick_off_pose(field, side, number, players) for side in (1, -1))
        assert ours.half_turn().error_to(theirs) == pytest.approx((0.0, 0.0), abs=1e-9)
        assert ours.x_m < -center_circle_radius_m(field)
    rows = [kick_off_row(number, players) for number in range(1, players)]
    assert sorted(rows) == list(range(players - 1))
    across = [kick_off_pose(field, 1, number, players).y_m for number in range(1, players)]
    assert np.argsort(rows).tolist() == np.argsort(across).tolist()
    places = np.array([[robot.pose.x_m, robot.pose.y_m] for robot in robots])
    apart = np.linalg.norm(places[:, None] - places[None], axis=2) + 10 * np.eye(len(robots))
    assert apart.min() > 2 * LIMITS.radius_m


@pytest.mark.parametrize("name", ["forward_mps", "left_mps", "turn_rps", "kick_mps", "pan_rad"])
def test_a_command_that_is_not_finite_is_refused(name):
    with pytest.raises(ArgumentError, match=f"a command's {name} must be finite, got nan"):
        lone_robot().step({0: Command(**{name: math.nan})})


def test_bad_arguments_are_named():
    with pytest.raises(ArgumentError, match="there is no robot 7: they are 0 to 0"):
        lone_robot().step({7: Command()})
    with pytest.raises(ArgumentError, match="players_per_side must be at least 1, got 0"):
        World(FIELD, 0, LIMITS, np.random.default_rng(0))
    with pytest.raises(ArgumentError, match="a push must be finite"):
        lone_robot().push(0, math.inf, 0.0)


def test_settings_of_physics_are_followed():
    ice = WorldSettings(ball=BallSettings(rolling_friction=0.0))
    slippery = World(FIELD, 1, LIMITS, np.random.default_rng(0), ice)
    while slippery.state.phase == "kick_off":
        slippery.step({})
    slippery.place_ball(0.0, 0.5, 0.3, 0.0)
    for _ in range(20):
        slippery.step({})
    assert slippery.state.ball.vx_mps == pytest.approx(0.3, abs=1e-6)
