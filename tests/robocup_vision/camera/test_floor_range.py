"""The laws every floor-range curve keeps: inverse of each other, monotone, a horizon, scaling with the image."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import PAPER_HORIZON_PX, PAPER_MIRROR, curves, numbers

from field_models.errors import ArgumentError
from robocup_vision.camera import FloorRange, Hyperboloid, Table, Tangent
from robocup_vision.camera.floor_range import magnified

RADII = np.linspace(26.0, 112.0, 87)


@given(curves())
def test_radius_and_inverse_range_are_inverse_of_each_other(curve: FloorRange):
    q = curve.inverse_range_per_m(RADII)
    np.testing.assert_allclose(curve.radius_px(q), RADII, rtol=1e-9)


@given(curves())
def test_range_grows_strictly_with_the_image_radius(curve: FloorRange):
    q = curve.inverse_range_per_m(RADII)
    assert np.all(q > 0)
    assert np.all(np.diff(q) < 0)


@given(curves(), st.sampled_from([(), (3,), (2, 1, 4)]))
def test_any_shape_goes_through(curve: FloorRange, shape: tuple[int, ...]):
    q = curve.inverse_range_per_m(np.full(shape, 50.0))
    assert np.shape(q) == shape
    assert np.shape(curve.radius_px(q)) == shape


def test_papers_mirror_as_printed():
    # r = R / (A - B sqrt(C + R^2)) in millimetres with the paper's constants; horizon at 113.8 px, viewpoint 205 mm
    mm = 80.0 / (10.12 - 2.054e-2 * math.sqrt(2.298e5 + 80.0**2))
    assert 1 / PAPER_MIRROR.inverse_range_per_m(80.0) == pytest.approx(mm / 1000, rel=1e-9)
    assert pytest.approx(113.8, abs=0.1) == PAPER_HORIZON_PX
    assert PAPER_MIRROR.implied_height_m == pytest.approx(0.205, abs=0.001)


@pytest.mark.parametrize(
    ("curve", "horizon_px"), [(PAPER_MIRROR, PAPER_HORIZON_PX), (Tangent(2.0, 0.006), math.pi / 2 / 0.006)]
)
def test_inverse_range_passes_smoothly_through_the_horizon(curve: FloorRange, horizon_px: float):
    below, at, above = curve.inverse_range_per_m(horizon_px + np.array([-1.0, 0.0, 1.0]))
    assert below > 0 > above
    assert at == pytest.approx(0.0, abs=1e-9)
    assert below == pytest.approx(-above, rel=0.05)
    assert curve.radius_px(0.0) == pytest.approx(horizon_px)


@pytest.mark.parametrize("curve", [PAPER_MIRROR, Tangent(2.0, 0.006)])
def test_the_middle_of_the_image_looks_straight_down(curve: FloorRange):
    assert curve.inverse_range_per_m(0.0) == np.inf
    assert curve.radius_px(np.inf) == 0.0


def test_hyperboloid_has_no_image_of_rays_steeper_up_than_its_asymptote():
    assert np.isnan(PAPER_MIRROR.radius_px(-1.001 * PAPER_MIRROR.B_per_m))
    assert PAPER_MIRROR.radius_px(-0.9 * PAPER_MIRROR.B_per_m) > PAPER_HORIZON_PX


def test_hyperboloid_that_shows_no_floor_implies_no_height():
    assert Hyperboloid(1.0, 1.0, 2.0).implied_height_m is None


def test_tangent_is_undefined_from_straight_up_on():
    assert np.isnan(Tangent(1.0, 0.01).inverse_range_per_m([-1.0, 315.0])).all()
    assert Tangent(2.0, 0.01).inverse_range_per_m(60.0) == pytest.approx(1 / (2.0 * math.tan(0.6)))
    assert Tangent(2.0, 0.01).implied_height_m is None


def test_table_passes_through_its_entries_and_ends_with_them():
    table = Table([30.0, 60.0, 90.0], [0.2, 0.7, 2.0])
    np.testing.assert_allclose(1 / table.inverse_range_per_m([30.0, 60.0, 90.0]), [0.2, 0.7, 2.0])
    assert 1 / table.inverse_range_per_m(45.0) == pytest.approx(1 / ((1 / 0.2 + 1 / 0.7) / 2))
    assert np.isnan(table.inverse_range_per_m([29.9, 90.1, 0.0, np.nan])).all()
    assert np.isnan(table.radius_px([5.01, 0.49, -1.0, np.inf, np.nan])).all()
    assert table.implied_height_m is None


def test_table_forgives_a_rounding_error_at_its_ends():
    table = Table([30.0, 90.0], [0.2, 2.0])
    np.testing.assert_allclose(table.inverse_range_per_m([30 - 1e-12, 90 + 1e-12]), [5.0, 0.5])
    np.testing.assert_allclose(table.radius_px([5 + 1e-14, 0.5 - 1e-14]), [30.0, 90.0])


def test_table_copies_its_arrays_and_nobody_can_write_to_them():
    radius = np.array([30.0, 90.0])
    table = Table(radius, np.array([0.2, 2.0]))
    radius[0] = 0.0
    assert table.table_radius_px[0] == 30.0
    with pytest.raises(ValueError, match="read-only"):
        table.table_range_m[0] = 1.0


@given(curves(), numbers(0.8, 1.25))
def test_a_magnified_curve_shows_the_same_floor_farther_out(curve: FloorRange, factor: float):
    larger = magnified(curve, factor)
    assert type(larger) is type(curve)
    np.testing.assert_allclose(
        larger.inverse_range_per_m(factor * RADII), curve.inverse_range_per_m(RADII), rtol=1e-9, atol=1e-12
    )
    if curve.implied_height_m is not None:
        assert larger.implied_height_m == pytest.approx(curve.implied_height_m)


def test_a_curve_of_no_known_family_cannot_be_magnified():
    with pytest.raises(ArgumentError, match="a str cannot be magnified"):
        magnified("curve", 1.1)  # type: ignore[arg-type]
