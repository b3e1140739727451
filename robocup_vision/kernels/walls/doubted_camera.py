"""Compiled loops that fit how a camera looks together with the pose: its centre and tilt, or the lean of its body.

A centre half a pixel off its file moves a far wall by centimetres, and the pose with it; so does a body that leans by
half a degree. They bend the outline in a way that no pose does: what the fit of the pose leaves over tells of them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, UInt64Array
from robocup_vision.compiling.loops import compiled, flag
from robocup_vision.kernels.algebra.cholesky import factor, substitute
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FitSummary,
    FloorOutline,
    Vector,
    WallPrediction,
    WallScene,
    agreement,
    inliers_of,
    position_std_m,
    predict_walls,
    room_for,
    settle,
    summarise_fit,
    tabulated,
    thinned,
    truncated_loss,
    turned_rate,
)

SIZE = 7  # x, y, theta; centre of the image along bearing 0 and a quarter turn on, pixels; turns about x and y
STEPS = 4
ONE, TWO, THREE, FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
MIN_NOISE = 0.3  # of what is said of a bearing: exact outlines have errors of the tables


class CameraDoubt(NamedTuple):
    """How a camera may look otherwise than its file says.

    Parameters
    ----------
    noise_px : float
        Standard deviation of a bearing's edge.
    center_std_px, turn_std_rad : float
        Of the centre, and of turns about the robot's x and y axes.
    turns_body : bool
        Whether the body turns about its foot and carries the camera along, or the camera turns by itself.
    """

    noise_px: float
    center_std_px: float
    turn_std_rad: float
    turns_body: bool


class DoubtedFit(NamedTuple):
    """Normal equations of the unknowns, written in place.

    Parameters
    ----------
    information, scatter : (7, 7) float64
        Sum of w J^T J, without the prior; sum over groups of neighbouring bearings of g g^T, g the group's sum of
        w e J: the residuals' true scatter.
    pull : (7,) float64
        Sum of w e J.
    """

    information: FloatArray
    scatter: FloatArray
    pull: FloatArray


@compiled(error_model="numpy", fastmath={"reassoc", "nsz", "contract"})
def gather_doubted(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    turns_body: bool,
    fit: DoubtedFit,
) -> tuple[float, float]:
    """Add up the normal equations of pose, centre and turns; returns the sums of w e^2 and of w.

    Parameters
    ----------
    unknowns : (7,) float64
        Where the fit stands, as in `fit_with_camera`.
    scene, outline : WallScene, FloorOutline
        The scene is turned already. Of the outline's scales the last counts.
    prediction : WallPrediction
        From this pose and scene.
    turns_body : bool
        As in `CameraDoubt`.
    fit : DoubtedFit
        Result.
    """
    count = scene.cos_b.shape[0]
    # derivatives and, last, residuals; then the same times their weights: a column a bearing, side by side
    rows, weighed = np.empty((SIZE + 1, count)), np.empty((SIZE + 1, count))
    which = np.empty(count, np.uint64)
    used = 0
    for k in range(count):
        which[used] = k
        used += (outline.radius[k] > 0.0) & (prediction.wall[k] >= 0)
    squares, total = _linearise(unknowns, scene, outline, prediction, turns_body, which[:used], rows, weighed)
    for i in range(SIZE):
        for j in range(i + 1):
            added = 0.0
            for n in range(np.uint64(used)):
                added += weighed[i, n] * rows[j, n]
            fit.information[i, j] = fit.information[j, i] = added
    # what four bearings pull errs together
    groups = used // 4
    pulls = np.empty((SIZE, groups))
    for i in range(SIZE):
        pulled = 0.0
        for n in range(np.uint64(used)):
            weighed[i, n] *= rows[SIZE, n]
            pulled += weighed[i, n]
        fit.pull[i] = pulled
        for g in range(np.uint64(groups)):
            at = FOUR * g
            pulls[i, g] = weighed[i, at] + weighed[i, at + ONE] + weighed[i, at + TWO] + weighed[i, at + THREE]
    for i in range(SIZE):
        for j in range(i + 1):
            added = 0.0
            for g in range(np.uint64(groups)):
                added += pulls[i, g] * pulls[j, g]
            fit.scatter[i, j] = fit.scatter[j, i] = added
    return squares, total


@compiled(error_model="numpy", fastmath={"reassoc", "nsz", "contract"})
def _linearise(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    turns_body: bool,
    which: UInt64Array,
    rows: FloatArray,
    weighed: FloatArray,
) -> tuple[float, float]:
    """Write derivatives and residuals of some bearings, plain and times their weights; return as `gather_doubted`."""
    plane, best_q, best_wall = prediction.planes.reshape(-1), prediction.q, prediction.wall
    cos_b, sin_b, radius, height = scene.cos_b, scene.sin_b, outline.radius, scene.height
    to_camera = scene.robot_to_camera
    per_scale, per_height = 1.0 / outline.scales[outline.scales.shape[0] - 1], 1.0 / height
    cos_t, sin_t, center_u, center_v = math.cos(unknowns[2]), math.sin(unknowns[2]), unknowns[3], unknowns[4]
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = to_camera[0], to_camera[1], to_camera[2]
    # how the viewpoint moves by theta
    swing_x = -sin_t * scene.offset_x - cos_t * scene.offset_y
    swing_y = cos_t * scene.offset_x - sin_t * scene.offset_y
    # a body that turns moves the viewpoint, as a pose does: about x to the right, about y ahead
    lever = height if turns_body else 0.0
    squares, total = 0.0, 0.0
    for n in range(np.uint64(which.shape[0])):
        k = which[n]
        at = FOUR * np.uint64(best_wall[k])
        c, s, q = cos_b[k], sin_b[k], best_q[k]
        along, aside = plane[at], plane[at + ONE]
        predicted, slope = tabulated(outline, q)
        turn = slope * (aside * c - along * s) / predicted
        oblique = 1.0 / math.sqrt(1.0 + turn * turn)
        by_u, by_v = oblique * (c + turn * s), oblique * (s - turn * c)
        e = (radius[k] - predicted) * oblique - by_u * center_u - by_v * center_v
        by_q = slope * oblique
        fall = by_q * (z0 * c + z1 * s - z2 * (q * height))
        by_x, by_y = -fall * plane[at + THREE], fall * plane[at + TWO]
        t0, t1, t2 = turned_rate(c, s, q * height, along, aside, per_height)
        by_t0, by_t1, by_t2 = by_q * t0, by_q * t1, by_q * t2
        by_theta = z0 * by_t0 + z1 * by_t1 + z2 * by_t2 + swing_x * by_x + swing_y * by_y
        by_ahead, by_left = cos_t * by_x + sin_t * by_y, cos_t * by_y - sin_t * by_x
        about_x = x0 * by_t0 + x1 * by_t1 + x2 * by_t2 - lever * by_left
        about_y = y0 * by_t0 + y1 * by_t1 + y2 * by_t2 + lever * by_ahead
        weight = agreement(e, per_scale)
        squares += weight * e * e
        total += weight
        rows[0, n], rows[1, n], rows[2, n], rows[3, n], rows[4, n] = by_x, by_y, by_theta, by_u, by_v
        rows[5, n], rows[6, n], rows[7, n], weighed[7, n] = about_x, about_y, e, weight
    for i in range(SIZE):
        for n in range(np.uint64(which.shape[0])):
            weighed[i, n] = weighed[SIZE, n] * rows[i, n]
    return squares, total


@compiled
def _file_information(doubt: CameraDoubt, i: int) -> float:
    """Return the information that the file has of an unknown, in bearings; next to none of the pose."""
    if i < 3:
        return 1e-6
    return (doubt.noise_px / (doubt.center_std_px if i < 5 else doubt.turn_std_rad)) ** 2


@compiled
def _add_prior(doubt: CameraDoubt, fit: DoubtedFit, system: FloatArray) -> None:
    """Write the information, lower triangle, with that of the file."""
    for i in range(SIZE):
        for j in range(i + 1):
            system[i, j] = fit.information[i, j]
        system[i, i] += _file_information(doubt, i)


@compiled
def _gain(doubt: CameraDoubt, fit: DoubtedFit, system: FloatArray, squares: float, total: float) -> float:
    """Return what one step away from the file gains, see `doubts_of_camera`; `system` (7, 7) is for work."""
    step = fit.pull.copy()
    _add_prior(doubt, fit, system)
    if not factor(system, SIZE):
        return 0.0
    # the leading block's factor is the factor's leading block
    gain = 0.0
    for i in range(SIZE):
        for j in range(i):
            step[i] -= system[i, j] * step[j]
        step[i] /= system[i, i]
        if i >= 3:
            gain += step[i] * step[i]
    left = max((squares - gain) / total, (MIN_NOISE * doubt.noise_px) ** 2)
    return float(gain / left)


@compiled
def doubts_of_camera(
    pose: FloatArray, scene: WallScene, outline: FloorOutline, lean: CameraDoubt, file: CameraDoubt
) -> tuple[float, float]:
    """Tell by how much a lean, or another centre and tilt, would explain an outline better.

    Parameters
    ----------
    pose : (3,) float64
        x, y, theta, as `settle` left it.
    scene, outline : WallScene, FloorOutline
        What it was fitted to.
    lean, file : CameraDoubt
        What may be. A body's turn and a camera's gain the same: the pose makes up for the viewpoint.

    Returns
    -------
    (float, float)
        For each: decrease of the weighted sum of squares in one step, over the mean square that is left.
    """
    prediction = room_for(scene)
    fit = DoubtedFit(np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE))
    predict_walls(pose, scene, prediction)
    return _gather_doubts(pose, scene, outline, prediction, lean, file, fit)


@compiled(inline="always")
def _gather_doubts(
    pose: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    lean: CameraDoubt,
    file: CameraDoubt,
    fit: DoubtedFit,
) -> tuple[float, float]:
    """Fill the normal equations about a pose from which walls are predicted; return as `doubts_of_camera`."""
    unknowns, system = np.zeros(SIZE), np.empty((SIZE, SIZE))
    for i in range(3):
        unknowns[i] = pose[i]
    squares, total = gather_doubted(unknowns, scene, outline, prediction, flag(False), fit)
    if not total > SIZE:
        return 0.0, 0.0
    return _gain(lean, fit, system, squares, total), _gain(file, fit, system, squares, total)


class UprightRules(NamedTuple):
    """What an upright body's outline is compared with: the same for all frames of a camera.

    Parameters
    ----------
    scene : WallScene
        The walls, and the camera that sees them.
    q_step, radius_of_q, unit_px
        As in `FloorOutline`.
    inlier_px, inflate, systematic : float
        As `summarise_fit` takes them.
    lean, file : CameraDoubt
        A body that may lean, and a camera that may be off its file.
    """

    scene: WallScene
    q_step: float
    radius_of_q: FloatArray
    unit_px: float
    inlier_px: float
    inflate: float
    systematic: float
    lean: CameraDoubt
    file: CameraDoubt


@compiled
def fit_upright(
    start: Vector,
    radius: FloatArray,
    scales: FloatArray,
    rules: UprightRules,
    lines: FloatArray,
    covariance: FloatArray,
) -> tuple[Vector, int, float, float, float, float, float, float]:
    """Fit an upright body's pose, and ask what a lean or another camera would explain: all of a frame in one call.

    Parameters
    ----------
    start : (float, float, float)
        x, y, theta where to start.
    radius, scales : (K,), (I,) float64
        As in `FloorOutline`.
    rules : UprightRules
        May be plain.
    lines : (2, K) float64
        Result: residual in pixels along the edge's normal, positive where floor is seen beyond the wall, NaN where
        none; and image radius of the nearest wall's foot, NaN where none.
    covariance : (3, 3) float64
        Result.

    Returns
    -------
    tuple
        Pose; number of bearings with an edge; the values of a `FitSummary`; and what `doubts_of_camera` tells of the
        fit, by the last of the scales.
    """
    known = UprightRules(*rules)
    scene = WallScene(*known.scene)
    outline = FloorOutline(radius, known.q_step, known.radius_of_q, scales, known.unit_px)
    unknowns, prediction = np.zeros(SIZE), room_for(scene)
    pose = unknowns[:3]
    pose[0], pose[1], pose[2] = start
    fine = Comparison(scene, outline, prediction)
    settle(pose, fine, thinned(fine))
    fit = DoubtedFit(np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE))
    by_lean, by_file = _gather_doubts(
        pose, scene, outline, prediction, CameraDoubt(*known.lean), CameraDoubt(*known.file), fit
    )
    cost, seen = _compare(unknowns, scene, outline, prediction, lines[0], lines[1])
    ratio, rms, along = summarise_fit(
        lines[0], known.inlier_px, fit.information, fit.scatter, known.inflate, known.systematic, covariance
    )
    return (pose[0], pose[1], pose[2]), seen, cost, ratio, rms, along, by_lean, by_file


@compiled
def turned_scene(scene: WallScene, about_x: float, about_y: float, turns_body: bool) -> WallScene:
    """Return the scene of a camera, or a body, turned about the robot's x axis, ahead, and then its y axis, left."""
    to_camera, turned = scene.robot_to_camera, np.empty((3, 3))
    cx, sx, cy, sy = math.cos(about_x), math.sin(about_x), math.cos(about_y), math.sin(about_y)
    for i in range(3):
        ahead, left, up = to_camera[i, 0], to_camera[i, 1], to_camera[i, 2]
        raised = sx * left + cx * up
        turned[i, 0] = cy * ahead + sy * raised
        turned[i, 1] = cx * left - sx * up
        turned[i, 2] = cy * raised - sy * ahead
    x, y, height = scene.offset_x, scene.offset_y, scene.height
    if turns_body:
        x, y = cy * x + sy * (sx * y + cx * height), cx * y - sx * height
    # inverse ranges are those of the upright camera's height
    return WallScene(scene.walls, x, y, height, turned, scene.cos_b, scene.sin_b)


