"""One frame followed: predict, search, choose the mode, fit, and gather what the verdict needs."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.cholesky import factor
from robocup_vision.kernels.model_edges.carpet import carpet_look, other_light
from robocup_vision.kernels.model_edges.conclude import covariance_with_prior, gained_nats, pose_alone, position_std
from robocup_vision.kernels.model_edges.fit import Gates, choose_mode, robust_fit
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.search import reaches, search, whiten
from robocup_vision.kernels.model_edges.tables import (
    FOUND,
    UNKNOWNS,
    FieldEdges,
    Findings,
    FloatArray,
    FollowSettings,
    Room,
    Samples,
    UInt8Array,
)
from robocup_vision.kernels.model_edges.verdict import LineLook, explained, judge, line_points

MODES = 5  # looked at before giving up
NO_FIT = -1e9  # worth of a mode that cannot be fitted
CARPET_LIGHT = 225.0  # blue, green and red of the carpet under the light that channels' steps are given for


class Scene(NamedTuple):
    """What stays from frame to frame.

    Parameters
    ----------
    field : FieldEdges
        The field.
    lens : (18,) float64
        See `prediction.predict`.
    draws : (H, 6) float64
        See `fit.choose_mode`.
    """

    field: FieldEdges
    lens: FloatArray
    draws: FloatArray


class Prior(NamedTuple):
    """Mean (7,) of the unknowns and the lower triangular root (7, 7) of their covariance."""

    mean: FloatArray
    root: FloatArray


class Fit(NamedTuple):
    """Results of `follow`.

    Parameters
    ----------
    unknowns : (7,) float64
        The fit.
    covariance : (7, 7) float64
        With the prior.
    information : (3, 3) float64
        Of x, y and heading by the measurements alone, what else is unknown left as open as the prior leaves it.
    gradient : (3,) float64
        Of that log-likelihood at the fit.
    carpet : (5,) or (8,) float64
        See `carpet_look`.
    figures : (14,) float64
        Samples, looked for, found, missing, found upright, inliers, their root mean square, prior's squared distance,
        line points that a pose must explain, those explained, hidden upright, standard deviation of the position by the
        measurements alone where it is greatest (m), how many edges of the field were found, and what the pose gained on
        its prior (nats).
    """

    unknowns: FloatArray
    covariance: FloatArray
    information: FloatArray
    gradient: FloatArray
    carpet: FloatArray
    figures: FloatArray


@compiled(fastmath=True, error_model="numpy")
def brightness(carpet: FloatArray) -> float:
    """Light of a picture, relative to that which channels are given for, by its carpet: in the shade, if there is any.

    Lines in the shade are fainter, and those in glare hardly brighter than it.
    """
    light = min(carpet[0] + carpet[1] + carpet[2], other_light(carpet))
    return float(min(max(light / CARPET_LIGHT, 0.15), 1.6))


@compiled(fastmath=True, error_model="numpy")
def _moved(prior: Prior, z: FloatArray, p: FloatArray) -> None:
    """Unknowns of standard normal ones about the prior's mean."""
    for i in range(UNKNOWNS):
        p[i] = prior.mean[i]
        for j in range(i + 1):
            p[i] += prior.root[i, j] * z[j]


@compiled(fastmath=True, error_model="numpy", inline="always")
def _refine(
    image: UInt8Array,
    scene: Scene,
    prior: Prior,
    settings: FollowSettings,
    spacing_px: float,
    room: Room,
    fit: Fit,
    z: FloatArray,
) -> tuple[int, int, float, bool]:
    """Predict and search anew near a fit and fit again, until it stays; z is about the prior's mean, in and out."""
    count, inliers, rms = 0, 0, 0.0
    here, origin, step = np.empty(UNKNOWNS), np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    again = settings.again_px
    gates = Gates(settings.fine_gates_px, settings.sharp_steps)
    for _ in range(3):
        for j in range(UNKNOWNS):
            origin[j] = -z[j]
            step[j] = 0.0
        _moved(prior, z, here)
        count = predict(scene.field, scene.lens, here, spacing_px, room.samples)
        whiten(room.samples, count, prior.root, room.rows)
        for n in range(count):
            room.reach_px[n] = again
        search(image, scene.field.channels, fit.carpet, brightness(fit.carpet), settings, room, count)
        inliers, rms, ok = robust_fit(room, count, settings, gates, origin, step)
        if not ok:
            return count, inliers, rms, False
        for j in range(UNKNOWNS):
            z[j] += step[j]
        farthest = 0.0
        for n in range(count):
            if room.found.candidates[n] > 0:
                moved = 0.0
                for j in range(UNKNOWNS):
                    moved += room.rows[n, j] * step[j]
                farthest = max(farthest, abs(moved))
        if farthest < 0.5 * settings.again_px:
            break
    # where the samples now lie by the fit
    for j in range(UNKNOWNS):
        fit.unknowns[j] = step[j]
    return count, inliers, rms, True


