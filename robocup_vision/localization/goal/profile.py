"""The final fit of a goal of a hue: its posts, bar and feet as profiles of colour and brightness.

Camera chips and JPEG keep colour at half the resolution, while brightness may hardly differ from what is behind the
goal; both together, each with a blur of its own, give what either lacks (see `kernels.goal.profile`).
"""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.edges import goal_points
from robocup_vision.kernels.goal.profile import (
    CHANNELS,
    MEMBERS,
    OWN,
    PER_MEMBER,
    SHARED,
    DueGoal,
    ProfilePicture,
    ProfilePixels,
    ProfileSpread,
    ProfileUnknowns,
    gather_profiles,
)
from robocup_vision.kernels.goal.profile_fit import ProfilePriors, fit_profiles
from robocup_vision.localization.goal.edges import FOOT_OFFSETS, EdgeAppearance, EdgeSamples, from_ideal, to_ideal
from robocup_vision.localization.goal.fit import GoalFit, GoalModel, fit, residuals
from robocup_vision.localization.goal.geometry import BAR_TOP, EDGES

_PIECES = 6
_MAX_LINES = 3
_ROUNDS = 4
_REACH_PX = 3.0
_CLEAR_OF_CORNERS_PX = 1.8
_MARGIN_PX = 14
_SATURATED = 246
_BRIGHTNESS = (0.114, 0.587, 0.299)
# priors: optics, lamps and the evenness of paint
_BLUR_PX, _BLUR_STD_PX = (0.7, 0.6), 0.3
_ACROSS_STD, _CURVE_STD, _ALONG_STD = 0.2, 0.2, 0.1
_MOVE_STD_PX = 1.0
_MAX_STD_PX = 0.6
# what edges and feet are off as a whole, beside what their noise says
_EDGE_ERROR_PX, _FOOT_ERROR_PX = 0.03, 0.06
_SCALES = np.array([1.0, 0.5, 0.3, 0.3])
_MIN_SAMPLES = 10
# the profiles' fit is the edges' refined: it may not be somewhere else
_MAX_SHIFT = 5.0
_FREEDOM, _TRUSTED = 5, 2.0


