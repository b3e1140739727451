"""Candidates for moving objects: returns inside known free space (Miura 2004, section 2.4).

A return is a measured range to an object. Differences of two frames would need the robot's exact motion. Returns where
the floor was free before, or where the field has no wall, only need the pose and its covariance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, read_only
from robocup_vision.geometry import Pose2, turned_covariance
from robocup_vision.perception.obstacles import Obstacle, join_places

# least distance of a return inside free space from the border, in standard deviations of its position
_INSIDE_SIGMAS = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """An object detected where the floor is known to be free."""

    #: centre of the object, robot frame
    x_m: float
    y_m: float
    covariance: FloatArray  #: (2, 2) float64: covariance of the centre by the sensor's errors alone, square metres

    def __post_init__(self) -> None:
        covariance = read_only(self.covariance)
        if covariance.shape != (2, 2):
            raise ArgumentError(f"covariance must be (2, 2), got {covariance.shape}")
        object.__setattr__(self, "covariance", covariance)


@dataclass(frozen=True, eq=False)
class KnownFreeSpace:
    """Cells of the field frame in which no fixed object stands.

    Raises
    ------
    ArgumentError
        If the cells are not a table or have no size.
    """

    free: npt.NDArray[np.bool_]  #: (H, W) bool: row by y, column by x
    corner_m: tuple[float, float]  #: middle of cell [0, 0], field frame
    cell_m: float  #: side of a cell

    def __post_init__(self) -> None:
        free = np.array(self.free, dtype=bool)
        if free.ndim != 2 or not free.size:
            raise ArgumentError(f"free must be (H, W), got {free.shape}")
        if not self.cell_m > 0:
            raise ArgumentError(f"cell_m must be positive, got {self.cell_m}")
        free.flags.writeable = False
        object.__setattr__(self, "free", free)

    @classmethod
    def of_field(cls, field: Field, cell_m: float = 0.02) -> KnownFreeSpace:
        """Return the whole floor of a field as free space."""
        low, high = field.floor_polygon.min(axis=0), field.floor_polygon.max(axis=0)
        width, height = np.ceil((high - low) / cell_m).astype(int) + 1
        x, y = low[0] + cell_m * np.arange(width), low[1] + cell_m * np.arange(height)
        inside = field.contains(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)).reshape(height, width)
        return cls(inside, (float(low[0]), float(low[1])), cell_m)

    @cached_property
    def _depth_m(self) -> FloatArray:
        padded = np.pad(self.free, 1).astype(np.uint8)
        cells = cv2.distanceTransform(padded, cv2.DIST_L2, cv2.DIST_MASK_PRECISE)[1:-1, 1:-1]
        # distances are to the middle of the nearest cell that is not free
        return np.asarray(np.maximum(cells - 0.5, 0.0) * self.cell_m, dtype=np.float64)

    def depth_m(self, points_m: FloatArray) -> FloatArray:
        """Return the distances (...) of points (..., 2), field frame, from the border of free space; 0 outside."""
        column, row = np.moveaxis(np.rint((points_m - self.corner_m) / self.cell_m), -1, 0)
        height, width = self.free.shape
        known = (column >= 0) & (column < width) & (row >= 0) & (row < height)
        column, row = (np.where(known, v, 0).astype(np.int64) for v in (column, row))
        return np.where(known, self._depth_m[row, column], 0.0)


@dataclass(frozen=True, slots=True, eq=False)
class ReturnDetector:
    """Finds returns inside known free space, each as the centre of an object.

    Raises
    ------
    ArgumentError
        If radius or deviation is not positive.
    """

    known_free: KnownFreeSpace  #: only returns inside are candidates
    radius_m: float = 0.09  #: radius of the objects, upright cylinders: that of a robot of the small-size league
    #: standard deviation of a measured range: metres, plus a fraction of the range; for obstacles without their own one
    range_std: tuple[float, float] = (0.01, 0.02)
    longest_m: float = math.inf  #: greatest range of a return

    def __post_init__(self) -> None:
        if not self.radius_m > 0:
            raise ArgumentError(f"radius_m must be positive, got {self.radius_m}")
        if not (min(self.range_std) >= 0 and max(self.range_std) > 0):
            raise ArgumentError(f"range_std must be positive, got {self.range_std}")

    def in_profile(
        self, bearing_rad: FloatArray, range_m: FloatArray, robot: Pose2, robot_covariance: FloatArray | None = None
    ) -> tuple[Detection, ...]:
        """Return the detections in a range profile.

        Parameters
        ----------
        bearing_rad : (J,) float64
            Bearings, robot frame, ascending and evenly spaced.
        range_m : (J,) float64
            Range of the first object at each; not finite if there is none.
        robot : Pose2
            Pose of the robot at that time, field frame.
        robot_covariance : (3, 3) float64, optional
            Covariance of the pose.
        """
        seen = np.isfinite(range_m) & (range_m < self.longest_m)
        reach = np.where(seen, range_m, 0.0)
        ends = np.stack([reach * np.cos(bearing_rad), reach * np.sin(bearing_rad)], axis=-1)
        seen &= self._inside(ends, self._std_m(np.hypot(ends[:, 0], ends[:, 1])), robot, robot_covariance)
        spacing = float(np.median(np.diff(bearing_rad)))
        returns = join_places(ends, seen, gap_m=0.5 * self.radius_m, step_rad=spacing)
        return self._detections(returns)

    def in_obstacles(
        self, obstacles: Sequence[Obstacle], robot: Pose2, robot_covariance: FloatArray | None = None
    ) -> tuple[Detection, ...]:
        """Return the detections among `View.obstacles`; other parameters as in `in_profile`."""
        # blurred outlines leave thin blocked slivers beside an object and at a line's end, less than half its width
        wide = [o for o in obstacles if o.range_m < self.longest_m and o.width_m >= self.radius_m]
        if not wide:
            return ()
        std_m = self._stds_m(wide)
        inside = self._inside(np.array([[o.x_m, o.y_m] for o in wide]), std_m, robot, robot_covariance)
        return self._detections([o for o, is_inside in zip(wide, inside.tolist(), strict=True) if is_inside])

    def _std_m(self, range_m: FloatArray) -> FloatArray:
        return self.range_std[0] + self.range_std[1] * range_m

    def _stds_m(self, obstacles: Sequence[Obstacle]) -> FloatArray:
        """(N,) float64: standard deviations of the obstacles' ranges."""
        range_std_m = np.array([one.range_std_m for one in obstacles])
        return np.where(
            np.isfinite(range_std_m), range_std_m, self._std_m(np.array([one.range_m for one in obstacles]))
        )

    def _inside(
        self, points_m: FloatArray, std_m: FloatArray, robot: Pose2, robot_covariance: FloatArray | None
    ) -> npt.NDArray[np.bool_]:
        """Return whether points (..., 2), robot frame, with range errors (...), are certainly in free space."""
        reach = np.hypot(points_m[..., 0], points_m[..., 1])
        variance = std_m**2
        if robot_covariance is not None:
            place = float(np.linalg.eigvalsh(robot_covariance[:2, :2])[-1])
            variance = variance + place + reach**2 * float(robot_covariance[2, 2])
        depth = self.known_free.depth_m(robot.transform(points_m))
        return np.asarray(depth > _INSIDE_SIGMAS * np.sqrt(variance))

    def _detections(self, returns: Sequence[Obstacle]) -> tuple[Detection, ...]:
        found = []
        for near, std_m in zip(returns, self._stds_m(returns).tolist(), strict=True):
            # two objects side by side make one wide return
            count = max(1, round(near.width_m / (2 * self.radius_m)))
            width = near.width_m / count
            ahead, aside = math.cos(near.bearing_rad), math.sin(near.bearing_rad)
            out = near.range_m + near_side_ratio(0.5 * width / self.radius_m) * self.radius_m
            along = std_m**2
            # the hidden part of an object may be on either side
            hidden = max(2 * self.radius_m - width, 0.0)
            across = along + hidden**2 / 12
            covariance = turned_covariance(np.diag([along, across]), near.bearing_rad)
            for piece in range(count):
                off = (piece - 0.5 * (count - 1)) * width
                found.append(Detection(ahead * out - aside * off, aside * out + ahead * off, covariance))
        return tuple(found)


