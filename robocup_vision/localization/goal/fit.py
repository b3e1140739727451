"""From rough posts to a camera: starts from both obliquenesses, then the direct fit to silhouette edges.

The measurement decides, not the solver: five unknowns (and, under priors, height, focal length and bloom) are fitted by
Gauss-Newton to sub-pixel edges of posts, bar and feet (see kernels.goal.fit.fit_goal).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.goal.edge_samples import weigh_samples
from robocup_vision.kernels.goal.fit import (
    FitLoss,
    FitPriors,
    FitSamples,
    NormalSystem,
    fit_goal,
    goal_residuals,
    normal_equations,
)
from robocup_vision.kernels.goal.lines.arc import invert_information
from robocup_vision.kernels.goal.picture import GoalScene
from robocup_vision.localization.goal.edges import (
    FOOT_OFFSETS,
    EdgeAppearance,
    EdgeSamples,
    EdgeSampleSettings,
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


@dataclass(frozen=True, slots=True)
class GoalFitSettings:
    """Settings of the fit of a camera to one goal, and of the check whether it is one.

    Parameters
    ----------
    inlier_px : float
        An edge sample nearer than this to the fit's edge agrees with it; a foot sample within twice that.
    foot_worth : float
        What a foot sample counts beside an edge sample: feet alone separate the two branches of a plane's picture,
        and are few.
    min_element_ratio, min_edge_ratio : float
        Inliers among the expected samples that each post and the bar, and each edge of a post, must have.
    min_other_ratio : float
        The same for the other five edges where one edge of a post is missing.
    min_score : float
        Lowest score of a goal.
    max_deviation : float
        Standard deviations that a prior may be off.
    edge_error_px, foot_error_px : float
        What an edge or a foot as a whole may be off, however many samples it has: paint, shading, posts that are no
        perfect cylinders.
    sample_error_px : float
        Noise of one sample beside its measured one.
    upright_std_rad : float
        Roll of a camera whose file does not state it: robots hold it roughly upright.
    known_angle_std_rad : float
        Tilt and roll of a camera whose file states them.
    reaches_px : (float, float)
        Length of the search for edges in the second and the last round; the first one is an argument of `refine`.
    near_ratio : float
        Inliers after the first round from which the second is left out.
    bloom_std_white_px, bloom_std_hue_px : float
        How far paint bleeds over its edge: the white of a goal in the sun by a pixel, paint of a hue hardly.
    edges : EdgeSampleSettings
        Where edges are sampled.
    """

    inlier_px: float = 0.5
    foot_worth: float = 3.0
    min_element_ratio: float = 0.45
    min_edge_ratio: float = 0.2
    min_other_ratio: float = 0.6
    min_score: float = 0.5
    max_deviation: float = 3.5
    edge_error_px: float = 0.075
    foot_error_px: float = 0.25
    sample_error_px: float = 0.05
    upright_std_rad: float = 0.1
    known_angle_std_rad: float = 0.01
    reaches_px: tuple[float, float] = (2.0, 1.5)
    near_ratio: float = 0.95
    bloom_std_white_px: float = 0.7
    bloom_std_hue_px: float = 0.15
    edges: EdgeSampleSettings = EdgeSampleSettings()


@dataclass(frozen=True, slots=True)
class GoalModel:
    """Goal, camera and priors in the form the kernels take them.

    Parameters
    ----------
    shape, view : GoalShape, IdealView
        The goal at +x, and the camera without distortion.
    prior, weight : (8,) float64
        Expected unknowns, and their inverse variances.
    settings : GoalFitSettings, optional
        Of the fit.
    scene, priors : GoalScene, FitPriors
        Goal and camera, and priors, as the kernels take them.
    tightness : (8,) float64
        Inverse standard deviations of the priors, 0 where there is none or the unknown is fixed.
    """

    shape: GoalShape
    view: IdealView
    prior: FloatArray
    weight: FloatArray
    settings: GoalFitSettings = GoalFitSettings()

    scene: GoalScene = field(init=False)
    priors: FitPriors = field(init=False)
    tightness: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "scene", goal_scene(self.shape, self.view))
        object.__setattr__(self, "priors", FitPriors(self.prior, self.weight))
        object.__setattr__(self, "tightness", np.sqrt(np.where(np.isinf(self.weight), 0.0, self.weight)))


def goal_model(
    shape: GoalShape, camera: PinholeCamera, bloom_std_px: float, settings: GoalFitSettings = GoalFitSettings()
) -> GoalModel:
    """Priors as the camera file gives them: height, focal length, and tilt and roll where they are known."""
    prior = np.zeros(UNKNOWNS)
    std = np.full(UNKNOWNS, np.inf)
    prior[HEIGHT], std[HEIGHT] = camera.height_m, camera.height_std_m
    std[LOG_FOCAL] = camera.focal_std_px / camera.focal_px[0]
    std[BLOOM] = bloom_std_px
    known = camera.roll_std_rad if camera.roll_std_rad is not None else settings.known_angle_std_rad
    if camera.tilt_rad is not None:
        prior[TILT], std[TILT] = camera.tilt_rad, known
    if camera.roll_rad is not None:
        prior[ROLL], std[ROLL] = camera.roll_rad, known
    else:
        std[ROLL] = camera.roll_std_rad if camera.roll_std_rad is not None else settings.upright_std_rad
    with np.errstate(divide="ignore"):
        weight = np.where(np.isinf(std), 0.0, 1.0 / np.maximum(std, 0.0) ** 2)
    return GoalModel(shape, IdealView(camera.focal_px, camera.center_px), prior, weight, settings)


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
    edge_ratio : (6,) float64
        Inliers among the expected samples of each silhouette edge.
    settings : GoalFitSettings
        Of the fit.
    """

    unknowns: FloatArray
    information: FloatArray
    samples: EdgeSamples
    residual_px: FloatArray
    edge_ratio: FloatArray
    settings: GoalFitSettings

    @cached_property
    def score(self) -> float:
        """How well the goal agrees with the fit, 0 to 1, at an absolute scale.

        A scale that adapted to the residuals would take the mirror branch, whose edges lie half a pixel off, for a
        noisy picture of the right one.
        """
        return agreement(self.samples, self.residual_px, self.settings)

    @property
    def element_ratios(self) -> tuple[float, float, float]:
        """Inlier ratios of the left post, the right post and the bar."""
        return element_ratios(self.edge_ratio)


