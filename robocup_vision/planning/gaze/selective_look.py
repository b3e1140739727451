"""Chooses which undecided floor to look at again (Miura and Shirai 2004, section 4.1).

Only floor on the way matters. The shortest path is planned as if all undecided cells were free. The robot looks at the
first undecided region on it, until no look from here can decide more of the path.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import BoolArray, FloatArray, read_only
from robocup_vision.checks import as_positive
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.kernels.motion.way_grid import find_way

Answer = Literal["look", "go", "blocked"]
# extra cost of a cell near undecided floor, so that the better known one of two equally long paths is taken
_UNSURE_COST = 1e-3
# a new path must be shorter than the last one by this fraction to replace it, so that looks already taken are used
_SWITCH_RATIO = 0.05
# number of looks after which an undecided place is given up until the robot has moved: further looks add little
_MAX_LOOKS = 2
_ELSEWHERE_M = 0.3  # distance from its last look at which the robot has another view


@dataclass(frozen=True, slots=True, eq=False)
class SelectedLook:
    """A place to look at again, and the path that it lies on."""

    answer: Answer  #: "look" at `at_m`; "go": no look from here can decide more of the path; "blocked": no path
    #: nearest place of the first undecided region on the path; None unless the answer is "look"
    at_m: tuple[float, float] | None
    #: (K, 2) float64: the optimistic shortest path, cell by cell from the robot on; empty if there is none
    path_m: FloatArray
    length_m: float  #: length of the path; infinite if there is none
    sure_m: float  #: length of the path before the robot touches undecided floor
    reason: str  #: the reason, as text


class SelectiveLook:
    """Chooses looks for one robot and one destination at a time.

    Parameters
    ----------
    cell_m : float
        Side of the map's cells.
    robot_radius_m : float
        Distance that the robot's centre keeps from blocked cells.
    half_view_rad : float
        Angle that a look covers to either side of its direction: half the field of view of a panning head's camera, or
        of a crop at full resolution.
    """

    def __init__(
        self,
        cell_m: float,
        robot_radius_m: float,
        half_view_rad: float,
    ) -> None:
        prepare("steering")
        self._cell_m = as_positive("cell_m", cell_m)
        self._radius_m = as_positive("robot_radius_m", robot_radius_m)
        self._half_view_rad = as_positive("half_view_rad", half_view_rad)
        # place looked at and position of the robot, for each look from here
        self._looks: list[tuple[tuple[float, float], tuple[float, float]]] = []
        self._path_m: FloatArray | None = None
        self._target_m: tuple[float, float] | None = None

    def forget(self) -> None:
        """Forget the looks taken and the last path."""
        self._looks.clear()
        self._path_m = None

    def observe(self, at_m: tuple[float, float], from_m: tuple[float, float]) -> None:
        """Update with a look at `at_m` from `from_m`.

        A place that is still undecided after two looks is not looked at again from here. It stays undecided, so the
        robot must drive slowly towards it.
        """
        here = [look for look in self._looks if math.dist(look[1], from_m) < _ELSEWHERE_M]
        self._looks = [*here, (at_m, from_m)]

    def choose(
        self,
        free: BoolArray,
        no_go: BoolArray,
        corner_m: tuple[float, float],
        robot_m: tuple[float, float],
        target_m: tuple[float, float],
    ) -> SelectedLook:
        """Choose where to look again.

        Parameters
        ----------
        free, no_go : (N, M) bool
            Cells that are free, and that are blocked; all others are undecided. First index along x.
        corner_m : (float, float)
            Lowest corner of cell (0, 0), in the frame of robot and target.
        robot_m, target_m : (float, float)
            The robot's centre, and its target; both on the map.

        Raises
        ------
        ArgumentError
            The grids differ in size, overlap, or robot or target is not on them.
        """
        if free.ndim != 2 or free.shape != no_go.shape:
            raise ArgumentError(f"free and no_go must be grids of one size, got {free.shape} and {no_go.shape}")
        if (free & no_go).any():
            raise ArgumentError("a cell cannot be both free and blocked")
        start, end = (self._cell(place, corner_m, free.shape) for place in (robot_m, target_m))
        if target_m != self._target_m:
            self._target_m, self._path_m = target_m, None
        corner = np.array(corner_m)
        undecided = ~free & ~no_go
        room = self._away_m(no_go)
        near_unsure = self._away_m(undecided) <= self._radius_m
        # the robot's own place is free, even if the map says otherwise; from there it may move away from blocked cells
        beside = (self._from_m(start, free.shape) <= self._radius_m) & (room >= room[start])
        passable = (room > self._radius_m) | beside
        cells = self._shortest(passable, near_unsure, start, end)
        if cells is None:
            self._path_m = None
            reason = "blocked: no way even if all that is undecided were free"
            return SelectedLook("blocked", None, read_only(np.empty((0, 2))), math.inf, 0.0, reason)
        cells = self._kept_path(cells, passable, corner, start)
        path = corner + (cells + 0.5) * self._cell_m
        self._path_m = path
        length = _length_m(path)
        unsure = np.flatnonzero(near_unsure[cells[:, 0], cells[:, 1]])
        sure = _length_m(path[: unsure[0] + 1]) if len(unsure) else length
        at = self._first_unsure(cells, undecided & ~self._given_up(robot_m, corner, free.shape), no_go, start)
        if at is None:
            rest = f", of which {length - sure:.2f} m must be seen from nearer" if len(unsure) else ", all of it free"
            return SelectedLook("go", None, read_only(path), length, sure, f"go: {length:.2f} m{rest}")
        x, y = (corner + (np.array(at) + 0.5) * self._cell_m).tolist()
        away = math.dist(robot_m, (x, y))
        reason = f"look at ({x:.2f}, {y:.2f}), {away:.2f} m off: the first undecided floor on a way of {length:.2f} m"
        return SelectedLook("look", (x, y), read_only(path), length, sure, reason)

    def _cell(
        self, place_m: tuple[float, float], corner_m: tuple[float, float], shape: tuple[int, ...]
    ) -> tuple[int, int]:
        i, j = (math.floor((p - c) / self._cell_m) for p, c in zip(place_m, corner_m, strict=True))
        if not (0 <= i < shape[0] and 0 <= j < shape[1]):
            raise ArgumentError(f"robot and target must be on the map, got {place_m}")
        return i, j

    def _given_up(self, robot_m: tuple[float, float], corner: FloatArray, shape: tuple[int, ...]) -> BoolArray:
        """Return the cells that have been looked at `_MAX_LOOKS` times from here."""
        counts = np.zeros(shape, dtype=np.int64)
        i, j = np.ogrid[: shape[0], : shape[1]]
        x, y = corner[0] + (i + 0.5) * self._cell_m, corner[1] + (j + 0.5) * self._cell_m
        for at_m, from_m in self._looks:
            if math.dist(from_m, robot_m) < _ELSEWHERE_M:
                forward, left = at_m[0] - from_m[0], at_m[1] - from_m[1]
                dx, dy = x - from_m[0], y - from_m[1]
                off = np.arctan2(forward * dy - left * dx, forward * dx + left * dy)
                counts += np.abs(off) < self._half_view_rad
        return np.asarray(counts >= _MAX_LOOKS)

    def _away_m(self, cells: BoolArray) -> FloatArray:
        """Return each cell's distance, centre to centre, from the nearest of `cells`; infinite if there are none."""
        if not cells.any():
            return np.full(cells.shape, np.inf)
        away = cv2.distanceTransform((~cells).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
        return np.asarray(away, dtype=np.float64) * self._cell_m

    def _from_m(self, start: tuple[int, int], shape: tuple[int, ...]) -> FloatArray:
        i, j = np.ogrid[: shape[0], : shape[1]]
        return np.asarray(np.hypot(i - start[0], j - start[1]) * self._cell_m)

    def _shortest(
        self, passable: BoolArray, near_unsure: BoolArray, start: tuple[int, int], end: tuple[int, int]
    ) -> npt.NDArray[np.int64] | None:
        if not passable[end]:
            return None
        size = max(passable.shape)
        price = np.full((size, size), np.inf, dtype=np.float32)
        price[: passable.shape[0], : passable.shape[1]] = np.where(
            passable, np.where(near_unsure, 1 + _UNSURE_COST, 1.0), np.inf
        )
        come_from, cost = np.empty(size * size, dtype=np.int32), np.empty(size * size, dtype=np.float32)
        first, cell = (place[0] * size + place[1] for place in (start, end))
        find_way(price, first, cell, come_from, cost)
        if not np.isfinite(cost[cell]):
            return None
        way = [cell]
        while cell != first:
            cell = int(come_from[cell])
            way.append(cell)
        return np.array(np.divmod(way[::-1], size), dtype=np.int64).T

    def _kept_path(
        self, cells: npt.NDArray[np.int64], passable: BoolArray, corner: FloatArray, start: tuple[int, int]
    ) -> npt.NDArray[np.int64]:
        """Return the rest of the last path if it is passable and hardly longer, otherwise the new path."""
        if self._path_m is None:
            return cells
        old = np.floor((self._path_m - corner) / self._cell_m).astype(np.int64)
        off = np.abs(old - start).max(axis=1)
        rest = old[int(np.argmin(off)) :]
        inside = ((rest >= 0) & (rest < passable.shape)).all(axis=1)
        if off.min() > 1 or not inside.all() or not passable[rest[:, 0], rest[:, 1]].all():
            return cells
        if (rest[0] != start).any():
            rest = np.vstack([start, rest])
        return rest if _length_m(rest) <= (1 + _SWITCH_RATIO) * _length_m(cells) else cells

    def _first_unsure(
        self, cells: npt.NDArray[np.int64], unsure: BoolArray, no_go: BoolArray, start: tuple[int, int]
    ) -> tuple[int, int] | None:
        """Return the first undecided cell along the path that is within the robot's radius and visible from here."""
        reach = math.ceil(self._radius_m / self._cell_m)
        seen: set[tuple[int, int]] = set()
        for i, j in cells.tolist():
            rows, columns = slice(max(0, i - reach), i + reach + 1), slice(max(0, j - reach), j + reach + 1)
            touched = np.argwhere(unsure[rows, columns]) + np.array([rows.start, columns.start])
            off = np.hypot(*(touched - (i, j)).T) * self._cell_m
            for k in np.argsort(off, kind="stable").tolist():
                cell = (int(touched[k, 0]), int(touched[k, 1]))
                if off[k] > self._radius_m or cell in seen:
                    continue
                if is_in_sight(no_go, start, cell):
                    return cell
                seen.add(cell)
        return None


def is_in_sight(blocked: BoolArray, start: tuple[int, int], cell: tuple[int, int]) -> bool:
    """Return whether no blocked cell lies on the straight line between two cells."""
    count = 2 * max(abs(cell[0] - start[0]), abs(cell[1] - start[1]), 1)
    along = np.linspace(0.0, 1.0, count + 1)[1:-1, None]
    between = np.rint(np.array(start) * (1 - along) + np.array(cell) * along).astype(np.int64)
    return not bool(blocked[between[:, 0], between[:, 1]].any())


def _length_m(path: npt.NDArray[np.float64] | npt.NDArray[np.int64]) -> float:
    return float(np.hypot(*np.diff(path, axis=0).T).sum())
