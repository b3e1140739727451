"""How tf tells the node where a head holds its camera: looked up at the image's stamp."""

import math

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera, camera_rotation, save_camera
from robocup_vision.messages.images import image_message
from robocup_vision.messages.types import header, make
from robocup_vision.ros.node import VisionNode
from robocup_vision.ros.settings import NodeSettings
from robocup_vision.ros.transforms import HeadJoints, Transforms, mounting_of

# the optical frame (right, down, ahead) in the head's (ahead, left, up), as every ROS robot has it: w, x, y, z
OPTICAL = (0.5, -0.5, 0.5, -0.5)


def about(axis, angle):
    return (math.cos(angle / 2), *(math.sin(angle / 2) * np.array(axis)).tolist())


def tf(*steps):
    made = []
    for t_s, parent, child, place, (w, x, y, z) in steps:
        transform = (tuple(map(float, place)), tuple(map(float, (x, y, z, w))))
        made.append((header(t_s, parent), child, transform))
    return make("tf2_msgs/msg/TFMessage", made)


STATIC = tf(
    (0.0, "head", "optical", (0.05, 0.0, 0.1), OPTICAL), (0.0, "base_footprint", "neck", (0, 0, 0.35), (1, 0, 0, 0))
)


def nod(t_s, pan, tilt):
    """Return the neck's pan, and the head's tilt: a joint about the left axis that turns down is positive."""
    return tf(
        (t_s, "neck", "yaw", (0, 0, 0), about((0, 0, 1), pan)), (t_s, "yaw", "head", (0, 0, 0), about((0, 1, 0), -tilt))
    )


@pytest.mark.parametrize(("pan", "tilt"), [(0.0, 0.0), (0.4, -0.3), (-0.7, 0.2)])
def test_a_mounting_is_that_of_the_joints(pan, tilt):
    transforms = Transforms()
    transforms.add(STATIC, is_static=True)
    transforms.add(nod(1.0, pan, tilt), is_static=False)
    rotation, place = transforms.lookup("base_footprint", "optical", 1.0)
    told = mounting_of(rotation, place)
    assert (told.pan_rad, told.tilt_rad, told.roll_rad) == pytest.approx((pan, tilt, 0.0), abs=1e-12)
    assert told.height_m == pytest.approx(0.35 + 0.05 * math.sin(tilt) + 0.1 * math.cos(tilt))
    axes = camera_rotation(told.pan_rad, told.tilt_rad, told.roll_rad)
    # ahead of the camera is the optical frame's z, left of it -x
    np.testing.assert_allclose(axes[:, 0], rotation[:, 2], atol=1e-12)
    np.testing.assert_allclose(axes[:, 1], -rotation[:, 0], atol=1e-12)


def test_between_two_times_it_is_interpolated_and_beyond_them_unknown():
    transforms = Transforms()
    transforms.add(STATIC, is_static=True)
    # where the robot stands is not asked for
    transforms.add(tf((0.2, "odom", "base_footprint", (1, 2, 0), about((0, 0, 1), 0.3))), is_static=False)
    for t_s, tilt in ((1.0, -0.2), (1.1, -0.4), (3.0, 0.0)):
        transforms.add(nod(t_s, 0.1, tilt), is_static=False)
    assert mounting_of(*transforms.lookup("base_footprint", "optical", 1.025)).tilt_rad == pytest.approx(
        -0.25, abs=1e-3
    )
    for t_s in (0.9, 2.0, 3.1):
        assert transforms.lookup("base_footprint", "optical", t_s) is None
    assert transforms.lookup("base_footprint", "arm", 1.0) is None


def test_an_image_waits_for_its_transforms(tmp_path):
    camera = PinholeCamera(
        (64, 48), (60.0, 60.0), (31.5, 23.5), 0.45, offset_m=(0.05, 0.0), pan_rad=0.0, tilt_rad=-0.3, roll_rad=0.0
    )
    save_camera(camera, tmp_path / "camera.toml")
    node = VisionNode(NodeSettings("humanoid_kid_2025", str(tmp_path / "camera.toml"), use_tf=True, memory=False))
    frame = np.full((48, 64, 3), (50, 130, 45), dtype=np.uint8)
    assert node.on_tf_static(STATIC, 1.0) == []
    assert node.on_tf(nod(1.0, 0.0, -0.3), 1.0) == []
    assert node.on_image(image_message(frame, 1.02, "optical"), 1.02) == []
    sent = node.on_tf(nod(1.04, 0.0, -0.5), 1.04)
    assert sent
    # the camera is in the robot's own tree
    told = [
        transform for outgoing in sent if outgoing.topic.startswith("/tf") for transform in outgoing.message.transforms
    ]
    assert "camera_optical_frame" not in {transform.child_frame_id for transform in told}
    assert said(node, 1.04) == "0 of 1 frames located"
    node.on_image(image_message(frame, 1.1, "optical"), 1.1)
    node.on_image(image_message(frame, 1.2, "optical"), 1.2)
    assert "tf does not tell how the camera was held at 1.100 s: not looked at" in said(node, 1.2)


