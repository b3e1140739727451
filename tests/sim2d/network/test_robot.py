"""Robots of the league obey velocities within their limits, stop unasked, kick, chip and dribble."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.values.simulation import (
    GlobalVelocity,
    LocalVelocity,
    MoveCommand,
    RobotCommand,
    Team,
    WheelVelocities,
)
from sim2d.network.world import STEPS_PER_S, LeagueWorld, body_velocity
from sim2d.world.ball_physics import Flight
from sim2d.world.robot_spec import RobotSpec
from sim2d.world.state import BallState

Y = Team.YELLOW


@pytest.fixture
def world():
    made = LeagueWorld(load_field("ssl_division_b"), Flight())
    made.add(Y, 3, Pose2(0.0, 0.0, math.pi / 2))
    made.place_ball(BallState(2.0, 2.0))
    return made


def go(world, seconds, move=None, **command):
    for step in range(round(seconds * STEPS_PER_S)):
        if step % 5 == 0 and (move is not None or command):
            world.command(Y, RobotCommand(3, move, **command))
        world.step()
    return next(robot for robot in world.state.robots if robot.number == 3)


def test_local_and_global_velocities(world):
    robot = go(world, 1.0, MoveCommand(local=LocalVelocity(1.0, 0.0, 0.0)))
    assert robot.velocity_mps == (pytest.approx(0.0, abs=1e-9), pytest.approx(1.0))
    robot = go(world, 1.0, MoveCommand(world=GlobalVelocity(0.5, 0.0, 1.0)))
    assert robot.velocity_mps == (pytest.approx(0.5), pytest.approx(0.0, abs=1e-9))
    assert robot.turn_rps == pytest.approx(1.0)


def test_it_speeds_up_and_brakes_by_its_limits(world):
    spec = RobotSpec()
    robot = go(world, 0.1, MoveCommand(world=GlobalVelocity(3.0, 0.0, 0.0)))
    assert robot.velocity_mps[0] == pytest.approx(spec.speed_up_mps2 * 0.1, rel=0.01)
    robot = go(world, 1.0, MoveCommand(world=GlobalVelocity(30.0, 0.0, 30.0)))
    assert robot.velocity_mps[0] == pytest.approx(spec.max_speed_mps)
    assert robot.turn_rps == pytest.approx(spec.max_turn_rps)
    robot = go(world, 0.1, MoveCommand(world=GlobalVelocity(0.0, 0.0, 0.0)))
    assert robot.velocity_mps[0] == pytest.approx(spec.max_speed_mps - spec.brake_mps2 * 0.1, rel=0.01)


def test_without_a_command_for_a_tenth_of_a_second_it_stands_still(world):
    go(world, 1.0, MoveCommand(world=GlobalVelocity(1.0, 0.0, 2.0)), kick_mps=3.0)
    before = go(world, 0.08)
    assert before.velocity_mps[0] == pytest.approx(1.0)
    after = go(world, 0.3)
    assert after.velocity_mps == (0.0, 0.0)
    assert after.turn_rps == 0.0
    # the kick that was ordered then does not come back with the next command
    pose = after.pose
    world.place_ball(BallState(pose.x_m + 0.09 * math.cos(pose.theta_rad), pose.y_m + 0.09 * math.sin(pose.theta_rad)))
    go(world, 0.1, MoveCommand(world=GlobalVelocity(0.0, 0.0, 0.0)))
    assert math.hypot(world.ball.vx_mps, world.ball.vy_mps) < 0.1


def test_fields_left_out_keep_their_value(world):
    go(world, 0.2, MoveCommand(local=LocalVelocity(0.0, 0.0, 0.0)), kick_mps=4.0)
    world.place_ball(BallState(0.0, 0.0965))
    for _ in range(5):
        world.command(Y, RobotCommand(3))
        world.step()
    assert world.ball.vy_mps > 3.5


@given(forward=st.floats(-3, 3), left=st.floats(-3, 3), turn=st.floats(-10, 10))
def test_wheels_move_the_body_as_their_angles_say(forward, left, turn):
    spec = RobotSpec()
    rims = tuple(
        -math.sin(angle) * forward + math.cos(angle) * left + spec.radius_m * turn for angle in spec.wheel_angles_rad
    )
    assert body_velocity(spec, WheelVelocities(*rims)) == pytest.approx((forward, left, turn), abs=1e-9)


def test_wheel_commands_drive(world):
    rims = [-math.sin(angle) * 1.0 for angle in RobotSpec().wheel_angles_rad]
    assert rims[0] > 0 > rims[3]  # forward turns the right wheels counter-clockwise about the robot, the left clockwise
    robot = go(world, 1.0, MoveCommand(wheels=WheelVelocities(*rims)))
    assert robot.velocity_mps == (pytest.approx(0.0, abs=1e-6), pytest.approx(1.0))


def test_a_kick_has_the_ordered_speed_and_a_chip_its_angle(world):
    world.place_ball(BallState(0.0, 0.0965))
    assert world.touches_ball(Y, 3)
    go(world, 0.02, kick_mps=5.0)
    assert math.hypot(world.ball.vx_mps, world.ball.vy_mps) == pytest.approx(5.0, rel=0.02)
    assert not world.touches_ball(Y, 3) or world.ball.vy_mps > 0
    go(world, 0.5)
    world.robot(Y, 3).place(Pose2(0.0, 0.0, 0.0))
    world.place_ball(BallState(0.0965, 0.0))
    go(world, 1 / STEPS_PER_S, kick_mps=4.0, kick_angle_rad=math.pi / 4)
    ball = world.ball
    assert ball.vx_mps == pytest.approx(4.0 / math.sqrt(2), rel=1e-6)
    assert ball.vz_mps == pytest.approx(4.0 / math.sqrt(2), rel=0.02)
    # and it flies over a robot that stands in the way
    world.add(Team.BLUE, 0, Pose2(0.8, 0.0, 0.0))
    go(world, 0.5)
    assert world.ball.x_m > 1.1


@pytest.mark.parametrize(("height_m", "is_over"), [(0.15, False), (0.6, True)])
def test_a_kick_is_over_where_its_ball_is_no_higher_than_a_robot_there(world, height_m, is_over):
    world.add(Team.BLUE, 0, Pose2(0.0, 0.5, 0.0))
    world.set_spec(Team.BLUE, 0, RobotSpec(height_m=height_m))
    world.place_ball(BallState(0.0, 0.0965))
    go(world, 1 / STEPS_PER_S, kick_mps=4.0, kick_angle_rad=math.pi / 4)
    assert world.state.kick is not None
    while world.ball.y_m < 0.5:
        world.step()
    assert 0.15 < world.ball.z_m < 0.6
    assert (world.state.kick is None) == is_over


def test_kicks_are_limited_by_the_kicker(world):
    world.place_ball(BallState(0.0, 0.0965))
    go(world, 1 / STEPS_PER_S, kick_mps=50.0)
    assert world.ball.vy_mps == pytest.approx(RobotSpec().max_kick_mps, rel=0.02)


def test_a_dribbler_takes_the_ball_along(world):
    world.robot(Y, 3).place(Pose2(0.0, 0.0, 0.0))
    world.place_ball(BallState(0.097, 0.005))
    go(world, 0.3, MoveCommand(local=LocalVelocity(0.0, 0.0, 0.0)), dribbler_rps=100.0)
    robot = go(world, 1.0, MoveCommand(local=LocalVelocity(-0.3, 0.0, 0.0)))
    assert robot.pose.x_m < -0.2
    assert world.touches_ball(Y, 3)


def test_robots_are_added_and_removed_by_their_numbers(world):
    with pytest.raises(ArgumentError, match="robot 3 of yellow is on the field already"):
        world.add(Y, 3, Pose2(0, 0, 0))
    with pytest.raises(ArgumentError, match="numbers are 0 to 15"):
        world.add(Y, 16, Pose2(0, 0, 0))
    world.remove(Y, 3)
    assert world.state.robots == ()
    with pytest.raises(ArgumentError, match="no robot 3 of yellow"):
        world.command(Y, RobotCommand(3))


def test_a_changed_robot_keeps_its_place(world):
    go(world, 0.5, MoveCommand(world=GlobalVelocity(1.0, 0.0, 0.0)))
    before = world.state.robots[0]
    world.set_spec(Y, 3, RobotSpec(radius_m=0.08, max_speed_mps=0.5))
    after = world.state.robots[0]
    assert (after.pose, after.velocity_mps, after.radius_m) == (before.pose, before.velocity_mps, 0.08)
