"""Fits what line points show of right and of wrong poses, to rendered pictures and to ones without a field.

As `sim2d.sensors.pose_evidence` for a carpet that goes on beyond the lines. A right pose is the one found near the
truth, in clear conditions and in rough ones: with worn lines, with cables, rulers and robots lying about, through a
camera that is not calibrated well. A wrong one is the best that is found in a picture without a field, or another that
the search brings up.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera import OmniCamera
from robocup_vision.camera.floor_range import magnified
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import LINE_POINT_STATES, LineCounts, LinesAloneLikelihoods
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from sim2d.rendering.litter import littered, worn
from sim2d.rendering.no_field import no_field_picture
from sim2d.rendering.random_scenes import sample
from sim2d.sensors.pose_evidence import (
    CLEAR,
    CLUTTER,
    CLUTTER_PER_PICTURE,
    PSEUDO_COUNT,
    ROUGH,
    SETS,
    FittedCue,
    err_alike,
    fit_cue,
)

RIGHT_M, RIGHT_RAD = 0.15, 0.1
WRONG_M, WRONG_RAD = 0.3, 0.2
# each picture of a set is looked at as it is, and in rough conditions
_LOOKS = 2
# how far a camera's centre is off there, of the outer usable radius
_OFF = (0.01, -0.008)
_ROUNDS = 3


@dataclass(eq=False)
class LineSamples:
    """What line points show of poses.

    Parameters
    ----------
    right : list of two lists of LineCounts
        Right poses, in clear and in rough conditions.
    wrong_place : list of LineCounts
        What else the search brings up in pictures of a field.
    clutter : list of lists of LineCounts
        All that is found in each picture without a field.
    """

    right: tuple[list[LineCounts], list[LineCounts]] = field(default_factory=lambda: ([], []))
    wrong_place: list[LineCounts] = field(default_factory=list)
    clutter: list[list[LineCounts]] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class FittedFound:
    """Fractions of predicted samples found beyond chance (2,) by right and wrong poses, and how many err alike."""

    right: FloatArray
    wrong: FloatArray
    correlation: float


@dataclass(frozen=True, eq=False)
class FittedLines:
    """What the file holds of lines alone, see `LinesAloneLikelihoods`."""

    points: FittedCue
    found: FittedFound

    @property
    def likelihoods(self) -> LinesAloneLikelihoods:
        """As the verdict takes them."""
        found = self.found
        return LinesAloneLikelihoods(self.points.likelihoods, np.array([*found.right, *found.wrong]), found.correlation)


def enlarged(camera: OmniCamera, factor: int) -> OmniCamera:
    """Return a camera whose picture is so many times as wide and high."""
    (width, height), (u, v), (inner, outer) = camera.size_px, camera.center_px, camera.usable_radius_px
    middle = (factor - 1) / 2
    return dataclasses.replace(
        camera,
        size_px=(factor * width, factor * height),
        center_px=(factor * u + middle, factor * v + middle),
        usable_radius_px=(factor * inner, factor * outer),
        floor_range=magnified(camera.floor_range, factor),
    )


def line_picture_count(count: int) -> int:
    """Return how many pictures `count` of each set come to, those without a field included."""
    return count * (len(SETS) * _LOOKS + CLUTTER_PER_PICTURE)


def draw_line_samples(on: Field, camera: OmniCamera, seed: int, count: int) -> Iterator[LineSamples]:
    """Yield, picture by picture, all samples so far (always the same, growing object); by `seed` alone.

    Parameters
    ----------
    on : Field
        With lines, on a carpet that goes on beyond them.
    camera : OmniCamera
        The camera.
    seed : int
        Not negative.
    count : int
        Pictures of each set.

    Raises
    ------
    ArgumentError
        If the field lacks lines, or is bounded.
    """
    if on.is_bounded or not len(on.lines) + len(on.arcs):
        raise ArgumentError(f"field '{on.name}' must have lines, on a carpet that goes on beyond them")
    off_px = np.array(_OFF) * camera.usable_radius_px[1]
    center_u, center_v = (np.array(camera.center_px) + off_px).tolist()
    clear = LinePoseEstimator(on, camera)
    rough = LinePoseEstimator(on, dataclasses.replace(camera, center_px=(center_u, center_v)))
    samples = LineSamples()
    for index, (condition, _) in enumerate(SETS.values()):
        for drawn in sample(on, camera, condition, seed, count):
            rng = np.random.default_rng([seed, index, drawn.index])
            _add_field(clear, drawn.frame, drawn.pose, samples, CLEAR)
            yield samples
            _add_field(rough, littered(worn(drawn.frame, rng), camera, rng), drawn.pose, samples, ROUGH)
            yield samples
    for index in range(CLUTTER_PER_PICTURE * count):
        found = [counts for _, counts in _candidates(clear, no_field_picture(camera.size_px, index, seed)[1])]
        if found:
            samples.clutter.append(found)
        yield samples


def _candidates(estimator: LinePoseEstimator, frame: UInt8Array) -> list[tuple[Pose2, LineCounts]]:
    points = estimator.finder.find(frame)
    found = estimator.candidates(points, estimator.evidence.see(points))
    return [(one.pose, one.tally.counts) for one in found if one.is_fixed]


def _add_field(estimator: LinePoseEstimator, frame: UInt8Array, truth: Pose2, samples: LineSamples, row: int) -> None:
    """Add what a picture of the field shows from a true pose."""
    right: list[tuple[float, LineCounts]] = []
    for pose, counts in _candidates(estimator, frame):
        away_m, turned_rad = pose.error_to(truth, symmetric=True)
        if away_m <= RIGHT_M and turned_rad <= RIGHT_RAD:
            right.append((away_m, counts))
        elif away_m > WRONG_M or turned_rad > WRONG_RAD:
            samples.wrong_place.append(counts)
    if right:
        samples.right[row].append(min(right, key=lambda one: one[0])[1])


def fit_line_samples(samples: LineSamples) -> FittedLines:
    """Turn samples into probabilities; which pose is a picture's best one depends on them, so they are fitted in turns.

    Raises
    ------
    ArgumentError
        If some kind of pose has no sample.
    """
    if not all((*samples.right, samples.wrong_place, samples.clutter)):
        raise ArgumentError("too few pictures: no sample of a pose by lines that is right, wrong, or of clutter")
    best = [max(found, key=lambda one: one.points[0]) for found in samples.clutter]
    for _ in range(_ROUNDS):
        rows = [*samples.right, best, samples.wrong_place]
        points = _fit_points(rows)
        fitted = FittedLines(points, _fit_found(rows))
        likelihoods = fitted.likelihoods
        best = [max(found, key=likelihoods.log_odds) for found in samples.clutter]
    return fitted


def _fit_points(rows: list[list[LineCounts]]) -> FittedCue:
    """Fit the probabilities of line points; clutter lies along lines by whole strokes, and errs alike by more."""
    counts = [np.array([one.points for one in row]) for row in rows]
    cue = fit_cue([list(one) for one in counts], LINE_POINT_STATES)
    correlation = cue.correlation
    for wrong, p in enumerate(cue.wrong):
        for right in cue.right:
            correlation = max(correlation, err_alike(counts[CLUTTER + wrong], p, np.log(p / right)))
    return dataclasses.replace(cue, correlation=correlation)


def _fit_found(rows: list[list[LineCounts]]) -> FittedFound:
    """Fit the fractions found beyond chance to the counts of two rows of right poses and two of wrong ones."""
    counts = [np.array([[one.found, one.missed, one.chance] for one in row]) for row in rows]
    # missed is what does not show its line, and is not covered by chance
    fraction = np.array([1.0 - _unseen(one) for one in counts])
    correlation = 1.0
    for own, one in enumerate(counts):
        found, missed, chance = one.T
        unseen = (1.0 - fraction) * (1.0 - chance[:, None])
        p = np.stack([1.0 - unseen, unseen], axis=-1)
        for other in range(CLUTTER, len(rows)) if own < CLUTTER else range(CLUTTER):
            ratio = np.log(p[:, own] / p[:, other])
            correlation = max(correlation, err_alike(np.column_stack([found, missed]), p[:, own], ratio))
    return FittedFound(fraction[:CLUTTER], fraction[CLUTTER:], correlation)


def _unseen(counts: FloatArray) -> float:
    found, missed, chance = counts.T
    uncovered = float(((found + missed) * (1.0 - chance)).sum())
    return min((float(missed.sum()) + PSEUDO_COUNT) / (uncovered + 2 * PSEUDO_COUNT), 1.0 - 1e-3)
