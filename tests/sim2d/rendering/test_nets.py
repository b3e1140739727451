"""Goal nets: how much they cover, near and far, and that both match cameras draw what the ray casters draw."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from field_models import COLOR_NAMES, Net, load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.match.setups import CAMERAS
from sim2d.rendering.fast.forward import EyeInField, ForwardFrames
from sim2d.rendering.fast.mirror import MirrorFrames
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Ball, Light, Robot, Scene
from sim2d.rendering.scene_table import net_rows
from sim2d.sensors.match_camera import MATCH_LIGHT, MATCH_ROOM, MATCH_SENSOR

NOISE = MATCH_SENSOR.noise_sigma
CLEAN = replace(MATCH_SENSOR, noise_sigma=0.0)


def scene_of(name, net):
    """Return a scene with robots and the ball in a goal; net: as the file has it, None, or another one."""
    field = load_field(name)
    if net != "file":
        field = replace(field, goals=tuple(replace(goal, net=net) for goal in field.goals))
    x, height = field.length_m / 2, 0.6 * field.goals[0].height_m
    robots = (Robot(x - 0.3, 0.3, 0.12, height), Robot(x + 0.25, -0.4, 0.12, 0.3))
    ball = Ball(x + 0.2, 0.2, field.ball_radius_m, COLOR_NAMES[field.ball_color])
    return Scene(field, (), robots, ball, MATCH_LIGHT, MATCH_ROOM, 0.5)


def camera(focal=300.0, height_m=0.5, tilt_rad=0.0):
    return PinholeCamera((320, 240), (focal, focal), (159.5, 119.5), height_m, tilt_rad=tilt_rad)


@pytest.mark.parametrize("name", ["spl_2020", "msl_18x12"])
def test_a_net_is_at_back_sides_and_roof(name):
    field = load_field(name)
    rows = net_rows(field)
    assert len(rows) == 8
    corners = rows[:, :3] + rows[:, 3:6] * rows[:, 9:10] + rows[:, 6:9] * rows[:, 10:11]
    for k, goal in enumerate(field.goals):
        part = slice(4 * k, 4 * k + 4)
        ends = np.concatenate([rows[part, :3], corners[part]])
        low, high = sorted([goal.line_x_m, goal.back_x_m])
        assert ends.min(axis=0) == pytest.approx([low, -goal.width_m / 2, 0.0])
        assert ends.max(axis=0) == pytest.approx([high, goal.width_m / 2, goal.net.height_m])
        assert rows[part, 9:11] / rows[part, 11:13] == pytest.approx(np.rint(rows[part, 9:11] / rows[part, 11:13]))
    assert not len(net_rows(load_field("four_legged_2007")))


def test_a_far_net_covers_its_cords_share_and_a_near_one_has_cords():
    mesh, cord = 0.05, 0.005
    shown = []
    # its own colour on a black field: what is seen is what it covers
    for distance, focal in ((4.0, 60.0), (0.7, 900.0)):
        lights = []
        for net in (Net(0.8, mesh, cord, "white"), None):
            scene = replace(scene_of("spl_2020", net), robots=(), ball=None, light=Light())
            lens = camera(focal, 0.4)
            lights.append(render_pinhole(lens, scene, Pose2(5.0 - distance, 0.0, 0.0), supersample=4))
        back = focal * 0.35 / distance  # so far from the middle there is nothing but the net at the back
        middle = slice(round(119.5 - back), round(119.5 + back)), slice(round(159.5 - back), round(159.5 + back))
        covered, behind = (light[middle] for light in lights)
        shown.append(((covered - behind) / (COLOR_NAMES["white"][0] - behind)).mean(axis=2))
    due = 1 - (1 - cord / mesh) ** 2
    assert shown[0].mean() == pytest.approx(due, rel=0.1)
    assert shown[1].mean() == pytest.approx(due, rel=0.1)
    # a pixel is 0.8 mm of the near net: cord or no cord
    assert np.percentile(shown[1], 98) > 0.99
    assert np.median(shown[1]) < 0.01


EYES = {
    "near": (3.2, 0.1, 0.0, -0.1),
    "far": (-1.0, 0.5, 0.0, -0.1),
    "behind": (5.5, 0.3, 3.0, -0.1),
    "beside": (4.8, -2.2, 1.5, -0.1),
    "in the mouth": (4.3, 0.9, -0.6, 0.0),
}


@pytest.mark.parametrize(
    "place",
    ["near", "behind", *(pytest.param(one, marks=pytest.mark.slow) for one in ("far", "beside", "in the mouth"))],
)
def test_a_forward_cameras_net_is_that_of_the_ray_caster_within_the_sensors_noise(place):
    """The slow cases alone find a net that is drawn wrongly from where few look."""
    x, y, heading, tilt = EYES[place]
    eye = EyeInField(x, y, 0.5, heading, tilt, 0.02)
    frames = []
    for net in ("file", None):
        scene = scene_of("spl_2020", net)
        quick = ForwardFrames(scene, camera(), CLEAN).draw(scene.robots, scene.ball, eye)
        blurred = cv2.GaussianBlur(quick.astype(np.float32), (0, 0), CLEAN.blur_px, borderType=cv2.BORDER_REPLICATE)
        lens = replace(camera(tilt_rad=tilt), roll_rad=0.02)
        slow = render_pinhole(lens, scene, Pose2(x, y, heading), supersample=4)
        frames.append((np.rint(blurred), CLEAN.expose(slow, np.random.default_rng(0)).astype(float)))
    (quick, slow), (quick_bare, bare) = frames
    difference, by_net = np.abs(quick - slow).max(axis=2), np.abs(slow - bare).max(axis=2)
    assert by_net.max() > 2 * NOISE
    assert difference.mean() < 0.15 * NOISE
    assert (difference > NOISE).mean() < 0.01
    # where the net is, it is the same net
    seen = by_net > 2
    assert np.corrcoef((quick - quick_bare)[seen].ravel(), (slow - bare)[seen].ravel())[0, 1] > 0.9


@pytest.mark.parametrize(
    "place",
    [(7.6, 0.3, 0.2), *(pytest.param(one, marks=pytest.mark.slow) for one in ((9.2, -1.8, 0.4), (9.9, 0.4, 2.0)))],
)
def test_a_mirrors_net_is_that_of_the_ray_caster(place):
    """The slow cases alone find a net that is drawn wrongly from beside and behind it."""
    lens, pose = CAMERAS["msl_mirror"](), Pose2(*place)
    frames = []
    for net in ("file", None):
        scene = scene_of("msl_18x12", net)
        quick = MirrorFrames(scene, lens, CLEAN).draw(scene.robots, scene.ball, pose)
        blurred = cv2.GaussianBlur(quick.astype(np.float32), (0, 0), CLEAN.blur_px, borderType=cv2.BORDER_REPLICATE)
        slow = CLEAN.expose(MirrorRenderer(lens, 3).render(scene, pose), np.random.default_rng(0))
        frames.append((np.rint(blurred), slow.astype(float)))
    net_quick, net_slow = (with_net - without for with_net, without in zip(*frames, strict=True))
    seen = np.abs(net_slow).max(axis=2) > 2
    assert seen.sum() > 500
    difference = np.abs(net_quick - net_slow).max(axis=2)
    assert difference.mean() < 0.05 * NOISE
    assert difference[seen].mean() < NOISE
    assert (difference > NOISE).mean() < 0.01
    assert math.isclose(net_quick[seen].mean(), net_slow[seen].mean(), rel_tol=0.2)


def test_light_falls_on_a_net():
    scene = replace(scene_of("spl_2020", "file"), robots=(), ball=None)
    pose, lens = Pose2(4.0, 0.0, 0.0), PinholeCamera((80, 60), (225.0, 225.0), (39.5, 29.5), 0.4, tilt_rad=0.0)
    dark, bright = (
        render_pinhole(lens, replace(scene, light=Light(level=level)), pose, supersample=2) for level in (0.5, 1.0)
    )
    assert bright == pytest.approx(2 * dark, rel=1e-4)
