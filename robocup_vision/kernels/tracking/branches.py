"""Compiled prediction of the branches of track trees, and their splitting over the detections of a frame."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled, variable

# detection number of a frame without one
MISS = -1
# Gauss-Hermite points of a normal distribution and their weights, three on each axis
_AXIS = (-math.sqrt(3.0), 0.0, math.sqrt(3.0))
_AXIS_WEIGHTS = (1.0 / 6.0, 4.0 / 6.0, 1.0 / 6.0)
_AXIS_POINTS = 3
# least variance of a place across its first axis, m^2
_MIN_VARIANCE = 1e-12


class BranchArrays(NamedTuple):
    """Branches as `robocup_vision.tracking.branches.Branches` describes them, L of each."""

    tree: Int64Array
    mean: FloatArray
    covariance: FloatArray
    evidence: FloatArray
    odds: FloatArray
    coasted_s: FloatArray
    missed: Int64Array
    history: Int64Array


class Detected(NamedTuple):
    """Detections of a frame: (M, 2) places in the field frame, (M, 2, 2) covariances, (M,) running numbers."""

    places_m: FloatArray
    spreads: FloatArray
    numbers: Int64Array


class MotionModel(NamedTuple):
    """Motion of objects from one frame to the next.

    travel_s : time for which the velocity of the last frame acts, seconds.
    kept_ratio : remaining fraction of the velocity.
    place_noise, shared_noise, velocity_noise : process noise on each axis: variances and covariance.
    survival : probability that an object stays on the field.
    """

    seconds: float
    travel_s: float
    kept_ratio: float
    place_noise: float
    shared_noise: float
    velocity_noise: float
    survival: float


class DetectionModel(NamedTuple):
    """Parameters of the detection of objects, see `tracking.branches`."""

    detection_probability: float
    clutter_per_m2: float
    gate: float
    unknown_ratio: float


class Eye(NamedTuple):
    """The robot's place in the field frame, and the radius of the objects' discs, metres."""

    x_m: float
    y_m: float
    radius_m: float


@compiled(error_model="numpy")
def predict_and_split(
    before: BranchArrays, motion: MotionModel, detected: Detected, eye: Eye, model: DetectionModel
) -> BranchArrays:
    """Return one branch without a detection for each of the last frame, and one for each detection in its gate.

    Branches come tree by tree; within each first the missed ones, then those with a detection.
    """
    count = before.tree.shape[0]
    mean, covariance, odds = before.mean.copy(), before.covariance.copy(), before.odds.copy()
    for k in range(count):
        _predict(motion, mean[k], covariance[k])
        # log(p s / (1 - p s)) of the existence probability p and the survival probability s
        odds[k] = -math.log(math.exp(-odds[k]) / motion.survival + (1.0 / motion.survival - 1.0))
    shadows = cast_shadows(detected.places_m, eye)
    hits = 0
    for k in range(count):
        for m in range(detected.numbers.shape[0]):
            hits += _distance(mean[k], covariance[k], detected.places_m[m], detected.spreads[m])[0] < model.gate
    rows, frames = count + hits, before.history.shape[1]
    after = BranchArrays(
        np.empty(rows, dtype=np.int64),
        np.empty((rows, 4)),
        np.empty((rows, 4, 4)),
        np.empty(rows),
        np.empty(rows),
        np.empty(rows),
        np.empty(rows, dtype=np.int64),
        np.empty((rows, frames), dtype=np.int64),
    )
    row, first = variable(0), 0
    while first < count:
        last = first
        while last < count and before.tree[last] == before.tree[first]:
            last += 1
        for k in range(first, last):
            likelihood = _miss(mean[k], covariance[k], shadows, eye, model, after.mean[row], after.covariance[row])
            after.evidence[row] = before.evidence[k] + math.log(likelihood)
            after.odds[row] = odds[k] + math.log(likelihood)
            after.coasted_s[row] = before.coasted_s[k] + motion.seconds
            after.missed[row] = before.missed[k] + 1
            _remember(before, k, variable(MISS), after, row)
            row += 1
        for k in range(first, last):
            for m in range(detected.numbers.shape[0]):
                place, spread = detected.places_m[m], detected.spreads[m]
                distance, area = _distance(mean[k], covariance[k], place, spread)
                if not distance < model.gate:
                    continue
                _hit(mean[k], covariance[k], place, spread, area, after.mean[row], after.covariance[row])
                gained = -0.5 * distance - 0.5 * math.log(area) - math.log(math.tau)
                gained += math.log(model.detection_probability / model.clutter_per_m2)
                after.evidence[row] = before.evidence[k] + gained
                after.odds[row] = odds[k] + gained
                after.coasted_s[row] = 0.0
                after.missed[row] = 0
                _remember(before, k, detected.numbers[m], after, row)
                row += 1
        first = last
    return after


@compiled(error_model="numpy")
def _predict(motion: MotionModel, mean: FloatArray, covariance: FloatArray) -> None:
    """Predict one branch: its velocity decays, and white acceleration is added."""
    travel, kept = motion.travel_s, motion.kept_ratio
    for axis in range(2):
        mean[axis] += travel * mean[2 + axis]
        mean[2 + axis] *= kept
    # rows, then columns
    for column in range(4):
        for axis in range(2):
            covariance[axis, column] += travel * covariance[2 + axis, column]
            covariance[2 + axis, column] *= kept
    for row in range(4):
        for axis in range(2):
            covariance[row, axis] += travel * covariance[row, 2 + axis]
            covariance[row, 2 + axis] *= kept
    for axis in range(2):
        covariance[axis, axis] += motion.place_noise
        covariance[axis, 2 + axis] += motion.shared_noise
        covariance[2 + axis, axis] += motion.shared_noise
        covariance[2 + axis, 2 + axis] += motion.velocity_noise


@compiled(error_model="numpy")
def _distance(mean: FloatArray, covariance: FloatArray, place: FloatArray, spread: FloatArray) -> tuple[float, float]:
    """Return a detection's squared Mahalanobis distance from a branch, and the innovation covariance's determinant."""
    x, y = place[0] - mean[0], place[1] - mean[1]
    a, b, d = covariance[0, 0] + spread[0, 0], covariance[0, 1] + spread[0, 1], covariance[1, 1] + spread[1, 1]
    determinant = a * d - b * b
    return (d * x * x - 2.0 * b * x * y + a * y * y) / determinant, determinant


@compiled(error_model="numpy")
def _hit(
    mean: FloatArray,
    covariance: FloatArray,
    place: FloatArray,
    spread: FloatArray,
    area: float,
    new_mean: FloatArray,
    new_covariance: FloatArray,
) -> None:
    """Write a branch updated with a detection; `area` is the determinant of the innovation covariance."""
    x, y = place[0] - mean[0], place[1] - mean[1]
    a, b, d = covariance[0, 0] + spread[0, 0], covariance[0, 1] + spread[0, 1], covariance[1, 1] + spread[1, 1]
    for i in range(4):
        along = (covariance[i, 0] * d - covariance[i, 1] * b) / area
        aside = (covariance[i, 1] * a - covariance[i, 0] * b) / area
        new_mean[i] = mean[i] + along * x + aside * y
        for j in range(4):
            new_covariance[i, j] = covariance[i, j] - along * covariance[0, j] - aside * covariance[1, j]


@compiled(error_model="numpy")
def _miss(
    mean: FloatArray,
    covariance: FloatArray,
    shadows: FloatArray,
    eye: Eye,
    model: DetectionModel,
    new_mean: FloatArray,
    new_covariance: FloatArray,
) -> float:
    """Write a branch without a detection and return its likelihood; its place moves towards where it would be hidden.

    The place's density is weighted at points around its mean and approximated by a normal distribution; the velocity
    follows by its covariance with the place.
    """
    a, b, d = covariance[0, 0], covariance[0, 1], covariance[1, 1]
    root_xx = math.sqrt(a)
    root_xy = b / root_xx
    root_yy = math.sqrt(max(d - root_xy * root_xy, _MIN_VARIANCE))
    total, sum_x, sum_y, sum_xx, sum_xy, sum_yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(_AXIS_POINTS):
        for j in range(_AXIS_POINTS):
            x = root_xx * _AXIS[i]
            y = root_xy * _AXIS[i] + root_yy * _AXIS[j]
            seen = model.detection_probability * visible_ratio(mean[0] + x, mean[1] + y, shadows, eye)
            weight = _AXIS_WEIGHTS[i] * _AXIS_WEIGHTS[j] * (1.0 - seen)
            total += weight
            sum_x += weight * x
            sum_y += weight * y
            sum_xx += weight * x * x
            sum_xy += weight * x * y
            sum_yy += weight * y * y
    shift_x, shift_y = sum_x / total, sum_y / total
    # change of the place's covariance; the term with `unknown_ratio` bounds how much nine points can reduce it
    more_xx = sum_xx / total - shift_x * shift_x - (1.0 - model.unknown_ratio) * a
    more_xy = sum_xy / total - shift_x * shift_y - (1.0 - model.unknown_ratio) * b
    more_yy = sum_yy / total - shift_y * shift_y - (1.0 - model.unknown_ratio) * d
    area = a * d - b * b
    for i in range(4):
        along = (covariance[i, 0] * d - covariance[i, 1] * b) / area
        aside = (covariance[i, 1] * a - covariance[i, 0] * b) / area
        new_mean[i] = mean[i] + along * shift_x + aside * shift_y
        for j in range(4):
            along_j = (covariance[j, 0] * d - covariance[j, 1] * b) / area
            aside_j = (covariance[j, 1] * a - covariance[j, 0] * b) / area
            grown = along * (more_xx * along_j + more_xy * aside_j) + aside * (more_xy * along_j + more_yy * aside_j)
            new_covariance[i, j] = covariance[i, j] + grown
    return total


@compiled(error_model="numpy")
def cast_shadows(places_m: FloatArray, eye: Eye) -> FloatArray:
    """Return (M, 3): distance, bearing and half angle of the disc at each of the places (M, 2)."""
    shadows = np.empty((places_m.shape[0], 3))
    for m in range(places_m.shape[0]):
        shadows[m, 0], shadows[m, 1], shadows[m, 2] = _polar(places_m[m, 0], places_m[m, 1], eye)
    return shadows


@compiled(error_model="numpy")
def visible_ratio(x_m: float, y_m: float, shadows: FloatArray, eye: Eye) -> float:
    """Visible fraction of the width of a disc at (x, y); `shadows` as `cast_shadows` returns them."""
    distance, bearing, half = _polar(x_m, y_m, eye)
    covered = 0.0
    for m in range(shadows.shape[0]):
        if distance > shadows[m, 0] + eye.radius_m:
            apart = abs((bearing - shadows[m, 1] + math.pi) % math.tau - math.pi)
            covered += min(max((half + shadows[m, 2] - apart) / (2.0 * half), 0.0), 1.0)
    return 1.0 - min(covered, 1.0)


@compiled(error_model="numpy")
def _polar(x_m: float, y_m: float, eye: Eye) -> tuple[float, float, float]:
    """Return distance and bearing of a disc from the viewpoint, and half the angle that it covers."""
    dx, dy = x_m - eye.x_m, y_m - eye.y_m
    distance = max(math.hypot(dx, dy), eye.radius_m)
    return distance, math.atan2(dy, dx), math.asin(eye.radius_m / distance)


@compiled
def _remember(before: BranchArrays, index: int, number: int, after: BranchArrays, row: int) -> None:
    """Write the tree and the latest detections of a branch that continues another."""
    after.tree[row] = before.tree[index]
    after.history[row, 0] = number
    for frame in range(1, before.history.shape[1]):
        after.history[row, frame] = before.history[index, frame - 1]
