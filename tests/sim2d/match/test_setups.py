"""Tests of what a match on each field is played with."""

import json

import pytest
from sim2d_players import Sleeper

from field_models import FileError, field_names, load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import OmniCamera, PinholeCamera
from sim2d.commands.match_options import CAMERA_NAMES, ROBOT_NAMES
from sim2d.match.arena import Arena
from sim2d.match.match import Match
from sim2d.match.run import MatchPlan
from sim2d.match.setups import CAMERAS, ROBOTS, camera_for, setup_for
from sim2d.report.match_figures import match_json
from sim2d.robot_link import RobotLimits

# field, players per side, kind of camera, whether robots have legs
LEAGUES = (
    ("ssl_2001", 2, OmniCamera, False),
    ("ssl_division_a", 6, PinholeCamera, False),
    ("ssl_division_b", 6, PinholeCamera, False),
    ("four_legged_2005", 4, PinholeCamera, True),
    ("four_legged_2007", 4, PinholeCamera, True),
    ("msl_6x4", 2, OmniCamera, False),
    ("msl_18x12", 5, OmniCamera, False),
    ("spl_2020", 5, PinholeCamera, True),
    ("humanoid_kid_2025", 4, PinholeCamera, True),
    ("humanoid_adult_2025", 3, PinholeCamera, True),
)


@pytest.mark.parametrize(("name", "players", "camera", "has_legs"), LEAGUES)
def test_a_field_alone_chooses_players_camera_and_robots(name, players, camera, has_legs):
    setup = setup_for(load_field(name))
    assert setup.players == players
    assert isinstance(setup.camera, camera)
    assert setup.robot.has_legs is has_legs
    # every robot stands on the floor around its own camera, which none of the others hides altogether
    assert setup.camera.height_m is not None
    assert setup.robot.limits.radius_m == pytest.approx(load_field(name).robot_radius_m, abs=0.03)


def test_all_built_in_fields_are_in_the_table():
    assert {name for name, *_ in LEAGUES} == set(field_names())


def test_the_options_name_what_there_is():
    assert tuple(CAMERAS) == CAMERA_NAMES
    assert tuple(ROBOTS) == ROBOT_NAMES


def test_another_camera_and_other_robots_may_be_named(tmp_path):
    field = load_field("ssl_division_b")
    setup = setup_for(field, players=3, camera="sekimori:128x110", robot="small")
    assert (setup.players, setup.camera.size_px) == (3, (128, 110))
    assert setup.robot is ROBOTS["small"]
    assert isinstance(setup_for(field, camera="msl_mirror").camera, OmniCamera)
    limits = RobotLimits(speed_mps=0.7)
    assert setup_for(field, limits=limits).robot.limits is limits
    with pytest.raises(FileError, match="missing"):
        setup_for(field, camera=str(tmp_path / "missing.toml"))


@pytest.mark.parametrize(
    ("chosen", "message"),
    [
        ({"players": 0}, "players must be at least 1, got 0"),
        ({"players": 40}, "40 robots of 0.09 m radius have no room side by side on 'ssl_2001'"),
        ({"robot": "middle_size", "players": 4}, "4 robots of 0.25 m radius have no room"),
        ({"camera": "eyes"}, "there is no camera 'eyes': give a camera or rig file"),
        ({"robot": "flying"}, "there are no robots 'flying', only small"),
    ],
)
def test_what_cannot_play_is_refused(chosen, message):
    with pytest.raises(ArgumentError, match=message):
        setup_for(load_field("ssl_2001"), **chosen)


def test_a_plan_takes_names_and_is_played_as_the_table_says():
    assert MatchPlan("spl_2020").setup.players == 5
    assert MatchPlan("msl_18x12").setup.camera.size_px == camera_for(load_field("msl_18x12")).size_px
    match = MatchPlan("ssl_2001", 1, 0.1, camera="ers7", robot="four_legged", ours=Sleeper, theirs=Sleeper).begin()
    arena = match.arena
    assert arena.limits == ROBOTS["four_legged"].limits
    assert arena.disturbances.names == ("sway", "latency", "slip", "drift", "shutter", "camera", "messages")
    assert match_json("ssl_2001", 1, 0, match.figures, disturbances=["sway"])["disturbances"] == ["sway"]


@pytest.mark.parametrize("name", ["ssl_2001", "spl_2020", "msl_6x4"])
def test_every_robot_sees_at_the_kick_off(name):
    arena = Arena(load_field(name), None, 3)
    senses = arena.senses()
    assert len(senses) == 2 * arena.players
    late = arena.disturbances.latency is not None
    assert all(late or (own.frame is not None and own.frame.std() > 5.0) for own in senses)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, *_ in LEAGUES])
def test_every_field_plays_a_second_and_the_same_seed_plays_the_same_match(name):
    """Only this finds a field on which players stop, lose their place or play another match each time."""
    match, again = (Match(load_field(name), seed=5) for _ in range(2))
    same_s = 0.2
    for moment in match.play(same_s):
        assert not any(robot.stopped for robot in moment.robots)
    for _ in again.play(same_s):
        pass
    assert again.arena.state == match.arena.state
    values, others = (match_json(name, one.arena.players, 5, one.figures) for one in (match, again))
    assert json.dumps(values) == json.dumps(others)
    for moment in match.play(1.0 - same_s):
        assert not any(robot.stopped for robot in moment.robots)
    assert all(robot.lost_ratio < 0.5 for robot in match.figures.robots)
    assert sum(robot.lost_ratio for robot in match.figures.robots) < 0.1 * len(match.figures.robots)


def test_a_match_is_not_played_on_half_a_field(tmp_path):
    path = tmp_path / "half.toml"
    path.write_text(
        'format = 1\nname = "room"\nlength_m = 6.0\nwidth_m = 4.0\nline_width_m = 0.05\nhalf = true\n'
        '[boundary]\nkind = "carpet"\n'
    )
    with pytest.raises(ArgumentError, match="a match needs a whole field, and of 'room' there is half"):
        setup_for(load_field(path))
