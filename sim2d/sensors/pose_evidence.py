"""Fits the probabilities of `robocup_vision.localization.evidence` to rendered pictures and to ones without a field.

A right pose is one that the search finds within 5 cm and 3 degrees of the truth in rendered pictures, under clear and
under rough conditions. A wrong pose is the best one that is found in a picture without a field, or the end of a fit
that started at a random pose.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import LINE_STATES, OUTLINE_STATES, Likelihoods, LineEvidence
from robocup_vision.localization.floor import OutlineFitter
from robocup_vision.localization.line_map import LineMap
from robocup_vision.localization.localizer import FrameEvidence
from robocup_vision.localization.methods import choose_method
from robocup_vision.localization.outline_model import OutlineFit
from robocup_vision.pipeline.frames import FrameOptions
from robocup_vision.pipeline.omni import OmniPipeline
from sim2d.rendering.no_field import PAINTERS, no_field_picture
from sim2d.rendering.random_scenes import CONDITIONS, Condition, sample

CLEAR, ROUGH, CLUTTER, WRONG_PLACE = range(4)
_CROWD, _BAD_DAY = CONDITIONS["crowd"], CONDITIONS["bad_day"]
# sets of pictures by name: their disturbances, and whether these are clear or rough conditions
SETS: dict[str, tuple[Condition, int]] = {
    **{name: (condition, ROUGH if condition.shadow else CLEAR) for name, condition in CONDITIONS.items()},
    "dense": (dataclasses.replace(_CROWD, obstacles=(9, 13)), CLEAR),
    "bad_day in a crowd": (
        dataclasses.replace(_BAD_DAY, obstacles=(6, 10), ring=True, noise_sigma=9.0, jpeg_quality=70),
        ROUGH,
    ),
}
# number of pictures without a field for each picture of a set
CLUTTER_PER_PICTURE = 24
RIGHT_M, RIGHT_RAD = 0.05, math.radians(3.0)
WRONG_M, WRONG_RAD = 0.15, math.radians(8.0)
# numbers of fits of each picture that start at random poses, and that start near the truth
STARTS, PRIORS = 3, 3
PRIOR_STD = (0.05, 0.05, math.radians(5.0))
# added to each count, since a state that has not occurred is not impossible
PSEUDO_COUNT = 0.5
_ROUNDS = 3


class Sample(NamedTuple):
    """Counts of the states of a pose's outline (6,) and of its lines (3,)."""

    outline: FloatArray
    lines: FloatArray


@dataclass(eq=False)
class Samples:
    """Samples of right and wrong poses."""

    #: Right poses, under clear and under rough conditions.
    right: tuple[list[Sample], list[Sample]] = field(default_factory=lambda: ([], []))
    #: Wrong ends of fits that started at random poses.
    wrong_place: list[Sample] = field(default_factory=list)
    #: All poses found in each picture without a field.
    clutter: list[list[Sample]] = field(default_factory=list)
    #: list of (6,) float64: outlines of wrong fits that determine a pose, from the first guess and from near the truth.
    wrong_fixed: list[FloatArray] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class FittedCue:
    """Probabilities (2, S) of a cue's states given right and given wrong poses.

    `correlation` is the number of samples that count as one independent sample, since their errors are correlated.
    """

    right: FloatArray
    wrong: FloatArray
    correlation: float

    @property
    def likelihoods(self) -> Likelihoods:
        """The likelihoods in the format of the verdict."""
        return Likelihoods.of(self.right, self.wrong, self.correlation)


@dataclass(frozen=True, eq=False)
class FittedEvidence:
    """The content of the evidence file, see `PoseEvidence`."""

    outline: FittedCue
    lines: FittedCue
    sure_log_odds: float


class _Looker:
    """Finds poses in a picture, and counts the states of their outlines and lines."""

    def __init__(self, on: Field, camera: OmniCamera) -> None:
        if not on.is_bounded or not len(on.lines) + len(on.arcs):
            raise ArgumentError(f"field '{on.name}' must have walls or boards, and lines")
        options = FrameOptions(choose_method(camera), None, None, 24, 24, "bgr")
        self._pipeline = OmniPipeline(on, camera, options)
        self.fitter = OutlineFitter(on, camera, self._pipeline.polar)
        flat = Likelihoods(np.zeros((4, len(LINE_STATES))))
        self._lines = LineEvidence(LineMap(on), self._pipeline.polar, flat)

    def measure(self, frame: np.ndarray) -> FrameEvidence | None:
        """Return the evidence of a picture, independently of earlier ones."""
        self._pipeline.forget()
        return self._pipeline.measure(frame)

    def candidates(self, seen: FrameEvidence) -> list[OutlineFit]:
        """Return all fits that determine a place on the field."""
        first, fitter = self.fitter.from_guess(seen.edge_px), self.fitter
        found = [] if first is None else fitter.search.candidates(first, seen.edge_px)
        return [fit for fit in found if fitter.is_fixed_place(fit)]

    def outline(self, fit: OutlineFit, seen: FrameEvidence) -> FloatArray:
        """Return the counts of the outline's states (6,)."""
        return self.fitter.weigh(fit, seen.floor_column).counts.astype(np.float64)

    def sample(self, fit: OutlineFit, seen: FrameEvidence) -> Sample:
        """Return the counts of all states."""
        assert seen.marks is not None
        lines = self._lines.counts(Pose2(*fit.pose), seen.marks)
        return Sample(self.outline(fit, seen), lines.astype(np.float64))


