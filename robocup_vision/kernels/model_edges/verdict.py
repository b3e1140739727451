"""Decides whether a picture confirms a pose: samples found, hidden or missing, and line points left unexplained."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.model_edges.carpet import is_carpet_at
from robocup_vision.kernels.model_edges.prediction import FRAME, pose_frame, ray
from robocup_vision.kernels.model_edges.tables import (
    EDGE,
    FOUND,
    HIDDEN,
    MISSING,
    ON_FLOOR,
    RIDGE,
    UNKNOWNS,
    UNSEEN,
    Buffers,
    FloatArray,
    FollowSettings,
    UInt8Array,
)

# least width in pixels of a line that is surely found if it is in view
SURE_PX = 1.0


@compiled(fastmath=True, error_model="numpy")
def _shows_carpet(image: UInt8Array, flat: UInt8Array, u: float, v: float, carpet: FloatArray) -> bool:
    """Return whether a pixel shows carpet with its full saturation."""
    x, y = int(round(u)), int(round(v))
    height, width = image.shape[0], image.shape[1]
    if x < 1 or y < 1 or x > width - 2 or y > height - 2:
        return False
    return is_carpet_at(flat, 3 * (y * width + x), 3, 3 * width, carpet, 1.0)


@compiled(fastmath=True, error_model="numpy")
def judge(
    image: UInt8Array, carpet: FloatArray, settings: FollowSettings, buffers: Buffers, count: int, z: FloatArray
) -> tuple[int, int, int, int]:
    """Classify each sample, and fill in `found.status`.

    A sample without a candidate is missing, and so contradicts the pose, only if plain carpet shows in place of its
    paint; anything else may hide it. A line thinner than a pixel is easily overlooked: it counts as hidden.

    Returns
    -------
    int, int, int, int
        Numbers of samples that are found, missing, found above the floor, and hidden above the floor.
    """
    samples, rows, found, gate_px = buffers.samples, buffers.rows, buffers.found, settings.gate_px
    seen, missing, upright, hidden = 0, 0, 0, 0
    flat = image.reshape(-1)
    for n in range(count):
        if found.candidates[n] < 0:
            found.status[n] = UNSEEN
            continue
        expected = 0.0
        for j in range(UNKNOWNS):
            expected += rows[n, j] * z[j]
        is_found = False
        for k in range(found.candidates[n]):
            if abs(found.offset_px[n, k] - expected) < gate_px:
                is_found = True
        if is_found:
            found.status[n] = FOUND
            seen += 1
            if samples.place[n] != ON_FLOOR:
                upright += 1
            continue
        if samples.kind[n] == RIDGE and samples.width_px[n] < SURE_PX:
            found.status[n] = HIDDEN
            continue
        # offset along the normal to where the paint should be
        offset = expected
        if samples.kind[n] == EDGE:
            offset += 0.5 * min(samples.width_px[n], 8.0)
        u = samples.uv[n, 0] + samples.normal[n, 0] * offset
        v = samples.uv[n, 1] + samples.normal[n, 1] * offset
        if _shows_carpet(image, flat, u, v, carpet):
            found.status[n] = MISSING
            missing += 1
        else:
            found.status[n] = HIDDEN
            if samples.place[n] != ON_FLOOR:
                hidden += 1
    return seen, missing, upright, hidden


@compiled(fastmath=True, error_model="numpy")
def explained(
    buffers: Buffers,
    number: int,
    count: int,
    z: FloatArray,
    spacing_px: float,
    gate_px: float,
    silent: FloatArray,
    lens: FloatArray,
    p: FloatArray,
) -> tuple[int, int]:
    """Count the line points that lie on predicted lines, and those of the others that lie in silent boxes.

    Parameters
    ----------
    buffers : Buffers
        Samples and line points.
    number, count : int
        Numbers of line points and of samples.
    z : (7,) float64
        The fit, about where the samples were predicted.
    spacing_px, gate_px : float
        See `FollowSettings`.
    silent : (B, 6) float64
        See `FieldEdges`.
    lens : (L,) float64
        See `prediction.predict`.
    p : (7,) float64
        The unknowns of the fit.

    Returns
    -------
    int, int
        Numbers of points that are explained, and of others that are no evidence for or against the pose.
    """
    points, samples, rows = buffers.points, buffers.samples, buffers.rows
    on_lines, neutral = 0, 0
    frame = np.empty(FRAME)
    pose_frame(p, lens, frame)
    for m in range(number):
        u, v = points[m, 0], points[m, 1]
        is_explained = False
        for n in range(count):
            if samples.place[n] != ON_FLOOR:
                continue
            du, dv = u - samples.uv[n, 0], v - samples.uv[n, 1]
            if abs(du) > 2.0 * spacing_px or abs(dv) > 2.0 * spacing_px:
                continue
            nu, nv = samples.normal[n, 0], samples.normal[n, 1]
            across = du * nu + dv * nv
            for j in range(UNKNOWNS):
                across -= rows[n, j] * z[j]
            along = dv * nu - du * nv
            slack = gate_px
            if samples.kind[n] != RIDGE:
                slack += 0.5 * samples.width_px[n]
                across -= 0.5 * samples.width_px[n]
            if abs(along) < 1.2 * spacing_px and abs(across) < slack:
                is_explained = True
                break
        if is_explained:
            on_lines += 1
        elif _is_silent(silent, lens, frame, u, v):
            neutral += 1
    return on_lines, neutral


@compiled(fastmath=True, error_model="numpy")
def _is_silent(silent: FloatArray, lens: FloatArray, frame: FloatArray, u: float, v: float) -> bool:
    """Return whether the ray of a pixel passes through a silent box; `frame` as `pose_frame` prepares it."""
    direction = ray(lens, frame, u, v)
    for n in range(silent.shape[0]):
        # distances along the ray at which it enters and leaves the box
        begin, end = 0.0, 1e9
        for k in range(3):
            times = 1.0 / direction[k] if abs(direction[k]) > 1e-9 else 1e9
            low, high = (silent[n, 2 * k] - frame[9 + k]) * times, (silent[n, 2 * k + 1] - frame[9 + k]) * times
            begin, end = max(begin, min(low, high)), min(end, max(low, high))
        if begin <= end:
            return True
    return False


@compiled(fastmath=True, error_model="numpy")
def log_std(position_std_m: float) -> float:
    """Return the logarithm of a standard deviation (m) plus the camera's error of 1 cm; open positions count as 1 m."""
    return math.log(min(position_std_m, 1.0) + 0.01)


@compiled(fastmath=True, error_model="numpy")
def log_odds(figures: FloatArray, weights: FloatArray) -> float:
    """Return the log odds that a fit near a prior is right, as `localization.model_edges.evidence` defines them.

    Parameters
    ----------
    figures : (15,) float64
        See `Fit`.
    weights : (9,) float64
        Constant, then weights of the squared distance from the prior, the logarithm of the inliers, the fraction of
        missing samples, that of hidden ones above the floor, that of unexplained line points, the root mean square of
        the residuals, the number of edges, and the logarithm of the position's standard deviation.
    """
    found, missing, inliers, rms, far = figures[2], figures[3], figures[4], figures[5], figures[6]
    points, right, upright, hidden = figures[7], figures[8], figures[11], figures[12]
    return float(
        weights[0]
        + weights[1] * far
        + weights[2] * math.log(1.0 + inliers)
        + weights[3] * missing / (found + missing + 4.0)
        + weights[4] * hidden / (upright + hidden + 4.0)
        + weights[5] * (points - right) / (points + 4.0)
        + weights[6] * rms
        + weights[7] * figures[9]
        + weights[8] * log_std(figures[10])
    )