def agreement(samples: EdgeSamples, residual_px: FloatArray, settings: GoalFitSettings) -> float:
    """Score of a fit with these residuals (N + M,), see `GoalFit.score`."""
    n, limit, worth = len(samples.edge), settings.inlier_px, settings.foot_worth
    score = np.maximum(0.0, 1.0 - (residual_px / limit) ** 2)
    score[n:] = worth * np.maximum(0.0, 1.0 - (residual_px[n:] / (2 * limit)) ** 2)
    # a foot may be hidden: its absence does not count against the goal as its presence counts for it
    return float(score.sum() / (int(samples.expected.sum()) + worth * max(len(score) - n, len(FOOT_OFFSETS))))


def are_mostly_within(residual_px: FloatArray, limit_px: float) -> bool:
    """Whether their median is within the limit."""
    return bool(2 * np.count_nonzero(np.abs(residual_px) < limit_px) > len(residual_px))


def element_ratios(ratio: FloatArray) -> tuple[float, float, float]:
    """Inlier ratios of the left post, the right post and the bar from those of the six edges."""
    left, right, bar = ratio[:2].mean(), ratio[2:4].mean(), max(ratio[BAR_TOP], ratio[BAR_TOP:].mean())
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
    settings = model.settings
    feet = np.abs(found.residual_px[len(found.samples.edge) :]) < 2 * settings.inlier_px
    standing = np.bincount(found.samples.foot_post[feet], minlength=2) >= 2
    ratio = found.edge_ratio.copy()
    bare = np.flatnonzero(ratio[:BAR_TOP] < settings.min_edge_ratio)
    if len(bare) == 1 and standing.all() and np.delete(ratio, bare).min() >= settings.min_other_ratio:
        # something of the goal's own hue right behind it may hide one edge: all the others confirm the goal
        ratio[bare] = ratio[bare ^ 1]
    ratios = element_ratios(ratio)
    if (
        min(ratios) < settings.min_element_ratio
        or found.score < settings.min_score
        or min(ratio[:BAR_TOP]) < settings.min_edge_ratio
    ):
        weakest = ("left post", "right post", "bar")[int(np.argmin(ratios))]
        return f"only {min(ratios):.0%} of the {weakest}'s edges are where they should be"
    if np.any(np.abs(found.unknowns[:2]) > extent_m):
        x, y = found.unknowns[:2]
        return f"what looks like one would put the camera off the pitch, at x = {x:.1f}, y = {y:.1f} m"
    deviation = _prior_deviations(model, found.unknowns)
    if float(deviation.max()) > settings.max_deviation:
        what = ("x", "y", "heading", "tilt", "roll", "height", "focal length", "bloom")[int(np.argmax(deviation))]
        return f"what looks like one would need a camera {what} that is {deviation.max():.0f} standard deviations off"
    if not standing.any():
        return "what looks like one does not stand on the carpet"
    return None


def _prior_deviations(model: GoalModel, unknowns: FloatArray) -> FloatArray:
    return np.asarray(np.abs(unknowns - model.prior) * model.tightness)


def max_prior_deviation(model: GoalModel, unknowns: FloatArray) -> float:
    """How far the unknown that deviates most from its prior is off, standard deviations."""
    return float(_prior_deviations(model, unknowns).max())


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
    cost = fit_goal(model.scene, samples, model.priors, FitLoss(scales, scales, False), p, information)
    return p, float(cost), information


def system_at(model: GoalModel, samples: EdgeSamples, p: FloatArray, loss: FitLoss) -> tuple[FloatArray, FloatArray]:
    """Information (8, 8) and negative gradient (8,) of samples and priors at unknowns (8,), by the last loss."""
    information, right = np.empty((UNKNOWNS, UNKNOWNS)), np.empty(UNKNOWNS)
    last = len(loss.goal_px) - 1
    residual = residuals(model, samples, p)
    system = NormalSystem(information, right)
    normal_equations(model.scene, samples.for_fit, model.priors, loss, last, p, residual, system)
    return information, right


