"""The joint fit on points made by geometry alone: exact points give the exact camera, outliers do not pull."""

import dataclasses

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.calibration.omni.choice import Chooser, range_std
from robocup_vision.calibration.omni.fit import FieldShape, JointFit, Points, spread_px
from robocup_vision.calibration.omni.model import CENTER, TILT, CameraModel, hyperboloid_of
from robocup_vision.camera import Tangent
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera

POSES = np.array(
    [[0.2, 0.1, 0.4], [-0.7, 0.4, 2.0], [0.9, -0.3, -1.2], [-0.3, -0.5, 3.0], [1.0, 0.5, 0.9], [0.0, 0.6, -2.4]]
)


@pytest.fixture(scope="module")
def shape():
    return FieldShape(load_field("ssl_2001"))


def seen_from(shape, camera, poses, rng, *, noise_px=0.0, outliers=0):
    """Feet of the walls in sight and points of the lines, as pixels of a camera at poses."""
    pixels, frame, is_line = [], [], []
    for index, pose in enumerate(poses):
        angle = np.linspace(-np.pi, np.pi, 120, endpoint=False)
        eye = np.broadcast_to(pose[:2], (120, 2))
        ray = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        wall = shape.straight[shape.visible_wall(eye, ray)]
        distance = -(eye * wall[:, :2]).sum(axis=1) - wall[:, 2]
        walls = eye + ray * (distance / (ray * wall[:, :2]).sum(axis=1))[:, None]
        lines = shape.field.line_points(0.05)
        lines = lines[np.hypot(*(lines - pose[:2]).T) > 0.15]
        for points, line in ((walls, False), (lines, True)):
            shown = camera.floor_to_pixel(Pose2(*pose).inverse().transform(points))
            shown += rng.normal(0, noise_px, shown.shape) if noise_px else 0
            if outliers:
                shown[:: 100 // outliers] += rng.uniform(-25, 25, shown[:: 100 // outliers].shape)
            pixels.append(shown)
            frame.append(np.full(len(shown), index))
            is_line.append(np.full(len(shown), line))
    count = sum(map(len, pixels))
    return Points(np.vstack(pixels), np.concatenate(frame), np.concatenate(is_line), np.ones(count))


@pytest.fixture(scope="module")
def true_camera():
    return dataclasses.replace(
        sekimori_camera(), center_px=(129.0, 108.0), tilt_rad=(0.008, -0.006), offset_m=(0.02, 0.01), heading_rad=0.3
    )


def start_of(camera):
    return dataclasses.replace(
        camera, center_px=(127.5, 109.5), tilt_rad=(0.0, 0.0), floor_range=hyperboloid_of(285.0, 111.0, 500.0)
    )


def solve(
    shape, points, start, poses, scales=(8.0, 4.0, 2.0, 1.0, 0.5), change=(20.0, 0.5, 0.5), free=None, painted=False
):
    model = CameraModel(start, "hyperboloid")
    vector = model.vector(start)
    joint = JointFit(shape, points, painted=painted)
    return joint, joint.solve(model, vector, poses, scales, vector, model.bounds(vector, *change), free)


def test_residuals_are_distances_in_pixels(shape, true_camera):
    points = seen_from(shape, true_camera, POSES[:1], np.random.default_rng(1))
    assert np.abs(JointFit(shape, points).residuals(true_camera, POSES[:1])).max() < 1e-6
    off = points.pixels - np.array(true_camera.center_px)
    outwards = 0.4 * off / np.hypot(*off.T)[:, None]
    walls = ~points.is_line
    moved = Points(points.pixels + outwards, points.frame, points.is_line, points.weight)
    residual = JointFit(shape, moved).residuals(true_camera, POSES[:1])
    # beyond a wall it is positive, and never more than the shift
    assert np.all(residual[walls] > 0)
    assert np.abs(residual).max() < 0.42
    assert np.median(residual[walls]) > 0.2


def test_camera_and_poses_come_back_from_a_poor_start(shape, true_camera):
    points = seen_from(shape, true_camera, POSES, np.random.default_rng(2), noise_px=0.01)
    rough = POSES + np.random.default_rng(3).normal(0, 0.04, POSES.shape)
    joint, fit = solve(shape, points, start_of(true_camera), rough)
    np.testing.assert_allclose(fit.camera.center_px, true_camera.center_px, atol=0.02)
    np.testing.assert_allclose(fit.camera.tilt_rad, true_camera.tilt_rad, atol=2e-4)
    np.testing.assert_allclose(fit.poses, POSES, atol=2e-3)
    radius = np.linspace(30, 105, 8)
    np.testing.assert_allclose(
        fit.camera.floor_range.inverse_range_per_m(radius),
        true_camera.floor_range.inverse_range_per_m(radius),
        rtol=2e-3,
    )
    assert fit.cost == pytest.approx(joint.cost(joint.residuals(fit.camera, fit.poses), 0.5))


def test_outliers_do_not_pull(shape, true_camera):
    points = seen_from(shape, true_camera, POSES, np.random.default_rng(4), noise_px=0.2, outliers=25)
    _, fit = solve(shape, points, start_of(true_camera), POSES + 0.03)
    np.testing.assert_allclose(fit.camera.center_px, true_camera.center_px, atol=0.3)
    np.testing.assert_allclose(fit.poses[:, :2], POSES[:, :2], atol=5e-3)


def test_a_fit_keeps_to_its_bounds_and_leaves_what_is_not_free(shape, true_camera):
    points = seen_from(shape, true_camera, POSES, np.random.default_rng(6))
    start, free = start_of(true_camera), np.ones(7, dtype=bool)
    free[TILT] = False
    _, fit = solve(shape, points, start, POSES, (4.0, 1.0), (0.5, 0.01, 0.01), free)
    off = np.abs(fit.vector - fit.model.vector(start))
    assert (off[:6] <= np.array([0.5, 0.5, 0.0, 0.0, 0.01, 0.01]) + 1e-12).all()
    assert off[CENTER].max() > 0.1


def test_covariance_covers_the_error_and_ties_centre_to_tilt(shape, true_camera):
    errors = []
    for seed in range(6):
        points = seen_from(shape, true_camera, POSES, np.random.default_rng(seed), noise_px=0.2)
        joint, fit = solve(shape, points, true_camera, POSES, (1.0, 0.6))
        covariance = joint.covariance(fit)
        std = np.sqrt(np.diag(covariance))
        errors.append((fit.vector - fit.model.vector(true_camera))[:6] / std[:6])
    assert 0.3 < np.sqrt(np.mean(np.square(errors))) < 2.0
    correlation = covariance / np.outer(std, std)
    assert abs(correlation[2, 1]) > 0.8
    assert abs(correlation[3, 0]) > 0.8


def test_points_off_the_curve_are_unknown_and_cost_most(shape, true_camera):
    far = Points(np.array([[129.0, -7.0]]), np.array([0]), np.array([True]), np.ones(1))
    joint = JointFit(shape, far)
    residual = joint.residuals(true_camera, POSES[:1])
    assert np.isinf(residual[0])
    assert joint.cost(residual, 1.0) == 1.0


def test_a_point_above_the_horizon_leaves_the_covariance_as_it_is(shape, true_camera):
    seen = seen_from(shape, true_camera, POSES, np.random.default_rng(3), noise_px=0.2)
    joint, fit = solve(shape, seen, true_camera, POSES, (1.0, 0.6))
    sky = Points(
        np.vstack([seen.pixels, [[129.0, -7.0]]]),
        np.append(seen.frame, seen.frame[-1]),
        np.append(seen.is_line, True),
        np.append(seen.weight, 1.0),
    )
    np.testing.assert_allclose(JointFit(shape, sky).covariance(fit), joint.covariance(fit), rtol=0.02, atol=1e-12)


def test_spread_ignores_outliers():
    rng = np.random.default_rng(7)
    residual = np.concatenate([rng.normal(0, 0.4, 800), rng.uniform(-50, 50, 200), [np.inf]])
    assert spread_px(residual) == pytest.approx(0.4, rel=0.2)
    assert spread_px(np.array([np.inf])) == 1.0


@pytest.mark.parametrize(
    ("curve", "tilt"), [("hyperboloid", (0.0, 0.0)), ("hyperboloid", (0.02, -0.015)), ("tangent", (0.0, 0.0))]
)
def test_held_out_points_choose_curve_and_tilt(shape, curve, tilt):
    camera = dataclasses.replace(sekimori_camera(), tilt_rad=tilt)
    if curve == "tangent":
        camera = dataclasses.replace(camera, floor_range=Tangent(0.72, 0.0113), viewpoint_height_m=0.25)
    points = seen_from(shape, camera, POSES, np.random.default_rng(8), noise_px=0.15)
    frame = dataclasses.replace(camera, tilt_rad=(0.0, 0.0))
    _, fit = solve(shape, points, frame, POSES, (4.0, 2.0, 1.0), (20.0, 0.7, 0.4))
    chooser = Chooser(shape, points, fit, (20.0, 0.7, 0.4), 1.0)
    choices = chooser.choose()
    assert choices[0].curve == curve
    assert choices[0].tilted == any(tilt)
    assert {choice.curve for choice in choices} == {"hyperboloid", "tangent", "table"}
    final = chooser.final(choices[0], 0.5)
    np.testing.assert_allclose(final.camera.center_px, camera.center_px, atol=0.3 if any(tilt) else 0.1)


@pytest.fixture(scope="module")
def carpet():
    """Return a field without walls, and the same with its lines and arcs painted beside where the field has them."""
    field = load_field("msl_6x4")
    rng = np.random.default_rng(9)
    std = 0.3 * field.line_width_m
    lines, arcs = field.lines.copy(), field.arcs.copy()
    along = lines[:, 2:] - lines[:, :2]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    sideways = rng.normal(0, std, (len(lines), 2))
    lines[:, :2] += sideways[:, :1] * normal
    lines[:, 2:] += sideways[:, 1:] * normal
    arcs[:, :3] += rng.normal(0, std, (len(arcs), 3))
    return field, dataclasses.replace(field, lines=lines, arcs=arcs)


def on_carpet(painted, camera, poses, rng):
    """Points of a painted carpet's lines, half a decimetre apart, within 3 m of each pose."""
    pixels, frame = [], []
    for index, pose in enumerate(poses):
        lines = painted.line_points(0.05)
        lines = lines[np.hypot(*(lines - pose[:2]).T) < 3.0]
        shown = camera.floor_to_pixel(Pose2(*pose).inverse().transform(lines))
        pixels.append(shown + rng.normal(0, 0.1, shown.shape))
        frame.append(np.full(len(shown), index))
    count = sum(map(len, pixels))
    return Points(np.vstack(pixels), np.concatenate(frame), np.ones(count, dtype=bool), np.ones(count))


CARPET_POSES = np.array([[0.1, -0.2, 0.5], [-0.9, 0.3, 2.0], [1.1, -0.4, -1.3]])


@pytest.fixture(scope="module")
def carpet_camera():
    curve = hyperboloid_of(85.0, 240.0, 400.0)
    return dataclasses.replace(
        sekimori_camera(480, 480), usable_radius_px=(40.0, 225.0), floor_range=curve, tilt_rad=(0.01, -0.008)
    )


def solved_on_carpet(field, painted_field, camera, poses, painted):
    points = on_carpet(painted_field, camera, poses, np.random.default_rng(10))
    start = dataclasses.replace(camera, center_px=(242.5, 237.0), tilt_rad=(0.0, 0.0))
    return solve(FieldShape(field), points, start, poses + 0.02, (8.0, 4.0, 2.0, 1.0), painted=painted)


def test_paint_that_errs_is_no_camera_that_errs(carpet, carpet_camera):
    field, painted_field = carpet
    true = CameraModel(carpet_camera, "hyperboloid").vector(carpet_camera)
    off = {}
    for painted in (False, True):
        joint, fit = solved_on_carpet(field, painted_field, carpet_camera, CARPET_POSES, painted=painted)
        off[painted] = np.abs(fit.vector - true)[:6]
    # the standard deviations know of the paint
    assert (off[True] < 3.5 * np.sqrt(np.diag(joint.covariance(fit)))[:6]).all()
    assert off[True][CENTER].sum() < off[False][CENTER].sum()


def test_lines_that_lie_in_their_place_are_left_there(carpet, carpet_camera):
    field = carpet[0]
    _, fit = solved_on_carpet(field, field, carpet_camera, CARPET_POSES, painted=True)
    assert np.abs(fit.paint_m).max() < 0.006
    np.testing.assert_allclose(fit.camera.center_px, carpet_camera.center_px, atol=0.3)


def test_the_floors_range_is_as_unsure_as_the_scale(carpet, carpet_camera):
    field = carpet[0]
    _, fit = solved_on_carpet(field, field, dataclasses.replace(carpet_camera, tilt_rad=(0.0, 0.0)), CARPET_POSES, True)
    level = dataclasses.replace(fit, vector=np.where(np.arange(7) == TILT.start, 0.0, fit.vector))
    level.vector[TILT] = 0.0
    radius_px = np.array([80.0, 150.0])
    only_scale = np.zeros((7, 7))
    only_scale[4, 4] = 0.02**2
    # at a given radius the range is inverse to the scale
    np.testing.assert_allclose(range_std(level, only_scale, radius_px), 0.02, rtol=1e-3)
    only_center = np.zeros((7, 7))
    only_center[0, 0] = 1.0
    step_m = 1.0 / level.camera.floor_range.inverse_range_per_m(np.stack([radius_px + 0.5, radius_px - 0.5]))
    expected = (step_m[0] - step_m[1]) * level.camera.floor_range.inverse_range_per_m(radius_px)
    np.testing.assert_allclose(range_std(level, only_center, radius_px), expected, rtol=1e-3)
    np.testing.assert_array_equal(range_std(level, np.zeros((7, 7)), radius_px), 0.0)
    beyond = range_std(level, only_scale, np.array([80.0, np.nan]))
    assert np.isnan(beyond).tolist() == [False, True]
    # of two cameras that explain the images as well, one sees the floor 6 % farther away: their mean is 3 % off
    vector = level.vector.copy()
    vector[4] -= np.log(1.06)
    farther = level.model.camera(vector)
    both = range_std(level, only_scale, radius_px, [farther])
    np.testing.assert_allclose(both, np.hypot(0.02, 0.06 / np.sqrt(2)), rtol=1e-3)
    np.testing.assert_allclose(range_std(level, only_scale, radius_px, [level.camera]), 0.02, rtol=1e-3)
