"""Aligning proposed poses against a plain twin that differentiates numerically, and what it must bring about."""

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.align import (
    FAR,
    LEFT_BEHIND,
    Alignment,
    align,
    align_all,
    align_likeliest,
    slopes_of,
)
from robocup_vision.kernels.model_edges.find import BINS, upright_mismatch
from robocup_vision.localization.model_edges.bank import prepare_bank

CAMERA = PinholeCamera(
    (104, 80), (96.0, 96.0), (51.5, 39.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.03, roll_std_rad=0.02
)
STD = np.array([0.12, 0.12, 0.06, 0.02, 0.02])
GATES_PX = np.array([20.0, 10.0, 5.0, 3.0, 3.0])
NONE = np.zeros((0, 8))
# of the beacon and the goal that a camera at (-0.6, 0.3, 2.9) may see, about as it sees them
SIGHTS = np.array(
    [
        [-1.35, 1.95, -1.35, 1.95, -0.9, 0.267, 24.0, 8.0],
        [-2.7, -0.45, -2.7, 0.45, 0.2, 0.5, 20.0, 2.0],
    ]
)


@pytest.fixture(scope="module")
def bank():
    return prepare_bank(load_field("four_legged_2007"), CAMERA, 0.8, 0.5)


def lined(camera, pose, rng, number=40):
    """Slopes of line points that a camera of this pose sees."""
    lines = load_field("four_legged_2007").line_points(0.02)
    places = pose.inverse().transform(lines)
    places = places[(places[:, 0] > 0.3) & (np.abs(places[:, 1]) < 0.5 * places[:, 0]) & (places[:, 0] < 3.0)]
    places = places[rng.choice(len(places), number)]
    return slopes_of(np.column_stack([places, places[:, 0]]), camera.tilt_rad, camera.roll_rad, camera.height_m)


def plain_floor(how, pose, slopes):
    """Place of each line point on the floor about the camera's foot (N, 2), NaN above the horizon."""
    tilt, roll = how.tilt_rad + pose[3], how.roll_rad + pose[4]
    pitch = np.array([[math.cos(tilt), 0, -math.sin(tilt)], [0, 1, 0], [math.sin(tilt), 0, math.cos(tilt)]])
    turn = np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]])
    ray = np.column_stack([np.ones(len(slopes)), slopes]) @ (pitch @ turn).T
    down = np.where(ray[:, 2] < -0.01, -ray[:, 2], np.nan)
    return ray[:, :2] / down[:, None] * how.height_m


def plain_residuals(bank, how, pose):
    """Distances from lines in pixels (N,), their derivatives (N, 5), and which of them count."""
    place = plain_floor(how, pose, how.slopes)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    at = place @ turn.T + pose[:2]
    cell = np.nan_to_num((at - bank.origin_m) / bank.cell_m + 0.5, nan=-1.0).astype(int)
    shape = np.array(bank.distance_m.shape[::-1])
    counts = ((cell >= 1) & (cell <= shape - 2)).all(axis=1)
    off, rows = np.full(len(place), FAR), np.zeros((len(place), 5))
    for n in np.flatnonzero(counts):
        x, y = cell[n]
        slope = np.array(
            [
                bank.distance_m[y, x + 1] - bank.distance_m[y, x - 1],
                bank.distance_m[y + 1, x] - bank.distance_m[y - 1, x],
            ]
        ) / (2 * bank.cell_m)
        direction = slope @ turn
        away = np.linalg.norm(place[n])
        ahead = place[n] / away
        slant = math.hypot(away, how.height_m)
        upward, aside = how.pixel_rad * slant**2 / how.height_m, how.pixel_rad * slant
        along, across = direction @ ahead, ahead[0] * direction[1] - ahead[1] * direction[0]
        one = math.sqrt((along * upward) ** 2 + (across * aside) ** 2 + bank.cell_m**2)
        off[n] = bank.distance_m[y, x] / one
        for j in range(5):
            ends = []
            for step in (1e-6, -1e-6):
                moved = np.array(pose)
                moved[j] += step
                c, s = math.cos(moved[2]), math.sin(moved[2])
                ends.append(np.array([[c, -s], [s, c]]) @ plain_floor(how, moved, how.slopes[n : n + 1])[0] + moved[:2])
            rows[n, j] = slope @ (ends[0] - ends[1]) / 2e-6 / one
    return off, rows, counts


