"""Counts the images that reach a second process: ``image_listener.py OUT_JSON SECONDS``; says "ready" first."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import Image

if __name__ == "__main__":
    rclpy.init()
    node = rclpy.create_node("image_listener")
    seen: list[tuple[int, int, int]] = []

    def on_image(message: Image) -> None:
        """Note size and number (the stamp's nanoseconds) of an image, and a sum of its bytes."""
        seen.append((message.header.stamp.nanosec, message.width * message.height, sum(message.data[:3000:7])))

    node.create_subscription(Image, "camera/image", on_image, QoSProfile(depth=20))
    print("ready", flush=True)
    until_s = time.monotonic() + float(sys.argv[2])
    while time.monotonic() < until_s:
        rclpy.spin_once(node, timeout_sec=0.1)
        if seen and seen[-1][0] == 999:
            break
    Path(sys.argv[1]).write_text(json.dumps(seen), encoding="utf-8")
    node.destroy_node()
    rclpy.try_shutdown()
