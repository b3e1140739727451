"""Plays a robot over ROS 2: sends images and odometry of a simulated one, and obeys cmd_vel, step by step.

Run as a program: ``simulated_robot.py GOALS_JSON OUT_JSON``. It drives to each goal in turn (x, y, field frame), and
writes where it truly was. Each step waits for the command of its own image, so that the machine's load does not matter.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import rclpy
from geometry_msgs.msg import PoseStamped, TwistStamped
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image

from field_models import load_field
from robocup_vision.geometry import Pose2
from robocup_vision.messages.topics import Topics, pose_message
from robocup_vision.messages.types import encode, header, make
from sim2d.match.arena import Arena
from sim2d.robot_link import Command

_REACHED_M = 0.01
_MAX_STEPS = 1500
_PATIENCE_S = 2.0


def drive(goals: list[tuple[float, float]], start: Pose2) -> dict[str, Any]:
    """Drive to each goal; return the true path, and how many steps had no command."""
    arena = Arena(load_field("ssl_2001"), 1, seed=1)
    arena.world.place(0, start)
    # out of the way
    arena.world.place(1, Pose2(1.2, -0.6, 3.0))
    node = rclpy.create_node("simulated_robot")
    quality = QoSProfile(depth=10)
    images = node.create_publisher(Image, "camera/image", quality)
    odometry = node.create_publisher(Odometry, "odometry", quality)
    to_goal = node.create_publisher(PoseStamped, "goal_pose", quality)
    commands: dict[int, TwistStamped] = {}

    def on_command(message: TwistStamped) -> None:
        commands[message.header.stamp.sec * 10**9 + message.header.stamp.nanosec] = message

    node.create_subscription(TwistStamped, "cmd_vel", on_command, quality)
    teller = Topics(arena.field, arena.camera)
    path, reached, missed, wanted = [], [], 0, list(goals)
    _wait(node, lambda: images.get_subscription_count() and to_goal.get_subscription_count())
    for _ in range(_MAX_STEPS):
        truth = arena.state.robots[0].pose
        path.append((truth.x_m, truth.y_m))
        if wanted and Pose2(*wanted[0], 0.0).error_to(truth)[0] < _REACHED_M:
            reached.append(wanted.pop(0))
        if not wanted:
            break
        t_s = arena.state.t_s + 1.0
        goal = make("geometry_msgs/msg/PoseStamped", header(t_s, "map"), pose_message(Pose2(*wanted[0], 0.0)))
        to_goal.publish(encode(goal))
        senses = arena.senses()[0]
        for outgoing in teller.of_odometry(senses.odometry, t_s):
            odometry.publish(encode(outgoing.message))
        assert senses.frame is not None
        frames = teller.of_frame(senses.frame, t_s)
        images.publish(encode(frames[0].message))
        stamp = round(t_s * 1e9)
        _wait(node, lambda stamp=stamp: stamp in commands)
        command = commands.pop(stamp, None)
        missed += command is None
        velocity = (0.0, 0.0) if command is None else (command.twist.linear.x, command.twist.linear.y)
        arena.step({0: Command(*velocity), 1: Command()})
    node.destroy_node()
    return {"path": path, "reached": reached, "steps_without_a_command": missed}


def _wait(node: Any, is_done: Any) -> None:
    until_s = time.monotonic() + _PATIENCE_S
    while not is_done() and time.monotonic() < until_s:
        rclpy.spin_once(node, timeout_sec=0.05)


if __name__ == "__main__":
    rclpy.init()
    goals = [(float(x), float(y)) for x, y in json.loads(sys.argv[1])]
    result = drive(goals[1:], Pose2(*goals[0], 0.0))
    Path(sys.argv[2]).write_text(json.dumps(result), encoding="utf-8")
    rclpy.try_shutdown()
