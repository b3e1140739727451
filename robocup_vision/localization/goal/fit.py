"""Fits a camera directly to the silhouette edges of a goal, from a rough start.

The measurement decides, not the solver: five unknowns (and, under priors, height, focal length and bloom) are fitted by
Gauss-Newton to sub-pixel edges of posts, bar and feet (see kernels.goal.fit.fit_goal).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import BoolArray, FloatArray
from robocup_vision.camera.pinhole import UPRIGHT_STD_RAD, PinholeCamera
from robocup_vision.kernels.goal.edge_samples import weigh_samples
from robocup_vision.kernels.goal.fit import (
    FitPriors,
    FitSamples,
    fit_goal,
    goal_residuals,
)
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.localization.goal.edges import (
    FOOT_OFFSETS,
    EdgeAppearance,
    EdgeSamples,
    goal_scene,
    measure,
)
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

_FIRST_EDGES, _BOTH_POSTS = np.arange(EDGES) != BAR_BOTTOM, np.ones(2, bool)
# an edge sample nearer than this to the fit's edge agrees with it; a foot sample within twice that
INLIER_PX = 0.5
# weight of a foot sample beside an edge sample: feet alone separate the two branches of a plane's picture, and are
# few
_FOOT_WEIGHT = 3.0
# common error of a whole edge or foot, however many samples it has: paint, shading, posts that are no perfect
# cylinders
_EDGE_ERROR_PX = 0.075
_FOOT_ERROR_PX = 0.25
_SAMPLE_ERROR_PX = 0.05  # noise of one sample in addition to the measured one
# length of the search for edges in the second and the last round; the first one is an argument of `refine`
_REACHES_PX = (2.0, 1.5)
# how far paint bleeds over its edge: the white of a goal in the sun by a pixel, paint of a hue hardly
BLOOM_STD_WHITE_PX = 0.7
BLOOM_STD_HUE_PX = 0.15


@dataclass(frozen=True, slots=True)
class GoalModel:
    """Goal, camera and priors in the form the kernels take them."""

    #: the goal at +x, and the camera without distortion
    shape: GoalShape
    view: IdealView
    #: (8,) float64: expected unknowns, and their inverse variances
    prior: FloatArray
    weight: FloatArray

    scene: GoalScene = field(init=False)
    priors: FitPriors = field(init=False)
    #: (8,) float64: inverse standard deviations of the priors, 0 where there is none or the unknown is fixed
    tightness: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scene", goal_scene(self.shape, self.view))
        object.__setattr__(self, "priors", FitPriors(self.prior, self.weight))
        object.__setattr__(self, "tightness", np.sqrt(np.where(np.isinf(self.weight), 0.0, self.weight)))


def goal_model(shape: GoalShape, camera: PinholeCamera, bloom_std_px: float) -> GoalModel:
    """Priors as the camera file gives them: height, focal length, and tilt and roll where they are known."""
    prior = np.zeros(UNKNOWNS)
    std = np.full(UNKNOWNS, np.inf)
    prior[HEIGHT], std[HEIGHT] = camera.height_m, camera.height_std_m
    std[LOG_FOCAL] = camera.focal_std_px / camera.focal_px[0]
    std[BLOOM] = bloom_std_px
    tilt_std_rad, roll_std_rad = camera.sway_std_rad
    if camera.tilt_rad is not None:
        prior[TILT], std[TILT] = camera.tilt_rad, tilt_std_rad
    if camera.roll_rad is not None:
        prior[ROLL], std[ROLL] = camera.roll_rad, roll_std_rad
    else:
        std[ROLL] = UPRIGHT_STD_RAD if camera.roll_std_rad is None else camera.roll_std_rad
    with np.errstate(divide="ignore"):
        weight = np.where(np.isinf(std), 0.0, 1.0 / np.maximum(std, 0.0) ** 2)
    return GoalModel(shape, IdealView(camera.focal_px, camera.center_px), prior, weight)


@dataclass(frozen=True, eq=False)
class GoalFit:
    """A goal found and fitted, for the goal at +x."""

    unknowns: FloatArray  #: (8,) float64: in the order of goal/geometry.py
    information: FloatArray  #: (8, 8) float64: inverse covariance of the unknowns, priors included
    samples: EdgeSamples  #: what was measured last
    residual_px: FloatArray  #: (N + M,) float64: of its edge samples and foot samples
    edge_ratio: FloatArray  #: (6,) float64: inliers among the expected samples of each silhouette edge

    @property
    def score(self) -> float:
        """How well the goal agrees with the fit, 0 to 1, at an absolute scale.

        A scale that adapted to the residuals would take the mirror branch, whose edges lie half a pixel off, for a
        noisy picture of the right one.
        """
        return agreement(self.samples, self.residual_px)

    @property
    def element_ratios(self) -> tuple[float, float, float]:
        """Inlier ratios of the left post, the right post and the bar."""
        ratio = self.edge_ratio
        left, right, bar = ratio[:2].mean(), ratio[2:4].mean(), max(ratio[BAR_TOP], ratio[BAR_TOP:].mean())
        return float(left), float(right), float(bar)


def agreement(samples: EdgeSamples, residual_px: FloatArray) -> float:
    """Score of a fit with these residuals (N + M,), see `GoalFit.score`."""
    n, limit, weight = len(samples.edge), INLIER_PX, _FOOT_WEIGHT
    score = np.maximum(0.0, 1.0 - (residual_px / limit) ** 2)
    score[n:] = weight * np.maximum(0.0, 1.0 - (residual_px[n:] / (2 * limit)) ** 2)
    # a foot may be hidden: its absence counts less against the goal than its presence for it
    return float(score.sum() / (int(samples.expected.sum()) + weight * max(len(score) - n, len(FOOT_OFFSETS))))


def fit(
    model: GoalModel, samples: EdgeSamples, start: FloatArray, scales: FloatArray
) -> tuple[FloatArray, float, FloatArray]:
    """Fit the unknowns to samples; returns them, the robust cost (infinite: failed) and the information matrix."""
    return fit_samples(model, samples.for_fit, start, scales)


def fit_samples(
    model: GoalModel, samples: FitSamples, start: FloatArray, scales: FloatArray
) -> tuple[FloatArray, float, FloatArray]:
    """Fit the unknowns as `fit` does to samples as the kernels take them."""
    p, information = start.copy(), np.zeros((UNKNOWNS, UNKNOWNS))
    cost = fit_goal(model.scene, samples, model.priors, scales, p, information)
    return p, float(cost), information


def covariance_of(model: GoalModel, information: FloatArray) -> FloatArray:
    """Invert an information matrix (8, 8); fixed unknowns have no variance."""
    fixed = np.isinf(model.weight)
    return np.where(fixed | fixed[:, None], 0.0, np.linalg.inv(information))


def weigh(samples: EdgeSamples) -> EdgeSamples:
    """Add the common error of each whole edge and foot to the samples' noise."""
    errors = (_SAMPLE_ERROR_PX, _EDGE_ERROR_PX, _FOOT_ERROR_PX)
    sigma = np.empty(len(samples.sigma))
    weigh_samples(samples.edge, samples.foot_post, samples.sigma, errors, sigma)
    return replace(samples, sigma=sigma)


