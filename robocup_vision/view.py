"""The view: what one frame shows, with any camera: pose, free floor, obstacles, lines and the ball. Robot frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, Generic, TypeVar, overload

import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.belief import Belief
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import EdgePoints, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor import free_floor
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.free_space import FreeSpace, FreeSpaceGrid
from robocup_vision.perception.joined import join_obstacles, move_obstacle
from robocup_vision.perception.kinds.network import KindSource
from robocup_vision.perception.markings.finder import MarkingSource
from robocup_vision.perception.markings.marking import Markings
from robocup_vision.perception.obstacles import Obstacle, ObstacleFinder
from robocup_vision.perception.polar_view import PolarView

Value = TypeVar("Value")


class WhenAsked(Generic[Value]):
    """Descriptor of a dataclass field that is set to a value, or to a callable that computes it; the default is None.

    Most robots never read these fields, so they are computed when they are first read. The callable must not depend on
    anything that changes later.
    """

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, owner: None, kind: type) -> Value | None: ...
    @overload
    def __get__(self, owner: object, kind: type) -> Value | None: ...
    def __get__(self, owner: object | None, kind: type) -> Value | None:
        if owner is None:
            return None
        value: Any = vars(owner)[self._name]
        if callable(value):
            value = vars(owner)[self._name] = value()
        return value  # type: ignore[no-any-return]

    def __set__(self, owner: object, value: Value | Callable[[], Value | None] | None) -> None:
        vars(owner)[self._name] = value


@dataclass(frozen=True)
class View:
    """What one frame shows.

    Parameters
    ----------
    pose : PoseEstimate or NotLocated
        Pose of the robot by this frame (and by the prior, if one was given).
    free_space : FreeSpace
        Free range in each direction.
    balls : tuple of Ball
        All balls, robot frame, the likeliest first.
    timings_s : mapping of str to float
        Computing time of each stage, and ``total``.
    boundary_radius_px : (K,) float64
        Image radius of the floor boundary at each of the polar view's bearings; NaN if there is none.
    marks : (K, M) uint8
        Classes of the polar samples: 0 blocked, 1 floor, 2 line, 3 ball.
    wall_radius_px : (K,) float64
        Image radius of the walls as the pose predicts them; NaN if it predicts none.
    polar : PolarView, FloorView or None
        Positions of those samples; None if the camera's pose above the floor is unknown. Then free space, boundary,
        marks and obstacles are empty, and only patterned balls are found, whose distance is estimated by their size.
    camera : OmniCamera or PinholeCamera
        The camera with its mounting in this frame: pan, tilt and roll as fitted.
    grid : FreeSpaceGrid or None
        The cells of the free space; None with `polar`.
    t_s : float or None
        Time of the frame, as passed to `look`.
    belief : Belief or None
        Estimate over time, if `Vision` has a memory.
    measurement : PoseEstimate or None
        Estimate by the frame without the prior, if `pose` includes the prior; None: `pose` does not include it.
    edge_points : EdgePoints or None
        Points at which edges of the field were predicted, and what the frame shows there; only with method "edges".
    obstacle_finder : ObstacleFinder or None
        Finds `obstacles`; None: there are none.
    thumbnail : (h, w, 3) uint8 or None
        Copy of every fourth pixel of the frame, for the hues of `obstacles`.
    warnings : tuple of str
        Probable faults of the set-up: swapped red and blue, reported once, and odometry since the last view that no
        robot can do. Empty in almost every view.
    marking_source : MarkingSource or None
        Finds `markings`; None: there are none.
    """

    pose: PoseEstimate | NotLocated
    free_space: FreeSpace
    balls: tuple[Ball, ...]
    timings_s: Mapping[str, float]
    boundary_radius_px: FloatArray
    marks: UInt8Array
    wall_radius_px: FloatArray
    polar: PolarView | FloorView | None
    camera: OmniCamera | PinholeCamera
    grid: FreeSpaceGrid | None
    t_s: float | None = None
    belief: Belief | None = None
    measurement: WhenAsked[PoseEstimate] = WhenAsked()
    edge_points: WhenAsked[EdgePoints] = WhenAsked()
    obstacle_finder: ObstacleFinder | None = None
    thumbnail: UInt8Array | None = None
    warnings: tuple[str, ...] = ()
    marking_source: MarkingSource | None = None

    def __post_init__(self) -> None:
        for array in (self.boundary_radius_px, self.marks, self.wall_radius_px, self.free_space.range_m):
            array.setflags(write=False)

    @property
    def views(self) -> tuple[View, ...]:
        """The view of each camera, to draw on its frame: this one, or those of a rig (`RigView`)."""
        return (self,)

    @property
    def ball(self) -> Ball | None:
        """The likeliest ball, robot frame; None if there is none."""
        return self.balls[0] if self.balls else None

    @property
    def camera_pose(self) -> PoseEstimate | NotLocated:
        """Pose of the camera, field frame: its foot on the floor, and the heading of its optical axis."""
        if isinstance(self.pose, NotLocated):
            return self.pose
        return self.pose.seen_from(self.camera.camera_in_robot)

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """The objects that stand on the floor and are not part of the field, robot frame, the nearest first.

        See `ObstacleFinder`. They are computed when first read, as is the kind of each.
        """
        # `max` is faster than `any`, since NumPy vectorises it
        if self.polar is None or self.obstacle_finder is None or not (self.marks.size and self.marks.max()):
            return ()
        finder, polar = self.obstacle_finder, self.polar
        found = finder.find(polar, self.marks, self.pose, self.boundary_radius_px, self.thumbnail)
        if self.marking_source is None or not isinstance(polar.camera, PinholeCamera) or not found:
            return found
        places = np.array([(one.x_m, one.y_m) for one in found])
        source = KindSource(partial(self.marking_source.unchanged_frame, "obstacles' kinds"), polar.camera, places)
        return tuple(replace(one, kind_teller=partial(source.kind, number)) for number, one in enumerate(found))

    @cached_property
    def markings(self) -> Markings:
        """Line segments, crossings, circles, goal posts and penalty marks, robot frame, each with its covariance.

        They are measured by this frame alone; the pose only identifies them with features of the field. They are
        computed from the frame when first read, before its array may change. Empty if the camera's tilt is unknown.

        Raises
        ------
        FrameError
            If the frame's array has been written to since it was looked at.
        """
        return Markings() if self.marking_source is None else self.marking_source.find(self.pose)

    def of_frame(self, frame: UInt8Array) -> View:
        """Return this view with its frame replaced by a copy, (H, W, 3) uint8, BGR, for values computed later."""
        source = self.marking_source
        if source is None or frame is source.frame:
            return self
        other = copy(self)
        vars(other)["marking_source"] = MarkingSource.of(source.finder, frame, source.camera, source.held_covariance)
        # the obstacles' kinds are read from the frame
        vars(other).pop("obstacles", None)
        return other

    @property
    def boundary_px(self) -> FloatArray:
        """(K, 2) float64: the floor boundary at each bearing, pixels; NaN if there is none."""
        if self.polar is None:
            return read_only(np.empty((0, 2)))
        return read_only(self.polar.to_pixel(self.polar.bearing_rad, self.boundary_radius_px))

    @property
    def line_points_px(self) -> FloatArray:
        """(N, 2) float64: polar samples on painted lines, pixels."""
        if self.polar is None:
            return read_only(np.empty((0, 2)))
        return read_only(self.polar.pixels[self.marks == free_floor.LINE])


@dataclass(frozen=True)
class RigView(View):
    """What the frames of several cameras on one body show together.

    `pose`, `free_space`, `balls`, `obstacles` and `measurement` are the body's, at the time `t_s`. Values that belong
    to one picture are in `views`: here `marks`, the boundary and the edge points are empty, `polar` and `grid` are
    None, and `camera` is the first one. The free space goes all around, with range NaN where no floor is seen.
    """

    #: View of each camera, in the rig's order and at its frame's time. Its pose is the body's, its `measurement` is by
    #: this camera alone. Without a frame the pose is `NotLocated`.
    views: tuple[View, ...] = ()
    motions: tuple[Pose2, ...] = ()  #: motion of the body from each frame to `t_s`, in the robot frame at that frame
    robot_radius_m: float = 0.0  #: radius of a robot on this field

    def of_camera(self, number: int) -> View:
        """Return the view of one camera, by its index in the rig, with the body's belief, to show on its picture."""
        return replace(self.views[number], belief=self.belief)

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """See `View.obstacles`; an object that several cameras show is one obstacle."""
        seen = [
            [move_obstacle(obstacle, motion) for obstacle in view.obstacles]
            for view, motion in zip(self.views, self.motions, strict=True)
        ]
        return join_obstacles(seen, self.robot_radius_m)

    @cached_property
    def markings(self) -> Markings:
        """See `View.markings`; a marking that two cameras show is there twice."""
        seen = [view.markings.moved(motion) for view, motion in zip(self.views, self.motions, strict=True)]
        return Markings(
            tuple(one for markings in seen for one in markings.segments),
            tuple(one for markings in seen for one in markings.crossings),
            tuple(one for markings in seen for one in markings.circles),
            tuple(one for markings in seen for one in markings.posts),
            tuple(one for markings in seen for one in markings.penalty_marks),
        )
