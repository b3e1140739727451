"""Maps the free floor around the robot from two sensors that measure different parts of objects (Miura 2004, 2.2).

Glare looks to a camera like floor of another colour. A range sensor measures above a ball or a fallen robot. Both may
measure different parts of one object, so their evidence must not be added. Each sensor has its own grid, and the states
of the grids are combined.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import BoolArray, FloatArray, Int8Array, Int32Array, UInt8Array
from robocup_vision.checks import require_at_least, require_positive
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.mapping import occupancy as kernel
from robocup_vision.mapping.range_profile import RangeProfile, cones
from robocup_vision.mapping.sensor_model import SensorModel, default_sensors
from robocup_vision.perception.free_space import FreeSpace

FREE, NO_GO, UNDECIDED = 0, 1, 2

_NO_DISCS = np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class FreeSpaceMapSettings:
    """Size and thresholds of a `FreeSpaceMap`.

    Raises
    ------
    ArgumentError
        A size or probability is out of its range.
    """

    #: number N of cells along each side of the window, which covers the range of a mirror camera
    cells: int = 80
    #: side of a cell, metres: less than half a robot's radius, so that a gap for a robot has free cells
    cell_m: float = 0.04
    #: a cell with a smaller probability of being occupied is free
    free_below: float = 0.1
    no_go_above: float = 0.9  #: a cell with a larger one is blocked (both are Miura's values)
    #: probabilities are clipped to between this and 1 - clip, so that a few later measurements can change the state
    clip: float = 0.02

    def __post_init__(self) -> None:
        require_at_least(self, 3, "cells")
        require_positive(self, "cell_m")
        if not 0 < self.clip < self.free_below < 0.5 < self.no_go_above < 1 - self.clip:
            raise ArgumentError(
                "probabilities must be 0 < clip < free_below < 0.5 < no_go_above < 1 - clip, got "
                f"clip {self.clip}, free_below {self.free_below}, no_go_above {self.no_go_above}"
            )


class FreeSpaceMap:
    """Free floor around the robot, from the evidence of its sensors so far.

    A square window of cells moves with the robot in whole cells. Its axes are those of the frame in which the robot's
    pose is given, so the cells are never resampled. Cells that leave the window are forgotten.

    Parameters
    ----------
    sensors : mapping of str to SensorModel, optional
        Sensors by name; ``floor`` and ``range`` of `default_sensors` by default.
    settings : FreeSpaceMapSettings, optional
        Size and thresholds.

    Raises
    ------
    ArgumentError
        If there is no sensor.

    Notes
    -----
    The probability P(E) that a cell is occupied follows by Bayes' rule from P0 = 0.5, in log-odds. The measured cell of
    a bearing gives the event O (an object was observed), nearer cells the event not O, farther ones none. A bearing is
    a cone that widens with range: only cells that cones cross entirely give not O. A cell is `FREE` if it is free by at
    least one sensor, and by every other sensor either free or undecided after at least n_req observations. Other cells
    must not be entered: they are `NO_GO` if blocked by a sensor, else `UNDECIDED`.

    The poses must be continuous. After a jump (a kidnapped robot, the other half of the field) call `forget`.
    """

    def __init__(
        self,
        sensors: Mapping[str, SensorModel] | None = None,
        settings: FreeSpaceMapSettings = FreeSpaceMapSettings(),
    ) -> None:
        self.sensors = dict(default_sensors() if sensors is None else sensors)
        if not self.sensors:
            raise ArgumentError("sensors must name at least one sensor")
        cells = settings.cells
        self.settings, self.cells, self.cell_m = settings, cells, settings.cell_m
        self._free_odds, self._no_go_odds, self._max_odds = (
            _logit(p) for p in (settings.free_below, settings.no_go_above, 1 - settings.clip)
        )
        self._needed = {name: model.observations_needed(settings.free_below) for name, model in self.sensors.items()}
        self._log_odds = {name: np.zeros((cells, cells), dtype=np.float32) for name in self.sensors}
        self._counts = {name: np.zeros((cells, cells), dtype=np.int32) for name in self.sensors}
        self._robot = Pose2(0.0, 0.0, 0.0)
        self._first = (-(cells // 2), -(cells // 2))
        self._state: UInt8Array | None = None

    @property
    def looks_to_free(self) -> int:
        """Number of observations after which an unknown cell is free, if each finds it free."""
        return max(self._needed.values())

    def forget(self) -> None:
        """Forget all evidence."""
        for name in self.sensors:
            self._log_odds[name][:] = 0.0
            self._counts[name][:] = 0
        self._state = None

    @property
    def robot(self) -> Pose2:
        """The robot's pose of the last `move`."""
        return self._robot

    @property
    def corner_m(self) -> tuple[float, float]:
        """Lowest corner of cell (0, 0), metres."""
        return self._first[0] * self.cell_m, self._first[1] * self.cell_m

    @property
    def center(self) -> tuple[float, float]:
        """Middle of the window, metres."""
        half = self.cells * self.cell_m / 2
        return self.corner_m[0] + half, self.corner_m[1] + half

    def move(self, robot: Pose2 | None = None, *, odometry: Pose2 | None = None) -> None:
        """Move the robot; the window follows in whole cells.

        Parameters
        ----------
        robot : Pose2, optional
            Its pose in the map's frame, which is the field frame or that of odometry.
        odometry : Pose2, optional
            Alternatively its motion since the last call, in its frame then.

        Raises
        ------
        ArgumentError
            If both or neither is given, or it is not finite.
        """
        if (robot is None) == (odometry is None):
            raise ArgumentError("move needs either the robot's pose or its odometry")
        pose = robot if robot is not None else self._robot.compose(odometry)  # type: ignore[arg-type]
        if not np.isfinite(pose.array).all():
            raise ArgumentError(f"the robot's pose must be finite, got {pose}")
        self._robot = pose
        half = self.cells // 2
        first = (math.floor(pose.x_m / self.cell_m) - half, math.floor(pose.y_m / self.cell_m) - half)
        shift = (first[0] - self._first[0], first[1] - self._first[1])
        if shift == (0, 0):
            return
        for name in self.sensors:
            _scroll(self._log_odds[name], shift)
            _scroll(self._counts[name], shift)
        self._first = first
        self._state = None

    def evidence(self, sensor: str, profile: RangeProfile, *, mask: npt.ArrayLike | None = None) -> Int8Array:
        """Return the evidence of each cell by a profile measured from the robot's pose.

        Returns
        -------
        (N, N) int8
            `HIT` (the paper's O), `CROSSED` (not O) or `SILENT` (none) of the kernel.
        """
        model = self._model(sensor)
        discs = self._discs(mask)
        # a copy, because the loop would be compiled again for a read-only array
        hit, depth_m = profile.hit.copy(), np.asarray(profile.depth_m)
        if len(discs):
            hit = hit & ~self._on_disc(profile, discs)
        out = np.empty((self.cells, self.cells), dtype=np.int8)
        lower, upper = cones(profile.bearing_rad)
        corner_x, corner_y = self.corner_m
        robot = self._robot
        kernel.gather_evidence(
            kernel.SensorInGrid(corner_x, corner_y, self.cell_m, robot.x_m, robot.y_m, robot.theta_rad),
            kernel.ProfileArrays(profile.bearing_rad, lower, upper, profile.range_m, depth_m, hit),
            model.nearest_m,
            model.reach_m,
            discs,
            out,
        )
        return out

    def update(self, sensor: str, profile: RangeProfile, *, mask: npt.ArrayLike | None = None) -> None:
        """Update the map with a profile that a sensor measures from the robot's pose.

        Parameters
        ----------
        sensor : str
            Its name.
        profile : RangeProfile
            Its measurement.
        mask : (D, 3) array_like, optional
            Discs x, y, radius of tracked robots in the map's frame, metres. Cells that touch them get no evidence, and
            hits at them are no evidence of fixed obstacles; cells in front of them still count as free.

        Raises
        ------
        ArgumentError
            If there is no such sensor, or the mask is not (D, 3) and finite.
        """
        model = self._model(sensor)
        evidence = self.evidence(sensor, profile, mask=mask)
        grids = self._log_odds[sensor], self._counts[sensor]
        kernel.add_evidence(evidence, model.hit_step, model.crossed_step, self._max_odds, *grids)
        self._state = None

    def probability(self, sensor: str) -> FloatArray:
        """Return (N, N) float64: the probability that each cell is occupied, by one sensor."""
        self._model(sensor)
        return np.asarray(1 / (1 + np.exp(-self._log_odds[sensor].astype(np.float64))))

    def observations(self, sensor: str) -> Int32Array:
        """Return (N, N) int32: number of observations of each cell by one sensor."""
        self._model(sensor)
        return self._counts[sensor].copy()

    def sensor_state(self, sensor: str) -> UInt8Array:
        """Return (N, N) uint8: FREE, NO_GO or UNDECIDED by one sensor alone."""
        self._model(sensor)
        odds = self._log_odds[sensor]
        free, no_go = odds < self._free_odds, odds > self._no_go_odds
        return np.where(free, FREE, np.where(no_go, NO_GO, UNDECIDED)).astype(np.uint8)

    @property
    def state(self) -> UInt8Array:
        """(N, N) uint8, read-only: FREE, NO_GO or UNDECIDED by all sensors together; first index along x."""
        if self._state is None:
            some_free = np.zeros((self.cells, self.cells), dtype=np.bool_)
            agreed, blocked = ~some_free, some_free.copy()
            for name in self.sensors:
                own = self.sensor_state(name)
                some_free |= own == FREE
                blocked |= own == NO_GO
                agreed &= (own == FREE) | ((own == UNDECIDED) & (self._counts[name] >= self._needed[name]))
            state = np.where(some_free & agreed, FREE, np.where(blocked, NO_GO, UNDECIDED)).astype(np.uint8)
            state.flags.writeable = False
            self._state = state
        return self._state

    def free_space(self, robot: Pose2, bearing_rad: npt.ArrayLike, *, nearest_m: float = 0.0) -> FreeSpace:
        """Return free ranges around a pose, for steering: the range of the first cell in each cone that is not FREE.

        Masked robots are not in the map. Steer by the smaller of these ranges and those of the present frame.

        Parameters
        ----------
        robot : Pose2
            Pose in the map's frame, inside the window.
        bearing_rad : (J,) array_like
            Bearings in the robot frame, ascending within one turn.
        nearest_m : float
            Cells that reach nearer than this are ignored, because the robot stands there or nothing is measured there.

        Raises
        ------
        ArgumentError
            If the pose lies outside the window, or the bearings do not ascend within one turn.
        """
        bearing = np.array(bearing_rad, dtype=np.float64)
        # checks the bearings
        bearing = RangeProfile(bearing, np.zeros(bearing.shape), np.zeros(bearing.shape, dtype=np.bool_)).bearing_rad
        x, y = robot.x_m - self.corner_m[0], robot.y_m - self.corner_m[1]
        if not (0 <= x < self.cells * self.cell_m and 0 <= y < self.cells * self.cell_m):
            raise ArgumentError(f"the pose must lie inside the map around {self.center}, got {robot}")
        out = np.empty(len(bearing))
        lower, upper = cones(bearing)
        corner_x, corner_y = self.corner_m
        sensor = kernel.SensorInGrid(corner_x, corner_y, self.cell_m, robot.x_m, robot.y_m, robot.theta_rad)
        kernel.free_ranges(sensor, lower, upper, nearest_m, self.state == FREE, out)
        out.flags.writeable = False
        return FreeSpace(bearing, out)

    def _model(self, sensor: str) -> SensorModel:
        model = self.sensors.get(sensor)
        if model is None:
            raise ArgumentError(f"there is no sensor {sensor!r}: they are {', '.join(self.sensors)}")
        return model

    def _discs(self, mask: npt.ArrayLike | None) -> FloatArray:
        if mask is None:
            return _NO_DISCS
        discs = np.asarray(mask, dtype=np.float64)
        if not discs.size:
            return _NO_DISCS
        if discs.ndim != 2 or discs.shape[1] != 3 or not np.isfinite(discs).all():
            raise ArgumentError(f"mask must be finite and of rows x, y, radius, got shape {discs.shape}")
        return np.ascontiguousarray(discs)

    def _on_disc(self, profile: RangeProfile, discs: FloatArray) -> BoolArray:
        """Return (J,) bool: bearings whose measured range, up to its depth, lies on a disc or within a cell of it."""
        turn = profile.bearing_rad + self._robot.theta_rad
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        x, y = discs[:, 0] - self._robot.x_m, discs[:, 1] - self._robot.y_m
        along, aside = c * x + s * y, np.abs(c * y - s * x)
        near, far = profile.range_m[:, None], (profile.range_m + profile.depth_m)[:, None]
        beyond = np.maximum(np.maximum(near - along, along - far), 0.0)
        return np.asarray((np.hypot(beyond, aside) <= discs[:, 2] + self.cell_m).any(axis=1))


def _logit(probability: float) -> float:
    return math.log(probability / (1 - probability))


def _scroll(grid: npt.NDArray[np.float32] | Int32Array, shift: tuple[int, int]) -> None:
    """Move a grid's content in place when its window moves by a number of cells; new cells are 0."""
    size = len(grid)
    kept = np.zeros_like(grid)
    if abs(shift[0]) < size and abs(shift[1]) < size:
        source = tuple(slice(max(s, 0), size + min(s, 0)) for s in shift)
        target = tuple(slice(max(-s, 0), size + min(-s, 0)) for s in shift)
        kept[target] = grid[source]
    grid[:] = kept