def only(samples: EdgeSamples, edges: BoolArray, posts: BoolArray) -> EdgeSamples:
    """Keep the samples of some of the edges (6,), and the feet of some of the posts (2,)."""
    kept, standing = edges[samples.edge], posts[samples.foot_post]
    return replace(
        samples,
        edge=samples.edge[kept],
        uv=np.ascontiguousarray(samples.uv[kept]),
        foot_post=samples.foot_post[standing],
        foot_at=samples.foot_at[standing],
        foot_uv=np.ascontiguousarray(samples.foot_uv[standing]),
        foot_direction=np.ascontiguousarray(samples.foot_direction[standing]),
        sigma=samples.sigma[np.concatenate([kept, standing])],
    )


def refine(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    start: FloatArray,
    appearance: EdgeAppearance,
    first_reach_px: float = 3.0,
) -> GoalFit | None:
    """Measure edges around a start and fit them, ever closer; None where the goal is lost.

    The bar's lower edge waits until the rest holds: the net's own bar runs close below it.
    """
    second_px, last_px = _REACHES_PX
    p, information = start, np.zeros((UNKNOWNS, UNKNOWNS))
    samples = None
    for reach, scales in (
        (first_reach_px, np.array([3.0, 2.0, 1.0])),
        (second_px, np.array([1.0, 1.0, 1.0])),
        (last_px, np.array([1.0, 1.0])),
    ):
        measured = measure(image, camera, model.view, model.shape, p, reach, appearance)
        if measured is None or len(measured.edge) < 12:
            return None
        samples = weigh(measured)
        used = only(samples, _FIRST_EDGES, _BOTH_POSTS) if reach > second_px else samples
        p, cost, information = fit(model, used, p, scales)
        if not math.isfinite(cost):
            return None
    assert samples is not None
    residual = residuals(model, samples, p)
    inlier = np.abs(residual[: len(samples.edge)]) < INLIER_PX
    ratio = np.bincount(samples.edge[inlier], minlength=EDGES) / np.maximum(samples.expected, 4)
    # an edge's common error grows with its samples' scatter: blur, compression and glare cause both
    scatter = float(np.mean(residual[: len(samples.edge)][inlier] ** 2)) if inlier.any() else 0.0
    information = information / max(1.0, scatter / _EDGE_ERROR_PX**2)
    return GoalFit(p, information, samples, residual, ratio)


def residuals(model: GoalModel, samples: EdgeSamples, unknowns: FloatArray) -> FloatArray:
    """Signed residuals (N + M,), pixels."""
    return sample_residuals(model, samples.for_fit, unknowns)


def sample_residuals(model: GoalModel, samples: FitSamples, unknowns: FloatArray) -> FloatArray:
    """Signed residuals (N + M + L,), pixels, of samples as the kernels take them."""
    residual = np.empty(len(samples.sigma))
    goal_residuals(model.scene, samples, unknowns, residual)
    return residual
