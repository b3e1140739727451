"""The branches of all track trees as arrays: predicted, split over the detections, and pruned."""

from __future__ import annotations

import math
from collections.abc import Set
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.tracking.settings import MovingObjectsSettings
from robocup_vision.tracking.shadows import Shadows

MISS = -1
# points of a normal distribution and their weights: Gauss-Hermite, three on each axis
_AXIS, _AXIS_WEIGHTS = np.array([-math.sqrt(3.0), 0.0, math.sqrt(3.0)]), np.array([1.0, 4.0, 1.0]) / 6.0
_POINTS = np.stack(np.meshgrid(_AXIS, _AXIS, indexing="ij"), axis=-1).reshape(-1, 2)
_WEIGHTS = np.outer(_AXIS_WEIGHTS, _AXIS_WEIGHTS).ravel()


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
    evidence : (L,) float64
        Log-likelihood ratio of all its detections and misses against clutter.
    odds : (L,) float64
        Logarithm of the odds that the object is still there.
    coasted_s : (L,) float64
        Seconds since the last detection.
    missed : (L,) int64
        Frames since then.
    history : (L, H) int64
        The last detections, newest first, by their running number; -1 where missed.
    """

    tree: Int64Array
    mean: FloatArray
    covariance: FloatArray
    evidence: FloatArray
    odds: FloatArray
    coasted_s: FloatArray
    missed: Int64Array
    history: Int64Array

    def __len__(self) -> int:
        return len(self.tree)

    @classmethod
    def initiated(
        cls,
        trees: Int64Array,
        places_m: FloatArray,
        spreads: FloatArray,
        detections: Int64Array,
        settings: MovingObjectsSettings,
    ) -> Branches:
        """Return one branch for each tree that begins at a detection."""
        count = len(trees)
        mean = np.zeros((count, 4))
        mean[:, :2] = places_m
        covariance = np.zeros((count, 4, 4))
        covariance[:, :2, :2] = spreads
        covariance[:, 2, 2] = covariance[:, 3, 3] = settings.speed_mps**2
        history = np.full((count, settings.history_frames), MISS, dtype=np.int64)
        history[:, 0] = detections
        first, zeros, never = np.full(count, settings.first_log_odds), np.zeros(count), np.zeros(count, dtype=np.int64)
        return cls(trees, mean, covariance, first, first.copy(), zeros, never, history)

    def select(self, chosen: Int64Array) -> Branches:
        """Those of the given indices, in their order."""
        return Branches(
            self.tree[chosen],
            self.mean[chosen],
            self.covariance[chosen],
            self.evidence[chosen],
            self.odds[chosen],
            self.coasted_s[chosen],
            self.missed[chosen],
            self.history[chosen],
        )

    def without(self, trees: Set[int]) -> Branches:
        """Those of all other trees."""
        return self.select(
            np.array([n for n, tree in enumerate(self.tree.tolist()) if tree not in trees], dtype=np.int64)
        )

    def concatenate(self, other: Branches) -> Branches:
        """Join these and those."""
        return Branches(
            np.concatenate([self.tree, other.tree]),
            np.concatenate([self.mean, other.mean]),
            np.concatenate([self.covariance, other.covariance]),
            np.concatenate([self.evidence, other.evidence]),
            np.concatenate([self.odds, other.odds]),
            np.concatenate([self.coasted_s, other.coasted_s]),
            np.concatenate([self.missed, other.missed]),
            np.concatenate([self.history, other.history]),
        )

    def predicted(self, seconds: float, settings: MovingObjectsSettings) -> Branches:
        """Return all of them `seconds` after the last frame."""
        steady_s = settings.steady_s
        kept = math.exp(-seconds / steady_s)
        move = np.eye(4)
        move[0, 2] = move[1, 3] = steady_s * (1 - kept)
        move[2, 2] = move[3, 3] = kept
        push = np.array([[seconds**2 / 2, 0.0], [0.0, seconds**2 / 2], [seconds, 0.0], [0.0, seconds]])
        noise = push @ push.T * settings.acceleration_mps2**2
        survival = math.exp(-seconds / settings.lifetime_s)
        return Branches(
            self.tree,
            self.mean @ move.T,
            move @ self.covariance @ move.T + noise,
            self.evidence,
            # log(p s / (1 - p s)) of the probability p with which it was there, s that it stays
            -np.log(np.exp(-self.odds) / survival + (1 / survival - 1)),
            self.coasted_s + seconds,
            self.missed,
            self.history,
        )

    def split(
        self,
        places_m: FloatArray,
        spreads: FloatArray,
        numbers: Int64Array,
        view: Shadows,
        settings: MovingObjectsSettings,
    ) -> Branches:
        """Return one branch for each detection within the gate of each of these, and one for each that is missed.

        Parameters
        ----------
        places_m, spreads : (M, 2) and (M, 2, 2) float64
            Detections in the field frame and their covariances.
        numbers : (M,) int64
            Their running numbers.
        view : Shadows
            What hides what in this frame.
        settings : MovingObjectsSettings
            With the gate, the probability of detection and the clutter.
        """
        missed = self._missed(view, settings)
        away = places_m[None, :, :] - self.mean[:, None, :2]
        spread = self.covariance[:, None, :2, :2] + spreads[None]
        a, b, d = spread[..., 0, 0], spread[..., 0, 1], spread[..., 1, 1]
        determinant = a * d - b * b
        distance = (d * away[..., 0] ** 2 - 2 * b * away[..., 0] * away[..., 1] + a * away[..., 1] ** 2) / determinant
        branch, detection = np.nonzero(distance < settings.gate)
        if not len(branch):
            return missed
        a, b, d, area = (v[branch, detection] for v in (a, b, d, determinant))
        inverse = np.stack([np.stack([d, -b], -1), np.stack([-b, a], -1)], -2) / area[:, None, None]
        covariance = self.covariance[branch]
        gain = covariance[:, :, :2] @ inverse
        likelihood = -0.5 * distance[branch, detection] - 0.5 * np.log(area) - math.log(math.tau)
        gained = likelihood + math.log(settings.detection_probability / settings.clutter_per_m2)
        history = missed.history[branch]
        history[:, 0] = numbers[detection]
        hit = Branches(
            self.tree[branch],
            self.mean[branch] + np.einsum("nij,nj->ni", gain, away[branch, detection]),
            covariance - gain @ covariance[:, :2, :],
            self.evidence[branch] + gained,
            self.odds[branch] + gained,
            np.zeros(len(branch)),
            np.zeros(len(branch), dtype=np.int64),
            history,
        )
        both = missed.concatenate(hit)
        return both.select(np.argsort(both.tree, kind="stable"))

    def _missed(self, view: Shadows, settings: MovingObjectsSettings) -> Branches:
        """Return each of these without a detection: the object is rather where it would not be detected.

        The place's density is weighted at points around its mean and made normal again; velocities follow by their
        covariance with it.
        """
        count = len(self)
        place = self.covariance[:, :2, :2]
        root = np.zeros_like(place)
        root[:, 0, 0] = np.sqrt(place[:, 0, 0])
        root[:, 1, 0] = place[:, 1, 0] / root[:, 0, 0]
        root[:, 1, 1] = np.sqrt(np.maximum(place[:, 1, 1] - root[:, 1, 0] ** 2, 1e-12))
        offsets = np.einsum("lij,pj->lpi", root, _POINTS)
        missing = 1 - settings.detection_probability * view.visible_ratio(self.mean[:, None, :2] + offsets)
        weights = _WEIGHTS * missing
        likelihood = weights.sum(axis=1)
        weights /= likelihood[:, None]
        shift = np.einsum("lp,lpi->li", weights, offsets)
        centred = offsets - shift[:, None]
        spread = np.einsum("lp,lpi,lpj->lij", weights, centred, centred)
        # nine points show no smaller spread
        spread += settings.unknown_ratio * place
        a, b, d = place[:, 0, 0], place[:, 0, 1], place[:, 1, 1]
        inverse = np.stack([np.stack([d, -b], -1), np.stack([-b, a], -1)], -2) / (a * d - b * b)[:, None, None]
        gain = self.covariance[:, :, :2] @ inverse
        return Branches(
            self.tree,
            self.mean + np.einsum("lij,lj->li", gain, shift),
            self.covariance + gain @ (spread - place) @ gain.transpose(0, 2, 1),
            self.evidence + np.log(likelihood),
            self.odds + np.log(likelihood),
            self.coasted_s,
            self.missed + 1,
            np.concatenate([np.full((count, 1), MISS, dtype=np.int64), self.history[:, :-1]], axis=1),
        )

    def pruned(self, chosen: Int64Array, settings: MovingObjectsSettings) -> Branches:
        """Keep the best branches of the chosen ones' trees.

        A branch is kept if it is likely, agrees with the chosen one on the oldest detection, and is not equal to one
        that is kept already, up to `max_branches` of each tree.
        """
        root = {int(self.tree[i]): int(self.history[i, -1]) for i in chosen}
        best = {int(self.tree[i]): float(self.evidence[i]) for i in chosen}
        order = np.lexsort((-self.evidence, self.tree)).tolist()
        picked = set(chosen.tolist())
        kept: list[int] = []
        count: dict[int, int] = {}
        seen: set[tuple[int, bytes]] = {(int(self.tree[i]), self.history[i].tobytes()) for i in chosen}
        for index in order:
            tree = int(self.tree[index])
            if tree not in root:
                continue
            if index not in picked:
                recent = (tree, self.history[index].tobytes())
                unlikely = self.evidence[index] < best[tree] - settings.max_log_ratio
                is_full = count.get(tree, 1) >= settings.max_branches
                if unlikely or recent in seen or self.history[index, -1] != root[tree] or is_full:
                    continue
                seen.add(recent)
                count[tree] = count.get(tree, 1) + 1
            kept.append(index)
        return self.select(np.array(kept, dtype=np.int64))
