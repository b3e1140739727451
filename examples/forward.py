"""A walking robot with a camera in its head, located in every frame by the lines, goals and beacons in view.

The head sweeps, the body nods: neither the nod nor the true height is known to the robot. Frames come from the
renderer, so that the truth is known.
"""

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from field_models import load_field
from robocup_vision import Memory, Pose2, Vision, draw
from robocup_vision.camera import PinholeCamera
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Room, Scene
from sim2d.rendering.sensor import Sensor

OUT = Path("out")
FRAMES, STEP_S, SPEED_MPS = 30, 1 / 30, 0.25

field = load_field("four_legged_2007")
camera = PinholeCamera(
    size_px=(208, 160),
    focal_px=(192.0, 192.0),
    center_px=(103.5, 79.5),
    height_m=0.185,
    height_std_m=0.006,
    pan_rad=0.0,
    tilt_rad=math.radians(-10.0),
    roll_rad=0.0,
    roll_std_rad=math.radians(1.4),
)
vision = Vision(field, camera, memory=Memory(field))
scene, sensor = Scene(field, room=Room(seed=5), carpet_margin_m=0.2), Sensor(noise_sigma=3.0, blur_px=0.6)
rng = np.random.default_rng(1)

robot, odometry = Pose2(-1.2, -0.5, 0.3), Pose2(0.0, 0.0, 0.0)
for index in range(FRAMES):
    t_s = index * STEP_S
    pan_rad = math.radians(50.0) * math.sin(2.0 * t_s)
    nod_rad = math.radians(1.2) * math.sin(10.0 * t_s)
    nodding = replace(camera, tilt_rad=math.radians(-10.0) + nod_rad)
    light = render_pinhole(nodding, scene, robot.compose(Pose2(0.0, 0.0, pan_rad)), supersample=2)
    frame = sensor.expose(light, rng)

    view = vision.look(frame, t_s=t_s, odometry=odometry, pan_rad=pan_rad)
    if index % 3 == 0:
        belief = view.belief
        assert belief is not None
        seen = "located" if view.pose else view.pose.reason
        if belief.pose:
            error_m, error_rad = belief.pose.pose.error_to(robot)
            print(f"{t_s:4.2f} s  off by {error_m * 100:4.1f} cm and {math.degrees(error_rad):4.2f} deg; frame: {seen}")
        else:
            print(f"{t_s:4.2f} s  frame: {seen}")

    moved = Pose2(SPEED_MPS * STEP_S, 0.0, 0.2 * STEP_S)
    robot = robot.compose(moved)
    # legs slip: odometry says 5 % too much
    odometry = Pose2(1.05 * moved.x_m, 0.0, 1.05 * moved.theta_rad)

OUT.mkdir(exist_ok=True)
cv2.imwrite(str(OUT / "forward.png"), draw(view, frame, vision))
print("overlay of the last frame, with the edges found, hidden and missing:", OUT / "forward.png")
