"""The compiled loops over branches against plain NumPy twins."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.tracking.branches import (
    MISS,
    BranchArrays,
    Detected,
    DetectionModel,
    Eye,
    MotionModel,
    cast_shadows,
    predict_and_split,
    visible_ratio,
)

EYE = Eye(0.2, -0.1, 0.09)
MODEL = DetectionModel(detection_probability=0.8, clutter_per_m2=0.2, gate=13.8, unknown_ratio=0.05)
STEADY_S, ACCELERATION_MPS2, LIFETIME_S = 1.5, 1.5, 100.0
AXIS, AXIS_WEIGHTS = np.array([-math.sqrt(3.0), 0.0, math.sqrt(3.0)]), np.array([1.0, 4.0, 1.0]) / 6.0
POINTS = np.stack(np.meshgrid(AXIS, AXIS, indexing="ij"), axis=-1).reshape(-1, 2)
WEIGHTS = np.outer(AXIS_WEIGHTS, AXIS_WEIGHTS).ravel()


def motion_model(seconds):
    kept, noise = math.exp(-seconds / STEADY_S), ACCELERATION_MPS2**2
    variances = 0.25 * seconds**4 * noise, 0.5 * seconds**3 * noise, seconds**2 * noise
    return MotionModel(seconds, STEADY_S * (1 - kept), kept, *variances, math.exp(-seconds / LIFETIME_S))


def draw_branches(rng):
    trees = np.sort(rng.integers(1, 4, int(rng.integers(0, 7))))
    count = len(trees)
    root = rng.normal(0, 0.15, (count, 4, 4))
    return BranchArrays(
        trees, rng.normal(0, 0.6, (count, 4)), root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(4),
        rng.normal(0, 2, count), rng.normal(0, 2, count), rng.uniform(0, 1, count), rng.integers(0, 4, count),
        rng.integers(-1, 9, (count, 5)),
    )  # fmt: skip


def draw_detected(rng):
    count = int(rng.integers(0, 5))
    root = rng.normal(0, 0.05, (count, 2, 2))
    spreads = root @ root.transpose(0, 2, 1) + 1e-3 * np.eye(2)
    return Detected(rng.normal(0, 0.6, (count, 2)), spreads, 9 + np.arange(count))


def polar(points):
    away = points - (EYE.x_m, EYE.y_m)
    distance = np.maximum(np.hypot(away[..., 0], away[..., 1]), EYE.radius_m)
    return distance, np.arctan2(away[..., 1], away[..., 0]), np.arcsin(EYE.radius_m / distance)


def plain_visible_ratio(points, places):
    near, at, half_near = polar(places)
    distance, bearing, half = (v[..., None] for v in polar(points))
    apart = np.abs(np.remainder(bearing - at + math.pi, math.tau) - math.pi)
    covered = np.clip((half + half_near - apart) / (2 * half), 0.0, 1.0)
    return 1.0 - np.minimum(np.where(distance > near + EYE.radius_m, covered, 0.0).sum(axis=-1), 1.0)


def plain_prediction(before, seconds):
    kept = math.exp(-seconds / STEADY_S)
    move = np.eye(4)
    move[0, 2] = move[1, 3] = STEADY_S * (1 - kept)
    move[2, 2] = move[3, 3] = kept
    push = np.array([[seconds**2 / 2, 0.0], [0.0, seconds**2 / 2], [seconds, 0.0], [0.0, seconds]])
    there = math.exp(-seconds / LIFETIME_S) / (1 + np.exp(-before.odds))
    return (
        before.mean @ move.T,
        move @ before.covariance @ move.T + push @ push.T * ACCELERATION_MPS2**2,
        np.log(there / (1 - there)),
    )


def plain_miss(mean, covariance, places):
    place = covariance[:2, :2]
    offsets = POINTS @ np.linalg.cholesky(place).T
    weights = WEIGHTS * (1 - MODEL.detection_probability * plain_visible_ratio(mean[:2] + offsets, places))
    likelihood = weights.sum()
    weights = weights / likelihood
    shift = weights @ offsets
    spread = (offsets - shift).T @ np.diag(weights) @ (offsets - shift) + MODEL.unknown_ratio * place
    gain = covariance[:, :2] @ np.linalg.inv(place)
    return mean + gain @ shift, covariance + gain @ (spread - place) @ gain.T, math.log(likelihood)


def plain_hit(mean, covariance, place, spread):
    innovation, off = covariance[:2, :2] + spread, place - mean[:2]
    distance = off @ np.linalg.solve(innovation, off)
    gain = covariance[:, :2] @ np.linalg.inv(innovation)
    density = math.exp(-0.5 * distance) / math.sqrt(np.linalg.det(math.tau * innovation))
    gained = math.log(density * MODEL.detection_probability / MODEL.clutter_per_m2)
    return distance, mean + gain @ off, covariance - gain @ covariance[:2, :], gained


def plain_split(before, detected, seconds):
    """Rows of all fields, tree by tree."""
    mean, covariance, odds = plain_prediction(before, seconds)
    rows = []
    for tree in np.unique(before.tree):
        own = np.flatnonzero(before.tree == tree)
        for k in own:
            now, spread, gained = plain_miss(mean[k], covariance[k], detected.places_m)
            evidence, missed = before.evidence[k] + gained, before.missed[k] + 1
            past = [MISS, *before.history[k, :-1]]
            rows.append((tree, now, spread, evidence, odds[k] + gained, before.coasted_s[k] + seconds, missed, past))
        for k in own:
            for m, number in enumerate(detected.numbers):
                hit = plain_hit(mean[k], covariance[k], detected.places_m[m], detected.spreads[m])
                distance, now, spread, gained = hit
                if distance < MODEL.gate:
                    past = [number, *before.history[k, :-1]]
                    rows.append((tree, now, spread, before.evidence[k] + gained, odds[k] + gained, 0.0, 0, past))
    return rows


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.3))
def test_branches_are_predicted_and_split_as_by_the_plain_twin(seed, seconds):
    rng = np.random.default_rng(seed)
    before, detected = draw_branches(rng), draw_detected(rng)
    untouched = [values.copy() for values in before]
    after = predict_and_split(before, motion_model(seconds), detected, EYE, MODEL)
    expected = plain_split(before, detected, seconds)
    assert [len(values) for values in after] == [len(expected)] * len(after)
    for column, values in enumerate(after):
        for row, wanted in zip(values, expected, strict=True):
            np.testing.assert_allclose(row, wanted[column], rtol=1e-7, atol=1e-9)
    for values, same in zip(before, untouched, strict=True):
        np.testing.assert_array_equal(values, same)


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1))
def test_the_visible_ratio_is_the_plain_twins(seed):
    rng = np.random.default_rng(seed)
    places, points = rng.normal(0, 0.5, (int(rng.integers(0, 5)), 2)), rng.normal(0, 1.0, (6, 2))
    shadows = cast_shadows(places, EYE)
    ratios = [visible_ratio(x, y, shadows, EYE) for x, y in points.tolist()]
    np.testing.assert_allclose(ratios, plain_visible_ratio(points, places), atol=1e-12)


def test_the_visible_ratio_runs_from_hidden_to_open():
    eye = Eye(0.0, 0.0, 0.09)
    shadows = cast_shadows(np.array([[0.5, 0.0]]), eye)
    points = [(1.0, 0.0), (1.0, 0.18), (1.0, 0.27), (1.0, 0.5), (0.3, 0.0)]
    hidden, half, most, beside, before = (visible_ratio(x, y, shadows, eye) for x, y in points)
    assert hidden == pytest.approx(0.0)
    assert 0.0 < half < most <= 1.0
    assert beside == before == 1.0
