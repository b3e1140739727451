"""A football's patches cover what twelve pentagons do, however it has rolled; only balls that have them show any."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.kernels.things import BALL, meet_thing
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Ball, Scene

CAMERA = PinholeCamera((96, 64), (96.0, 96.0), (47.5, 31.5), 0.3, pan_rad=0.0, tilt_rad=-0.5, roll_rad=0.0)
LAMP = np.array([1.0, 0.0], dtype=np.float32)
WHITE, DARK = 3, 4
angles = st.floats(-math.pi, math.pi)


def everywhere(count):
    """Return unit normals (N, 3) evenly over a ball."""
    z = 1 - 2 * (np.arange(count) + 0.5) / count
    turn = np.arange(count) * math.pi * (3 - math.sqrt(5))
    level = np.sqrt(1 - z * z)
    return np.stack([level * np.cos(turn), level * np.sin(turn), z], axis=1).astype(np.float32)


def is_patch(normals, turn_rad):
    """Return where rays that fall on a ball of radius 1 from above its normals meet a patch."""
    about_x, about_y, about_z = turn_rad
    found = []
    for normal in normals:
        x, y, up = -5 * normal
        row = tuple(np.float32(v) for v in (BALL, x, y, about_x, about_y, 1, 2, WHITE, about_z, DARK))
        t, color, _ = meet_thing(row[0], row, *-normal, np.float32(1 - up), LAMP)
        assert t == pytest.approx(4, abs=1e-4)
        found.append(color == DARK)
    return np.array(found)


@settings(max_examples=5)
@given(st.tuples(angles, angles, angles))
def test_the_patches_cover_28_percent_however_the_ball_lies(turn_rad):
    assert np.mean(is_patch(everywhere(4000), turn_rad)) == pytest.approx(0.284, abs=0.004)


@settings(max_examples=5)
@given(st.tuples(angles, angles, angles))
def test_a_patch_lies_opposite_each_patch(turn_rad):
    normals = everywhere(500)
    # at a patch's rim either side may round
    assert np.mean(is_patch(normals, turn_rad) == is_patch(-normals, turn_rad)) > 0.995


def test_only_a_ball_with_patches_is_dark_in_part():
    ball = Ball(0.5, 0.0, 0.05, (240.0, 240.0, 240.0))
    patched = dataclasses.replace(ball, patches_bgr=(20.0, 20.0, 20.0), turn_rad=(0.3, -1.0, 2.0))
    field = load_field("spl_2020")
    plain, dark, none = (
        render_pinhole(CAMERA, Scene(field=field, ball=one), Pose2(0.0, 0.0, 0.0), supersample=2)
        for one in (ball, patched, None)
    )
    is_ball = (np.abs(plain - none) > 0).any(axis=-1) & (plain.min(axis=-1) > 100)
    assert is_ball.sum() > 100
    ratio = np.mean(dark[is_ball].max(axis=-1) < 80)
    assert 0.1 < ratio < 0.45
    np.testing.assert_array_equal(
        np.asarray(dark)[~is_ball & (plain == none).all(axis=-1)], none[~is_ball & (plain == none).all(axis=-1)]
    )
