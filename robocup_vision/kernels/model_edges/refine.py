"""Proposes modes near a prior, and refines one: its edges are predicted and searched again until the fit converges."""

from __future__ import annotations

import numpy as np

from robocup_vision.compiling.loops import compiled, flag, variable
from robocup_vision.kernels.model_edges.fit import Gates, choose_mode, robust_fit
from robocup_vision.kernels.model_edges.prediction import predict
from robocup_vision.kernels.model_edges.search import reaches, search, whiten
from robocup_vision.kernels.model_edges.tables import (
    UNKNOWNS,
    Buffers,
    EdgeScene,
    FloatArray,
    FollowSettings,
    Prior,
    UInt8Array,
)

POSE = 3  # x, y and heading lead the unknowns
# least and greatest reach of the search for a mode far from its prior, as multiples of the search near a fit; and the
# factor on the first gates of its fit
MIN_SEARCHES, MAX_SEARCHES, ROUGHER = 1.2, 4.0, 2.0


@compiled(fastmath=True, error_model="numpy")
def moved(prior: Prior, z: FloatArray, p: FloatArray) -> None:
    """Fill in the unknowns p (7,) that belong to standard normal ones z (7,) about the prior's mean."""
    for i in range(UNKNOWNS):
        p[i] = prior.mean[i]
        for j in range(i + 1):
            p[i] += prior.root[i, j] * z[j]


@compiled(fastmath=True, error_model="numpy")
def looked_for(buffers: Buffers, count: int) -> int:
    """Count the samples that could be looked for."""
    looked = 0
    for n in range(count):
        if buffers.found.candidates[n] >= 0:
            looked += 1
    return looked


@compiled(fastmath=True, error_model="numpy", inline="always")
def propose(
    image: UInt8Array,
    scene: EdgeScene,
    prior: Prior,
    settings: FollowSettings,
    buffers: Buffers,
    carpet: FloatArray,
    light: float,
    modes: FloatArray,
) -> tuple[int, int]:
    """Predict coarsely spaced samples, search them within the prior's range, and choose and fit modes (K, 7) by them.

    Parameters
    ----------
    image, scene, prior, settings, buffers
        See `follow.follow`.
    carpet : (5,) or (8,) float64
        See `carpet_look`.
    light : float
        See `follow.brightness`.
    modes : (K, 7) float64
        Result.

    Returns
    -------
    int, int
        Numbers of samples that could be looked for, and of modes.
    """
    count = predict(scene.field, scene.lens, prior.mean, settings.coarse_spacing_px, buffers.samples)
    if count < 3:
        return 0, 0
    whiten(buffers.samples, count, prior.root, buffers.rows)
    reaches(buffers.rows, count, settings, buffers.reach_px)
    search(image, scene.field.channels, carpet, light, settings, buffers, count)
    kept = choose_mode(buffers, count, scene.draws, settings, modes)
    origin, gates = np.zeros(UNKNOWNS), Gates(settings.coarse_gates_px, 0)
    for k in range(kept):
        robust_fit(buffers, count, settings, gates, origin, modes[k])
    return looked_for(buffers, count), kept


@compiled(fastmath=True, error_model="numpy", inline="always")
def refine(
    image: UInt8Array,
    scene: EdgeScene,
    prior: Prior,
    settings: FollowSettings,
    spacing_px: float,
    buffers: Buffers,
    carpet: FloatArray,
    light: float,
    z: FloatArray,
    step: FloatArray,
) -> tuple[int, int, float, bool]:
    """Predict and search again near a fit and repeat the fit, until it converges.

    Parameters
    ----------
    image, scene, prior, settings, buffers
        See `follow.follow`.
    spacing_px : float
        Distance between samples.
    carpet, light
        See `propose`.
    z : (7,) float64
        Standard normal unknowns about the prior's mean; in and out.
    step : (7,) float64
        Result: the last change of z, from where the samples were predicted.

    Returns
    -------
    int, int, float, bool
        Numbers of samples and inliers, root mean square of their residuals (pixels), and whether it could be fitted.
    """
    count, inliers, rms = 0, 0, 0.0
    unknowns, origin = np.empty(UNKNOWNS), np.empty(UNKNOWNS)
    near_px = settings.again_px
    fine_gates = Gates(settings.fine_gates_px, settings.sharp_steps)
    for iteration in range(3):
        for j in range(UNKNOWNS):
            origin[j] = -z[j]
            step[j] = 0.0
        moved(prior, z, unknowns)
        count = predict(scene.field, scene.lens, unknowns, spacing_px, buffers.samples)
        whiten(buffers.samples, count, prior.root, buffers.rows)
        again_px, gates = near_px, fine_gates
        # derivatives at the prior are inaccurate far from it
        if iteration == 0 and settings.bent_ratio > 0.0:
            bent_px = settings.bent_ratio * _farthest(buffers, count, z, variable(POSE), flag(False))
            if bent_px > MIN_SEARCHES * near_px:
                again_px = min(bent_px, MAX_SEARCHES * near_px)
                gates = _rough_gates(settings)
        for n in range(count):
            buffers.reach_px[n] = again_px
        search(image, scene.field.channels, carpet, light, settings, buffers, count)
        inliers, rms, ok = robust_fit(buffers, count, settings, gates, origin, step)
        if not ok:
            return count, inliers, rms, False
        for j in range(UNKNOWNS):
            z[j] += step[j]
        if _farthest(buffers, count, step, variable(UNKNOWNS), flag(True)) < 0.5 * near_px:
            break
    return count, inliers, rms, True


@compiled
def _rough_gates(settings: FollowSettings) -> Gates:
    """Return the gates of a fit that starts far from its result."""
    first, second, last = settings.fine_gates_px[0], settings.fine_gates_px[1], settings.fine_gates_px[-1]
    return Gates(np.array((ROUGHER * first, ROUGHER * second, first, last)), settings.sharp_steps)


@compiled(fastmath=True, error_model="numpy")
def _farthest(buffers: Buffers, count: int, z: FloatArray, unknowns: int, found_only: bool) -> float:
    """Return the greatest distance in pixels by which the first unknowns of z move a sample."""
    farthest = 0.0
    for n in range(count):
        if found_only and buffers.found.candidates[n] < 1:
            continue
        shift = 0.0
        for j in range(unknowns):
            shift += buffers.rows[n, j] * z[j]
        farthest = max(farthest, abs(shift))
    return farthest
