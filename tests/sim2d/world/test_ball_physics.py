"""A chipped ball flies by gravity alone, loses at each bounce what the model says, and passes over what is low."""

import math

import numpy as np
import pymunk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.geometry import Pose2
from sim2d.world.ball_physics import CLEAR_HEIGHT_M, GRAVITY_MPS2, BallBody
from sim2d.world.physics import Physics
from sim2d.world.robot_spec import PERFECT, RobotSpec

DT_S = 1 / 300


def ball_in_space():
    space = pymunk.Space()
    return space, BallBody(space, 0.0215, 1)


def go(space, ball, seconds):
    states = []
    for _ in range(round(seconds / DT_S)):
        ball.apply_friction(DT_S)
        space.step(DT_S)
        states.append(ball.state)
    return states


@given(speed=st.floats(2.0, 7.0), angle=st.floats(0.4, 1.2))
def test_a_chip_is_a_parabola_and_bounces_with_fixed_losses(speed, angle):
    space, ball = ball_in_space()
    flight = ball.flight
    along, up = speed * math.cos(angle), speed * math.sin(angle)
    ball.kick(along, 0.0, up)
    states = go(space, ball, 3.0)
    bounces = [k for k in range(1, len(states)) if states[k].z_m == 0 and states[k - 1].z_m > 0]
    first = states[: bounces[0]]
    assert max(state.z_m for state in first) == pytest.approx(up**2 / 2 / GRAVITY_MPS2, rel=0.01, abs=1e-3)
    assert {state.vx_mps for state in first} == {along}
    assert bounces[0] * DT_S == pytest.approx(2 * up / GRAVITY_MPS2, abs=2 * DT_S)
    assert states[bounces[0]].vz_mps == pytest.approx(flight.up_ratio * up, rel=1e-6)
    assert states[bounces[0]].vx_mps == pytest.approx(flight.first_floor_ratio * along, rel=1e-6)
    later = [k for k in bounces[1:] if states[k].vz_mps > 0]
    for k in later:
        assert states[k].vx_mps == pytest.approx(states[bounces[0]].vx_mps, rel=1e-6)
    # in the end it rolls, and is slower for it
    assert states[-1].z_m == states[-1].vz_mps == 0
    assert states[-1].vx_mps < states[bounces[0]].vx_mps


def test_it_flies_over_a_wall_that_a_low_one_meets():
    reached = {}
    for name, up in (("low", 1.0), ("high", 4.0)):
        space, ball = ball_in_space()
        wall = pymunk.Segment(space.static_body, (1.0, -1.0), (1.0, 1.0), 0.02)
        space.add(wall)
        ball.kick(3.0, 0.0, up)
        reached[name] = max(state.x_m for state in go(space, ball, 0.6))
    assert reached["low"] < 1.0
    assert reached["high"] > 1.5


def test_after_the_flight_it_touches_again():
    space, ball = ball_in_space()
    space.add(pymunk.Segment(space.static_body, (3.0, -1.0), (3.0, 1.0), 0.02))
    ball.kick(3.0, 0.0, 3.0)
    states = go(space, ball, 3.0)
    assert max(state.z_m for state in states) > CLEAR_HEIGHT_M
    assert max(state.x_m for state in states) < 3.0


def test_a_ball_that_is_put_down_flies_no_more():
    space, ball = ball_in_space()
    ball.kick(1.0, 0.0, 5.0)
    go(space, ball, 0.2)
    assert ball.flies
    ball.place(0.5, 0.5)
    assert not ball.flies
    assert go(space, ball, 0.1)[-1].z_m == 0
    ball.throw(1.0, 0.0)
    assert ball.flies
    assert go(space, ball, 0.3)[-1].z_m < 1.0


def test_a_ball_in_the_air_is_not_in_a_mouth():
    physics = Physics(load_field("ssl_division_b"))
    robot = physics.add((0, 1, 0), Pose2(0.0, 0.0, 0.0), RobotSpec(), PERFECT, np.random.default_rng(0))
    ball = physics.add_ball()
    ball.place(0.1, 0.0)
    assert robot.holds(ball)
    ball.throw(0.3, 0.0)
    assert not robot.holds(ball)
    ball.place(0.1, 0.05)
    assert not robot.holds(ball)
    ball.place(-0.1, 0.0)
    assert not robot.holds(ball)
