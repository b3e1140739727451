"""sim2d's own matches under a game controller: listened to, driven, and the league's rules without one."""

# ruff: noqa: D102
import dataclasses

import pytest
from sim2d_players import SMALL_CAMERA, Reckoner

from benchmarks.worlds.damaged_messages import REFEREE
from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.ssl.controller_clients import CiClient
from robocup_vision.ssl.framed import varint
from robocup_vision.ssl.protocol.mapping import decode, encode
from robocup_vision.ssl.values.geometry import FloorPoint
from robocup_vision.ssl.values.referee import CiInput, CiOutput, RefereeCommand
from sim2d.match.league_referee import league_referee
from sim2d.match.match import Match
from sim2d.network.foreign_referee import DrivenReferee, ForeignReferee

C = RefereeCommand
FIELD = load_field("ssl_division_b")


class Source:
    """Says what the test wants."""

    def __init__(self):
        self.packets, self.counter = [], 0

    def say(self, command, **changes):
        self.counter += 1
        self.packets.append(dataclasses.replace(REFEREE, command=command, command_counter=self.counter, **changes))

    def __call__(self, t_s, robots, ball, blue_positive):
        packets, self.packets = self.packets, []
        return packets


def begin(source, players=1):
    def rules(field, limits):
        return ForeignReferee(source, field)

    return Match(FIELD, players, ours=Reckoner, theirs=Reckoner, camera=SMALL_CAMERA, referee=rules)


def senses(match):
    match.step()
    return [robot.senses for robot in match.step().robots]


def test_players_are_told_what_the_game_controller_commands():
    source = Source()
    match = begin(source)
    assert {one.phase for one in senses(match)} == {"halt"}
    source.say(C.PREPARE_KICKOFF_YELLOW, blue_on_positive_half=True)
    assert [(one.phase, one.own_turn) for one in senses(match)] == [("kick_off", True), ("kick_off", False)]
    # yellow has the other half now
    source.say(C.DIRECT_FREE_YELLOW, blue_on_positive_half=False)
    assert [one.own_turn for one in senses(match)] == [False, True]
    source.say(C.BALL_PLACEMENT_BLUE, designated_position=FloorPoint(1.0, -2.0))
    told = senses(match)
    assert told[0].placement_in_field == (1.0, -2.0)
    assert told[0].phase == "ball_placement"
    source.say(C.FORCE_START)
    assert senses(match)[0].phase == "play"
    assert senses(match)[0].placement_in_field is None


def test_the_ball_is_put_where_the_kick_is_and_goals_are_those_told():
    source = Source()
    match = begin(source)
    source.say(C.DIRECT_FREE_BLUE, designated_position=FloorPoint(-1.0, 2.0))
    match.step()
    state = match.arena.state
    assert (state.ball.x_m, state.ball.y_m) == (-1.0, 2.0)
    source.say(C.PREPARE_KICKOFF_BLUE, yellow=dataclasses.replace(REFEREE.yellow, score=2))
    match.step()
    state = match.arena.state
    assert (state.ball.x_m, state.ball.y_m) == (0.0, 0.0)
    assert state.score == (2, 1)


def test_the_leagues_rules_need_no_game_controller():
    match = Match(FIELD, 1, ours=Reckoner, theirs=Reckoner, camera=SMALL_CAMERA, referee=league_referee)
    phases = []
    for moment in match.play(7.0):
        if not phases or phases[-1] != moment.state.phase:
            phases.append(moment.state.phase)
    assert phases[:3] == ["halt", "stop", "kick_off"]


def test_a_match_drives_a_game_controller_at_its_own_speed(peer):
    got = []

    def halt_and_then_play(frame):
        got.append(decode(CiInput, frame))
        started = len(got) > 10
        command = C.FORCE_START if started else C.HALT
        answer = encode(CiOutput(dataclasses.replace(REFEREE, command=command, command_counter=int(started))))
        return varint(len(answer)) + answer

    with CiClient(port=peer(halt_and_then_play)) as client:
        match = begin(DrivenReferee(client, FIELD))
        phases = [moment.state.phase for moment in match.play(1.0)]
    assert phases[1] == "halt"
    assert phases[-1] == "play"
    assert len(got) == 30
    assert got[0].geometry.field.length_m == 9.0
    assert got[1].geometry is None
    assert got[-1].time_ns - got[0].time_ns == pytest.approx(29e9 / 30, abs=10)
    assert {robot.robot.team for robot in got[0].tracker.frame.robots} == {1, 2}


def test_what_a_user_can_mend_is_told():
    with pytest.raises(ArgumentError, match="seed must not be negative"):
        Match(FIELD, 1, -1, referee=league_referee)
