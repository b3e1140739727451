"""Pictures of a rig of four fisheye cameras on a middle-size field, rendered with known truth."""

import math

import numpy as np

from field_models import load_field
from robocup_vision.camera import FisheyeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Ball, Robot, Room, Scene
from sim2d.rendering.sensor import Sensor

SIZE = (264, 200)
FIELD = load_field("msl_6x4")
# pans of four cameras, the last one's picture is smaller
PANS = (0.0, math.pi / 2, math.pi, -math.pi / 2)
# with a ball between the first two cameras, and a robot ahead of the first
POSE = Pose2(-0.9, -0.4, 0.35)
BALL = POSE.transform((0.9, 0.9))
ROBOT = POSE.transform((1.5, 0.0))


def camera(pan_rad, size_px=SIZE):
    width, height = size_px
    return FisheyeCamera(
        size_px,
        (0.3 * width, 0.3 * width),
        ((width - 1) / 2, (height - 1) / 2),
        0.55,
        projection="equidistant",
        offset_m=(0.15 * math.cos(pan_rad), 0.15 * math.sin(pan_rad)),
        pan_rad=pan_rad,
        tilt_rad=-0.5,
        roll_rad=0.0,
    )


CAMERAS = (*map(camera, PANS[:3]), camera(PANS[3], (256, 200)))


def render(pose, seed, *, things=False, cameras=CAMERAS):
    rng, sensor = np.random.default_rng(seed), Sensor(noise_sigma=3.0, blur_px=0.6)
    robots = (Robot(*ROBOT, 0.26, 0.8),) if things else ()
    ball = Ball(*BALL, FIELD.ball_radius_m) if things else None
    scene = Scene(FIELD, robots=robots, ball=ball, room=Room(seed=4, bystanders=0), carpet_margin_m=0.8)
    return tuple(sensor.expose(render_pinhole(one, scene, pose, supersample=2), rng) for one in cameras)
