"""The picture against geometry: edges where they belong, heights, occlusion, symmetry, line width."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt
import pytest

from field_models import load_field
from robocup_vision.camera import OmniCamera, Tangent
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import BOX_COLORS, Ball, Box, Highlight, Light, Robot, Scene, Shadow

SSL = load_field("ssl_2001")
CORNERS = np.array([[1.37, -0.7625], [1.37, 0.7625], [-1.37, 0.7625], [-1.37, -0.7625]])
BARE = dataclasses.replace(SSL, lines=np.empty((0, 4)), arcs=np.empty((0, 5)), goals=(), floor_polygon=CORNERS)
CAMERA = sekimori_camera()
RENDERER = MirrorRenderer(CAMERA)
GREEN = np.array([50.0, 130.0, 45.0])


def is_floor(image: npt.NDArray[np.float32]) -> npt.NDArray[np.bool_]:
    return np.abs(image - GREEN).max(axis=-1) < 2


def edge_rows(image: npt.NDArray[np.float32], column: int, guess: float) -> float:
    """Row at which floor (below) ends in one column, from the summed share of floor within 3 px of a guess."""
    first, last = round(guess) - 3, round(guess) + 3
    blue = image[first : last + 1, column, 0].astype(np.float64)
    share = (blue - blue[0]) / (blue[-1] - blue[0])
    return last + 0.5 - share.sum()


def test_foot_of_the_wall_is_unbiased():
    """Mean over many columns and places of the measured minus the true edge, below 0.02 px, single ones below 0.2."""
    camera = dataclasses.replace(CAMERA, tilt_rad=(0.02, -0.015), center_px=(CAMERA.center_px[0] + 0.3, 111.0))
    renderer = MirrorRenderer(camera)
    places = ((0.0, 0.0), (0.4, 0.11), (-0.53, 0.31), (0.21, -0.33))
    errors = []
    for turn in (0.0, math.pi / 2, math.pi, -math.pi / 2):
        for x, y in places:
            pose = Pose2(x, y, turn)  # a wall lies to the left, which is up in the image
            image = renderer.render(Scene(BARE), pose)
            aside = np.linspace(-0.25, 0.25, 2001)
            left = {0.0: 0.7625 - y, math.pi / 2: 1.37 + x, math.pi: 0.7625 + y, -math.pi / 2: 1.37 - x}[turn]
            foot = camera.floor_to_pixel(np.stack([aside, np.full_like(aside, left)], axis=1))
            for column in range(math.ceil(foot[:, 0].min()) + 1, math.floor(foot[:, 0].max()) - 1):
                inside = (foot[:, 0] > column - 0.5) & (foot[:, 0] < column + 0.5)
                truth = foot[inside, 1].mean()
                errors.append(edge_rows(image, column, truth) - truth)
    assert len(errors) > 300
    assert abs(np.mean(errors)) < 0.02
    assert np.std(errors) < 0.06
    assert np.abs(errors).max() < 0.2


def test_wall_top_is_where_similar_triangles_put_it():
    """A point 0.10 m up looks like a floor point h / (h - 0.10) times as far away."""
    scene = Scene(BARE)
    image = RENDERER.render(scene, Pose2(0.0, 0.3, 0.0))
    height_m = CAMERA.height_m
    assert height_m is not None
    top = CAMERA.floor_to_pixel([0.0, (0.7625 - 0.3) * height_m / (height_m - 0.10)])
    column = round(float(top[0]))
    profile = image[:, column, 0]
    foot = CAMERA.floor_to_pixel([0.0, 0.7625 - 0.3])
    wall = profile[round(float(foot[1])) - 3]
    above = profile[round(float(top[1])) - 3]
    window = profile[round(float(top[1])) - 3 : round(float(top[1])) + 4]
    share = (window - above) / (wall - above)
    edge = round(float(top[1])) + 3.5 - share.sum()
    assert edge == pytest.approx(float(top[1]), abs=0.1)


def test_free_range_matches_the_picture():
    """Floor within the exact free range is green, just beyond it is not."""
    scene = Scene(BARE, boxes=(Box(0.5, 0.2, 0.4), Box(-0.6, -0.3, 1.0)), robots=(Robot(0.1, -0.45, 0.09),))
    pose = Pose2(-0.1, 0.1, 0.8)
    camera = sekimori_camera(640, 480)
    image = MirrorRenderer(camera, 2).render(scene, pose)
    bearing = np.linspace(-math.pi, math.pi, 720, endpoint=False)
    free = scene.free_range_m(pose, bearing)
    foot = camera.floor_to_pixel(np.stack([free * np.cos(bearing), free * np.sin(bearing)], axis=1))
    outward = np.stack([np.cos(bearing), -np.sin(bearing)], axis=1)
    floor = is_floor(image)

    def at(pixels: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        u, v = np.rint(pixels).astype(int).T
        kept = (u >= 0) & (u < 640) & (v >= 0) & (v < 480)
        return np.asarray(floor[v[kept], u[kept]])

    smooth = np.abs(np.gradient(free)) < 0.02  # at the side of a box a pixel sees both
    assert smooth.mean() > 0.9
    assert at(foot[smooth] - 2 * outward[smooth]).all()
    assert not at(foot[smooth] + 2 * outward[smooth]).any()


@pytest.mark.parametrize("spin_rad", [0.0, 0.02])
def test_half_turn_of_pose_turns_the_picture(spin_rad: float):
    """One goal colour, no room in view: turned by pi about the field's centre everything looks the same."""
    boxes = (Box(0.4, 0.2, 0.3), Box(-0.4, -0.2, 0.3))
    scene = Scene(SSL, boxes=boxes)
    pose = Pose2(0.3, -0.2, 0.7)
    image = RENDERER.render(scene, pose, spin_rad=spin_rad)
    other = RENDERER.render(scene, dataclasses.replace(pose.half_turn(), theta_rad=pose.theta_rad), spin_rad=spin_rad)
    floor = is_floor(image)
    turned = other[::-1, ::-1]
    assert floor.sum() > 5000
    np.testing.assert_allclose(turned[floor], image[floor], atol=0.5)
    # white paint turns along; lamps light upright faces from one side, so only what lies flat is compared
    v, u = np.nonzero(
        (image.min(axis=-1) > 100) & (np.hypot(*(np.indices(floor.shape) - np.array([[[109.5]], [[127.5]]]))) < 50)
    )
    assert len(v) > 50
    np.testing.assert_allclose(turned[v, u], image[v, u], atol=0.5)
    same = RENDERER.render(scene, pose.half_turn(), spin_rad=spin_rad)
    np.testing.assert_allclose(same[floor], image[floor], atol=0.5)


