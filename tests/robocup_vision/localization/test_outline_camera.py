"""A leaning body's outline gives its pose and its lean; an upright one's is taken for upright."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import numbers

from field_models import load_field
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.perception.polar_view import PolarView
from sim2d.match.setups import CAMERAS
from sim2d.rendering.cameras import sekimori_camera

FIELD, CAMERA = load_field("ssl_2001"), sekimori_camera()
VIEW = PolarView(CAMERA)
FITTER = OutlineFitter(FIELD, CAMERA, VIEW)
MODEL = FITTER.model
PRIOR_STD = np.array([0.02, 0.02, 0.02])
places = st.builds(Pose2, numbers(-1.1, 1.1), numbers(-0.55, 0.55), numbers(-3.1, 3.1))
leans = st.tuples(numbers(-0.015, 0.015), numbers(-0.015, 0.015))


def floor_columns(radius, view=VIEW):
    """Return each bearing's outermost floor sample: at its edge, or right at the robot where something hides it."""
    at_edge = np.searchsorted(view.radius_px, np.nan_to_num(radius, nan=-1.0)) - 1
    return np.clip(at_edge, 0, len(view.radius_px) - 1).astype(np.int64)


def locate(radius, prior, fitter=None):
    fitter = fitter or FITTER
    return fitter.locate(radius, floor_columns(radius, fitter.view), prior)[:2]


def outline(pose, lean, noise, field=FIELD, camera=CAMERA, view=VIEW):
    """Image radius of the walls' feet from a leaning body: points of the walls, projected one by one."""
    turn = camera_rotation(0.0, *lean)
    parts = np.linspace(0.0, 1.0, 2000)[:, None]
    feet = np.concatenate([(1 - parts) * wall[:2] + parts * wall[2:] for wall in field.walls])
    in_robot = pose.inverse().transform(feet)
    # the body turns about its foot, which the camera's place turns with
    in_body = np.concatenate([in_robot, np.zeros((len(in_robot), 1))], axis=1) @ turn
    pixels = camera.point_to_pixel(in_body)
    radius = np.hypot(*(pixels - camera.center_px).T)
    bearing = np.mod(camera.image_bearing_rad(pixels), math.tau)
    bins = np.rint(bearing / (math.tau / view.bearings)).astype(int) % view.bearings
    off = np.abs(np.mod(bearing - view.bearing_rad[bins] + math.pi, math.tau) - math.pi)
    found = np.full(view.bearings, np.nan)
    for k in range(view.bearings):
        here = np.flatnonzero((bins == k) & (off < 0.004) & np.isfinite(radius))
        if len(here):
            # of two walls the nearer one bounds the floor
            found[k] = radius[here].min()
    return found + noise


@given(places, leans, st.integers(0, 2**32 - 1))
def test_a_leaning_body_knows_where_it_is(pose, lean, seed):
    noise = np.random.default_rng(seed).normal(0, 0.1, VIEW.bearings)
    estimate, _ = locate(outline(pose, lean, noise), pose)
    assert estimate
    distance, angle = estimate.pose.error_to(pose, symmetric=True)
    assert distance < 0.02
    assert angle < math.radians(1.0)


def test_a_lean_moves_a_fit_of_upright_bodies_by_centimetres():
    pose, lean = Pose2(0.8, 0.2, 0.3), (0.012, 0.004)
    radius = outline(pose, lean, 0.0)
    level, _ = MODEL.fit(tuple(pose.array), radius, MODEL.scales((2.0,)), trusts_file=True)
    assert math.dist(level.pose[:2], (pose.x_m, pose.y_m)) > 0.02
    estimate, _ = locate(radius, pose)
    assert estimate.pose.error_to(pose)[0] < 0.005


def test_one_wall_alone_tells_no_lean():
    pose, lean = Pose2(0.0, 0.2, math.pi / 2), (0.01, 0.0)
    radius = outline(pose, lean, np.random.default_rng(0).normal(0, 0.1, VIEW.bearings))
    radius[np.abs(np.mod(VIEW.bearing_rad + math.pi, math.tau) - math.pi) > 0.6] = np.nan
    fits = [
        MODEL.fit(tuple(pose.array), radius, MODEL.scales((2.0,)), trusts_file=trusts)[0] for trusts in (False, True)
    ]
    assert fits[0].pose == fits[1].pose


