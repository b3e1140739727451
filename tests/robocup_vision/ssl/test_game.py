"""What the referee's commands mean to a team: phases, turns, sides, and packets that are lost or repeated."""

import dataclasses

import pytest

from benchmarks.worlds.damaged_messages import REFEREE
from field_models.errors import ArgumentError
from robocup_vision.ssl.game import Game
from robocup_vision.ssl.log import SslLog
from robocup_vision.ssl.values.geometry import FloorPoint
from robocup_vision.ssl.values.referee import RefereeCommand
from robocup_vision.ssl.values.simulation import Team

C = RefereeCommand
BALL = (0.0, 0.0)


def told(*commands, team=Team.YELLOW, **changes):
    game = Game(team)
    for counter, command in enumerate(commands):
        game.update(dataclasses.replace(REFEREE, command=command, command_counter=counter, **changes))
        game.state(0.1 * counter, BALL)
    return game


def test_before_the_first_packet_nobody_may_move():
    assert Game(Team.BLUE).state(0.0, BALL).phase == "halt"


@pytest.mark.parametrize(
    ("commands", "phase", "own_turn"),
    [
        ((C.HALT,), "halt", False),
        ((C.STOP,), "stop", False),
        ((C.FORCE_START,), "play", False),
        ((C.PREPARE_KICKOFF_YELLOW,), "kick_off", True),
        ((C.PREPARE_KICKOFF_BLUE,), "kick_off", False),
        ((C.PREPARE_KICKOFF_YELLOW, C.NORMAL_START), "free_kick", True),
        ((C.PREPARE_PENALTY_BLUE, C.NORMAL_START), "penalty", False),
        ((C.STOP, C.NORMAL_START), "play", False),
        ((C.DIRECT_FREE_YELLOW,), "free_kick", True),
        ((C.INDIRECT_FREE_BLUE,), "free_kick", False),
        ((C.TIMEOUT_BLUE,), "time_out", False),
        ((C.BALL_PLACEMENT_YELLOW,), "ball_placement", True),
        ((C.STOP, C.GOAL_BLUE), "stop", False),
    ],
)
def test_commands_mean_phases(commands, phase, own_turn):
    state = told(*commands).state(1.0, BALL)
    assert (state.phase, state.own_turn) == (phase, own_turn)


def test_a_free_kick_is_over_once_the_ball_has_moved_or_its_time_is():
    game = told(C.DIRECT_FREE_BLUE)
    assert game.state(2.0, (0.04, 0.0)).phase == "free_kick"
    assert game.state(2.1, (0.06, 0.0)).phase == "play"
    # the repeated packet does not begin it again
    game.update(dataclasses.replace(REFEREE, command=C.DIRECT_FREE_BLUE, command_counter=0))
    assert game.state(2.2, (0.06, 0.0)).phase == "play"
    late = told(C.DIRECT_FREE_BLUE)
    assert late.state(9.9, BALL).phase == "free_kick"
    assert late.state(10.2, BALL).phase == "play"


def test_a_new_counter_begins_the_same_command_again():
    game = told(C.DIRECT_FREE_BLUE)
    assert game.state(1.0, (1.0, 0.0)).phase == "play"
    game.update(dataclasses.replace(REFEREE, command=C.DIRECT_FREE_BLUE, command_counter=9))
    assert game.state(1.1, (1.0, 0.0)).phase == "free_kick"


@pytest.mark.parametrize(
    ("blue_positive", "team", "attacks"),
    [(True, Team.YELLOW, 1), (True, Team.BLUE, -1), (False, Team.YELLOW, -1), (None, Team.BLUE, None)],
)
def test_sides_keepers_and_cards(blue_positive, team, attacks):
    yellow = dataclasses.replace(REFEREE.yellow, goalkeeper=4, max_allowed_robots=5)
    place = FloorPoint(1.5, -2.0)
    game = told(C.STOP, team=team, yellow=yellow, blue_on_positive_half=blue_positive, designated_position=place)
    state = game.state(1.0, None)
    assert state.attacks == attacks
    assert (state.goalkeeper == 4) == (team == Team.YELLOW)
    assert state.max_robots == (5 if team == Team.YELLOW else None)
    assert state.placement_m == (1.5, -2.0)