def test_heading_turns_the_picture():
    scene = Scene(SSL)
    camera = dataclasses.replace(CAMERA, size_px=(221, 221), center_px=(110.0, 110.0))
    renderer = MirrorRenderer(camera, 2)
    level = renderer.render(scene, Pose2(0.2, 0.1, 0.3))
    turned = renderer.render(scene, Pose2(0.2, 0.1, 0.3 + math.pi / 2))
    # the robot turns left, so the world turns right (clockwise)
    both = is_floor(level) & is_floor(np.rot90(turned, 1))
    assert both.sum() > 0.97 * is_floor(level).sum()


def test_line_paints_its_area():
    """The painted share summed over the floor seen is length times width."""
    painted = dataclasses.replace(
        BARE, lines=np.array([[0.2, -0.4, 0.2, 0.4]]), arcs=np.array([[0.0, 0.0, 0.5, 0.4, 1.1]])
    )
    pose = Pose2(-0.2, 0.05, 0.4)
    white = RENDERER.render(Scene(painted), pose) - RENDERER.render(Scene(BARE), pose)
    share = white[..., 0].astype(np.float64) / (230 - 50)
    v, u = np.mgrid[:220, :256]
    pixels = np.stack([u, v], axis=-1).astype(np.float64)
    du, dv = np.array([0.01, 0.0]), np.array([0.0, 0.01])
    right = CAMERA.pixel_to_floor(pixels + du) - CAMERA.pixel_to_floor(pixels - du)
    down = CAMERA.pixel_to_floor(pixels + dv) - CAMERA.pixel_to_floor(pixels - dv)
    area = np.abs(right[..., 0] * down[..., 1] - right[..., 1] * down[..., 0]) / 0.02**2
    seen = share > 1e-4
    expected = 0.81 * 0.01 + 0.5 * 1.1 * 0.01
    assert (share[seen] * area[seen]).sum() == pytest.approx(expected, rel=0.02)
    assert share.max() <= 1.001


