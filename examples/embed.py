"""A robot's control loop: each camera frame becomes a pose, free floor, the ball and a motion command.

The camera is played by the sample images; each stands alone, so no odometry is passed on. On a robot, hand `look` the
motion since the frame before as `odometry`, and the measured velocity to `steer`.
"""

import math
from pathlib import Path

import cv2
import numpy as np

from field_models import load_field
from robocup_vision import MotionLimits, Steering, Vision, draw, load_camera

DATASET = Path(__file__).parents[1] / "images" / "omni_ssl_2001"
OUT = Path("out")

vision = Vision(load_field("ssl_2001"), load_camera(DATASET / "camera.toml"))
steering = Steering(robot_radius_m=0.09, limits=MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03))
velocity_mps = np.zeros(2)
target_bearing_rad = 0.0

for path in sorted((DATASET / "images").glob("*.png")):
    frame = cv2.imread(str(path))
    assert frame is not None
    view = vision.look(frame)

    if view.ball is not None:
        target_bearing_rad = math.atan2(view.ball.y_m, view.ball.x_m)
    command = steering.steer(view.free_space, velocity_mps, target_bearing_rad)
    velocity_mps = command.velocity_mps  # a robot would measure it

    if view.pose:
        x_m, y_m, theta_rad = view.pose.pose.array
        print(f"{path.name}  at {x_m:+.3f} m, {y_m:+.3f} m, {math.degrees(theta_rad):+.1f} deg on the field")
    else:
        print(f"{path.name}  not located: {view.pose.reason}")
    nearest = min(view.obstacles, key=lambda obstacle: obstacle.range_m, default=None)
    for name, seen in (("ball", view.ball), ("nearest obstacle", nearest)):
        print(f"    {name}:", "none" if seen is None else f"{seen.x_m:+.3f} m ahead, {seen.y_m:+.3f} m to the left")
    print(f"    command: {velocity_mps[0]:+.3f} m/s ahead, {velocity_mps[1]:+.3f} m/s to the left ({command.reason})")

OUT.mkdir(exist_ok=True)
assert frame is not None
cv2.imwrite(str(OUT / "embed.png"), draw(view, frame, vision))
print(f"what the last frame showed: {OUT / 'embed.png'}")
