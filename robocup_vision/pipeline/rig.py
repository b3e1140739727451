"""The pipeline of several cameras on one body: one pose, the free floor all around, each ball and obstacle once.

Each camera measures the body's pose by its own frame; agreeing measurements are fused. The view is of the moment of the
look; odometry moves the measurements of older frames to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import NamedTuple

import numpy as np

from field_models.errors import ArgumentError, FrameError
from field_models.field import Field
from robocup_vision.arguments import as_time
from robocup_vision.arrays import UInt8Array
from robocup_vision.avoidance.recent_free_space import carry_free_space
from robocup_vision.camera.rig import Rig
from robocup_vision.estimates import NotLocated, PoseEstimate, SwappedChannels
from robocup_vision.geometry import Pose2
from robocup_vision.localization.field_half import in_both_halves
from robocup_vision.localization.filter.errors import OdometryNoise
from robocup_vision.localization.filter.settings import PoseFilterSettings
from robocup_vision.localization.fusion import fused, is_unambiguous, largest_group, motion_covariance, moved
from robocup_vision.localization.localizer import Localization
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.joined import SeenFloor, join_balls, join_free_space, move_ball
from robocup_vision.pipeline.frames import NO_FRAME, FrameOptions
from robocup_vision.pipeline.pinhole import PinholePipeline
from robocup_vision.view import RigView, View

_STILL = Pose2(0.0, 0.0, 0.0)


class RigFrames(NamedTuple):
    """The frames of one look, with their times."""

    frames: tuple[UInt8Array | None, ...]  #: one for each camera; None: it gave no frame
    taken_s: tuple[float | None, ...]  #: when each was taken
    #: returns the body's motion between two times, in the robot frame at the first; None if it is not known
    motion_between: Callable[[float, float], Pose2 | None]


def rig_frames(
    rig: Rig,
    frames: object,
    t_s: float | Sequence[float | None] | None,
    motion_between: Callable[[float, float], Pose2 | None],
) -> tuple[RigFrames, float | None]:
    """Return the frames of a look, and its time.

    Parameters
    ----------
    motion_between : callable
        See `RigFrames`.

    Raises
    ------
    FrameError
        If the number of frames differs from the number of cameras.
    ArgumentError
        If the number of times does, or a frame has no time where another has.
    """
    count = len(rig)
    if frames is None:
        frames = (None,) * count
    if not isinstance(frames, (tuple, list)) or len(frames) != count:
        got = len(frames) if isinstance(frames, (tuple, list)) else f"a {type(frames).__name__}"
        raise FrameError(f"a look of a rig takes a sequence of {count} frames, None where there is none, got {got}")
    if isinstance(t_s, (tuple, list)):
        if len(t_s) != count:
            raise ArgumentError(f"t_s of a rig must be one time, or one for each of its {count} frames, got {len(t_s)}")
        times = [None if one is None else as_time(one) for one in t_s]
        for name, one, frame in zip(rig.names, times, frames, strict=True):
            if one is None and frame is not None and any(other is not None for other in times):
                raise ArgumentError(f"t_s has no time for the frame of {name}")
        now_s = max((one for one in times if one is not None), default=None)
    else:
        now_s = None if t_s is None else as_time(t_s)
        times = [now_s] * count
    taken_s = tuple(None if one is None else one - latency for one, latency in zip(times, rig.latency_s, strict=True))
    return RigFrames(tuple(frames), taken_s, motion_between), now_s


class _Shot:
    """One camera's frame in a look, the body's motion since it was taken, and the pose found by it."""

    def __init__(self, number: int, pipeline: PinholePipeline, frame: UInt8Array, taken_s: float | None) -> None:
        self.number, self.pipeline, self.taken_s = number, pipeline, taken_s
        self.frame = frame
        self.motion, self.motion_covariance = _STILL, np.zeros((3, 3))
        self.answer: Localization | None = None
        self.seconds = 0.0

    def locate(self, prior: PoseEstimate | Pose2 | None, *, may_search: bool) -> PoseEstimate | NotLocated:
        """Locate the body, given a prior at the moment of the look; set `answer`, which is at the frame's time."""
        begin = perf_counter()
        if isinstance(prior, PoseEstimate):
            prior = self.then(prior)
        elif self.is_moved and prior is not None:
            prior = prior.compose(self.motion.inverse())
        self.answer = self.pipeline.locate(self.frame, self.pipeline.camera, self.taken_s, prior, may_search=may_search)
        self.seconds += perf_counter() - begin
        return self.answer.pose

    @property
    def is_moved(self) -> bool:
        """Whether the body moved, or may have, between the frame and the look."""
        return self.motion != _STILL or bool(self.motion_covariance.any())

    def now(self, estimate: PoseEstimate) -> PoseEstimate:
        """Move an estimate from the frame's time to the moment of the look."""
        return moved(estimate, self.motion, self.motion_covariance) if self.is_moved else estimate

    def then(self, estimate: PoseEstimate) -> PoseEstimate:
        """Move an estimate from the moment of the look to the frame's time."""
        return moved(estimate, self.motion.inverse(), self.motion_covariance) if self.is_moved else estimate

    def see(self, answer: Localization) -> View:
        """Return the camera's view."""
        return self.pipeline.see(self.frame, self.pipeline.camera, answer, self.taken_s, perf_counter() - self.seconds)


