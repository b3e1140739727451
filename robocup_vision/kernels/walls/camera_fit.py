"""Compiled fit of a pose to a floor outline, optionally together with errors of the camera's centre and tilt.

An error of half a pixel of the centre, or of half a degree of the tilt of a leaning body, moves a far wall and the pose
by centimetres. Both errors deform the outline as no other pose does, so the residuals of the pose's fit reveal them.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, UInt64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import factor, substitute
from robocup_vision.kernels.walls.fit import (
    Comparison,
    FloorOutline,
    Vector,
    WallPrediction,
    WallScene,
    agreement,
    compare_outline,
    empty_prediction,
    inliers_of,
    position_std_m,
    predict_walls,
    settle,
    tabulated,
    thinned,
    turned_rate,
)

# unknowns: x, y, theta; image centre along bearing 0 and a quarter turn on, pixels; rotations of the body about x and y
SIZE = 7
STEPS = 4
ONE, TWO, THREE, FOUR = np.uint64(1), np.uint64(2), np.uint64(3), np.uint64(4)
# least noise of a bearing, relative to the assumed one: even an exact outline has the tables' errors of interpolation
MIN_NOISE = 0.3
# standard deviation, pixels or radians, of a parameter that is fixed
KNOWN = 1e-6
# height of the pivot of rotations, relative to the camera's: a leaning body turns about its foot, and an error of the
# file turns the camera about itself; half-way the error is small in both cases
PIVOT = 0.5
# prior information about each unknown of the pose: practically none
NO_INFORMATION = 1e-6


class CameraErrors(NamedTuple):
    """Uncertainty of the camera file.

    Parameters
    ----------
    noise_px : float
        Standard deviation of a bearing's edge.
    center_std_px, turn_std_rad : float
        Standard deviations of the centre along u and v, and of rotations about the robot's x and y axes (see `PIVOT`).
    """

    noise_px: float
    center_std_px: float
    turn_std_rad: float


class FitRules(NamedTuple):
    """Parameters of a fit and of its assessment, the same for all frames of a camera.

    Parameters
    ----------
    scene : WallScene
        The walls and the camera.
    q_step, radius_of_q, unit_px
        As in `FloorOutline`.
    inlier_px : float
        Greatest residual of an inlier.
    inflate, systematic_px2 : float
        Factor of the residuals' scatter, and variance that all bearings have in common, see `_write_covariance`.
    errors : CameraErrors
        Uncertainty of the camera.
    min_gain : float
        Least decrease of the weighted sum of squares, divided by the remaining mean square, at which the camera is
        fitted.
    """

    scene: WallScene
    q_step: float
    radius_of_q: FloatArray
    unit_px: float
    inlier_px: float
    inflate: float
    systematic_px2: float
    errors: CameraErrors
    min_gain: float


class NormalEquations(NamedTuple):
    """Normal equations of the unknowns, filled in place.

    Parameters
    ----------
    information, scatter : (7, 7) float64
        Sum of w J^T J, without the prior; scatter of the residuals: sum over groups of neighbouring bearings of g g^T,
        where g is the group's sum of w e J.
    pull : (7,) float64
        Sum of w e J.
    """

    information: FloatArray
    scatter: FloatArray
    pull: FloatArray


@compiled(error_model="numpy", fastmath={"reassoc", "nsz", "contract"})
def gather_equations(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    equations: NormalEquations,
) -> tuple[float, float]:
    """Sum the normal equations of pose, centre and rotations; returns the sums of w e^2 and of w.

    Parameters
    ----------
    unknowns : (7,) float64
        Present estimate.
    scene, outline : WallScene, FloorOutline
        The scene has already been turned. The last scale of the outline is used.
    prediction : WallPrediction
        Prediction from this pose and scene.
    equations : NormalEquations
        Filled.
    """
    count = scene.cos_b.shape[0]
    # derivatives and, last, residuals; then the same multiplied by their weights; one column for each bearing
    rows, weighed = np.empty((SIZE + 1, count)), np.empty((SIZE + 1, count))
    which = np.empty(count, np.uint64)
    used = 0
    for k in range(count):
        which[used] = k
        used += (outline.radius[k] > 0.0) & (prediction.wall[k] >= 0)
    squares, total = _linearise(unknowns, scene, outline, prediction, which[:used], rows, weighed)
    for i in range(SIZE):
        for j in range(i + 1):
            added = 0.0
            for n in range(np.uint64(used)):
                added += weighed[i, n] * rows[j, n]
            equations.information[i, j] = equations.information[j, i] = added
    # the errors of four neighbouring bearings are correlated
    groups = used // 4
    pulls = np.empty((SIZE, groups))
    for i in range(SIZE):
        pulled = 0.0
        for n in range(np.uint64(used)):
            weighed[i, n] *= rows[SIZE, n]
            pulled += weighed[i, n]
        equations.pull[i] = pulled
        for g in range(np.uint64(groups)):
            at = FOUR * g
            pulls[i, g] = weighed[i, at] + weighed[i, at + ONE] + weighed[i, at + TWO] + weighed[i, at + THREE]
    for i in range(SIZE):
        for j in range(i + 1):
            added = 0.0
            for g in range(np.uint64(groups)):
                added += pulls[i, g] * pulls[j, g]
            equations.scatter[i, j] = equations.scatter[j, i] = added
    return squares, total


@compiled(error_model="numpy", fastmath={"reassoc", "nsz", "contract"})
def _linearise(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    which: UInt64Array,
    rows: FloatArray,
    weighed: FloatArray,
) -> tuple[float, float]:
    """Write derivatives and residuals of some bearings, plain and weighted; returns the sums of `gather_equations`."""
    plane, best_q, best_wall = prediction.planes.reshape(-1), prediction.q, prediction.wall
    cos_b, sin_b, radius, height = scene.cos_b, scene.sin_b, outline.radius, scene.height
    to_camera = scene.robot_to_camera
    per_scale, per_height = 1.0 / outline.scales[outline.scales.shape[0] - 1], 1.0 / height
    cos_t, sin_t, center_u, center_v = math.cos(unknowns[2]), math.sin(unknowns[2]), unknowns[3], unknowns[4]
    (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) = to_camera[0], to_camera[1], to_camera[2]
    # derivative of the viewpoint by theta
    swing_x = -sin_t * scene.offset_x - cos_t * scene.offset_y
    swing_y = cos_t * scene.offset_x - sin_t * scene.offset_y
    # a rotation moves the viewpoint as a pose does: to the right if about x, ahead if about y
    lever = (1.0 - PIVOT) * height
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
def _prior_information(errors: CameraErrors, i: int) -> float:
    """Return the prior information about an unknown, in units of one bearing's."""
    if i < 3:
        return NO_INFORMATION
    return (errors.noise_px / (errors.center_std_px if i < 5 else errors.turn_std_rad)) ** 2


