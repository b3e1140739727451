"""Matches of robots with several cameras, and of humanoids with a fisheye: they know where they are."""

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import load_rig, save_camera
from sim2d.match.arena import Arena
from sim2d.match.disturbances import Disturbances, disturbances_for
from sim2d.match.env import MatchEnv
from sim2d.match.match import Match
from sim2d.match.run import MatchPlan, run_match
from sim2d.match.setups import CAMERAS, setup_for
from sim2d.sensors.match_camera import ShutterSettings

FIELD = load_field("msl_6x4")


@pytest.fixture(scope="module")
def rig():
    return CAMERAS["msl_fisheyes"]()


def errors_of(match, seconds):
    """Return how far each robot's estimate is off in each period, metres; infinite where it has none."""
    errors = []
    for moment in match.play(seconds):
        for truth, robot in zip(moment.state.robots, moment.robots, strict=True):
            assert not robot.stopped
            pose = robot.status.pose
            errors.append(pose.pose.error_to(truth.pose)[0] if pose else np.inf)
    return np.array(errors)


@pytest.mark.slow
@pytest.mark.parametrize(("field", "camera"), [("msl_6x4", "msl_fisheyes"), ("humanoid_kid_2025", "kid_fisheye")])
def test_robots_know_where_they_are(field, camera):
    """Only this finds robots with several cameras, or a fisheye, that lose their place in play."""
    match = Match(load_field(field), 1, 3, camera=CAMERAS[camera]())
    assert np.mean(errors_of(match, 1.5) < 0.05) > 0.97


def test_frames_of_all_cameras_come_together(rig):
    arena = Arena(FIELD, 1, 3, camera=rig)
    (one, other) = arena.senses()
    assert len(one.rig_frames) == 4
    assert one.frame is one.rig_frames[0]
    assert [frame.shape for frame in other.rig_frames] == [(152, 200, 3)] * 4
    assert not np.array_equal(one.rig_frames[0], one.rig_frames[2])
    assert one.frame_pan_rad is None
    assert arena.setup(0).rig is rig
    assert not arena.setup(0).sees_ahead_only


def test_a_rig_file_is_taken(rig, tmp_path):
    for name, camera in zip(rig.names, rig.cameras, strict=True):
        save_camera(camera, tmp_path / f"{name}.toml")
    names = ", ".join(f'"{name}.toml"' for name in rig.names)
    (tmp_path / "rig.toml").write_text(f"format = 1\ncameras = [{names}]\n")
    again = setup_for(FIELD, camera=str(tmp_path / "rig.toml")).rig
    assert again.names == load_rig(tmp_path / "rig.toml").names == rig.names


def test_what_robots_with_several_cameras_cannot_is_told(rig, tmp_path):
    with pytest.raises(ArgumentError, match="shutter, camera and knock are of robots with one camera"):
        Arena(FIELD, 1, 3, camera=rig, disturbances=Disturbances(shutter=ShutterSettings()))
    with pytest.raises(ArgumentError, match="observation is of one camera"):
        MatchEnv(FIELD, players=1, camera=rig)
    with pytest.raises(ArgumentError, match="a recording holds the frames of one camera"):
        run_match(MatchPlan("msl_6x4", 1, 0.1, camera=rig), tmp_path / "out", record=True)
    setup = setup_for(FIELD, camera=rig)
    assert disturbances_for(setup.robot, setup.camera, setup.rig).names == ("sway", "messages")
