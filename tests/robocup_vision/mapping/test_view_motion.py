"""Motion from views of a mirror camera: against the truth, with and without wheels, and of a camera off the centre."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera.files import load_camera
from robocup_vision.geometry import Pose2
from robocup_vision.mapping import EgoMotion, ViewMotion
from robocup_vision.vision import Vision
from sim2d.match.arena import Arena
from sim2d.match.disturbances import NONE
from sim2d.robot_link import Command

ROOT = Path(__file__).parents[3]
FRAMES = 20


@pytest.fixture(scope="module")
def drive():
    """Return views, what the wheels report, and the true poses of an upright robot that drives and turns."""
    field = load_field("ssl_2001")
    arena = Arena(field, players=1, seed=5, disturbances=NONE)
    vision = Vision(field, arena.camera)
    views, odometry, truth = [], [], []
    for _ in range(FRAMES):
        senses = arena.senses()[0]
        views.append(vision.look(senses.frame, senses.t_s))
        odometry.append(senses.odometry)
        truth.append(arena.state.robots[0].pose)
        arena.step({0: Command(0.4, 0.1, 0.6)})
    return views, odometry, truth


def followed(views, odometry=None):
    motion = ViewMotion()
    steps = odometry or [None] * len(views)
    return [motion.update(view, step) for view, step in zip(views, steps, strict=True)]


def test_views_alone_tell_the_way_and_how_well(drive):
    views, _, truth = drive
    steps = followed(views)
    away_m, away_rad = steps[-1].pose.error_to(truth[0].inverse().compose(truth[-1]))
    driven_m, _ = truth[-1].error_to(truth[0])
    assert driven_m > 0.15
    assert away_m < 0.01
    assert away_rad < 0.02
    nees = []
    for before, now, step in zip(truth[:-1], truth[1:], steps[1:], strict=True):
        assert step.profiles >= 1
        off = before.inverse().compose(now).array - step.motion.array
        nees.append(off @ np.linalg.solve(step.covariance, off))
    assert np.mean(nees) < 6.0


def test_wheels_that_slip_are_corrected(drive):
    views, odometry, truth = drive
    slipped = [Pose2(1.1 * o.x_m, 1.1 * o.y_m, 1.1 * o.theta_rad) for o in odometry]
    moved = truth[0].inverse().compose(truth[-1])
    by_wheels = Pose2(0.0, 0.0, 0.0)
    for step in slipped[1:]:
        by_wheels = by_wheels.compose(step)
    fused = followed(views, slipped)[-1].pose
    assert fused.error_to(moved)[0] < 0.5 * by_wheels.error_to(moved)[0]


def test_a_camera_off_the_robots_centre_gives_the_centres_motion(drive):
    views, _, _ = drive
    arm = Pose2(0.05, -0.03, 0.0)
    moved = [replace(view, camera=replace(view.camera, offset_m=(arm.x_m, arm.y_m))) for view in views]
    centred, shifted = followed(views), followed(moved)
    for one, other in zip(centred[5:], shifted[5:], strict=True):
        expected = arm.compose(one.motion).compose(arm.inverse())
        assert other.motion.array == pytest.approx(expected.array, abs=2e-3)
        # turning is known as well; the centre's place only as well as its arm allows
        assert other.covariance[2, 2] == pytest.approx(one.covariance[2, 2], rel=0.2)


def test_after_forgetting_the_next_view_is_the_first(drive):
    views, _, _ = drive
    motion = ViewMotion(EgoMotion(len(views[0].boundary_radius_px)))
    motion.update(views[0])
    assert motion.update(views[1]).profiles == 1
    motion.forget()
    assert motion.update(views[0]).profiles == 0


def test_views_that_tell_no_motion_are_refused(drive):
    views, _, _ = drive
    goal_camera = load_camera(ROOT / "images" / "goal_four_legged" / "camera.toml")
    motion = ViewMotion()
    with pytest.raises(ArgumentError, match="hand t_s to look"):
        motion.update(replace(views[0], t_s=None))
    with pytest.raises(ArgumentError, match="needs a mirror camera"):
        motion.update(replace(views[0], camera=goal_camera))
    motion.update(views[1])
    with pytest.raises(ArgumentError, match="later than that of the view before"):
        motion.update(views[0])
