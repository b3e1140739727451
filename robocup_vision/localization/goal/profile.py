"""The final fit of a goal of a hue: its posts, bar and feet as profiles of colour and brightness.

Camera chips and JPEG keep colour at half the resolution, while brightness may hardly differ from what is behind the
goal; both together, each with a blur of its own, give what either lacks (see `kernels.goal.profile`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.edge_places import goal_points
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

_BRIGHTNESS = (0.114, 0.587, 0.299)  # of B, G and R: the luma of BT.601
_SCALES = np.array([1.0, 0.5, 0.3, 0.3])  # of the robust loss in each iteration, pixels: the start is right to a pixel


@dataclass(frozen=True, slots=True)
class ProfileSettings:
    """Which pixels are taken, what is known of paint and optics before, and when the profiles' fit counts.

    Parameters
    ----------
    pieces : int
        Segments of a member: enough to see one that is hidden, long enough to average noise.
    max_lines : int
        Rows (bar: columns) of a segment: more add little, for their errors are alike.
    rounds : int
        Of the profiles' fit: it moves by less than a pixel.
    reach_px : float
        Of background beside an edge: wider than the blur.
    clear_of_corners_px : float
        Left out at corners and feet, where two members blur into each other.
    margin_px : int
        Around the goal in the picture: room for background and for an edge a pixel off.
    saturated : int
        Level from which a pixel shines: a chip's response bends there.
    blur_px, blur_std_px : (float, float), float
        Prior on the blur of colour and of brightness: JPEG keeps colour at half the resolution.
    across_std, curve_std, along_std : float
        Prior on the paint's light across a member, its curve, and along it: lamps and the evenness of paint.
    move_std_px : float
        Prior on an edge's move: the edges' fit is right to a pixel.
    max_std_px : float
        Noise from which a segment's edge is left out: it is less certain than the edges' fit.
    edge_error_px, foot_error_px : float
        Error that whole edges and feet have in common, beside their noise.
    min_samples : int
        Edges that must be measured: more than the unknowns.
    max_shift : float
        Standard deviations that the result may be off the edges' fit, which it refines.
    freedom, trusted : float
        Unknowns that the goal's edges determine, and how many samples the noise of their own is trusted as.
    """

    pieces: int = 6
    max_lines: int = 3
    rounds: int = 4
    reach_px: float = 3.0
    clear_of_corners_px: float = 1.8
    margin_px: int = 14
    saturated: int = 246
    blur_px: tuple[float, float] = (0.7, 0.6)
    blur_std_px: float = 0.3
    across_std: float = 0.2
    curve_std: float = 0.2
    along_std: float = 0.1
    move_std_px: float = 1.0
    max_std_px: float = 0.6
    edge_error_px: float = 0.03
    foot_error_px: float = 0.06
    min_samples: int = 10
    max_shift: float = 5.0
    freedom: int = 5
    trusted: float = 2.0


def expected_profile(
    settings: ProfileSettings = ProfileSettings(),
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Return the prior (SHARED,) on the unknowns common to all profiles: values, and inverse variances."""
    expected, weight = np.zeros(SHARED), np.full(SHARED, 1e-6)
    expected[:CHANNELS], weight[:CHANNELS] = settings.blur_px, settings.blur_std_px**-2
    for base in range(CHANNELS, SHARED, PER_MEMBER):
        weight[base], weight[base + 1] = settings.across_std**-2, settings.curve_std**-2
        weight[base + 3 : base + PER_MEMBER : 2] = settings.along_std**-2
    return expected, weight


