"""An image topic as a source: messages in, frames out, without ROS; what the user gets wrong."""

import importlib.util

import numpy as np
import pytest

from field_models.errors import ArgumentError, FrameError, RobocupVisionError
from robocup_vision.geometry import Pose2
from robocup_vision.live.sources.opening import open_source
from robocup_vision.live.sources.ros_topic import TopicSource, open_topic
from robocup_vision.live.sources.source import SourceOptions
from robocup_vision.messages.images import image_message
from robocup_vision.messages.topics import pose_message
from robocup_vision.messages.types import header, make

OPTIONS = SourceOptions(field="ssl_2001")
FRAME = np.arange(20 * 30 * 3, dtype=np.uint8).reshape(20, 30, 3)


class Listener:
    """Hands messages over as rclpy would."""

    def __init__(self, topics, on_problem):
        self.topics, self.tell, self.closed = topics, on_problem, False

    def send(self, topic, message, now_s=0.0):
        """Hand a message over."""
        self.topics[topic][1](message, now_s)

    def close(self):
        """Note it."""
        self.closed = True


@pytest.fixture
def opened():
    """Return a source and what it listens by."""
    made = []

    def listen(topics, on_problem):
        made.append(Listener(topics, on_problem))
        return made[0]

    source = TopicSource("/image", "/odom", OPTIONS, listen)
    yield source, made[0]
    source.close()


def odometry(x_m):
    pose, unknown = pose_message(Pose2(x_m, 0.0, 0.0)), np.zeros(36)
    still = ((0.0,) * 3, (0.0,) * 3)
    return make("nav_msgs/msg/Odometry", header(0.0, "odom"), "base", (pose, unknown), (still, unknown))


def test_the_newest_image_is_read_once_with_the_motion_since_the_last_one(opened):
    source, ros = opened
    ros.send("/odom", odometry(1.0))
    ros.send("/image", image_message(FRAME, 100.0, "camera"))
    [first] = source.read(1.0)
    assert first.t_s == 0.0
    np.testing.assert_array_equal(first.frame, FRAME)
    assert source.read(0.0) == ()
    ros.send("/odom", odometry(1.5))
    ros.send("/image", image_message(FRAME, 100.1, "camera"))
    ros.send("/odom", odometry(2.0))
    ros.send("/image", image_message(255 - FRAME, 100.2, "camera"))
    [newest] = source.read(1.0)
    np.testing.assert_array_equal(newest.frame, 255 - FRAME)
    assert newest.t_s == pytest.approx(0.2)
    assert newest.odometry == Pose2(1.0, 0.0, 0.0)


def test_a_stamp_that_is_zero_is_the_clocks(opened):
    source, ros = opened
    ros.send("/image", image_message(FRAME, 0.0, "camera"), now_s=50.0)
    source.read(1.0)
    ros.send("/image", image_message(FRAME, 0.0, "camera"), now_s=50.5)
    assert source.read(1.0)[0].t_s == pytest.approx(0.5)


def test_a_bag_that_begins_anew_goes_on_in_time_and_forgets_what_was(opened):
    source, ros = opened
    for stamp_s in (100.0, 130.0):
        ros.send("/odom", odometry(stamp_s))
        ros.send("/image", image_message(FRAME, stamp_s, "camera"))
        source.read(1.0)
    ros.send("/odom", odometry(100.0))
    ros.send("/image", image_message(FRAME, 100.0, "camera"))
    [again] = source.read(1.0)
    assert again.alone
    assert again.t_s == pytest.approx(30.0)
    assert again.odometry == Pose2(0.0, 0.0, 0.0)
    ros.send("/image", image_message(FRAME, 100.5, "camera"))
    [next_one] = source.read(1.0)
    assert not next_one.alone
    assert next_one.t_s == pytest.approx(30.5)


def test_odometry_that_is_not_finite_is_left_out(opened):
    source, ros = opened
    for x_m in (1.0, np.nan):
        ros.send("/odom", odometry(x_m))
    ros.send("/image", image_message(FRAME, 1.0, "camera"))
    source.read(1.0)
    ros.send("/odom", odometry(1.2))
    ros.send("/image", image_message(FRAME, 1.1, "camera"))
    assert source.read(1.0)[0].odometry.x_m == pytest.approx(0.2)


def test_an_image_of_an_encoding_that_is_not_known_is_refused_and_the_next_is_read(opened):
    source, ros = opened
    message = image_message(FRAME, 1.0, "camera")
    message.encoding = "32FC1"
    ros.send("/image", message)
    with pytest.raises(FrameError, match="32FC1"):
        source.read(1.0)
    ros.send("/image", image_message(FRAME, 1.1, "camera"))
    assert len(source.read(1.0)) == 1


def test_a_topic_that_is_silent_or_of_another_type_is_said_until_images_come(opened):
    source, ros = opened
    assert source.problem == "no image has come yet"
    ros.tell("/image", "topic /image: is of type std_msgs/msg/String")
    assert "std_msgs/msg/String" in source.problem
    ros.send("/image", image_message(FRAME, 1.0, "camera"))
    assert source.problem == ""
    ros.tell("/odom", "topic /odom: nobody publishes it")
    assert "nobody publishes" in source.problem


def test_a_source_that_was_closed_has_ended_and_listens_no_more(opened):
    source, ros = opened
    source.close()
    assert source.read(1.0) is None
    assert ros.closed


@pytest.mark.parametrize(
    ("text", "message"),
    [("", "names no topic"), ("/image,speed=3", "'speed=3' is no option"), ("/i,odometry=", "odometry=")],
)
def test_a_wrong_text_is_told(text, message):
    with pytest.raises(ArgumentError, match=message):
        open_topic(text, OPTIONS)


@pytest.mark.skipif(importlib.util.find_spec("rclpy") is not None, reason="rclpy is installed")
def test_without_rclpy_the_user_is_told_how_to_get_it():
    with pytest.raises(RobocupVisionError, match="needs rclpy"):
        open_source("ros:/image", OPTIONS)
