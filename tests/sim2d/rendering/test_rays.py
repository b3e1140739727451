"""Rays against formulas written down a second time."""

from __future__ import annotations

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.camera import OmniCamera, Tangent
from sim2d.rendering.cameras import camera_by_name, sekimori_camera
from sim2d.rendering.rays import MirrorRays, sample_offsets


def paper_range_m(radius_px: np.ndarray) -> np.ndarray:
    """Sekimori et al. 2001, eq. 26, in the paper's own millimetres."""
    return radius_px / (10.12 - 2.054e-2 * np.sqrt(2.298e5 + radius_px**2)) / 1000


def from_centre_px(rays: MirrorRays) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return how far the pixels lie to the right of the centre and below it, and their image radius."""
    v, u = np.divmod(rays.pixel_index, 256)
    return u - 127.5, v - 109.5, np.hypot(u - 127.5, v - 109.5)


def test_floor_distance_follows_the_paper():
    rays = MirrorRays(sekimori_camera(), 1)
    right, down, radius = from_centre_px(rays)
    floor = (radius > 27) & (radius < 112)
    bearing = np.arctan2(-down, right)
    x, y = rays.floor_m * rays.cos, rays.floor_m * rays.sin
    expected = paper_range_m(radius)
    np.testing.assert_allclose(x[floor], (expected * np.cos(bearing))[floor], rtol=2e-5, atol=1e-6)
    np.testing.assert_allclose(y[floor], (expected * np.sin(bearing))[floor], rtol=2e-5, atol=1e-6)


def test_viewpoint_is_the_focus_of_the_papers_mirror():
    rays = MirrorRays(sekimori_camera(), 1)
    assert rays.height_m == pytest.approx(0.205, abs=0.001)
    # level rays are those of the horizon at R = 113.8 px
    radius = from_centre_px(rays)[2]
    assert np.all(rays.slope[radius > 114.0] > 0)
    assert np.all(rays.slope[radius < 113.6] < 0)


def test_scaled_camera_sees_the_same_floor():
    small, large = sekimori_camera(), sekimori_camera(640, 480)
    place = np.array([[0.7, -0.3], [-1.2, 0.4]])
    scale = 480 / 220
    offset_small = small.floor_to_pixel(place) - small.center_px
    np.testing.assert_allclose(large.floor_to_pixel(place) - large.center_px, scale * offset_small, rtol=1e-9)
    assert large.height_m == pytest.approx(small.height_m)
    assert large.center_px == (319.5, 239.5)


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_samples_cover_a_pixel_evenly(n: int):
    offsets = sample_offsets(n)
    steps = (np.arange(n * n) + 0.5) / n**2 - 0.5
    for axis in (0, 1):
        np.testing.assert_allclose(np.sort(offsets[:, axis]), steps, atol=1e-12)
    turned = {tuple(row) for row in np.round(-offsets, 9) + 0.0}
    assert turned == {tuple(row) for row in np.round(offsets, 9) + 0.0}


def test_refusals():
    with pytest.raises(ArgumentError, match="supersample must be at least 1, got 0"):
        MirrorRays(sekimori_camera(), 0)
    flat = OmniCamera((64, 64), (31.5, 31.5), (5.0, 30.0), Tangent(1.0, 0.02))
    with pytest.raises(ArgumentError, match="viewpoint_height_m"):
        MirrorRays(flat, 1)


def test_cameras_by_name(tmp_path):
    assert camera_by_name("sekimori").size_px == (256, 220)
    assert camera_by_name("sekimori:640x480").usable_radius_px[1] == pytest.approx(112 * 480 / 220)
    with pytest.raises(ArgumentError, match=r"is neither a \.toml file nor sekimori.*; did you mean 'sekimori'"):
        camera_by_name("sekimroi")
    with pytest.raises(ArgumentError, match="sekimori:WIDTHxHEIGHT"):
        camera_by_name("sekimori:wide")
    with pytest.raises(ArgumentError, match="'sekimori:99999x99999' has too large images: at most 9999x9999 pixels"):
        camera_by_name("sekimori:99999x99999")
    with pytest.raises(Exception, match=r"absent\.toml"):
        camera_by_name(tmp_path / "absent.toml")