def test_a_team_that_is_none_is_refused():
    with pytest.raises(ArgumentError, match="team must be yellow or blue"):
        Game(Team.UNKNOWN)


def test_a_foreign_match_is_followed_through_all_its_phases(recordings):
    game, phases = Game(Team.YELLOW), []
    with SslLog(recordings / "referee.log.gz") as log:
        for entry in log:
            game.update(entry.value)
            phase = game.state(entry.received_ns / 1e9, BALL).phase
            if not phases or phases[-1] != phase:
                phases.append(phase)
    assert phases[:3] == ["halt", "stop", "kick_off"]
    assert {"free_kick", "prepare_penalty", "time_out", "ball_placement"} <= set(phases)


def test_an_unknown_command_is_a_halt_with_its_number_named():
    state = told(C.FORCE_START, RefereeCommand(18)).state(1.0, BALL)
    assert (state.phase, state.doubt) == ("halt", "unknown command 18")


def test_one_referee_is_followed_until_it_has_been_silent():
    def say(t_s, source, command, counter):
        packet = dataclasses.replace(REFEREE, source_identifier=source, command=command, command_counter=counter)
        game.update(packet, ("127.0.0.1", 1), t_s)
        return game.state(t_s, BALL).phase

    game = Game(Team.YELLOW)
    for k in range(20):
        assert say(0.1 * k, "a", C.FORCE_START, 3) == "play"
        assert say(0.1 * k + 0.05, "b", C.HALT, 7) == "play"
    assert "another sender of referee packets is not followed: b at 127.0.0.1:1" in game.problem
    assert say(2.5, "b", C.STOP, 8) == "play"
    assert say(3.0, "b", C.STOP, 8) == "stop"
    assert game.problem == ""


def test_of_several_new_referees_none_is_followed():
    game = Game(Team.YELLOW)
    for t_s, source in ((0.0, "a"), (0.9, "b"), (1.5, "c"), (1.6, "b")):
        game.update(dataclasses.replace(REFEREE, source_identifier=source, command=C.FORCE_START), None, t_s)
    assert game.problem == "several senders of referee packets speak, none is followed: b, c"


def test_a_clock_that_was_set_back_does_not_hold_the_old_referee():
    game = Game(Team.YELLOW)
    game.update(dataclasses.replace(REFEREE, source_identifier="a", command=C.HALT), None, 5000.0)
    game.update(dataclasses.replace(REFEREE, source_identifier="b", command=C.FORCE_START), None, 0.0)
    assert game.state(0.0, BALL).phase == "play"


def test_a_lost_referee_halts_and_what_he_said_comes_back_with_him():
    game = told(C.PREPARE_KICKOFF_BLUE, C.NORMAL_START)
    game.lose_referee()
    assert (game.state(1.0, BALL).phase, game.state(1.0, BALL).doubt) == ("halt", "no referee")
    game.update(dataclasses.replace(REFEREE, command=C.NORMAL_START, command_counter=1))
    assert (game.state(1.1, BALL).phase, game.state(1.1, BALL).own_turn) == ("free_kick", False)


def test_the_game_controllers_clock_ends_a_kick_and_what_comes_next_is_told():
    yellow = dataclasses.replace(REFEREE.yellow, can_place_ball=False)
    game = told(C.DIRECT_FREE_BLUE, yellow=yellow, action_time_left_us=3_000_000, next_command=C.PREPARE_PENALTY_YELLOW)
    state = game.state(100.0, BALL)
    assert (state.phase, state.action_left_s, state.can_place_ball) == ("free_kick", 3.0, False)
    assert (state.next_phase, state.next_own_turn) == ("prepare_penalty", True)
    game.update(dataclasses.replace(REFEREE, command=C.DIRECT_FREE_BLUE, command_counter=0, action_time_left_us=-1))
    assert game.state(100.1, BALL).phase == "play"


def test_a_clock_that_was_set_back_does_not_make_a_kick_last():
    game = told(C.DIRECT_FREE_BLUE)
    game.update(dataclasses.replace(REFEREE, command=C.DIRECT_FREE_BLUE, command_counter=9))
    assert game.state(5000.0, BALL).phase == "free_kick"
    assert game.state(0.0, BALL).phase == "free_kick"
    assert game.state(10.2, BALL).phase == "play"
