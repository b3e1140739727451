"""A ball is as large in the picture as its outline, the cone of rays that touch it, whatever the camera."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.perception.balls.projection import ball_projection
from robocup_vision.perception.balls.sizes import ball_sizes_px
from sim2d.rendering.cameras import sekimori_camera

RADIUS_M = 0.03
HELD = {"pan_rad": 0.0, "tilt_rad": -0.35, "roll_rad": 0.0}
CAMERAS = {
    "mirror": sekimori_camera(),
    "pinhole": PinholeCamera((320, 240), (250.0, 250.0), (159.5, 119.5), 0.4, **HELD),
    "lens": PinholeCamera((320, 240), (250.0, 250.0), (159.5, 119.5), 0.4, (-0.2, 0.05, 0.0, 0.0), **HELD),
    "fisheye": FisheyeCamera((320, 240), (120.0, 120.0), (159.5, 119.5), 0.4, **HELD),
}
TURN = np.linspace(0.0, math.tau, 720)


def outline(camera, place):
    """Return the pixel of a ball's centre and those of its outline."""
    away = np.array([*place, RADIUS_M]) - camera.viewpoint_m
    distance = float(np.linalg.norm(away))
    ahead = away / distance
    aside = np.cross(ahead, (0.0, 0.0, 1.0))
    aside /= np.linalg.norm(aside)
    sine = RADIUS_M / distance
    rim = np.cos(TURN)[:, None] * aside + np.sin(TURN)[:, None] * np.cross(aside, ahead)
    return camera.ray_to_pixel(ahead), camera.ray_to_pixel(math.sqrt(1.0 - sine**2) * ahead + sine * rim)


@pytest.mark.parametrize("name", CAMERAS)
@given(st.floats(0.35, 0.9), st.floats(-0.2, 0.2))
def test_a_ball_is_as_large_as_its_outline(name, range_m, bearing_rad):
    camera = CAMERAS[name]
    center, rim = outline(camera, (range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad)))
    along, across = ball_sizes_px(camera, float(camera.viewpoint_m[2]), RADIUS_M, center)
    # half the area's root: the outline is an ellipse, however it lies
    (u, v), (next_u, next_v) = rim.T, np.roll(rim, -1, axis=0).T
    area = abs(float(u @ next_v - v @ next_u)) / 2.0
    assert float(along * across) == pytest.approx(area / math.pi, rel=0.05)


@pytest.mark.parametrize("name", CAMERAS)
@pytest.mark.parametrize("range_m", [0.5, 0.7])
def test_sizes_along_the_rays_are_those_at_the_pixel_and_seeds_cover_the_ball(name, range_m):
    camera = CAMERAS[name]
    sizes = ball_projection(camera, RADIUS_M).sizes
    center, rim = outline(camera, (range_m, 0.0))
    along, across = sizes.at(*center.tolist())
    (axis_u, axis_v), reach = sizes.axis_px, rim - center
    ray = center - (axis_u, axis_v)
    ray /= np.linalg.norm(ray)
    assert along == pytest.approx(np.ptp(reach @ ray) / 2, rel=0.08)
    assert across == pytest.approx(np.ptp(reach @ (-ray[1], ray[0])) / 2, rel=0.08)
    off = sizes.seeds[:, ::-1] - center
    assert (((off @ ray) / along) ** 2 + ((off @ (-ray[1], ray[0])) / across) ** 2 < 1.0).any()