def said(node, now_s):
    [outgoing] = node.diagnostics(now_s)
    return outgoing.message.status[0].message


def joints(t_s, **positions):
    empty = np.empty(0)
    return make(
        "sensor_msgs/msg/JointState", header(t_s, ""), list(positions), np.array(list(positions.values())), empty, empty
    )


def head(tilt="-head_tilt"):
    at_zero = PinholeCamera((64, 48), (60.0, 60.0), (31.5, 23.5), 0.45, pan_rad=0.05, tilt_rad=-0.2, roll_rad=0.0)
    return HeadJoints("head_pan", tilt, at_zero)


def test_joints_add_to_the_camera_file_and_are_interpolated():
    told = head()
    told.add(joints(1.0, knee=3.0, head_pan=0.2, head_tilt=0.1), 1.0)
    told.add(joints(1.1, head_tilt=0.3, head_pan=0.4), 1.1)
    mounting = told.mounting_at(1.025)
    assert mounting.known == {"pan_rad": pytest.approx(0.05 + 0.25), "tilt_rad": pytest.approx(-0.2 - 0.15)}
    told = head("head_tilt")
    told.add(joints(1.0, head_pan=0.2, head_tilt=0.1), 1.0)
    assert told.mounting_at(1.0).tilt_rad == pytest.approx(-0.2 + 0.1)


def test_joints_that_do_not_tell_a_time_tell_nothing():
    told = head()
    told.add(joints(1.0, head_pan=0.2), 1.0)
    # the tilt has not come
    assert told.mounting_at(1.0) is None
    told.add(joints(1.0, head_tilt=math.nan), 1.0)
    assert told.mounting_at(1.0) is None
    told.add(joints(1.0, head_tilt=0.1), 1.0)
    assert told.mounting_at(1.0) is not None
    assert told.mounting_at(1.01) is None
    told.add(joints(3.0, head_pan=0.0, head_tilt=0.0), 3.0)
    assert told.mounting_at(2.0) is None


def test_an_image_waits_for_the_joints(tmp_path):
    at_zero = PinholeCamera((64, 48), (60.0, 60.0), (31.5, 23.5), 0.45, pan_rad=0.0, tilt_rad=0.0, roll_rad=0.0)
    save_camera(at_zero, tmp_path / "camera.toml")
    settings = NodeSettings("humanoid_kid_2025", str(tmp_path / "camera.toml"), tilt_joint="-neck", memory=False)
    node = VisionNode(settings)
    frame = np.full((48, 64, 3), (50, 130, 45), dtype=np.uint8)
    node.on_joint_states(joints(1.0, neck=0.3), 1.0)
    assert node.on_image(image_message(frame, 1.02, "optical"), 1.02) == []
    sent = node.on_joint_states(joints(1.04, neck=0.5), 1.04)
    told = {
        transform.child_frame_id: transform.transform.rotation
        for outgoing in sent
        if outgoing.topic == "/tf"
        for transform in outgoing.message.transforms
    }
    q = told["camera_optical_frame"]
    # the optical axis, the frame's z, in the robot's
    assert 2 * (q.x * q.z + q.w * q.y) == pytest.approx(math.cos(0.4))
    assert 1 - 2 * (q.x**2 + q.y**2) == pytest.approx(-math.sin(0.4))
    node.on_image(image_message(frame, 1.1, "optical"), 1.1)
    node.on_image(image_message(frame, 1.2, "optical"), 1.2)
    assert "joint_states does not tell how the camera was held at 1.100 s: not looked at" in said(node, 1.2)


def test_joints_are_for_cameras_that_look_ahead_and_instead_of_tf(tmp_path):
    with pytest.raises(ArgumentError, match="leave out pan_joint and tilt_joint"):
        NodeSettings(use_tf=True, pan_joint="head_pan")
    with pytest.raises(ArgumentError, match="are for cameras that look ahead"):
        VisionNode(NodeSettings("ssl_2001", "images/omni_ssl_2001/camera.toml", tilt_joint="head_tilt"))
