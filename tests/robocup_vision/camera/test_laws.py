"""Laws of every camera model: pixels and floor come back through rays, the mounting, what nobody may write to."""

import numpy as np
import pytest
from hypothesis import given
from strategies import all_cameras, fisheyes, numbers, pinholes

from robocup_vision.camera import OmniCamera, PinholeCamera, camera_rotation


def pixels_of(camera):
    """Return pixels (M, N, 2) of the whole picture, or of a mirror's usable ring."""
    if isinstance(camera, OmniCamera):
        inner, outer = camera.usable_radius_px
        bearings = np.linspace(0.0, 2 * np.pi, 16, endpoint=False)
        return camera.polar_to_pixel(bearings[:, None], np.linspace(inner + 0.01, outer - 0.01, 12))
    width, height = camera.size_px
    return np.stack(np.meshgrid(np.linspace(0, width - 1, 13), np.linspace(0, height - 1, 11)), axis=-1)


@given(all_cameras())
def test_pixels_come_back_through_unit_rays(camera):
    pixels = pixels_of(camera)
    rays = camera.pixel_to_ray(pixels)
    shown = np.isfinite(rays).all(axis=-1)
    if type(camera) in (OmniCamera, PinholeCamera):
        assert shown.all()
    else:
        away = np.hypot(*np.moveaxis((pixels - camera.center_px) / camera.focal_px, -1, 0))
        assert (away[~shown] >= min(camera.image_radius(camera.widest_rad), 1.7)).all()
    np.testing.assert_allclose(np.linalg.norm(rays[shown], axis=-1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(camera.ray_to_pixel(rays[shown]), pixels[shown], atol=1e-6)
    np.testing.assert_allclose(camera.ray_to_pixel(17.0 * rays[shown]), pixels[shown], atol=1e-6)


@given(all_cameras())
def test_floor_lies_where_the_rays_of_its_pixels_meet_it(camera):
    pixels = pixels_of(camera)
    rays, floor = camera.pixel_to_ray(pixels), camera.pixel_to_floor(pixels)
    seen = np.isfinite(floor).all(axis=-1)
    np.testing.assert_array_equal(seen, rays[..., 2] < -1e-9)
    np.testing.assert_allclose(camera.floor_to_pixel(floor[seen]), pixels[seen], atol=1e-5)
    steep = rays[..., 2] < -1e-6
    met = [*camera.offset_m, camera.height_m] - rays[steep] * (camera.height_m / rays[steep][:, 2:])
    np.testing.assert_allclose(met[:, 2], 0.0, atol=1e-12 * np.abs(met).max(initial=1.0))
    np.testing.assert_allclose(floor[steep], met[:, :2], rtol=1e-6, atol=1e-6)


@given(pinholes() | fisheyes(), numbers(-3, 3), numbers(-1.5, 1.5), numbers(-3, 3))
def test_turning_the_neck_leaves_the_cameras_own_rays_alone(camera, pan, tilt, roll):
    turned = camera.with_orientation(pan, tilt, roll)
    assert type(turned) is type(camera)
    pixels = pixels_of(camera)
    own = camera.pixel_to_camera_ray(pixels)
    np.testing.assert_array_equal(turned.pixel_to_camera_ray(pixels), own)
    np.testing.assert_allclose(turned.pixel_to_ray(pixels), own @ camera_rotation(pan, tilt, roll).T, atol=1e-12)


@given(all_cameras())
def test_cached_arrays_are_read_only(camera):
    for name in ("camera_to_robot", "viewpoint_m"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(camera, name)[0] = 1.0
