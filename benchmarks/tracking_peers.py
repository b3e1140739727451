"""What tracking.py compares with: a global nearest neighbour, and stonesoup's GNN and JPDA, on the same detections.

The global nearest neighbour has the same Kalman filter, noise and detections as `MovingObjects`. Tracks begin with any
detection that none has, are reported once `hits` of `window` frames had one, and end after `patience` misses in a row.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np
from scipy.optimize import linear_sum_assignment

from robocup_vision.geometry import FloatArray

Reports = list[tuple[int, FloatArray]]


@dataclass
class _Track:
    number: int
    mean: FloatArray
    covariance: FloatArray
    hits: list[bool]
    believed: bool = False


@dataclass
class NearestNeighbours:
    """A global nearest neighbour."""

    acceleration_mps2: float = 1.5
    speed_mps: float = 0.7
    hits: int = 3
    window: int = 4
    patience: int = 8
    gate: float = 13.8
    tracks: list[_Track] = field(default_factory=list)
    count: int = 0

    def update(self, seconds: float, places_m: FloatArray, spreads: FloatArray) -> Reports:
        """Take detections (M, 2) and covariances (M, 2, 2) in the field frame; (number, place) of each track."""
        move = np.eye(4)
        move[0, 2] = move[1, 3] = seconds
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
            track.believed |= sum(track.hits[-self.window :]) >= self.hits
        self.tracks = [t for t in self.tracks if any(t.hits[-(self.patience if t.believed else 2) :])]
        for j in sorted(free):
            self.count += 1
            covariance = np.diag([0.0, 0.0, self.speed_mps**2, self.speed_mps**2])
            covariance[:2, :2] = spreads[j]
            self.tracks.append(_Track(self.count, np.array([*places_m[j], 0.0, 0.0]), covariance, [True]))
        return [(t.number, t.mean[:2]) for t in self.tracks if t.believed]
