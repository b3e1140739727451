"""A ball in a pinhole camera's frame is placed by the camera as it was held, with what that leaves open."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import COLOR_NAMES, load_field
from robocup_vision import Vision
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.balls.projection import PinholeBallProjection
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Ball, Scene

FIELD = load_field("four_legged_2007")
CAMERA = PinholeCamera(
    (208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.0, height_std_m=0.006,
    roll_std_rad=0.024, offset_m=(0.05, 0.0),
)  # fmt: skip
PROJECTION = PinholeBallProjection(CAMERA, FIELD.ball_radius_m)
STEP = 1e-5


def placed(camera, pixel, sway_std_rad=None):
    return PROJECTION.held(camera, sway_std_rad).place(*pixel, 0.3, 0.0)


@given(
    st.floats(-1.5, 1.5), st.floats(-0.6, -0.1), st.floats(-0.03, 0.03), st.floats(10.0, 200.0), st.floats(90.0, 155.0)
)
def test_the_covariance_is_what_errors_of_tilt_roll_and_height_do(pan, tilt, roll, u, v):
    held = CAMERA.with_orientation(pan, tilt, roll)
    ball = placed(held, (u, v), (0.004, 0.007))
    here = np.array([ball.x_m, ball.y_m])

    def moved(other):
        there = placed(other, (u, v))
        return (np.array([there.x_m, there.y_m]) - here) / STEP

    raised = PinholeCamera(
        held.size_px, held.focal_px, held.center_px, held.height_m + STEP, pan_rad=pan, tilt_rad=tilt, roll_rad=roll,
        offset_m=held.offset_m,
    )  # fmt: skip
    moves = np.stack([
        0.004 * moved(held.with_orientation(pan, tilt + STEP, roll)),
        0.007 * moved(held.with_orientation(pan, tilt, roll + STEP)),
        0.006 * moved(raised),
    ])  # fmt: skip
    of_pixel = placed(held, (u, v), (1e-9, 1e-9)).covariance
    of_height = np.outer(moves[2], moves[2])
    of_sway = ball.covariance - of_pixel
    expected = moves[:2].T @ moves[:2]
    assert of_sway == pytest.approx(expected, abs=0.005 * float(np.trace(expected)))
    assert np.linalg.eigvalsh(of_pixel - 0.99 * of_height).min() > -1e-12


def test_a_camera_that_is_not_told_may_be_off_as_its_file_says():
    own = placed(CAMERA, (104.0, 120.0))
    same = placed(CAMERA, (104.0, 120.0), (0.024, 0.024))
    assert own.covariance == pytest.approx(same.covariance)
    stiff = placed(CAMERA, (104.0, 120.0), (0.001, 0.001))
    assert np.linalg.eigvalsh(own.covariance - stiff.covariance).min() > 0


# lenses, of which the second folds back a little beyond the picture
LENSES = {"none": (), "wide": (-0.12, 0.03, 0.001, -0.001), "wider": (-0.3, 0.1, 0.0, 0.0)}


@pytest.mark.parametrize(("nod_deg", "lens"), [(-2.0, "none"), (2.0, "wide"), (0.0, "wider"), (2.0, "wider")])
def test_a_nodding_robot_knows_where_the_ball_is(nod_deg, lens):
    truth, at, pan = Pose2(-0.6, 0.2, 0.3), np.array([0.9, 0.1]), 0.25
    camera = replace(CAMERA, distortion=LENSES[lens])
    held = camera.with_orientation(pan, CAMERA.tilt_rad + math.radians(nod_deg), 0.01)
    in_field = truth.transform(at)
    ball = Ball(*in_field.tolist(), FIELD.ball_radius_m, COLOR_NAMES[FIELD.ball_color])
    rendered = render_pinhole(held, Scene(FIELD, ball=ball), truth, supersample=2)
    frame = np.clip(rendered, 0, 255).astype(np.uint8)
    prior = PoseEstimate(truth, np.diag([0.03, 0.03, 0.02]) ** 2, 1.0, 0.0)
    view = Vision(FIELD, camera).look(frame, prior=prior, pan_rad=pan)
    assert view.pose
    error = np.array([view.balls[0].x_m, view.balls[0].y_m]) - at
    assert math.hypot(*error) < 0.04
    assert error @ np.linalg.solve(view.balls[0].covariance, error) < 9.0
    assert np.sqrt(np.linalg.eigvalsh(view.balls[0].covariance)[-1]) < 0.1


YELLOW = replace(FIELD, ball_color="yellow")


def seen(scene, pose, nod_rad=0.0, cast_bgr=(1.0, 1.0, 1.0)):
    """Balls in a frame of a camera that is blurred a little, and has noise."""
    held = CAMERA.with_orientation(0.0, CAMERA.tilt_rad + nod_rad, 0.0)
    rendered = cv2.GaussianBlur(render_pinhole(held, scene, pose, supersample=4), (0, 0), 0.7)
    noise = np.random.default_rng(4).normal(0.0, 2.0, rendered.shape)
    frame = np.clip(rendered * np.array(cast_bgr) + noise, 0, 255).astype(np.uint8)
    return Vision(YELLOW, CAMERA).look(frame).balls


@pytest.mark.parametrize("away_m", [1.8, 2.2, 2.6, 3.0])
def test_the_band_of_a_beacon_is_no_ball_of_its_colour(away_m):
    beacon = next(one for one in YELLOW.beacons if one.colors == ("white", "yellow", "pink"))
    heading = math.atan2(beacon.y_m, beacon.x_m)
    pose = Pose2(beacon.x_m - away_m * math.cos(heading), beacon.y_m - away_m * math.sin(heading), heading + 0.1)
    # nodded up by so much, the band lies where a ball could
    assert seen(Scene(YELLOW), pose, 0.03, (0.9, 1.1, 1.1)) == ()


@pytest.mark.parametrize(("heading", "away_m"), [(0.0, 0.5), (0.6, 0.9), (math.pi / 2, 1.3), (math.pi / 2, 0.5)])
def test_a_ball_on_a_line_is_a_ball(heading, away_m):
    # the centre line runs along y
    on_line = Ball(0.0, 0.9, YELLOW.ball_radius_m, COLOR_NAMES["yellow"])
    pose = Pose2(-away_m * math.cos(heading), 0.9 - away_m * math.sin(heading), heading)
    balls = seen(Scene(YELLOW, ball=on_line), pose)
    assert len(balls) == 1
    # of the robot, whose camera is held as its file says
    assert math.hypot(balls[0].x_m - away_m, balls[0].y_m) < 0.06 * away_m + 0.02
