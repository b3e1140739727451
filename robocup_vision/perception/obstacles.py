"""Obstacles on the floor, with place and width."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, Int64Array, UInt8Array, read_only
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.kernels.floor.things import (
    AVERAGED_COLUMNS,
    FieldFeet,
    blocked_feet,
    drop_narrow,
    find_things,
)
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.hues import hues_of
from robocup_vision.perception.kinds.network import Kind
from robocup_vision.perception.polar_view import BODY_COLUMNS, PolarView

# width of posts and of paint in front of obstacles, relative to a robot's radius
_NARROW_RATIO = 0.5
# standard deviation of a uniform distribution over one step of the samples, in steps
_STEP_RATIO = 12.0**-0.5
_NO_POSE = read_only(np.empty((0, 0)))


@dataclass(frozen=True)
class Obstacle:
    """The near side of an object on the floor, robot frame."""

    #: middle of its near side
    x_m: float
    y_m: float
    width_m: float  #: distance between the ends of its near side
    #: bearing and range of its middle
    bearing_rad: float
    range_m: float
    #: standard deviation of its range, from the samples' spacing there and the camera's errors; NaN if not known
    range_std_m: float = math.nan
    #: hue of most of its saturated pixels, such as its team's, in the frame's colours: 0 red, a third of a turn green,
    #: two thirds blue. None if hardly any pixel is saturated.
    hue_rad: float | None = None
    #: computes its `kind`; None if it cannot be known
    kind_teller: Callable[[], Kind | None] | None = dataclass_field(default=None, repr=False, compare=False)

    @property
    def kind(self) -> Kind | None:
        """Its kind by a small network, "robot" or "person"; None if unknown, as in mirror cameras.

        Computed from the frame when it is read, so read it before the frame's array is written to again.

        Raises
        ------
        FrameError
            If the frame's array has been written to since it was looked at.
        """
        return None if self.kind_teller is None else self.kind_teller()

    @property
    def interval_rad(self) -> tuple[float, float]:
        """Bearings of its right and left end; the left one is greater by less than a turn."""
        half = math.atan2(self.width_m / 2, self.range_m)
        return self.bearing_rad - half, self.bearing_rad + half


class ObstacleFinder:
    """Finds objects that stand on the floor and are not part of the field.

    An obstacle hides the floor behind it, is at least half a robot wide, and stands out on at least one side: its feet
    are nearer than the next ones by half a robot's radius, or the next ones are the field's own. With a known pose,
    feet of the field's walls, boards, goals and beacons, and feet beyond the certain floor, are the field's own.
    Without one, a floor that ends gradually farther away ends at a wall or at the carpet's edge. Obstacles are not
    reported where the error of a range, one step of the samples, exceeds a robot's size.
    """

    def __init__(self, field: Field) -> None:
        self._radius_m = field.robot_radius_m
        panels = [goal.panels for goal in field.goals if goal.kind == "panels"]
        posts = [
            (goal.line_x_m, side * goal.width_m / 2, goal.post_radius_m)
            for goal in field.goals
            if goal.kind == "posts"
            for side in (-1, 1)
        ]
        posts += [(beacon.x_m, beacon.y_m, beacon.radius_m) for beacon in field.beacons]
        nets = [
            (goal.side, abs(goal.line_x_m), abs(goal.back_x_m), goal.width_m / 2)
            for goal in field.goals
            if goal.net is not None
        ]
        self._feet = FieldFeet(
            np.array(field.floor_polygon, dtype=np.float64),
            np.vstack([*panels, np.empty((0, 4))]),
            np.array(posts, dtype=np.float64).reshape(-1, 3),
            np.array(nets, dtype=np.float64).reshape(-1, 4),
        )

    def find(
        self,
        view: PolarView | FloorView,
        marks: UInt8Array,
        pose: PoseEstimate | NotLocated,
        edge_px: FloatArray | None = None,
        thumbnail: UInt8Array | None = None,
    ) -> tuple[Obstacle, ...]:
        """Return the obstacles, the nearest first.

        Parameters
        ----------
        marks : (K, M) uint8
            Marks of the samples: 0 blocked, else floor, line or ball.
        edge_px : (K,) float64, optional
            End of the floor on each bearing, as `view.radius_px`, NaN if not known. Feet close to it are measured by
            it; others are between the last sample of floor and the first blocked one.
        thumbnail : (h, w, 3) uint8, optional
            `hues.thumbnail_of` the frame, for the hues.
        """
        eye_m, used, step_rad = float(view.camera.viewpoint_m[2]), view.columns_in_use, view.row_step_rad
        columns = np.empty(view.bearings, dtype=np.int64)
        blocked_feet(marks, view.shown, view.range_m, BODY_COLUMNS, used, eye_m, self._radius_m, columns)
        drop_narrow(columns, view.range_m, used, _NARROW_RATIO * self._radius_m, step_rad, view.is_ring)
        places = _feet(view, columns, edge_px)
        robot, covariance = (0.0, 0.0, 0.0), _NO_POSE
        if isinstance(pose, PoseEstimate):
            robot, covariance = (pose.pose.x_m, pose.pose.y_m, pose.pose.theta_rad), pose.covariance
        # the last rows of a forward camera's view are outside the picture
        seen = view.bearings if isinstance(view, PolarView) else view.seen_bearings
        found = np.empty((seen, 6))
        count = find_things(
            columns[:seen],
            places[:seen],
            view.range_m,
            used,
            self._radius_m,
            step_rad,
            view.is_ring,
            view.camera.offset_m,
            robot,
            covariance,
            self._feet,
            found,
        )
        found[:count, 5] = _range_std_m(view, found[:count, 4], found[:count, 5])
        things = [Obstacle(*row) for row in found[:count].tolist()]
        # without its height a mirror camera cannot project points above the floor
        if thumbnail is None or not things or view.camera.height_m is None:
            return tuple(things)
        hues = hues_of(thumbnail, view.camera, found[:count, :2], found[:count, 2], self._radius_m)
        return tuple(replace(one, hue_rad=hue) for one, hue in zip(things, hues, strict=True))


def _range_std_m(view: PolarView | FloorView, range_m: FloatArray, step_m: FloatArray) -> FloatArray:
    """Return standard deviations (N,) of ranges (N,), from steps of the samples (N,) and from the camera's errors."""
    variance = (_STEP_RATIO * step_m) ** 2
    camera = view.camera
    if isinstance(camera, PinholeCamera):
        nod_m = (range_m**2 + camera.height_m**2) / camera.height_m * (camera.tilt_std_rad or 0.0)
        variance = variance + nod_m**2 + (range_m * camera.height_std_m / camera.height_m) ** 2
    return np.asarray(np.sqrt(variance))