@compiled
def _factor(errors: CameraErrors, equations: NormalEquations, size: int, lower: FloatArray) -> bool:
    """Write the Cholesky factor of the leading block of the information with the prior; False if it is indefinite."""
    for i in range(size):
        for j in range(i + 1):
            lower[i, j] = equations.information[i, j]
        lower[i, i] += _prior_information(errors, i)
    return bool(factor(lower, size))


@compiled
def _write_covariance(
    errors: CameraErrors,
    equations: NormalEquations,
    size: int,
    rules: FitRules,
    lower: FloatArray,
    covariance: FloatArray,
) -> float:
    """Write the sandwich covariance (3, 3) of the pose, using the factor of the leading block of the information.

    Returns the largest standard deviation of the position, metres.
    """
    middle, all_unknowns = np.empty((size, size)), np.empty((size, size))
    for p in range(size):
        for q in range(size):
            middle[p, q] = rules.inflate * equations.scatter[p, q] + rules.systematic_px2 * equations.information[p, q]
        # the pose's prior is included, so that a direction without information does not appear exact
        middle[p, p] += errors.noise_px**2 * _prior_information(errors, p)
    # rows stand for columns, because both matrices are symmetric
    for p in range(size):
        substitute(lower, size, middle[p])
    for p in range(size):
        for q in range(size):
            all_unknowns[p, q] = middle[q, p]
        substitute(lower, size, all_unknowns[p])
    for p in range(3):
        for q in range(3):
            covariance[p, q] = all_unknowns[p, q]
    return float(position_std_m(covariance))


