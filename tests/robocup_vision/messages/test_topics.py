"""What a look tells as messages: REP-103 covariances, REP-105 frames, maps whose rows run along x."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from recorded_runs import FIELD, make_steering, make_vision, run_frames

from field_models import Mark, load_field
from robocup_vision.belief import MapPicture
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.messages.camera_infos import camera_info
from robocup_vision.messages.topics import (
    TOPIC_TYPES,
    FrameNames,
    Outgoing,
    Topics,
    TopicSettings,
    camera_transform,
    covariance_3x3,
    covariance_6x6,
    occupancy_grid,
    pose_message,
    pose_of,
    sphere_outline,
)
from robocup_vision.messages.types import decode, encode, to_seconds
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.markings.marking import Circle, Crossing, LineSegment, Markings, PenaltyMark, Post


def _by_topic(made: Iterable[Outgoing]) -> dict[str, Any]:
    messages = list(made)
    for outgoing in messages:
        # every one can be sent, and is of the type that is announced
        assert outgoing.message.__msgtype__ == TOPIC_TYPES[outgoing.topic.removeprefix("/robot1")]
        decode(encode(outgoing.message), outgoing.message.__msgtype__)
    return {outgoing.topic: outgoing.message for outgoing in messages}


@given(st.floats(-20, 20), st.floats(-20, 20), st.floats(-math.pi, math.pi))
def test_a_pose_comes_back(x: float, y: float, theta: float) -> None:
    pose = Pose2(x, y, theta)
    off_m, off_rad = pose_of(pose_message(pose)).error_to(pose)
    assert off_m == 0.0
    assert off_rad < 1e-12


def test_a_covariance_stands_in_x_y_and_about_z() -> None:
    covariance = np.array([[1.0, 0.1, 0.2], [0.1, 2.0, 0.3], [0.2, 0.3, 3.0]])
    full = covariance_6x6(covariance)
    assert full[0] == 1.0
    assert full[7] == 2.0
    assert full[35] == 3.0
    assert full[5] == full[30] == 0.2
    assert np.array_equal(covariance_3x3(full), covariance)
    assert np.linalg.eigvalsh(full.reshape(6, 6)).min() > 0


def test_a_map_has_rows_along_x() -> None:
    state = np.zeros((3, 3), dtype=np.uint8)
    state[2, 0], state[0, 1] = 1, 2
    message = occupancy_grid(MapPicture(state, (-1.0, 0.5), 0.04), 2.0, "map")
    # index = x + width * y
    assert message.data.tolist() == [0, 0, 100, -1, 0, 0, 0, 0, 0]
    assert (message.info.origin.position.x, message.info.origin.position.y) == (-1.0, 0.5)


def test_map_to_odom_to_robot_is_the_believed_pose() -> None:
    topics, vision = Topics(FIELD, make_vision().camera), make_vision()
    odometry = Pose2(0.0, 0.0, 0.0)
    for now in run_frames():
        view = vision.look(now.frame, now.t_s, now.odometry)
        odometry = odometry.compose(now.odometry)
        topics.of_odometry(now.odometry, now.t_s)
        sent = _by_topic(topics.of_look(view, now.t_s))
    assert view.belief is not None
    assert view.belief.pose
    transforms = {t.child_frame_id: t for t in sent["/tf"].transforms}
    assert transforms["odom"].header.frame_id == "map"
    assert transforms["base_footprint"].header.frame_id == "odom"
    to_odom, to_robot = (
        Pose2(t.translation.x, t.translation.y, 2 * math.atan2(t.rotation.z, t.rotation.w))
        for t in (transforms["odom"].transform, transforms["base_footprint"].transform)
    )
    assert to_robot.error_to(odometry)[0] < 1e-12
    assert to_odom.compose(to_robot).error_to(view.belief.pose.pose) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert to_seconds(transforms["odom"].header.stamp) == pytest.approx(now.t_s, abs=1e-9)


def test_a_scan_has_the_free_ranges() -> None:
    now, vision = run_frames()[0], make_vision()
    view = vision.look(now.frame, now.t_s)
    scan = _by_topic(Topics(FIELD, vision.camera).of_look(view, now.t_s))["/scan"]
    bearing = scan.angle_min + scan.angle_increment * np.arange(len(scan.ranges))
    assert bearing == pytest.approx(view.free_space.bearing_rad, abs=1e-9)
    reached = np.isinf(scan.ranges)
    assert scan.ranges[~reached] == pytest.approx(view.free_space.range_m[~reached], abs=1e-6)
    assert (view.free_space.range_m[reached] >= scan.range_max - 1e-6).all()


def test_what_is_not_seen_is_an_empty_array_and_an_unknown_pose_is_not_sent() -> None:
    vision = make_vision()
    dark = np.zeros_like(run_frames()[0].frame)
    view = vision.look(dark, 0.5)
    assert isinstance(view.pose, NotLocated)
    sent = _by_topic(Topics(FIELD, vision.camera).of_look(view, 0.5))
    assert sent["/balls"].balls == []
    assert sent["/field_boundary"].points == []
    assert to_seconds(sent["/obstacles"].header.stamp) == 0.5
    assert "/pose_with_covariance" not in sent
    assert [t.child_frame_id for t in sent["/tf"].transforms] == ["base_footprint"]


def test_what_the_image_shows_is_told_in_pixels() -> None:
    now, vision = run_frames()[0], make_vision()
    u_px, v_px = vision.camera.point_to_pixel([0.8, 0.1, FIELD.ball_radius_m]).tolist()
    view = replace(vision.look(now.frame, now.t_s), balls=(Ball(0.8, 0.1, np.eye(2) * 1e-4, u_px, v_px),))
    sent = _by_topic(Topics(FIELD, vision.camera).of_look(view, now.t_s))
    message = sent["/balls_in_image"]
    assert message.header.frame_id == "camera_optical_frame"
    assert [(one.center.x, one.center.y) for one in message.balls] == [(ball.u_px, ball.v_px) for ball in view.balls]
    for one in message.balls:
        middle = one.bb.center.position
        assert abs(middle.x - one.center.x) < 1.0
        assert abs(middle.y - one.center.y) < 1.0
        assert 1.0 < one.bb.size_x < 10.0
        assert 1.0 < one.bb.size_y < 10.0
    edge = sent["/field_boundary_in_image"]
    on_floor = sent["/field_boundary"]
    there = view.camera.pixel_to_floor(np.array([(point.x, point.y) for point in edge.points]))
    assert there == pytest.approx(np.array([(point.x, point.y) for point in on_floor.points]), abs=1e-9)


@pytest.mark.parametrize(
    "camera", [make_vision().camera, PinholeCamera((64, 48), (60, 60), (32, 24), 0.5, tilt_rad=-0.3)]
)
def test_a_spheres_outline_is_where_its_surface_turns_away(camera: Any) -> None:
    center, radius = np.array([0.8, 0.1, 0.02]), 0.05
    outline = sphere_outline(tuple(center), radius, camera)
    assert np.linalg.norm(outline - center, axis=1) == pytest.approx(radius)
    # a ray to it touches the sphere
    assert np.sum((outline - center) * (outline - camera.viewpoint_m), axis=1) == pytest.approx(0.0, abs=1e-12)


def test_a_command_is_a_stamped_twist() -> None:
    now, vision = run_frames()[0], make_vision()
    view = vision.look(now.frame, now.t_s)
    command = make_steering().steer(view.free_space, (0.0, 0.0), 0.3)
    topics = Topics(FIELD, vision.camera, TopicSettings(prefix="/robot1"))
    sent = _by_topic(topics.of_command(command, 1.0))["/robot1/cmd_vel"]
    assert (sent.twist.linear.x, sent.twist.linear.y) == tuple(command.velocity_mps)
    sent = _by_topic(topics.of_command((0.1, 0.2, 0.3), 1.0))["/robot1/cmd_vel"]
    assert sent.twist.angular.z == 0.3


PINHOLE = PinholeCamera((320, 240), (300.0, 301.0), (160.0, 119.0), 0.5, (0.1, 0.2, 0.01, 0.02), tilt_rad=-0.3)


def test_camera_info_of_both_cameras() -> None:
    info = camera_info(PINHOLE, 1.0, "camera")
    assert info.k.tolist() == [300.0, 0.0, 160.0, 0.0, 301.0, 119.0, 0.0, 0.0, 1.0]
    assert info.d.tolist() == [0.1, 0.2, 0.01, 0.02, 0.0]
    assert info.distortion_model == "plumb_bob"
    info = camera_info(make_vision().camera, 1.0, "camera")
    assert (info.distortion_model, info.d.size, info.width, info.height) == ("", 0, 256, 220)


def test_the_optical_frame_of_a_pinhole_camera_looks_along_z() -> None:
    transform = camera_transform(PINHOLE, FrameNames(), 1.0).transform
    x, y, z, w = (getattr(transform.rotation, key) for key in "xyzw")
    assert x * x + y * y + z * z + w * w == pytest.approx(1.0)
    # columns of the rotation: image right, image down, forward
    right = (1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w))
    forward = (2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y))
    assert right == pytest.approx((0.0, -1.0, 0.0), abs=1e-9)
    assert forward == pytest.approx((math.cos(0.3), 0.0, -math.sin(0.3)), abs=1e-9)
    assert camera_transform(PINHOLE.with_orientation(None, None, None), FrameNames(), 1.0) is None


def test_markings_are_told_where_they_are_wanted() -> None:
    view = make_vision().look(run_frames()[0].frame, 0.5)
    field = replace(load_field("spl_2020"), marks=(Mark(3.2, 0.0, "cross", 0.1),))
    markings = Markings(
        (LineSegment((1.0, -1.0), (1.0, 2.0), 0.0, 1.0, np.eye(2)),),
        (Crossing(1.0, 2.0, np.eye(2), "L", (0.0, -math.pi / 2)),),
        (Circle(0.5, 0.1, np.eye(2), 0.75),),
        (Post(2.0, 0.3, np.eye(2), (4.5, 0.8)), Post(2.0, 0.3, np.eye(2), (-4.5, 0.8)), Post(1.0, 0.0, np.eye(2))),
        (PenaltyMark(1.5, -0.2, np.eye(2)),),
    )
    shown = replace(view)
    vars(shown)["markings"] = markings
    told = _by_topic(Topics(field, view.camera, TopicSettings(markings=True)).of_look(shown, 1.0))
    array = told["/markings"]
    assert array.header.frame_id == "base_footprint"
    (segment,), (crossing,), (circle, mark) = array.segments, array.intersections, array.ellipses
    assert (segment.start.y, segment.end.y) == (-1.0, 2.0)
    assert (crossing.center.x, crossing.num_rays) == (1.0, 2)
    assert [(round(ray.x, 9), round(ray.y, 9)) for ray in crossing.rays] == [(1.0, 0.0), (0.0, -1.0)]
    assert (circle.diameter, circle.center.position.x) == (1.5, 0.5)
    assert (mark.diameter, mark.center.position.x) == (0.1, 1.5)
    posts = told["/goalposts"]
    assert [(post.attributes.side, post.attributes.team) for post in posts.posts] == [(1, 2), (2, 1), (0, 0)]
    assert posts.posts[0].bb.size.z == field.goals[0].height_m
    assert "/markings" not in _by_topic(Topics(field, view.camera).of_look(shown, 1.0))