def test_taller_things_hide_what_is_behind_them():
    ball = Ball(0.6, 0.0, 0.0215)
    pose = Pose2(0.0, 0.0, 0.0)
    u, v = np.rint(CAMERA.point_to_pixel([0.6, 0.0, 0.02])).astype(int)
    open_view = RENDERER.render(Scene(BARE, ball=ball), pose)[v, u]
    hidden = RENDERER.render(Scene(BARE, ball=ball, boxes=(Box(0.4, 0.0, color_bgr=BOX_COLORS["blue"]),)), pose)[v, u]
    assert open_view[2] > 2 * open_view[1]
    assert hidden[0] > 2 * hidden[2]


@pytest.mark.slow
def test_ball_is_round_and_where_it_lies():
    """Only this finds a ball that a mirror shows elsewhere, or too large."""
    ball = Ball(0.35, 0.2, 0.0215)
    camera = sekimori_camera(640, 480)
    renderer = MirrorRenderer(camera, 2)
    image, bare = (renderer.render(Scene(BARE, ball=one), Pose2(0.0, 0.0, 0.0)) for one in (ball, None))
    orange = image[..., 2] > 1.5 * image[..., 1]
    orange &= np.abs(image - bare).max(axis=-1) > 20
    v, u = np.nonzero(orange)
    center = camera.point_to_pixel([0.35, 0.2, 0.0215])
    assert np.hypot(u.mean() - center[0], v.mean() - center[1]) < 0.5
    grazing = math.asin(0.0215 / math.dist((0.35, 0.2, 0.0215), (0, 0, camera.height_m or 0)))
    assert 0.5 < orange.sum() / (math.pi * (grazing * 219) ** 2) < 3.0


def test_tops_of_low_things_and_bars_of_high_goals():
    field = load_field("four_legged_2007")
    goal = field.goals[0]
    camera = OmniCamera((640, 480), (319.5, 239.5), (40.0, 230.0), Tangent(1.0, 0.0065), viewpoint_height_m=0.6)
    renderer = MirrorRenderer(camera, 1)
    pose = Pose2(1.9, 0.3, 0.0)
    scene = Scene(field, boxes=(Box(2.4, 0.3, color_bgr=BOX_COLORS["red"]),), robots=(Robot(1.5, 0.3, 0.15),))
    image = renderer.render(scene, pose)

    def color(x: float, y: float, z: float) -> npt.NDArray[np.float32]:
        u, v = np.rint(camera.point_to_pixel(np.append(pose.inverse().transform([x, y]), z))).astype(int)
        return np.asarray(image[v, u])

    np.testing.assert_allclose(color(2.4, 0.3, 0.13), BOX_COLORS["red"], rtol=0.05)
    np.testing.assert_allclose(color(1.5, 0.3, 0.14), scene.robots[0].marker_bgr, rtol=0.05)
    np.testing.assert_allclose(color(1.62, 0.3, 0.14), scene.robots[0].color_bgr, rtol=0.1)
    bar, post = color(goal.line_x_m, 0.1, goal.height_m), color(goal.line_x_m, 0.45, 0.2)
    for seen in (bar, post):
        assert seen[0] > 3 * seen[2]
        assert seen[1] > 3 * seen[2]


def test_body_and_rim_are_dark():
    image = RENDERER.render(Scene(SSL), Pose2(0.0, 0.0, 0.0))
    np.testing.assert_allclose(image[110, 128], (30, 28, 28))
    assert not image[0, 0].any()
    assert not image[110, 5].any()


