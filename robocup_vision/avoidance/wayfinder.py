"""Finds the direction in which a robot gets round obstacles that it sees on its way to a target.

Steering uses a single view. By one view alone, a robot that heads straight for its target stops in a dead end, moves to
and fro between two obstacles, or comes to a corner too fast to turn. Here a small grid remembers the floor of the last
views and moves with the odometry. Unknown cells count as free. The cheapest path over the grid gives the direction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arguments import as_angle, as_number, as_pose
from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array
from robocup_vision.avoidance.steering import FreeRanges, bearings_and_ranges
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.motion import way_grid

# constants with _RATIO are multiples of the robot's radius
_EVERY = 3  # views between two searches for the path
_CELL_RATIO = 0.2  # size of a cell: five cells per radius resolve whether the robot fits
_RADIUS_CELLS = 1.0 / _CELL_RATIO
_SPARE_RATIO = 0.05  # clearance on each side that a gap seen from near must have
_SOFT_RATIO = 0.5  # width of the zone beside blocked cells in which the price is higher than on open floor
_TRY_RATIO = 0.5  # two places ahead within this distance count as the same attempt
# A view measures the floor where its sectors are narrower than the robot's radius. The measurement is certain where
# they are narrower than this.
_SURE_RATIO = 0.4
_STRIP_CELLS = 2.5  # depth of the strip that is marked as blocked behind a free range, cells
_MARK_RULES = way_grid.MarkRules(
    # with each view that shows it from farther away, a free cell counts as measured from 3 % farther: others may enter
    fading=1.03,
    # far sectors are wide
    overrule_ratio=1.5,
)
_PRICE_RULES = way_grid.PriceRules(
    # so that paths keep a distance where there is room
    tight=2.0,
    # more than any detour over open floor nearby
    shut=5.0,
    # a blocked strip measured from afar may be an error of a wide sector; one measured from near is not
    maybe_barred=50.0,
    barred=1000.0,
    # passing by slowly takes fewer
    tries=15.0,
    tried=1.0,
    remembered=0.995,
)


@dataclass(frozen=True, slots=True)
class Heading:
    """A direction to head in.

    Parameters
    ----------
    bearing_rad : float
        Robot frame, radians.
    distance_m : float
        Distance, metres. A robot that would stop there is never too fast for the next turn or for the target.
    straight : bool
        Whether the direction leads straight to the target.
    """

    bearing_rad: float
    distance_m: float
    straight: bool


class Wayfinder:
    """Remembers the floor around one robot and finds the path over it to a target.

    Parameters
    ----------
    robot_radius_m : float
        The same as that of `Steering`, so that a path is never narrower than steering allows.
    window_m : float
        Width of the square that is remembered, with the robot near its middle. A target outside is moved to its rim.

    Raises
    ------
    ArgumentError
        An argument is out of its range.

    Notes
    -----
    A view marks cells free up to each direction's range and blocked over a strip behind it. A newer view replaces an
    older one, except that a cell measured free from much nearer stays free. Cells measured as blocked from afar have a
    high price, since sectors are wide there. Cells measured as blocked from near have a much higher price, which is
    highest in the middle of a strip. No cell is impassable, so there is always a path. The price of a place that the
    robot repeatedly heads for without passing it grows each time (as in learning real-time A*), so others are tried.

    The returned distance makes a robot slow down before a turn. Turning by an angle a at a speed v changes the velocity
    by 2 v sin(a/2), which takes a distance of about 2 v^2 sin(a/2) / alpha. That is twice the robot's radius R at the
    speed v^2 = alpha R / sin(a/2). A robot that brakes to stop R / (2 sin(a/2)) beyond the turn has this speed at it.
    """

    def __init__(self, robot_radius_m: float, window_m: float = 4.0) -> None:
        if not as_number("robot_radius_m", robot_radius_m) >= 1e-6:
            raise ArgumentError(f"robot_radius_m must be at least 1e-06, got {robot_radius_m!r}")
        if not as_number("window_m", window_m) >= 8.0 * robot_radius_m:
            raise ArgumentError(f"window_m must be at least 8 radii of the robot, got {window_m!r}")
        self._cell_m = _CELL_RATIO * robot_radius_m
        self._size = math.ceil(window_m / self._cell_m)
        shape = (self._size, self._size)
        self._open_any: UInt8Array = np.empty(shape, np.uint8)
        self._open_sure: UInt8Array = np.empty(shape, np.uint8)
        self._price: Float32Array = np.empty(shape, np.float32)
        self._come_from = np.empty(self._size**2, np.int32)
        self._cost: Float32Array = np.empty(self._size**2, np.float32)
        self.forget()
        prepare("steering")

    def forget(self) -> None:
        """Forget all views."""
        self._state: UInt8Array = np.full((self._size, self._size), way_grid.UNSEEN, np.uint8)
        self._seen_from: Float32Array = np.zeros((self._size, self._size), np.float32)
        self._tried: Float32Array = np.zeros((self._size, self._size), np.float32)
        self._x = self._y = self._size / 2
        self._theta = 0.0
        self._views = 0
        # next turn: x and y, cells, and the path's direction after it; None: straight to the target
        self._turn: tuple[float, float, float] | None = None
        self._target = (math.inf, math.inf)
        self._is_due = True

    def update(self, free_space: FreeRanges, motion: Pose2) -> None:
        """Update the grid with a view.

        Parameters
        ----------
        free_space : FreeRanges
            Free ranges (J,), metres, at evenly spaced bearings, robot frame.
        motion : Pose2
            Motion since the previous view, in the robot frame at that view.

        Raises
        ------
        ArgumentError
            There are fewer than two bearings, or the number of ranges differs.
        """
        motion = as_pose("motion", motion)
        bearing, range_m = bearings_and_ranges(free_space, 2)
        c, s = math.cos(self._theta), math.sin(self._theta)
        self._x += (c * motion.x_m - s * motion.y_m) / self._cell_m
        self._y += (s * motion.x_m + c * motion.y_m) / self._cell_m
        self._theta = math.remainder(self._theta + motion.theta_rad, math.tau)
        if self._views % _EVERY == 0:
            self._keep_inside()
            self._reach = _RADIUS_CELLS / float(bearing[1] - bearing[0])
            view = way_grid.RangesInGrid(self._x, self._y, self._theta, bearing, range_m / self._cell_m)
            way_grid.mark_view(
                self._state, self._seen_from, view, _RADIUS_CELLS, self._reach, _STRIP_CELLS, _MARK_RULES
            )
            self._is_due = True
        self._views += 1

    def head(
        self,
        target_bearing_rad: float,
        target_distance_m: float,
        velocity_mps: Sequence[float] | FloatArray = (0.0, 0.0),
    ) -> Heading:
        """Return the direction in which to drive to a target.

        Parameters
        ----------
        target_bearing_rad, target_distance_m : float
            The target, robot frame, radians and metres.
        velocity_mps : (2,) float64 or pair of float
            The robot's velocity, robot frame: if it drives in another direction, it slows down first.

        Raises
        ------
        ArgumentError
            The target is not finite, its bearing is more than a turn, or its distance is negative.
        """
        target_bearing_rad = as_angle("target_bearing_rad", target_bearing_rad)
        target_distance_m = as_number("target_distance_m", target_distance_m)
        if target_distance_m < 0.0:
            raise ArgumentError(f"target_distance_m must not be negative, got {target_distance_m!r}")
        is_new = self._is_due
        target = self._in_grid(target_bearing_rad, target_distance_m)
        # a new search is due, or the target has moved by more than a robot's radius
        if is_new or math.hypot(target[0] - self._target[0], target[1] - self._target[1]) > _RADIUS_CELLS:
            self._target = target
            self._find(target)
            self._is_due = False
        if self._turn is None:
            bearing, distance_m = target_bearing_rad, target_distance_m
        else:
            x, y, after = self._turn
            towards = math.atan2(y - self._y, x - self._x)
            bearing = math.remainder(towards - self._theta, math.tau)
            distance_m = math.hypot(x - self._x, y - self._y) * self._cell_m + self._room_to_turn_m(after - towards)
        if is_new and distance_m > self._cell_m / _CELL_RATIO:
            # the place a radius ahead is passed next
            angle, radius = bearing + self._theta, _RADIUS_CELLS
            x, y = self._x + radius * math.cos(angle), self._y + radius * math.sin(angle)
            way_grid.note_try(self._tried, self._price, x, y, _TRY_RATIO * radius)
        if math.hypot(*velocity_mps) > 0.0:
            going = math.atan2(float(velocity_mps[1]), float(velocity_mps[0]))
            distance_m = min(distance_m, self._room_to_turn_m(bearing - going))
        return Heading(bearing, distance_m, self._turn is None)

    def _room_to_turn_m(self, angle_rad: float) -> float:
        radius_m = self._cell_m / _CELL_RATIO
        return 0.5 * radius_m / max(abs(math.sin(0.5 * angle_rad)), 1e-3)

    def _in_grid(self, bearing_rad: float, distance_m: float) -> tuple[float, float]:
        """Return the grid coordinates of a place; if it is outside, those of the rim in its direction."""
        unit_x, unit_y = math.cos(bearing_rad + self._theta), math.sin(bearing_rad + self._theta)
        far = distance_m / self._cell_m
        for unit, place in ((unit_x, self._x), (unit_y, self._y)):
            if abs(unit) > 1e-9:
                far = min(far, ((self._size - 2 if unit > 0.0 else 1) - place) / unit)
        return self._x + far * unit_x, self._y + far * unit_y

    def _find(self, target_cell: tuple[float, float]) -> None:
        size, radius = self._size, _RADIUS_CELLS
        target_x, target_y = target_cell
        way_grid.split_blocked(self._state, self._seen_from, _SURE_RATIO * self._reach, self._open_any, self._open_sure)
        away_any, away_sure = (
            np.asarray(cv2.distanceTransform(seen, cv2.DIST_L2, cv2.DIST_MASK_5), dtype=np.float32)
            for seen in (self._open_any, self._open_sure)
        )
        spare, soft = _SPARE_RATIO * radius, _SOFT_RATIO * radius
        way_grid.price_cells(away_any, away_sure, self._tried, radius, spare, soft, _PRICE_RULES, self._price)
        self._turn = None
        start = int(self._y + 0.5) * size + int(self._x + 0.5)
        target = int(target_y + 0.5) * size + int(target_x + 0.5)
        if start == target or way_grid.dearest_between(self._price, self._x, self._y, target_x, target_y) <= 1.0:
            return
        way_grid.find_way(self._price, start, target, self._come_from, self._cost)
        turn, after = way_grid.straight_part(
            self._price, self._come_from, start, target, self._x, self._y, round(2.0 * radius)
        )
        if turn != target:
            x, y = turn % size, turn // size
            self._turn = (x, y, math.atan2(after // size - y, after % size - x))

    def _keep_inside(self) -> None:
        """Shift the grid by whole cells if the robot has left its middle."""
        size = self._size
        by_x, by_y = round(self._x - size / 2), round(self._y - size / 2)
        if max(abs(by_x), abs(by_y)) < size // 12:
            return
        columns, rows = np.arange(size) + by_x, np.arange(size) + by_y
        inside = (rows[:, None] >= 0) & (rows[:, None] < size) & (columns >= 0) & (columns < size)
        shifted = np.ix_(rows % size, columns % size)
        self._state = np.where(inside, self._state[shifted], way_grid.UNSEEN).astype(np.uint8)
        self._seen_from = np.where(inside, self._seen_from[shifted], 0.0).astype(np.float32)
        self._tried = np.where(inside, self._tried[shifted], 0.0).astype(np.float32)
        self._x -= by_x
        self._y -= by_y
        if self._turn is not None:
            x, y, after = self._turn
            self._turn = (x - by_x, y - by_y, after)
        self._target = (self._target[0] - by_x, self._target[1] - by_y)