def plain_sights(how, pose):
    """Bearings and sizes of sightings less those predicted, in pixels."""
    off = []
    for x0, y0, x1, y1, bearing, size_m, size_px, _ in how.sights:
        turns = []
        for x, y in ((x0, y0), (x1, y1)):
            turn = math.remainder(math.atan2(y - pose[1], x - pose[0]) - pose[2] - bearing, math.tau)
            away = math.hypot(x - pose[0], y - pose[1])
            turns.append((turn / how.pixel_rad, size_m / (how.pixel_rad * away * math.cos(bearing)) - size_px))
        off.extend(min(turns, key=lambda one: abs(one[0])))
    return np.array(off)


def plain_align(bank, how, start, first=None):
    """Pose and cost; the first step is made by so many points."""
    center = np.array([*start, 0.0, 0.0])
    weights = np.repeat(how.sights[:, 7], 2)
    pose = center.copy()
    for turn, gate in enumerate(how.gates_px):
        few = how if turn or first is None else how._replace(slopes=how.slopes[:first])
        off, rows, counts = plain_residuals(bank, few, pose)
        weight = np.where(counts, 1.0 / (1.0 + (off / gate) ** 2) ** 2, 0.0)
        system = np.diag(1.0 / how.std**2) + (rows * weight[:, None]).T @ rows
        aside, steps = plain_sights(how, pose), 1e-6 * np.eye(5)
        slopes = [(plain_sights(how, pose + one) - plain_sights(how, pose - one)) / 2e-6 for one in steps]
        by, heavy = np.array(slopes).T.reshape(-1, 5), weights / (1.0 + (aside / gate) ** 2) ** 2
        system += (by * heavy[:, None]).T @ by
        gradient = rows.T @ (weight * off) + by.T @ (heavy * aside)
        pose = pose + np.linalg.solve(system, -(pose - center) / how.std**2 - gradient)
    off, _, _ = plain_residuals(bank, how, pose)
    square = (off / how.gates_px[-1]) ** 2
    seen = (plain_sights(how, pose) / how.gates_px[-1]) ** 2
    cost = (square / (1.0 + square)).sum() + (weights * seen / (1.0 + seen)).sum()
    return pose, 0.5 * ((pose[3:] / how.std[3:]) ** 2).sum() + cost


@pytest.mark.parametrize("sights", [NONE, SIGHTS])
def test_one_pose_is_moved_as_by_the_plain_twin(bank, sights):
    rng = np.random.default_rng(3)
    truth = Pose2(-0.6, 0.3, 2.9)
    how = Alignment(lined(CAMERA, truth, rng, 12), -0.17, 0.03, 0.185, STD, 1 / 96.0, GATES_PX[:2], sights)
    for _ in range(3):
        start = truth.array + rng.normal(0.0, (0.1, 0.1, 0.05))
        pose = np.zeros(5)
        cost = align(bank, how, start, pose)
        expected, expected_cost = plain_align(bank, how, start)
        np.testing.assert_allclose(pose, expected, atol=2e-5)
        assert cost == pytest.approx(expected_cost, rel=1e-3)


def test_a_nod_is_made_good_and_the_right_pose_costs_least(bank):
    rng = np.random.default_rng(4)
    truth = Pose2(-1.2, 0.6, 2.2)
    nodding = CAMERA.with_orientation(0.0, -0.17 + 0.02, 0.03)
    how = Alignment(lined(nodding, truth, rng, 90), -0.17, 0.03, 0.185, STD, 1 / 96.0, GATES_PX, NONE)
    starts = truth.array + np.array([(0.08, -0.06, 0.03), (0.9, 0.2, 0.4), (1.7, -1.0, -1.2)])
    poses, costs = np.zeros((3, 5)), np.zeros(3)
    seen = np.zeros((len(bank.paints), BINS + 1))
    seen[:, 1:] = np.cumsum(rng.random((len(bank.paints), BINS)) < 0.1, axis=1)
    align_all(bank, how, seen, 0.25, starts, poses, costs)
    assert np.hypot(*(poses[0, :2] - truth.array[:2])) < 0.1
    assert poses[0, 3] == pytest.approx(0.02, abs=0.006)
    for start, pose, cost in zip(starts, poses, costs, strict=True):
        alone = np.zeros(5)
        wrong = upright_mismatch(bank, seen, *pose[:3])
        assert cost == pytest.approx(align(bank, how, start, alone) + 0.25 * wrong)
        np.testing.assert_array_equal(alone, pose)
    assert np.argmin(costs) == 0


