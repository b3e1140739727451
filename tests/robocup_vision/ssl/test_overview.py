"""What several cameras see is merged: each robot and each ball once."""

import dataclasses
import math

import pytest

from robocup_vision.ssl.log import SslLog
from robocup_vision.ssl.overview import CameraMerge, merge_frames
from robocup_vision.ssl.values.detection import DetectionBall, DetectionFrame, DetectionRobot, VisionPacket
from robocup_vision.ssl.values.geometry import CameraCalibration, FieldSize, Geometry


def frame(camera, t_s=1.0, number=5, **things):
    return DetectionFrame(number, t_s, t_s, camera, **things)


def robot(number, x_m, y_m=0.0, angle=0.0, confidence=1.0):
    return DetectionRobot(confidence, number, x_m, y_m, angle)


def test_a_robot_at_the_seam_is_one_at_the_confident_mean():
    first = frame(0, yellow=(robot(3, 1.00, angle=math.pi - 0.01), robot(1, 2.0)), blue=(robot(3, -1.0),))
    second = frame(1, yellow=(robot(3, 1.03, angle=-math.pi + 0.02, confidence=0.5),))
    merged = merge_frames([first, second])
    assert [r.robot_id for r in merged.yellow] == [1, 3]
    assert merged.yellow[1].x_m == pytest.approx(1.01)
    assert math.cos(merged.yellow[1].orientation_rad) == pytest.approx(-1.0, abs=1e-4)
    assert [r.robot_id for r in merged.blue] == [3]
    assert merged.cameras == (0, 1)


def test_balls_of_two_cameras_are_one_and_others_stay():
    first = frame(0, balls=(DetectionBall(1.0, 0.0, 0.0), DetectionBall(0.4, 2.0, 1.0)))
    second = frame(1, balls=(DetectionBall(1.0, 0.02, 0.0),))
    merged = merge_frames([second, first])
    assert [(ball.x_m, ball.y_m) for ball in merged.balls] == [(pytest.approx(0.01), 0.0), (2.0, 1.0)]


def test_a_camera_that_fell_silent_is_left_out_and_one_without_numbers_is_kept():
    nameless = robot(None, 0.5)
    merged = merge_frames([frame(0, 1.0, yellow=(robot(1, 0.0),)), frame(1, 2.0, yellow=(nameless, nameless))])
    assert (merged.cameras, merged.yellow, merged.t_capture_s) == ((1,), (nameless, nameless), 2.0)
    assert merge_frames([]) is None


def test_an_old_frame_does_not_replace_a_newer_one_but_a_restarted_sender_does():
    merge = CameraMerge()
    merge.add(VisionPacket(frame(0, 5.0, 10, yellow=(robot(1, 1.0),))))
    merge.add(VisionPacket(frame(0, 4.9, 10, yellow=(robot(1, 2.0),))))
    assert merge.overview.yellow[0].x_m == 1.0
    merge.add(VisionPacket(frame(0, 0.1, 0, yellow=(robot(1, 3.0),))))
    assert merge.overview.yellow[0].x_m == 3.0
    merge.add(VisionPacket(frame(0, float("nan"), 11)))
    assert merge.overview.t_capture_s == 0.1


def test_calibrations_that_come_one_by_one_are_put_together():
    merge = CameraMerge()
    assert merge.geometry is None
    assert merge.overview is None
    size = FieldSize(9.0, 6.0, 1.0, 0.18, 0.3)
    camera = CameraCalibration(1, 390.0, 300.0, 300.0, 0.2, 0.7, 0.7, 0.7, 0.7, 0.0, 0.0, 3.5)
    merge.add(VisionPacket(geometry=Geometry(size, (camera,))))
    merge.add(VisionPacket(geometry=Geometry(size, (dataclasses.replace(camera, camera_id=0),))))
    assert [known.camera_id for known in merge.geometry.cameras] == [0, 1]


def test_a_foreign_simulators_packets_make_one_field(recordings):
    merge = CameraMerge()
    with SslLog(recordings / "erforce_vision.log.gz") as log:
        for entry in log:
            merge.add(entry.value)
            overview = merge.overview
            assert {robot.robot_id for robot in overview.yellow + overview.blue} <= set(range(11))
    assert merge.geometry.field.length_m == 9.0
    assert [robot.robot_id for robot in merge.overview.yellow] == list(range(11))


def seen_by(merge, camera, k, start_s, x_m, number=1):
    merge.add(VisionPacket(frame(camera, start_s + k / 60, k, yellow=(robot(number, x_m),))))


def test_a_number_seen_at_two_places_is_the_surer_one_and_said():
    first = frame(0, yellow=(robot(5, -1.5, confidence=0.95),))
    second = frame(1, yellow=(robot(5, 1.5, confidence=0.3), robot(6, 0.0)))
    merged = merge_frames([first, second])
    assert [(r.robot_id, r.x_m) for r in merged.yellow] == [(5, -1.5), (6, 0.0)]
    assert merged.problems == ("yellow 5 is seen at (-1.50, 0.00) and (1.50, 0.00) m: the surer one is taken",)


def test_no_number_that_is_none_passes():
    nan, inf = float("nan"), float("inf")
    bad = frame(
        0,
        balls=(DetectionBall(0.9, nan, 0.0), DetectionBall(0.9, 1.0, 0.0), DetectionBall(nan, 1.0, 0.0)),
        yellow=(robot(1, inf), robot(2, 0.0, angle=nan), robot(3, 1.0)),
        blue=(DetectionRobot(0.9, 4, 0.0, 0.0, None),),
    )
    merge = CameraMerge()
    merge.add(VisionPacket(bad))
    for merged in (merge.overview, merge_frames([bad, frame(1, nan)])):
        assert [ball.x_m for ball in merged.balls] == [1.0]
        assert [r.robot_id for r in merged.yellow + merged.blue] == [3, 4]
        assert len(merged.problems) == 4
        assert "robot 1 at x inf" in merged.problems[2]


def test_cameras_whose_clocks_are_apart_are_merged():
    merge = CameraMerge()
    for k in range(30):
        seen_by(merge, 0, k, 100.0, -1.0, 1)
        seen_by(merge, 1, k, 101.0, 1.0, 2)
        seen_by(merge, 2, k, 0.0, 2.0, 3)
    assert [r.robot_id for r in merge.overview.yellow] == [1, 2, 3]


@pytest.mark.parametrize("silent", [0, 1])
def test_a_silent_camera_drops_out_whatever_the_clocks_say(silent):
    merge = CameraMerge()
    for k in range(60):
        for camera in (0, 1):
            if camera != silent or k < 30:
                seen_by(merge, camera, k, 1000.0 * camera, float(camera), camera)
    assert merge.overview.cameras == (1 - silent,)


def test_freshness_is_by_the_time_of_reception_where_stamps_stand_still():
    merge = CameraMerge()
    merge.add(VisionPacket(frame(0, 0.0)), 10.0)
    merge.add(VisionPacket(frame(1, 0.0)), 10.03)
    assert merge.overview.cameras == (0, 1)
    merge.add(VisionPacket(frame(1, 0.0)), 10.06)
    assert merge.overview.cameras == (1,)


def test_a_simulator_started_anew_is_right_at_once():
    merge = CameraMerge()
    for k in range(5):
        for camera in range(4):
            seen_by(merge, camera, 1000 + k, 5000.0, 1.0, 1)
    seen_by(merge, 0, 0, 0.0, -1.0, 2)
    assert (merge.overview.cameras, merge.overview.yellow[0].robot_id) == ((0,), 2)