def measure_profiles(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    unknowns: npt.NDArray[np.float64],
    appearance: EdgeAppearance,
    settings: ProfileSettings = ProfileSettings(),
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
    settings : ProfileSettings, optional
        Which pixels are taken, what is known before, and when the fit counts.

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
    u0, v0 = (int(max(0.0, low)) for low in points.min(axis=0) - settings.margin_px)
    u1, v1 = (int(x) for x in np.minimum(points.max(axis=0) + settings.margin_px, (width, height)))
    if u1 - u0 < 8 or v1 - v0 < 8:
        return None
    part = image[v0:v1, u0:u1]
    shine = np.asarray(cv2.inRange(part, (0, 0, 0), (settings.saturated - 1,) * 3) == 0, np.uint8)
    points -= (u0, v0)
    edges, spans, arcs = _predicted(points, settings.clear_of_corners_px)
    segments = MEMBERS * settings.pieces + 2
    room = settings.pieces * settings.max_lines * (2 * (part.shape[0] + part.shape[1]) // 3) + 400
    pixels = ProfilePixels(
        np.empty((room, CHANNELS)),
        np.empty((room, 4)),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(segments),
    )
    picture = ProfilePicture(part, np.array([appearance.towards, _BRIGHTNESS]), shine)
    count = gather_profiles(
        picture,
        DueGoal(edges, spans, arcs),
        ProfileSpread(settings.pieces, settings.reach_px, settings.max_lines),
        pixels,
    )
    if count < SHARED:
        return None
    middle = pixels.middle
    pixels = ProfilePixels(
        pixels.values[:count], pixels.places[:count], pixels.owner[:count], pixels.lane[:count], middle
    )
    expected, weight = expected_profile(settings)
    own, variance = np.zeros((segments, OWN)), np.empty((segments, 2))
    profiles = ProfileUnknowns(expected.copy(), own)
    priors = ProfilePriors(expected, weight, settings.move_std_px)
    if not fit_profiles(pixels, settings.pieces, priors, settings.rounds, profiles, variance):
        return None
    variance[np.isnan(variance) | (np.abs(own[:, :2]) > 2 * settings.move_std_px)] = np.inf
    at = middle[: MEMBERS * settings.pieces, None]
    member = np.repeat(np.arange(MEMBERS), settings.pieces)[:, None]
    edge = 2 * member + [0, 1]
    slope = edges[edge, 1]
    across = edges[edge, 0] + slope * at + np.array([-1.0, 1.0]) * own[: len(at), :2] * np.sqrt(1 + slope**2)
    along = np.broadcast_to(at, across.shape)
    uv = np.where((edge < BAR_TOP)[..., None], np.stack([across, along], -1), np.stack([along, across], -1))
    good = variance[: len(at)] < settings.max_std_px**2
    steep = arcs[:, 1] / (
        0.5 * (edges[[1, 3], 0] - edges[[0, 2], 0] + (edges[[1, 3], 1] - edges[[0, 2], 1]) * arcs[:, 0])
    )
    direction = np.stack([-steep, np.ones(2)], axis=-1) / np.sqrt(1 + steep**2)[:, None]
    middle_foot = 2 * EDGES + np.array([feet // 2, feet + feet // 2])
    foot_uv = points[middle_foot] + own[len(at) :, :1] * direction
    stands = variance[len(at) :, 0] < settings.max_std_px**2
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


def _predicted(points: npt.NDArray[np.float64], clear_px: float) -> tuple[npt.NDArray[np.float64], ...]:
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
    spans[:2, 0], spans[:2, 1] = under_bar[:, 1] + clear_px, feet.min(axis=1) - clear_px
    spans[2] = under_bar[0, 0] + clear_px, under_bar[1, 0] - clear_px
    return edges, spans, arcs


def polish(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    found: GoalFit,
    appearance: EdgeAppearance,
    settings: ProfileSettings = ProfileSettings(),
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
    settings : ProfileSettings, optional
        Which pixels are taken, what is known before, and when the fit counts.
    """
    alone = measure_profiles(image, camera, model, found.unknowns, appearance, settings)
    if alone is None or len(alone.edge) < settings.min_samples or len(np.unique(alone.edge)) < EDGES:
        return found
    samples, single = _with_feet(*_weighed(alone, settings), found.samples)
    p, cost, information = fit(model, samples, found.unknowns, _SCALES)
    shift = p - found.unknowns
    if not math.isfinite(cost) or shift @ found.information @ shift > settings.max_shift**2:
        return found
    residual = residuals(model, samples, p)
    # the residuals of the fit estimate the error of each whole edge
    square = np.minimum((residual / samples.sigma) ** 2, 9 * single / samples.sigma**2).sum()
    due = max(float((single / samples.sigma**2).sum()) - settings.freedom, 1.0)
    excess = (float(square) + settings.trusted) / (due + settings.trusted)
    samples = replace(samples, sigma=samples.sigma * math.sqrt(excess))
    return replace(found, unknowns=p, information=information / excess, samples=samples, residual_px=residual)


def _weighed(alone: EdgeSamples, settings: ProfileSettings) -> tuple[EdgeSamples, npt.NDArray[np.float64]]:
    """Let the noise include what an edge as a whole may be off; returns the variance of each single sample as well."""
    n = len(alone.edge)
    typical = float(np.mean(alone.sigma[:n] ** 2))
    whole = np.full(len(alone.sigma), settings.edge_error_px**2 + typical)
    whole[n:] = settings.foot_error_px**2 + 2 * typical
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
