"""Search over the whole field for the pose of a floor's outline: a bank of places, and fits from the best."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robocup_vision.arrays import FloatArray, Int16Array, Int64Array
from robocup_vision.compiling.loops import plain
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.walls import fit as kernels
from robocup_vision.kernels.walls import search as wall_search
from robocup_vision.localization.distinct import Apart, may_be_one
from robocup_vision.localization.outline_model import OutlineFit, OutlineModel

# bearings of the bank's outlines, number of places to fit, and truncation of a difference, units
BANK_BEARINGS = 80
_BANK_STARTS = 30
_BANK_WIDTH = 12.0
_APART = Apart(0.1, 0.1, twins=True)  # least distance of two fits to refine, and of two places
# widths of the redescending weights, units: for all starts, and for the best of their fits
_ROUGH_SCALES = (8.0, 6.0, 4.0)
FINE_SCALES = (3.0, 2.0, 1.0, 1.0)
_REFINED = 16  # number of fits refined with `FINE_SCALES`


@dataclass(frozen=True, eq=False)
class OutlineSearch:
    """Searches the whole field for the pose of an outline."""

    model: OutlineModel

    def candidates(self, fit: OutlineFit, radius_px: FloatArray) -> list[OutlineFit]:
        """Return fits to an outline (K,) from another fit, from all over the field, and from along its walls."""
        found = np.empty((_REFINED, 3))
        count = wall_search.search_outline(fit.pose, radius_px, self._rules, found)
        model, scales = self.model, self.model.scales(FINE_SCALES)
        starts = [fit.pose, *((x, y, theta) for x, y, theta in found[:count].tolist())]
        # with errors of the camera, wrong places would fit better
        return [model.fit(start, radius_px, scales, trusts_file=True)[0] for start in starts]

    def may_be_one(self, fit: OutlineFit, other: OutlineFit) -> bool:
        """Whether two fits may be of the same place, up to a half turn, by the covariance of `other`."""
        pose, place = Pose2(*fit.pose), Pose2(*other.pose)
        if _APART.is_one(pose, place):
            return True
        return any(may_be_one(one, place, other.covariance) for one in (pose, pose.half_turn()))

    @cached_property
    def _rules(self) -> wall_search.SearchRules:
        """The parameters of the compiled search."""
        model = self.model
        return plain(
            wall_search.SearchRules(
                model.scene,
                *model.radius_of_q,
                model.unit_px,
                *self._bank,
                self._bank_rows,
                self._px_per_level,
                *self._ways,
                np.array(_ROUGH_SCALES) * model.unit_px,
                _BANK_STARTS,
                _APART.m,
                _APART.rad,
            )
        )

    @property
    def _px_per_level(self) -> float:
        """Pixels for each level of the bank's outlines."""
        return _BANK_WIDTH * self.model.unit_px / int(wall_search.MAX_DIFFERENCE)

    @property
    def _ways(self) -> tuple[FloatArray, FloatArray]:
        """Positions along and across the field."""
        floor = self.model.field.floor_polygon
        low, high = floor.min(axis=0), floor.max(axis=0)
        return np.linspace(low[0], high[0], 15)[1:-1], np.linspace(low[1], high[1], 9)[1:-1]

    @property
    def _bank_rows(self) -> Int64Array:
        """(B,) int64: indices of the outline's bearings that are nearest to those of the bank."""
        count, rows = BANK_BEARINGS, len(self.model.view.bearing_rad)
        return np.asarray(np.rint(np.arange(count) * (rows / count)).astype(np.int64) % rows)

    @property
    def _bank(self) -> tuple[FloatArray, Int16Array]:
        """Places (P, 2) over half the field, and the expected outlines (P, 2 B) there, in levels."""
        model = self.model
        floor = model.field.floor_polygon
        spacing = float(np.ptp(floor, axis=0).min()) / 15
        low, high = floor.min(axis=0), floor.max(axis=0)
        x, y = (_between_walls(*ends, spacing) for ends in zip(low, high, strict=True))
        # half the field suffices, because the outlines of the other half are the same, turned
        x, y = np.meshgrid(x[x >= 0.0], y)
        places = np.stack([x.ravel(), y.ravel()], axis=1)
        places = places[model.field.contains(places)]
        bearings = np.arange(BANK_BEARINGS) * (math.tau / BANK_BEARINGS)
        q, wall = np.empty(len(bearings)), np.empty(len(bearings), dtype=np.int64)
        out = kernels.WallPrediction(q, wall, np.empty((len(model.scene.walls), 4)))
        scene = model.scene._replace(cos_b=np.cos(bearings), sin_b=np.sin(bearings))
        q_step, radius = model.radius_of_q
        profiles = np.empty((len(places), len(bearings)), dtype=np.int16)
        for place, profile in zip(places, profiles, strict=True):
            kernels.predict_walls(np.array([*place, 0.0]), scene, out)
            profile[:] = np.rint(np.interp(q, np.arange(len(radius)) * q_step, radius) / self._px_per_level)
        # clockwise, as in `sum_differences`
        profiles = np.roll(profiles[:, ::-1], 1, axis=1)
        return places, np.hstack([profiles, profiles])


def _between_walls(low_m: float, high_m: float, spacing_m: float) -> FloatArray:
    """Return coordinates (N,) between two walls, spaced by the distance to the nearer wall, at most by `spacing_m`.

    A step changes a wall's foot in the picture by the ratio of its distances.
    """
    away_m, steps = spacing_m / 4, []
    while away_m < (high_m - low_m) / 2:
        steps.append(away_m)
        away_m += min(away_m, spacing_m)
    return np.array([*(low_m + one for one in steps), *(high_m - one for one in reversed(steps))])
