"""Overhead vision: exact without realism, and with it noise, hidden balls and floor rays as the table says."""

import math

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.ssl.protocol.mapping import decode
from robocup_vision.ssl.values.detection import VisionPacket
from robocup_vision.ssl.values.simulation import ErForceRealism, Team
from sim2d.network.overhead_view import camera_rig
from sim2d.network.realism import REALISMS, Realism, changed_realism, realism_named
from sim2d.network.vision import MAX_PACKET_BYTES, OverheadVision, detection_packets, visible_ratio
from sim2d.network.world import SIDES, LeagueState
from sim2d.world.ball_physics import Flight
from sim2d.world.state import BallState, RobotState

FIELD = load_field("ssl_division_b")
CENTER = BallState(0.0, 0.0)


def robot(team=Team.YELLOW, number=1, x=1.0, y=0.5, angle=0.3):
    return RobotState(0, SIDES[team], number, Pose2(x, y, angle), (0.0, 0.0), 0.0)


def state(*robots, ball=CENTER, t_s=2.0):
    return LeagueState(t_s, robots, ball)


def vision(realism):
    return OverheadVision(FIELD, realism, np.random.default_rng(1))


def test_without_realism_everything_is_where_it_is():
    truth = state(robot(), robot(Team.BLUE, 7, -4.7, -3.2), ball=BallState(1.0, -2.0, z_m=0.4))
    (frame,) = vision(Realism()).capture(truth, 100.0)
    (yellow,), (blue,), (ball,) = frame.yellow, frame.blue, frame.balls
    assert (frame.t_capture_s, frame.t_sent_s, frame.frame_number) == (102.0, 102.0, 1)
    assert (yellow.robot_id, yellow.x_m, yellow.y_m, yellow.orientation_rad) == (1, 1.0, 0.5, 0.3)
    assert (blue.robot_id, blue.x_m, blue.y_m) == (7, -4.7, -3.2)
    assert (ball.x_m, ball.y_m, ball.z_m) == (1.0, -2.0, 0.4)


def test_cameras_tell_where_they_are_and_pixels_agree_with_their_calibration():
    for camera in camera_rig(FIELD, 2, 2, 1.0):
        cal = camera.calibration
        # rotation by (x, y, z, w) = (1, 0, 0, 0)
        rotation = np.diag([1.0, -1.0, -1.0])
        shift = np.array([cal.t_x_m, cal.t_y_m, cal.t_z_m])
        np.testing.assert_allclose(-rotation.T @ shift, [cal.camera_x_m, cal.camera_y_m, cal.camera_z_m], atol=1e-12)
        for point in ([camera.x_m, camera.y_m, 0.0], [camera.x_m + 1.0, camera.y_m - 0.7, 0.15]):
            seen = rotation @ np.array(point) + shift
            u, v = seen[:2] / seen[2] * cal.focal_length_px + (cal.principal_x_px, cal.principal_y_px)
            assert camera.pixel(*point) == (pytest.approx(u), pytest.approx(v))
        # the ray through a point above the floor passes its point on the floor
        assert camera.pixel(*camera.on_floor(camera.x_m + 0.5, camera.y_m, 1.0)) == pytest.approx(
            camera.pixel(camera.x_m + 0.5, camera.y_m, 1.0)
        )


def test_every_place_of_the_field_is_seen_and_seams_twice():
    rig = camera_rig(FIELD, 2, 2, 1.0)
    rng = np.random.default_rng(3)
    for x, y in rng.uniform([-4.8, -3.3], [4.8, 3.3], (500, 2)).tolist():
        seen = sum(camera.covers(x, y) for camera in rig)
        assert seen == (1 + (abs(x) <= 0.5)) * (1 + (abs(y) <= 0.5))


