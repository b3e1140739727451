"""A mirror camera as one that looks straight down: the same floor in the same pixels, in NumPy and compiled."""

import math

import numpy as np
from hypothesis import given
from strategies import cameras, numbers

from robocup_vision.camera import OmniCamera, Table
from robocup_vision.camera.downward import downward
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.kernels.algebra.lens import MAX_SLOPE2, distorted, slopes_at

# errors of compiled cubics, pixels: of a smooth curve, and at the kinks of a table of three pairs
SMOOTH_PX, KINKED_PX = 0.02, 0.5


def pixels_of_floor(camera: OmniCamera, bearing: float, ratio: float) -> np.ndarray:
    """Return the pixel (1, 2) at a fraction of the usable radius, or (0, 2) where none has a slope to the floor."""
    inner, outer = camera.usable_radius_px
    pixel = camera.polar_to_pixel(bearing, inner + ratio * (outer - inner))
    off_axis = math.acos(np.clip(-(camera.camera_to_robot.T @ camera.pixel_to_ray(pixel))[2], -1.0, 1.0))
    shows_floor = np.isfinite(camera.pixel_to_floor(pixel)).all() and off_axis < math.radians(88.0)
    return pixel[None] if shows_floor else np.empty((0, 2))


@given(cameras(), numbers(-3.1, 3.1), numbers(0.02, 0.98))
def test_it_shows_the_floor_where_the_mirror_does(camera: OmniCamera, bearing: float, ratio: float):
    held, pixel = downward(camera), pixels_of_floor(camera, bearing, ratio)
    place = camera.pixel_to_floor(pixel)
    np.testing.assert_allclose(held.pixel_to_floor(pixel), place, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(held.floor_to_pixel(place), pixel, atol=1e-4)


@given(cameras(), numbers(-3.1, 3.1), numbers(0.02, 0.98))
def test_its_compiled_table_is_the_camera(camera: OmniCamera, bearing: float, ratio: float):
    held = downward(camera)
    lens, error_px = lens_table(held), KINKED_PX if isinstance(camera.floor_range, Table) else SMOOTH_PX
    for pixel in pixels_of_floor(camera, bearing, ratio):
        right, down = held.ideal_slopes(pixel)
        assert right * right + down * down < lens[MAX_SLOPE2]
        shown = np.array(distorted(lens, right, down)[:2]) * held.focal_px + held.center_px
        np.testing.assert_allclose(shown, pixel, atol=error_px)
        there = held.camera_ray_to_pixel(np.array([1.0, *(-np.array(slopes_at(lens, *pixel)))]))
        np.testing.assert_allclose(there, pixel, atol=error_px)


@given(cameras())
def test_a_smaller_copy_of_its_pictures_shows_the_same_floor(camera: OmniCamera):
    held = downward(camera)
    small = held.in_size((held.size_px[0] // 2, held.size_px[1] // 2))
    pixel = pixels_of_floor(camera, 0.4, 0.5)
    across, down = np.divide(held.size_px, small.size_px)
    in_copy = (pixel + 0.5) / (across, down) - 0.5
    np.testing.assert_allclose(small.pixel_to_floor(in_copy), held.pixel_to_floor(pixel), rtol=0.02, atol=1e-3)
