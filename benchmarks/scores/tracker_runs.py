"""Trackers run over films of detections, and scored: ours, a tuned nearest neighbour, and stonesoup's.

The score is CLEAR MOT: misses, false reports and identity switches against the truth (Bernardin and Stiefelhagen 2008).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from benchmarks.harness import Table, verdict
from benchmarks.peers.tracking_peers import NearestNeighbours, Reports, stone_soup_reports
from benchmarks.worlds.crowd import Frame
from robocup_vision.arrays import FloatArray
from robocup_vision.tracking import MovingObjects
from robocup_vision.tracking.detections import in_field

# a report farther away than this from an object is not of it: less than two radii
NEAR_M = 0.15


@dataclass
class Score:
    """Sums over frames and runs."""

    objects: int = 0
    missed: int = 0
    false: int = 0
    switches: int = 0
    false_tracks: int = 0
    squared_m2: float = 0.0
    _last: dict[int, int] = field(default_factory=dict)
    _seen: set[int] = field(default_factory=set)
    _true: set[int] = field(default_factory=set)

    def frame(
        self,
        places_m: FloatArray,
        reports: list[tuple[int, FloatArray]],
        counted: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        """Add a frame: true places (N, 2), and numbers and places of the tracks reported.

        Reports of objects that are not `counted` (N,) are neither right nor wrong.
        """
        if counted is not None:
            others = places_m[~counted]
            reports = [r for r in reports if not any(np.hypot(*(r[1] - place)) < NEAR_M for place in others)]
            # too far for any match, so that the objects keep their indices
            self.objects -= len(others)
            self.missed -= len(others)
            places_m = np.where(counted[:, None], places_m, np.inf)
        away = np.array([[np.hypot(*(at - place)) for _, at in reports] for place in places_m])
        away = away.reshape(len(places_m), len(reports))
        cost = np.where(away < NEAR_M, away, 1e3)
        for i, j in zip(*np.nonzero(away < NEAR_M), strict=True):
            # who was this object before stays it while it is near
            if self._last.get(int(i)) == reports[j][0]:
                cost[i, j] -= 10.0
        matched = 0
        for i, j in zip(*linear_sum_assignment(cost), strict=True):
            if away[i, j] < NEAR_M:
                matched += 1
                number = reports[j][0]
                self._true.add(number)
                self.squared_m2 += float(away[i, j]) ** 2
                self.switches += self._last.get(int(i), number) != number
                self._last[int(i)] = number
        self._seen |= {number for number, _ in reports}
        self.objects += len(places_m)
        self.missed += len(places_m) - matched
        self.false += len(reports) - matched

    def end_run(self) -> None:
        """Count the run's tracks that never were of any object."""
        self.false_tracks += len(self._seen - self._true)
        self._last, self._seen, self._true = {}, set(), set()

    @property
    def mota(self) -> float:
        """1 less misses, false reports and switches over objects."""
        return 1 - (self.missed + self.false + self.switches) / max(self.objects, 1)

    @property
    def rms_m(self) -> float:
        """Of the matched reports' places."""
        return float(np.sqrt(self.squared_m2 / max(self.objects - self.missed, 1)))


PERIOD_S = 1 / 15
# of a table of trackers, behind their names
COLUMNS = (
    "runs: label | MOTA: score | missed %: loss | false %: loss | switches: count | false tracks: count | "
    "RMS mm: error | verdict"
)
# chosen on seeds that this program does not use
TUNED = {
    "hits": 3,
    "window": 3,
    "patience": 6,
    "gate": 9.2,
    "tentative_patience": 1,
    "quiet": 1000,
    "acceleration_mps2": 2.0,
    "speed_mps": 1.0,
}

Tracker = Callable[[Sequence[Frame]], list[Reports] | None]


def track_splitting(frames: Sequence[Frame]) -> list[Reports]:
    """Ours."""
    tracker = MovingObjects()
    out = []
    for frame in frames:
        tracks = tracker.update(frame.t_s, frame.detections, frame.robot, frame.robot_covariance)
        out.append([(t.number, np.array([t.x_m, t.y_m])) for t in tracks])
    return out


def nearest_neighbours(frames: Sequence[Frame], settings: dict[str, float]) -> list[Reports]:
    """Track with the global nearest neighbour."""
    tracker = NearestNeighbours(**settings)  # type: ignore[arg-type]
    return [tracker.update(PERIOD_S, *in_field(f.detections, f.robot, f.robot_covariance)) for f in frames]


def stone_soup(frames: Sequence[Frame], joint: bool) -> list[Reports] | None:
    """Track with stonesoup."""
    return stone_soup_reports(joint, PERIOD_S, [in_field(f.detections, f.robot, f.robot_covariance) for f in frames])


def tracker_row(table: Table, name: str, runs: int, of: Score | None, ok: bool | None = None) -> None:
    """Print a tracker under `COLUMNS`."""
    if of is None:
        table.row(name, runs, "not installed", *(None,) * 6)
        return
    missed, false = (f"{100 * count / of.objects:.1f}" for count in (of.missed, of.false))
    judged = None if ok is None else verdict(ok)
    table.row(
        name, runs, f"{of.mota:.3f}", missed, false, of.switches, of.false_tracks, f"{1e3 * of.rms_m:.0f}", judged
    )


def score(tracker: Tracker, films: Sequence[Sequence[Frame]], in_view_only: bool = False) -> Score | None:
    """Sum up all runs, of all objects or of those marked in view; None if the tracker is not installed."""
    total = Score()
    for frames in films:
        reports = tracker(frames)
        if reports is None:
            return None
        for frame, reported in zip(frames, reports, strict=True):
            total.frame(frame.places_m, reported, frame.in_view if in_view_only else None)
        total.end_run()
    return total
