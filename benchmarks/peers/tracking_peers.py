"""What tracking.py compares with: a global nearest neighbour, and stonesoup's GNN and JPDA, on the same detections.

The global nearest neighbour has the same Kalman filter, noise and detections as `MovingObjects`. Tracks begin with any
detection that none has, are reported once `hits` of `window` frames had one, and end after `patience` misses in a row.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from robocup_vision.arrays import FloatArray

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
    """A global nearest neighbour."""

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