class _Fused(NamedTuple):
    """The body's pose at the moment of a look: `pose` with the prior, `measurement` without, and the frames used."""

    pose: PoseEstimate | NotLocated
    measurement: PoseEstimate | None
    shots: tuple[_Shot, ...] = ()


class RigPipeline:
    """Turns the frames of a rig into views.

    Parameters
    ----------
    options : tuple of FrameOptions
        One for each camera.
    """

    # floor samples belong to one camera, not to a rig
    polar = grid = None

    def __init__(self, field: Field, rig: Rig, options: tuple[FrameOptions, ...]) -> None:
        self.field, self.rig = field, rig
        self._directions = options[0].directions
        self._by_edges = options[0].method.by_edges
        self.pipelines = tuple(
            PinholePipeline(field, camera, one) for camera, one in zip(rig.cameras, options, strict=True)
        )
        # results must not depend on the order of the cameras in the file
        self._order = sorted(range(len(rig)), key=lambda k: (rig.cameras[k].pan_rad or 0.0, *rig.cameras[k].offset_m))
        self._noise, self._limits = OdometryNoise(), PoseFilterSettings()
        self._last_pose: Pose2 | None = None

    def with_rig(self, rig: Rig) -> RigPipeline:
        """Return this pipeline with another calibration of its rig: see `PinholePipeline.with_camera`."""
        other = copy(self)
        other.rig = rig
        other.pipelines = tuple(
            pipeline.with_camera(camera) for pipeline, camera in zip(self.pipelines, rig.cameras, strict=True)
        )
        return other

    def forget(self) -> None:
        """See `FramePipeline.forget`."""
        for pipeline in self.pipelines:
            pipeline.forget()
        self._last_pose = None

    @property
    def colors(self) -> Colors | None:
        """The colours of the first camera that has any."""
        return next((pipeline.colors for pipeline in self.pipelines if pipeline.colors is not None), None)

    @property
    def swapped_channels_nats(self) -> float:
        """See `Vision.swapped_channels_nats`: the sum over all cameras."""
        return sum(pipeline.swapped_channels_nats for pipeline in self.pipelines)

    def look(
        self, frames: RigFrames, t_s: float | None, odometry: Pose2 | None, prior: PoseEstimate | Pose2 | None
    ) -> View:
        """See `Vision.look`."""
        begin = perf_counter()
        if prior is None and odometry is not None and self._last_pose is not None:
            prior = self._last_pose.compose(odometry)
        shots, warnings = self._shots(frames, t_s)
        if not shots:
            return replace(self.drop(t_s, odometry), warnings=warnings)
        located = self._locate(shots, prior)
        seen = {shot.number: shot.see(self._body_localization(shot, located)) for shot in shots}
        views = tuple(
            seen[k] if k in seen else pipeline.drop(t_s, odometry) for k, pipeline in enumerate(self.pipelines)
        )
        pose, measurement = _unless_swapped(located, views)
        self._last_pose = pose.pose if pose else None
        motions = tuple(next((s.motion for s in shots if s.number == k), _STILL) for k in range(len(views)))
        return self._joined_view(views, motions, pose, measurement, t_s, begin, warnings)

    def drop(self, t_s: float | None = None, odometry: Pose2 | None = None) -> View:
        """Return the view of a moment at which no camera gave a frame."""
        begin = perf_counter()
        views = tuple(pipeline.drop(t_s, odometry) for pipeline in self.pipelines)
        known = self._last_pose if odometry is not None else None
        self._last_pose = None if known is None or odometry is None else known.compose(odometry)
        return self._joined_view(views, (_STILL,) * len(views), NotLocated(NO_FRAME), None, t_s, begin, ())

    def _shots(self, given: RigFrames, t_s: float | None) -> tuple[list[_Shot], tuple[str, ...]]:
        """Return the frames to be used, and warnings about those that are too old."""
        shots: list[_Shot] = []
        warnings: list[str] = []
        for number, pipeline in enumerate(self.pipelines):
            frame, taken_s = given.frames[number], given.taken_s[number]
            if frame is None:
                continue
            try:
                frame = pipeline.checked(frame)
            except FrameError as error:
                raise FrameError(f"{self.rig.names[number]}: {error}{self._hint(number, frame)}") from None
            shot = _Shot(number, pipeline, frame, taken_s)
            if taken_s is not None and t_s is not None and taken_s != t_s:
                motion, seconds = given.motion_between(taken_s, t_s), abs(t_s - taken_s)
                if seconds > self._limits.history_s:
                    warnings.append(f"{self.rig.names[number]}: its frame is {seconds:.2f} s old and is not used")
                    continue
                if motion is None:
                    limits = self._limits
                    std = np.array([limits.max_speed_mps, limits.max_speed_mps, limits.max_turn_rps]) * seconds / 3
                    shot.motion_covariance = np.diag(std**2)
                else:
                    shot.motion = motion
                    shot.motion_covariance = motion_covariance(motion, seconds, self._noise)
            shots.append(shot)
        return sorted(shots, key=lambda shot: self._order.index(shot.number)), tuple(warnings)

    def _hint(self, number: int, frame: object) -> str:
        """Return a hint at the camera that a frame of a wrong size may be from."""
        for other, camera in enumerate(self.rig.cameras):
            width, height = camera.size_px
            if other != number and getattr(frame, "shape", None) == (height, width, 3):
                return f", as frames of {self.rig.names[other]} are: are they in the order of the rig's cameras?"
        return ""

    def _locate(self, shots: list[_Shot], prior: PoseEstimate | Pose2 | None) -> _Fused:
        """Locate the body by all frames.

        Each camera follows the prior. Where no camera can, or there is no prior, they search one after the other. As
        soon as one has found an unambiguous pose, the others follow that.
        """
        alone = len(shots) == 1
        followed: list[_Shot] = []
        if prior is not None or alone or not self._by_edges:
            # a search takes long, and is not needed where at least one camera follows the prior
            for shot in shots:
                shot.locate(prior, may_search=alone or not self._by_edges)
            followed = [shot for shot in shots if shot.answer is not None and shot.answer.pose]
            if followed or alone or not self._by_edges:
                return self._fuse(shots, prior)
        found: PoseEstimate | None = None
        waiting: list[_Shot] = []
        for shot in shots:
            near = found if found is not None and is_unambiguous(found) else None
            pose = shot.locate(near if near is not None else prior, may_search=near is None)
            if pose and found is None:
                found = shot.now(_measured(shot))
            elif not pose and found is None:
                waiting.append(shot)
        if found is not None and is_unambiguous(found):
            for shot in waiting:
                shot.locate(found, may_search=False)
        return self._fuse(shots, prior)

    def _fuse(self, shots: list[_Shot], prior: PoseEstimate | Pose2 | None) -> _Fused:
        located = [shot for shot in shots if shot.answer is not None and shot.answer.pose]
        if not located:
            reasons = dict.fromkeys(f"{self.rig.names[shot.number]}: {_reason(shot)}" for shot in shots)
            return _Fused(NotLocated(_reason(shots[0]) if len(shots) == 1 else "; ".join(reasons)), None)
        if len(located) == 1:
            shot = located[0]
            assert shot.answer is not None
            pose, measurement = shot.answer.pose, shot.answer.measurement
            assert isinstance(pose, PoseEstimate)
            alone = None if measurement is None else shot.now(measurement())
            return _Fused(shot.now(pose), alone, (shot,))
        measured = [shot.now(_measured(shot)) for shot in located]
        groups = largest_group(measured, prior if isinstance(prior, PoseEstimate) else None)
        if len(groups) > 1:
            places = "; ".join(
                f"{self.rig.names[located[group[0]].number]} at ({measured[group[0]].x_m:.2f},"
                f" {measured[group[0]].y_m:.2f}) m"
                for group in groups
            )
            return _Fused(NotLocated(f"the cameras disagree on where the robot is: {places}"), None)
        chosen = groups[0]
        # the prior must count once: it is in the pose of `first`, which is fused with measurements without the prior
        first = next((k for k in chosen if _has_prior(located[k])), chosen[0])
        answer = located[first].answer
        assert answer is not None
        assert isinstance(answer.pose, PoseEstimate)
        pose = located[first].now(answer.pose)
        together = measured[first]
        for k in chosen:
            if k != first:
                pose, together = fused(pose, measured[k]) or pose, fused(together, measured[k]) or together
        return _Fused(pose, together, tuple(located[k] for k in chosen))

    def _body_localization(self, shot: _Shot, located: _Fused) -> Localization:
        """Return a camera's answer with its pose replaced by the body's fused pose."""
        answer = shot.answer
        assert answer is not None
        if isinstance(located.pose, NotLocated):
            return answer._replace(pose=located.pose, measurement=None)
        if len(located.shots) == 1 and located.shots[0] is shot:
            return answer
        measurement = partial(_measured, shot) if answer.pose else None
        is_of_it = any(other is shot for other in located.shots)
        answer = answer._replace(pose=shot.then(located.pose), measurement=measurement)
        # a camera that located the body elsewhere has estimated its mounting from the wrong pose
        return answer if is_of_it else answer._replace(camera=shot.pipeline.camera, held_covariance=None)

    def _joined_view(
        self,
        views: tuple[View, ...],
        motions: tuple[Pose2, ...],
        pose: PoseEstimate | NotLocated,
        measurement: PoseEstimate | None,
        t_s: float | None,
        begin: float,
        warnings: tuple[str, ...],
    ) -> View:
        floors = [
            floor for view, motion in zip(views, motions, strict=True) if (floor := _floor_of(view, motion)) is not None
        ]
        balls = join_balls(
            [
                [move_ball(ball, motion) if motion != _STILL else ball for ball in view.balls]
                for view, motion in zip(views, motions, strict=True)
            ]
        )
        all_warnings = (
            *warnings,
            *(f"{name}: {text}" for name, view in zip(self.rig.names, views, strict=True) for text in view.warnings),
        )
        timings: dict[str, float] = {}
        for view in views:
            for stage, seconds in view.timings_s.items():
                timings[stage] = timings.get(stage, 0.0) + seconds
        free_space = join_free_space(floors, self._directions)
        timings["total"] = perf_counter() - begin
        nothing, none = np.empty(0), np.empty((0, 0), dtype=np.uint8)
        return RigView(
            pose,
            free_space,
            balls,
            timings,
            nothing,
            none,
            np.empty(0),
            None,
            views[0].camera,
            None,
            t_s,
            measurement=measurement,
            warnings=all_warnings,
            views=views,
            motions=motions,
            robot_radius_m=self.field.robot_radius_m,
        )


