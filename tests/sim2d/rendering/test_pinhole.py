"""The pinhole renderer against geometry: silhouettes, feet, tops, area averages, light, clutter; a fisheye's circle."""

from __future__ import annotations

import dataclasses
import math
from functools import lru_cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import numbers

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array, FloatArray
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.goal.scenes import ers7_camera
from sim2d.rendering.goal.surroundings import Glare, Member, SunPatch
from sim2d.rendering.pinhole import dark_pixels, render_pinhole, smear
from sim2d.rendering.scene import Robot, Room, Scene

FIELD = dataclasses.replace(load_field("four_legged_2007"), beacons=())
GOAL = FIELD.goals[0]
ROOM = Room(distance_m=0.5, bystanders=0)
BRIGHT = 1e5
EDGE_PX = 0.02
ROW_PX = 0.07  # one row or column: 64 rays a pixel count an edge along their lattice no finer


def looking_at_goal(x_m: float, y_m: float, tilt_rad: float, roll_rad: float) -> tuple[PinholeCamera, Pose2]:
    """Return a camera that looks at the goal's middle; from far it is a larger one, as few rows tell no slope."""
    size_px = (208, 160) if x_m > 0.0 else (416, 320)
    left, right = (math.atan2(side * GOAL.width_m / 2 - y_m, GOAL.line_x_m - x_m) for side in (1, -1))
    return ers7_camera(*size_px).with_orientation(0.0, tilt_rad, roll_rad), Pose2(x_m, y_m, (left + right) / 2)


def coverage(camera: PinholeCamera, pose: Pose2, member: Member) -> FloatArray:
    """Share (H, W) of each pixel that shows a member of the goal: it shines, nothing else changes."""
    scene = Scene(FIELD, room=ROOM)
    shine = Glare(GOAL.side, member, 0.5, 100.0, 0.0, 100.0, BRIGHT)
    lit = render_pinhole(camera, scene, pose, glare=(shine,))
    return np.asarray((lit - bare(camera, pose))[..., 0] / BRIGHT, dtype=np.float64)


@lru_cache(maxsize=8)
def bare(camera: PinholeCamera, pose: Pose2) -> Float32Array:
    """Render what nothing shines on, once for all members that are seen from there."""
    return render_pinhole(camera, Scene(FIELD, room=ROOM), pose)


def seen_at(camera: PinholeCamera, pose: Pose2, points: FloatArray) -> FloatArray:
    flat = pose.inverse().transform(points[:, :2])
    return camera.point_to_pixel(np.column_stack([flat, points[:, 2]]))