def test_noise_and_missing_balls_are_those_of_the_table():
    realism = REALISMS["rc2021"]
    eyes = vision(realism)
    errors, angles, balls, found = [], [], [], 0
    frames = 3000
    truth = state(robot(x=2.0, y=2.0), ball=BallState(2.0, 1.0))
    for _ in range(frames):
        frame = next(f for f in eyes.capture(truth, 0.0) if f.yellow)
        errors += [frame.yellow[0].x_m - 2.0, frame.yellow[0].y_m - 2.0]
        angles.append(frame.yellow[0].orientation_rad - 0.3)
        found += len(frame.balls)
        balls += [ball.x_m - 2.0 for ball in frame.balls]
    assert np.std(errors) == pytest.approx(0.0013, rel=0.05)
    assert np.std(angles) == pytest.approx(0.01, rel=0.05)
    assert np.std(balls) == pytest.approx(0.0010, rel=0.05)
    assert found / frames == pytest.approx(0.95, abs=0.015)
    assert frame.t_sent_s - frame.t_capture_s == pytest.approx(0.010)


def test_a_ball_behind_a_robot_is_hidden_and_one_before_it_is_not():
    camera = camera_rig(FIELD, 1, 1, 0.0)[0]
    beyond, before = (
        state(robot(x=3.0, y=0.0), ball=BallState(3.12, 0.0)),
        state(robot(x=3.0, y=0.0), ball=BallState(2.85, 0.0)),
    )
    assert visible_ratio(camera, beyond, FIELD.ball_radius_m) < 0.4
    assert visible_ratio(camera, before, FIELD.ball_radius_m) == 1.0
    assert visible_ratio(camera, state(ball=BallState(3.0, 0.0)), FIELD.ball_radius_m) == 1.0
    hidden = vision(Realism(hides_ball=True)).capture(beyond, 0.0)[0]
    assert hidden.balls == ()
    assert vision(Realism()).capture(beyond, 0.0)[0].balls


def test_a_flying_ball_is_seen_where_its_ray_meets_the_floor():
    eyes = vision(Realism(floor_rays=True))
    (frame,) = eyes.capture(state(ball=BallState(2.0, 0.0, z_m=1.0)), 0.0)
    (ball,) = frame.balls
    assert ball.z_m is None
    assert ball.x_m == pytest.approx(2.0 * eyes.cameras[0].z_m / (eyes.cameras[0].z_m - 1.0))


def test_packets_fit_into_small_buffers_however_many_robots_there_are():
    crowd = [
        robot(team, number, 0.5 * number - 4, float(team)) for team in (Team.YELLOW, Team.BLUE) for number in range(16)
    ]
    (frame,) = vision(Realism()).capture(state(*crowd), 1.8e9)
    packets = detection_packets(frame)
    assert max(map(len, packets)) <= MAX_PACKET_BYTES
    read = [decode(VisionPacket, data).detection for data in packets]
    assert sum(len(part.yellow) for part in read) == sum(len(part.blue) for part in read) == 16
    assert sum(len(part.balls) for part in read) == 1
    for realism in REALISMS.values():
        geometry = vision(realism).geometry_packets(Flight())
        assert max(map(len, geometry)) <= MAX_PACKET_BYTES
        cameras = [camera.camera_id for data in geometry for camera in decode(VisionPacket, data).geometry.cameras]
        assert cameras == list(range(realism.camera_columns * realism.camera_rows))


def test_a_realism_is_changed_by_what_a_message_sets():
    changed = changed_realism(Realism(), ErForceRealism(ball_std_m=0.002, vision_delay_ns=35_000_000))
    assert changed == Realism(ball_std_m=0.002, vision_delay_s=0.035)
    assert changed_realism(Realism(), ErForceRealism(enable_invisible_ball=True)).hides_ball
    for bad in (ErForceRealism(ball_std_m=-1.0), ErForceRealism(vision_delay_ns=10**18)):
        with pytest.raises(ArgumentError, match="must be from 0 to"):
            changed_realism(Realism(), bad)
    with pytest.raises(ArgumentError, match="no realism 'odd', only none, rc2021"):
        realism_named("odd")
    assert math.isclose(realism_named("rc2021").vision_delay_s, 0.035)
