"""From rough posts to a camera: starts from both obliquenesses, then the direct fit to silhouette edges.

The measurement decides, not the solver: five unknowns (and, under priors, height, focal length and bloom) are fitted by
Gauss-Newton to sub-pixel edges of posts, bar and feet (see kernels.goal_fit.fit_goal).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.fit import fit_goal, goal_residuals
from robocup_vision.localization.goal.edges import FOOT_OFFSETS, EdgeSamples, Look, measure
from robocup_vision.localization.goal.geometry import (
    BAR_BOTTOM,
    BAR_TOP,
    BLOOM,
    EDGES,
    HEIGHT,
    LOG_FOCAL,
    ROLL,
    TILT,
    UNKNOWNS,
    GoalShape,
    IdealView,
)

INLIER_PX = 0.5
# feet alone tell the two branches apart, and are few
FOOT_WORTH = 3.0
# shares of an element's edges, and of all, that must be in place
MIN_ELEMENT_SHARE = 0.45
MIN_EDGE_SHARE = 0.2  # a post has two edges
MIN_OTHER_SHARE = 0.6  # of the other five edges, where one post edge is missing
MIN_SCORE = 0.5
MAX_STRAIN = 3.5  # standard deviations that a prior may be off
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
    shape_array, view_array : (4,) float64
        Goal and camera as the kernels take them.
    tightness : (8,) float64
        Inverse standard deviations of the priors, 0 where there is none or the unknown is held.
    """

    shape: GoalShape
    view: IdealView
    prior: FloatArray
    weight: FloatArray

    shape_array: FloatArray = field(init=False)
    view_array: FloatArray = field(init=False)
    tightness: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        s = self.shape
        object.__setattr__(self, "shape_array", np.array([s.line_x_m, s.width_m, s.height_m, s.radius_m]))
        object.__setattr__(self, "view_array", np.array([*self.view.focal_px, *self.view.center_px]))
        object.__setattr__(self, "tightness", np.sqrt(np.where(np.isinf(self.weight), 0.0, self.weight)))


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

    @cached_property
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
    bare = np.flatnonzero(share[:BAR_TOP] < MIN_EDGE_SHARE)
    if len(bare) == 1 and standing.all() and np.delete(share, bare).min() >= MIN_OTHER_SHARE:
        # something of the goal's own hue right behind it may hide one edge: all the others speak for it
        share[bare] = share[bare ^ 1]
    shares = element_shares(share)
    if min(shares) < MIN_ELEMENT_SHARE or found.score < MIN_SCORE or min(share[:BAR_TOP]) < MIN_EDGE_SHARE:
        weakest = ("left post", "right post", "bar")[int(np.argmin(shares))]
        return f"only {min(shares):.0%} of the {weakest}'s edges are where they should be"
    if np.any(np.abs(found.unknowns[:2]) > extent_m):
        x, y = found.unknowns[:2]
        return f"what looks like one would put the camera off the pitch, at x = {x:.1f}, y = {y:.1f} m"
    strain = _strains(model, found.unknowns)
    if float(strain.max()) > MAX_STRAIN:
        what = ("x", "y", "heading", "tilt", "roll", "height", "focal length", "bleeding")[int(np.argmax(strain))]
        return f"what looks like one would need a camera {what} that is {strain.max():.0f} standard deviations off"
    if not standing.any():
        return "what looks like one does not stand on the carpet"
    return None


def _strains(model: GoalModel, unknowns: FloatArray) -> FloatArray:
    return np.asarray(np.abs(unknowns - model.prior) * model.tightness)


def strain_of(model: GoalModel, unknowns: FloatArray) -> float:
    """How far the prior that suffers most is off, standard deviations."""
    return float(_strains(model, unknowns).max())


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


def without_element(samples: EdgeSamples, element: int) -> EdgeSamples:
    """Drop the edges and the foot of the left post (0) or the right one (1), or the bar (2)."""
    kept, feet = samples.edge // 2 != element, samples.foot_post != element
    marks = np.ones(len(samples.mark_m), bool)
    return replace(
        samples,
        edge=samples.edge[kept],
        uv=np.ascontiguousarray(samples.uv[kept]),
        foot_post=samples.foot_post[feet],
        foot_at=samples.foot_at[feet],
        foot_uv=np.ascontiguousarray(samples.foot_uv[feet]),
        foot_direction=np.ascontiguousarray(samples.foot_direction[feet]),
        sigma=samples.sigma[np.concatenate([kept, feet, marks])],
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
    """Shares (6,) in which weak edges count by any step of colour or light that lies exactly there.

    Paint washed white, or before something of its own hue, has edges of another kind. They are too often somebody
    else's to be fitted to; but where half of the edges say that a goal stands there, they tell that it does.
    """
    weak = share < MIN_ELEMENT_SHARE
    weak[BAR_TOP] = False
    # the bar's lower edge is the least of them: the net hangs there
    if not weak.any() or weak[:BAR_TOP].sum() > 2 or share[~weak].min() < MIN_OTHER_SHARE:
        return share
    grey = np.full(3, 3**-0.5)
    again = share
    for towards in (grey, -grey, -look.towards):
        samples = measure(image, camera, model.view, model.shape, p, INLIER_PX, Look(towards, math.inf, 1.0))
        if samples is not None:
            seen = np.bincount(samples.edge, minlength=EDGES) / np.maximum(samples.expected, 4)
            again = np.where(weak & (seen >= MIN_OTHER_SHARE), np.maximum(again, seen), again)
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