def _unless_swapped(located: _Fused, views: tuple[View, ...]) -> tuple[PoseEstimate | NotLocated, PoseEstimate | None]:
    """Return the body's pose and measurement, corrected where a camera shows swapped red and blue channels.

    A camera's `SwappedChannels` replaces the pose; candidates of both halves are kept where a camera kept both.
    """
    pose, measurement = located.pose, located.measurement
    swapped = next((view.pose for view in views if isinstance(view.pose, SwappedChannels)), None)
    if swapped is not None or isinstance(pose, NotLocated):
        return pose if swapped is None else swapped, None
    if any(isinstance(v.pose, PoseEstimate) and len(v.pose.candidates) > len(pose.candidates) for v in views):
        return in_both_halves(pose), None if measurement is None else in_both_halves(measurement)
    return pose, measurement


def _measured(shot: _Shot) -> PoseEstimate:
    """Return the pose that a located camera measured without the prior."""
    assert shot.answer is not None
    assert isinstance(shot.answer.pose, PoseEstimate)
    return shot.answer.pose if shot.answer.measurement is None else shot.answer.measurement()


def _has_prior(shot: _Shot) -> bool:
    return shot.answer is not None and shot.answer.measurement is not None


def _reason(shot: _Shot) -> str:
    assert shot.answer is not None
    assert isinstance(shot.answer.pose, NotLocated)
    return shot.answer.pose.reason


def _floor_of(view: View, motion: Pose2) -> SeenFloor | None:
    """Return the free space of a camera at the moment of the look; None if it shows none."""
    free_space, grid = view.free_space, view.grid
    if grid is None:
        # no frame was given, and the free space is that of the frame before: its nearest and farthest view are unknown
        if not len(free_space.bearing_rad) or not free_space.range_m.any():
            return None
        nothing = np.zeros(len(free_space.bearing_rad))
        return SeenFloor(free_space, nothing, nothing + np.inf)
    if motion == _STILL:
        return SeenFloor(free_space, grid.nearest_m, grid.farthest_m)
    carried = carry_free_space(free_space, motion)
    # the view reached as far beyond the free range as it did at the frame's time
    return SeenFloor(carried, grid.nearest_m, carried.range_m + (grid.farthest_m - free_space.range_m))