@compiled
def _gain(
    errors: CameraErrors, equations: NormalEquations, lower: FloatArray, squares: float, total: float
) -> float:  # fmt: skip
    """Return the gain of one step of the camera's unknowns.

    It is the decrease of the weighted sum of squares, from `squares`, divided by the remaining mean square.
    """
    if not (total > SIZE and _factor(errors, equations, SIZE, lower)):
        return 0.0
    step, gain = equations.pull.copy(), 0.0
    # the factor of the leading block is the leading block of the factor, so the pose's own gain can be left out
    for i in range(SIZE):
        for j in range(i):
            step[i] -= lower[i, j] * step[j]
        step[i] /= lower[i, i]
        if i >= 3:
            gain += step[i] * step[i]
    left = max((squares - gain) / total, (MIN_NOISE * errors.noise_px) ** 2)
    return float(gain / left)


@compiled
def turned_scene(scene: WallScene, about_x: float, about_y: float) -> WallScene:
    """Return the scene of a camera rotated about the robot's x axis and then its y axis, through the pivot."""
    to_camera, turned = scene.robot_to_camera, np.empty((3, 3))
    cx, sx, cy, sy = math.cos(about_x), math.sin(about_x), math.cos(about_y), math.sin(about_y)
    for i in range(3):
        ahead, left, up = to_camera[i, 0], to_camera[i, 1], to_camera[i, 2]
        raised = sx * left + cx * up
        turned[i, 0] = cy * ahead + sy * raised
        turned[i, 1] = cx * left - sx * up
        turned[i, 2] = cy * raised - sy * ahead
    x, y, height = scene.offset_x, scene.offset_y, scene.height
    lever = (1.0 - PIVOT) * height
    x, y = cy * x + sy * (sx * y + cx * lever), cx * y - sx * lever
    # inverse ranges remain relative to the upright camera's height
    return WallScene(scene.walls, x, y, height, turned, scene.cos_b, scene.sin_b)


@compiled
def _fit_camera(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    errors: CameraErrors,
    prediction: WallPrediction,
    equations: NormalEquations,
    lower: FloatArray,
) -> bool:
    """Fit pose, centre and rotations (7,) to an outline by Gauss-Newton with the camera file as prior.

    Fills `lower` (7, 7) with the factor of the information. Returns False if the outline does not determine the
    unknowns.
    """
    step = np.empty(SIZE)
    for iteration in range(STEPS + 1):
        turned = turned_scene(scene, unknowns[5], unknowns[6])
        predict_walls(unknowns[:3], turned, prediction)
        gather_equations(unknowns, turned, outline, prediction, equations)
        if not _factor(errors, equations, SIZE, lower):
            return False
        if iteration == STEPS:
            break
        for i in range(SIZE):
            step[i] = equations.pull[i]
            if i >= 3:
                step[i] -= _prior_information(errors, i) * unknowns[i]
        substitute(lower, SIZE, step)
        for i in range(SIZE):
            unknowns[i] += step[i]
    return True


class Fitted(NamedTuple):
    """A fit's pose x, y, theta, the number of bearings with an edge, and the quality of the fit.

    Parameters
    ----------
    pose : (float, float, float)
    bearings : int
    cost : float
        As in `compare_outline`.
    inlier_ratio, rms_px : float
        See `inliers_of`.
    along_m : float
        Largest standard deviation of the position; infinite if the outline does not determine it.
    sliding_m : float
        `along_m` of the fit without the camera's unknowns; large if the pose can slide along walls.
    """

    pose: Vector
    bearings: int
    cost: float
    inlier_ratio: float
    rms_px: float
    along_m: float
    sliding_m: float


@compiled
def _empty_equations() -> NormalEquations:
    return NormalEquations(np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE))


