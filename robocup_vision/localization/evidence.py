"""Likelihood ratio by which a mirror camera's pose is accepted: a frame of that pose against clutter.

Each bearing of the floor's outline is in one of a few states, and so is each floor sample that shows or should show a
line. A state has one probability for a right pose in each of two conditions (clear, rough), and one for a wrong pose in
each of two (the best fit to clutter, a wrong place). The logarithms are summed and divided by the number of samples
with correlated errors. The most likely condition of each side counts. Hidden samples are nearly as likely on both
sides.

The probabilities are data: `evidence.toml`, which `robocup-vision fit-evidence` writes.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import msgspec
import numpy as np

from field_models.errors import FileError
from field_models.toml_file import StrictStruct, load_toml
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array, read_only
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor.free_floor import FLOOR, LINE
from robocup_vision.kernels.walls.evidence import AGREES, CLOSE, HIDDEN, weigh_outline
from robocup_vision.localization.line_map import LineMap
from robocup_vision.localization.outline_model import OutlineFit
from robocup_vision.perception.polar_view import PolarView

PACKAGED = Path(__file__).with_name("evidence.toml")
# function of a pose's log odds by the lines, computed only if the outline does not decide
LineOdds = Callable[[Pose2], float]

OUTLINE_STATES = ("close", "agrees", "off", "hidden", "beyond", "no floor")
LINE_STATES = ("on a line", "floor instead of a line", "line elsewhere")
CONDITIONS = 2
# distances from a line's middle, in line widths, within which a sample is on the line, and entirely on it
_NEAR_WIDTHS, _WITHIN_WIDTHS = 1.2, 0.25


def no_lines(pose: Pose2) -> float:
    """Return the log odds of a pose if lines are not used: 0."""
    return 0.0


_LogOdds = Annotated[float, msgspec.Meta(gt=0)]


class _Cue(StrictStruct):
    states: list[str]
    correlation: Annotated[float, msgspec.Meta(ge=1)]
    right: list[list[float]]
    wrong: list[list[float]]


class _EvidenceFile(StrictStruct):
    format: Literal[1]
    command: str
    sets: list[str]
    min_log_odds: _LogOdds
    sure_log_odds: _LogOdds
    outline: _Cue
    lines: _Cue


@dataclass(frozen=True, slots=True, eq=False)
class Likelihoods:
    """Probabilities of the states of one cue's samples."""

    #: (2 CONDITIONS, S) float64: logarithms, for the conditions of a right pose, then of a wrong one, divided by the
    #: number of samples with correlated errors
    log_p: FloatArray
    correlation: float = 1.0  #: number of samples with correlated errors

    @classmethod
    def of(cls, right: FloatArray, wrong: FloatArray, correlation: float) -> Likelihoods:
        """Make likelihoods from probabilities (CONDITIONS, S) and the number of samples with correlated errors."""
        return cls(read_only(np.log(np.vstack([right, wrong])) / correlation), correlation)

    def log_odds(self, counts: FloatArray | Int64Array) -> float:
        """Return the log-likelihood ratio of counts (S,) of states."""
        total = self.log_p @ counts
        return float(total[:CONDITIONS].max() - total[CONDITIONS:].max())


@dataclass(frozen=True, slots=True, eq=False)
class PoseEvidence:
    """Probabilities and thresholds that decide whether a pose is accepted."""

    #: likelihoods of the states `OUTLINE_STATES` and `LINE_STATES`
    outline: Likelihoods
    lines: Likelihoods
    min_log_odds: float  #: least accepted log odds, against clutter and against every other place
    #: log odds by the outline alone at which no other candidate is examined: `min_log_odds` above those of the most
    #: likely wrong fit
    sure_log_odds: float


def load_evidence(path: str | Path = PACKAGED) -> PoseEvidence:
    """Read the fitted probabilities.

    Parameters
    ----------
    path : str or Path, optional
        A file of `robocup-vision fit-evidence`; by default the package's own.

    Raises
    ------
    FileError
        If the file is missing or wrong.
    """
    described = load_toml(path, _EvidenceFile)
    return PoseEvidence(
        _likelihoods(path, "outline", described.outline, OUTLINE_STATES),
        _likelihoods(path, "lines", described.lines, LINE_STATES),
        described.min_log_odds,
        described.sure_log_odds,
    )


