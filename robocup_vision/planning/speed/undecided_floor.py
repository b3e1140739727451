"""Plans speeds towards undecided floor: slow enough that it has been observed sufficiently when the robot arrives.

Miura (2004), section 6.3. A region that needs n more looks, with period T, must be reached after them, with room to
stop: v (n T + t_dead) + v^2 / (2 a) <= d - r, where d is its distance along the path and r the robot's radius.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Int16Array
from robocup_vision.checks import as_positive, require_positive
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.planning.gaps.gap_choice import Point
from robocup_vision.planning.speed.speed_planner import SpeedPlan, checked_path

# values of `UndecidedFloor.looks`
FREE, BLOCKED = -1, 0
# step along the path, in cells, so that no cell is skipped
_STEP_CELLS = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class UndecidedFloor:
    """The floor in square cells, and the number of looks that each still needs.

    Cells outside are undecided, and need as many looks as the most undecided one inside, at least one.
    """

    #: (R, C) int16: row along y, column along x: -1 free, 0 blocked for certain, n > 0 undecided for n more looks
    looks: Int16Array
    corner_m: Point  #: outer corner of cell [0, 0], in the frame of the path
    #: width of a cell
    cell_m: float

    def __post_init__(self) -> None:
        looks = np.array(self.looks, dtype=np.int16)
        if looks.ndim != 2 or not looks.size:
            raise ArgumentError(f"looks must be (R, C), got {looks.shape}")
        require_positive(self, "cell_m")
        looks.flags.writeable = False
        object.__setattr__(self, "looks", looks)


def looks_to_decide(log_odds: FloatArray, gain: FloatArray, decided: float) -> Int16Array:
    """Return (R, C) the number of looks that each cell still needs; -1: it is free, 0: it is blocked.

    Parameters
    ----------
    log_odds : (R, C) float64
        Log-odds that each cell is occupied.
    gain : (R, C) float64
        By the sensor's model, decrease of the log-odds with one look from here that finds the cell free. Later looks
        are from nearer, and not worse.
    decided : float
        A cell is blocked at log-odds of at least this, and free at most minus this.
    """
    looks = np.ceil((np.asarray(log_odds) + decided) / np.maximum(gain, 1e-6))
    looks = np.clip(looks, 1, np.iinfo(np.int16).max)
    looks[np.asarray(log_odds) <= -decided] = FREE
    looks[np.asarray(log_odds) >= decided] = BLOCKED
    return looks.astype(np.int16)


def safe_speed_mps(room_m: float, looks: int, look_period_s: float, limits: MotionLimits) -> float:
    """Return the largest v with v (n T + t_dead) + v^2 / (2 a) <= room, at most the robot's speed.

    Parameters
    ----------
    room_m : float
        d - r: distance until the robot touches the region.
    looks : int
        n: number of looks needed; 0 (blocked) counts as 1.
    look_period_s : float
        T: time from one look to the next.
    limits : MotionLimits
        Contains t_dead and a.
    """
    # for blocked cells, too, the next decision is made one look later
    late = max(looks, 1) * look_period_s + limits.dead_time_s
    a = limits.acceleration_mps2
    return min(limits.speed_mps, a * (math.sqrt(late**2 + 2.0 * max(room_m, 0.0) / a) - late))


class UndecidedSpeed:
    """Plans speeds along paths over floor that is partly undecided; one object serves all paths.

    Parameters
    ----------
    robot_radius_m : float
        Radius of the robot plus its clearance.
    """

    def __init__(self, limits: MotionLimits, robot_radius_m: float, look_period_s: float) -> None:
        self._limits = limits
        self._radius_m = as_positive("robot_radius_m", robot_radius_m)
        self._look_period_s = as_positive("look_period_s", look_period_s)

    def plan(self, path_m: FloatArray, floor: UndecidedFloor) -> SpeedPlan:
        """Return the largest speed at which all cells on the way are decided in time.

        Parameters
        ----------
        path_m : (P, 2) float64
            The path from the robot's place, in the floor's frame.
        floor : UndecidedFloor
            The cells. Those under the robot count as free.
        """
        path = checked_path(path_m)
        places, arcs = _walk(path, _STEP_CELLS * floor.cell_m, self._needed_m(floor))
        # the robot touches a cell at its nearer side, not at its middle
        radius = self._radius_m + 0.5 * floor.cell_m
        reach = math.ceil(radius / floor.cell_m)
        around = np.arange(-reach, reach + 1)
        corner = np.array(floor.corner_m)
        # cells (S, N, N) that the robot touches at each place, and how many looks they need
        index = np.floor((places - corner) / floor.cell_m).astype(int)
        columns = index[:, 0, None, None] + around
        rows = index[:, 1, None, None] + around[:, None]
        x = corner[0] + (columns + 0.5) * floor.cell_m
        y = corner[1] + (rows + 0.5) * floor.cell_m
        covered = np.hypot(x - places[:, 0, None, None], y - places[:, 1, None, None]) <= radius
        covered &= np.hypot(x - places[0, 0], y - places[0, 1]) > self._radius_m
        height, width = floor.looks.shape
        inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
        looks = floor.looks[np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)].astype(int)
        looks = np.where(inside, looks, max(1, int(floor.looks.max())))
        matters = covered & (looks != FREE)
        if not matters.any():
            return SpeedPlan(self._limits.speed_mps, True, math.inf, "full speed: the way is free")
        # at each place only the cell that needs the most looks counts
        least, why = self._limits.speed_mps, "full speed: what is undecided is far"
        clearance = math.inf
        for s in np.flatnonzero(matters.any(axis=(1, 2))).tolist():
            most = int(looks[s][matters[s]].max())
            # at the previous step the cell was not touched yet
            room = float(arcs[max(s - 1, 0)])
            clearance = min(clearance, room)
            speed = safe_speed_mps(room, most, self._look_period_s, self._limits)
            if speed < least:
                least = speed
                what = f"undecided floor in {room:.2f} m, {most} looks" if most else f"blocked in {room:.2f} m"
                why = f"slow, {speed:.2f} m/s: {what}" if speed > 0.0 else f"stop: {what}"
        return SpeedPlan(least, least > 0.0, clearance, why)

    def _needed_m(self, floor: UndecidedFloor) -> float:
        """Return the distance along the path beyond which no cell slows the robot down."""
        speed, looks = self._limits.speed_mps, max(1, int(floor.looks.max()))
        return speed * looks * self._look_period_s + self._limits.stop_m(speed) + 2.0 * floor.cell_m


def _walk(path: FloatArray, step_m: float, max_m: float) -> tuple[FloatArray, FloatArray]:
    """Return places (S, 2) along the path, and their arc lengths (S,)."""
    ends = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    arcs = np.arange(0.0, min(max_m, float(ends[-1])) + step_m, step_m)
    arcs = np.minimum(arcs, ends[-1])
    return np.stack([np.interp(arcs, ends, path[:, k]) for k in (0, 1)], axis=1), arcs