def expected_profile() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the prior (SHARED,) on what all profiles share: values, and inverse variances."""
    expected, weight = np.zeros(SHARED), np.full(SHARED, 1e-6)
    expected[:CHANNELS], weight[:CHANNELS] = _BLUR_PX, _BLUR_STD_PX**-2
    for base in range(CHANNELS, SHARED, PER_MEMBER):
        weight[base], weight[base + 1] = _ACROSS_STD**-2, _CURVE_STD**-2
        weight[base + 3 : base + PER_MEMBER : 2] = _ALONG_STD**-2
    return expected, weight


def measure_profiles(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    unknowns: npt.NDArray[np.float64],
    appearance: EdgeAppearance,
) -> EdgeSamples | None:
    """Measure both edges of each segment of posts and bar, and the feet, near where `unknowns` put them.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    camera, model : PinholeCamera, GoalModel
        The camera, and goal and view without distortion.
    unknowns : (8,) float64
        Right to a pixel, in the order of goal/geometry.py.
    appearance : EdgeAppearance
        Of the paint.

    Returns
    -------
    EdgeSamples or None
        Their noise is that of each alone. None where too little of the goal is in view.
    """
    feet = len(FOOT_OFFSETS)
    points = np.empty((2 * EDGES + 4 * feet, 2))
    if not goal_points(model.scene, unknowns, points):
        return None
    points = from_ideal(camera, points)
    width, height = camera.size_px
    u0, v0 = (int(max(0.0, low)) for low in points.min(axis=0) - _MARGIN_PX)
    u1, v1 = (int(x) for x in np.minimum(points.max(axis=0) + _MARGIN_PX, (width, height)))
    if u1 - u0 < 8 or v1 - v0 < 8:
        return None
    part = image[v0:v1, u0:u1]
    shine = np.asarray(cv2.inRange(part, (0, 0, 0), (_SATURATED - 1,) * 3) == 0, np.uint8)
    points -= (u0, v0)
    edges, spans, arcs = _predicted(points)
    segments = MEMBERS * _PIECES + 2
    room = _PIECES * _MAX_LINES * (2 * (part.shape[0] + part.shape[1]) // 3) + 400
    pixels = ProfilePixels(
        np.empty((room, CHANNELS)),
        np.empty((room, 4)),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(segments),
    )
    picture = ProfilePicture(part, np.array([appearance.towards, _BRIGHTNESS]), shine)
    count = gather_profiles(picture, DueGoal(edges, spans, arcs), ProfileSpread(_PIECES, _REACH_PX, _MAX_LINES), pixels)
    if count < SHARED:
        return None
    middle = pixels.middle
    pixels = ProfilePixels(
        pixels.values[:count], pixels.places[:count], pixels.owner[:count], pixels.lane[:count], middle
    )
    expected, weight = expected_profile()
    own, variance = np.zeros((segments, OWN)), np.empty((segments, 2))
    profiles = ProfileUnknowns(expected.copy(), own)
    priors = ProfilePriors(expected, weight, _MOVE_STD_PX)
    if not fit_profiles(pixels, _PIECES, priors, _ROUNDS, profiles, variance):
        return None
    variance[np.isnan(variance) | (np.abs(own[:, :2]) > 2 * _MOVE_STD_PX)] = np.inf
    at = middle[: MEMBERS * _PIECES, None]
    member = np.repeat(np.arange(MEMBERS), _PIECES)[:, None]
    edge = 2 * member + [0, 1]
    slope = edges[edge, 1]
    across = edges[edge, 0] + slope * at + np.array([-1.0, 1.0]) * own[: len(at), :2] * np.sqrt(1 + slope**2)
    along = np.broadcast_to(at, across.shape)
    uv = np.where((edge < BAR_TOP)[..., None], np.stack([across, along], -1), np.stack([along, across], -1))
    good = variance[: len(at)] < _MAX_STD_PX**2
    steep = arcs[:, 1] / (
        0.5 * (edges[[1, 3], 0] - edges[[0, 2], 0] + (edges[[1, 3], 1] - edges[[0, 2], 1]) * arcs[:, 0])
    )
    direction = np.stack([-steep, np.ones(2)], axis=-1) / np.sqrt(1 + steep**2)[:, None]
    middle_foot = 2 * EDGES + np.array([feet // 2, feet + feet // 2])
    foot_uv = points[middle_foot] + own[len(at) :, :1] * direction
    stands = variance[len(at) :, 0] < _MAX_STD_PX**2
    return EdgeSamples(
        np.ascontiguousarray(edge[good]),
        np.ascontiguousarray(to_ideal(camera, uv[good] + (u0, v0))),
        np.flatnonzero(stands),
        np.full(int(stands.sum()), feet // 2),
        np.ascontiguousarray(to_ideal(camera, foot_uv[stands] + (u0, v0))),
        np.ascontiguousarray(direction[stands]),
        np.sqrt(np.concatenate([variance[: len(at)][good], variance[len(at) :, 0][stands]])),
        np.bincount(edge[np.isfinite(along)], minlength=EDGES),
    )


def _predicted(points: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], ...]:
    """Lines of the edges, free spans of the members and arcs of the feet, as `gather_profiles` takes them."""
    ends = points[: 2 * EDGES].reshape(EDGES, 2, 2)
    ends = np.where((np.arange(EDGES) < BAR_TOP)[:, None, None], ends, ends[..., ::-1])  # across, along
    slope = (ends[:, 1, 0] - ends[:, 0, 0]) / (ends[:, 1, 1] - ends[:, 0, 1])
    edges = np.column_stack([ends[:, 0, 0] - slope * ends[:, 0, 1], slope])
    feet = points[2 * EDGES : 2 * EDGES + 2 * len(FOOT_OFFSETS), 1].reshape(2, -1)
    s = float(FOOT_OFFSETS[-1])
    low, middle, high = feet[:, 0], feet[:, len(FOOT_OFFSETS) // 2], feet[:, -1]
    arcs = np.column_stack([middle, (high - low) / (2 * s), (high + low - 2 * middle) / (2 * s * s)])
    under_bar = points[2 * EDGES - 2 : 2 * EDGES]
    spans = np.empty((MEMBERS, 2))
    spans[:2, 0], spans[:2, 1] = under_bar[:, 1] + _CLEAR_OF_CORNERS_PX, feet.min(axis=1) - _CLEAR_OF_CORNERS_PX
    spans[2] = under_bar[0, 0] + _CLEAR_OF_CORNERS_PX, under_bar[1, 0] - _CLEAR_OF_CORNERS_PX
    return edges, spans, arcs


def polish(
    image: npt.NDArray[np.uint8], camera: PinholeCamera, model: GoalModel, found: GoalFit, appearance: EdgeAppearance
) -> GoalFit:
    """Fit the profiles from where the edges' fit ended; what was found, unchanged, where they do not confirm it.

    Parameters
    ----------
    image : (H, W, 3) uint8
        BGR.
    camera, model : PinholeCamera, GoalModel
        See `refine`.
    found : GoalFit
        What `refine` found.
    appearance : EdgeAppearance
        Of the paint.
    """
    alone = measure_profiles(image, camera, model, found.unknowns, appearance)
    if alone is None or len(alone.edge) < _MIN_SAMPLES or len(np.unique(alone.edge)) < EDGES:
        return found
    samples, single = _with_feet(*_weighed(alone), found.samples)
    p, cost, information = fit(model, samples, found.unknowns, _SCALES)
    shift = p - found.unknowns
    if not math.isfinite(cost) or shift @ found.information @ shift > _MAX_SHIFT**2:
        return found
    residual = residuals(model, samples, p)
    # the fit's own misfit says what every edge is off as a whole
    square = np.minimum((residual / samples.sigma) ** 2, 9 * single / samples.sigma**2).sum()
    due = max(float((single / samples.sigma**2).sum()) - _FREEDOM, 1.0)
    excess = (float(square) + _TRUSTED) / (due + _TRUSTED)
    samples = replace(samples, sigma=samples.sigma * math.sqrt(excess))
    return replace(found, unknowns=p, information=information / excess, samples=samples, residual_px=residual)


def _weighed(alone: EdgeSamples) -> tuple[EdgeSamples, npt.NDArray[np.float64]]:
    """Let the noise include what an edge as a whole may be off; returns the variance of each single sample as well."""
    n = len(alone.edge)
    typical = float(np.mean(alone.sigma[:n] ** 2))
    whole = np.full(len(alone.sigma), _EDGE_ERROR_PX**2 + typical)
    whole[n:] = _FOOT_ERROR_PX**2 + 2 * typical
    per_edge = np.bincount(alone.edge, minlength=EDGES)[alone.edge]
    shared = whole * np.concatenate([per_edge, np.ones(len(alone.foot_post))])
    return replace(alone, sigma=np.sqrt(alone.sigma**2 + shared)), alone.sigma**2 + whole


def _with_feet(
    samples: EdgeSamples, single: npt.NDArray[np.float64], other: EdgeSamples
) -> tuple[EdgeSamples, npt.NDArray[np.float64]]:
    """Add the feet that `measure` found, whose errors are of another kind; `other` is weighed already."""
    sigma = other.sigma[len(other.edge) :]
    per_foot = np.bincount(other.foot_post, minlength=2)[other.foot_post]
    joined = replace(
        samples,
        foot_post=np.concatenate([samples.foot_post, other.foot_post]),
        foot_at=np.concatenate([samples.foot_at, other.foot_at]),
        foot_uv=np.vstack([samples.foot_uv, other.foot_uv]),
        foot_direction=np.vstack([samples.foot_direction, other.foot_direction]),
        sigma=np.concatenate([samples.sigma, sigma]),
    )
    return joined, np.concatenate([single, sigma**2 / per_foot])