def covariance_of(model: GoalModel, information: FloatArray) -> FloatArray:
    """Invert an information matrix (8, 8); fixed unknowns have no variance."""
    covariance = np.empty((UNKNOWNS, UNKNOWNS))
    if not invert_information(information, model.weight, covariance):
        # rounding may leave one that is hardly definite indefinite
        fixed = np.isinf(model.weight)
        covariance = np.where(fixed | fixed[:, None], 0.0, np.linalg.inv(information))
    return covariance


def weigh(samples: EdgeSamples, settings: GoalFitSettings = GoalFitSettings()) -> EdgeSamples:
    """Let the samples' noise include what their edge as a whole may be off."""
    errors = (settings.sample_error_px, settings.edge_error_px, settings.foot_error_px)
    sigma = np.empty(len(samples.sigma))
    weigh_samples(samples.edge, samples.foot_post, samples.sigma, errors, sigma)
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
    appearance: EdgeAppearance,
    first_reach_px: float = 3.0,
) -> GoalFit | None:
    """Measure edges around a start and fit them, ever closer; None where the goal is lost.

    The bar's lower edge waits until the rest holds: the net's own bar runs close below it.
    """
    settings = model.settings
    second_px, last_px = settings.reaches_px
    p, information = start, np.zeros((UNKNOWNS, UNKNOWNS))
    samples, residual = None, np.empty(0)
    for reach, scales in (
        (first_reach_px, np.array([3.0, 2.0, 1.0])),
        (second_px, np.array([1.0, 1.0, 1.0])),
        (last_px, np.array([1.0, 1.0])),
    ):
        near = np.count_nonzero(np.abs(residual) < settings.inlier_px)
        if reach == second_px and near > settings.near_ratio * len(residual):
            continue  # near enough for the last one
        measured = measure(image, camera, model.view, model.shape, p, reach, appearance, settings.edges)
        if measured is None or len(measured.edge) < 12:
            return None
        samples = weigh(measured, settings)
        used = without(samples, BAR_BOTTOM) if reach > second_px else samples
        p, cost, information = fit(model, used, p, scales)
        if not math.isfinite(cost):
            return None
        residual = residuals(model, used, p)
    assert samples is not None
    residual = residuals(model, samples, p)
    inlier = np.abs(residual[: len(samples.edge)]) < settings.inlier_px
    ratio = np.bincount(samples.edge[inlier], minlength=EDGES) / np.maximum(samples.expected, 4)
    ratio = _confirmed_edges(image, camera, model, p, appearance, ratio)
    # an edge's common error grows with its samples' scatter: blur, compression and glare cause both
    scatter = float(np.mean(residual[: len(samples.edge)][inlier] ** 2)) if inlier.any() else 0.0
    information = information / max(1.0, scatter / settings.edge_error_px**2)
    return GoalFit(p, information, samples, residual, ratio, settings)


def _confirmed_edges(
    image: npt.NDArray[np.uint8],
    camera: PinholeCamera,
    model: GoalModel,
    p: FloatArray,
    appearance: EdgeAppearance,
    ratio: FloatArray,
) -> FloatArray:
    """Inlier ratios (6,) in which weak edges count by any step of colour or light that lies exactly there.

    Paint washed white, or before something of its own hue, has edges of another kind. They are too often somebody
    else's to be fitted to; but where half of the edges agree with a goal, they confirm it.
    """
    settings = model.settings
    weak = ratio < settings.min_element_ratio
    weak[BAR_TOP] = False
    # the bar's lower edge is the least of them: the net hangs there
    if not weak.any() or weak[:BAR_TOP].sum() > 2 or ratio[~weak].min() < settings.min_other_ratio:
        return ratio
    grey = np.full(3, 3**-0.5)
    again = ratio
    for towards in (grey, -grey, -appearance.towards):
        grey_edge = EdgeAppearance(towards, math.inf, 1.0)
        samples = measure(image, camera, model.view, model.shape, p, settings.inlier_px, grey_edge, settings.edges)
        if samples is not None:
            seen = np.bincount(samples.edge, minlength=EDGES) / np.maximum(samples.expected, 4)
            again = np.where(weak & (seen >= settings.min_other_ratio), np.maximum(again, seen), again)
    return again


def residuals(model: GoalModel, samples: EdgeSamples, unknowns: FloatArray) -> FloatArray:
    """Signed residuals (N + M + L,), pixels."""
    return sample_residuals(model, samples.for_fit, unknowns)


def sample_residuals(model: GoalModel, samples: FitSamples, unknowns: FloatArray) -> FloatArray:
    """Signed residuals (N + M + L,), pixels, of samples as the kernels take them."""
    residual = np.empty(len(samples.sigma))
    goal_residuals(model.scene, samples, unknowns, residual)
    return residual
