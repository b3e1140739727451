"""Free range of the floor in each direction, from polar cells (Sekimori et al. 2001, section 3.1).

A cell is free if at least a ratio r_th of it is floor; the free range of a direction ends at its first cell that is not
free. Counting floor samples in each cell is equivalent to the paper's AND with a template of cells and labelling.
"""

from __future__ import annotations

import math
from copy import copy
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt8Array, read_only
from robocup_vision.checks import require_at_least
from robocup_vision.kernels.floor import free_floor, free_ranges
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import BODY_COLUMNS, PolarView

# the paper's r_th; stricter than its 0.8, because cells are smaller and specks are removed before
FREE_RATIO = 0.9
_BLUR_PX = 1.5  # extent of an edge's blur by lens and sampling
_CROSSING_WIDTHS = 3.0  # width, in line widths, of lines that meet or are crossed obliquely
_MAX_OBSTACLE_RATIO = 0.55  # greatest width of a line relative to an obstacle; a wider stripe may be a robot


@dataclass(frozen=True, slots=True, eq=False)
class FreeSpace:
    """Free floor around the robot."""

    bearing_rad: FloatArray  #: (J,) float64: directions in the robot frame, ascending, radians
    #: (J,) float64: distance from the robot's centre to the first obstacle, metres; for a mirror camera it may be too
    #: short by up to a cell
    range_m: FloatArray


class FreeSpaceGrid:
    """The polar cells of one camera: I rings by J directions on the floor around the robot.

    For a pinhole camera, floor nearer than its view is assumed free; if something stands where the floor comes into
    view, the range is 0. Its rings grow with the range, and a range ends at the first blocked sample of its first
    blocked cell.

    Parameters
    ----------
    view : PolarView or FloorView
        Samples of the cells.
    directions : int
        Number J of directions, over a turn or over the view.
    rings : int or tuple of float
        Number I of rings between image radii of equal steps (the paper's choice; for a pinhole camera between ranges
        of equal ratios), or the boundaries of the rings, metres.
    threshold : float
        The paper's r_th: least fraction of floor in a free cell.

    Raises
    ------
    ArgumentError
        If there are no directions or rings, the bounds do not increase, or the threshold is not within 0 to 1.
    """

    def __init__(
        self,
        view: PolarView | FloorView,
        directions: int = 80,
        rings: int | tuple[float, ...] = 20,
        threshold: float = FREE_RATIO,
    ) -> None:
        self.view, self.directions, self.rings, self.threshold = view, directions, rings, threshold
        require_at_least(self, 3, "directions")
        if not 0 < threshold <= 1:
            raise ArgumentError(f"threshold must be within 0 to 1, got {threshold}")
        if isinstance(rings, int):
            if rings < 1:
                raise ArgumentError(f"rings must be at least 1, got {rings}")
        elif len(rings) < 2 or not np.all(np.diff(rings) > 0) or rings[0] < 0:
            raise ArgumentError(f"rings must be at least two increasing ranges in metres, got {list(rings)}")
        #: (I + 1,) float64: boundaries of the rings, metres
        self.ring_bounds_m = read_only(view.ring_bounds_m(rings, BODY_COLUMNS) if isinstance(rings, int) else rings)
        first, width = view.span_rad
        #: (J,) float64: middle of each direction in the robot frame, ascending, radians
        self.bearing_rad = read_only((np.arange(directions) + 0.5) * (width / directions) + first)
        valid, floor_m = view.valid.copy(), view.floor_m
        valid[:, :BODY_COLUMNS] = 0
        #: (K, M) int32: cell of each sample, ring * J + direction; -1 outside all cells
        self.cell = self.cells_of(floor_m, valid)
        self._cells = self._free_cells(np.hypot(floor_m[..., 0], floor_m[..., 1]))

    def held(self, view: FloorView) -> FreeSpaceGrid:
        """Return the grid of a view that `FloorView.held` made from this one's."""
        other = copy(self)
        turn_rad = (view.camera.pan_rad or 0.0) - self._pan_rad
        other.view, other.bearing_rad = view, read_only(self.bearing_rad + turn_rad)
        return other

    @property
    def _pan_rad(self) -> float:
        assert isinstance(self.view, FloorView)
        return self.view.camera.pan_rad or 0.0

    def cells_of(self, floor_m: FloatArray, valid: UInt8Array) -> Int32Array:
        """Return the cells (...,) int32 of floor points (..., 2) in the robot frame, metres; -1 if there is none."""
        x, y = floor_m[..., 0], floor_m[..., 1]
        with np.errstate(invalid="ignore"):
            ring = np.searchsorted(self.ring_bounds_m, np.hypot(x, y), side="right") - 1
            first, width = self.view.span_rad
            turn = np.arctan2(y, x) - first
            if not self.view.is_ring:
                # relative to the middle, because a lens may show more than half a turn
                turn = np.remainder(turn - width / 2 + math.pi, math.tau) - math.pi + width / 2
            direction = np.nan_to_num(np.floor(turn * (self.directions / width))).astype(int)
        if self.view.is_ring:
            direction %= self.directions
        known = np.isfinite(x) & (valid > 0) & (ring >= 0) & (ring < len(self.ring_bounds_m) - 1)
        known &= (direction >= 0) & (direction < self.directions)
        cell = np.where(known, ring * self.directions + direction, -1).astype(np.int32)
        cell.flags.writeable = False
        return cell

    def _free_cells(self, middle_m: FloatArray) -> free_ranges.FreeCells:
        """Return the cells of samples at ranges (K, M), and the numbers of blocked samples that a free cell may have.

        A cell without samples hides no other.
        """
        rings, shape = len(self.ring_bounds_m) - 1, (len(self.ring_bounds_m) - 1, self.directions)
        total = np.bincount(self.cell[self.cell >= 0], minlength=rings * self.directions).reshape(shape)
        needed = np.ceil(total * self.threshold - 1e-6)
        seen = (np.arange(1, rings + 1)[:, None] * (needed > 0)).max(axis=0)
        near_m = (middle_m - 0.5 * np.diff(middle_m, axis=1, prepend=middle_m[:, :1])).astype(np.float32)
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
        """(J,) float64: range from which a forward camera sees the floor in each direction, metres; inf: nowhere."""
        cells = self._cells
        return read_only(np.where(cells.seen > 0, cells.first_m, np.inf))

    @property
    def farthest_m(self) -> FloatArray:
        """(J,) float64: range up to which a forward camera sees the floor in each direction, metres."""
        return read_only(self.ring_bounds_m[self._cells.seen])

    def _first_m(self, near_m: Float32Array) -> FloatArray:
        """(J,) float64: range at which all bearings of each direction are in view; near edges (K, M) of samples."""
        seen = self.cell >= 0
        first = seen.argmax(axis=1)
        at = np.flatnonzero(seen.any(axis=1))
        # rows of a camera off the robot's centre cross directions, some of which contain no row's first sample
        nearest_m = np.full(self.directions, np.inf)
        np.minimum.at(nearest_m, self.cell[seen] % self.directions, near_m[seen])
        first_m = np.where(np.isfinite(nearest_m), nearest_m, 0.0)
        np.maximum.at(first_m, self.cell[at, first[at]] % self.directions, near_m[at, first[at]])
        return first_m

    def measure(self, passable: UInt8Array) -> FreeSpace:
        """Measure the free ranges from the samples (K, M) uint8 that can be driven over (non-zero)."""
        range_m = np.empty(self.directions)
        free_ranges.measure_ranges(passable, self.view.shown, self._cells, range_m)
        return FreeSpace(self.bearing_rad, range_m)


