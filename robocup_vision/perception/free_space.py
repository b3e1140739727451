"""How far the floor is free in each direction, from polar cells of floor (Sekimori et al. 2001, section 3.1).

A cell is free when at least a ratio r_th of it is floor; the free range of a direction ends at its first cell that is
not. Counting floor samples per cell gives the same as the paper's AND with a template of cells and labelling.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt8Array, read_only
from robocup_vision.checks import require_at_least
from robocup_vision.kernels.floor import free_floor, free_ranges
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import BODY_COLUMNS, PolarView

# the paper's r_th: stricter than its 0.8, since the cells are smaller and specks are removed before: a box that reaches
# into a cell blocks it
FREE_RATIO = 0.9
# what every frame needs, wherever the camera's neck turns it
_OF_EVERY_FRAME = ("cell", "_cells")


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpace:
    """Free floor around the robot."""

    bearing_rad: FloatArray  #: (J,) float64: directions in the robot frame, ascending, radians
    #: (J,) float64: distance from the robot's centre to the first thing that is not floor, metres; by a mirror camera
    #: on the safe side by up to a cell
    range_m: FloatArray


@dataclass(frozen=True, eq=False)
class FreeSpaceGrid:
    """The polar cells of one camera: I rings times J directions on the floor around the robot.

    A pinhole camera takes the floor nearer than it sees for free; where something stands as soon as floor comes into
    view, the range is 0. Its rings grow with the range, so that a range ends at the first blocked sample of its first
    blocked cell.

    Raises
    ------
    ArgumentError
        If there are no directions or rings, the bounds do not increase, or the threshold is not within 0 to 1.
    """

    view: PolarView | FloorView  #: the samples that fill the cells
    directions: int = 80  #: number J of directions, over a whole turn or over what is in view
    #: number I of rings between image radii of equal steps (the paper's choice; for a pinhole camera between ranges of
    #: equal ratios), or the rings' own bounds, metres
    rings: int | tuple[float, ...] = 20
    threshold: float = FREE_RATIO  #: the paper's r_th: the fraction of a cell that must be floor

    def __post_init__(self) -> None:
        require_at_least(self, 3, "directions")
        if not 0 < self.threshold <= 1:
            raise ArgumentError(f"threshold must be within 0 to 1, got {self.threshold}")
        if isinstance(self.rings, int):
            if self.rings < 1:
                raise ArgumentError(f"rings must be at least 1, got {self.rings}")
        elif len(self.rings) < 2 or not np.all(np.diff(self.rings) > 0) or self.rings[0] < 0:
            raise ArgumentError(f"rings must be at least two increasing ranges in metres, got {list(self.rings)}")

    @cached_property
    def ring_bounds_m(self) -> FloatArray:
        """(I + 1,) float64: floor ranges between which the rings lie, metres."""
        if not isinstance(self.rings, int):
            return read_only(self.rings)
        return read_only(self.view.ring_bounds_m(self.rings, BODY_COLUMNS))

    @cached_property
    def bearing_rad(self) -> FloatArray:
        """(J,) float64: the directions' middles in the robot frame, ascending, radians."""
        first, width = self.view.span_rad
        return read_only((np.arange(self.directions) + 0.5) * (width / self.directions) + first)

    def held(self, view: FloorView) -> FreeSpaceGrid:
        """Return the grid of a view that `FloorView.held` made of this one's."""
        for name in _OF_EVERY_FRAME:
            getattr(self, name)
        other = object.__new__(FreeSpaceGrid)
        bearing_rad = self.bearing_rad + ((view.camera.pan_rad or 0.0) - self._pan_rad)
        bearing_rad.flags.writeable = False
        vars(other).update(vars(self), view=view, bearing_rad=bearing_rad, _pan_rad=view.camera.pan_rad or 0.0)
        return other

    @cached_property
    def _pan_rad(self) -> float:
        assert isinstance(self.view, FloorView)
        return self.view.camera.pan_rad or 0.0

    @cached_property
    def cell(self) -> Int32Array:
        """(K, M) int32: each sample's cell, ring * J + direction; -1 outside all of them."""
        valid = self.view.valid.copy()
        valid[:, :BODY_COLUMNS] = 0
        return self.cells_of(self.view.floor_m, valid)

    def cells_of(self, floor_m: FloatArray, valid: UInt8Array) -> Int32Array:
        """Cell (...,) int32 of floor points (..., 2) in the robot frame, metres; -1: none."""
        x, y = floor_m[..., 0], floor_m[..., 1]
        with np.errstate(invalid="ignore"):
            ring = np.searchsorted(self.ring_bounds_m, np.hypot(x, y), side="right") - 1
            first, width = self.view.span_rad
            turn = np.arctan2(y, x) - first
            if not self.view.is_ring:
                # about the middle: a lens may show more than a half turn
                turn = np.remainder(turn - width / 2 + math.pi, math.tau) - math.pi + width / 2
            direction = np.nan_to_num(np.floor(turn * (self.directions / width))).astype(int)
        if self.view.is_ring:
            direction %= self.directions
        known = np.isfinite(x) & (valid > 0) & (ring >= 0) & (ring < len(self.ring_bounds_m) - 1)
        known &= (direction >= 0) & (direction < self.directions)
        cell = np.where(known, ring * self.directions + direction, -1).astype(np.int32)
        cell.flags.writeable = False
        return cell

    @cached_property
    def _cells(self) -> free_ranges.FreeCells:
        """The samples' cells, and the blocked samples that a free one may have; one that no sample sees hides none."""
        rings, shape = len(self.ring_bounds_m) - 1, (len(self.ring_bounds_m) - 1, self.directions)
        total = np.bincount(self.cell[self.cell >= 0], minlength=rings * self.directions).reshape(shape)
        needed = np.ceil(total * self.threshold - 1e-6)
        seen = (np.arange(1, rings + 1)[:, None] * (needed > 0)).max(axis=0)
        middle = np.hypot(self.view.floor_m[..., 0], self.view.floor_m[..., 1])
        near_m = (middle - 0.5 * np.diff(middle, axis=1, prepend=middle[:, :1])).astype(np.float32)
        return free_ranges.FreeCells(
            self.cell,
            (total - needed).astype(np.int32),
            seen,
            self.ring_bounds_m,
            near_m,
            self._first_m(near_m),
            self.view.is_ring,
        )

    @property
    def nearest_m(self) -> FloatArray:
        """(J,) float64: range from which on a forward camera sees the floor in each direction, metres; inf: nowhere."""
        cells = self._cells
        return read_only(np.where(cells.seen > 0, cells.first_m, np.inf))

    @property
    def farthest_m(self) -> FloatArray:
        """(J,) float64: range up to which a forward camera sees the floor in each direction, metres."""
        return read_only(self.ring_bounds_m[self._cells.seen])

    def _first_m(self, near_m: Float32Array) -> FloatArray:
        """(J,) float64: where each direction comes into view, on all its bearings; near rims (K, M) of the samples."""
        seen = self.cell >= 0
        first = seen.argmax(axis=1)
        at = np.flatnonzero(seen.any(axis=1))
        # about a camera beside the robot's centre, rows cross directions: some begin none of their own
        nearest_m = np.full(self.directions, np.inf)
        np.minimum.at(nearest_m, self.cell[seen] % self.directions, near_m[seen])
        first_m = np.where(np.isfinite(nearest_m), nearest_m, 0.0)
        np.maximum.at(first_m, self.cell[at, first[at]] % self.directions, near_m[at, first[at]])
        return first_m

    def measure(self, passable: UInt8Array) -> FreeSpace:
        """Free ranges from the samples (K, M) uint8 that may be driven over (non-zero)."""
        range_m = np.empty(self.directions)
        free_ranges.measure_ranges(passable, self.view.shown, self._cells, range_m)
        return FreeSpace(self.bearing_rad, range_m)


