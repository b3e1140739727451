"""Follows one frame: predicts edges, searches them, chooses the mode, fits it, and gathers the verdict's figures."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.cholesky import factor
from robocup_vision.kernels.model_edges.bands import LineLook, line_points
from robocup_vision.kernels.model_edges.carpet import carpet_look, other_light
from robocup_vision.kernels.model_edges.posterior import covariance_with_prior, pose_alone, position_std
from robocup_vision.kernels.model_edges.prediction import horizon_row
from robocup_vision.kernels.model_edges.refine import looked_for, moved, propose, refine
from robocup_vision.kernels.model_edges.tables import (
    FOUND,
    UNKNOWNS,
    Buffers,
    EdgeScene,
    FieldEdges,
    Findings,
    Fit,
    FloatArray,
    FollowSettings,
    Prior,
    Samples,
    UInt8Array,
)
from robocup_vision.kernels.model_edges.verdict import explained, judge, log_odds, log_std

MODES = 5  # greatest number of modes that are examined in a frame
NO_FIT = -1e9  # score of a mode that cannot be fitted
CARPET_LIGHT = 225.0  # sum of blue, green and red of the carpet in the nominal light


@compiled(fastmath=True, error_model="numpy")
def brightness(carpet: FloatArray) -> float:
    """Return the light of a picture relative to that of the nominal colours, by its carpet.

    Of a carpet in sun and shade it is that of the shade, in which lines are fainter.
    """
    light = min(carpet[0] + carpet[1] + carpet[2], other_light(carpet))
    return float(min(max(light / CARPET_LIGHT, 0.15), 1.6))


@compiled(error_model="numpy")
def prepare(
    pose: FloatArray,
    covariance: FloatArray,
    camera_prior: FloatArray,
    keep: FloatArray,
    sway: FloatArray,
    into: Prior,
) -> bool:
    """Join the priors of pose and camera orientation; returns whether the covariance is positive definite.

    Parameters
    ----------
    pose : (3,) float64
        x, y, heading.
    covariance : (3, 3) float64
        Covariance of `pose`.
    camera_prior : (2, 4) float64
        Tilt, roll, height and logarithm of focal length at rest, and their standard deviations.
    keep : (4,) float64
        Fraction of the last frame's deviation that remains.
    sway : (2, 4) float64
        In: the deviations from rest in the last frame, and their variances. Out: those expected now.
    into : Prior
        Result.
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


@compiled(fastmath=True, error_model="numpy")
def follow(
    image: UInt8Array,
    scene: EdgeScene,
    prior: Prior,
    settings: FollowSettings,
    buffers: Buffers,
    fit: Fit,
    most_modes: int,
    knows_carpet: bool,
) -> bool:
    """Fit the unknowns to one frame under a prior, and return whether there was anything to fit.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    scene, prior, settings
        See `EdgeScene`, `Prior` and `FollowSettings`. All named tuples may be plain tuples.
    buffers : Buffers
        Scratch; contains the fit's samples, findings and line points afterwards.
    fit : Fit
        Result.
    most_modes : int
        Greatest number of modes that are examined.
    knows_carpet : bool
        Whether `fit.carpet` has already been computed from this image, with about the same tilt.
    """
    edges = FieldEdges(*scene[0])
    own_buffers = Buffers(
        Samples(*buffers[0]), Findings(*buffers[1]), buffers[2], buffers[3], buffers[4], buffers[5], buffers[6]
    )
    return _follow(
        image,
        EdgeScene(edges, scene[1], scene[2]),
        Prior(*prior),
        FollowSettings(*settings),
        own_buffers,
        Fit(*fit),
        most_modes,
        knows_carpet,
    )


