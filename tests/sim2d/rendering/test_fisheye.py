"""Frames of a fisheye camera: where its lens puts what a pinhole camera at the same place sees, and its dark rim."""

import numpy as np

from field_models import load_field
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.pinhole import dark_pixels, render_pinhole
from sim2d.rendering.scene import Room, Scene

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