class FloorMarking:
    """Marks the samples that can be driven over: floor, and painted lines between floor.

    Parameters
    ----------
    view : PolarView or FloorView
        The samples.
    line_width_m : float
        Width of the field's lines.
    obstacle_width_m : float
        Width of an obstacle, which bounds the length of a line seen end-on.
    """

    def __init__(
        self,
        view: PolarView | FloorView,
        line_width_m: float,
        obstacle_width_m: float,
    ) -> None:
        self._view = view
        line_m = _CROSSING_WIDTHS * line_width_m
        per_column = np.maximum(np.gradient(view.range_m), 1e-6)
        # plus the lens' blur on both sides
        per_row = view.range_m * view.row_step_rad
        columns = np.ceil(line_m / per_column + 2 * _BLUR_PX / view.step_px)
        rows = np.ceil((line_m + 2 * _BLUR_PX * view.across_m_per_px) / per_row) + 2
        # less than a robot's width
        rows = np.maximum(np.minimum(rows, np.floor(_MAX_OBSTACLE_RATIO * obstacle_width_m / per_row)), 1)
        #: (M,) int32 each: greatest width of a line at each column, in samples along and across the bearing
        self.widest_line = columns.astype(np.int32), rows.astype(np.int32)
        self._none_known = np.full(view.bearings, -1)

    def held(self, view: FloorView) -> FloorMarking:
        """Return the marking of a view that `FloorView.held` made from this one's."""
        other = copy(self)
        other._view = view
        return other

    def mark(self, samples: UInt8Array, llr: npt.NDArray[np.int8]) -> UInt8Array:
        """Mark each sample: (K, M) uint8, 0 blocked, 1 floor, 2 line.

        Parameters
        ----------
        samples : (K, M, 3) uint8
            Colours.
        llr : (K, M) int8
            The floor's log-likelihood ratios.
        """
        out = np.empty(llr.shape, dtype=np.uint8)
        view, unknown = self._view, self._none_known
        free_floor.passable(
            samples, llr, view.shown, *self.widest_line, view.columns_in_use, view.is_ring, unknown, out
        )
        return out
