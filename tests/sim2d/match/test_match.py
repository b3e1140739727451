"""The match loop: players get senses alone, fail alone, and the same seed plays the same match."""

import json
import subprocess
import sys

import numpy as np
import pytest
from object_graph import reachable
from sim2d_players import (
    SMALL_CAMERA,
    Exits,
    FailsAt,
    NeverBorn,
    Reckoner,
    ReportsNan,
    ReportsWords,
    SaysInfinity,
    SaysNan,
    SaysNothing,
    SaysTooMuch,
    SaysWords,
    Sleeper,
    Talker,
)

from field_models import load_field
from field_models.errors import ArgumentError
from sim2d.match.arena import Arena
from sim2d.match.disturbances import Disturbances
from sim2d.match.match import Match, periods
from sim2d.players.built_in import BuiltInPlayer
from sim2d.report.match_figures import match_json
from sim2d.robot_link import Command
from sim2d.sensors.faults import BodyFault
from sim2d.sensors.team_channel import ChannelSettings
from sim2d.world.world import World

FIELD = load_field("ssl_2001")


def small_match(seed=0, players=1, **options):
    return Match(FIELD, players, seed, camera=SMALL_CAMERA, **{"ours": Reckoner, "theirs": Sleeper, **options})


def play(match, seconds):
    return list(match.play(seconds))


def test_every_period_has_senses_status_and_commands():
    match = small_match()
    moments = play(match, 1.0)
    assert len(moments) == 30
    np.testing.assert_allclose([moment.state.t_s for moment in moments], np.arange(30) / 30)
    first, last = moments[0].robots[0], moments[-1].robots[0]
    assert first.senses.frame.shape == (56, 64, 3)
    assert first.senses.frame_t_s == first.senses.t_s == 0.0
    assert last.command == Command(forward_mps=0.3, turn_rps=1.5)
    assert not np.array_equal(first.senses.frame, last.senses.frame)
    with pytest.raises(ValueError, match="read-only"):
        first.senses.frame[0, 0] = 0


def test_setups_tell_the_sides():
    arena = Arena(FIELD, 2, 0, camera=SMALL_CAMERA)
    setups = [arena.setup(index) for index in range(4)]
    assert [(s.attacks, s.number, s.players) for s in setups] == [(1, 0, 2), (1, 1, 2), (-1, 0, 2), (-1, 1, 2)]
    assert len({s.seed for s in setups}) == 4


def test_own_kick_off_is_reported_to_one_side():
    moment = small_match().step()
    assert [robot.senses.phase for robot in moment.robots] == ["kick_off", "kick_off"]
    assert [robot.senses.own_turn for robot in moment.robots] == [True, False]


def test_status_is_compared_with_the_truth():
    match = small_match()
    play(match, 2.0)
    ours, theirs = match.figures.robots
    assert ours.frames == theirs.frames == 60
    assert ours.within_5cm_3deg == 1.0
    assert 0 < ours.median_error_m < 0.02
    assert ours.lost_ratio == 0.0
    assert ours.distance_m == pytest.approx(0.5, abs=0.1)
    assert (theirs.within_5cm_3deg, theirs.lost_ratio, theirs.median_error_m) == (0.0, 1.0, None)
    assert theirs.longest_lost_s == pytest.approx(2.0)
    assert theirs.right_half_ratio is None


@pytest.mark.parametrize(
    ("player", "reason", "stopped_s"),
    [
        (FailsAt, "RuntimeError: my own bug", 0.5),
        (SaysNan, "ArgumentError: a command's forward_mps must be finite, got nan", 0.5),
        (SaysInfinity, "ArgumentError: a command's kick_mps must be finite, got inf", 0.5),
        (SaysTooMuch, "ArgumentError: a team message must be at most 128 bytes, got 129", 0.5),
        (SaysNothing, "TypeError: the command is a NoneType, no Command", 0.5),
        (SaysWords, "ValueError: could not convert string to float: 'fast'", 0.5),
        (Exits, "SystemExit: 3", 0.5),
        (ReportsWords, "TypeError: the status is a str, no PlayerStatus", 0.0),
        (ReportsNan, "ArgumentError: the status' pose must be finite, got Pose2(x_m=nan, ", 0.0),
        (NeverBorn, "ValueError: no way", 0.0),
    ],
)
def test_a_player_that_fails_is_stopped_alone(player, reason, stopped_s):
    match = small_match(theirs=player)
    moments = play(match, 1.0)
    ours, theirs = match.figures.robots
    assert (ours.stopped_s, ours.stopped_reason) == (None, "")
    assert ours.distance_m > 0.15
    assert theirs.stopped_s == pytest.approx(stopped_s)
    assert theirs.stopped_reason.startswith(reason)
    assert moments[-1].robots[1].command == Command()
    assert not moments[-1].robots[1].status.pose
    values = match_json("ssl_2001", 1, 0, match.figures)
    assert values["robots"][1]["stopped_reason"] == theirs.stopped_reason
    json.dumps(values, allow_nan=False)


