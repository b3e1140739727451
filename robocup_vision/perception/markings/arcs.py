"""Circles and arcs of the field's radii in the line points of one frame, on the floor, without a pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.markings.correlated_errors import FloorErrors, common_covariance
from robocup_vision.perception.markings.line_pieces import LinePieces
from robocup_vision.perception.markings.marking import GATE_SIGMAS
from robocup_vision.perception.markings.straight import (
    GATE_PX,
    MIN_BARE_RATIO,
    MIN_POINTS,
    NOISE_PX,
    POINTS_PER_SAMPLE,
    SLACK_WIDTHS,
    STRAIGHT_NATS,
    fit_line,
    is_bare,
    middle_shifts_m,
    scale_m,
)

# deviations of the camera's tilt that are tested, standard deviations
_SWAYS = (-1.3, 0.0, 1.3)
_FIT_STEPS = 8
# iteration from which the circle is accurate enough for a correction of its line's middle by perspective
_MIDDLE_STEP = 5
# half the arc over which a circle's curvature in the picture is measured
_BEND_RAD = 0.05
# parts of a turn in which an arc's extent is counted
_PARTS = 36
# greatest number of pieces, evenly spread, that propose a centre on either side
_MAX_VOTERS = 60
# width of a proposal's gate, in gates
_WIDE = 3.0
# smallest visible part of a circle
_MIN_ARC_RAD = math.radians(70.0)
# greatest noise of points of a circle; lines that resemble one have more
_MAX_ARC_PX = 0.35


@dataclass(frozen=True, slots=True, eq=False)
class Arc:
    """An arc of a circle."""

    center_m: FloatArray  #: (2,) float64: centre of the circle, robot frame
    covariance: FloatArray  #: (2, 2) float64: covariance of `center_m`, including the errors of the camera's attitude
    deviations: FloatArray  #: (K,) float64: fitted errors of the attitude, standard deviations
    cost_nats: float  #: half the sum of the samples' squared normalised residuals
    noise_px: float  #: standard deviation of the points
    radius_m: float  #: radius of the field's circle
    points: Int64Array  #: (P,) int64: indices of its line points


def find_arcs(
    points: LinePoints,
    pieces: LinePieces,
    errors: FloorErrors,
    line_width_m: float,
    common_px: float,
    radii_m: FloatArray,
    free: BoolArray,
) -> list[Arc]:
    """Return the arcs of these radii, the one with most points first.

    Arguments as in `find_straight`; `common_px`: see `common_error_px`; `free` (N,) and `pieces` are those on no
    straight line.
    """
    slack_m = SLACK_WIDTHS * line_width_m
    shifts = errors.shifts_m(points.pixels) if len(radii_m) else np.empty((0, 2, 0))
    piece_shifts = errors.shifts_m(pieces.pixels)
    free = free.copy()
    found: list[Arc] = []
    # at most as many as the field has
    for radius, most in zip(*(part.tolist() for part in np.unique(radii_m, return_counts=True)), strict=True):
        for _ in range(most):
            start = _propose(pieces, piece_shifts, radius, slack_m)
            if start is None:
                break
            arc = _fit(points, shifts, free, *start, radius, errors, line_width_m, common_px)
            if arc is None or _shows_carpet(points, errors, arc) or _may_be_straight(points, arc):
                break
            found.append(arc)
            free[arc.points] = False
            taken = np.abs(np.hypot(*(pieces.floor_m - arc.center_m).T) - radius) < 0.3 * radius
            pieces, piece_shifts = pieces.take(~taken), piece_shifts[~taken]
    return sorted(found, key=lambda one: -len(one.points))


def _propose(
    pieces: LinePieces, shifts: FloatArray, radius_m: float, slack_m: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return the centre (2,) and the camera's errors (K,) with most inlier pieces; None if there are too few."""
    if len(pieces) < 4:
        return None
    errors = shifts.shape[-1]
    best, best_score = None, float(MIN_POINTS)
    a, b, c, d = pieces.floor_per_px.reshape(-1, 4).T
    way_x, way_y = (
        a * pieces.along_px[:, 0] + b * pieces.along_px[:, 1],
        c * pieces.along_px[:, 0] + d * pieces.along_px[:, 1],
    )
    length = np.maximum(np.hypot(way_x, way_y), 1e-12)
    normal = np.stack([way_y / length, -way_x / length], axis=1)
    voters = np.linspace(0, len(pieces) - 1, min(len(pieces), _MAX_VOTERS)).astype(np.int64)
    for sway in _SWAYS if errors else (0.0,):
        deviations = np.zeros(errors)
        deviations[:1] = sway
        floor = pieces.floor_m + shifts @ deviations
        centers = np.vstack([floor[voters] + sign * radius_m * normal[voters] for sign in (1, -1)])
        x, y = floor[:, 0] - centers[:, :1], floor[:, 1] - centers[:, 1:]
        away = np.maximum(np.hypot(x, y), 1e-9)
        x, y = x / away, y / away
        near = np.abs(away - radius_m) <= _WIDE * GATE_PX * pieces.across_m_per_px(x, y) + slack_m
        near &= pieces.is_along(-y, x)
        score = near @ pieces.weight
        at = int(np.argmax(score))
        if score[at] > best_score:
            best, best_score = (centers[at], deviations), float(score[at])
    return best


