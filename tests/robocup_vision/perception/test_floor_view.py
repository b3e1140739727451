"""Floor samples of a pinhole camera that nods and rolls with its body."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.vision import Vision
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Robot, Scene

CAMERA = PinholeCamera(
    (208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.4, tilt_rad=-0.17, roll_rad=0.0, roll_std_rad=0.03
)


@pytest.mark.parametrize("distortion", [(), (-0.3, 0.1, 0.001, 0.0), (0.1, 0.02, 0.0, 0.001, 0.0, 0.2, 0.05, 0.01)])
@pytest.mark.parametrize(("nod_rad", "roll_rad"), [(0.03, 0.0), (-0.03, 0.02), (0.0, -0.05)])
def test_a_turned_view_samples_the_same_floor(nod_rad, roll_rad, distortion):
    camera = replace(CAMERA, distortion=distortion)
    view = FloorView(camera)
    held = replace(camera, tilt_rad=camera.tilt_rad + nod_rad, roll_rad=roll_rad)
    turned = view.held(held)
    np.testing.assert_array_equal(turned.floor_m, view.floor_m)
    expected = held.floor_to_pixel(view.floor_m.reshape(-1, 2)).reshape(view.floor_m.shape)
    shown = np.isfinite(expected).all(axis=-1) & (expected >= 0).all(axis=-1) & (expected <= (207, 159)).all(axis=-1)
    assert shown.sum() > 0.3 * shown.size
    np.testing.assert_allclose(turned.pixels[shown], expected[shown], atol=1e-6)
    frame = np.random.default_rng(0).integers(0, 256, (160, 208, 3), dtype=np.uint8)
    sampled = turned.sample(frame)
    inside = ((turned.pixels >= 0) & (turned.pixels <= (207, 159))).all(axis=-1)
    # what lies beyond a lens is not shown, but it may look as if
    assert np.mean(turned.shown[view.valid > 0] == inside[view.valid > 0]) > 0.99
    u, v = np.moveaxis(np.rint(np.nan_to_num(expected)).clip(0, (207, 159)).astype(int), -1, 0)
    # each is the mean of nine neighbours, all of them in the picture
    means = cv2.blur(frame[v, u], (3, 3), borderType=cv2.BORDER_REPLICATE)
    amid = cv2.erode(shown.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    amid[view.seen_bearings - 1 :] = False
    assert (sampled == means)[amid].all(axis=-1).mean() > 0.99


def test_a_panned_view_shows_the_same_pixels_elsewhere():
    view = FloorView(CAMERA)
    turned = view.held(CAMERA.with_orientation(0.1, CAMERA.tilt_rad, CAMERA.roll_rad))
    made = FloorView(turned.camera)
    for name in ("bearing_rad", "span_rad", "floor_m", "valid", "range_m"):
        np.testing.assert_allclose(getattr(turned, name), getattr(made, name), atol=1e-9)
    np.testing.assert_allclose(turned.pixels, made.pixels, atol=1e-6)
    columns = np.arange(view.bearings) % len(view.radius_px)
    np.testing.assert_allclose(turned.floor_at(columns), turned.floor_m[np.arange(view.bearings), columns], atol=1e-12)


@pytest.mark.parametrize("pan_rad", [-0.7, 0.4])
def test_what_a_camera_beside_the_robots_centre_has_in_view_is_worked_out_again_for_another_pan(pan_rad):
    camera = replace(CAMERA, pan_rad=0.0, offset_m=(0.08, -0.02))
    panned = FloorView(camera).panned(camera.with_orientation(pan_rad, camera.tilt_rad, camera.roll_rad))
    made = FloorView(panned.camera)
    assert made.span_rad != pytest.approx(np.add(FloorView(camera).span_rad, (pan_rad, 0.0)), abs=1e-3)
    for name in ("bearing_rad", "span_rad", "floor_m", "valid", "range_m"):
        np.testing.assert_allclose(getattr(panned, name), getattr(made, name), atol=1e-9)


@pytest.mark.parametrize("nod_rad", [-0.03, 0.0, 0.03])
def test_a_nod_that_moves_the_robots_own_body_over_the_floor_blocks_nothing(nod_rad):
    field = load_field("four_legged_2007")
    camera, mask = replace(CAMERA, pan_rad=0.0), np.zeros((160, 208), dtype=np.uint8)
    mask[135:, 60:150] = 255
    light = render_pinhole(
        replace(camera, tilt_rad=camera.tilt_rad + nod_rad), Scene(field, carpet_margin_m=0.2), Pose2(-0.5, -0.2, 0.0)
    )
    frame = np.clip(light, 0, 255).astype(np.uint8)
    frame[mask > 0] = 20
    view = Vision(field, camera, mask=mask).look(frame, prior=Pose2(-0.47, -0.22, 0.02))
    assert view.pose
    assert view.free_space.range_m.min() > 0.8


def test_free_space_goes_by_the_tilt_that_the_frame_shows():
    field = load_field("four_legged_2007")
    camera = replace(CAMERA, pan_rad=0.0)
    ahead_m = 1.2
    scene = Scene(field, robots=(Robot(-0.5 + ahead_m + 0.12, -0.2, 0.12, 0.25),), carpet_margin_m=0.2)
    vision = Vision(field, camera, rings=80)
    measured = []
    for nod_rad in (-0.025, 0.0, 0.025):
        nodding = replace(camera, tilt_rad=camera.tilt_rad + nod_rad)
        light = render_pinhole(nodding, scene, Pose2(-0.5, -0.2, 0.0), supersample=2)
        vision.forget()
        view = vision.look(np.clip(light, 0, 255).astype(np.uint8), prior=Pose2(-0.47, -0.22, 0.02))
        assert view.pose
        assert view.camera.tilt_rad == pytest.approx(nodding.tilt_rad, abs=math.radians(0.3))
        bearing = np.argmin(np.abs(view.free_space.bearing_rad))
        measured.append(float(view.free_space.range_m[bearing]))
    # by the file's tilt a nod of 1.4 degrees makes 1.0 or 1.5 m of it
    np.testing.assert_allclose(measured, ahead_m, rtol=0.06)


def fisheye(circle_px):
    return FisheyeCamera(
        (304, 400),
        (163.0, 163.0),
        (151.5, 199.5),
        0.75,
        pan_rad=0.0,
        tilt_rad=0.0,
        roll_rad=0.0,
        projection="equidistant",
        usable_radius_px=(0.0, circle_px),
    )


def test_a_fisheye_looks_as_near_as_its_circle_shows():
    view = FloorView(fisheye(190.0))
    # straight down the picture the circle ends so far off the axis
    assert view.range_m[0] == pytest.approx(0.75 / math.tan(190.0 / 163.0), rel=0.01)
    assert view.valid[view.seen_bearings // 2, 1:50].all()


def test_floor_begins_beyond_the_robots_own_parts_that_a_mask_hides():
    mask = np.zeros((400, 304), dtype=np.uint8)
    mask[360:] = 255
    view = FloorView(fisheye(190.0), mask=mask)
    # within the pixels by which it is told
    nearest_m = [0.75 / math.tan((row - 199.5) / 163.0) for row in (360.0, 356.0)]
    assert nearest_m[0] <= view.range_m[0] <= 1.001 * nearest_m[1]
    nothing = FloorView(fisheye(190.0), mask=np.full((400, 304), 255, dtype=np.uint8))
    assert not nothing.valid.any()
