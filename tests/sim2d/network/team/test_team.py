"""A team by overhead vision, in a loop with the simulator and without sockets: what the referee says is obeyed."""

# ruff: noqa: D102
from __future__ import annotations

import dataclasses
import math

import pytest

from benchmarks.worlds.damaged_messages import REFEREE
from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.field import geometry_from_field
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.detection import DetectionFrame, VisionPacket
from robocup_vision.ssl.values.geometry import FloorPoint
from robocup_vision.ssl.values.referee import RefereeCommand, TeamInfo
from robocup_vision.ssl.values.simulation import RobotControl, RobotControlResponse, SimulatorError, Team
from sim2d.network.league import STEPS_A_COMMAND, Channel, LeagueSimulator
from sim2d.network.realism import REALISMS
from sim2d.network.team.team import OverheadTeam
from sim2d.network.world import TEAM_OF
from sim2d.world.state import BallState

FIELD = load_field("ssl_division_b")
C = RefereeCommand


class Loop:
    """A team that plays yellow in a simulator, told by a referee of the test's own."""

    def __init__(self, players=3, realism="none", team=Team.YELLOW):
        self.simulator = LeagueSimulator(FIELD, players, REALISMS[realism])
        self.side, self.team = team, OverheadTeam(team, FIELD)
        self.counter = 0
        self.robots = 11
        self.shift_s = 0.0
        self.sent = []

    def tell(self, command, place=None):
        self.counter += 1
        info = TeamInfo("x", 0, 0, 0, 4, 0, 0, max_allowed_robots=self.robots)
        self.team.hear_referee(
            dataclasses.replace(
                REFEREE,
                command=command,
                command_counter=self.counter,
                yellow=info,
                blue=info,
                blue_on_positive_half=True,
                designated_position=None if place is None else FloorPoint(*place),
            )
        )
        return self

    def go(self, seconds):
        """Yield the truth after each control period."""
        for _ in range(round(30 * seconds)):
            for _ in range(STEPS_A_COMMAND):
                for channel, data in self.simulator.step():
                    if channel is Channel.VISION:
                        packet = decode(VisionPacket, data)
                        if packet.detection is not None:
                            t_s = packet.detection.t_capture_s + self.shift_s
                            packet = VisionPacket(dataclasses.replace(packet.detection, t_capture_s=t_s))
                        self.team.hear_vision(packet)
            self.sent = self.team.commands(self.team.seen_s + self.simulator.world.t_s % (1 / 60))
            answer, _ = self.simulator.answer_robots(self.side, encode(RobotControl(tuple(self.sent))))
            if answer is not None:
                self.team.hear_robots(decode(RobotControlResponse, answer))
            yield self.simulator.world.state

    def finish(self, seconds):
        *_, state = self.go(seconds)
        return state

    def own(self, state):
        return [robot for robot in state.robots if TEAM_OF[robot.side] == self.side]


def speed(robot):
    return math.hypot(*robot.velocity_mps)


def away(robot, ball):
    return math.hypot(robot.pose.x_m - ball.x_m, robot.pose.y_m - ball.y_m) - robot.radius_m


def test_without_a_referee_nobody_moves():
    loop = Loop()
    state = loop.finish(0.3)
    assert len(loop.sent) == 3
    assert max(map(speed, loop.own(state))) == 0.0


@pytest.mark.parametrize("command", [C.HALT, C.TIMEOUT_BLUE])
def test_in_a_halt_no_robot_is_commanded_to_move_from_the_next_command_on(command):
    loop = Loop().tell(C.FORCE_START)
    assert max(map(speed, loop.own(loop.finish(1.0)))) > 0.5
    loop.tell(command)
    state = loop.finish(1 / 30)
    for sent in loop.sent:
        assert (sent.move.local.forward_mps, sent.move.local.left_mps, sent.move.local.turn_rps) == (0.0, 0.0, 0.0)
        assert sent.kick_mps == 0.0
    # 1.5 m/s less 6 m/s^2
    state = loop.finish(0.35)
    assert max(map(speed, loop.own(state))) < 0.01


@pytest.mark.slow
def test_in_a_stop_they_leave_the_ball_and_drive_slowly():
    """Only this finds a stop that is not obeyed once vision is late and noisy."""
    loop = Loop(4, "rc2021").tell(C.FORCE_START)
    loop.finish(2.5)
    loop.tell(C.STOP)
    loop.finish(2.0)
    for state in loop.go(1.5):
        for robot in loop.own(state):
            assert away(robot, state.ball) > 0.5
            assert speed(robot) <= 1.5


@pytest.mark.slow
def test_a_kick_off_is_taken_and_the_ball_goes_into_the_goal():
    """Only this finds a team that never scores."""
    loop = Loop(2)
    loop.simulator.world.remove(Team.BLUE, 0)
    loop.tell(C.PREPARE_KICKOFF_YELLOW)
    for state in loop.go(2.0):
        assert all(robot.pose.x_m < 0.1 for robot in loop.own(state))
        assert math.hypot(state.ball.x_m, state.ball.y_m) < 0.01
    loop.tell(C.NORMAL_START)
    assert any(state.ball.x_m > 4.52 and abs(state.ball.y_m) < 0.5 for state in loop.go(20.0))


