"""Frames whose true camera is not the one that the calibration starts from."""

import dataclasses
import math

import numpy as np
import pytest

from robocup_vision.calibration.omni.model import hyperboloid_of, scale_and_horizon
from sim2d.rendering.random_scenes import Condition, sample

OFF = Condition(center_offset_px=(2.6, -3.5), tilt_rad=(math.radians(0.6), math.radians(-0.5)))


@pytest.fixture(scope="session")
def true_camera(paper_camera):
    return OFF.true_camera(paper_camera)


@pytest.fixture(scope="session")
def off_samples(ssl_field, paper_camera):
    """Six frames through the true camera; nobody may write to them."""
    samples = list(sample(ssl_field, paper_camera, OFF, seed=41, count=6, supersample=2))
    for one in samples:
        one.frame.flags.writeable = False
    return samples


@pytest.fixture(scope="session")
def off_frames(off_samples):
    return [one.frame for one in off_samples]


@pytest.fixture(scope="session")
def rough_camera(paper_camera):
    scale, horizon = scale_and_horizon(paper_camera.floor_range, paper_camera.usable_radius_px)
    curve = hyperboloid_of(1.2 * scale, 0.85 * horizon, 4 * horizon)
    return dataclasses.replace(paper_camera, center_px=(135.0, 103.0), floor_range=curve)


@pytest.fixture(scope="session")
def floor_error_m():
    """Median distance on the floor within 1.5 m, after the best rigid motion, between two cameras' maps."""

    def error(camera, truth):
        pixels = truth.polar_to_pixel(np.arange(0, 6.2, 0.3)[:, None], np.linspace(30, 100, 15)[None]).reshape(-1, 2)
        right, got = truth.pixel_to_floor(pixels), camera.pixel_to_floor(pixels)
        near = np.hypot(*right.T) < 1.5
        right, got = right[near] - right[near].mean(axis=0), got[near] - got[near].mean(axis=0)
        u, _, v = np.linalg.svd(got.T @ right)
        turn = u @ np.diag([1, np.linalg.det(u @ v)]) @ v
        return float(np.median(np.hypot(*(got @ turn - right).T)))

    return error