def test_light():
    pose = Pose2(0.1, 0.05, 0.4)
    plain = RENDERER.render(Scene(BARE), pose)
    floor = is_floor(plain)
    half = RENDERER.render(Scene(BARE, light=Light(level=0.5)), pose)
    np.testing.assert_allclose(half[floor], plain[floor] / 2, rtol=0.05)

    graded = RENDERER.render(Scene(BARE, light=Light(gradient=0.2, gradient_direction_rad=1.0)), pose)
    v, u = np.nonzero(floor)
    places = pose.transform(CAMERA.pixel_to_floor(np.stack([u, v], axis=1)))
    gain = 1 + 0.2 * (places @ (math.cos(1.0), math.sin(1.0))) / 1.37
    np.testing.assert_allclose(graded[v, u, 1], 130 * gain, rtol=0.02)

    cut = Shadow(0.7, low_m=0.2)
    shaded = RENDERER.render(Scene(BARE, light=Light(shadow=cut)), pose)
    depth = places @ (math.cos(0.7), math.sin(0.7)) - 0.2
    ratio = shaded[v, u] / plain[v, u]
    np.testing.assert_allclose(ratio[depth < -0.1], 1, rtol=0.02)
    np.testing.assert_allclose(
        ratio[depth > 0.1], np.broadcast_to(cut.factor_bgr, (int((depth > 0.1).sum()), 3)), rtol=0.03
    )

    spot = Highlight(0.4, 0.2, 0.05, 80.0)
    lit = RENDERER.render(Scene(BARE, light=Light(highlights=(spot,))), pose) - plain
    brightest = np.unravel_index(np.argmax(lit[..., 0]), lit.shape[:2])
    place = pose.transform(CAMERA.pixel_to_floor([brightest[1], brightest[0]]))
    assert np.hypot(*(place - (0.4, 0.2))) < 0.02
    assert lit.max() == pytest.approx(80, rel=0.05)
    np.testing.assert_allclose(lit[..., 0], lit[..., 2], atol=1e-3)


def test_carpet_texture_lies_on_the_floor():
    light = Light(texture=0.1, texture_seed=4)
    here = RENDERER.render(Scene(BARE, light=light), Pose2(0.0, 0.0, 0.0))
    floor = is_floor(RENDERER.render(Scene(BARE), Pose2(0.0, 0.0, 0.0)))
    grain = here[floor][:, 1] / 130 - 1
    assert abs(grain.mean()) < 0.03
    assert 0.05 < grain.std() < 0.12
    turned = RENDERER.render(Scene(BARE, light=light), Pose2(0.0, 0.0, math.pi))[::-1, ::-1]
    np.testing.assert_allclose(turned[floor], here[floor], atol=1.0)


def test_spin_blurs_along_the_turn_only():
    pose = Pose2(0.0, 0.0, 0.0)
    scene = Scene(BARE, boxes=(Box(0.5, 0.0, color_bgr=BOX_COLORS["white"]),))
    sharp = RENDERER.render(scene, pose)
    blurred = RENDERER.render(scene, pose, spin_rad=math.radians(8))
    v, u = np.mgrid[:220, :256]
    ring = np.abs(np.hypot(u - 127.5, v - 109.5) - 75) < 1
    assert blurred[ring].sum() == pytest.approx(sharp[ring].sum(), rel=0.01)
    steepest = [np.abs(np.diff(image[80:140, 203, 0])).max() for image in (sharp, blurred)]
    assert steepest[1] < 0.6 * steepest[0]


def test_offset_camera_turns_about_the_robot():
    camera = dataclasses.replace(CAMERA, offset_m=(0.05, -0.02))
    renderer = MirrorRenderer(camera)
    pose = Pose2(0.2, 0.1, 1.1)
    image = renderer.render(Scene(BARE), pose)
    # a viewpoint straight over the same place, of a robot that stands there
    x, y = pose.transform((0.05, -0.02))
    np.testing.assert_allclose(RENDERER.render(Scene(BARE), Pose2(x, y, 1.1)), image, atol=1e-3)