def test_messages_go_to_the_own_team_alone_and_twice_a_second():
    made = []

    def talker(setup):
        made.append(Talker(setup))
        return made[-1]

    quick = Disturbances(messages=ChannelSettings(0.0, 0.1, 0.1))
    play(small_match(players=2, ours=talker, theirs=talker, disturbances=quick), 1.0)
    for robot, player in enumerate(made):
        side, other = int(robot < 2), 1 - robot % 2
        # sent at 0 and 0.5 s, 0.1 s under way
        assert player.heard == ((3, bytes([side, other, 0])), (18, bytes([side, other, 15])))


def test_an_interrupt_is_no_failure_of_a_player():
    class Interrupted(Sleeper):
        def act(self, senses):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        small_match(theirs=Interrupted).step()


def test_a_shoved_robot_is_where_the_hand_put_it():
    match = small_match(ours=Sleeper, faults=[BodyFault(0, 0.2, push_m=(0.1, 0.05), turn_rad=0.5)])
    moments = play(match, 1.0)
    before, after = moments[5].state.robots[0].pose, moments[-1].state.robots[0].pose
    assert (after.x_m - before.x_m, after.y_m - before.y_m) == pytest.approx((0.1, 0.05), abs=0.01)
    assert after.theta_rad == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"players": 0}, "players must be at least 1, got 0"),
        ({"seed": -1}, "seed must not be negative, got -1"),
        ({"faults": [BodyFault(4, 1.0)]}, "a fault must name a robot from 0 to 3, got 4"),
    ],
)
def test_what_cannot_be_played_is_refused(options, problem):
    with pytest.raises(ArgumentError, match=problem):
        Arena(FIELD, **{"players": 2, "seed": 0, "camera": SMALL_CAMERA, **options})


def test_seconds_are_whole_periods():
    assert [periods(seconds) for seconds in (0.01, 1 / 30, 1.0, 1.01, 60.0)] == [1, 1, 30, 31, 1800]


TRUTH = ("World", "WorldState", "RobotState", "RobotBody", "BallBody", "Arena", "Match", "MatchCamera", "Scene")


def is_truth(thing):
    return type(thing).__name__ in TRUTH or type(thing).__module__.startswith(
        ("pymunk", "sim2d.world.physics", "sim2d.world.world")
    )


@pytest.mark.parametrize("player", [Reckoner, BuiltInPlayer])
def test_a_player_cannot_reach_the_world(player):
    made = []

    def make(setup):
        made.append((setup, player(setup)))
        return made[-1][1]

    camera = None if player is BuiltInPlayer else SMALL_CAMERA
    match = Match(FIELD, 1, 0, ours=make, theirs=Sleeper, camera=camera)
    moments = play(match, 0.2)
    # what a player keeps must not lead there either: the record would, and hands nothing on
    found = reachable([*made, *(moment.robots[0].senses for moment in moments)])
    assert any(isinstance(thing, np.ndarray) for thing in found)
    assert [thing for thing in found if is_truth(thing)] == []


def test_the_walk_would_find_the_world():
    world = World(FIELD, 1, Arena(FIELD, 1, 0, camera=SMALL_CAMERA).limits, np.random.default_rng(0))
    frame = np.zeros((4, 4, 3), dtype=np.uint8)
    for hidden in ([lambda: world], {"a": (world.step,)}, [frame, iter([world])]):
        assert any(is_truth(thing) for thing in reachable([hidden]))
    assert reachable([frame[1:]])[-1] is frame


# most loops are a forward camera's
FIGURES_OF_A_MATCH = """
import json
from field_models import load_field
from sim2d.match.match import Match
from sim2d.report.match_figures import match_json

field = "four_legged_2007"
match = Match(load_field(field), 1, 5)
for _ in match.play(1.5):
    pass
print(json.dumps(match_json(field, 1, 5, match.figures)))
"""


@pytest.mark.slow
def test_the_same_seed_is_the_same_match_in_another_process(capsys):
    """Only this finds a match that depends on hashes, threads or clocks of its process."""
    program = [sys.executable, "-c", FIGURES_OF_A_MATCH]
    elsewhere = subprocess.run(program, capture_output=True, text=True, check=True).stdout
    exec(FIGURES_OF_A_MATCH, {})
    assert capsys.readouterr().out == elsewhere
    assert json.loads(elsewhere)["robots"][0]["distance_m"] > 0.1


def test_small_matches_repeat_and_seeds_differ():
    def story(seed):
        match = small_match(seed)
        moments = play(match, 0.5)
        frames = b"".join(moment.robots[0].senses.frame.tobytes() for moment in moments)
        return frames, match_json("ssl_2001", 1, 0, match.figures)

    assert story(1) == story(1)
    assert story(1)[0] != story(2)[0]
