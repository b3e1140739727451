"""The automatic referee: what happens under a game controller's commands is told, each thing once."""

# ruff: noqa: D102
import dataclasses

import pytest

from benchmarks.worlds.damaged_messages import REFEREE
from field_models import load_field
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.values.controller import EventKind
from robocup_vision.ssl.values.geometry import FloorPoint
from robocup_vision.ssl.values.referee import RefereeCommand
from robocup_vision.ssl.values.simulation import Team
from sim2d.network.autoref import Autoref
from sim2d.world.state import BallState, RobotState

FIELD = load_field("ssl_division_b")
C, K = RefereeCommand, EventKind


def robot(side, number, x, y, vx=0.0):
    return RobotState(0, side, number, Pose2(x, y, 0.0), (vx, 0.0), 0.0)


class Game:
    """An automatic referee, its clock and what it told."""

    def __init__(self):
        self.autoref, self.t_s, self.counter, self.told = Autoref(FIELD), 0.0, 0, []
        self.ball, self.robots = BallState(0.0, 0.0), [robot(1, 1, -1.0, 0.0), robot(-1, 2, 1.0, 0.0)]

    def say(self, command, **changes):
        self.counter += 1
        changes = {"blue_on_positive_half": True, "source_identifier": "gc"} | changes
        packet = dataclasses.replace(REFEREE, command=command, command_counter=self.counter, **changes)
        self.autoref.hear(packet, self.t_s, self.ball)
        self.autoref.hear(packet, self.t_s, self.ball)
        return self

    def go(self, seconds=0.1, **changes):
        for name, value in changes.items():
            setattr(self, name, value)
        for _ in range(round(30 * seconds)):
            self.t_s += 1 / 30
            self.told += self.autoref.judge(self.t_s, self.robots, self.ball, 1.7e9 + self.t_s)
        return self

    @property
    def kinds(self):
        return [event.kind for event in self.told]


def test_before_a_game_controller_speaks_nothing_is_told():
    assert Game().go(ball=BallState(9.0, 0.0)).told == []


@pytest.mark.parametrize("blue_positive", [True, False])
def test_a_goal_is_told_once_for_the_side_that_attacks_it(blue_positive):
    game = Game().say(C.FORCE_START, blue_on_positive_half=blue_positive).go(ball=BallState(3.0, 0.0))
    game.go(robots=[robot(1, 1, 2.89, 0.0)]).go(0.5, ball=BallState(4.6, 0.0))
    assert game.kinds == [K.POSSIBLE_GOAL]
    goal = game.told[0].possible_goal
    assert goal.team == (Team.YELLOW if blue_positive else Team.BLUE)
    assert (goal.kicking_team, goal.kicking_number) == (Team.YELLOW, 1)
    assert game.told[0].time_us == pytest.approx(1e6 * (1.7e9 + 0.2), abs=2e5)


@pytest.mark.parametrize(
    ("ball", "kind"), [((0.0, 3.1), K.BALL_LEFT_FIELD_TOUCH_LINE), ((4.7, 2.0), K.BALL_LEFT_FIELD_GOAL_LINE)]
)
def test_a_ball_that_left_the_field_is_told_with_who_touched_it_last(ball, kind):
    game = Game().say(C.FORCE_START).go(robots=[robot(-1, 2, 0.11, 0.0)])
    game.go(0.5, ball=BallState(*ball))
    assert game.kinds == [kind]
    told = getattr(game.told[0], kind.name.lower())
    assert (told.team, told.number) == (Team.BLUE, 2)
    assert (told.place.x_m, told.place.y_m) == ball


def test_a_fast_ball_is_told_and_play_is_watched_on():
    game = Game().say(C.FORCE_START).go(robots=[robot(1, 1, -0.11, 0.0)])
    game.go(0.5, ball=BallState(0.5, 0.0, 7.5, 0.0))
    assert game.kinds == [K.BOT_KICKED_BALL_TOO_FAST]
    assert game.told[0].bot_kicked_ball_too_fast.amount == pytest.approx(7.5)
    assert game.go(ball=BallState(4.6, 0.0)).kinds[-1] == K.POSSIBLE_GOAL


def test_in_a_stop_speed_is_told_once():
    game = Game().say(C.STOP).go(5.0, robots=[robot(1, 1, -2.0, 0.0, 1.8)])
    assert game.kinds == [K.BOT_TOO_FAST_IN_STOP]
    assert game.told[0].bot_too_fast_in_stop.amount == pytest.approx(1.8)


def test_a_placement_is_told_once_the_ball_lies_and_is_left():
    place = FloorPoint(1.0, 1.0)
    game = Game().say(C.BALL_PLACEMENT_YELLOW, designated_position=place, next_command=C.DIRECT_FREE_YELLOW)
    game.go(1.0, robots=[robot(1, 1, 0.9, 1.0)], ball=BallState(1.02, 1.0))
    assert game.told == []
    game.go(1.0, robots=[robot(1, 1, 0.5, 1.0)])
    assert game.kinds == [K.PLACEMENT_SUCCEEDED]
    told = game.told[0].placement_succeeded
    assert (told.team, told.off_m, told.distance_m) == (Team.YELLOW, pytest.approx(0.02), pytest.approx(2**0.5))


def test_a_defender_near_the_kick_is_told():
    game = Game().say(C.DIRECT_FREE_YELLOW).go(3.0, robots=[robot(1, 1, -0.3, 0.0), robot(-1, 2, 0.4, 0.0)])
    assert game.kinds == [K.DEFENDER_TOO_CLOSE_TO_KICK_POINT]
    assert game.told[0].defender_too_close_to_kick_point.number == 2


def test_a_double_touch_is_told():
    game = Game().say(C.PREPARE_KICKOFF_YELLOW).go().say(C.NORMAL_START)
    game.go(0.2, robots=[robot(1, 1, -0.115, 0.0)])
    game.go(0.2, ball=BallState(0.3, 0.0))
    game.go(0.2, robots=[robot(1, 1, 0.19, 0.0)])
    assert K.ATTACKER_DOUBLE_TOUCHED_BALL in game.kinds
