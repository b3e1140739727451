"""Modes proposed and refined, step by step beside plain NumPy; and the wider picture that an open heading asks for."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.carpet import carpet_look
from robocup_vision.kernels.model_edges.fit import Gates, choose_mode, robust_fit
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.refine import (
    MAX_SEARCHES,
    MIN_SEARCHES,
    moved,
    propose,
    refine,
    widened,
)
from robocup_vision.kernels.model_edges.search import reaches, search, whiten
from robocup_vision.kernels.model_edges.tables import HEADING, UNKNOWNS, Prior, Scene, empty_room, empty_samples
from robocup_vision.localization.model_edges.field_edges import field_edges
from robocup_vision.localization.model_edges.settings import EdgeSettings
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Room as Hall
from sim2d.rendering.scene import Scene as Hallway
from sim2d.rendering.sensor import Sensor

NUMBERS = EdgeSettings().for_width(208, 0.025)
CAMERA = PinholeCamera((208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.0)


def prior_of(heading_std_rad):
    root = np.diag([0.05, 0.05, heading_std_rad, 0.02, 0.02, 0.006, 0.0])
    return Prior(np.array([-0.5, -0.2, 3.0, -0.17, 0.0, 0.185, 0.0]), root)


def test_unknowns_are_the_prior_s_mean_and_its_root_times_standard_normal_ones():
    rng = np.random.default_rng(2)
    prior, z, p = (
        Prior(rng.normal(size=UNKNOWNS), np.tril(rng.normal(size=(UNKNOWNS, UNKNOWNS)))),
        rng.normal(size=7),
        np.empty(7),
    )
    moved(prior, z, p)
    np.testing.assert_allclose(p, prior.mean + prior.root @ z)


def test_a_heading_that_is_known_widens_nothing():
    wide, beside_px = widened(lens_table(CAMERA), prior_of(0.01), NUMBERS)
    assert beside_px == 0.0
    np.testing.assert_array_equal(wide, lens_table(CAMERA))
    # nor does a search's proposal
    assert widened(lens_table(CAMERA), prior_of(0.1), NUMBERS._replace(view_sigmas=0.0))[1] == 0.0


@pytest.mark.parametrize("heading_std_rad", [0.06, 0.1, 0.5])
def test_a_wider_picture_shows_what_a_camera_so_much_wider_shows(heading_std_rad):
    prior, edges = prior_of(heading_std_rad), field_edges(load_field("four_legged_2007"), math.inf)
    assert prior.root[HEADING, HEADING] == heading_std_rad
    wide, beside_px = widened(lens_table(CAMERA), prior, NUMBERS)
    assert beside_px == pytest.approx(min(NUMBERS.view_sigmas * heading_std_rad * 192.0, NUMBERS.max_reach_px))
    seen, expected = empty_samples(600), empty_samples(600)
    count = predict(edges, wide, prior.mean, 10.0, seen)
    # the pixels beside it, to a whole one
    more = round(beside_px)
    wider = replace(CAMERA, size_px=(208 + 2 * more, 160), center_px=(103.5 + more, 79.5))
    number = predict(edges, lens_table(wider), prior.mean, 10.0, expected)
    assert count == pytest.approx(number, abs=0.1 * number)
    left, right = (seen.uv[:count, 0] - beside_px).min(), (seen.uv[:count, 0] - beside_px).max()
    assert left == pytest.approx((expected.uv[:number, 0] - more).min(), abs=6.0)
    assert right == pytest.approx((expected.uv[:number, 0] - more).max(), abs=6.0)
    within = ((seen.uv[:count, 0] >= beside_px) & (seen.uv[:count, 0] < beside_px + 208)).sum()
    plain = predict(edges, lens_table(CAMERA), prior.mean, 10.0, expected)
    assert within == pytest.approx(plain, abs=0.25 * plain)


@pytest.fixture(scope="module")
def looked_at():
    """Return a picture of a pitch, the scene, room to work in, the carpet and the light."""
    pitch = load_field("four_legged_2007")
    shown = Hallway(pitch, room=Hall(seed=3), carpet_margin_m=0.2)
    light = render_pinhole(CAMERA, shown, Pose2(-0.45, -0.25, 3.05), supersample=4)
    image = Sensor(noise_sigma=3.0, blur_px=0.6).expose(light, np.random.default_rng(3))
    draws = np.random.default_rng(1).random((100, 6))
    scene, carpet = Scene(field_edges(pitch, math.inf), lens_table(CAMERA), draws), np.zeros(5)
    carpet_look(image, 46, carpet)
    return image, scene, empty_room(600, 1), carpet, brightness(carpet)


@pytest.mark.parametrize("heading_std_rad", [0.02, 0.1])
def test_modes_are_proposed_as_by_its_steps_one_by_one(looked_at, heading_std_rad):
    image, scene, room, carpet, light = looked_at
    prior, modes, expected = prior_of(heading_std_rad), np.zeros((5, UNKNOWNS)), np.zeros((5, UNKNOWNS))
    wide, beside_px = widened(scene.lens, prior, NUMBERS)
    count = predict(scene.field, wide, prior.mean, NUMBERS.coarse_spacing_px, room.samples)
    room.samples.uv[:count, 0] -= beside_px
    whiten(room.samples, count, prior.root, room.rows)
    reaches(room.rows, count, NUMBERS, room.reach_px)
    search(image, scene.field.channels, carpet, light, NUMBERS, room, count)
    number = choose_mode(room, count, scene.draws, NUMBERS, expected)
    for mode in expected[:number]:
        robust_fit(room, count, NUMBERS, Gates(NUMBERS.coarse_gates_px, 0), np.zeros(UNKNOWNS), mode)
    within = (room.samples.uv[:count, 0] >= 0.0) & (room.samples.uv[:count, 0] < 208)
    in_view = int((within & (room.found.candidates[:count] >= 0)).sum())
    assert propose(image, scene, prior, NUMBERS, room, carpet, light, modes) == (in_view, number)
    np.testing.assert_allclose(modes, expected, atol=1e-9)


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (2.5, -2.0, 2.0)])
def test_a_mode_is_refined_as_by_its_steps_one_by_one(looked_at, start):
    image, scene, room, carpet, light = looked_at
    prior, z, step = prior_of(0.05), np.zeros(UNKNOWNS), np.zeros(UNKNOWNS)
    z[:3] = start
    result = refine(image, scene, prior, NUMBERS, 5.0, room, carpet, light, z, step)
    expected, turned = np.zeros(UNKNOWNS), 0
    expected[:3] = start
    first, second, last = NUMBERS.fine_gates_px
    rough = Gates(np.array([2.0 * first, 2.0 * second, first, last]), NUMBERS.sharp_steps)
    fine = Gates(NUMBERS.fine_gates_px, NUMBERS.sharp_steps)
    for turn in range(3):
        here, way, origin = prior.mean + prior.root @ expected, np.zeros(UNKNOWNS), -expected
        count = predict(scene.field, scene.lens, here, 5.0, room.samples)
        whiten(room.samples, count, prior.root, room.rows)
        bent_px = NUMBERS.bent_ratio * np.abs(room.rows[:count, :3] @ expected[:3]).max()
        far = turn == 0 and bent_px > MIN_SEARCHES * NUMBERS.again_px
        turned += far
        room.reach_px[:count] = min(bent_px, MAX_SEARCHES * NUMBERS.again_px) if far else NUMBERS.again_px
        search(image, scene.field.channels, carpet, light, NUMBERS, room, count)
        inliers, rms, _ = robust_fit(room, count, NUMBERS, rough if far else fine, origin, way)
        expected = expected + way
        found = room.found.candidates[:count] > 0
        if np.abs(room.rows[:count][found] @ way).max() < 0.5 * NUMBERS.again_px:
            break
    assert turned == (start[0] != 0.0)
    assert result == (count, inliers, pytest.approx(rms), True)
    np.testing.assert_allclose(z, expected, atol=1e-6)
    np.testing.assert_allclose(step, way, atol=1e-6)
    fitted = prior.mean + prior.root @ z
    assert np.hypot(fitted[0] + 0.45, fitted[1] + 0.25) < 0.06
