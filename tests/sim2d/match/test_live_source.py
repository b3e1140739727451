"""Robots of a simulated match as a source: what each sees itself, beside the truth."""

import pytest
from sim2d_players import SMALL_CAMERA, Sleeper

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.live.sources.opening import open_source
from robocup_vision.live.sources.source import SourceOptions
from sim2d.match.live_source import MatchSource, open_match
from sim2d.match.match import Match


def test_each_robot_shows_what_it_sees_itself():
    source = open_source("sim:ssl_2001,players=1,seed=3,robots=0+1", SourceOptions())
    assert [setup.name for setup in source.setups] == ["robot 0", "robot 1"]
    assert source.make_vision(source.setups[0]) is None
    for _ in range(12):
        frames = source.read(1.0)
    assert [frame.robot for frame in frames] == ["robot 0", "robot 1"]
    for frame in frames:
        assert frame.view.t_s == frame.t_s
        assert frame.colors is not None
        assert frame.plan.command is not None
        assert frame.plan.reasons[0].startswith("intent: ")
        error_m, _ = frame.view.belief.pose.pose.error_to(frame.truth)
        assert error_m < 0.01


def test_robots_and_the_ball_are_put_elsewhere():
    source = open_source("sim:ssl_2001,players=1,seed=3", SourceOptions())
    source.read(1.0)
    source.place("robot 0", 0.3, -0.4, 1.5)
    source.place("robot 1", 0.9, 0.6, None)
    heading_rad = source.read(1.0)[0].world.robots[1].pose.theta_rad
    frame = source.read(1.0)[0]
    robots = {robot.name: robot for robot in frame.world.robots}
    assert [robot.side for robot in frame.world.robots] == [1, -1]
    # one control period later they have hardly moved
    assert robots["robot 0"].pose.error_to(Pose2(0.3, -0.4, 1.5))[0] < 0.05
    assert robots["robot 1"].pose.error_to(Pose2(0.9, 0.6, heading_rad))[1] < 0.2
    assert frame.truth.error_to(robots["robot 0"].pose) == (0.0, 0.0)


def test_the_ball_is_put_elsewhere_once_play_has_begun():
    match = Match(load_field("ssl_2001"), 1, 3, ours=Sleeper, theirs=Sleeper, camera=SMALL_CAMERA)
    source = MatchSource("sim", match, (0,))
    source.read(1.0)
    with pytest.raises(ArgumentError, match="until the whistle of the kick-off"):
        source.place("ball", -0.5, 0.25, None)
    while match.arena.state.phase == "kick_off":
        source.read(1.0)
    source.place("ball", -0.5, 0.25, None)
    source.read(1.0)
    assert source.read(1.0)[0].world.ball_m == pytest.approx((-0.5, 0.25), abs=0.01)


@pytest.mark.parametrize(
    ("place", "words"),
    [
        (("ball", 9.0, 0.0, None), r"ball cannot be put at \(9.00, 0.00\): that is off the floor"),
        (("robot 7", 0.0, 0.0, None), "there is no 'robot 7' in this match, only the ball and robots 0 to 1"),
    ],
)
def test_what_cannot_be_put_there_is_named(place, words):
    source = open_source("sim:ssl_2001,players=1,seed=3", SourceOptions())
    with pytest.raises(ArgumentError, match=words):
        source.place(*place)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("ssl_2001,speed=3", "'speed=3' must be one of"),
        ("ssl_2001,seed", "'seed' must be one of"),
        ("ssl_2001,seed=1,seed=2", "must be one of"),
        ("ssl_2001,seed=-1", "seed must be a whole number"),
        ("ssl_2001,robots=9", "robots must be numbers from 0 to 3"),
        ("ssl_2001,robots=0+0", "robots must be numbers"),
        ("ssl_2001,ours=nobody", "no player 'nobody'"),
    ],
)
def test_what_a_match_has_not_is_named(text, words):
    with pytest.raises(ArgumentError, match=words.replace("+", r"\+")):
        open_match(text, SourceOptions())


@pytest.mark.parametrize(
    "options",
    [
        SourceOptions(field="msl_6x4"),
        SourceOptions(memory=True),
        SourceOptions(method="field"),
        SourceOptions(colors="c"),
    ],
)
def test_options_that_say_nothing_to_a_match_are_refused(options):
    with pytest.raises(ArgumentError, match="sim:ssl_2001"):
        open_match("ssl_2001", options)
