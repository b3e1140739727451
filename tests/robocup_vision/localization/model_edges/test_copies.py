"""Blurred frames: followed and found in smaller copies."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import EdgeState, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.distinct import pose_offset
from robocup_vision.localization.localizer import FrameEvidence
from robocup_vision.localization.model_edges.finder import EdgeFinder, for_walled_fields
from robocup_vision.localization.model_edges.follower import EdgeFollower
from robocup_vision.localization.model_edges.localizer import EdgeLocalizer, reductions
from robocup_vision.localization.model_edges.settings import EdgeSettings
from robocup_vision.vision import Vision
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Scene
from sim2d.rendering.sensor import motion_blur

STD = np.array([0.05, 0.05, math.radians(2.0)])
BLUR_PX = 23


@pytest.fixture(scope="module")
def blurred_shot(spl_shot):
    """Show the penalty area while the robot turns: a frame of twice the size, blurred along its rows."""
    width, height = (2 * n for n in spl_shot.camera.size_px)
    frame = cv2.resize(spl_shot.frame, (width, height), interpolation=cv2.INTER_CUBIC)
    frame = cv2.blur(frame, (BLUR_PX, 9))
    camera = replace(
        spl_shot.camera,
        size_px=(width, height),
        focal_px=tuple(2 * f for f in spl_shot.camera.focal_px),
        center_px=tuple(2 * c + 0.5 for c in spl_shot.camera.center_px),
    )
    return replace(spl_shot, frame=frame, camera=camera)


def test_a_blurred_frame_is_followed_in_a_smaller_copy(blurred_shot):
    prior = PoseEstimate(blurred_shot.pose, np.diag(STD**2), 1.0, 0.0)
    whole = EdgeFollower(blurred_shot.field, blurred_shot.camera)
    follower = EdgeFollower(
        blurred_shot.field, blurred_shot.camera, EdgeSettings().for_unconfirmed_frames(), reduction=3
    )
    answer = follower.follow(blurred_shot.frame, prior)
    assert answer
    away, turn = answer.estimate.pose.error_to(blurred_shot.pose)
    assert away < 0.06
    assert turn < math.radians(1.5)
    camera = blurred_shot.camera
    assert answer.as_fitted(camera).tilt_rad - camera.tilt_rad == pytest.approx(-0.012, abs=0.006)
    # the nod found goes on in the follower of whole frames
    whole.state = follower.state
    assert whole.state.log_odds > 0.0
    assert whole.state.last_pose.error_to(answer.estimate.pose)[0] == pytest.approx(0.0, abs=1e-9)


def test_the_edges_are_told_in_pixels_of_the_whole_frame(blurred_shot):
    vision = Vision(blurred_shot.field, blurred_shot.camera)
    view = vision.look(blurred_shot.frame, prior=PoseEstimate(blurred_shot.pose, np.diag(STD**2), 1.0, 0.0))
    assert view.pose
    points = view.edge_points
    assert points.pixels[:, 0].max() > 0.6 * blurred_shot.camera.size_px[0]
    found = points.pixels[points.state == EdgeState.FOUND]
    rows, columns = found[:, 1].round().astype(int), found[:, 0].round().astype(int)
    inside = (columns >= 0) & (columns < 640) & (rows >= 0) & (rows < 480)
    # lines are brighter than the median of the picture, mostly
    light = blurred_shot.frame.astype(int)[..., 0]
    assert np.mean(light[rows[inside], columns[inside]] > np.median(light)) > 0.7


def test_a_follower_of_copies_tells_residuals_and_focal_length_of_the_whole_frame(spl_shot):
    prior = PoseEstimate(spl_shot.pose, np.diag(STD**2), 1.0, 0.0)
    whole, half = (EdgeFollower(spl_shot.field, spl_shot.camera, reduction=k) for k in (1, 2))
    in_whole, in_half = whole.follow(spl_shot.frame, prior), half.follow(spl_shot.frame, prior)
    assert in_whole
    assert in_half
    assert in_half.estimate.pose.error_to(in_whole.estimate.pose) == pytest.approx((0.0, 0.0), abs=0.02)
    assert in_half.estimate.residual_px == pytest.approx(2 * in_half.evidence.rms_px)
    assert in_half.as_fitted(spl_shot.camera).focal_px == pytest.approx(in_whole.as_fitted(spl_shot.camera).focal_px)
    # where it is followed again, the copy is the same
    assert half.copy_of(half.copy_of(spl_shot.frame)).shape == half.copy_of(spl_shot.frame).shape


def test_a_small_frame_has_no_copy():
    assert [reductions(width_px) for width_px in (208, 416, 640)] == [[], [2], [2, 3]]


def test_a_frame_without_a_field_confirms_nothing_in_a_second_look_either(blurred_shot):
    prior = PoseEstimate(blurred_shot.pose, np.diag(STD**2), 1.0, 0.0)
    noise = np.random.default_rng(2).integers(0, 256, blurred_shot.frame.shape).astype(np.uint8)
    evidence = FrameEvidence(noise, blurred_shot.camera, None, None, np.empty(0), np.empty(0, dtype=np.int64))
    assert not EdgeLocalizer(blurred_shot.field, blurred_shot.camera).locate(evidence, prior).pose


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


@pytest.fixture(
    scope="module", params=[CORNER, pytest.param(PENALTY_AREA, marks=pytest.mark.slow)], ids=["corner", "penalty_area"]
)
def blurred(request):
    return Blurred(frame_at(request.param, (9.0, 3.0)), request.param)


def frame_at(pose, blur_px):
    held = CAMERA.with_orientation(0.0, CAMERA.tilt_rad + 0.008, -0.006)
    light = render_pinhole(held, Scene(replace(HALF, line_width_m=0.05)), pose, supersample=4)
    return motion_blur(np.clip(light, 0, 255).astype(np.uint8), *blur_px)


def finder_of_copies():
    return EdgeFinder(
        EdgeFollower(HALF, CAMERA, EdgeSettings().for_unconfirmed_frames(), reduction=3), for_walled_fields(HALF)
    )


def off_m(candidates, truth):
    return min(one.error_to(truth)[0] for one in candidates)


def test_a_blurred_frame_of_wide_lines_is_located_among_the_corners_that_look_alike(blurred):
    """The penalty area alone finds a corner that is taken where more is in view."""
    answer = finder_of_copies().find(blurred.frame)
    assert answer
    candidates = answer.estimate.candidates
    assert off_m(candidates, blurred.camera_pose) < 0.05
    assert len(candidates) == (4 if blurred.pose == CORNER else 1)
    assert answer.as_fitted(CAMERA).focal_px == CAMERA.focal_px


def test_vision_takes_it_where_nothing_else_is_known_of_the_pose(blurred):
    """The penalty area alone finds a `Vision` that stops at the first answer."""
    view = Vision(HALF, CAMERA).look(blurred.frame)
    assert view.pose
    assert off_m(view.pose.candidates, blurred.pose) < 0.05
    pixels = view.edge_points.pixels
    assert pixels[:, 0].max() > 0.6 * CAMERA.size_px[0]


@pytest.mark.parametrize("pose", [Pose2(0.9, -1.5, -2.0), Pose2(0.8, 2.2, 0.2)])
def test_what_leaves_the_position_open_beside_boards_says_so(pose):
    frame = frame_at(pose, (6.0, 6.0))
    std = np.array([0.1, 0.1, math.radians(5.0)])
    prior = PoseEstimate(pose.compose(Pose2(0.08, -0.06, 0.05)), np.diag(std**2), 1.0, 0.0)
    evidence = FrameEvidence(frame, CAMERA, None, None, np.empty(0), np.empty(0, dtype=np.int64))
    answer = EdgeLocalizer(HALF, CAMERA).locate(evidence, prior)
    assert answer.pose
    error = pose_offset(answer.pose.pose, pose)
    assert error @ np.linalg.solve(answer.pose.covariance, error) < 16.0


def test_a_picture_of_noise_is_not_located():
    rng = np.random.default_rng(5)
    finder = finder_of_copies()
    assert not finder.find(rng.integers(0, 255, (480, 640, 3), dtype=np.uint8))
    assert not finder.find(np.full((480, 640, 3), (50, 130, 45), dtype=np.uint8))
