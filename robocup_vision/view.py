"""What one frame shows, for either kind of camera: pose, free floor, obstacles, lines and the ball. Robot frame."""

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
    """Stands in the place of a dataclass field's default, None: the field takes a value, or what works it out.

    Most robots never read these fields, so they are worked out when they are first read. A callable that is handed over
    must not depend on anything that changes later.
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
        The robot on the field, as this frame alone shows it.
    free_space : FreeSpace
        Free range in each direction.
    balls : tuple of Ball
        All balls, robot frame, the likeliest first.
    timings_s : mapping of str to float
        Seconds each stage took, and ``total``.
    boundary_radius_px : (K,) float64
        Image radius of the floor's edge at each of the polar view's bearings, NaN where none.
    marks : (K, M) uint8
        Polar samples: 0 blocked, 1 floor, 2 line, 3 ball.
    wall_radius_px : (K,) float64
        Where the pose predicts the walls; NaN where it predicts none.
    polar : PolarView, FloorView or None
        Where those samples lie; None where the camera's place over the floor is unknown: then free space, boundary and
        marks are empty, and there is no obstacle and no ball but a patterned one, whose size says how far away it is.
    camera : OmniCamera or PinholeCamera
        The camera as this frame shows it to be mounted on the robot: with the head's pan, tilt and roll as fitted.
    grid : FreeSpaceGrid or None
        The cells of the free space; None with `polar`.
    t_s : float or None
        When the frame was taken, as passed to `look`.
    belief : Belief or None
        Estimate over time, where `Vision` has a memory.
    measurement : PoseEstimate or None
        Estimate by the frame without the prior, where `pose` includes the prior; None: `pose` does not.
    edge_points : EdgePoints or None
        Where edges of the field were predicted and what the frame shows there, with method "edges"; else None.
    obstacle_finder : ObstacleFinder or None
        What `obstacles` are found by; None: there are none.
    thumbnail : (h, w, 3) uint8 or None
        Every fourth pixel of the frame, a copy: what `obstacles` tell hues by.
    warnings : tuple of str
        What seems to be wrong with the set-up: red and blue swapped, told once, and odometry up to this frame that no
        robot can do. Empty in almost every view.
    marking_source : MarkingSource or None
        What `markings` are found by; None: there are none.
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
        """The view of each camera: this one, or those of a rig (`RigView`), to draw on their frames."""
        return (self,)

    @property
    def ball(self) -> Ball | None:
        """The likeliest ball, robot frame; None: none is seen."""
        return self.balls[0] if self.balls else None

    @property
    def camera_pose(self) -> PoseEstimate | NotLocated:
        """The camera on the field: its foot on the floor, and the heading of its optical axis."""
        if isinstance(self.pose, NotLocated):
            return self.pose
        return self.pose.seen_from(self.camera.camera_in_robot)

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """One for each thing that stands on the floor and is no part of the field, the nearest first.

        See `ObstacleFinder`. Computed when asked for; so is the kind of each.
        """
        # NumPy finds a maximum several bytes at a time, `any` one after the other
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

        Measured by this frame alone; a located pose only says what of the field each is. Worked out when asked, from
        the frame itself: ask before its array is written to again. Empty where the camera's tilt is not known.

        Raises
        ------
        FrameError
            If the frame's array has been written to since it was looked at.
        """
        return Markings() if self.marking_source is None else self.marking_source.find(self.pose)

    def of_frame(self, frame: UInt8Array) -> View:
        """Return this view for a copy of its frame, (H, W, 3) uint8, BGR: what is worked out later reads the copy."""
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
        """(K, 2) float64: the floor's edge at each bearing, pixels; NaN rows where none."""
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

    `pose`, `free_space`, `balls`, `obstacles` and `measurement` are the body's, at the time `t_s`. What belongs to one
    picture stands in `views`: here `marks`, the boundary and the edge points are empty, `polar` and `grid` are None,
    and `camera` is the first one's. The free space goes all around; its range is NaN where no camera sees the floor.
    """

    #: of each camera, in the rig's order and at its frame's time. Its pose is the body's, its `measurement` what this
    #: camera measured. Without a frame it is `NotLocated`.
    views: tuple[View, ...] = ()
    motions: tuple[Pose2, ...] = ()  #: motion of the body from each frame to `t_s`, in its frame at that time
    robot_radius_m: float = 0.0  #: of a robot on this field

    def of_camera(self, number: int) -> View:
        """Return the view of one camera, by its place in the rig, with the body's belief: to show on its picture."""
        return replace(self.views[number], belief=self.belief)

    @cached_property
    def obstacles(self) -> tuple[Obstacle, ...]:
        """See `View.obstacles`: one for each thing, whether one or several cameras show it."""
        seen = [
            [move_obstacle(obstacle, motion) for obstacle in view.obstacles]
            for view, motion in zip(self.views, self.motions, strict=True)
        ]
        return join_obstacles(seen, self.robot_radius_m)

    @cached_property
    def markings(self) -> Markings:
        """See `View.markings`: those of all cameras, each by its own frame; what two of them show is there twice."""
        seen = [view.markings.moved(motion) for view, motion in zip(self.views, self.motions, strict=True)]
        return Markings(
            tuple(one for markings in seen for one in markings.segments),
            tuple(one for markings in seen for one in markings.crossings),
            tuple(one for markings in seen for one in markings.circles),
            tuple(one for markings in seen for one in markings.posts),
            tuple(one for markings in seen for one in markings.penalty_marks),
        )
