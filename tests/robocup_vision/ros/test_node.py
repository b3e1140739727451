"""The ROS 2 node on plain messages: what goes in, what comes out, and what the diagnostics say."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_runs import FRAMES, make_vision, run_frames

from field_models.errors import ArgumentError, FileError
from robocup_vision.camera.files import save_camera
from robocup_vision.commands import ros as ros_command
from robocup_vision.geometry import Pose2
from robocup_vision.messages.camera_infos import camera_info
from robocup_vision.messages.images import image_message
from robocup_vision.messages.topics import Topics, covariance_6x6, pose_message, pose_of
from robocup_vision.messages.types import header, make
from robocup_vision.ros.node import VisionNode
from robocup_vision.ros.settings import NodeSettings


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("camera") / "camera.toml"
    save_camera(make_vision().camera, path)
    return str(path)


@pytest.fixture
def node(camera: str) -> VisionNode:
    return VisionNode(NodeSettings("ssl_2001", camera))


def _drive(node: VisionNode, count: int = FRAMES) -> dict[str, Any]:
    """Hand the node frames with odometry; return the last messages by topic."""
    sent: dict[str, Any] = {}
    teller = Topics(node.vision.field, node.vision.camera)
    for now in run_frames()[:count]:
        [odometry] = teller.of_odometry(now.odometry, now.t_s)
        assert node.on_odometry(odometry.message, now.t_s) == []
        for outgoing in node.on_image(image_message(now.frame, now.t_s, "camera"), now.t_s):
            sent[outgoing.topic] = outgoing.message
    return sent


def _status(node: VisionNode, now_s: float) -> Any:
    [outgoing] = node.diagnostics(now_s)
    assert outgoing.topic == "/diagnostics"
    return outgoing.message.status[0]


def test_the_pose_is_the_robots_and_map_to_odom_leads_to_it(node: VisionNode) -> None:
    sent = _drive(node)
    truth = run_frames()[-1].truth
    assert pose_of(sent["/pose_with_covariance"].pose.pose).error_to(truth, symmetric=True)[0] < 0.01
    [transform] = sent["/tf"].transforms
    assert (transform.header.frame_id, transform.child_frame_id) == ("map", "odom")
    q = transform.transform.rotation
    to_odom = Pose2(transform.transform.translation.x, transform.transform.translation.y, 2 * math.atan2(q.z, q.w))
    odometry = Pose2(0.0, 0.0, 0.0)
    for now in run_frames():
        odometry = odometry.compose(now.odometry)
    believed = pose_of(sent["/pose_with_covariance"].pose.pose)
    assert to_odom.compose(odometry).error_to(believed) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert {"/scan", "/balls", "/obstacles", "/field_boundary", "/tracks", "/map"} <= sent.keys()
    assert "/cmd_vel" not in sent
    assert "/camera/image" not in sent
    status = _status(node, run_frames()[-1].t_s)
    assert status.level == 0
    assert status.message == f"{FRAMES} of {FRAMES} frames located"


def test_without_memory_the_odometry_makes_the_prior(camera: str) -> None:
    node = VisionNode(NodeSettings("ssl_2001", camera, memory=False, publish_tf=False))
    sent = _drive(node, 4)
    assert "/tf" not in sent
    assert "/tracks" not in sent
    assert pose_of(sent["/pose_with_covariance"].pose.pose).error_to(run_frames()[3].truth, symmetric=True)[0] < 0.02


def test_an_initial_pose_is_what_the_next_frame_is_looked_at_with(node: VisionNode) -> None:
    _drive(node, 3)
    now = run_frames()[0]
    covariance = covariance_6x6(np.diag([0.01, 0.01, 0.01]))
    pose = (pose_message(now.truth), covariance)
    node.on_initial_pose(make("geometry_msgs/msg/PoseWithCovarianceStamped", header(0.0, "map"), pose), 0.0)
    memory = node.vision.memory
    assert memory is not None
    assert memory.poses.is_fresh
    assert memory.poses.expected is not None
    assert memory.poses.expected.error_to(now.truth) == pytest.approx((0.0, 0.0), abs=1e-12)
    late_s = run_frames()[3].t_s
    sent = {o.topic: o.message for o in node.on_image(image_message(now.frame, late_s, "camera"), late_s)}
    assert pose_of(sent["/pose_with_covariance"].pose.pose).error_to(now.truth)[0] < 0.02


def test_a_pose_in_another_frame_or_not_finite_is_left_out(node: VisionNode) -> None:
    goal = make("geometry_msgs/msg/PoseStamped", header(0.0, "odom"), pose_message(Pose2(0.0, 0.0, 0.0)))
    node.on_goal(goal, 0.0)
    assert "goal_pose is in frame 'odom', must be in 'map'" in _status(node, 0.0).message
    goal = make("geometry_msgs/msg/PoseStamped", header(0.0, "map"), pose_message(Pose2(math.nan, 0.0, 0.0)))
    node.on_goal(goal, 0.0)
    assert "goal_pose: the position is not finite" in _status(node, 0.0).message
    for frame, x, problem in (
        ("odom", 0.0, "initialpose is in frame"),
        ("map", math.inf, "initialpose: the position is not finite"),
    ):
        pose = (pose_message(Pose2(x, 0.0, 0.0)), np.zeros(36))
        node.on_initial_pose(make("geometry_msgs/msg/PoseWithCovarianceStamped", header(0.0, frame), pose), 0.0)
        assert problem in _status(node, 0.0).message


def test_commands_lead_to_the_goal_and_stop_without_a_pose(camera: str) -> None:
    node = VisionNode(NodeSettings("ssl_2001", camera, cmd_vel=True))
    assert "/cmd_vel" not in _drive(node, 2)
    truth = run_frames()[2].truth
    ahead = truth.compose(Pose2(0.5, 0.0, 0.0))
    node.on_goal(make("geometry_msgs/msg/PoseStamped", header(0.0, "map"), pose_message(ahead)), 0.0)
    now = run_frames()[2]
    sent = {o.topic: o.message for o in node.on_image(image_message(now.frame, now.t_s, "c"), now.t_s)}
    assert sent["/cmd_vel"].twist.linear.x > 0.0
    dark = VisionNode(NodeSettings("ssl_2001", camera, cmd_vel=True))
    dark.on_goal(make("geometry_msgs/msg/PoseStamped", header(0.0, ""), pose_message(ahead)), 0.0)
    sent = {o.topic: o.message for o in dark.on_image(image_message(now.frame * 0, 1.0, "c"), 1.0)}
    assert (sent["/cmd_vel"].twist.linear.x, sent["/cmd_vel"].twist.linear.y) == (0.0, 0.0)


def test_a_frame_that_cannot_be_used_is_said_and_the_next_one_is_used(node: VisionNode) -> None:
    now = run_frames()[0]
    message = image_message(now.frame, now.t_s, "camera")
    message.encoding = "mono8"
    assert node.on_image(message, 0.0) == []
    assert _status(node, 0.0).level == 2
    assert "encoding 'mono8' cannot be read" in _status(node, 0.0).message
    assert node.on_image(image_message(now.frame[::2, ::2], now.t_s, "camera"), 0.0) == []
    assert "frame must be uint8 (220, 256, 3)" in _status(node, 0.0).message
    assert node.on_image(image_message(now.frame, now.t_s, "camera", "png"), 0.0)
    assert _status(node, 0.0).level == 0


def test_what_is_wrong_is_logged_once_and_stays_in_the_diagnostics(node: VisionNode) -> None:
    now = run_frames()[0]
    message = image_message(now.frame, now.t_s, "camera")
    for encoding in ("mono8", "mono16", "mono8"):
        message.encoding = encoding
        node.on_image(message, now.t_s)
    [news] = node.take_news()
    assert "image encoding 'mono8' cannot be read" in news
    assert node.take_news() == []
    for _ in range(2):
        assert "image encoding 'mono8' cannot be read" in _status(node, now.t_s).message


def test_warnings_of_a_view_reach_the_diagnostics_and_the_log_once(node: VisionNode) -> None:
    teller = Topics(node.vision.field, node.vision.camera)
    news = []
    for number, now in enumerate(run_frames()[:4]):
        # 5 m in a frame, there and back
        jump = Pose2(5.0 * (number % 2), 0.0, 0.0)
        node.on_odometry(teller.of_odometry(jump, now.t_s)[0].message, now.t_s)
        node.on_image(image_message(now.frame, now.t_s, "camera"), now.t_s)
        news += node.take_news()
    [said] = [text for text in news if "is not believed" in text]
    assert said.startswith("odometry of 5 m")
    status = _status(node, run_frames()[3].t_s)
    assert status.level == 1
    assert "is not believed: no robot moves so fast" in status.message
    assert "is not believed" not in _status(node, run_frames()[3].t_s).message


def test_what_may_be_published_follows_the_settings(node: VisionNode, camera: str) -> None:
    assert set(_drive(node)) <= node.published.keys()
    assert {"/tf", "/tf_static", "/diagnostics", "/balls", "/tracks"} <= node.published.keys()
    assert not {"/cmd_vel", "/camera/image", "/odometry", "/truth/pose"} & node.published.keys()
    settings = NodeSettings("ssl_2001", camera, memory=False, publish_tf=False, cmd_vel=True, prefix="/robot1")
    published = VisionNode(settings).published
    assert "/robot1/cmd_vel" in published
    assert {"/tf_static", "/diagnostics"} <= published.keys()
    assert not {"/tf", "/robot1/tracks", "/robot1/map"} & published.keys()


def test_silence_is_said(node: VisionNode) -> None:
    assert "no image has come on camera/image yet" in _status(node, 0.0).message
    _drive(node, 1)
    assert "no image for 2.5 s" in _status(node, run_frames()[0].t_s + 2.5).message
    [outgoing] = node.diagnostics(0.0, ("tf2_msgs/msg/TFMessage is not installed",))
    assert "tf2_msgs/msg/TFMessage is not installed" in [pair.value for pair in outgoing.message.status[0].values]


def test_another_cameras_info_is_said(node: VisionNode) -> None:
    info = camera_info(node.vision.camera, 0.0, "camera")
    node.on_camera_info(info, 0.0)
    assert "camera_info" not in _status(node, 0.0).message
    info.width = 640
    node.on_camera_info(info, 0.0)
    assert "camera_info says 640x220, the camera file 256x220" in _status(node, 0.0).message


def test_time_that_goes_back_begins_anew(node: VisionNode) -> None:
    _drive(node)
    teller = Topics(node.vision.field, node.vision.camera)
    late = run_frames()[-1].t_s
    node.on_odometry(teller.of_odometry(Pose2(0.0, 0.0, 0.0), late + 5.0)[0].message, late + 5.0)
    sent = _drive(node, 3)
    assert pose_of(sent["/pose_with_covariance"].pose.pose).error_to(run_frames()[2].truth, symmetric=True)[0] < 0.02
    assert "time went back" in _status(node, 0.0).message


def test_odometry_that_is_not_finite_is_left_out(node: VisionNode) -> None:
    message = Topics(node.vision.field, node.vision.camera).of_odometry(Pose2(0.0, 0.0, 0.0), 0.0)[0].message
    message.pose.pose.position.x = math.nan
    node.on_odometry(message, 0.0)
    assert "odometry: the position is not finite" in _status(node, 0.0).message


def test_a_robot_may_be_known_to_begin_in_its_own_half(camera: str) -> None:
    node = VisionNode(NodeSettings("ssl_2001", camera, half="own"))
    assert node.vision.memory is not None
    assert node.vision.memory.poses.half == "own"


def test_options_are_the_settings() -> None:
    parser = argparse.ArgumentParser()
    ros_command.add_parser(parser.add_subparsers())
    options = parser.parse_args(["ros"])
    assert NodeSettings(**{name: getattr(options, name) for name in NodeSettings.names()}) == NodeSettings()
    options = parser.parse_args(["ros", "--no-memory", "--field", "f", "--ros-args", "-p", "camera:=c"])
    assert (options.memory, options.field, options.ros_args) == (False, "f", ["-p", "camera:=c"])


def test_settings_that_are_missing_or_out_of_range_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="needs --camera"):
        VisionNode(NodeSettings("ssl_2001"))
    with pytest.raises(FileError, match=r"none\.toml: cannot be read"):
        VisionNode(NodeSettings("ssl_2001", str(tmp_path / "none.toml")))
    with pytest.raises(ArgumentError, match="robot_radius_m"):
        NodeSettings(robot_radius_m=-1.0)
    with pytest.raises(ArgumentError, match="half must be 'own' or empty, got 'left'"):
        NodeSettings(half="left")
    with pytest.raises(ArgumentError, match="half is for the memory, which is off"):
        NodeSettings(half="own", memory=False)
    with pytest.raises(ArgumentError, match="image_topic"):
        NodeSettings(image_topic="")