def picture_count(count: int) -> int:
    """Return the total number of pictures: `count` of each set, and those without a field."""
    return count * (len(SETS) + CLUTTER_PER_PICTURE)


def draw_samples(on: Field, camera: OmniCamera, seed: int, count: int) -> Iterator[Samples]:
    """Yield all samples so far after each of `count` pictures per set; it is always the same, growing object.

    Raises
    ------
    ArgumentError
        If the field lacks walls or lines.
    """
    looker, samples = _Looker(on, camera), Samples()
    for index, (condition, row) in enumerate(SETS.values()):
        for drawn in sample(on, camera, condition, seed, count):
            rng = np.random.default_rng([seed, index, drawn.index])
            seen = looker.measure(drawn.frame)
            if seen is not None:
                _add_field(looker, seen, drawn.pose, samples, row, rng)
            yield samples
    for index in range(CLUTTER_PER_PICTURE * count):
        seen = looker.measure(no_field_picture(camera.size_px, index, seed)[1])
        if seen is not None:
            found = [looker.sample(fit, seen) for fit in looker.candidates(seen)]
            if found:
                samples.clutter.append(found)
        yield samples


def clutter_names() -> list[str]:
    """Return the kinds of pictures without a field."""
    return list(PAINTERS)


def _add_field(
    looker: _Looker, seen: FrameEvidence, truth: Pose2, samples: Samples, row: int, rng: np.random.Generator
) -> None:
    """Add the samples of a picture of the field, taken from a true pose."""
    fitter = looker.fitter
    right = [fit for fit in looker.candidates(seen) if _is_within(fit, truth, RIGHT_M, RIGHT_RAD)]
    if right:
        samples.right[row].append(looker.sample(min(right, key=lambda fit: fit.cost), seen))
    half = np.array([fitter.field.length_m / 2, fitter.field.width_m / 2, math.pi])
    for start in rng.uniform(-half, half, (STARTS, 3)).tolist():
        fit = fitter.from_start(tuple(start), seen.edge_px)
        if fitter.is_fixed_place(fit) and not _is_within(fit, truth, WRONG_M, WRONG_RAD):
            samples.wrong_place.append(looker.sample(fit, seen))
    first = fitter.from_guess(seen.edge_px)
    near = [fitter.from_prior(Pose2(*at), seen.edge_px) for at in truth.array + rng.normal(0.0, PRIOR_STD, (PRIORS, 3))]
    for one in (first, *near):
        if one is not None and fitter.fixes_pose(one) and not _is_within(one, truth, 2 * RIGHT_M, 2 * RIGHT_RAD):
            samples.wrong_fixed.append(looker.outline(one, seen))


def _is_within(fit: OutlineFit, truth: Pose2, max_m: float, max_rad: float) -> bool:
    distance, angle = Pose2(*fit.pose).error_to(truth, symmetric=True)
    return distance <= max_m and angle <= max_rad


def fit_samples(samples: Samples, min_log_odds: float) -> FittedEvidence:
    """Estimate the probabilities from samples.

    The best pose in a picture without a field depends on the probabilities, so best poses and probabilities are
    computed alternately.

    Raises
    ------
    ArgumentError
        If some kind of pose has no sample.
    """
    if not all((*samples.right, samples.wrong_place, samples.clutter)):
        raise ArgumentError("too few pictures: no sample of a right pose, of a wrong one, or of clutter")
    best = [max(found, key=lambda one: one.outline[0]) for found in samples.clutter]
    for _ in range(_ROUNDS):
        rows = [*samples.right, best, samples.wrong_place]
        outline = _fit_cue([[one.outline for one in row] for row in rows], OUTLINE_STATES)
        by_outline = outline.likelihoods
        best = [max(found, key=lambda one: by_outline.log_odds(one.outline)) for found in samples.clutter]
    lines = _fit_cue([[one.lines for one in row] for row in rows], LINE_STATES)
    sure = max([0.0, *(by_outline.log_odds(counts) for counts in samples.wrong_fixed)]) + min_log_odds
    return FittedEvidence(outline, lines, sure)


def _fit_cue(rows: list[list[FloatArray]], states: tuple[str, ...]) -> FittedCue:
    """Fit the probabilities of a cue's states to the counts (N, S) of two rows of right poses and two of wrong ones."""
    counts = [np.array(row).reshape(-1, len(states)) for row in rows]
    totals = np.array([one.sum(axis=0) for one in counts]) + PSEUDO_COUNT
    p = totals / totals.sum(axis=1, keepdims=True)
    correlation = max(
        _variance_ratio(counts[right], p[right], np.log(p[right] / p[wrong]))
        for right in (CLEAR, ROUGH)
        for wrong in (CLUTTER, WRONG_PLACE)
    )
    return FittedCue(p[:CLUTTER], p[CLUTTER:], max(correlation, 1.0))


def _variance_ratio(counts: FloatArray, p: FloatArray, ratio: FloatArray) -> float:
    """Return the variance of a picture's sum of log ratios, divided by that of independent samples."""
    number = counts.sum(axis=1)
    mean = float(p @ ratio)
    independent = float(p @ (ratio - mean) ** 2)
    return float(((counts @ ratio - number * mean) ** 2).sum() / max(number.sum() * independent, 1e-9))