def _feet(view: PolarView | FloorView, columns: Int64Array, edge_px: FloatArray | None) -> FloatArray:
    """Return the feet on the floor, (K, 2); mixed colours shift the first blocked sample, so edges are preferred."""
    at = columns - 0.5
    if edge_px is not None:
        edge = np.interp(edge_px, view.radius_px, np.arange(len(view.radius_px)))
        at = np.where(np.abs(edge - at) <= AVERAGED_COLUMNS, edge, at)
    before = np.minimum(at.astype(np.int64), np.maximum(view.columns_in_use - 2, columns - 1))
    part = (at - before)[:, None]
    return np.asarray((1.0 - part) * view.floor_at(before) + part * view.floor_at(before + 1))


def join_places(
    places_m: FloatArray, seen: npt.NDArray[np.bool_], gap_m: float, step_rad: float
) -> tuple[Obstacle, ...]:
    """Join neighbouring bearings whose places are close together; the last bearing is adjacent to the first.

    Parameters
    ----------
    places_m : (K, 2) float64
        Place of the object on each bearing, robot frame.
    seen : (K,) bool
        Bearings with an object.
    gap_m : float
        Gap, beyond the spacing of the bearings, at which neighbours are different objects.
    step_rad : float
        Spacing of the bearings.
    """
    if not seen.any():
        return ()
    space_m = np.hypot(*places_m.T) * step_rad
    apart_m = np.hypot(*(places_m - np.roll(places_m, 1, axis=0)).T)
    goes_on = seen & np.roll(seen, 1) & (apart_m < gap_m + space_m)
    # start at a gap, so that no object is divided at the last bearing
    order = np.roll(np.arange(len(seen)), -int(np.argmin(goes_on)))
    order = order[seen[order]]
    first = np.union1d([0], np.flatnonzero(~goes_on[order]))
    last = np.append(first[1:], len(order)) - 1
    bearings = last - first + 1
    x, y = (np.add.reduceat(places_m[order], first) / bearings[:, None]).T
    ends_m = np.hypot(*(places_m[order[last]] - places_m[order[first]]).T)
    width = ends_m + np.add.reduceat(space_m[order], first) / bearings
    found = np.column_stack([x, y, width, np.arctan2(y, x), np.hypot(x, y)])
    return tuple(Obstacle(*row) for row in found.tolist())
