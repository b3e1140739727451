"""A map during its run: landmarks are added, updated and merged, and all observations are kept for the refinement."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.landmarks.features import Features, to_bytes
from robocup_vision.landmarks.landmark_map import LandmarkMap
from robocup_vision.landmarks.mapping.refinement import Observations
from robocup_vision.landmarks.mapping.stereo import StereoPoints
from robocup_vision.landmarks.pose_fit import CHI2_3DOF

_CHUNK = 512
# greatest distance of two landmarks, and of their descriptors (unit vectors), that may be the same
_SAME_PLACE_M = 0.15
_SAME_LOOK = 0.45


def _none(*shape: int) -> FloatArray:
    return np.empty((0, *shape))


def _no_index() -> Int64Array:
    return np.empty(0, dtype=np.int64)


@dataclass(eq=False)
class DraftMap:
    """Growing arrays of a `LandmarkMap`, with the observations."""

    positions_m: FloatArray = field(default_factory=lambda: _none(3))
    covariances: FloatArray = field(default_factory=lambda: _none(3, 3))
    noise: FloatArray = field(default_factory=_none)
    seen: Int64Array = field(default_factory=_no_index)
    missed: Int64Array = field(default_factory=_no_index)
    last_frame: Int64Array = field(default_factory=_no_index)
    view_landmark: Int64Array = field(default_factory=_no_index)
    view_direction: Int64Array = field(default_factory=_no_index)
    view_descriptors: Float32Array = field(default_factory=lambda: np.empty((0, 128), dtype=np.float32))
    view_contrast: FloatArray = field(default_factory=_none)
    view_size_m: FloatArray = field(default_factory=_none)
    view_spacing_m: FloatArray = field(default_factory=_none)
    observations: Observations = field(
        default_factory=lambda: Observations(_no_index(), _no_index(), _none(4), _none())
    )
    _row: dict[tuple[int, int], int] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.positions_m)

    def add(self, positions_m: FloatArray, covariances: FloatArray, frame: int) -> Int64Array:
        """Add landmarks and return their indices."""
        count = len(positions_m)
        start = len(self)
        self.positions_m = np.concatenate([self.positions_m, positions_m])
        self.covariances = np.concatenate([self.covariances, covariances])
        self.noise = np.append(self.noise, np.ones(count))
        self.seen = np.append(self.seen, np.ones(count, dtype=np.int64))
        self.missed = np.append(self.missed, np.zeros(count, dtype=np.int64))
        self.last_frame = np.append(self.last_frame, np.full(count, frame))
        return np.arange(start, start + count)

    def note_views(self, landmarks: Int64Array, directions: Int64Array, features: Features, per_px: FloatArray) -> None:
        """Add views of landmarks; a view from a known direction replaces the earlier one.

        Parameters
        ----------
        landmarks, directions : (N,) int64
            Index of each view's landmark, and its direction, 0 to 35.
        features : Features
            The N features.
        per_px : (N,) float64
            Metres for each pixel at the landmark's distance.
        """
        keys = zip(landmarks.tolist(), directions.tolist(), strict=True)
        rows = np.array([self._row.setdefault(key, len(self._row)) for key in keys], dtype=np.int64)
        noted: dict[str, npt.NDArray[Any]] = {
            "view_landmark": landmarks,
            "view_direction": directions,
            "view_descriptors": features.descriptors,
            "view_contrast": features.contrast,
            "view_size_m": features.size_px * per_px,
            "view_spacing_m": features.spacing_px * per_px,
        }
        for name, values in noted.items():
            before = getattr(self, name)
            after: npt.NDArray[Any] = np.empty((len(self._row), *values.shape[1:]), dtype=values.dtype)
            if len(before):
                after[: len(before)] = before
            after[rows] = values
            setattr(self, name, after)

    def note_observations(self, landmarks: Int64Array, points: StereoPoints, frame: int) -> None:
        """Add observations of landmarks (N,) as N stereo points in a frame."""
        old = self.observations
        self.observations = Observations(
            np.append(old.frame, np.full(len(landmarks), frame)),
            np.append(old.landmark, landmarks),
            np.concatenate([old.measured_px, points.measured_px]),
            np.append(old.std_px, points.std_px),
        )
        self.last_frame[landmarks] = frame

    def merge_duplicates(self) -> None:
        """Merge landmarks with similar positions and descriptors that were never observed in the same frame."""
        pairs = self._alike()
        together: dict[int, set[int]] = {}
        for frame, landmark in zip(self.observations.frame.tolist(), self.observations.landmark.tolist(), strict=True):
            together.setdefault(landmark, set()).add(frame)
        into = np.arange(len(self))
        for i, j in pairs:
            a, b = int(into[i]), int(into[j])
            frames_a, frames_b = together.get(a, set()), together.get(b, set())
            if a == b or frames_a & frames_b:
                continue
            keep, drop = min(a, b), max(a, b)
            into[into == drop] = keep
            together[keep] = frames_a | frames_b
            weight = np.linalg.inv(self.covariances[[keep, drop]])
            self.covariances[keep] = np.linalg.inv(weight.sum(axis=0))
            self.positions_m[keep] = self.covariances[keep] @ (
                weight[0] @ self.positions_m[keep] + weight[1] @ self.positions_m[drop]
            )
            self.seen[keep] += self.seen[drop]
            self.missed[keep] = max(self.missed[keep], self.missed[drop])
            self.last_frame[keep] = max(self.last_frame[keep], self.last_frame[drop])
        kept = into == np.arange(len(self))
        self.view_landmark = into[self.view_landmark]
        self.observations = Observations(
            self.observations.frame,
            into[self.observations.landmark],
            self.observations.measured_px,
            self.observations.std_px,
        )
        self.keep(kept)

    def _alike(self) -> list[tuple[int, int]]:
        """Return pairs of landmarks with similar positions and descriptors, the nearest first."""
        count = len(self)
        look = np.zeros((count, self.view_descriptors.shape[1]), dtype=np.float32)
        look[self.view_landmark] = self.view_descriptors  # the last of several views counts
        found: list[tuple[float, int, int]] = []
        square = (self.positions_m**2).sum(axis=1)
        for low in range(0, count, _CHUNK):
            high = min(low + _CHUNK, count)
            apart2 = square[low:high, None] + square[None] - 2 * self.positions_m[low:high] @ self.positions_m.T
            i, j = np.nonzero(apart2 < _SAME_PLACE_M**2)
            i += low
            i, j = i[i < j], j[i < j]
            i, j = (index[(look[i] * look[j]).sum(axis=1) > 1 - _SAME_LOOK**2 / 2] for index in (i, j))
            offset = self.positions_m[i] - self.positions_m[j]
            weight = np.linalg.inv(self.covariances[i] + self.covariances[j])
            squared = np.einsum("ni,nij,nj->n", offset, weight, offset)
            near = squared < CHI2_3DOF
            found += zip(squared[near].tolist(), i[near].tolist(), j[near].tolist(), strict=True)
        return [(i, j) for _, i, j in sorted(found)]

    def keep(self, kept: np.ndarray[tuple[int, ...], np.dtype[np.bool_]]) -> None:
        """Keep the landmarks of a mask (L,), and drop the others with their views and observations."""
        number = np.cumsum(kept) - 1
        for name in ("positions_m", "covariances", "noise", "seen", "missed", "last_frame"):
            setattr(self, name, getattr(self, name)[kept])
        rows = kept[self.view_landmark]
        # a merged landmark may have two views from one direction: the later one is kept
        latest = {
            (int(landmark), int(direction)): int(r)
            for r, landmark, direction in zip(
                np.flatnonzero(rows), self.view_landmark[rows], self.view_direction[rows], strict=True
            )
        }
        chosen = np.array(sorted(latest.values()), dtype=np.int64)
        for name in ("view_direction", "view_descriptors", "view_contrast", "view_size_m", "view_spacing_m"):
            setattr(self, name, getattr(self, name)[chosen])
        self.view_landmark = number[self.view_landmark[chosen]]
        self._row = {
            (int(landmark), int(direction)): r
            for r, (landmark, direction) in enumerate(zip(self.view_landmark, self.view_direction, strict=True))
        }
        s = self.observations.take(kept[self.observations.landmark])
        self.observations = Observations(s.frame, number[s.landmark], s.measured_px, s.std_px)

    def finished(self, trajectory: FloatArray, trajectory_cov: FloatArray) -> LandmarkMap:
        """Return a copy as a `LandmarkMap`."""
        return LandmarkMap(
            self.positions_m.copy(),
            (self.covariances + self.covariances.transpose(0, 2, 1)) / 2,
            self.noise.copy(),
            self.seen.copy(),
            self.missed.copy(),
            self.view_landmark.copy(),
            self.view_direction.copy(),
            to_bytes(self.view_descriptors),
            self.view_contrast.copy(),
            self.view_size_m.copy(),
            self.view_spacing_m.copy(),
            trajectory.copy(),
            (trajectory_cov + trajectory_cov.transpose(0, 2, 1)) / 2,
        )
