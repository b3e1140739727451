"""The branches of all track trees as arrays: predicted, split over the detections, and pruned together."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.geometry import FloatArray

IntArray = npt.NDArray[np.int64]

# squared Mahalanobis distance of a detection that may still belong to a branch: chi-square, 2 degrees, 99.9 %
_GATE = 13.8
# branches this much less likely than their tree's best are given up
_LEAST_LOG_SHARE = 7.0
# frames after which a choice between branches is final, and over which equal branches are one
_MEMORY = 5
_MISS = -1


@dataclass(frozen=True, slots=True, eq=False)
class Branches:
    """Branches of track trees.

    Parameters
    ----------
    tree : (L,) int64
        Which tree each belongs to.
    mean : (L, 4) float64
        x, y, vx, vy in the field frame, m and m/s.
    covariance : (L, 4, 4) float64
        Of these.
    score : (L,) float64
        Log-likelihood ratio of the branch against clutter.
    coasted_s : (L,) float64
        Seconds since the last detection.
    missed : (L,) int64
        Frames since then.
    history : (L, 5) int64
        The last detections, newest first, by their running number; -1 where missed.
    """

    tree: IntArray
    mean: FloatArray
    covariance: FloatArray
    score: FloatArray
    coasted_s: FloatArray
    missed: IntArray
    history: IntArray

    def __len__(self) -> int:
        return len(self.tree)

    @classmethod
    def begun(
        cls, trees: IntArray, places_m: FloatArray, spreads: FloatArray, speed_mps: float, detections: IntArray
    ) -> Branches:
        """One branch for each tree that begins at a detection."""
        count = len(trees)
        mean = np.zeros((count, 4))
        mean[:, :2] = places_m
        covariance = np.zeros((count, 4, 4))
        covariance[:, :2, :2] = spreads
        covariance[:, 2, 2] = covariance[:, 3, 3] = speed_mps**2
        history = np.full((count, _MEMORY), _MISS, dtype=np.int64)
        history[:, 0] = detections
        zeros = np.zeros(count)
        return cls(trees, mean, covariance, zeros, zeros.copy(), np.zeros(count, dtype=np.int64), history)

    def taken(self, chosen: IntArray) -> Branches:
        """Those of the given indices, in their order."""
        return Branches(
            self.tree[chosen],
            self.mean[chosen],
            self.covariance[chosen],
            self.score[chosen],
            self.coasted_s[chosen],
            self.missed[chosen],
            self.history[chosen],
        )

    def joined(self, other: Branches) -> Branches:
        """These and those."""
        return Branches(
            np.concatenate([self.tree, other.tree]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.covariance, other.covariance]),
            np.concatenate([self.score, other.score]),
            np.concatenate([self.coasted_s, other.coasted_s]),
            np.concatenate([self.missed, other.missed]),
            np.concatenate([self.history, other.history]),
        )

    def predicted(self, seconds: float, acceleration_mps2: float) -> Branches:
        """All of them `seconds` later, with a white acceleration of this standard deviation."""
        move = np.eye(4)
        move[0, 2] = move[1, 3] = seconds
        push = np.array([[seconds**2 / 2, 0.0], [0.0, seconds**2 / 2], [seconds, 0.0], [0.0, seconds]])
        noise = push @ push.T * acceleration_mps2**2
        return Branches(
            self.tree,
            self.mean @ move.T,
            move @ self.covariance @ move.T + noise,
            self.score,
            self.coasted_s + seconds,
            self.missed,
            self.history,
        )

    def split(
        self,
        places_m: FloatArray,
        spreads: FloatArray,
        numbers: IntArray,
        detection_probability: FloatArray,
        clutter_per_m2: float,
    ) -> Branches:
        """One branch for each detection within the gate of each of these, and one for each that is missed.

        Parameters
        ----------
        places_m, spreads : (M, 2) and (M, 2, 2) float64
            Detections in the field frame and their covariances.
        numbers : (M,) int64
            Their running numbers.
        detection_probability : (L,) float64
            That an object at the branch is detected.
        clutter_per_m2 : float
            False detections a frame and square metre.
        """
        count = len(self)
        history = np.concatenate([np.full((count, 1), _MISS, dtype=np.int64), self.history[:, :-1]], axis=1)
        missed = Branches(
            self.tree,
            self.mean,
            self.covariance,
            self.score + np.log1p(-detection_probability),
            self.coasted_s,
            self.missed + 1,
            history,
        )
        away = places_m[None, :, :] - self.mean[:, None, :2]
        spread = self.covariance[:, None, :2, :2] + spreads[None]
        a, b, d = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
        determinant = a * d - b * b
        distance = (d * away[..., 0] ** 2 - 2 * b * away[..., 0] * away[..., 1] + a * away[..., 1] ** 2) / determinant
        branch, detection = np.nonzero(distance < _GATE)
        if not len(branch):
            return missed
        a, b, d, area = (v[branch, detection] for v in (a, b, d, determinant))
        inverse = np.stack([np.stack([d, -b], -1), np.stack([-b, a], -1)], -2) / area[:, None, None]
        covariance = self.covariance[branch]
        gain = covariance[:, :, :2] @ inverse
        likelihood = -0.5 * distance[branch, detection] - 0.5 * np.log(area) - math.log(math.tau)
        history = history[branch]
        history[:, 0] = numbers[detection]
        hit = Branches(
            self.tree[branch],
            self.mean[branch] + np.einsum("nij,nj->ni", gain, away[branch, detection]),
            covariance - gain @ covariance[:, :2, :],
            self.score[branch] + likelihood + np.log(detection_probability[branch] / clutter_per_m2),
            np.zeros(len(branch)),
            np.zeros(len(branch), dtype=np.int64),
            history,
        )
        return missed.joined(hit)

    def pruned(self, most: int) -> Branches:
        """The best of each tree: likely ones, that agree on what is long past, no two alike, at most so many."""
        order = np.lexsort((-self.score, self.tree))
        kept: list[int] = []
        tree, seen, best, root, count = -1, set(), 0.0, 0, 0
        for index in order.tolist():
            if self.tree[index] != tree:
                tree, best, root, count = int(self.tree[index]), self.score[index], int(self.history[index, -1]), 0
                seen = set()
            recent = self.history[index].tobytes()
            unlikely = self.score[index] < best - _LEAST_LOG_SHARE
            if count >= most or unlikely or recent in seen or self.history[index, -1] != root:
                continue
            seen.add(recent)
            kept.append(index)
            count += 1
        return self.taken(np.array(kept, dtype=np.int64))

    def best_compatible(self) -> tuple[IntArray, IntArray]:
        """Each tree's best branch such that no two share a present detection, strongest trees first.

        Returns
        -------
        (B,) int64
            Their indices.
        (D,) int64
            Trees left over because all their branches see only what stronger trees see, and have for long.
        """
        used: set[int] = set()
        chosen, left_over = [], []
        starts = np.flatnonzero(np.diff(self.tree, prepend=-1))
        ends = np.append(starts[1:], len(self))
        recent: dict[int, bytes] = {}
        for group in sorted(range(len(starts)), key=lambda g: -self.score[starts[g]]):
            indices = range(int(starts[group]), int(ends[group]))
            pick = next((i for i in indices if self.history[i, 0] == _MISS or int(self.history[i, 0]) not in used), -1)
            first = int(starts[group])
            alike = self.history[first].tobytes()
            if int(self.history[first, 0]) in used and recent.get(int(self.history[first, 0])) == alike:
                left_over.append(int(self.tree[first]))
                continue
            if pick < 0:
                pick = first
            chosen.append(pick)
            newest = int(self.history[pick, 0])
            if newest != _MISS:
                used.add(newest)
                recent[newest] = self.history[pick].tobytes()
        return np.array(chosen, dtype=np.int64), np.array(left_over, dtype=np.int64)
