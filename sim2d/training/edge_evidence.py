"""Fits the weights of `robocup_vision.localization.model_edges.weights` to rendered pictures and ones without a field.

In each picture, poses are fitted near right and wrong priors, and searched without a prior. Each fit or search is one
choice: one of the poses found is right, or none. A conditional logit model is fitted to all choices, with the same
weights with and without a prior, except for a constant each and for one factor by which the weights count in a search.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from field_models import Field, load_field
from field_models.errors import ArgumentError
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.camera import PinholeCamera, Rig
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.verdict import log_odds
from robocup_vision.localization.model_edges.evidence import Evidence
from robocup_vision.localization.model_edges.finder import EdgeFinder
from robocup_vision.localization.model_edges.follower import EdgeFollower
from robocup_vision.localization.model_edges.weights import WEIGHTS, EdgeWeights
from sim2d.match.setups import CAMERAS
from sim2d.rendering.no_field import PAINTERS, no_field_picture
from sim2d.rendering.random_scenes import CONDITIONS, sample

# fields, cameras that robots carry on them, and widths of the pictures
SETUPS = (
    ("four_legged_2005", "ers7", 208),
    ("four_legged_2007", "ers7", 208),
    ("spl_2020", "nao", 208),
    ("spl_2020", "nao", 640),
    ("humanoid_kid_2025", "kid_head", 208),
    ("humanoid_kid_2025", "kid_fisheye", 400),
    ("msl_6x4", "msl_fisheyes", 200),
    ("msl_18x12", "msl_fisheyes", 400),
    ("ssl_2001", "ssl_forward", 320),
    ("ssl_division_b", "ssl_forward", 320),
)
MAX_ROBOTS, ROBOT_HEIGHT_RATIO, MAX_BOXES = 8, (0.6, 1.2), 3
# standard deviations of tilt and roll, and of the height, where the camera file has none
SWAY_STD_RAD, HEIGHT_STD_M = math.radians(1.2), 0.004
# standard deviations (x, y, theta) of narrow and wide right priors, and the number of each per picture
NEAR_STD, WIDE_STD = (0.05, 0.05, math.radians(2.0)), (0.3, 0.3, math.radians(10.0))
NEARS, WIDES = 2, 1
# number of wrong priors beside the true pose, range of their distance and std of their turn; number of priors anywhere
ASIDES, ASIDE_M, ASIDE_RAD, ANYWHERE = 4, (0.4, 1.5), math.radians(5.0), 2
# a fit with smaller errors is right
RIGHT_M, RIGHT_RAD = 0.1, math.radians(5.0)
# a fit whose errors are between those and this multiple of them is neither right nor wrong
WRONG_RATIO = 2.0
# ridge of the weights: without it, separable samples would give infinite weights
RIDGE = 1e-3
_STEPS, _MAX_STEP, _CONVERGED = 100, 1.0, 1e-6
# fraction of wrong fits whose log-odds exceed `sure_log_odds`
_SURE_RATE = 1e-3


class Choice(NamedTuple):
    """Poses found for one prior, or by one search, of which one or none is right."""

    #: (N, 10) float64: indicators of a fit near a prior and of a search, then the terms of `WEIGHTS`.
    terms: FloatArray
    is_right: BoolArray  #: (N,) bool


def setups() -> Iterator[tuple[Field, PinholeCamera]]:
    """Yield the fields and cameras of `SETUPS`."""
    for field_name, camera_name, width_px in SETUPS:
        made = CAMERAS[camera_name]()
        camera = made.cameras[0] if isinstance(made, Rig) else made
        assert isinstance(camera, PinholeCamera)
        # the camera is put at the robot's centre, with pictures of this width
        yield (
            load_field(field_name),
            dataclasses.replace(
                camera.in_size((width_px, round(width_px / camera.size_px[0] * camera.size_px[1]))),
                offset_m=(0.0, 0.0),
                pan_rad=0.0,
                roll_rad=camera.roll_rad or 0.0,
                roll_std_rad=camera.roll_std_rad or SWAY_STD_RAD,
                height_std_m=max(camera.height_std_m, HEIGHT_STD_M),
            ),
        )


def picture_count(count: int) -> int:
    """Return the total number of pictures: `count` of each setup, and as many without a field."""
    return 2 * count * len(SETUPS)


def set_names() -> list[str]:
    """Return the names of the sets of pictures."""
    rendered = [f"rendered: {field}, {camera}, {width_px} px" for field, camera, width_px in SETUPS]
    return rendered + [f"without a field: {name}" for name in PAINTERS]


def draw_choices(seed: int, count: int) -> Iterator[list[Choice]]:
    """Yield all choices so far after each picture; it is always the same, growing list."""
    choices: list[Choice] = []
    for index, (field, camera) in enumerate(setups()):
        looker = _Looker(field, camera, choices)
        for picture in range(count):
            rng = np.random.default_rng([seed, index, picture])
            frame, truth = _picture(field, camera, [seed, index], picture, rng)
            looker.look(frame, truth, rng)
            yield choices
        for picture in range(count):
            rng = np.random.default_rng([seed, index, count + picture])
            looker.look(no_field_picture(camera.size_px, picture, seed + index)[1], None, rng)
            yield choices


def _picture(
    field: Field, camera: PinholeCamera, seed: list[int], index: int, rng: np.random.Generator
) -> tuple[UInt8Array, Pose2]:
    """Render a picture under the conditions in turn, by a swaying camera; return it with the true pose."""
    condition = list(CONDITIONS.values())[index % len(CONDITIONS)]
    swaying = dataclasses.replace(
        condition,
        center_offset_px=(0.0, 0.0),
        tilt_rad=tuple(rng.normal(0.0, camera.roll_std_rad or 0.0, 2).tolist()),
        obstacles=(0, MAX_BOXES),
        ring=False,
        robots=int(rng.integers(MAX_ROBOTS + 1)),
        robot_height_m=float(rng.uniform(*ROBOT_HEIGHT_RATIO)) * camera.height_m,
    )
    (drawn,) = sample(field, camera, swaying, 1000 * seed[0] + seed[1], 1, indices=[index])
    return drawn.frame, drawn.pose


class _Looker:
    """Fits poses to pictures of one camera, and adds them to the choices."""

    def __init__(self, field: Field, camera: PinholeCamera, choices: list[Choice]) -> None:
        self._field, self._choices = field, choices
        self._follower = EdgeFollower(field, camera)
        self._finder = EdgeFinder(self._follower)

    def look(self, frame: UInt8Array, truth: Pose2 | None, rng: np.random.Generator) -> None:
        """Add the choices of a picture; `truth` None: it shows no field."""
        self._follower.forget_paint()
        half_m = np.array([self._field.length_m, self._field.width_m]) / 2
        for index in range(ANYWHERE):
            x, y, turn = (*(rng.uniform(-half_m, half_m)), rng.uniform(-math.pi, math.pi))
            self._fit(frame, truth, Pose2(x, y, turn), (NEAR_STD, WIDE_STD)[index % 2])
        if truth is not None:
            for std, number in ((NEAR_STD, NEARS), (WIDE_STD, WIDES)):
                for _ in range(number):
                    self._fit(frame, truth, Pose2(*(truth.array + rng.normal(0.0, std)).tolist()), std, is_near=True)
            for _ in range(ASIDES):
                direction, away_m = rng.uniform(-math.pi, math.pi), rng.uniform(*ASIDE_M)
                dx, dy = away_m * math.cos(direction), away_m * math.sin(direction)
                turn = truth.theta_rad + rng.normal(0.0, ASIDE_RAD)
                self._fit(frame, truth, Pose2(truth.x_m + dx, truth.y_m + dy, turn), NEAR_STD)
        self._search(frame, truth)

    def _fit(
        self, frame: UInt8Array, truth: Pose2 | None, prior: Pose2, std: tuple[float, ...], is_near: bool = False
    ) -> None:
        """Add the fit near a prior, unless it is neither right nor wrong."""
        follower = self._follower
        follower.forget()
        follower.follow(frame, PoseEstimate(prior, np.diag(std) ** 2, 1.0, 0.0))
        evidence = follower.evidence
        if not evidence.inliers:
            return
        is_right = False
        if truth is not None:
            # along directions that the picture does not determine, the fit keeps the prior's error
            open_m = 3.0 * min(evidence.position_std_m, std[0]) if is_near else 0.0
            away_m, turn_rad = follower.pose.error_to(truth)
            is_right = away_m < max(RIGHT_M, open_m) and turn_rad < max(RIGHT_RAD, 3.0 * std[2] if open_m else 0.0)
            is_doubtful = away_m < WRONG_RATIO * RIGHT_M and turn_rad < WRONG_RATIO * RIGHT_RAD
            if is_doubtful and not is_right:
                return
        self._choices.append(Choice(_terms([evidence], near=True), np.array([is_right])))

    def _search(self, frame: UInt8Array, truth: Pose2 | None) -> None:
        """Add the poses that a search compares."""
        found, _ = self._finder.fits(frame, next(self._finder.propose(frame)))
        if not found:
            return
        twins = not self._field.halves_differ
        errors = [(9.0, 9.0) if truth is None else one.estimate.pose.error_to(truth, symmetric=twins) for one in found]
        right = [away_m < WRONG_RATIO * RIGHT_M and turn_rad < RIGHT_RAD for away_m, turn_rad in errors]
        self._choices.append(Choice(_terms([one.evidence for one in found], near=False), np.array(right)))


def _terms(found: list[Evidence], near: bool) -> FloatArray:
    """Return the terms of each fit, (N, 10), see `Choice`."""
    units = np.eye(1 + len(WEIGHTS))
    terms = [[log_odds(np.array(one), unit) for unit in units[1:]] for one in found]
    rows = np.column_stack([np.full(len(found), near), np.full(len(found), not near), np.array(terms)])
    if not near:
        rows[:, 2] = 0.0
    return rows.astype(np.float64)


def fit_choices(choices: list[Choice], cost: float) -> EdgeWeights:
    """Fit the weights.

    Parameters
    ----------
    choices : list of Choice
        The choices of all pictures.
    cost : float
        Cost of accepting a wrong pose near a prior, relative to that of refusing a right one.

    Raises
    ------
    ArgumentError
        If no pose is right or none is wrong, near a prior or in a search.
    """
    near = np.array([choice.terms[0, 0] > 0.0 for choice in choices], dtype=bool)
    right = np.array([choice.is_right.any() for choice in choices], dtype=bool)
    counts = [np.count_nonzero(near & right), np.count_nonzero(near & ~right), *np.bincount(right[~near], minlength=2)]
    if not all(counts):
        raise ArgumentError("too few pictures: no right pose or no wrong one, near a prior or anywhere")
    # reweight the choices near a prior so that half of them are right, and the wrong ones have the higher cost
    number = np.count_nonzero(near)
    cost_of = np.where(near, np.where(right, 0.5 * number / counts[0], 0.5 * cost * number / counts[1]), 1.0)
    weights, within_picture = _conditional_logit(choices, cost_of)
    wrong = np.vstack([choice.terms for choice, one in zip(choices, near & ~right, strict=True) if one])
    sure = max(float(np.quantile(wrong @ weights, 1.0 - _SURE_RATE)), 0.0)
    return EdgeWeights(np.delete(weights, 1), float(weights[1]), within_picture, sure)


def _conditional_logit(choices: list[Choice], cost: FloatArray) -> tuple[FloatArray, float]:
    """Return the weights of maximum likelihood, and the factor that multiplies them without a prior.

    The log-likelihood is maximised by Gauss-Newton steps.
    """
    size = choices[0].terms.shape[1]
    # the weights, and the logarithm of the factor
    unknowns, ridge = np.zeros(size + 1), RIDGE * np.eye(size + 1)
    groups = list(_groups(choices, cost))
    for _ in range(_STEPS):
        gradient, hessian = ridge @ unknowns, ridge.copy()
        weights, factor = unknowns[:-1], math.exp(unknowns[-1])
        for terms, right, each in groups:
            slopes = np.pad(terms, ((0, 0), (0, 0), (0, 1)))
            if terms[0, 0, 1]:
                slopes[..., 2:-1] *= factor
                slopes[..., -1] = slopes[..., 2:-1] @ weights[2:]
            # the last outcome means that no pose is right
            log_p = np.pad(slopes[..., :-1] @ weights, ((0, 0), (0, 1)))
            p = np.exp(log_p - log_p.max(axis=1, keepdims=True))
            p /= p.sum(axis=1, keepdims=True)
            among_right = p * right / np.maximum((p * right).sum(axis=1, keepdims=True), 1e-300)
            p, among_right = p[:, :-1], among_right[:, :-1]
            mean = np.einsum("nk,nki->ni", p, slopes)
            gradient += each @ (mean - np.einsum("nk,nki->ni", among_right, slopes))
            flat = slopes.reshape(-1, size + 1)
            hessian += (flat.T * (each[:, None] * p).ravel()) @ flat - (mean.T * each) @ mean
        step = np.linalg.solve(hessian, gradient)
        # far from the optimum the log-likelihood is not quadratic
        step *= min(1.0, _MAX_STEP / np.abs(step).max(initial=_MAX_STEP))
        unknowns -= step
        if np.abs(step).max() < _CONVERGED:
            break
    return unknowns[:-1], math.exp(unknowns[-1])


def _groups(choices: list[Choice], cost: FloatArray) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Group choices of one kind and size: terms (N, K, 10), right outcomes (N, K + 1) and costs (N,)."""
    kinds = [(choice.terms[0, 0], len(choice.terms)) for choice in choices]
    for kind in sorted(set(kinds)):
        same = [index for index, other in enumerate(kinds) if other == kind]
        right = [[*choices[index].is_right, not choices[index].is_right.any()] for index in same]
        yield np.array([choices[index].terms for index in same]), np.array(right, dtype=np.float64), cost[same]
