"""Parts of a player: each can be replaced, gets what it needs, and the default ones are the built-in player's."""

from __future__ import annotations

import pickle
from dataclasses import fields, replace
from typing import Any

import pytest
from sim2d_players import SMALL_CAMERA, Sleeper

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.vision import Vision
from sim2d.match.arena import Arena
from sim2d.match.match import Match
from sim2d.match.setups import camera_for
from sim2d.players.catalog import BuiltInTeam, player_name
from sim2d.players.driving.motion import Motion
from sim2d.players.parts import (
    LEGS_ODOMETRY,
    WHEELS_ODOMETRY,
    PlayerParts,
    make_ball,
    make_driving,
    make_localizer,
    make_role,
    make_tactics,
)
from sim2d.players.settings import PlayerSettings
from sim2d.robot_link import Command, PlayerSetup, RobotLimits

FIELD = load_field("ssl_2001")
SETUP = PlayerSetup(FIELD, SMALL_CAMERA, RobotLimits(), 1, 1, 2, 0)
CALLED: list[str] = []


class Spied:
    """A part that hands everything on to the usual one, and tells what it was asked."""

    def __init__(self, name: str, usual: Any) -> None:
        object.__setattr__(self, "spied", (name, usual))

    def __getattr__(self, key: str) -> Any:
        name, usual = object.__getattribute__(self, "spied")
        CALLED.append(f"{name}.{key}")
        return getattr(usual, key)


def spied_localizer(*arguments):
    return Spied("localizer", make_localizer(*arguments))


def spied_ball(*arguments):
    return Spied("ball", make_ball(*arguments))


def spied_role(*arguments):
    return Spied("role", make_role(*arguments))


def spied_tactics(*arguments):
    return Spied("tactics", make_tactics(*arguments))


def spied_driving(*arguments):
    return Spied("driving", make_driving(*arguments))


SPIED = PlayerParts(spied_localizer, spied_ball, spied_role, spied_tactics, spied_driving)


def play(team, seconds=0.2):
    match = Match(FIELD, 2, 3, ours=team, theirs=Sleeper)
    moments = list(match.play(seconds))
    assert not match.figures.robots[0].stopped_reason
    assert not match.figures.robots[1].stopped_reason
    return [(robot.command, robot.status.intent) for moment in moments for robot in moment.robots[:2]]


@pytest.fixture(scope="module")
def usual():
    return play(BuiltInTeam(("memory", "plans", "messages")))


def test_every_part_is_asked_and_one_that_hands_on_changes_nothing(usual):
    CALLED.clear()
    assert play(BuiltInTeam(("memory", "plans", "messages"), parts=SPIED)) == usual
    asked = {name.split(".")[0] for name in CALLED}
    assert asked == {field.name for field in fields(PlayerParts)}
    assert {"localizer.look", "ball.locate", "role.choose", "tactics.decide", "driving.drive"} <= set(CALLED)


class Stubborn(Motion):
    """Drives straight ahead, whatever is wanted."""

    def __init__(self, setup, settings):
        super().__init__(setup.limits, None, settings.motion)

    def drive(self, plan, pose, free_space, t_s, moving=(), travel=None):
        """Return the one command."""
        return Command(forward_mps=0.123)


def test_a_part_of_ones_own_is_obeyed():
    found = play(BuiltInTeam(parts=PlayerParts(driving=Stubborn)))
    assert Command(forward_mps=0.123) in [command for command, _ in found]


def test_a_team_with_parts_goes_to_other_processes_and_has_a_name_of_its_own():
    team = BuiltInTeam(("messages",), parts=SPIED)
    assert pickle.loads(pickle.dumps(team)) == team
    assert team != BuiltInTeam(("messages",))
    assert player_name(team) == "BuiltInTeam"
    assert replace(team, parts=PlayerParts()) == BuiltInTeam(("messages",))


def test_who_sees_ahead_only_counts_on_the_odometry_of_its_legs_or_wheels():
    field, settings = load_field("four_legged_2007"), PlayerSettings()
    wheels = PlayerSetup(field, camera_for(field), RobotLimits(), 1, 1, 2, 0)
    setups = (SETUP, wheels, replace(wheels, has_legs=True))
    for remembers in (False, True):
        noises = [make_localizer(setup, settings, remembers).memory.poses.odometry_noise for setup in setups]
        assert noises == [settings.memory.odometry, WHEELS_ODOMETRY, LEGS_ODOMETRY]


@pytest.mark.parametrize(("field_name", "has_legs"), [("four_legged_2007", True), ("ssl_division_b", False)])
def test_players_are_told_whether_they_have_legs(field_name, has_legs):
    assert Arena(load_field(field_name), None, 0).setup(0).has_legs == has_legs


def test_a_localizer_without_a_memory_is_refused():
    with pytest.raises(ArgumentError, match="a player's localizer must have a memory"):
        BuiltInTeam(parts=PlayerParts(localizer=lambda setup, *_: Vision(setup.field, setup.camera)))(SETUP)