@compiled
def fit_with_camera(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    doubt: CameraDoubt,
    inlier_px: float,
    inflate: float,
    systematic: float,
    residual: FloatArray,
    predicted: FloatArray,
    covariance: FloatArray,
) -> FitSummary:
    """Fit pose, centre and turns to an outline; what the camera file says is a prior.

    Parameters
    ----------
    unknowns : (7,) float64
        In: a pose near by, then zeros. Out: x, y, theta; centre along bearing 0 and a quarter turn on, pixels from
        where the file puts it; turns about the robot's x and y axes, radians beyond the file's.
    scene, outline : WallScene, FloorOutline
        What is fitted to what.
    doubt : CameraDoubt
        The prior.
    inlier_px, inflate, systematic : float
        As in `summarise_fit`.
    residual, predicted : (K,) float64
        Result: by how much each radius differs, and each predicted radius, pixels about the file's centre; NaN: none.
    covariance : (7, 7) float64
        Result: of the unknowns.

    Returns
    -------
    FitSummary
        Of the fit; its cost and standard deviation are infinite where the outline does not determine the unknowns.
    """
    prediction = room_for(scene)
    fit = DoubtedFit(np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE))
    system, step = np.empty((SIZE, SIZE)), np.empty(SIZE)
    for turn in range(STEPS + 1):
        turned = turned_scene(scene, unknowns[5], unknowns[6], doubt.turns_body)
        predict_walls(unknowns[:3], turned, prediction)
        gather_doubted(unknowns, turned, outline, prediction, doubt.turns_body, fit)
        _add_prior(doubt, fit, system)
        for i in range(SIZE):
            step[i] = fit.pull[i]
            if i >= 3:
                step[i] -= _file_information(doubt, i) * unknowns[i]
        if not factor(system, SIZE):
            return FitSummary(math.inf, 0.0, 0.0, math.inf)
        if turn == STEPS:
            break
        substitute(system, SIZE, step)
        for i in range(SIZE):
            unknowns[i] += step[i]
    _sandwich(doubt, fit, system, inflate, systematic, covariance)
    cost, _ = _compare(unknowns, scene, outline, prediction, residual, predicted)
    ratio, rms = inliers_of(residual, inlier_px)
    return FitSummary(cost, ratio, rms, position_std_m(covariance))


