"""Trackers run over films of detections, and scored: ours, a tuned nearest neighbour, and stonesoup's.

The score is CLEAR MOT: misses, false reports and identity switches against the truth (Bernardin and Stiefelhagen 2008).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from benchmarks.harness import Table, verdict
from benchmarks.worlds.crowd import Frame
from robocup_vision.arrays import FloatArray
from robocup_vision.tracking import MovingObjects
from robocup_vision.tracking.detections import in_field

Reports = list[tuple[int, FloatArray]]
# how long a velocity lasts
_STEADY_S = 1.0


@dataclass
class _Track:
    number: int
    mean: FloatArray
    covariance: FloatArray
    hits: list[bool]
    confirmed: bool = False


@dataclass
class NearestNeighbours:
    """A global nearest neighbour, with the same Kalman filter, noise and detections as `MovingObjects`.

    Tracks begin with any detection that none has, are reported once `hits` of `window` frames had one, and end after
    `patience` misses in a row.
    """

    acceleration_mps2: float
    speed_mps: float  #: standard deviation of a new track's
    hits: int
    window: int
    patience: int
    tentative_patience: int  #: of a track that is not reported yet
    quiet: int  #: frames without a detection after which a track is not reported
    gate: float  #: squared Mahalanobis distance
    tracks: list[_Track] = field(default_factory=list)
    numbers: Iterator[int] = field(default_factory=lambda: itertools.count(1))

    def update(self, seconds: float, places_m: FloatArray, spreads: FloatArray) -> Reports:
        """Take detections (M, 2) and covariances (M, 2, 2) in the field frame; (number, place) of each track."""
        kept = math.exp(-seconds / _STEADY_S)
        move = np.eye(4)
        move[0, 2] = move[1, 3] = _STEADY_S * (1 - kept)
        move[2, 2] = move[3, 3] = kept
        push = np.array([[seconds**2 / 2, 0.0], [0.0, seconds**2 / 2], [seconds, 0.0], [0.0, seconds]])
        cost = np.full((len(self.tracks), len(places_m)), 1e6)
        for i, track in enumerate(self.tracks):
            track.mean = move @ track.mean
            track.covariance = move @ track.covariance @ move.T + push @ push.T * self.acceleration_mps2**2
            track.hits.append(False)
            for j in range(len(places_m)):
                spread = track.covariance[:2, :2] + spreads[j]
                off = places_m[j] - track.mean[:2]
                distance = off @ np.linalg.solve(spread, off)
                if distance < self.gate:
                    cost[i, j] = distance + math.log(np.linalg.det(spread))
        free = set(range(len(places_m)))
        for i, j in zip(*linear_sum_assignment(cost), strict=True):
            if cost[i, j] < 1e5:
                track = self.tracks[i]
                gain = track.covariance[:, :2] @ np.linalg.inv(track.covariance[:2, :2] + spreads[j])
                track.mean = track.mean + gain @ (places_m[j] - track.mean[:2])
                track.covariance = track.covariance - gain @ track.covariance[:2]
                track.hits[-1] = True
                free.discard(int(j))
        for track in self.tracks:
            track.confirmed |= sum(track.hits[-self.window :]) >= self.hits
        self.tracks = [
            t for t in self.tracks if any(t.hits[-(self.patience if t.confirmed else self.tentative_patience) :])
        ]
        for j in sorted(free):
            covariance = np.diag([0.0, 0.0, self.speed_mps**2, self.speed_mps**2])
            covariance[:2, :2] = spreads[j]
            self.tracks.append(_Track(next(self.numbers), np.array([*places_m[j], 0.0, 0.0]), covariance, [True]))
        return [(t.number, t.mean[:2]) for t in self.tracks if t.confirmed and any(t.hits[-self.quiet :])]


def stone_soup_reports(
    joint: bool, seconds: float, frames: Sequence[tuple[FloatArray, FloatArray]]
) -> list[Reports] | None:
    """Return the tracks of each frame of places (M, 2) and covariances (M, 2, 2) by stonesoup; None: not installed.

    The tracker is put together from its parts as its own examples do: JPDA (`joint`) or GNN with 2D assignment. Tracks
    are reported after 3 detections, and end after as many frames without any as suits each best on other seeds.
    """
    try:
        from stonesoup.dataassociator.neighbour import GNNWith2DAssignment
        from stonesoup.dataassociator.probability import JPDAwithEHM2
        from stonesoup.deleter.time import UpdateTimeStepsDeleter
        from stonesoup.hypothesiser.distance import DistanceHypothesiser
        from stonesoup.hypothesiser.probability import PDAHypothesiser
        from stonesoup.initiator.simple import MultiMeasurementInitiator
        from stonesoup.measures import Mahalanobis
        from stonesoup.models.measurement.linear import LinearGaussian
        from stonesoup.models.transition.linear import CombinedLinearGaussianTransitionModel, ConstantVelocity
        from stonesoup.predictor.kalman import KalmanPredictor
        from stonesoup.tracker.simple import MultiTargetMixtureTracker, MultiTargetTracker
        from stonesoup.types.detection import Detection
        from stonesoup.types.state import GaussianState
        from stonesoup.updater.kalman import KalmanUpdater
    except ImportError:
        return None
    # as those of `MovingObjects`
    acceleration_mps2, speed_mps = 2.0, 0.7
    # Mahalanobis distance, not squared; for JPDA: ratio detected, clutter
    gate, detected, clutter_per_m2 = 3.0, 0.8, 0.2
    noise = acceleration_mps2**2 * seconds
    transition = CombinedLinearGaussianTransitionModel([ConstantVelocity(noise)] * 2)
    predictor, updater = KalmanPredictor(transition), KalmanUpdater()
    start = datetime(2001, 3, 5)
    prior = GaussianState([[0.0]] * 4, np.diag([4.0, speed_mps**2, 4.0, speed_mps**2]), timestamp=start)
    near: Any = DistanceHypothesiser(predictor, updater, Mahalanobis(), missed_distance=gate)
    hypothesiser, associator, tracker = near, GNNWith2DAssignment, MultiTargetTracker
    if joint:
        hypothesiser = PDAHypothesiser(
            predictor, updater, clutter_spatial_density=clutter_per_m2, prob_detect=detected,
            prob_gate=0.99,
        )  # fmt: skip
        associator, tracker = JPDAwithEHM2, MultiTargetMixtureTracker
    initiator = MultiMeasurementInitiator(
        prior_state=prior,
        deleter=UpdateTimeStepsDeleter(2),
        data_associator=GNNWith2DAssignment(near),
        updater=updater,
        min_points=3,
    )

    def seen() -> Iterator[tuple[datetime, set[Any]]]:
        for index, (places, spreads) in enumerate(frames):
            now = start + timedelta(seconds=index * seconds)
            yield (
                now,
                {
                    Detection(place[:, None], timestamp=now, measurement_model=LinearGaussian(4, (0, 2), spread))
                    for place, spread in zip(places, spreads, strict=True)
                },
            )

    numbers: dict[str, int] = {}
    out = []
    for _, tracks in tracker(
        initiator, UpdateTimeStepsDeleter(6 if joint else 5), seen(), associator(hypothesiser), updater
    ):
        places = [(t.id, np.asarray(t.state_vector, dtype=float)[[0, 2], 0]) for t in tracks]
        out.append([(numbers.setdefault(name, len(numbers)), at) for name, at in places])
    return out


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