def _fit(
    points: LinePoints,
    shifts: FloatArray,
    free: BoolArray,
    center_m: FloatArray,
    deviations: FloatArray,
    radius_m: float,
    errors: FloorErrors,
    line_width_m: float,
    common_px: float,
) -> Arc | None:
    """Fit centre and camera jointly; None if too little of the circle is visible."""
    slack_m = SLACK_WIDTHS * line_width_m
    left = np.flatnonzero(free)
    floor, shifts, bend_px = points.floor_m[left], shifts[left], np.zeros(len(left))
    per_px, own = points.floor_per_px[left], points.weight[left]
    state = np.concatenate([center_m, deviations])
    prior = np.diag(np.concatenate([np.zeros(2), np.ones(len(deviations))]))
    gate = _WIDE * GATE_PX
    for step in range(_FIT_STEPS):
        if step == _MIDDLE_STEP:
            floor, shifts, bend_px = _middles(points.pixels[left], per_px, errors, state, radius_m, line_width_m)
        off = floor + shifts @ state[2:] - state[:2]
        away = np.maximum(np.hypot(*off.T), 1e-9)
        outward = off / away[:, None]
        scale = _scale_m(per_px, outward)
        near = np.abs(away - radius_m) <= gate * scale + slack_m
        if np.count_nonzero(near) < MIN_POINTS:
            return None
        rows = np.concatenate([-outward, np.einsum("ni,nik->nk", outward, shifts)], axis=1)[near]
        residual_px = (away - radius_m)[near] / scale[near]
        rows /= scale[near, None]
        noise_px = max(NOISE_PX, math.sqrt(float(own[near] @ residual_px**2 / own[near].sum())))
        weight = own[near] / (POINTS_PER_SAMPLE * (noise_px**2 + bend_px[near] ** 2))
        information = (rows.T * weight) @ rows + prior
        change = np.linalg.solve(
            information + 1e-9 * np.eye(len(state)), (rows.T * weight) @ residual_px + prior @ state
        )
        state = state - change
        gate = max(GATE_PX, 0.7 * gate)
    if noise_px > _MAX_ARC_PX or (np.abs(state[2:]) > GATE_SIGMAS).any():
        return None
    turn = np.arctan2(outward[near, 1], outward[near, 0])
    parts = np.unique((turn / math.tau * _PARTS).astype(np.int64) % _PARTS)
    if len(parts) * math.tau / _PARTS < _MIN_ARC_RAD:
        return None
    covariance = np.linalg.inv(information + 1e-9 * np.eye(len(state)))
    gain = covariance @ (rows.T * weight)
    covariance += common_covariance(gain, points.pixels[left[near]], np.hypot(common_px, bend_px[near]))
    cost = 0.5 * float(weight @ residual_px**2)
    return Arc(state[:2], covariance[:2, :2], state[2:], cost, noise_px, radius_m, left[near])


