"""Looks for a floor's outline over the whole field: a bank of places, fitted ever more finely, and what may rival."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robocup_vision.arrays import Float32Array, FloatArray, Int64Array
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls import fit as kernels
from robocup_vision.kernels.walls import search as wall_search
from robocup_vision.kernels.walls.fit import Vector
from robocup_vision.localization.outline_model import OutlineFit, OutlineModel

Arbiter = Callable[[list[Pose2]], int | None]


@dataclass(frozen=True, slots=True)
class OutlineSearchSettings:
    """Settings of `OutlineSearch`; "units" are 1/86 of the usable image radius.

    Parameters
    ----------
    bank_bearings, bank_starts, bank_width : int, int, float
        Bearings that outlines are compared at over the whole field, how many places go on, and where a difference is
        truncated, units.
    start_apart, fit_apart, rival_apart : float
        Starts, fits and rivals nearer to each other, metres plus radians, are one.
    rough_scales, coarse_scales, fine_scales : tuple of float
        Widths of the redescending weights, units: from all starts, from the likely ones, and from what they found.
    likely, refined : int
        How many starts go on to `coarse_scales`, and how many of those to `fine_scales`.
    hopeless_cost : float
        A coarse fit costlier by so much than the best is not refined.
    rival_cost, equal_cost : float
        Fits whose costs differ less than this explain the outline about equally well; so close, none is preferred.
    """

    bank_bearings: int = 80
    bank_starts: int = 30
    bank_width: float = 12.0
    start_apart: float = 0.15
    fit_apart: float = 0.03
    rival_apart: float = 0.05
    rough_scales: tuple[float, ...] = (8.0, 6.0, 4.0)
    coarse_scales: tuple[float, ...] = (2.0,)
    fine_scales: tuple[float, ...] = (3.0, 2.0, 1.0, 1.0)
    likely: int = 24
    refined: int = 8
    hopeless_cost: float = 0.3
    rival_cost: float = 0.08
    equal_cost: float = 0.002


@dataclass(frozen=True, eq=False)
class OutlineSearch:
    """Searches the whole field for the pose that an outline was seen from.

    Parameters
    ----------
    model : OutlineModel
        What the outline is compared with.
    settings : OutlineSearchSettings
        Of the search.
    """

    model: OutlineModel
    settings: OutlineSearchSettings

    def improve(self, fit: OutlineFit, radius_px: FloatArray, arbiter: Arbiter | None) -> OutlineFit | None:
        """Look for a better fit over the whole field, and by sliding along the walls that already agree.

        None where several places explain the outline (K,) equally well; see `OutlineFitter.locate` for the arbiter.
        """
        settings, model = self.settings, self.model
        starts = np.vstack([self._starts(radius_px), self._slides(fit.pose)])
        half_px = radius_px[::2].copy()
        poses, costs = self._fit_each(
            starts, model.half_scene, half_px, np.array(settings.rough_scales) * model.unit_px
        )
        likely = _apart(poses[np.argsort(costs)], settings.fit_apart, settings.likely)
        poses, costs = self._fit_each(likely, model.half_scene, half_px, model.scales(settings.coarse_scales))
        hopeful = poses[np.argsort(costs)][: np.count_nonzero(costs < costs.min() + settings.hopeless_cost)]
        last, scales = _apart(hopeful, settings.fit_apart, settings.refined), model.scales(settings.fine_scales)
        poses, costs = self._fit_each(last, model.scene, radius_px, scales)
        chosen = self._choose(np.vstack([fit.pose, poses]), np.append(fit.cost, costs), arbiter)
        if not chosen:
            return fit if chosen == 0 else None
        x, y, theta = last[chosen - 1].tolist()
        return model.fit((x, y, theta), radius_px, scales)[0]

    def _choose(self, poses: FloatArray, costs: FloatArray, arbiter: Arbiter | None) -> int | None:
        """Return the index of the right one of some fits (N, 3); None where several explain the outline as well."""
        settings, most = self.settings, costs.min() + self.settings.rival_cost
        order = np.argsort(costs, kind="stable")
        order = order[costs[order] < most]
        rivals: list[int] = order[_spread(poses[order], settings.rival_apart, len(order))].tolist()
        if len(rivals) == 1:
            return rivals[0]
        chosen = None if arbiter is None else arbiter([Pose2(*poses[n].tolist()) for n in rivals])
        if chosen is not None:
            return rivals[chosen]
        return None if costs[rivals[1]] < costs[rivals[0]] + settings.equal_cost else rivals[0]

    def _fit_each(
        self, starts: FloatArray, scene: kernels.WallScene, radius_px: FloatArray, scales: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Fit each of the starts (N, 3) to an outline at a scene's bearings; return poses (N, 3) and costs (N,)."""
        poses, costs = np.empty_like(starts), np.empty(len(starts))
        wall_search.fit_each(starts, scene, self.model.outline(radius_px, scales), poses, costs)
        return poses, costs

    def _slides(self, pose: Vector) -> FloatArray:
        """Return poses (N, 3) along and across the field from a pose x, y, theta, of its heading."""
        along, across = self._ways
        poses = np.empty((len(along) + len(across), 3))
        poses[:] = pose
        poses[: len(along), 0], poses[len(along) :, 1] = along, across
        return poses

    @cached_property
    def _ways(self) -> tuple[FloatArray, FloatArray]:
        """Places along, and across the field."""
        floor = self.model.field.floor_polygon
        low, high = floor.min(axis=0), floor.max(axis=0)
        return np.linspace(low[0], high[0], 15)[1:-1], np.linspace(low[1], high[1], 9)[1:-1]

    @cached_property
    def _bank_rows(self) -> Int64Array:
        """(B,) int64: which of the outline's bearings are nearest to those of the bank."""
        count, rows = self.settings.bank_bearings, len(self.model.view.bearing_rad)
        return np.asarray(np.rint(np.arange(count) * (rows / count)).astype(np.int64) % rows)

    @cached_property
    def _bank(self) -> tuple[FloatArray, Float32Array]:
        """Places (P, 2) over half the field, and the outlines (P, 2 B) to be seen there."""
        model = self.model
        floor = model.field.floor_polygon
        spacing = float(np.ptp(floor, axis=0).min()) / 15
        low, high = floor.min(axis=0), floor.max(axis=0)
        # half the places do: the outline of the other half is the same, turned
        x, y = np.meshgrid(np.arange(spacing / 2, high[0], spacing), np.arange(low[1] + spacing / 2, high[1], spacing))
        places = np.stack([x.ravel(), y.ravel()], axis=1)
        places = places[model.field.contains(places)]
        bearings = np.arange(self.settings.bank_bearings) * (math.tau / self.settings.bank_bearings)
        q, wall = np.empty(len(bearings)), np.empty(len(bearings), dtype=np.int64)
        out = kernels.WallPrediction(q, wall, np.empty((len(model.scene.walls), 4)))
        scene = model.scene._replace(cos_b=np.cos(bearings), sin_b=np.sin(bearings))
        q_step, radius = model.radius_of_q
        profiles = np.empty((len(places), len(bearings)), dtype=np.float32)
        for place, profile in zip(places, profiles, strict=True):
            kernels.predict_walls(np.array([*place, 0.0]), scene, out)
            profile[:] = np.interp(q, np.arange(len(radius)) * q_step, radius)
        # clockwise, as `score_bank` takes them
        profiles = np.roll(profiles[:, ::-1], 1, axis=1)
        return places, np.hstack([profiles, profiles])

    def _starts(self, radius_px: FloatArray) -> FloatArray:
        """Poses (N, 3) whose expected outline is most like the measured one, over the whole field and all headings."""
        (places, profiles), settings = self._bank, self.settings
        count = settings.bank_bearings
        radius = radius_px[self._bank_rows]
        known = np.isfinite(radius)
        weight = (known / max(np.count_nonzero(known), 1)).astype(np.float32)
        cost = np.empty((len(places), count), dtype=np.float32)
        width_px = np.float32(settings.bank_width * self.model.unit_px)
        wall_search.score_bank(profiles, np.where(known, radius, 0.0).astype(np.float32), weight, width_px, cost)
        most = min(10 * settings.bank_starts, cost.size)
        best = np.argpartition(cost, most - 1, axis=None)[:most]
        best = best[np.argsort(cost.ravel()[best])]
        place, shift = np.divmod(best, count)
        poses = np.empty((len(best), 3))
        poses[:, :2], poses[:, 2] = places[place], -shift * math.tau / count
        return _apart(poses, settings.start_apart, settings.bank_starts)


def _spread(poses: FloatArray, apart: float, most: int) -> Int64Array:
    """Return the indices (N,) of some poses, the best first, that are not what a better one is."""
    picked = np.empty(most, dtype=np.int64)
    return picked[: wall_search.spread_poses(poses, apart, picked)]


def _apart(poses: FloatArray, apart: float, most: int) -> FloatArray:
    """Return those poses (N, 3) that `_spread` picks."""
    return np.asarray(poses[_spread(poses, apart, most)])
