"""Built-in players on some of the league simulator's robots, beside robots for foreign commands."""

from __future__ import annotations

import math

import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values import simulation as sim
from robocup_vision.ssl.values.referee import Referee, RefereeCommand
from sim2d.match.league_referee import LeagueReferee
from sim2d.match.setups import setup_for
from sim2d.network.built_in import CameraRobots, OverheadRobots, built_in_robots, check_apart
from sim2d.network.league import Channel, LeagueSimulator
from sim2d.network.realism import REALISMS

FIELD = load_field("ssl_division_b")


def begin(*words, players=2, referee=None):
    robots = [built_in_robots(text, FIELD, players) for text in words]
    check_apart(robots)
    return LeagueSimulator(FIELD, players, REALISMS["none"], 0, 0.0, referee, robots)


def way(simulator, team, number, seconds):
    before = simulator.world.robot(team, number).pose
    for _ in range(round(300 * seconds)):
        simulator.step()
    after = simulator.world.robot(team, number).pose
    return math.hypot(after.x_m - before.x_m, after.y_m - before.y_m)


def test_some_robots_play_and_the_others_obey_foreign_commands():
    simulator = begin("yellow=overhead:1")
    move = sim.MoveCommand(world=sim.GlobalVelocity(0.0, 1.0, 0.0))
    commands = encode(sim.RobotControl((sim.RobotCommand(0, move), sim.RobotCommand(1, move))))
    answer, _ = simulator.answer_robots(sim.Team.YELLOW, commands)
    response = decode(sim.RobotControlResponse, answer)
    assert [error.code for error in response.errors] == ["ROBOT_BUILT_IN"]
    assert [feedback.number for feedback in response.feedback] == [0]
    assert way(simulator, sim.Team.YELLOW, 1, 1.0) > 0.2
    # the foreign one braked when its command was too old
    assert 0.02 < simulator.world.robot(sim.Team.YELLOW, 0).pose.y_m < 0.3


@pytest.mark.slow
def test_players_with_cameras_of_their_own_play_within_their_limits():
    """Only this finds a player by its own camera that no frame reaches in the league's simulator."""
    simulator = begin("blue=plain:1", players=2)
    assert way(simulator, sim.Team.BLUE, 1, 1.5) > 0.1
    assert simulator.world.spec(sim.Team.BLUE, 1).max_speed_mps == setup_for(FIELD).robot.limits.speed_mps
    assert way(simulator, sim.Team.BLUE, 0, 0.1) == 0.0


def test_built_in_players_obey_the_referee_of_the_match():
    simulator = begin("yellow=overhead", "blue=plain:0", referee=LeagueReferee(FIELD, 0.09))
    for team, number in ((sim.Team.YELLOW, 1), (sim.Team.BLUE, 0)):
        # it begins with a halt
        assert way(simulator, team, number, 0.4) == 0.0
    told = [decode(Referee, data).command for _ in range(30) for c, data in simulator.step() if c is Channel.REFEREE]
    assert set(told) == {RefereeCommand.HALT}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("green=plain", "given as yellow=KIND or blue=KIND"),
        ("yellow", "given as yellow=KIND or blue=KIND"),
        ("yellow=clever", "there are no built-in players 'clever', only overhead, plain, memory, planning"),
        ("yellow=plain:1,x", "numbers are from 0 to 15"),
        ("yellow=plain:16", "numbers are from 0 to 15"),
    ],
)
def test_wrong_words_are_reported(words, message):
    with pytest.raises(ArgumentError, match=message):
        built_in_robots(words, FIELD, 2)


def test_no_robot_has_two_players():
    with pytest.raises(ArgumentError, match="robot 1 of yellow has two built-in players"):
        begin("yellow=overhead", "yellow=overhead:1")


def test_the_words_name_the_kinds():
    assert isinstance(built_in_robots("yellow=overhead:3", FIELD, 2), OverheadRobots)
    made = built_in_robots("blue=memory:1,0", FIELD, 2)
    assert isinstance(made, CameraRobots)
    assert made.numbers == (0, 1)