def test_who_has_kicked_off_leaves_the_ball_to_others():
    loop = Loop(3).tell(C.DIRECT_FREE_YELLOW)
    for number in range(3):
        loop.simulator.world.remove(Team.BLUE, number)
    kicker = None
    for _ in loop.go(6.0):
        if kicker is None and "free kick" in loop.team.intents.values():
            kicker = next(number for number, intent in loop.team.intents.items() if intent == "free kick")
        if kicker is not None and loop.team.state.phase == "play":
            break
    assert kicker is not None
    loop.finish(0.2)
    assert loop.team.intents[kicker] not in ("fetch", "get behind", "shoot", "dribble")
    assert any(intent in ("fetch", "get behind") for intent in loop.team.intents.values())


@pytest.mark.slow
def test_the_ball_is_placed_and_left():
    """Only this finds a ball placement that does not end."""
    loop = Loop(3)
    loop.simulator.world.place_ball(BallState(-1.0, 3.2))
    loop.tell(C.BALL_PLACEMENT_YELLOW, (0.5, 2.0))
    lies = 0
    for state in loop.go(30.0):
        placed = math.hypot(state.ball.x_m - 0.5, state.ball.y_m - 2.0) < 0.15
        left = all(away(robot, state.ball) > 0.5 for robot in loop.own(state))
        lies = lies + 1 if placed and left else 0
        if lies > 15:
            break
    assert lies > 15


@pytest.mark.slow
def test_robots_with_cards_leave_to_places_of_their_own():
    """Only this finds robots with cards that stay, leave with the keeper or wait in one place."""
    loop = Loop(4)
    loop.robots = 2
    loop.tell(C.FORCE_START)
    state = loop.finish(9.0)
    left = [robot for robot in loop.own(state) if abs(robot.pose.y_m) > 3.05]
    assert len(left) == 2
    for robot in left:
        # the keeper stays
        assert robot.number != 0
        assert loop.team.intents[robot.number] == "leave the field"
    outside = [robot.pose for robot in left]
    assert math.hypot(outside[0].x_m - outside[1].x_m, outside[0].y_m - outside[1].y_m) > 0.25


def test_at_the_others_kick_off_nobody_waits_near_the_ball():
    loop = Loop(3)
    loop.simulator.world.robot(Team.YELLOW, 1).place(Pose2(-0.3, 0.05, 0.0))
    loop.tell(C.PREPARE_KICKOFF_BLUE)
    state = loop.finish(2.0)
    assert all(away(robot, state.ball) > 0.5 for robot in loop.own(state))


def test_in_a_stop_no_command_is_faster_than_allowed():
    loop = Loop(3).tell(C.FORCE_START)
    loop.finish(1.0)
    loop.tell(C.STOP)
    for _ in loop.go(0.5):
        for sent in loop.sent:
            assert math.hypot(sent.move.local.forward_mps, sent.move.local.left_mps) <= 1.3 + 1e-9


def test_it_plays_on_when_visions_clock_is_set_or_a_frame_comes_from_the_future():
    loop = Loop(2).tell(C.FORCE_START)
    loop.finish(0.5)
    future = VisionPacket(DetectionFrame(1, 1e9, 1e9, 0))
    loop.team.hear_vision(future)
    loop.shift_s = -5000.0
    assert max(map(speed, loop.own(loop.finish(1.0)))) > 0.5
    said = " ".join(loop.team.problems.take_new())
    assert "the clock of camera 0 has gone from" in said


def test_what_a_simulator_refuses_is_said_once_with_its_count():
    team = OverheadTeam(Team.YELLOW, FIELD)
    for number in range(5):
        error = SimulatorError("VELOCITY_TYPE", f"robot {number}: only local velocities")
        team.hear_robots(RobotControlResponse((error,)))
    assert team.problems.take_new() == ["the simulator answers VELOCITY_TYPE: robot 4: only local velocities"]
    assert team.problems.take_new() == []
    assert team.problems.lines() == ["5 x the simulator answers VELOCITY_TYPE: robot 4: only local velocities"]


def test_that_vision_shows_another_field_is_said_once():
    team = OverheadTeam(Team.YELLOW, FIELD)
    team.hear_vision(VisionPacket(geometry=geometry_from_field(FIELD)))
    assert team.problems.take_new() == []
    for _ in range(3):
        team.hear_vision(VisionPacket(geometry=geometry_from_field(load_field("ssl_division_a"))))
    assert team.problems.take_new() == [
        "vision shows a field of 12.00 x 9.00 m, but played on is ssl_division_b of 9.00 x 6.00 m (--field)"
    ]


def test_an_unknown_command_is_a_halt_that_is_said():
    loop = Loop(2).tell(C.FORCE_START).tell(RefereeCommand(18))
    loop.finish(0.1)
    assert (loop.team.state.phase, loop.team.state.doubt) == ("halt", "unknown command 18")
    assert "unknown command 18" in loop.team.problems.take_new()[0]


def test_a_team_on_the_other_half_plays_the_other_way():
    loop = Loop(3, team=Team.BLUE).tell(C.FORCE_START)
    loop.simulator.world.place_ball(BallState(-2.0, 0.0))
    assert min(robot.velocity_mps[0] for robot in loop.own(loop.finish(1.0))) < -0.5


def test_a_field_without_goals_is_refused():
    with pytest.raises(ArgumentError, match="no goals to play at"):
        OverheadTeam(Team.YELLOW, dataclasses.replace(FIELD, goals=()))
