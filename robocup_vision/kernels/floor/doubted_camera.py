"""Compiled loops that fit a camera's centre and tilt together with the pose, where the floor's outline asks for it.

A centre half a pixel off its file moves a far wall by centimetres, and the pose with it. It bends the outline in a way
that no pose does: what is left over after the fit of the pose tells of it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.cholesky import factor, substitute
from robocup_vision.kernels.floor.walls import FloorOutline, WallPrediction, WallScene, predict_walls, tabulated

SIZE = 7  # x, y, theta; centre of the image along bearing 0 and a quarter turn on, pixels; tilt about the same axes
STEPS = 4
LEAST_NOISE = 0.3  # of what is said of a bearing: exact outlines have errors of the tables


class CameraDoubt(NamedTuple):
    """What may be wrong with a camera file.

    Parameters
    ----------
    noise_px : float
        Standard deviation of a bearing's edge.
    center_std_px, tilt_std_rad : float
        Of centre and tilt in a file that is doubted.
    """

    noise_px: float
    center_std_px: float
    tilt_std_rad: float


class DoubtedFit(NamedTuple):
    """Normal equations of the unknowns, written in place.

    Parameters
    ----------
    information, scatter : (7, 7) float64
        Sum of w J^T J, its lower triangle, without the prior; of groups' pulls, as in `WallFit`.
    pull : (7,) float64
        Sum of w e J.
    """

    information: FloatArray
    scatter: FloatArray
    pull: FloatArray


@compiled
def gather_doubted(
    scene: WallScene,
    outline: FloorOutline,
    prediction: WallPrediction,
    center_u: float,
    center_v: float,
    fit: DoubtedFit,
) -> tuple[float, float]:
    """Add up the normal equations of pose, centre and tilt; returns the sums of w e^2 and of w.

    Parameters
    ----------
    scene, outline : WallScene, FloorOutline
        As in `fit_walls`; the last of the scales counts.
    prediction : WallPrediction
        From the pose, by the scene's tilt.
    center_u, center_v : float
        Where the centre is by now, pixels from where the file puts it.
    fit : DoubtedFit
        Result.
    """
    best_q, best_wall, planes = prediction
    cos_b, sin_b, radius, height = scene.cos_b, scene.sin_b, outline.radius, scene.height
    information, scatter, pull = fit.information, fit.scatter, fit.pull
    scale = outline.scales[outline.scales.shape[0] - 1]
    jacobian, group = np.empty(SIZE), np.zeros(SIZE)
    for i in range(SIZE):
        pull[i] = 0.0
        for j in range(SIZE):
            information[i, j] = 0.0
            scatter[i, j] = 0.0
    squares, total, in_group = 0.0, 0.0, 0
    for k in range(cos_b.shape[0]):
        w = best_wall[k]
        if not radius[k] > 0 or w < 0:
            continue
        c, s, q = cos_b[k], sin_b[k], best_q[k]
        along, aside = planes[w, 0, 0], planes[w, 0, 1]
        predicted, slope = tabulated(outline, q)
        turn = slope * (aside * c - along * s) / predicted
        oblique = 1.0 / math.sqrt(1.0 + turn * turn)
        by_u, by_v = oblique * (c + turn * s), oblique * (s - turn * c)
        e = (radius[k] - predicted) * oblique - by_u * center_u - by_v * center_v
        by_q = slope * oblique
        for p in range(3):
            jacobian[p] = by_q * (planes[w, p + 1, 0] * c + planes[w, p + 1, 1] * s - q * planes[w, p + 1, 2])
        jacobian[3], jacobian[4] = by_u, by_v
        # a turn t of the camera takes a plane's normal n to n - t x n
        jacobian[5] = by_q * (s / height + q * height * aside)
        jacobian[6] = -by_q * (c / height + q * height * along)
        ratio = e / scale if e < 0 else e / (3.0 * scale)
        weight = 1.0 / (1.0 + ratio * ratio) ** 2
        squares += weight * e * e
        total += weight
        for i in range(SIZE):
            part = weight * jacobian[i]
            pull[i] += part * e
            group[i] += part * e
            for j in range(i + 1):
                information[i, j] += part * jacobian[j]
        in_group += 1
        if in_group == 4:
            for i in range(SIZE):
                for j in range(SIZE):
                    scatter[i, j] += group[i] * group[j]
            for i in range(SIZE):
                group[i] = 0.0
            in_group = 0
    return squares, total


@compiled
def _add_prior(doubt: CameraDoubt, fit: DoubtedFit, system: FloatArray, size: int) -> None:
    """Write the leading (size, size) block of the information, lower triangle, with that of the file."""
    variance = doubt.noise_px**2
    for i in range(size):
        for j in range(i + 1):
            system[i, j] = fit.information[i, j]
        if i >= 3:
            std = doubt.center_std_px if i < 5 else doubt.tilt_std_rad
            system[i, i] += variance / (std * std)
        else:
            system[i, i] += 1e-6


@compiled
def doubt_of_camera(pose: FloatArray, scene: WallScene, outline: FloorOutline, doubt: CameraDoubt) -> float:
    """Tell by how much another centre and tilt would explain an outline better, at the pose fitted without them.

    Parameters
    ----------
    pose : (3,) float64
        x, y, theta, as `fit_walls` left it.
    scene, outline : WallScene, FloorOutline
        What it was fitted to.
    doubt : CameraDoubt
        What may be wrong.

    Returns
    -------
    float
        Decrease of the weighted sum of squares in one step, over the mean square that is left.
    """
    count = scene.cos_b.shape[0]
    prediction = WallPrediction(np.empty(count), np.empty(count, np.int64), np.empty((scene.walls.shape[0], 4, 3)))
    fit = DoubtedFit(np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE))
    system, step = np.empty((SIZE, SIZE)), np.empty(SIZE)
    predict_walls(pose, scene, prediction)
    squares, total = gather_doubted(scene, outline, prediction, 0.0, 0.0, fit)
    if not total > SIZE:
        return 0.0
    _add_prior(doubt, fit, system, SIZE)
    for i in range(SIZE):
        step[i] = fit.pull[i]
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
    left = max((squares - gain) / total, (LEAST_NOISE * doubt.noise_px) ** 2)
    return float(gain / left)


@compiled
def _leaned(scene: WallScene, about_u: float, about_v: float) -> WallScene:
    """Return the scene seen by a camera turned by small angles about its axes."""
    turned = np.empty((3, 3))
    cu, su, cv, sv = math.cos(about_u), math.sin(about_u), math.cos(about_v), math.sin(about_v)
    for j in range(3):
        # Rx(u)^T Ry(v)^T
        first, second, third = scene.robot_to_camera[0, j], scene.robot_to_camera[1, j], scene.robot_to_camera[2, j]
        turned[0, j] = cv * first - sv * third
        up = sv * first + cv * third
        turned[1, j] = cu * second + su * up
        turned[2, j] = -su * second + cu * up
    return WallScene(
        scene.walls, scene.offset_x, scene.offset_y, scene.height, turned, scene.cos_b, scene.sin_b
    )  # fmt: skip


@compiled
def fit_with_camera(
    unknowns: FloatArray,
    scene: WallScene,
    outline: FloorOutline,
    doubt: CameraDoubt,
    inflate: float,
    systematic: float,
    predicted: FloatArray,
    covariance: FloatArray,
) -> bool:
    """Fit pose, centre and tilt to an outline; what the camera file says is a prior.

    Parameters
    ----------
    unknowns : (7,) float64
        In: a pose near by, then zeros. Out: x, y, theta; centre along bearing 0 and a quarter turn on, pixels from
        where the file puts it; tilt about the same axes, radians beyond the file's.
    scene, outline : WallScene, FloorOutline
        What is fitted to what.
    doubt : CameraDoubt
        The prior.
    inflate, systematic : float
        As in `summarise_fit`.
    predicted : (K,) float64
        Result: image radius of the nearest wall's foot about the file's centre, NaN where none.
    covariance : (3, 3) float64
        Result: of x, y, theta.

    Returns
    -------
    bool
        False where the outline does not determine the unknowns.
    """
    count = scene.cos_b.shape[0]
    prediction = WallPrediction(np.empty(count), np.empty(count, np.int64), np.empty((scene.walls.shape[0], 4, 3)))
    fit = DoubtedFit(np.empty((SIZE, SIZE)), np.empty((SIZE, SIZE)), np.empty(SIZE))
    system, step = np.empty((SIZE, SIZE)), np.empty(SIZE)
    for turn in range(STEPS + 1):
        predict_walls(unknowns[:3], _leaned(scene, unknowns[5], unknowns[6]), prediction)
        gather_doubted(scene, outline, prediction, unknowns[3], unknowns[4], fit)
        _add_prior(doubt, fit, system, SIZE)
        for i in range(SIZE):
            step[i] = fit.pull[i]
            if i >= 3:
                step[i] -= (system[i, i] - fit.information[i, i]) * unknowns[i]
        if not factor(system, SIZE):
            return False
        if turn == STEPS:
            break
        substitute(system, SIZE, step)
        for i in range(SIZE):
            unknowns[i] += step[i]
    # the sandwich covariance of all unknowns; the pose's block of it
    columns = np.empty((3, SIZE))
    for i in range(3):
        for j in range(SIZE):
            columns[i, j] = 1.0 if i == j else 0.0
        substitute(system, SIZE, columns[i])
    for i in range(3):
        for j in range(3):
            total = 0.0
            for p in range(SIZE):
                for q in range(SIZE):
                    known = fit.information[max(p, q), min(p, q)]
                    middle = inflate * fit.scatter[p, q] + systematic * known
                    if p == q and p >= 3:
                        std = doubt.center_std_px if p < 5 else doubt.tilt_std_rad
                        middle += (doubt.noise_px**2 / std) ** 2
                    total += columns[i, p] * middle * columns[j, q]
            covariance[i, j] = total
    for k in range(count):
        predicted[k] = np.nan
        if prediction.wall[k] >= 0:
            w, c, s = prediction.wall[k], scene.cos_b[k], scene.sin_b[k]
            at, slope = tabulated(outline, prediction.q[k])
            turned = slope * (prediction.planes[w, 0, 1] * c - prediction.planes[w, 0, 0] * s) / at
            predicted[k] = at + unknowns[3] * (c + turned * s) + unknowns[4] * (s - turned * c)
    return True