@compiled
def fit_outline(
    start: Vector,
    radius: FloatArray,
    scales: FloatArray,
    rules: FitRules,
    lines: FloatArray,
    covariance: FloatArray,
) -> tuple[Vector, int, float, float, float, float, float]:
    """Fit a pose to an outline, together with errors of the camera file if the outline contradicts it.

    Parameters
    ----------
    start : (float, float, float)
        Start x, y, theta.
    radius, scales : (K,), (I,) float64
        As in `FloorOutline`.
    rules : FitRules
        May be a plain tuple.
    lines : (2, K) float64
        Filled with `residual` and `predicted` of `compare_outline`.
    covariance : (3, 3) float64
        Filled with the covariance of the pose.

    Returns
    -------
    tuple
        The values of a `Fitted`, as a plain tuple, which is faster.
    """
    known = FitRules(*rules)
    scene, errors = WallScene(*known.scene), CameraErrors(*known.errors)
    outline = FloorOutline(radius, known.q_step, known.radius_of_q, scales, known.unit_px)
    unknowns, prediction, lower = np.zeros(SIZE), empty_prediction(scene), np.empty((SIZE, SIZE))
    pose = unknowns[:3]
    pose[0], pose[1], pose[2] = start
    fine = Comparison(scene, outline, prediction)
    settle(pose, fine, thinned(fine))
    equations = _empty_equations()
    squares, total = gather_equations(unknowns, scene, outline, prediction, equations)
    gain = _gain(errors, equations, lower, squares, total)
    cost, bearings = compare_outline(scene, outline, prediction, (0.0, 0.0), lines[0], lines[1])
    sliding = math.inf
    if _factor(errors, equations, 3, lower):
        sliding = _write_covariance(errors, equations, 3, known, lower, covariance)
    along = sliding
    if gain >= known.min_gain:
        corrected, other, covariance_7 = unknowns.copy(), np.empty(lines.shape), np.empty((3, 3))
        if _fit_camera(corrected, scene, outline, errors, prediction, equations, lower):
            along_7 = _write_covariance(errors, equations, SIZE, known, lower, covariance_7)
            turned = turned_scene(scene, corrected[5], corrected[6])
            cost_7, _ = compare_outline(turned, outline, prediction, (corrected[3], corrected[4]), other[0], other[1])
            if cost_7 < cost:
                unknowns, cost, along = corrected, cost_7, along_7
                covariance[:, :] = covariance_7
                lines[:, :] = other
    ratio, rms = inliers_of(lines[0], known.inlier_px)
    return (unknowns[0], unknowns[1], unknowns[2]), bearings, cost, ratio, rms, along, sliding


@compiled
def fit_leaning(
    start: Vector,
    radius: FloatArray,
    scales: FloatArray,
    rules: FitRules,
    lines: FloatArray,
    covariance: FloatArray,
) -> tuple[Vector, int, float, float, float, float, float]:
    """Fit the pose and the lean of a body, whether or not the outline contradicts the camera file.

    Parameters
    ----------
    start, radius, scales, rules, lines, covariance
        As in `fit_outline`; the camera's centre is fixed.

    Returns
    -------
    tuple
        The values of a `Fitted`.
    """
    known = FitRules(*rules)
    scene, known_errors = WallScene(*known.scene), CameraErrors(*known.errors)
    errors = CameraErrors(known_errors.noise_px, KNOWN, known_errors.turn_std_rad)
    unknowns, prediction, lower = np.zeros(SIZE), empty_prediction(scene), np.empty((SIZE, SIZE))
    unknowns[0], unknowns[1], unknowns[2] = start
    equations, is_determined = _empty_equations(), True
    outline = FloorOutline(radius, known.q_step, known.radius_of_q, scales, known.unit_px)
    for n in range(scales.shape[0]):
        outline = FloorOutline(radius, known.q_step, known.radius_of_q, scales[n : n + 1], known.unit_px)
        is_determined = is_determined and _fit_camera(unknowns, scene, outline, errors, prediction, equations, lower)
    along = _write_covariance(errors, equations, SIZE, known, lower, covariance) if is_determined else math.inf
    turned = turned_scene(scene, unknowns[5], unknowns[6])
    cost, bearings = compare_outline(turned, outline, prediction, (unknowns[3], unknowns[4]), lines[0], lines[1])
    ratio, rms = inliers_of(lines[0], known.inlier_px)
    return (unknowns[0], unknowns[1], unknowns[2]), bearings, cost, ratio, rms, along, along