def silhouettes(pose: Pose2, side: int, z_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points on the left and the right outline of a post: where sight lines touch it."""
    dx, dy = GOAL.line_x_m - pose.x_m, side * GOAL.width_m / 2 - pose.y_m
    away = math.hypot(dx, dy)
    touch = math.sqrt(away**2 - GOAL.post_radius_m**2)
    half = math.asin(GOAL.post_radius_m / away)
    return tuple(
        np.column_stack(
            [
                np.full(len(z_m), pose.x_m + touch * math.cos(math.atan2(dy, dx) + turn)),
                np.full(len(z_m), pose.y_m + touch * math.sin(math.atan2(dy, dx) + turn)),
                z_m,
            ]
        )
        for turn in (half, -half)
    )


def check_edge(errors: FloatArray) -> None:
    """Each row agrees roughly, the straight line through all of them closely at both its ends."""
    assert len(errors) > 15
    assert np.abs(errors).max() < ROW_PX
    at = np.linspace(-1, 1, len(errors))
    line = np.polynomial.polynomial.polyfit(at, errors, 1)
    assert np.abs(line).sum() < EDGE_PX


def crossing_u(pixels: FloatArray, row: int) -> float:
    """Where a straight outline through two pixels crosses the middle of a row."""
    (u0, v0), (u1, v1) = pixels
    return float(u0 + (u1 - u0) * (row - v0) / (v1 - v0))


@pytest.mark.parametrize(
    ("x", "y", "tilt", "roll"),
    [
        (1.2, 0.3, 0.05, 0.08),
        pytest.param(-2.3, 1.0, 0.1, 0.02, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize(("member", "side"), [("positive_y", 1), ("negative_y", -1)])
def test_posts_edges_are_where_projection_says(x: float, y: float, tilt: float, roll: float, member: Member, side: int):
    """The far, rolled view alone finds an error that grows with distance or roll."""
    camera, pose = looking_at_goal(x, y, tilt, roll)
    share = coverage(camera, pose, member)
    for outline, is_left in zip(silhouettes(pose, side, np.array([0.03, 0.38])), (True, False), strict=True):
        ends = seen_at(camera, pose, outline)
        errors = []
        for row in range(math.ceil(ends[:, 1].min()), math.floor(ends[:, 1].max()) + 1):
            expected = crossing_u(ends, row)
            low, high = round(expected) - 2, round(expected) + 2
            filled = share[row, low : high + 1].sum()
            errors.append((high + 0.5 - filled if is_left else low - 0.5 + filled) - expected)
        check_edge(np.array(errors))


@pytest.mark.parametrize(
    ("x", "roll"),
    [(1.2, 0.0), pytest.param(-2.0, -0.04, marks=pytest.mark.slow)],
)
def test_bars_edges_are_where_projection_says(x: float, roll: float):
    """The far, rolled view alone finds an error that grows with distance or roll."""
    camera, pose = looking_at_goal(x, 0.2, 0.05, roll)
    share = coverage(camera, pose, "bar")
    # in the plane across the bar the sight lines touch it below and above its axis
    away, rise = GOAL.line_x_m - pose.x_m, GOAL.height_m - camera.height_m
    to_axis, touch = math.hypot(away, rise), math.sqrt(away**2 + rise**2 - GOAL.post_radius_m**2)
    half = math.asin(GOAL.post_radius_m / to_axis)
    for turn, is_top in ((half, True), (-half, False)):
        up = math.atan2(rise, away) + turn
        point = [pose.x_m + touch * math.cos(up), camera.height_m + touch * math.sin(up)]
        ends = seen_at(camera, pose, np.array([[point[0], s, point[1]] for s in (0.35, -0.35)]))
        errors = []
        for column in range(math.ceil(ends[0, 0]), math.floor(ends[1, 0]) + 1):
            expected = crossing_u(ends[:, ::-1], column)
            low, high = round(expected) - 2, round(expected) + 2
            filled = share[low : high + 1, column].sum()
            errors.append((high + 0.5 - filled if is_top else low - 0.5 + filled) - expected)
        check_edge(np.array(errors))


def test_posts_stand_on_the_floor_and_end_at_the_bars_upper_edge():
    camera, pose = looking_at_goal(1.0, 0.0, 0.05, 0.0)
    share = coverage(camera, pose, "positive_y")
    toward = math.atan2(pose.y_m - GOAL.width_m / 2, pose.x_m - GOAL.line_x_m)
    near = np.array([GOAL.line_x_m, GOAL.width_m / 2]) + GOAL.post_radius_m * np.array(
        [math.cos(toward), math.sin(toward)]
    )
    top = GOAL.height_m + GOAL.post_radius_m
    (u, foot_v), (_, top_v) = seen_at(camera, pose, np.array([[*near, 0.0], [*near, top]]))
    column = round(u)
    shown = np.flatnonzero(share[:, column] > 0)
    foot, first = round(foot_v), round(top_v)
    low = foot - 2 - 0.5 + share[foot - 2 : foot + 3, column].sum()
    assert low == pytest.approx(foot_v, abs=0.1)  # the foot is round: flat only at this one bearing
    # from below, the rim that faces the camera is the post's highest point, if the bar does not hide it
    assert shown[0] == pytest.approx(first, abs=1)


@given(st.integers(0, 10**6), numbers(-2.0, 1.5), numbers(-1.5, 1.5), numbers(-0.2, 0.2))
@settings(max_examples=4)
def test_few_rays_and_many_see_the_same(seed: int, x: float, y: float, roll: float):
    camera, pose = looking_at_goal(x, y, 0.02, roll)
    camera = dataclasses.replace(
        camera, size_px=(104, 80), focal_px=(96.0, 96.0), center_px=(51.5, 39.5)
    ).with_orientation(0.0, 0.02, roll)
    scene = Scene(FIELD, robots=(Robot(2.0, 0.2, 0.12),), room=Room(seed, bystanders=0))
    few, many = (render_pinhole(camera, scene, pose, backdrop=Backdrop("plain"), supersample=n) for n in (6, 12))
    lamps = many.max(axis=2) > 250  # far over white: their edges are not worth more rays
    difference = np.abs(few - many).max(axis=2)[~lamps]
    assert np.quantile(difference, 0.995) < 16.0
    assert difference.mean() < 0.5


def test_offset_and_pan_place_the_camera_on_its_robot():
    camera, pose = looking_at_goal(0.5, 0.3, 0.05, 0.02)
    robot = pose.compose(Pose2(0.1, 0.05, 0.4).inverse())
    mounted = dataclasses.replace(camera, offset_m=(0.1, 0.05), pan_rad=0.4)
    scene = Scene(FIELD, room=ROOM)
    same = render_pinhole(mounted, scene, robot) - render_pinhole(camera, scene, pose)
    assert np.quantile(np.abs(same), 0.999) < 2.0


@pytest.mark.slow
def test_distorted_lens_bends_the_picture_as_the_camera_says():
    """Only this finds a renderer that leaves out the lens's distortion."""
    camera, pose = looking_at_goal(0.8, 0.0, 0.05, 0.0)
    camera = dataclasses.replace(camera, distortion=(-0.25, 0.05, 0.0, 0.0))
    share = coverage(camera, pose, "positive_y")
    left, right = silhouettes(pose, 1, np.array([0.2]))
    (u_left, v), (u_right, _) = seen_at(camera, pose, np.vstack([left, right]))
    row = round(v)
    assert share[row].sum() == pytest.approx(u_right - u_left, abs=0.1)
    assert share[row] @ np.arange(share.shape[1]) / share[row].sum() == pytest.approx((u_left + u_right) / 2, abs=0.1)


def test_robot_in_front_hides_the_post():
    camera, pose = looking_at_goal(0.5, 0.0, 0.05, 0.0)
    shine = Glare(1, "positive_y", 0.5, 100.0, 0.0, 100.0, BRIGHT)
    hiding = pose.transform([1.0, math.tan(math.atan2(0.45, 2.2)) * 1.0])
    scene = Scene(FIELD, robots=(Robot(*map(float, hiding), 0.2, 0.6),), room=ROOM)
    assert render_pinhole(camera, scene, pose, glare=(shine,)).max() < BRIGHT / 10


@pytest.mark.slow
def test_glare_stays_on_its_member_of_its_goal_and_turns_paint_white():
    """Only this finds glare on the wrong member, or that leaves paint its colour."""
    camera, pose = looking_at_goal(1.0, 0.0, 0.05, 0.0)
    scene = Scene(FIELD, room=ROOM)
    dark = bare(camera, pose)
    lit = render_pinhole(camera, scene, pose, glare=(Glare(1, "bar", 0.25, 0.1, 0.0, 0.5, 250.0),))
    added = (lit - dark)[..., 0]
    rows, columns = np.nonzero(added > 1)
    middle = seen_at(camera, pose, np.array([[GOAL.line_x_m, -GOAL.width_m / 4, GOAL.height_m]]))[0]
    np.testing.assert_allclose([columns.mean(), rows.mean()], middle, atol=2.0)
    assert lit[rows, columns].min(axis=1).max() > 230
    other = render_pinhole(camera, scene, pose, glare=(Glare(-1, "bar", 0.25, 0.1, 0.0, 0.5, 250.0),))
    np.testing.assert_array_equal(other, dark)


def test_sunlight_falls_where_its_beam_goes():
    camera, pose = looking_at_goal(0.5, 0.0, -0.1, 0.0)
    scene = Scene(FIELD, room=ROOM)
    patch = SunPatch(1.5, 0.0, 0.0, 0.4, 0.4, 0.0, 1.0, 2.0)
    gain = render_pinhole(camera, scene, pose, sun=(patch,)) / np.maximum(render_pinhole(camera, scene, pose), 1.0)
    inside, outside = seen_at(camera, pose, np.array([[1.5, 0.05, 0.0], [1.5, 0.4, 0.0]]))
    assert gain[round(inside[1]), round(inside[0])] == pytest.approx([2.0] * 3, rel=0.02)
    assert gain[round(outside[1]), round(outside[0])] == pytest.approx([1.0] * 3, rel=0.02)


@pytest.mark.slow
def test_backdrop_hangs_behind_everything_and_repeats():
    """Only this finds a backdrop that hides the field, or differs from frame to frame."""
    camera, pose = looking_at_goal(1.0, 0.0, 0.1, 0.0)
    scene = Scene(FIELD, room=ROOM)
    plain, hall, again = (
        render_pinhole(camera, scene, pose, backdrop=Backdrop(kind, seed=3)) for kind in ("plain", "hall", "hall")
    )
    np.testing.assert_array_equal(hall, again)
    changed = np.abs(plain - hall).max(axis=2) > 1
    assert changed[:30].mean() > 0.5
    assert not changed[-30:].any()


@given(numbers(0.0, 9.0))
def test_smear_keeps_the_light_and_widens_along_rows_by_a_boxs_variance(length: float):
    image = np.zeros((9, 41, 3), dtype=np.float32)
    image[4, 20] = 1.0
    smeared = smear(image, length)[..., 0]
    assert smeared.sum() == pytest.approx(1.0, rel=1e-5)
    assert smeared[4].sum() == pytest.approx(1.0, rel=1e-5)
    u = np.arange(41) - 20
    assert smeared[4] @ u == pytest.approx(0.0, abs=1e-4)
    assert smeared[4] @ u**2 == pytest.approx(length**2 / 12, abs=1e-3)


def test_what_cannot_be_rendered_is_refused():
    scene, pose = Scene(FIELD), Pose2(0.0, 0.0, 0.0)
    with pytest.raises(ArgumentError, match="tilt_rad is unknown"):
        render_pinhole(ers7_camera(), scene, pose)
    level = ers7_camera().with_orientation(0.0, 0.0, 0.0)
    with pytest.raises(ArgumentError, match="supersample must be at least 2, got 1"):
        render_pinhole(level, scene, pose, supersample=1)
    folded = dataclasses.replace(level, distortion=(-2.0, 0.0, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="distortion leaves part of the image without rays"):
        render_pinhole(folded, scene, pose)


def test_a_backdrop_without_points_has_no_colors():
    """A camera that looks down shows none of the room's wall."""
    nothing = np.empty(0, dtype=np.float32)
    assert Backdrop("hall", seed=1).colors(nothing, nothing, nothing).shape == (0, 3)


POSE = Pose2(0.4, -0.3, 0.6)
MOUNTING = {"pan_rad": 0.0, "tilt_rad": -0.2, "roll_rad": 0.05}


def frame(camera):
    scene = Scene(load_field("four_legged_2007"), room=Room(3, bystanders=0))
    return render_pinhole(camera, scene, POSE, supersample=4)


def test_a_lens_shows_what_a_pinhole_camera_sees_where_it_says_and_nothing_beyond_its_circle():
    fisheye = FisheyeCamera(
        (200, 180), (90.0, 90.0), (99.5, 89.5), 0.4, projection="equidistant", usable_radius_px=(0.0, 85.0), **MOUNTING
    )
    pinhole = PinholeCamera((161, 121), (150.0, 150.0), (80.0, 60.0), 0.4, **MOUNTING)
    bent, straight = frame(fisheye), frame(pinhole)
    dark = dark_pixels(fisheye)
    assert 0.3 < dark.mean() < 0.5
    assert not bent[dark].any()
    assert bent[~dark].any(axis=-1).all()
    u, v = np.meshgrid(np.arange(5, 156, 10), np.arange(5, 116, 10))
    places = np.stack([u, v], axis=-1).reshape(-1, 2)
    at = np.rint(fisheye.ray_to_pixel(pinhole.pixel_to_ray(places))).astype(int)
    # a pixel of the fisheye covers four of the other, some of them at edges
    off = np.abs(bent[at[:, 1], at[:, 0]] - straight[places[:, 1], places[:, 0]]).max(axis=-1)
    assert np.median(off) < 4.0
