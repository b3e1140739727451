"""The compiled search over the whole field against plain code: scores, what is apart, and all of it together."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import PAPER_MIRROR, numbers

from field_models import load_field
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FloorOutline,
    WallScene,
    cost_of,
    predict_walls,
    room_for,
    settle,
    thinned,
)
from robocup_vision.kernels.walls.search import (
    UNKNOWN,
    WIDEST,
    SearchRules,
    fit_each,
    in_order,
    least,
    score_bank,
    search_outline,
    spread_poses,
)
from robocup_vision.localization.outline_model import OutlineModel, OutlineNoise
from robocup_vision.localization.outline_search import OutlineSearch, OutlineSearchSettings
from robocup_vision.perception.polar_view import PolarView

CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
MODEL = OutlineModel(load_field("ssl_2001"), CAMERA, PolarView(CAMERA), OutlineNoise())
RULES = OutlineSearch(MODEL, OutlineSearchSettings())._rules
seeds = st.integers(0, 2**32 - 1)
places = st.builds(Pose2, numbers(-1.25, 1.25), numbers(-0.65, 0.65), numbers(-3.1, 3.1))


def outline(pose, rng, noise_px=0.2, hidden=0.2):
    """Return the image radius of the floor's edge at each bearing, NaN where nothing is seen."""
    prediction = room_for(MODEL.scene)
    predict_walls(pose.array, MODEL.scene, prediction)
    radius = PAPER_MIRROR.radius_px(prediction.q) + rng.normal(0, noise_px, len(prediction.q))
    radius[(prediction.wall < 0) | (rng.random(len(radius)) < hidden)] = np.nan
    return radius


def fit(start, scene, radius, scales):
    compared = FloorOutline(radius, *MODEL.radius_of_q, scales, MODEL.unit_px)
    fine, pose = Comparison(scene, compared, room_for(scene)), np.array(start)
    settle(pose, fine, thinned(fine))
    return pose, cost_of(fine)


@settings(deadline=None, max_examples=20)
@given(seeds)
def test_bank_scores_agree_with_numpy(seed):
    rng = np.random.default_rng(seed)
    bank, levels = rng.integers(0, 1200, (4, 20), dtype=np.int16), rng.integers(0, 1200, 20, dtype=np.int16)
    bank[0] = levels + rng.integers(-150, 150, 20)
    known = rng.random(20) < rng.random()
    clockwise = np.roll(bank[:, ::-1], 1, axis=1)
    out = np.empty((4, 20), dtype=np.int16)
    score_bank(np.hstack([clockwise, clockwise]), np.where(known, levels, UNKNOWN).astype(np.int16), out)
    for shift in range(20):
        off = np.abs(levels.astype(int) - np.roll(bank, shift, axis=1))
        np.testing.assert_array_equal(out[:, shift], np.minimum(off, WIDEST)[:, known].sum(axis=1))


def test_no_sum_of_differences_is_too_large_for_two_bytes():
    count = OutlineSearchSettings().bank_bearings
    out = np.empty((1, count), dtype=np.int16)
    score_bank(np.zeros((1, 2 * count), dtype=np.int16), np.full(count, 2**15 - 1, dtype=np.int16), out)
    assert (out == count * int(WIDEST)).all()


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 400), st.integers(0, 200), seeds)
def test_the_least_scores_come_in_order_the_first_of_equal_ones_first(count, top, seed):
    scores = np.random.default_rng(seed).integers(0, top + 1, count).astype(np.int16)
    out = np.empty(min(count, 30), dtype=np.int64)
    least(scores, out)
    np.testing.assert_array_equal(out, np.argsort(scores, kind="stable")[: len(out)])


@settings(deadline=None, max_examples=40)
@given(st.lists(st.sampled_from([0.1, 0.2, 0.5, 1.0, math.inf]), max_size=30))
def test_costs_are_ordered_as_a_stable_sort_does(costs):
    out = np.empty(len(costs), dtype=np.int64)
    in_order(np.array(costs), out)
    np.testing.assert_array_equal(out, np.argsort(costs, kind="stable"))


def test_each_start_is_fitted_by_itself():
    rng = np.random.default_rng(3)
    radius, scales = outline(Pose2(-0.4, 0.2, 2.0), rng), np.array([8.0, 4.0, 2.0])
    starts = rng.normal(0, 0.3, (5, 3))
    poses, costs = np.empty((5, 3)), np.empty(5)
    compared = FloorOutline(radius, *MODEL.radius_of_q, scales, MODEL.unit_px)
    fit_each(starts, MODEL.scene, compared, poses, costs)
    for start, pose, cost in zip(starts, poses, costs, strict=True):
        alone = fit(start, MODEL.scene, radius, scales)
        assert cost == alone[1]
        np.testing.assert_array_equal(pose, alone[0])


