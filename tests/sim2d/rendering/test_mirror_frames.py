"""A mirror camera's quick frames against the ray caster's: lines on every field, and pictures that are leaned over."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import field_names, load_field
from robocup_vision.camera import OmniCamera, Tangent
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.fast.mirror import LeaningMirror, MirrorFrames
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import Ball, Robot, Room, Scene
from sim2d.rendering.sensor import Sensor

SENSOR = Sensor(noise_sigma=0.0, blur_px=0.7, vignette=0.25)
SOFT = replace(SENSOR, vignette=0.0)


HIGH = OmniCamera(
    size_px=(160, 120), center_px=(81.0, 58.5), usable_radius_px=(10.0, 58.0), floor_range=Tangent(0.9, 0.025),
    mirrored=True, tilt_rad=(0.01, -0.02), viewpoint_height_m=0.7,
)  # fmt: skip
FEW = ("ssl_2001", "spl_2020", "msl_6x4")


@pytest.mark.parametrize(
    ("name", "camera"),
    [
        *((name, sekimori_camera()) for name in FEW),
        ("msl_6x4", HIGH),
        *(pytest.param(name, sekimori_camera(), marks=pytest.mark.slow) for name in field_names() if name not in FEW),
        pytest.param("four_legged_2007", HIGH, marks=pytest.mark.slow),
    ],
)
def test_lines_are_those_of_the_ray_caster(name, camera):
    """The slow cases alone find a field whose paint the quick frames lose."""
    field, rng = load_field(name), np.random.default_rng(4)
    bare = replace(field, lines=np.empty((0, 4)), arcs=np.empty((0, 5)))
    high = field.floor_polygon.max(axis=0)
    x0, y0, x1, y1 = field.lines[0].tolist()
    on_a_line = Pose2((x0 + x1) / 2, (y0 + y1) / 2, math.atan2(y1 - y0, x1 - x0))
    caster = MirrorRenderer(camera, 1)
    scenes = [Scene(one, carpet_margin_m=0.5) for one in (field, bare)]
    frames = [MirrorFrames(scene, camera, Sensor()) for scene in scenes]
    for pose in (Pose2(*rng.uniform(-high, high).tolist(), rng.uniform(-3, 3)), on_a_line, Pose2(0.0, 0.0, 0.0)):
        quick, quick_bare = (drawn.draw((), None, pose).astype(int) for drawn in frames)
        slow, slow_bare = (Sensor().expose(caster.render(scene, pose), rng).astype(int) for scene in scenes)
        difference = np.abs((quick - quick_bare) - (slow - slow_bare)).max(axis=2)
        painted = (slow != slow_bare).any(axis=2)
        assert painted.sum() > 100
        # rays are looked at in their bearing's direction, and averaged over edges along it
        assert difference[painted].mean() < 1.0
        assert (difference[painted] > 3).mean() < 0.025
        # far away a patch is many lines long, and its share of a line's end differs
        assert (difference[~painted] > 2).mean() < 3e-3


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