def near_side_ratio(half_width_ratio: float) -> float:
    """Return the mean distance of a disc's near side from its centre along the line of sight, in radii.

    Parameters
    ----------
    half_width_ratio : float
        Half of the visible width, over which the mean is taken, in radii; 1 or more for the whole disc.
    """
    half = min(half_width_ratio, 1.0)
    return 0.5 * (math.sqrt(1.0 - half * half) + math.asin(half) / half)


def in_field(
    detections: Sequence[Detection], robot: Pose2, robot_covariance: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return places (M, 2) and covariances (M, 2, 2) of detections in the field frame.

    A covariance (3, 3) of the robot's pose, field frame, is added to those of the detections.
    """
    local = np.array([[d.x_m, d.y_m] for d in detections]).reshape(-1, 2)
    spreads = turned_covariance(np.array([d.covariance for d in detections]).reshape(-1, 2, 2), robot.theta_rad)
    places = robot.transform(local)
    if robot_covariance is not None:
        by_pose = np.zeros((len(local), 2, 3))
        by_pose[:, 0, 0] = by_pose[:, 1, 1] = 1.0
        by_pose[:, 0, 2], by_pose[:, 1, 2] = robot.y_m - places[:, 1], places[:, 0] - robot.x_m
        spreads = spreads + by_pose @ np.asarray(robot_covariance) @ by_pose.transpose(0, 2, 1)
    return places, spreads
