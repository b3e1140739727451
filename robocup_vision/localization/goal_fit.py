"""From rough posts to a camera: starts from both obliquenesses, then the direct fit to silhouette edges.

The measurement decides, not the solver: five unknowns (and, under priors, height, focal length and bloom) are fitted by
Gauss-Newton to sub-pixel edges of posts, bar and feet (see kernels.goal_fit.fit_goal).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import FloatArray
from robocup_vision.kernels.goal_fit import fit_goal, goal_residuals
from robocup_vision.kernels.goal_strips import mean_along
from robocup_vision.localization.goal_edges import FOOT_OFFSETS, EdgeSamples, Look, measure, to_ideal
from robocup_vision.localization.goal_geometry import (
    BAR_BOTTOM,
    BAR_TOP,
    BLOOM,
    EDGES,
    HEADING,
    HEIGHT,
    LOG_FOCAL,
    ROLL,
    TILT,
    UNKNOWNS,
    GoalShape,
    IdealView,
    X,
    Y,
    project,
)
from robocup_vision.perception.goal_region import Strip

INLIER_PX = 0.5
# feet alone tell the two branches apart, and are few
FOOT_WORTH = 3.0
# shares of an element's edges, and of all, that must be in place
LEAST_ELEMENT_SHARE = 0.45
LEAST_EDGE_SHARE = 0.2  # a post has two edges
LEAST_OTHER_SHARE = 0.6  # of the other five edges, where one post edge is missing
LEAST_SCORE = 0.5
MOST_STRAIN = 3.5  # standard deviations that a prior may be off
# what an edge as a whole may be off, however many samples it has: paint, shading, posts that are no perfect cylinders
_EDGE_ERROR_PX = 0.075
_FOOT_ERROR_PX = 0.25
_SAMPLE_ERROR_PX = 0.05
_UPRIGHT_STD_RAD = 0.1  # a robot's camera is roughly upright even where the file says nothing
_KNOWN_ANGLE_STD_RAD = 0.01
_START_SCALES = np.full(8, 100.0)
_SECOND_REACH_PX, _PLAIN_SHARE = 2.0, 0.95


@dataclass(frozen=True, slots=True)
class GoalModel:
    """Goal, camera and priors in the form the kernels take them.

    Parameters
    ----------
    shape, view : GoalShape, IdealView
        The goal at +x, and the camera without distortion.
    prior, weight : (8,) float64
        Expected unknowns, and their inverse variances.
    """

    shape: GoalShape
    view: IdealView
    prior: FloatArray
    weight: FloatArray

    @property
    def shape_array(self) -> FloatArray:
        """(4,) float64 as the kernels take it."""
        s = self.shape
        return np.array([s.line_x_m, s.width_m, s.height_m, s.radius_m])

    @property
    def view_array(self) -> FloatArray:
        """(4,) float64 as the kernels take it."""
        return np.array([*self.view.focal_px, *self.view.center_px])


def goal_model(shape: GoalShape, camera: PinholeCamera, bloom_std_px: float) -> GoalModel:
    """Priors as the camera file gives them: height, focal length, and tilt and roll where they are known."""
    prior = np.zeros(UNKNOWNS)
    std = np.full(UNKNOWNS, np.inf)
    prior[HEIGHT], std[HEIGHT] = camera.height_m, camera.height_std_m
    std[LOG_FOCAL] = camera.focal_std_px / camera.focal_px[0]
    std[BLOOM] = bloom_std_px
    known = camera.roll_std_rad if camera.roll_std_rad is not None else _KNOWN_ANGLE_STD_RAD
    if camera.tilt_rad is not None:
        prior[TILT], std[TILT] = camera.tilt_rad, known
    if camera.roll_rad is not None:
        prior[ROLL], std[ROLL] = camera.roll_rad, known
    else:
        std[ROLL] = camera.roll_std_rad if camera.roll_std_rad is not None else _UPRIGHT_STD_RAD
    with np.errstate(divide="ignore"):
        weight = np.where(np.isinf(std), 0.0, 1.0 / np.maximum(std, 0.0) ** 2)
    return GoalModel(shape, IdealView(camera.focal_px, camera.center_px), prior, weight)


@dataclass(frozen=True, eq=False)
class GoalFit:
    """A goal found and fitted, for the goal at +x.

    Parameters
    ----------
    unknowns : (8,) float64
        See goal_geometry.
    information : (8, 8) float64
        Inverse covariance of the unknowns, priors included.
    samples : EdgeSamples
        What was measured last.
    residual_px : (N + M,) float64
        Of its edge samples and foot samples.
    share : (6,) float64
        Inliers among the expected samples of each silhouette edge.
    """

    unknowns: FloatArray
    information: FloatArray
    samples: EdgeSamples
    residual_px: FloatArray
    share: FloatArray

    @property
    def score(self) -> float:
        """How well the goal agrees with the fit, 0 to 1, at an absolute scale.

        A scale that adapted to the residuals would take the mirror branch, whose edges lie half a pixel off, for a
        noisy picture of the right one.
        """
        return agreement(self.samples, self.residual_px)

    @property
    def element_shares(self) -> tuple[float, float, float]:
        """Shares of the left post, the right post and the bar."""
        return element_shares(self.share)


def agreement(samples: EdgeSamples, residual_px: FloatArray) -> float:
    """Score of a fit with these residuals (N + M,), see `GoalFit.score`."""
    n = len(samples.edge)
    worth = np.maximum(0.0, 1.0 - (residual_px / INLIER_PX) ** 2)
    worth[n:] = FOOT_WORTH * np.maximum(0.0, 1.0 - (residual_px[n:] / (2 * INLIER_PX)) ** 2)
    # a foot may be hidden, so its absence is forgiven where its presence counts
    return float(worth.sum() / (int(samples.expected.sum()) + FOOT_WORTH * max(len(worth) - n, len(FOOT_OFFSETS))))


def are_mostly_within(residual_px: FloatArray, limit_px: float) -> bool:
    """Whether their median is within the limit."""
    return bool(2 * np.count_nonzero(np.abs(residual_px) < limit_px) > len(residual_px))


def element_shares(share: FloatArray) -> tuple[float, float, float]:
    """Shares of the left post, the right post and the bar from those of the six edges."""
    left, right, bar = share[:2].mean(), share[2:4].mean(), max(share[BAR_TOP], share[BAR_TOP:].mean())
    return float(left), float(right), float(bar)


def objection(model: GoalModel, found: GoalFit, extent_m: FloatArray) -> str | None:
    """Why a fit cannot be the goal, or None.

    Parameters
    ----------
    model, found : GoalModel, GoalFit
        What was fitted.
    extent_m : (2,) float64
        Greatest |x| and |y| at which a camera can stand.
    """
    feet = np.abs(found.residual_px[len(found.samples.edge) :]) < 2 * INLIER_PX
    standing = np.bincount(found.samples.foot_post[feet], minlength=2) >= 2
    share = found.share.copy()
    bare = np.flatnonzero(share[:BAR_TOP] < LEAST_EDGE_SHARE)
    if len(bare) == 1 and standing.all() and np.delete(share, bare).min() >= LEAST_OTHER_SHARE:
        # something of the goal's own hue right behind it may hide one edge: all the others speak for it
        share[bare] = share[bare ^ 1]
    shares = element_shares(share)
    if min(shares) < LEAST_ELEMENT_SHARE or found.score < LEAST_SCORE or min(share[:BAR_TOP]) < LEAST_EDGE_SHARE:
        weakest = ("left post", "right post", "bar")[int(np.argmin(shares))]
        return f"only {min(shares):.0%} of the {weakest}'s edges are where they should be"
    if np.any(np.abs(found.unknowns[:2]) > extent_m):
        x, y = found.unknowns[:2]
        return f"what looks like one would put the camera off the pitch, at x = {x:.1f}, y = {y:.1f} m"
    strain = _strains(model, found.unknowns)
    if float(strain.max()) > MOST_STRAIN:
        what = ("x", "y", "heading", "tilt", "roll", "height", "focal length", "bleeding")[int(np.argmax(strain))]
        return f"what looks like one would need a camera {what} that is {strain.max():.0f} standard deviations off"
    if not standing.any():
        return "what looks like one does not stand on the carpet"
    return None


def _strains(model: GoalModel, unknowns: FloatArray) -> FloatArray:
    return np.asarray(np.abs(unknowns - model.prior) * np.sqrt(np.where(np.isinf(model.weight), 0.0, model.weight)))


def strain_of(model: GoalModel, unknowns: FloatArray) -> float:
    """How far the prior that suffers most is off, standard deviations."""
    return float(_strains(model, unknowns).max())


def strip_samples(camera: PinholeCamera, posts: Sequence[tuple[int, Strip]]) -> EdgeSamples:
    """Take rough samples of posts' edges and feet from the strips they were found as (0 the left post, 1 the right)."""
    edge, uv, feet = [], [], []
    for post, strip in posts:
        for v in np.linspace(strip.top + 0.3 * (strip.bottom - strip.top), strip.bottom, 5):
            edge += [2 * post, 2 * post + 1]
            uv += [(u, v) for u in strip.edges_at(v)]
        if math.isfinite(strip.foot):
            feet.append((post, strip.axis_at(strip.foot), strip.foot))
    return EdgeSamples(
        np.array(edge),
        to_ideal(camera, np.array(uv, dtype=np.float64)),
        np.array([foot[0] for foot in feet], dtype=np.int64),
        np.full(len(feet), len(FOOT_OFFSETS) // 2, dtype=np.int64),
        to_ideal(camera, np.array([foot[1:] for foot in feet], dtype=np.float64).reshape(-1, 2)),
        np.tile([0.0, 1.0], (len(feet), 1)),
        np.array([1.0] * len(edge) + [1.5] * len(feet)),
        np.full(EDGES, 5),
    )


def starts(model: GoalModel, left: Strip, right: Strip) -> Iterator[FloatArray]:
    """Cameras that see both posts where they are: placed by the posts' own widths, and obliquely left and right.

    The last two are the branches that a plane's picture always allows.
    """
    fu, fv = model.view.focal_px
    cu, cv = model.view.center_px
    low_left, low_right = (s.foot if math.isfinite(s.foot) else s.bottom for s in (left, right))
    a, b = left.axis_at(low_left), right.axis_at(low_right)
    half, line = model.shape.width_m / 2, model.shape.line_x_m
    near_left = 2 * model.shape.radius_m * fu / max(left.width_at(left.bottom), 1.0)
    near_right = 2 * model.shape.radius_m * fu / max(right.width_at(right.bottom), 1.0)
    aside = float(np.clip((near_right**2 - near_left**2) / (4 * half), -near_left - half, near_left + half))
    ahead = math.sqrt(max(near_left**2 - (half - aside) ** 2, 0.04))
    places = [(line - ahead, aside)]
    for beta in (-0.6, 0.6):
        distance = 2 * half * math.cos(beta) * fu / max(b - a, 1.0)
        places.append((line - distance * math.cos(beta), distance * math.sin(beta)))
    for x, y in places:
        p = model.prior.copy()
        p[X], p[Y] = x, y
        # the axis points where both posts' bearings lie best about it
        p[HEADING] = (
            math.atan2(half - y, line - x)
            + math.atan2(-half - y, line - x)
            + math.atan((a - cu) / fu)
            + math.atan((b - cu) / fu)
        ) / 2
        distance = math.hypot(line - x, y)
        p[TILT] = -math.atan(p[HEIGHT] / distance) + math.atan(((low_left + low_right) / 2 - cv) / fv)
        yield p


def fit(
    model: GoalModel, samples: EdgeSamples, start: FloatArray, scales: FloatArray
) -> tuple[FloatArray, float, FloatArray]:
    """Fit the unknowns to samples; returns them, the robust cost (infinite: failed) and the information matrix."""
    p, information = start.copy(), np.zeros((UNKNOWNS, UNKNOWNS))
    cost = fit_goal(
        model.shape_array,
        model.view_array,
        p,
        model.prior,
        model.weight,
        FOOT_OFFSETS,
        samples.edge,
        samples.uv,
        samples.foot_post,
        samples.foot_at,
        samples.foot_uv,
        samples.foot_direction,
        samples.mark_m,
        samples.mark_uv,
        samples.mark_direction,
        samples.sigma,
        scales,
        information,
    )
    return p, float(cost), information


def covariance_of(model: GoalModel, information: FloatArray) -> FloatArray:
    """Invert an information matrix (8, 8); what the model holds fast has no variance."""
    covariance = np.asarray(np.linalg.inv(information), np.float64)
    held = np.isinf(model.weight)
    covariance[held] = 0.0
    covariance[:, held] = 0.0
    return covariance


def swung(model: GoalModel, unknowns: FloatArray, share: float = -1.0) -> FloatArray:
    """Another camera that sees nearly the same picture: as far from the goal's middle, `share` times as oblique.

    -1 is the mirror branch that the picture of a plane always allows.
    """
    p = unknowns.copy()
    ahead = model.shape.line_x_m - p[X]
    aside = math.atan2(p[Y], ahead)
    distance = math.hypot(ahead, p[Y])
    p[X] = model.shape.line_x_m - distance * math.cos(share * aside)
    p[Y] = distance * math.sin(share * aside)
    p[HEADING] += aside - share * aside
    return p


def with_bar(samples: EdgeSamples, bar_px: FloatArray) -> EdgeSamples:
    """Rough samples with points (K, 2) on the bar's upper edge, ideal pixels, added."""
    n, k = len(samples.edge), len(bar_px)
    return replace(
        samples,
        edge=np.append(samples.edge, np.full(k, BAR_TOP)),
        uv=np.vstack([samples.uv, bar_px]),
        sigma=np.insert(samples.sigma, n, np.ones(k)),
    )


def weigh(samples: EdgeSamples) -> EdgeSamples:
    """Let the samples' noise include what their edge as a whole may be off."""
    per_edge = np.bincount(samples.edge, minlength=EDGES)[samples.edge]
    per_foot = np.bincount(samples.foot_post, minlength=2)[samples.foot_post]
    shared = np.concatenate([_EDGE_ERROR_PX**2 * per_edge, _FOOT_ERROR_PX**2 * per_foot])
    sigma = np.sqrt(samples.sigma**2 + _SAMPLE_ERROR_PX**2 + shared)
    return replace(samples, sigma=sigma)


def without(samples: EdgeSamples, edge: int) -> EdgeSamples:
    """Drop the samples of one edge."""
    keep = samples.edge != edge
    both = np.concatenate([keep, np.ones(len(samples.foot_post), bool)])
    return replace(
        samples, edge=samples.edge[keep], uv=np.ascontiguousarray(samples.uv[keep]), sigma=samples.sigma[both]
    )


def refine(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    start: FloatArray,
    look: Look,
    first_reach_px: float = 3.0,
) -> GoalFit | None:
    """Measure edges around a start and fit them, ever closer; None where the goal is lost.

    The bar's lower edge waits until the rest holds: the net's own bar runs close below it.
    """
    p, information = start, np.zeros((UNKNOWNS, UNKNOWNS))
    samples, residual = None, np.empty(0)
    for reach, scales in (
        (first_reach_px, np.array([3.0, 2.0, 1.0])),
        (_SECOND_REACH_PX, np.array([1.0, 1.0, 1.0])),
        (1.5, np.array([1.0, 1.0])),
    ):
        if reach == _SECOND_REACH_PX and np.count_nonzero(np.abs(residual) < INLIER_PX) > _PLAIN_SHARE * len(residual):
            continue  # near enough for the last one
        measured = measure(image, camera, model.view, model.shape, p, reach, look)
        if measured is None or len(measured.edge) < 12:
            return None
        samples = weigh(measured)
        used = without(samples, BAR_BOTTOM) if reach > _SECOND_REACH_PX else samples
        p, cost, information = fit(model, used, p, scales)
        if not math.isfinite(cost):
            return None
        residual = residuals(model, used, p)
    assert samples is not None
    residual = residuals(model, samples, p)
    inlier = np.abs(residual[: len(samples.edge)]) < INLIER_PX
    share = np.bincount(samples.edge[inlier], minlength=EDGES) / np.maximum(samples.expected, 4)
    share = _looked_again(image, camera, model, p, look, share)
    # what an edge is off as a whole grows with what its samples scatter: blur, compression and glare do both
    scatter = float(np.mean(residual[: len(samples.edge)][inlier] ** 2)) if inlier.any() else 0.0
    return GoalFit(p, information / max(1.0, scatter / _EDGE_ERROR_PX**2), samples, residual, share)


def _looked_again(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    p: FloatArray,
    look: Look,
    share: FloatArray,
) -> FloatArray:
    """Shares (6,) in which a post's weak edges count by any step of colour or light that lies exactly there.

    Paint washed white, or before something of its own hue, has edges of another kind. They are too often somebody
    else's to be fitted to; but where all other edges say that a post stands there, they tell that it does.
    """
    weak = share < LEAST_ELEMENT_SHARE
    weak[BAR_TOP:] = False
    if not weak.any() or weak.sum() > 2 or share[~weak].min() < LEAST_OTHER_SHARE:
        return share
    grey = np.full(3, 3**-0.5)
    again = share
    for towards in (grey, -grey, -look.towards):
        samples = measure(image, camera, model.view, model.shape, p, INLIER_PX, Look(towards, math.inf, 1.0))
        if samples is not None:
            seen = np.bincount(samples.edge, minlength=EDGES) / np.maximum(samples.expected, 4)
            again = np.where(weak & (seen >= LEAST_OTHER_SHARE), np.maximum(again, seen), again)
    return again


def residuals(model: GoalModel, samples: EdgeSamples, unknowns: FloatArray) -> FloatArray:
    """Signed residuals (N + M + L,), pixels."""
    residual = np.empty(len(samples.edge) + len(samples.foot_post) + len(samples.mark_m))
    goal_residuals(
        model.shape_array,
        model.view_array,
        unknowns,
        FOOT_OFFSETS,
        samples.edge,
        samples.uv,
        samples.foot_post,
        samples.foot_at,
        samples.foot_uv,
        samples.foot_direction,
        samples.mark_m,
        samples.mark_uv,
        samples.mark_direction,
        residual,
    )
    return residual


def bar_rows(
    paint: npt.NDArray[np.uint8], scale: float, model: GoalModel, p: FloatArray, most: int
) -> list[FloatArray]:
    """Where the bar's upper edge may be, best first: points (5, 2), ideal pixels, on the line between the posts.

    Parameters
    ----------
    paint : (h, w) uint8
        Bright where paint is.
    scale : float
        Frame pixels per pixel of `paint`.
    model : GoalModel
        Camera and goal.
    p : (8,) float64
        Unknowns from the posts alone.
    most : int
        How many to return.
    """
    foot_left, top_left, top_right, foot_right = project(model.view, p, model.shape.corners)
    up_left, up_right = top_left - foot_left, top_right - foot_right
    height = min(float(np.hypot(*up_left)), float(np.hypot(*up_right)))
    if not (math.isfinite(height) and height > 4):
        return []
    thick = height * 2 * model.shape.radius_m / model.shape.height_m
    step = min(0.25 * thick, 1.0) / height
    rise = np.arange(0.6, 1.45, step)
    start = foot_left + rise[:, None] * up_left
    end = foot_right + rise[:, None] * up_right
    mean = np.empty(len(rise))
    mean_along(paint, (start + 0.5) / scale - 0.5, (end + 0.5) / scale - 0.5, mean)
    half = max(1, round(0.5 * thick / height / step))
    # brighter than what is above it; below it the net's bar may follow
    sums = np.concatenate([[0.0], np.cumsum(mean)])
    response = np.full(len(mean), -np.inf)
    at = np.arange(half, len(mean) - 3 * half)
    if len(at) == 0:
        return []
    response[at] = (sums[at + half] - sums[at - half]) / (2 * half) - (sums[at + 3 * half] - sums[at + half]) / (
        2 * half
    )
    found = []
    for _ in range(most):
        best = int(np.argmax(response))
        if not response[best] > 6.0:
            break
        k = min(best + half, len(rise) - 1)
        found.append(start[k] + (end[k] - start[k]) * np.linspace(0.05, 0.95, 5)[:, None])
        response[max(0, best - half) : best + half + 1] = -np.inf
    return found
