"""Points held out of a fit are in every frame; a mirror is bent, or kinked as its table, where the evidence says so."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.calibration.omni.choice import Chooser, halves
from robocup_vision.calibration.omni.fit import Fit, JointFit, Points
from robocup_vision.calibration.omni.model import BentCurve, CameraModel
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.calibration.omni.shape import FieldShape
from robocup_vision.camera import Table
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera

FIELD = load_field("msl_6x4")
POSE = Pose2(0.4, -0.3, 0.7)
STRETCH = np.array([0.0, 0.02, -0.02, 0.015, -0.015, 0.0])


def camera_of(curve):
    camera = sekimori_camera()
    mirror = camera.floor_range
    if curve == "bent":
        curve = BentCurve(mirror, np.linspace(*camera.usable_radius_px, len(STRETCH)), STRETCH)
    elif curve == "kinked":
        radius = np.linspace(15.0, 108.0, 40)
        range_m = 1.0 / mirror.inverse_range_per_m(radius)
        curve = Table(radius, np.where(radius > 60.0, range_m * (radius / 60.0) ** 0.8, range_m))
    else:
        curve = mirror
    return dataclasses.replace(camera, floor_range=curve, viewpoint_height_m=0.2)


def chooser_of(true, start, family, noise_px=0.2):
    """Fit points of the lines that a true camera shows, from a start of a family."""
    lines = POSE.inverse().transform(FIELD.line_points(0.02))
    pixels = true.floor_to_pixel(lines[np.hypot(*lines.T) < 2.0])
    radius = np.hypot(*(pixels - true.center_px).T)
    pixels = pixels[(radius > true.usable_radius_px[0]) & (radius < 107.0)]
    pixels += np.random.default_rng(3).normal(0.0, noise_px, pixels.shape)
    count = len(pixels)
    points = Points(pixels, np.zeros(count, dtype=np.int64), np.ones(count, dtype=bool), np.ones(count))
    model = CameraModel(start, family)
    fit = Fit(model, model.vector(start), POSE.array[None], 0.0, np.zeros(count))
    settings = OmniCalibrationSettings()
    return Chooser(FieldShape(FIELD, settings.fit), points, fit, (20.0, 0.7, 0.7), 1.0, settings)


@pytest.mark.parametrize(
    ("true", "start", "family", "chosen"),
    [
        ("smooth", "smooth", "hyperboloid", "hyperboloid"),
        ("bent", "smooth", "hyperboloid", "table"),
        ("kinked", "kinked", "own", "own"),
        ("smooth", "kinked", "own", "hyperboloid"),
    ],
)
def test_evidence_chooses_the_curve_by_lines(true, start, family, chosen):
    assert chooser_of(camera_of(true), camera_of(start), family).choose()[0].curve == chosen


def test_information_is_the_curvature_of_the_likelihood_where_nothing_else_is_unknown():
    camera = camera_of("bent")
    chooser = chooser_of(camera, camera_of("smooth"), "hyperboloid", 0.0)
    model = CameraModel(camera, "table")
    vector = model.vector(camera_of("smooth"))
    vector[model.bends] = STRETCH
    settings = OmniCalibrationSettings()
    # lines that lie where they should, and a prior that leaves nothing but the bends
    tight = dataclasses.replace(settings.fit, paint_std_widths=1e-9)
    model = dataclasses.replace(
        model, settings=dataclasses.replace(settings.model, center_std_ratio=1e-9, tilt_std_rad=1e-9, shape_std=1e-9)
    )
    joint = JointFit(FieldShape(FIELD, tight), chooser.points, tight)

    def at(stretch):
        moved = vector.copy()
        moved[model.bends] = stretch
        residual = joint.residuals(model.camera(moved), POSE.array[None])
        return Fit(model, moved, POSE.array[None], 0.0, residual)

    width_px, step = 0.5, 1e-4
    information = joint.information(at(STRETCH), width_px, model.bends)
    one = np.eye(len(STRETCH))[2]
    highest = joint.log_likelihood(at(STRETCH), width_px)
    beside = [joint.log_likelihood(at(STRETCH + sign * step * one), width_px) for sign in (-1, 1)]
    curvature = (2 * highest - sum(beside)) / step**2
    # what pose, scale and horizon explain as well is no information
    assert 0 < information[2, 2] < 1.05 * curvature
    np.testing.assert_allclose(information, information.T, rtol=1e-6, atol=1e-6 * information.max())
    assert np.linalg.eigvalsh(information).min() > -1e-6 * information.max()


@given(st.lists(st.lists(st.integers(0, 31), min_size=2, max_size=20), min_size=1, max_size=4))
def test_every_frame_has_points_in_both_halves(sectors):
    frame = np.concatenate([np.full(len(own), index) for index, own in enumerate(sectors)])
    sector = np.concatenate(sectors)
    half = halves(sector, frame)
    for index, own in enumerate(sectors):
        assert set(half[frame == index].tolist()) == {0, 1}
        if len({one % 2 for one in own}) == 2:
            np.testing.assert_array_equal(half[frame == index], np.array(own) % 2)
