"""Pictures that are leaned over, against the ray caster's of a tilted camera."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.fast.mirror import LeaningMirror, MirrorFrames
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import Ball, Robot, Room, Scene
from sim2d.rendering.sensor import Sensor

SENSOR = Sensor(noise_sigma=0.0, blur_px=0.7, vignette=0.25)
SOFT = replace(SENSOR, vignette=0.0)


@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(1.0, 0.5), (-0.4, 0.0), (0.0, -1.0)])
def test_a_leaned_picture_is_that_of_a_tilted_camera(pitch_deg, roll_deg):
    field, camera, rng = load_field("ssl_2001"), sekimori_camera(), np.random.default_rng(0)
    pitch, roll = math.radians(pitch_deg), math.radians(roll_deg)
    robots = (Robot(0.5, 0.3, 0.09, 0.14), Robot(-0.7, -0.4, 0.09, 0.14))
    scene = Scene(field, (), robots, Ball(0.2, -0.4, field.ball_radius_m), room=Room(seed=4, distance_m=1.2))
    leaning, pose = LeaningMirror(camera), Pose2(0.1, 0.1, 0.4)
    tilt_x, tilt_y = camera.tilt_rad
    tilted = replace(camera, tilt_rad=(tilt_x + roll, tilt_y - pitch))
    moved = pose.compose(Pose2(*leaning.shift_m(pitch, roll), 0.0))
    frames = MirrorFrames(scene, camera, SENSOR)
    upright = frames.draw(robots, scene.ball, moved)
    drawn = frames.draw(robots, scene.ball, pose, pitch_rad=pitch, roll_rad=roll)
    leaned = SOFT.expose(drawn.astype(np.float32), rng)
    slow = SENSOR.expose(MirrorRenderer(tilted, 3).render(scene, moved), rng)
    u, v = np.meshgrid(np.arange(camera.size_px[0]), np.arange(camera.size_px[1]))
    radius = np.hypot(u - camera.center_px[0], v - camera.center_px[1])
    inside = (radius > camera.usable_radius_px[0] + 3) & (radius < camera.usable_radius_px[1] - 2)
    away, not_leaned = (
        np.abs(frame.astype(int) - slow).max(axis=2)[inside]
        for frame in (leaned, SOFT.expose(upright.astype(np.float32), rng))
    )
    # within a quarter of a match sensor's noise; most of it the fast frames' own difference
    assert away.mean() < 2.0
    assert (away > 12).mean() < 0.04
    assert away.mean() < 0.6 * not_leaned.mean()


def test_a_body_that_is_upright_gives_the_picture_itself():
    leaning = LeaningMirror(sekimori_camera())
    frame = np.zeros((220, 256, 3), dtype=np.uint8)
    assert leaning.lean(frame, 1e-5, 0.0) is frame


def test_the_robots_own_body_does_not_move_in_its_picture():
    camera = sekimori_camera()
    frame = np.random.default_rng(1).integers(0, 256, (220, 256, 3), dtype=np.uint8)
    v, u = np.mgrid[:220, :256]
    radius = np.hypot(u - camera.center_px[0], v - camera.center_px[1])
    leaned = LeaningMirror(camera).lean(frame, 0.02, -0.01)
    own = radius < camera.usable_radius_px[0]
    assert (leaned[own] == frame[own]).all()
    assert (leaned[(radius > 40) & (radius < 100)] != frame[(radius > 40) & (radius < 100)]).any()