def _likelihoods(path: str | Path, name: str, cue: _Cue, states: tuple[str, ...]) -> Likelihoods:
    if tuple(cue.states) != states:
        raise FileError(path, f"must be {list(states)}", key=f"{name}.states", value=cue.states)
    for key, rows in (("right", cue.right), ("wrong", cue.wrong)):
        if len(rows) != CONDITIONS:
            raise FileError(path, f"must have {CONDITIONS} rows", key=f"{name}.{key}", value=rows)
        for row in rows:
            if len(row) != len(states) or not min(row) > 0.0 or not abs(sum(row) - 1.0) < 1e-3:
                problem = f"must hold {len(states)} probabilities above 0 that add up to 1"
                raise FileError(path, problem, key=f"{name}.{key}", value=row)
    return Likelihoods.of(np.array(cue.right), np.array(cue.wrong), cue.correlation)


class OutlineTally(NamedTuple):
    """Evidence for a pose by an outline."""

    log_odds: float  #: log odds by the outline alone
    counts: Int64Array  #: (6,) int64: bearings in each state

    def reason(self, log_odds: float) -> str:
        """Describe the missing evidence, given the log odds by all evidence."""
        visible = int(self.counts.sum() - self.counts[HIDDEN])
        agree = self.counts[CLOSE] + self.counts[AGREES]
        return f"{agree} of {visible} visible bearings agree with walls, odds {odds_text(log_odds)}"


def odds_text(log_odds: float) -> str:
    """Write odds as "3:1" or "1:30"."""
    if log_odds < -math.log(1000.0):
        return "below 1:1000"
    odds = math.exp(min(abs(log_odds), math.log(1000.0)))
    ratio = f"{odds:.2g}" if odds < 10.0 else f"{odds:.0f}"
    return f"{ratio}:1" if log_odds > 0.0 else f"1:{ratio}"


class OutlineEvidence:
    """Counts the states of an outline's bearings at a pose, and computes its log odds.

    Parameters
    ----------
    unit_px : float
        A pixel of the paper's image, see `OutlineModel`.
    likelihoods : Likelihoods
        Likelihoods of `OUTLINE_STATES`.
    """

    def __init__(self, view: PolarView, unit_px: float, likelihoods: Likelihoods) -> None:
        # a bearing is used if at least half of its samples are inside the frame and outside the mask
        is_shown = (view.valid.mean(axis=1) >= 0.5).astype(np.uint8)
        # copies, because the loop would be compiled again for read-only arrays
        self._arrays = is_shown, np.array(view.radius_px), unit_px, np.array(likelihoods.log_p)

    def weigh(self, fit: OutlineFit, outermost: Int64Array) -> OutlineTally:
        """Compute the log odds of a fit, given each bearing's outermost floor sample (K,), -1 if none."""
        return self.weigh_walls(fit.residual_px, fit.predicted_px, outermost)

    def weigh_walls(self, residual_px: FloatArray, predicted_px: FloatArray, outermost: Int64Array) -> OutlineTally:
        """Compute the log odds of a pose from predicted feet of walls and the residuals of the floor's edges, (K,)."""
        counts = np.empty(len(OUTLINE_STATES), dtype=np.int64)
        log_odds = weigh_outline(residual_px, predicted_px, outermost, *self._arrays, counts)
        return OutlineTally(log_odds, counts)


class LineEvidence:
    """Counts the states of floor samples on lines at a pose, and computes its log odds."""

    def __init__(self, line_map: LineMap, view: PolarView, likelihoods: Likelihoods) -> None:
        self._map, self._floor_m, self._likelihoods = line_map, view.floor_m, likelihoods
        width_m = line_map.field.line_width_m
        near_m, deep_m = _NEAR_WIDTHS * width_m, np.gradient(view.range_m)
        # a sample extends by half a column inwards and outwards
        self._on_m = np.maximum(near_m, 0.5 * deep_m + 0.5 * near_m)
        # only near the robot a line fills a sample
        self._bare_m = np.where(deep_m < 2 * width_m, _WITHIN_WIDTHS * width_m, 0.0)

    def counts(self, pose: Pose2, marks: UInt8Array) -> Int64Array:
        """Count the samples in each of `LINE_STATES`, given the marks (K, M) of `FloorMarking.mark`."""
        on_line = self._map.count_near(pose, marks, LINE, self._floor_m, self._on_m)
        bare = self._map.count_near(pose, marks, FLOOR, self._floor_m, self._bare_m)
        return np.array([on_line, bare, np.count_nonzero(marks == LINE) - on_line])

    def log_odds(self, pose: Pose2, marks: UInt8Array) -> float:
        """Compute the log odds of a pose by the lines alone."""
        return self._likelihoods.log_odds(self.counts(pose, marks))
