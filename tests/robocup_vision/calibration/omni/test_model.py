"""Vectors and cameras: every curve goes there and back, and every family starts near what it starts from."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.calibration.omni.model import (
    BENDS,
    CENTER,
    CURVES,
    HORIZON,
    SCALE,
    TILT,
    BentCurve,
    CameraModel,
    hyperboloid_of,
    scale_and_horizon,
    tangent_of,
)
from robocup_vision.camera import OmniCamera, Table, Tangent, load_camera, save_camera
from sim2d.rendering.cameras import sekimori_camera

USABLE = (26.0, 110.0)
scales = st.floats(20.0, 1000.0)
horizons = st.floats(60.0, 400.0)


@given(scales, horizons, st.floats(0.3, 30.0))
def test_hyperboloid_has_the_scale_and_horizon_asked_for(scale, horizon, root):
    curve = hyperboloid_of(scale, horizon, root * horizon)
    assert scale_and_horizon(curve, USABLE) == pytest.approx((scale, horizon), rel=1e-6)
    assert curve.inverse_range_per_m(horizon) == pytest.approx(0.0, abs=1e-6 * scale / horizon)
    assert curve.inverse_range_per_m(1e-3) == pytest.approx(scale / 1e-3, rel=1e-4)


@given(scales, horizons)
def test_tangent_has_the_scale_and_horizon_asked_for(scale, horizon):
    assert scale_and_horizon(tangent_of(scale, horizon), USABLE) == pytest.approx((scale, horizon))


def test_scale_and_horizon_of_a_table_are_those_of_the_curve_it_was_made_of():
    curve = hyperboloid_of(270.0, 114.0, 900.0)
    radius = np.linspace(15, 112, 80)
    table = Table(radius, 1 / curve.inverse_range_per_m(radius))
    assert scale_and_horizon(table, USABLE) == pytest.approx((270, 114), rel=0.02)


def test_scale_and_horizon_of_a_table_without_a_horizon_are_finite():
    table = Table(np.array([10.0, 50.0, 120.0]), np.array([0.1, 0.2, 0.3]))
    scale, horizon = scale_and_horizon(table, USABLE)
    assert scale > 0
    assert horizon >= USABLE[1]


@pytest.mark.parametrize("curve", CURVES)
def test_vector_and_camera_go_there_and_back(curve):
    frame = dataclasses.replace(
        sekimori_camera(), tilt_rad=(0.01, -0.02), heading_rad=0.3, mirrored=True, viewpoint_height_m=0.31
    )
    model = CameraModel(frame, curve)
    vector = model.vector(frame)
    assert len(vector) == model.size == len(model.prior_std())
    vector[CENTER] += (0.5, -1.0)
    vector[SCALE] += 0.1
    vector[HORIZON] -= 0.05
    camera = model.camera(vector)
    assert camera.center_px == (128.0, 108.5)
    assert camera.tilt_rad == frame.tilt_rad
    assert (camera.heading_rad, camera.mirrored, camera.size_px) == (0.3, True, (256, 220))
    # somebody measured it
    assert camera.height_m == model.written(vector).height_m == 0.31
    again = CameraModel(camera, curve).vector(camera)
    np.testing.assert_allclose(
        again[: 7 if curve == "hyperboloid" else 4], vector[: 7 if curve == "hyperboloid" else 4]
    )


def test_a_magnified_curve_is_of_its_family():
    table = Table(np.array([20.0, 60.0, 110.0]), np.array([0.1, 0.4, 3.0]))
    frame = OmniCamera((256, 220), (127.5, 109.5), (26.0, 105.0), table)
    model = CameraModel(frame, "magnified")
    np.testing.assert_array_equal(model.vector(frame), [127.5, 109.5, 0.0, 0.0, 0.0])
    camera = model.camera(np.array([128.0, 110.0, 0.01, 0.0, math.log(1.02)]))
    assert isinstance(camera.floor_range, Table)
    np.testing.assert_allclose(camera.floor_range.table_radius_px, 1.02 * table.table_radius_px)
    np.testing.assert_array_equal(camera.floor_range.table_range_m, table.table_range_m)
    assert camera.center_px == (128.0, 110.0)
    assert camera.tilt_rad == (0.01, 0.0)
    assert camera.height_m is not None


@given(st.lists(st.floats(-0.05, 0.05), min_size=BENDS, max_size=BENDS))
def test_a_bent_curve_is_inverted(stretch):
    curve = BentCurve(hyperboloid_of(270.0, 114.0, 500.0), np.linspace(*USABLE, BENDS), np.array(stretch))
    radius = np.linspace(28, 100, 20)
    np.testing.assert_allclose(curve.radius_px(curve.inverse_range_per_m(radius)), radius, atol=0.02)
    assert curve.implied_height_m == curve.base.implied_height_m


def kinked_camera():
    """Return a mirror of two zones by its table: 12 px a step within 70 px, 5 px beyond."""
    radius = np.array([22.0, 34.0, 46.0, 58.0, 70.0, 75.0, 80.0, 85.0, 90.0, 95.0, 100.0, 105.0, 108.0])
    table = Table(radius, 0.1 + 0.25 * np.arange(len(radius)))
    return OmniCamera((256, 220), (127.5, 109.5), USABLE, table)


@pytest.mark.parametrize(("curve", "frame"), [("table", sekimori_camera()), ("own", kinked_camera())])
def test_a_stretched_curve_starts_as_it_is(curve, frame):
    model = CameraModel(frame, curve)
    vector = model.vector(frame)
    assert len(vector) == model.size == len(model.prior_std())
    radius = np.linspace(22.0, 108.0, 50)
    np.testing.assert_allclose(
        model.camera(vector).floor_range.inverse_range_per_m(radius),
        frame.floor_range.inverse_range_per_m(radius),
        rtol=1e-9,
    )


@given(st.floats(0.7, 1.4), st.floats(0.8, 1.25))
def test_an_own_table_grows_in_the_image_and_on_the_floor(larger, farther):
    frame = kinked_camera()
    model = CameraModel(frame, "own")
    vector = model.vector(frame)
    vector[HORIZON] += math.log(larger)
    vector[SCALE] += math.log(larger / farther)
    curve = model.camera(vector).floor_range
    radius = np.linspace(30.0, 100.0, 20)
    np.testing.assert_allclose(
        curve.inverse_range_per_m(radius * larger), frame.floor_range.inverse_range_per_m(radius) / farther, rtol=1e-9
    )


@given(st.lists(st.floats(-0.02, 0.02), min_size=BENDS, max_size=BENDS))
def test_a_stretched_table_keeps_its_kink_when_written(stretch):
    frame = kinked_camera()
    model = CameraModel(frame, "own")
    vector = model.vector(frame)
    vector[6:] = stretch
    written = model.written(vector).floor_range
    assert isinstance(written, Table)
    before, kink, after = written.radius_px(1 / np.array([0.85, 1.1, 1.35]))
    assert kink == pytest.approx(70.0, rel=0.03)
    assert kink - before > 1.5 * (after - kink)
    inside = np.linspace(*USABLE, 30)
    np.testing.assert_allclose(
        written.inverse_range_per_m(inside), model.camera(vector).floor_range.inverse_range_per_m(inside), rtol=0.02
    )


def test_an_own_table_goes_on_beyond_its_rows_and_never_reaches_the_horizon():
    radius = np.linspace(30.0, 111.0, 80)
    whole = hyperboloid_of(270.0, 114.0, 900.0)
    frame = dataclasses.replace(kinked_camera(), floor_range=Table(radius, 1 / whole.inverse_range_per_m(radius)))
    model = CameraModel(frame, "own")
    curve = model.camera(model.vector(frame)).floor_range
    assert curve.inverse_range_per_m(28.0) == pytest.approx(float(whole.inverse_range_per_m(28.0)), rel=0.02)
    assert curve.inverse_range_per_m(111.5) == pytest.approx(float(whole.inverse_range_per_m(111.5)), rel=0.02)
    far = curve.inverse_range_per_m(np.linspace(111.0, 125.0, 50))
    assert np.all(np.isnan(far) | (far > 0))


def test_only_a_table_is_stretched_as_it_is():
    frame = sekimori_camera()
    with pytest.raises(ArgumentError, match="only a table can be stretched as it is, got a Hyperboloid"):
        CameraModel(frame, "own").camera(np.zeros(6 + BENDS))


def test_a_written_table_passes_the_camera_file_s_checks(tmp_path):
    frame = sekimori_camera()
    model = CameraModel(frame, "table")
    vector = model.vector(frame)
    vector[7:] = 0.02 * np.sin(np.arange(BENDS))
    written = model.written(vector)
    assert isinstance(written.floor_range, Table)
    save_camera(written, tmp_path / "camera.toml")
    loaded = load_camera(tmp_path / "camera.toml")
    pixels = written.polar_to_pixel(np.arange(6)[:, None], np.linspace(27, 105, 8)[None]).reshape(-1, 2)
    np.testing.assert_allclose(loaded.pixel_to_floor(pixels), model.camera(vector).pixel_to_floor(pixels), rtol=0.01)


def test_a_tangent_gets_a_height_so_that_it_may_tilt():
    frame = OmniCamera((640, 480), (319.5, 239.5), (40.0, 190.0), Tangent(2.1, 0.0057))
    model = CameraModel(frame, "tangent")
    vector = model.vector(frame)
    vector[TILT] = 0.01
    assert model.camera(vector).height_m == pytest.approx(math.exp(vector[HORIZON] - vector[SCALE]) / 2)
    assert model.written(vector).tilt_rad == (0.01, 0.01)