@compiled
def _sandwich(
    doubt: CameraDoubt, fit: DoubtedFit, system: FloatArray, inflate: float, systematic: float, out: FloatArray
) -> None:
    """Write the sandwich covariance (7, 7) of all unknowns, by the factor of the system."""
    middle = np.empty((SIZE, SIZE))
    for p in range(SIZE):
        for q in range(SIZE):
            middle[p, q] = inflate * fit.scatter[p, q] + systematic * fit.information[p, q]
        # of the pose, too: without it a direction that nothing tells of would come out as exact
        middle[p, p] += doubt.noise_px**2 * _file_information(doubt, p)
    # both are symmetric: rows do for columns
    for p in range(SIZE):
        substitute(system, SIZE, middle[p])
    for p in range(SIZE):
        for q in range(SIZE):
            out[p, q] = middle[q, p]
        substitute(system, SIZE, out[p])


@compiled(error_model="numpy", fastmath={"reassoc", "nsz", "contract"})
def _compare(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    residual: FloatArray,
    predicted: FloatArray,
) -> tuple[float, int]:
    """Write what is predicted, and what the outline differs by.

    Returns the truncated mean cost, and the number of bearings with an edge.
    """
    cost, used, missed, plane, per_two_units = 0.0, 0, 0, prediction.planes.reshape(-1), 0.5 / outline.unit_px
    center_u, center_v = unknowns[3], unknowns[4]
    for k in range(np.uint64(scene.cos_b.shape[0])):
        r, wall = outline.radius[k], prediction.wall[k]
        is_seen, is_met = r > 0.0, wall >= 0
        c, s = scene.cos_b[k], scene.sin_b[k]
        place = np.uint64(4 * max(wall, 0))
        at, slope = tabulated(outline, prediction.q[k])
        turn = slope * (plane[place + ONE] * c - plane[place] * s) / at
        foot = at + center_u * (c + turn * s) + center_v * (s - turn * c)
        e = (r - foot) / math.sqrt(1.0 + turn * turn)
        predicted[k] = foot if is_met else np.nan
        residual[k] = e if is_seen & is_met else np.nan
        cost += truncated_loss(e, per_two_units) if is_seen & is_met else 0.0
        used += is_seen
        missed += is_seen & (not is_met)
    return (cost + missed) / max(used, 1), used