@pytest.fixture(scope="module")
def far_field():
    """Make a fitter on a large field, and outlines of leaning bodies in a crowd: each with the pose and a prior."""
    field, camera = load_field("ssl_division_b"), CAMERAS["ssl_mirror"]()
    view = PolarView(camera)
    rng, seen = np.random.default_rng(4), []
    for _ in range(40):
        pose = Pose2(rng.uniform(-3.5, 3.5), rng.uniform(-2.5, 2.5), rng.uniform(-3, 3))
        noise = rng.normal(0, 0.3, view.bearings)
        radius = outline(pose, (rng.normal(0, 0.01), 0.0), noise, field, camera, view)
        # robots hide a good part of the boards
        for middle in rng.uniform(-math.pi, math.pi, 6):
            radius[np.abs(np.mod(view.bearing_rad - middle + math.pi, math.tau) - math.pi) < 0.2] = np.nan
        off = rng.normal(0, 1, 3) * PRIOR_STD
        seen.append((radius, pose, Pose2(pose.x_m + off[0], pose.y_m + off[1], pose.theta_rad + off[2])))
    return OutlineFitter(field, camera, view), seen


def test_on_a_far_field_a_leaning_body_is_not_where_an_upright_one_would_be(far_field):
    fitter, seen = far_field
    answers = [(locate(radius, prior, fitter)[0], pose) for radius, pose, prior in seen]
    errors = [estimate.pose.error_to(pose)[0] for estimate, pose in answers if estimate]
    assert len(errors) > 0.7 * len(seen)
    assert max(errors) < 0.3
    assert np.median(errors) < 0.05


def test_a_priors_covariance_is_a_factor_of_a_leaning_bodys_pose(far_field):
    fitter, seen = far_field
    covariance, included = np.diag(PRIOR_STD) ** 2, 0
    for radius, pose, at in seen:
        prior = PoseEstimate(at, covariance, 1.0, 0.0)
        answer = fitter.locate(radius, floor_columns(radius, fitter.view), prior)
        if not answer.estimate:
            assert answer.measurement is None
            continue
        assert answer.estimate.pose.error_to(pose)[0] < 5 * max(PRIOR_STD)
        assert answer.estimate.candidates == (answer.estimate.pose, answer.estimate.pose.half_turn())
        if answer.measurement is not None:
            included += 1
            # the product of both is no wider than either
            for wider in (covariance, answer.measurement.covariance):
                assert np.linalg.eigvalsh(wider - answer.estimate.covariance).min() > -1e-9
    assert included > 0.2 * len(seen)


def test_a_leaning_body_is_not_where_its_prior_excludes_it(far_field):
    fitter, seen = far_field
    for radius, _, at in seen:
        wrong = Pose2(at.x_m + 0.4, at.y_m - 0.4, at.theta_rad)
        answer = fitter.locate(
            radius, floor_columns(radius, fitter.view), PoseEstimate(wrong, np.eye(3) * 1e-4, 1.0, 0.0)
        )
        # only an upright body's pose overrides its prior
        assert answer.measurement is None


def test_a_pose_that_its_prior_draws_off_the_field_has_no_measurement(far_field):
    fitter, _ = far_field
    field, camera, view = fitter.field, fitter.camera, fitter.view
    rng, outside = np.random.default_rng(2), 0
    for _ in range(30):
        pose = Pose2(rng.uniform(-3.5, 3.5), field.floor_polygon[:, 1].max() - 0.05, rng.uniform(-3, 3))
        radius = outline(pose, (rng.normal(0, 0.01), 0.0), rng.normal(0, 0.3, view.bearings), field, camera, view)
        for middle in rng.uniform(-math.pi, math.pi, 6):
            radius[np.abs(np.mod(view.bearing_rad - middle + math.pi, math.tau) - math.pi) < 0.3] = np.nan
        prior = PoseEstimate(
            Pose2(pose.x_m, pose.y_m + 0.1, pose.theta_rad), np.diag([0.05, 0.05, 0.03]) ** 2, 1.0, 0.0
        )
        answer = fitter.locate(radius, floor_columns(radius, view), prior)
        if not answer.estimate:
            outside += "outside the field" in answer.estimate.reason
            assert answer.measurement is None
    assert outside


def test_a_direction_that_no_wall_tells_is_not_made_up():
    pose = Pose2(0.0, 0.0, 0.0)
    radius = outline(pose, (0.0, 0.0), 0.0)
    radius[np.abs(np.mod(VIEW.bearing_rad + math.pi / 2, math.tau) - math.pi) > 0.5] = np.nan
    assert np.isfinite(radius).sum() > 20
    leaning = MODEL.fit_leaning((tuple(pose.array),), radius)
    assert leaning is None or leaning.along_m > 0.5
    assert not locate(radius, pose)[0]