@compiled(error_model="numpy")
def prepare(
    pose: FloatArray,
    covariance: FloatArray,
    camera_prior: FloatArray,
    keep: FloatArray,
    sway: FloatArray,
    into: Prior,
) -> bool:
    """Join the prior of the pose with that of the camera's orientation.

    Parameters
    ----------
    pose : (3,) float64
        x, y, heading.
    covariance : (3, 3) float64
        Of these.
    camera_prior : (2, 4) float64
        Tilt, roll, height and logarithm of focal length at rest, and their standard deviations.
    keep : (4,) float64
        Fraction of the last frame's deviation that is left.
    sway : (2, 4) float64
        What they were off by in the last frame, and its variance; then, what is expected now.
    into : Prior
        Result.

    Returns
    -------
    bool
        Whether the covariance has a root.
    """
    prior, root = into.mean, into.root
    for i in range(3):
        prior[i] = pose[i]
        for j in range(3):
            root[i, j] = covariance[i, j]
    if not factor(root, 3):
        return False
    for i in range(3):
        for j in range(i + 1, 3):
            root[i, j] = 0.0
    for i in range(4):
        k = keep[i]
        sway[0, i] *= k
        sway[1, i] = camera_prior[1, i] ** 2 * (1.0 - k * k) + k * k * sway[1, i]
        prior[3 + i] = camera_prior[0, i] + sway[0, i]
        root[3 + i, 3 + i] = math.sqrt(max(sway[1, i], 0.0))
    return True


@compiled(fastmath=True, error_model="numpy", inline="always")
def _propose(
    image: UInt8Array, scene: Scene, prior: Prior, settings: FollowSettings, room: Room, fit: Fit, modes: FloatArray
) -> tuple[int, int]:
    """Predict few samples, search for them in all of the prior's reach, and choose and fit modes (K, 7) by them.

    Returns
    -------
    int, int
        Samples that could be looked for, and modes.
    """
    count = predict(scene.field, scene.lens, prior.mean, settings.coarse_spacing_px, room.samples)
    if count < 3:
        return 0, 0
    whiten(room.samples, count, prior.root, room.rows)
    reaches(room.rows, count, settings, room.reach_px)
    search(image, scene.field.channels, fit.carpet, brightness(fit.carpet), settings, room, count)
    kept = choose_mode(room, count, scene.draws, settings, modes)
    origin, gates = np.zeros(UNKNOWNS), Gates(settings.coarse_gates_px, 0)
    for k in range(kept):
        robust_fit(room, count, settings, gates, origin, modes[k])
    return _looked_for(room, count), kept


@compiled(fastmath=True, error_model="numpy")
def follow(
    image: UInt8Array,
    scene: Scene,
    prior: Prior,
    settings: FollowSettings,
    room: Room,
    fit: Fit,
    most_modes: int,
    knows_carpet: bool,
) -> bool:
    """Fit one frame to what a prior lets it show; the tuples may be plain.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    scene : Scene
        Field, lens and draws.
    prior : Prior
        Of the unknowns.
    settings : FollowSettings
        Numbers.
    room : Room
        To work in; holds the fit's samples, findings and line points afterwards.
    fit : Fit
        Result.
    most_modes : int
        How many modes are looked at, at most `MODES`.
    knows_carpet : bool
        Whether `fit.carpet` is of this image already, seen with about the same tilt.

    Returns
    -------
    bool
        Whether there was anything to fit.
    """
    edges = FieldEdges(*scene[0])
    of_room = Room(Samples(*room[0]), Findings(*room[1]), room[2], room[3], room[4], room[5], room[6])
    return _follow(
        image,
        Scene(edges, scene[1], scene[2]),
        Prior(*prior),
        FollowSettings(*settings),
        of_room,
        Fit(*fit),
        most_modes,
        knows_carpet,
    )