@dataclass(frozen=True, slots=True)
class FloorMarkingSettings:
    """Settings of `FloorMarking`."""

    blur_px: float = 1.5  #: how far the lens and the sampling spread an edge
    crossing_widths: float = 3.0  #: width of lines that meet, or are crossed obliquely, in line widths
    max_obstacle_ratio: float = 0.55  #: a line is at most this part of an obstacle's width: a wider one may be a robot


@dataclass(frozen=True, eq=False)
class FloorMarking:
    """Marks the samples that may be driven over: floor, and painted lines between floor."""

    view: PolarView | FloorView  #: the samples
    line_width_m: float  #: width of the field's lines
    #: a thing more than about half as wide as this is not taken for a line seen along its length
    obstacle_width_m: float
    settings: FloorMarkingSettings = FloorMarkingSettings()  #: widths of lines

    def held(self, view: FloorView) -> FloorMarking:
        """Return the marking of a view that `FloorView.held` made of this one's."""
        for name in ("widest_line", "_none_known"):
            getattr(self, name)
        other = object.__new__(FloorMarking)
        vars(other).update(vars(self), view=view)
        return other

    @cached_property
    def widest_line(self) -> tuple[Int32Array, Int32Array]:
        """(M,) int32 each: the widest line at each column, in samples across and along the rows."""
        settings, range_m = self.settings, self.view.range_m
        line_m = settings.crossing_widths * self.line_width_m
        per_column = np.maximum(np.gradient(range_m), 1e-6)
        # the lens reaches over on both sides
        per_row = range_m * self.view.row_step_rad
        columns = np.ceil(line_m / per_column + 2 * settings.blur_px / self.view.step_px)
        rows = np.ceil((line_m + 2 * settings.blur_px * self.view.across_m_per_px) / per_row) + 2
        # but never as wide as a robot
        rows = np.maximum(np.minimum(rows, np.floor(settings.max_obstacle_ratio * self.obstacle_width_m / per_row)), 1)
        return columns.astype(np.int32), rows.astype(np.int32)

    @cached_property
    def _none_known(self) -> npt.NDArray[np.int64]:
        return np.full(self.view.bearings, -1)

    def mark(
        self, samples: UInt8Array, llr: npt.NDArray[np.int8], outermost: npt.NDArray[np.int64] | None = None
    ) -> UInt8Array:
        """Mark each sample: (K, M) uint8, 0 blocked, 1 floor, 2 line.

        Parameters
        ----------
        samples : (K, M, 3) uint8
            Colours.
        llr : (K, M) int8
            Floor likelihood ratios.
        outermost : (K,) int64, optional
            Column of each bearing's outermost floor, -1 where not known: saves looking beyond it.
        """
        if outermost is None:
            outermost = self._none_known
        out = np.empty(llr.shape, dtype=np.uint8)
        view, is_ring = self.view, self.view.is_ring
        free_floor.passable(samples, llr, view.shown, *self.widest_line, view.columns_in_use, is_ring, outermost, out)
        return out
