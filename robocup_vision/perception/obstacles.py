"""Things that stand on the floor, each with a place and a width."""

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

# paint that leads up to a thing, and posts, are narrower than this part of a robot's radius
_NARROW_RATIO = 0.5
# standard deviation of a foot that lies anywhere within a step of the samples
_STEP_RATIO = 12.0**-0.5
_NO_POSE = read_only(np.empty((0, 0)))


@dataclass(frozen=True)
class Obstacle:
    """The near side of something that stands on the floor, robot frame."""

    #: middle of its near side
    x_m: float
    y_m: float
    width_m: float  #: distance between the ends of its near side
    #: of its middle
    bearing_rad: float
    range_m: float
    #: standard deviation of its range, by the samples' spacing there and the camera's errors; NaN: not known
    range_std_m: float = math.nan
    #: hue that most of what is saturated on it has, such as its team's: 0 red, a third of a turn green, two thirds
    #: blue, in the frame's colours as they are. None: next to nothing on it is saturated.
    hue_rad: float | None = None
    #: tells its `kind`; None: nothing does
    kind_teller: Callable[[], Kind | None] | None = dataclass_field(default=None, repr=False, compare=False)

    @property
    def kind(self) -> Kind | None:
        """Whether it is a "robot" or a "person", by a small network; None: nothing tells, as in mirror cameras.

        Worked out when asked, from the frame itself: ask before its array is written to again.

        Raises
        ------
        FrameError
            If the frame's array has been written to since it was looked at.
        """
        return None if self.kind_teller is None else self.kind_teller()

    @property
    def interval_rad(self) -> tuple[float, float]:
        """Bearings of its right and its left end; the left one is the greater, by less than a turn."""
        half = math.atan2(self.width_m / 2, self.range_m)
        return self.bearing_rad - half, self.bearing_rad + half


class ObstacleFinder:
    """Finds what stands on a field's floor and is no part of the field, one obstacle for each thing.

    A thing hides the floor behind it, is at least half a robot wide, and stands out before what is behind it on at
    least one side: its feet are nearer than the next ones by half a robot's radius, or these are the field's own. Where
    a pose is known, feet on the field's walls, boards, goals and beacons, and beyond where its floor is sure to reach,
    are the field's own. Where none is known, a floor that ends gradually farther away ends at a wall or a carpet's end.
    Things are left out where the error of a range, a step of the samples, is larger than a robot.
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
            What they show: 0 blocked, else floor, line or ball.
        edge_px : (K,) float64, optional
            Where each bearing's floor ends, as `view.radius_px`, NaN where not known: a foot that near is measured by
            it. Others lie between the last sample of floor and the first that is blocked.
        thumbnail : (h, w, 3) uint8, optional
            `hues.thumbnail_of` the frame, by which hues are measured.
        """
        eye_m, used, step_rad = float(view.camera.viewpoint_m[2]), view.columns_in_use, view.row_step_rad
        columns = np.empty(view.bearings, dtype=np.int64)
        blocked_feet(marks, view.shown, view.range_m, BODY_COLUMNS, used, eye_m, self._radius_m, columns)
        drop_narrow(columns, view.range_m, used, _NARROW_RATIO * self._radius_m, step_rad, view.is_ring)
        places = _feet(view, columns, edge_px)
        robot, covariance = (0.0, 0.0, 0.0), _NO_POSE
        if isinstance(pose, PoseEstimate):
            robot, covariance = (pose.pose.x_m, pose.pose.y_m, pose.pose.theta_rad), pose.covariance
        # rows that see nothing follow those in view of a camera that looks ahead
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
        # a mirror camera of unknown height does not know where it shows what stands above the floor
        if thumbnail is None or not things or view.camera.height_m is None:
            return tuple(things)
        hues = hues_of(thumbnail, view.camera, found[:count, :2], found[:count, 2], self._radius_m)
        return tuple(replace(one, hue_rad=hue) for one, hue in zip(things, hues, strict=True))


def _range_std_m(view: PolarView | FloorView, range_m: FloatArray, step_m: FloatArray) -> FloatArray:
    """Return standard deviations (N,) of ranges (N,): a foot lies within a step (N,), and the camera's errors count."""
    variance = (_STEP_RATIO * step_m) ** 2
    camera = view.camera
    if isinstance(camera, PinholeCamera):
        nod_m = (range_m**2 + camera.height_m**2) / camera.height_m * (camera.tilt_std_rad or 0.0)
        variance = variance + nod_m**2 + (range_m * camera.height_std_m / camera.height_m) ** 2
    return np.asarray(np.sqrt(variance))


def _feet(view: PolarView | FloorView, columns: Int64Array, edge_px: FloatArray | None) -> FloatArray:
    """Return where feet lie on the floor, (K, 2): colours that mix about a foot move the first blocked sample."""
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
    """Join neighbouring bearings whose places lie close together; the last bearing is the first one's neighbour.

    Parameters
    ----------
    places_m : (K, 2) float64
        What is met on each bearing, robot frame.
    seen : (K,) bool
        Bearings on which anything is.
    gap_m : float
        Neighbours farther apart than this are different things, beyond what their bearings' spacing explains.
    step_rad : float
        That spacing.
    """
    if not seen.any():
        return ()
    space_m = np.hypot(*places_m.T) * step_rad
    apart_m = np.hypot(*(places_m - np.roll(places_m, 1, axis=0)).T)
    goes_on = seen & np.roll(seen, 1) & (apart_m < gap_m + space_m)
    # from a gap on, so that a thing across the last bearing is whole
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