@compiled(fastmath=True, error_model="numpy", inline="always")
def _follow(
    image: UInt8Array,
    scene: EdgeScene,
    prior: Prior,
    settings: FollowSettings,
    buffers: Buffers,
    fit: Fit,
    most_modes: int,
    knows_carpet: bool,
) -> bool:
    """See `follow`."""
    for i in range(fit.figures.shape[0]):
        fit.figures[i] = 0.0
    if not knows_carpet:
        carpet_look(image, int(horizon_row(scene.lens, prior.mean[3], prior.mean[4])), fit.carpet)
    light = brightness(fit.carpet)
    # choosing the best mode alone is faster, and most frames need no other
    modes = np.zeros((1, UNKNOWNS))
    looked_at, kept = propose(image, scene, prior, settings, buffers, fit.carpet, light, modes)
    if kept == 0:
        return False
    # with much in view a wider spacing gives enough samples
    spacing_px = max(settings.spacing_px, settings.coarse_spacing_px * looked_at / settings.ample_samples)
    z = modes[0].copy()
    # the line points of the first mode serve all modes, which differ little in the width of a line in the picture
    moved(prior, z, fit.unknowns)
    least = 0.5 * settings.min_ratio * scene.field.channels[0, 3] * light
    look = LineLook(
        max(least, 5.0 * fit.carpet[3]), settings.line_width_m, settings.max_line_widths, settings.point_stride
    )
    points = line_points(image, scene.lens, fit.unknowns, fit.carpet, look, buffers.points)
    is_decided, best_score = _assess(image, scene, prior, settings, spacing_px, buffers, points, fit, light, z)
    if not is_decided and most_modes > 1:
        modes = np.zeros((most_modes, UNKNOWNS))
        _, kept = propose(image, scene, prior, settings, buffers, fit.carpet, light, modes)
        # `propose` has overwritten the samples of the first mode
        best, last = variable(0), variable(-1)
        for k in range(1, kept):
            for j in range(UNKNOWNS):
                z[j] = modes[k, j]
            is_decided, score = _assess(image, scene, prior, settings, spacing_px, buffers, points, fit, light, z)
            last = k
            if score > best_score:
                best, best_score = k, score
                if is_decided:
                    break
        if best != last:
            # the buffers must contain the samples of the best mode
            for j in range(UNKNOWNS):
                z[j] = modes[best, j]
            _assess(image, scene, prior, settings, spacing_px, buffers, points, fit, light, z)
    return best_score > NO_FIT


@compiled(fastmath=True, error_model="numpy")
def _assess(
    image: UInt8Array,
    scene: EdgeScene,
    prior: Prior,
    settings: FollowSettings,
    spacing_px: float,
    buffers: Buffers,
    points: int,
    fit: Fit,
    light: float,
    z: FloatArray,
) -> tuple[bool, float]:
    """Refine a mode, and compute its figures and log odds with the line points of the picture.

    Returns
    -------
    bool, float
        Whether no other mode needs to be examined, and the mode's log odds; `NO_FIT` if it cannot be fitted.
    """
    figures, step = fit.figures, np.empty(UNKNOWNS)
    count, inliers, rms, ok = refine(image, scene, prior, settings, spacing_px, buffers, fit.carpet, light, z, step)
    if not ok or not covariance_with_prior(prior.root, buffers.information, fit.covariance):
        return False, NO_FIT
    if not pose_alone(prior.root, z, buffers.information, buffers.gradient, fit.information, fit.gradient):
        return False, NO_FIT
    seen, missing, upright, hidden = judge(image, fit.carpet, settings, buffers, count, step)
    moved(prior, z, fit.unknowns)
    silent, lens = scene.field.silent, scene.lens
    matched, neutral = explained(buffers, points, count, step, spacing_px, settings.gate_px, silent, lens, fit.unknowns)
    prior_distance2 = 0.0
    for j in range(UNKNOWNS):
        prior_distance2 += z[j] * z[j]
    figures[0], figures[1], figures[2], figures[3] = count, looked_for(buffers, count), seen, missing
    figures[4], figures[5], figures[6] = inliers, rms, prior_distance2
    figures[7], figures[8] = points - neutral, matched
    figures[9], figures[10] = _edges_found(buffers, count), position_std(fit.information)
    figures[11], figures[12] = upright, hidden
    odds = log_odds(figures, settings.weights)
    # that a frame leaves the position open does not contradict the mode
    if_fixed = odds + settings.weights[8] * (log_std(0.0) - log_std(figures[10]))
    figures[13], figures[14] = odds, if_fixed
    return if_fixed >= settings.sure_log_odds, odds


@compiled(fastmath=True, error_model="numpy")
def _edges_found(buffers: Buffers, count: int) -> int:
    """Count the edges of the field of which samples were found."""
    last = 0
    for n in range(count):
        last = max(last, buffers.samples.feature[n])
    is_found, found = np.zeros(last + 1, np.bool_), 0
    for n in range(count):
        feature = buffers.samples.feature[n]
        if buffers.found.status[n] == FOUND and not is_found[feature]:
            is_found[feature] = True
            found += 1
    return found
