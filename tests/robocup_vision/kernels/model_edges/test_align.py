"""What aligning proposed poses brings about."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.align import (
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


def spread(truth, rng, number=40):
    """Return starts (N, 3), the first one next to the truth."""
    near = truth.array + np.array((0.06, -0.05, 0.03))
    far = rng.uniform((-2.0, -1.5, -3.0), (2.0, 1.5, 3.0), (number - 1, 3))
    return np.vstack([near, far])


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