def test_points_beside_the_field_count_as_off(bank):
    slopes = np.array([[0.0, 0.5], [0.0, -0.3]])
    how = Alignment(slopes, -0.17, 0.03, 0.185, STD, 1 / 96.0, GATES_PX, NONE)
    pose = np.zeros(5)
    # far beside the field, one above the horizon and one on the floor
    assert align(bank, how, np.array([9.0, 9.0, 0.0]), pose) == pytest.approx(2.0, abs=1e-3)
    np.testing.assert_allclose(pose, (9.0, 9.0, 0.0, 0.0, 0.0))


def test_slopes_are_those_of_the_pixels():
    pixels = np.random.default_rng(1).uniform((0.0, 50.0), (103.0, 79.0), (30, 2))
    floor = CAMERA.pixel_to_floor(pixels)
    slopes = slopes_of(np.column_stack([floor, floor[:, 0]]), -0.17, 0.03, 0.185)
    expected = np.column_stack([(51.5 - pixels[:, 0]) / 96.0, (39.5 - pixels[:, 1]) / 96.0])
    np.testing.assert_allclose(slopes, expected, atol=1e-9)


def spread(truth, rng, number=40):
    """Return starts (N, 3), the first one next to the truth."""
    near = truth.array + np.array((0.06, -0.05, 0.03))
    far = rng.uniform((-2.0, -1.5, -3.0), (2.0, 1.5, 3.0), (number - 1, 3))
    return np.vstack([near, far])


def test_the_likeliest_are_moved_as_by_the_plain_twin_and_the_costlier_are_left_behind(bank):
    rng = np.random.default_rng(5)
    truth = Pose2(-0.6, 0.3, 2.9)
    how = Alignment(lined(CAMERA, truth, rng, 30), -0.17, 0.03, 0.185, STD, 1 / 96.0, GATES_PX, SIGHTS)
    starts, seen = spread(truth, rng), np.zeros((len(bank.paints), BINS + 1))
    seen[:, 1:] = np.cumsum(rng.random((len(bank.paints), BINS)) < 0.1, axis=1)
    poses, costs = np.zeros((len(starts), 5)), np.zeros(len(starts))
    align_likeliest(bank, how, seen, 0.25, starts, 6, poses, costs)
    kept = np.flatnonzero(costs < LEFT_BEHIND)
    assert len(kept) == 6
    assert (costs[costs >= LEFT_BEHIND] == LEFT_BEHIND).all()
    assert np.argmin(costs) == 0
    pose, cost = plain_align(bank, how, starts[0], first=15)
    np.testing.assert_allclose(poses[0], pose, atol=2e-5)
    assert costs[0] == pytest.approx(cost + 0.25 * upright_mismatch(bank, seen, *poses[0, :3]), rel=1e-3)


def test_what_is_left_behind_does_not_change_what_is_kept(bank):
    rng = np.random.default_rng(6)
    truth = Pose2(-1.2, 0.6, 2.2)
    how = Alignment(lined(CAMERA, truth, rng, 30), -0.17, 0.03, 0.185, STD, 1 / 96.0, GATES_PX, NONE)
    starts, seen = spread(truth, rng), np.zeros((len(bank.paints), BINS + 1))
    results = {}
    for likely in (5, len(starts)):
        poses, costs = np.zeros((len(starts), 5)), np.zeros(len(starts))
        align_likeliest(bank, how, seen, 0.25, starts, likely, poses, costs)
        results[likely] = poses, costs
    (few, few_costs), (every, every_costs) = results[5], results[len(starts)]
    kept = few_costs < LEFT_BEHIND
    assert (every_costs < LEFT_BEHIND).all()
    np.testing.assert_array_equal(few[kept], every[kept])
    np.testing.assert_array_equal(few_costs[kept], every_costs[kept])
