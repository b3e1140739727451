"""Poses found without a prior in a smaller copy of the frame, by boards and lines of any width."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.localizer import FrameEvidence
from robocup_vision.localization.model_edges.finder import EdgeFinder, for_walled_fields
from robocup_vision.localization.model_edges.follower import EdgeFollower
from robocup_vision.localization.model_edges.localizer import EdgeLocalizer
from robocup_vision.localization.model_edges.settings import EdgeSettings
from robocup_vision.vision import Vision
from sim2d.rendering.motion_blur import motion_blur
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Scene

HALF = load_field(Path(__file__).parents[3] / "data" / "onboard_ssl_half_field.toml")
CAMERA = PinholeCamera(
    size_px=(640, 480),
    focal_px=(642.0, 642.0),
    center_px=(322.8, 239.8),
    height_m=0.17,
    offset_m=(0.09, 0.0),
    tilt_rad=-0.29,
    roll_rad=0.0,
)
CORNER, PENALTY_AREA = Pose2(2.9, 1.7, 0.6), Pose2(2.9, 2.3, -1.5)


@dataclass(frozen=True)
class Blurred:
    """A frame of a robot that turns: lines twice as wide as the field file says, tilt and roll a little off."""

    frame: np.ndarray
    pose: Pose2

    @property
    def camera_pose(self):
        """The camera's own."""
        return self.pose.compose(CAMERA.camera_in_robot)


@pytest.fixture(scope="module", params=[CORNER, PENALTY_AREA], ids=["corner", "penalty_area"])
def blurred(request):
    return Blurred(frame_at(request.param, (9.0, 3.0)), request.param)


def frame_at(pose, blur_px):
    held = CAMERA.with_orientation(0.0, CAMERA.tilt_rad + 0.008, -0.006)
    light = render_pinhole(held, Scene(replace(HALF, line_width_m=0.05)), pose, supersample=4)
    return motion_blur(np.clip(light, 0, 255).astype(np.uint8), *blur_px)


def finder_of_copies():
    return EdgeFinder(EdgeFollower(HALF, CAMERA, EdgeSettings().for_unconfirmed_frames(), 3), for_walled_fields(HALF))


def off_m(candidates, truth):
    return min(one.error_to(truth)[0] for one in candidates)


def test_a_blurred_frame_of_wide_lines_is_located_among_the_corners_that_look_alike(blurred):
    answer = finder_of_copies().find(blurred.frame)
    assert answer
    candidates = answer.estimate.candidates
    assert off_m(candidates, blurred.camera_pose) < 0.05
    assert len(candidates) == (4 if blurred.pose == CORNER else 1)
    assert answer.as_fitted(CAMERA).focal_px == CAMERA.focal_px


def test_vision_takes_it_where_nothing_else_is_known_of_the_pose(blurred):
    view = Vision(HALF, CAMERA).look(blurred.frame)
    assert view.pose
    assert off_m(view.pose.candidates, blurred.pose) < 0.05
    pixels = view.edge_points.pixels
    assert pixels[:, 0].max() > 0.6 * CAMERA.size_px[0]


@pytest.mark.parametrize("pose", [Pose2(0.9, -1.5, -2.0), Pose2(0.8, 2.2, 0.2)])
def test_what_leaves_the_position_open_is_looked_at_in_smaller_copies_beside_boards(pose):
    frame = frame_at(pose, (6.0, 6.0))
    std = np.array([0.1, 0.1, math.radians(5.0)])
    prior = PoseEstimate(pose.compose(Pose2(0.08, -0.06, 0.05)), np.diag(std**2), 1.0, 0.0)
    evidence = FrameEvidence(frame, CAMERA, None, None, np.empty(0), np.empty(0, dtype=np.int64))
    once = EdgeLocalizer(HALF, CAMERA, settings=EdgeSettings(open_m=math.inf)).locate(evidence, prior)
    again = EdgeLocalizer(HALF, CAMERA).locate(evidence, prior)
    assert once.pose
    assert again.pose
    assert again.pose.pose.error_to(pose)[0] < 0.5 * once.pose.pose.error_to(pose)[0]
    assert again.pose.pose.error_to(pose)[0] < 0.05
    # the measurement, too, is that of the copy
    assert np.trace(again.measurement().covariance) < np.trace(once.measurement().covariance)


def test_a_picture_of_noise_is_not_located():
    rng = np.random.default_rng(5)
    finder = finder_of_copies()
    assert not finder.find(rng.integers(0, 255, (480, 640, 3), dtype=np.uint8))
    assert not finder.find(np.full((480, 640, 3), (50, 130, 45), dtype=np.uint8))
