"""Data of the loops as named tuples: the field's edges, the lens, the predicted samples and what was found there.

Unknowns are numbered alike everywhere: x and y of the camera's foot (m), heading of its axis, tilt, roll (rad), height
(m) and the logarithm of the focal length's scale.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array

__all__ = [
    "FieldEdges",
    "Findings",
    "FloatArray",
    "Int64Array",
    "Samples",
    "UInt8Array",
    "empty_findings",
    "empty_samples",
]

UNKNOWNS = 7
X, Y, HEADING, TILT, ROLL, HEIGHT, LOG_FOCAL = range(UNKNOWNS)

# kinds of samples
RIDGE, EDGE = 0, 1
# where a feature is: painted on the floor, or standing on it
ON_FLOOR, UPRIGHT = 0, 1
# classes of a sample in the verdict
UNSEEN, FOUND, HIDDEN, MISSING = 0, 1, 2, 3

PEAKS = 3  # candidates kept for a sample


class FieldEdges(NamedTuple):
    """The field's edges, field frame, metres.

    Parameters
    ----------
    segments : (S, 14) float64
        Straight edges that do not depend on the viewpoint, lines on the floor and feet of walls: x, y, z of both ends,
        unit vector towards the inside (of a line: across), width (of a wall: height), channel, feature, `ON_FLOOR` or
        `UPRIGHT`, 1 where it is a line.
    arcs : (A, 8) float64
        Curved lines: centre x and y, radius, start, sweep (rad), width, channel, feature.
    cylinders : (C, 7) float64
        Upright: x, y, radius, foot, top, channel, first feature.
    corners : (W, 9) float64
        Upright edges of goal panels, each a silhouette from one side only: x, y, foot, top, channel, feature, direction
        of the outside along y (1 or -1), 1 if it is a silhouette for viewpoints farther out than itself and 0 if for
        the others, width of the panel behind it.
    bars : (B, 7) float64
        Level, along y: x, y0, y1, height of the axis, radius, channel, first feature.
    rings : (R, 7) float64
        Around upright cylinders where the paint changes: x, y, radius, height, channel, height of the upper paint's
        band, feature.
    channels : (K, 8) float64
        Weights of blue, green and red, and the step of the weighted sum, from outside to inside, under the light that
        shows the carpet at `CARPET_LIGHT`; blue, green and red of the paint less their mean, zeros where it has no
        hue; the mean where the paint is white, else 0.
    silent : (B, 6) float64
        Boxes, least and greatest x, y and z: what looks like a line in or behind one is no evidence about the pose.
    """

    segments: FloatArray
    arcs: FloatArray
    cylinders: FloatArray
    corners: FloatArray
    bars: FloatArray
    rings: FloatArray
    channels: FloatArray
    silent: FloatArray


class Samples(NamedTuple):
    """Places on predicted edges; the number in use is passed beside it.

    Parameters
    ----------
    point_m : (M, 3) float64
        On the edge, field frame.
    uv : (M, 2) float64
        Predicted pixel.
    normal : (M, 2) float64
        Unit normal in the image; for an edge it points inside.
    jacobian : (M, 7) float64
        Derivatives of the pixel's position along the normal by the unknowns.
    width_px : (M,) float64
        Width of a ridge, or of the paint inside an edge, along the normal.
    expected : (M,) float64
        Expected step of its channel in grey levels, under the nominal light.
    channel, feature, kind, place : (M,) int64
        Index of the channel; index of the field's edge that it is on; `RIDGE` or `EDGE`; `ON_FLOOR` or `UPRIGHT`.
    """

    point_m: FloatArray
    uv: FloatArray
    normal: FloatArray
    jacobian: FloatArray
    width_px: FloatArray
    expected: FloatArray
    channel: Int64Array
    feature: Int64Array
    kind: Int64Array
    place: Int64Array


class Findings(NamedTuple):
    """What a frame shows at the samples.

    Parameters
    ----------
    offset_px : (M, PEAKS) float64
        Offsets of the candidates along the normal from the predicted pixel, the strongest first.
    strength : (M, PEAKS) float64
        Their steps in grey levels.
    candidates : (M,) int64
        Number of candidates of each sample; -1 if it was not looked for.
    status : (M,) int64
        `UNSEEN`, `FOUND`, `HIDDEN` or `MISSING`.
    """

    offset_px: FloatArray
    strength: FloatArray
    candidates: Int64Array
    status: Int64Array


class FollowSettings(NamedTuple):
    """Numbers of the loops; `localization.model_edges.settings.EdgeSettings` gives the reason for each.

    Parameters
    ----------
    spacing_px, coarse_spacing_px : float
        Least distance between samples in the fit, and their distance where the mode is chosen.
    ample_samples : float
        About this number of samples is enough for the fit.
    reach_sigmas : float
        Range of the search for a sample along its normal, in standard deviations of its offset by the prior.
    min_ratio : float
        Least step of a candidate, as a fraction of the expected one.
    sigma_px, shared_px : float
        Standard deviations of a sample's own error, and of the offset that all samples of an edge share.
    stray_ratio : float
        Fraction of the samples found that lie on another object than their edge, anywhere within `gate_px`.
    sharp_gates, sharp_steps : float, int
        Gate of the last steps, in robust standard deviations, and the number of these steps.
    gate_px : float
        Greatest residual of an inlier.
    again_px : float
        Range of the search for candidates around a fit.
    line_width_m : float
        Width of painted lines.
    point_stride : int
        Distance of the rows and columns that are read for line points.
    weights : (9,) float64
        See `verdict.log_odds`.
    sure_log_odds : float
        Log odds, as if the position were fixed, from which no other mode is examined.
    coarse_gates_px, fine_gates_px : (G,) float64
        Gates of the fit's steps, for the mode and for the final fit.
    max_line_widths : float
        Greatest width of a line, in line widths of the field file.
    bent_ratio : float
        Range of the first search for a mode, as a fraction of its distance from the prior in pixels; 0 for `again_px`.
    """

    spacing_px: float
    coarse_spacing_px: float
    ample_samples: float
    reach_sigmas: float
    min_ratio: float
    sigma_px: float
    shared_px: float
    stray_ratio: float
    sharp_gates: float
    sharp_steps: int
    gate_px: float
    again_px: float
    line_width_m: float
    point_stride: int
    weights: FloatArray
    sure_log_odds: float
    coarse_gates_px: FloatArray
    fine_gates_px: FloatArray
    max_line_widths: float
    bent_ratio: float


class Buffers(NamedTuple):
    """Arrays that every frame uses anew.

    Parameters
    ----------
    samples, found
        Predicted samples and what was found there.
    rows : (M, 7) float64
        Derivatives of the samples by the prior's standard normal unknowns.
    reach_px : (M,) float64
        Range of the search for each sample.
    points : (P, 3) float64
        Line points, see `bands.line_points`.
    information : (7, 7) float64
        Information about the standard normal unknowns by the measurements alone.
    gradient : (7,) float64
        Gradient of the measurements' log-likelihood at the fit.
    """

    samples: Samples
    found: Findings
    rows: FloatArray
    reach_px: FloatArray
    points: FloatArray
    information: FloatArray
    gradient: FloatArray


class EdgeScene(NamedTuple):
    """What stays from frame to frame.

    Parameters
    ----------
    field : FieldEdges
        The field.
    lens : (L,) float64
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
        Covariance of the unknowns, with the prior.
    information : (3, 3) float64
        Information about x, y and heading by the measurements alone; the other unknowns are marginalised under their
        prior.
    gradient : (3,) float64
        Gradient of that log-likelihood at the fit.
    carpet : (5,) or (8,) float64
        See `carpet_look`.
    figures : (15,) float64
        Numbers of samples, of those looked for, found, missing and inliers; root mean square of the inliers' residuals
        (pixels); squared Mahalanobis distance from the prior; numbers of line points that a pose must explain, of those
        explained, and of the field's edges found; greatest standard deviation of the position by the measurements alone
        (m); numbers of samples found above the floor and hidden there; log odds by all of these, and as if the position
        were fixed.
    """

    unknowns: FloatArray
    covariance: FloatArray
    information: FloatArray
    gradient: FloatArray
    carpet: FloatArray
    figures: FloatArray


def empty_buffers(samples: int, points: int) -> Buffers:
    """Return buffers for numbers of samples and line points."""
    return Buffers(
        empty_samples(samples),
        empty_findings(samples),
        np.zeros((samples, UNKNOWNS)),
        np.zeros(samples),
        np.zeros((points, 3)),
        np.zeros((UNKNOWNS, UNKNOWNS)),
        np.zeros(UNKNOWNS),
    )


def empty_samples(size: int) -> Samples:
    """Return buffers for a number of samples."""
    channel, feature, kind, place = (np.zeros(size, dtype=np.int64) for _ in range(4))
    return Samples(
        np.zeros((size, 3)),
        np.zeros((size, 2)),
        np.zeros((size, 2)),
        np.zeros((size, UNKNOWNS)),
        np.zeros(size),
        np.zeros(size),
        channel,
        feature,
        kind,
        place,
    )


def empty_findings(size: int) -> Findings:
    """Return buffers for the findings at a number of samples."""
    return Findings(
        np.zeros((size, PEAKS)), np.zeros((size, PEAKS)), np.zeros(size, np.int64), np.zeros(size, np.int64)
    )
