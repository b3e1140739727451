"""Pictures of forward cameras on a field, rendered with known truth, for the tests of their calibration."""

import numpy as np

from robocup_vision.geometry import Pose2
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Room, Scene
from sim2d.rendering.sensor import Sensor

# on `spl_2020`; of no goal is any part in view
PLACES = (
    Pose2(1.5, -0.5, 1.75),
    Pose2(-2.4, 1.2, -1.4),
    Pose2(0.4, 1.4, -1.8),
    Pose2(2.6, -1.6, 1.2),
    Pose2(-1.0, -1.0, 1.5),
    Pose2(-3.0, -1.5, 1.6),
)


def render(field, camera, places, seed, *, margin_m):
    rng = np.random.default_rng(seed)
    scene, sensor = Scene(field, room=Room(seed=seed), carpet_margin_m=margin_m), Sensor(noise_sigma=2.0, blur_px=0.5)
    return [sensor.expose(render_pinhole(camera, scene, pose, supersample=3), rng) for pose in places]