def differ(pose, others, apart):
    for other in others:
        turn = abs(math.remainder(pose[2] - other[2], math.tau))
        here, there = math.dist(pose[:2], other[:2]) + turn, math.dist(pose[:2], -other[:2]) + math.pi - turn
        if min(here, there) <= apart:
            return False
    return True


@settings(deadline=None, max_examples=40)
@given(places, seeds, st.floats(0.05, 2.0))
def test_spread_poses_are_the_best_that_are_apart(pose, seed, apart):
    rng = np.random.default_rng(seed)
    poses = pose.array + rng.normal(0, (0.3, 0.3, 0.3), (40, 3))
    # their half turns, too, and whole turns
    poses[::3, :2] *= -1
    poses[:, 2] += rng.integers(-4, 5, 40) * math.pi
    out = np.full(8, -1)
    count = spread_poses(poses, apart, out)
    expected: list[int] = []
    for n, found in enumerate(poses):
        if len(expected) < 8 and differ(found, poses[expected], apart):
            expected.append(n)
    assert out[:count].tolist() == expected


def apart(poses, least_apart, most):
    picked: list[np.ndarray] = []
    for pose in poses:
        if len(picked) < most and differ(pose, picked, least_apart):
            picked.append(pose)
    return np.array(picked)


def search_twin(pose, radius, rules):
    """As `search_outline`, step by step; returns the starts of the last fits, what they found and its cost."""
    known = SearchRules(*rules)
    scene, half_scene = WallScene(*known.scene), WallScene(*known.half_scene)
    seen = radius[known.rows]
    count, is_seen = len(seen), seen > 0
    levels = np.floor(np.where(is_seen, seen, 0.0) / known.px_per_level + 0.5)
    counter_clockwise = np.roll(known.bank[:, :count].astype(int), -1, axis=1)[:, ::-1]
    off = np.stack([np.abs(levels - np.roll(counter_clockwise, shift, axis=1)) for shift in range(count)], axis=1)
    scores = np.minimum(off, WIDEST)[:, :, is_seen].sum(axis=2)
    best = np.argsort(scores.ravel(), kind="stable")[: known.considered]
    headings = -(best % count) * math.tau / count
    starts = apart(np.column_stack([known.places[best // count], headings]), known.start_apart, known.starts)
    along = [(x, pose[1], pose[2]) for x in known.along]
    across = [(pose[0], y, pose[2]) for y in known.across]
    starts = np.vstack([starts, along, across])
    for scales, most, hopeless in (
        (known.rough, known.likely, math.inf),
        (known.coarse, known.refined, known.hopeless),
    ):
        fits = [fit(start, half_scene, radius[::2].copy(), scales) for start in starts]
        fits.sort(key=lambda found: found[1])
        hopeful = [found for found, cost in fits if cost < fits[0][1] + hopeless]
        starts = apart(hopeful, known.fit_apart, most)
    fits = [fit(start, scene, radius, known.fine) for start in starts]
    return starts, np.array([found for found, _ in fits]), np.array([cost for _, cost in fits])


@settings(deadline=None, max_examples=10)
@given(places, seeds, st.floats(0.0, 0.7))
def test_the_whole_search_agrees_with_its_steps(pose, seed, hidden):
    rng = np.random.default_rng(seed)
    radius = outline(pose, rng, hidden=hidden)
    slid = (0.3, pose.y_m, pose.theta_rad)
    room = np.empty((8, 3)), np.empty((8, 3)), np.empty(8)
    count = search_outline(slid, radius, RULES, *room)
    expected = search_twin(slid, radius, RULES)
    assert count == len(expected[0])
    for found, wanted in zip(room, expected, strict=True):
        np.testing.assert_allclose(found[:count], wanted, atol=1e-6)


@settings(deadline=None, max_examples=20)
@given(places, seeds)
def test_the_search_finds_where_an_outline_was_made_from(pose, seed):
    radius = outline(pose, np.random.default_rng(seed), 0.1, 0.0)
    begun, poses, costs = np.empty((8, 3)), np.empty((8, 3)), np.empty(8)
    count = search_outline((0.0, 0.0, 0.0), radius, RULES, begun, poses, costs)
    errors = [Pose2(*found).error_to(pose, symmetric=True) for found in poses[:count]]
    distance, angle = min(errors)
    assert distance < 0.01
    assert angle < 0.01
    assert costs[errors.index((distance, angle))] == pytest.approx(costs[:count].min(), abs=1e-3)


def test_an_outline_of_nothing_still_gives_fits():
    nothing = np.full(len(MODEL.view.bearing_rad), np.nan)
    begun, poses, costs = np.empty((8, 3)), np.empty((8, 3)), np.empty(8)
    count = search_outline((0.0, 0.0, 0.0), nothing, RULES, begun, poses, costs)
    assert 1 <= count <= 8
    assert np.isfinite(poses[:count]).all()
