"""Line points found in painted pictures lie on the lines; what is no line yields none."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from field_models import ArgumentError, load_field
from robocup_vision.camera import OmniCamera, Tangent
from robocup_vision.geometry import Pose2
from robocup_vision.localization.line_map import LineMap
from robocup_vision.perception.line_points import LineFinder, LinePoints

FIELD = load_field("msl_6x4")
POSE = Pose2(-0.7, 0.4, 0.5)


@pytest.fixture(scope="module")
def finder(mirror_camera):
    return LineFinder(mirror_camera, FIELD.line_width_m)


def errors_m(points, pose):
    return LineMap(FIELD).nearest(pose.transform(points.floor_m)).distance_m


@pytest.mark.parametrize(("gain", "noise"), [(1.0, 0.0), (1.0, 8.0), (0.4, 4.0)])
def test_points_lie_on_the_lines(finder, mirror_camera, paint_field, gain, noise):
    frame = paint_field(mirror_camera, FIELD, POSE, gain=gain, noise=noise, rng=np.random.default_rng(1))
    points = finder.find(frame)
    assert len(points) > 300
    error = errors_m(points, POSE)
    assert np.median(error) < 0.006
    assert np.mean(error < 0.05) > 0.97


@pytest.mark.parametrize("inner_px", [None, 4.0])
def test_points_lie_on_the_lines_of_a_carpet_so_green_that_its_red_and_blue_are_next_to_black(
    mirror_camera, paint_field, inner_px
):
    camera = mirror_camera
    if inner_px is not None:
        # a camera nobody has calibrated: the black of the robot's body is looked at, too
        camera = replace(camera, usable_radius_px=(inner_px, camera.usable_radius_px[1]))
    frame = paint_field(mirror_camera, FIELD, POSE).astype(np.float64)
    is_carpet = frame.min(axis=2) < 100
    frame[is_carpet] *= (0.08, 1.0, 0.12)
    height, width = is_carpet.shape
    v, u = np.mgrid[:height, :width]
    frame[np.hypot(u - camera.center_px[0], v - camera.center_px[1]) < mirror_camera.usable_radius_px[0]] = 8
    frame += np.random.default_rng(2).normal(0.0, 4.0, frame.shape)
    points = LineFinder(camera, FIELD.line_width_m).find(np.clip(np.round(frame), 0, 255).astype(np.uint8))
    assert len(points) > 300
    error = errors_m(points, POSE)
    assert np.median(error) < 0.006
    assert np.mean(error < 0.05) > 0.97
    assert np.mean(points.weight == 1) > 0.7


def test_every_line_in_view_is_found(finder, mirror_camera, paint_field):
    points = finder.find(paint_field(mirror_camera, FIELD, POSE))
    found = POSE.transform(points.floor_m)
    model = FIELD.line_points(0.1)
    pixel = mirror_camera.floor_to_pixel(POSE.inverse().transform(model))
    radius = np.hypot(*(pixel - mirror_camera.center_px).T)
    model = model[(radius > 30) & (radius < 80)]
    gap = np.linalg.norm(model[:, None] - found[None], axis=-1).min(axis=1)
    assert np.mean(gap < 0.1) > 0.9


def test_a_line_where_the_carpet_ends_is_found_and_weighs_less(finder, mirror_camera, paint_field):
    points = finder.find(paint_field(mirror_camera, FIELD, POSE, margin_m=FIELD.line_width_m / 2))
    on_edge = (np.abs(np.abs(POSE.transform(points.floor_m)) - (3.0, 2.0)) < 0.04).any(axis=1)
    assert np.count_nonzero(on_edge) > 50
    assert np.mean(points.weight[on_edge] < 1) > 0.8
    off_edge = (np.abs(np.abs(POSE.transform(points.floor_m)) - (3.0, 2.0)) > 0.2).all(axis=1)
    assert np.mean(points.weight[off_edge] == 1) > 0.7


def test_the_carpet_is_distinguished_from_a_grey_hall_floor_that_fills_more_of_the_ring(
    finder, mirror_camera, paint_field
):
    pose = Pose2(-2.9, 2.0, 0.3)
    points = finder.find(paint_field(mirror_camera, FIELD, pose, margin_m=0.15))
    assert len(points) > 100
    assert np.median(errors_m(points, pose)) < 0.01


def test_what_is_grey_is_no_carpet_however_the_carpet_varies(finder, mirror_camera, paint_field):
    rng = np.random.default_rng(5)
    frame = paint_field(mirror_camera, FIELD, POSE).astype(np.float64)
    height, width = frame.shape[:2]
    is_carpet = frame.min(axis=2) < 100
    # light of many colours on a carpet that is three parts green to two parts each of the others
    light = cv2.resize(rng.uniform(0.75, 1.25, (8, 10, 3)), (width, height), interpolation=cv2.INTER_CUBIC)
    frame[is_carpet] = (np.array([80.0, 120.0, 80.0]) * light)[is_carpet]
    v, u = np.mgrid[:height, :width]
    around = np.hypot(u - mirror_camera.center_px[0], v - mirror_camera.center_px[1]) > 80
    frame[around] = 60.0
    frame[around & ((u + v) % 12 < 2)] = 130.0
    points = finder.find(np.clip(np.round(frame + rng.normal(0.0, 2.0, frame.shape)), 0, 255).astype(np.uint8))
    is_far = np.hypot(*(points.pixels - mirror_camera.center_px).T) > 84
    assert not np.any(points.weight[is_far] == 1)
    assert np.median(errors_m(points.take(~is_far), POSE)) < 0.02


def test_bare_floor_holds_no_line(finder, mirror_camera, paint_field):
    points = finder.find(paint_field(mirror_camera, FIELD, POSE))
    v, u = np.nonzero(points.bare_floor)
    bare = POSE.transform(mirror_camera.pixel_to_floor(np.stack([u, v], axis=1)))
    assert len(bare) > 1000
    assert LineMap(FIELD).nearest(bare).distance_m.min() > FIELD.line_width_m / 2


def test_masked_pixels_are_never_points(mirror_camera, paint_field):
    mask = np.zeros((240, 320), dtype=np.uint8)
    mask[:, 160:] = 255
    points = LineFinder(mirror_camera, FIELD.line_width_m, mask).find(paint_field(mirror_camera, FIELD, POSE))
    assert len(points) > 100
    assert points.pixels[:, 0].max() < 161


@pytest.mark.parametrize("kind", ["black", "white", "grey", "noise"])
def test_frames_without_lines_yield_no_points_or_few(finder, kind):
    rng = np.random.default_rng(0)
    level = {"black": 0, "white": 255, "grey": 128}.get(kind)
    frame = rng.integers(0, 256, (240, 320, 3), dtype=np.uint8)
    if level is not None:
        frame[:] = level
    assert len(finder.find(frame)) <= 5


def test_line_points_of_unequal_length_are_refused():
    with pytest.raises(ArgumentError, match="floor_m must be"):
        LinePoints(np.zeros((2, 2)), np.zeros((3, 2)), np.zeros((2, 2, 2)), np.ones(2))


def test_from_pixels_gives_floor_and_its_derivative(mirror_camera):
    pixels = np.array([[100.0, 90.0], [200.0, 150.0], [5.0, 5.0]])
    camera = OmniCamera((320, 240), (160.0, 120.0), (20.0, 110.0), Tangent(2.0, 0.0114))
    points = LinePoints.from_pixels(camera, pixels)
    assert len(points) == 2  # the last one lies beyond the horizon
    moved = camera.pixel_to_floor(points.pixels + np.array([0.1, -0.2]))
    expected = points.floor_m + points.floor_per_px @ (0.1, -0.2)
    np.testing.assert_allclose(moved, expected, atol=1e-4)
    assert not points.floor_m.flags.writeable
    assert len(points.take(np.array([1]))) == 1
    assert math.isclose(points.weight.sum(), 2.0)