@compiled(fastmath=True, error_model="numpy", inline="always")
def _follow(
    image: UInt8Array,
    scene: Scene,
    prior: Prior,
    settings: FollowSettings,
    room: Room,
    fit: Fit,
    most_modes: int,
    knows_carpet: bool,
) -> bool:
    """See `follow`."""
    for i in range(fit.figures.shape[0]):
        fit.figures[i] = 0.0
    if not knows_carpet:
        carpet_look(image, int(scene.lens[3] + scene.lens[1] * math.tan(prior.mean[3])), fit.carpet)
    # the best mode alone is chosen sooner, and in most frames no other needs a look
    modes = np.zeros((1, UNKNOWNS))
    looked, kept = _propose(image, scene, prior, settings, room, fit, modes)
    if kept == 0:
        return False
    # where much is in view, samples farther apart tell as much
    spacing_px = max(settings.spacing_px, settings.coarse_spacing_px * looked / settings.ample_samples)
    z = modes[0].copy()
    clear, best_worth = _assess(image, scene, prior, settings, spacing_px, room, fit, z)
    if not clear and most_modes > 1:
        modes = np.zeros((most_modes, UNKNOWNS))
        _, kept = _propose(image, scene, prior, settings, room, fit, modes)
        best, last = variable(0), variable(0)
        for k in range(1, kept):
            for j in range(UNKNOWNS):
                z[j] = modes[k, j]
            clear, worth = _assess(image, scene, prior, settings, spacing_px, room, fit, z)
            last = k
            if worth > best_worth:
                best, best_worth = k, worth
                if clear:
                    break
        if best != last:
            # back to the best of them
            for j in range(UNKNOWNS):
                z[j] = modes[best, j]
            _assess(image, scene, prior, settings, spacing_px, room, fit, z)
    if best_worth == NO_FIT:
        return False
    if not covariance_with_prior(prior.root, room.information, fit.covariance):
        return False
    if not pose_alone(prior.root, z, room.information, room.gradient, fit.information, fit.gradient):
        return False
    fit.figures[11] = position_std(fit.information)
    fit.figures[13] = gained_nats(prior.root, fit.covariance)
    return True


@compiled(fastmath=True, error_model="numpy")
def _assess(
    image: UInt8Array,
    scene: Scene,
    prior: Prior,
    settings: FollowSettings,
    spacing_px: float,
    room: Room,
    fit: Fit,
    z: FloatArray,
) -> tuple[bool, float]:
    """Refine a mode and weigh what speaks for it.

    Returns
    -------
    bool, float
        Whether no other mode needs a look, and what the mode is worth among others; `NO_FIT` if it cannot be fitted.
    """
    figures = fit.figures
    count, inliers, rms, ok = _refine(image, scene, prior, settings, spacing_px, room, fit, z)
    if not ok:
        return False, NO_FIT
    step = np.empty(UNKNOWNS)
    for j in range(UNKNOWNS):
        step[j] = fit.unknowns[j]
    seen, missing, upright, hidden = judge(image, fit.carpet, settings, room, count, step)
    _moved(prior, z, fit.unknowns)
    least = 0.5 * settings.min_ratio * scene.field.channels[0, 3] * brightness(fit.carpet)
    look = LineLook(max(least, 5.0 * fit.carpet[3]), settings.line_width_m, settings.point_stride)
    number = line_points(image, scene.lens, fit.unknowns, fit.carpet, look, room.points)
    silent, lens = scene.field.silent, scene.lens
    right, neutral = explained(room, number, count, step, spacing_px, settings.gate_px, silent, lens, fit.unknowns)
    number -= neutral
    far = 0.0
    for j in range(UNKNOWNS):
        far += z[j] * z[j]
    figures[0], figures[1], figures[2], figures[3] = count, _looked_for(room, count), seen, missing
    figures[4] = upright
    figures[5], figures[6], figures[7], figures[8], figures[9] = inliers, rms, far, number, right
    figures[10] = hidden
    figures[12] = _edges_found(room, count)
    weights = settings.mode_weights
    worth = (
        weights[0] * math.log(1.0 + inliers)
        - weights[1] * missing / (seen + missing + 4.0)
        - weights[2] * hidden / (upright + hidden + 4.0)
        - weights[3] * (number - right) / (number + 4.0)
        - weights[4] * far
        - weights[5] * rms
    )
    clear = missing <= settings.clear_missing * seen and number - right <= 1.0 + settings.clear_unexplained * number
    clear = clear and rms <= settings.clear_rms_px
    return clear, worth


@compiled(fastmath=True, error_model="numpy")
def _looked_for(room: Room, count: int) -> int:
    """Count the samples that could be looked for."""
    looked = 0
    for n in range(count):
        if room.found.candidates[n] >= 0:
            looked += 1
    return looked


@compiled(fastmath=True, error_model="numpy")
def _edges_found(room: Room, count: int) -> int:
    """Count the edges of the field of which samples were found."""
    last = 0
    for n in range(count):
        last = max(last, room.samples.feature[n])
    is_found, found = np.zeros(last + 1, np.bool_), 0
    for n in range(count):
        feature = room.samples.feature[n]
        if room.found.status[n] == FOUND and not is_found[feature]:
            is_found[feature] = True
            found += 1
    return found
