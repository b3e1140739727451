"""One verdict on a mirror camera's pose: the likelihood ratio of a frame to clutter.

Each bearing of the floor's outline is in one of a few states, and so is each floor sample that shows a line or should
show one. A state has one probability for a right pose in each of two conditions (clear, rough), and one for a wrong
pose in each of two (the best fit to clutter, a wrong place). The logarithms of the probabilities are summed and divided
by the number of samples with correlated errors. The likeliest condition of each side counts. A hidden sample is nearly
as likely on both sides, and so counts little.

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
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.outline_model import OutlineFit
from robocup_vision.perception.polar_view import PolarView

PACKAGED = Path(__file__).with_name("evidence.toml")
# a pose's log odds by the lines, computed only where the outline does not decide
LineOdds = Callable[[Pose2], float]

OUTLINE_STATES = ("close", "agrees", "off", "hidden", "beyond", "no floor")
LINE_STATES = ("on a line", "floor instead of a line", "line elsewhere")
CONDITIONS = 2
# distances from a line's middle, in line widths, within which a sample is on the line, and wholly on it
_NEAR_WIDTHS, _WITHIN_WIDTHS = 1.2, 0.25


def no_lines(pose: Pose2) -> float:
    """Return the log odds of a pose where no lines are weighed: they speak neither for nor against it."""
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

    #: (2 CONDITIONS, S) float64: logarithms, for the conditions of a right pose, then for those of a wrong one, divided
    #: by the number of samples whose errors are correlated
    log_p: FloatArray
    correlation: float = 1.0  #: that number

    @classmethod
    def of(cls, right: FloatArray, wrong: FloatArray, correlation: float) -> Likelihoods:
        """Take probabilities (CONDITIONS, S) each, and how many samples err alike."""
        return cls(read_only(np.log(np.vstack([right, wrong])) / correlation), correlation)

    def log_odds(self, counts: FloatArray | Int64Array) -> float:
        """Return the log-likelihood ratio of counts (S,) of states."""
        total = self.log_p @ counts
        return float(total[:CONDITIONS].max() - total[CONDITIONS:].max())


@dataclass(frozen=True, slots=True, eq=False)
class PoseEvidence:
    """Probabilities and thresholds that decide whether a pose is accepted."""

    #: of the states `OUTLINE_STATES` and `LINE_STATES`
    outline: Likelihoods
    lines: Likelihoods
    min_log_odds: float  #: smallest accepted: against clutter, and against every other place
    #: by the outline alone, log odds from which no other candidate is examined: `min_log_odds` above the likeliest
    #: wrong fit's
    sure_log_odds: float


def load_evidence(path: str | Path = PACKAGED) -> PoseEvidence:
    """Read the fitted probabilities.

    Parameters
    ----------
    path : str or Path, optional
        A file of `robocup-vision fit-evidence`; without it the one that comes with the package.

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
    """Evidence of an outline on a pose."""

    log_odds: float  #: by the outline alone
    counts: Int64Array  #: (6,) int64: bearings in each state

    def reason(self, log_odds: float) -> str:
        """Name the missing evidence, given the log odds by all evidence."""
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
    """Counts the states of an outline's bearings by a pose, and weighs them.

    Parameters
    ----------
    unit_px : float
        A pixel of the paper's image, see `OutlineModel`.
    likelihoods : Likelihoods
        Of `OUTLINE_STATES`.
    """

    def __init__(self, view: PolarView, unit_px: float, likelihoods: Likelihoods) -> None:
        # a bearing is shown where at least half of its samples lie inside the frame and outside the mask
        is_shown = (view.valid.mean(axis=1) >= 0.5).astype(np.uint8)
        # copies: a read-only array would be compiled for once more
        self._arrays = is_shown, np.array(view.radius_px), unit_px, np.array(likelihoods.log_p)

    def weigh(self, fit: OutlineFit, outermost: Int64Array) -> OutlineTally:
        """Weigh a fit, given each bearing's outermost floor sample (K,), -1 where none."""
        return self.weigh_walls(fit.residual_px, fit.predicted_px, outermost)

    def weigh_walls(self, residual_px: FloatArray, predicted_px: FloatArray, outermost: Int64Array) -> OutlineTally:
        """Weigh a pose by where it predicts the walls' feet, and how far from these the floor's edges are, (K,)."""
        counts = np.empty(len(OUTLINE_STATES), dtype=np.int64)
        log_odds = weigh_outline(residual_px, predicted_px, outermost, *self._arrays, counts)
        return OutlineTally(log_odds, counts)


class LineEvidence:
    """Counts the states of floor samples on lines by a pose, and weighs them."""

    def __init__(self, line_map: LineMap, view: PolarView, likelihoods: Likelihoods) -> None:
        self._map, self._floor_m, self._likelihoods = line_map, view.floor_m, likelihoods
        width_m = line_map.field.line_width_m
        near_m, deep_m = _NEAR_WIDTHS * width_m, np.gradient(view.range_m)
        # a sample stands for half a column inwards and outwards
        self._on_m = np.maximum(near_m, 0.5 * deep_m + 0.5 * near_m)
        # near the robot a line fills its sample
        self._bare_m = np.where(deep_m < 2 * width_m, _WITHIN_WIDTHS * width_m, 0.0)

    def counts(self, pose: Pose2, marks: UInt8Array) -> Int64Array:
        """Count the samples in each of `LINE_STATES`, given the marks (K, M) of `FloorMarking.mark`."""
        on_line = self._map.count_near(pose, marks, LINE, self._floor_m, self._on_m)
        bare = self._map.count_near(pose, marks, FLOOR, self._floor_m, self._bare_m)
        return np.array([on_line, bare, np.count_nonzero(marks == LINE) - on_line])

    def log_odds(self, pose: Pose2, marks: UInt8Array) -> float:
        """Weigh a pose by the lines alone."""
        return self._likelihoods.log_odds(self.counts(pose, marks))