def _scale_m(per_px: FloatArray, outward: FloatArray) -> FloatArray:
    """Return the motion (P,) of points along their own directions for a step in the picture, metres for each pixel."""
    return np.asarray(np.linalg.norm(np.einsum("nij,ni->nj", per_px, outward), axis=1))


def _middles(
    pixels: FloatArray,
    per_px: FloatArray,
    errors: FloorErrors,
    state: FloatArray,
    radius_m: float,
    line_width_m: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return points (P, 2) on the middle of a circle's line, their shifts (P, 2, K) and errors (P,), pixels.

    `state` (2 + K,) holds the approximate centre and errors of the attitude, at which the shifts are linearised,
    because those of far places depend on the tilt. A line is crossed along one of four axes of the picture, and between
    the edges of a curved line the middle of the crossing is displaced inwards by half**2 tan(angle)**2 / (2 r), where
    half is half its width and r its radius of curvature in the picture.
    """
    fitted = errors.moved(state[2:])
    camera, shifts = fitted.camera, fitted.shifts_m(pixels)
    floor = camera.pixel_to_floor(pixels)
    outward = floor - state[:2]
    outward /= np.maximum(np.hypot(*outward.T), 1e-9)[:, None]
    places = state[:2] + radius_m * outward
    along = _BEND_RAD * np.stack([-outward[:, 1], outward[:, 0]], axis=1)
    ends = [
        camera.floor_to_pixel(places + radius_m * (sign * along - 0.5 * _BEND_RAD**2 * outward)) for sign in (1, -1)
    ]
    chord = np.hypot(*(ends[1] - ends[0]).T)
    sagitta = np.hypot(*((ends[0] + ends[1]) / 2 - camera.floor_to_pixel(places)).T)
    curvature = 8 * sagitta / np.maximum(chord, 1e-9) ** 2
    half_px = 0.5 * line_width_m / _scale_m(per_px, outward)
    bend_px = np.nan_to_num(0.5 * (half_px * math.tan(math.pi / 8)) ** 2 * curvature)
    floor = floor - middle_shifts_m(camera, places, outward, line_width_m) - shifts @ state[2:]
    return floor, shifts, bend_px


def _shows_carpet(points: LinePoints, errors: FloorErrors, arc: Arc) -> bool:
    """Whether bare carpet covers much of the circle as far as it is in view."""
    turn = np.linspace(0.0, math.tau, 2 * _PARTS, endpoint=False)
    circle = arc.center_m + arc.radius_m * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    camera = errors.camera
    # pixels for the fitted attitude
    shifted = circle - errors.shifts_m(camera.floor_to_pixel(circle)) @ arc.deviations
    bare = np.count_nonzero(is_bare(points, camera.floor_to_pixel(shifted)))
    turn = np.arctan2(*(points.floor_m[arc.points] - arc.center_m).T[::-1])
    seen = len(np.unique((turn / math.tau * 2 * _PARTS).astype(np.int64) % (2 * _PARTS)))
    return bool(bare > MIN_BARE_RATIO * seen)


def _may_be_straight(points: LinePoints, arc: Arc) -> bool:
    """Whether a straight line is about equally likely."""
    angle, distance, _, _ = fit_line(points, arc.points, _angle_of(points.floor_m[arc.points]))
    normal = np.array([math.cos(angle), math.sin(angle)])
    residual_px = (points.floor_m[arc.points] @ normal - distance) / scale_m(points, arc.points, normal)
    variance = POINTS_PER_SAMPLE * arc.noise_px**2
    cost = 0.5 * float(points.weight[arc.points] @ residual_px**2) / variance
    return cost - arc.cost_nats < STRAIGHT_NATS


def _angle_of(floor_m: FloatArray) -> float:
    """Return the direction of the normal of a line through places."""
    way = np.linalg.svd(floor_m - floor_m.mean(axis=0), full_matrices=False)[2][0]
    return math.atan2(-way[0], way[1])
