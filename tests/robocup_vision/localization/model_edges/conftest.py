"""Rendered frames of forward cameras on two fields, with truth."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from field_models import Field, load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Robot, Room, Scene
from sim2d.rendering.sensor import Sensor

CAMERA = PinholeCamera(
    (208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.0, roll_std_rad=0.024
)


@dataclass(frozen=True)
class Shot:
    """A frame, the field, the camera's file, and the camera's true pose."""

    frame: np.ndarray
    field: Field
    camera: PinholeCamera
    pose: Pose2


def take(name, pose, *, nod_rad=0.0, robots=(), camera=CAMERA, seed=3):
    field = load_field(name)
    held = replace(camera, tilt_rad=camera.tilt_rad + nod_rad)
    scene = Scene(field, robots=robots, room=Room(seed=seed), carpet_margin_m=0.2)
    light = render_pinhole(held, scene, pose, supersample=4)
    rng = np.random.default_rng(seed)
    return Shot(Sensor(noise_sigma=3.0, blur_px=0.6).expose(light, rng), field, camera, pose)


@pytest.fixture(scope="session")
def take_shot():
    return take


@pytest.fixture(scope="session")
def fl_shot():
    """Show a four-legged robot the goal at -x; it nods by a degree, and another robot is in view."""
    other = Robot(-1.7, 0.35, 0.12, 0.25)
    return take("four_legged_2007", Pose2(-0.5, -0.2, 3.0), nod_rad=0.017, robots=(other,))


@pytest.fixture(scope="session")
def spl_shot():
    """Show a humanoid the penalty area."""
    camera = replace(CAMERA, size_px=(320, 240), focal_px=(308.0, 308.0), center_px=(159.5, 119.5), height_m=0.46)
    camera = replace(camera, tilt_rad=-0.25)
    return take("spl_2020", Pose2(1.2, 0.6, -0.15), nod_rad=-0.012, camera=camera)
