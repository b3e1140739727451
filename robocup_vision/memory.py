"""Memory: estimates the robot's pose, other robots and the free floor over time, from frames and odometry.

It combines the parts in `localization.filter`, `tracking` and `mapping`: tracked robots are masked out of the map, and
tracks and map are updated with the filtered pose, not with the pose of a single frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arguments import as_field, require_kind
from robocup_vision.belief import Belief, MapPicture, Track
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.checks import require_not_negative
from robocup_vision.compiling.prepared_kernels import prepare
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import FORWARD_FRAME_ERRORS, FrameErrors, OdometryNoise
from robocup_vision.localization.filter.pose_filter import PoseFilter
from robocup_vision.localization.filter.settings import Half, PoseFilterSettings
from robocup_vision.mapping.occupancy import FreeSpaceMap, FreeSpaceMapSettings
from robocup_vision.mapping.range_profile import floor_profile
from robocup_vision.mapping.sensor_model import default_sensors
from robocup_vision.mapping.view_motion import ViewMotion
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.tracking import KnownFreeSpace, MovingObjects, MovingObjectsSettings, ReturnDetector
from robocup_vision.view import View

_FLOOR = "floor"
# tolerance of the speed limit: odometry has errors, and robots may be somewhat faster than stated
_MAX_SPEED_RATIO = 1.5
_NO_TIME = "memory needs the time of a frame: hand t_s to look"


@dataclass(frozen=True, slots=True)
class MemorySettings:
    """Settings of `Memory` and its parts.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    poses: PoseFilterSettings = PoseFilterSettings()  #: settings of the pose filter
    odometry: OdometryNoise = OdometryNoise()  #: errors of the odometry
    frames: FrameErrors | None = None  #: errors of single frames; None: those of the kind of camera that `Vision` has
    objects: MovingObjectsSettings = MovingObjectsSettings()  #: settings of the tracking of other robots
    free_map: FreeSpaceMapSettings = FreeSpaceMapSettings()  #: settings of the map of the free floor
    longest_m: float = 1.3  #: obstacles farther away are measured too inaccurately to be tracked
    mask_margin_m: float = 0.05  #: margin around tracks that are masked out of the map: the error of their positions
    #: If the pose changes against odometry by more than this, the robot was elsewhere, since corrections are smaller.
    #: Tracks and map are then forgotten.
    jump_m: float = 0.25
    jump_rad: float = 0.35

    def __post_init__(self) -> None:
        for name in ("longest_m", "jump_m", "jump_rad"):
            if not getattr(self, name) > 0.0:
                raise ArgumentError(f"{name} must be positive, got {getattr(self, name)!r}")
        require_not_negative(self, "mask_margin_m")


class Memory:
    """Combines the views of a robot's frames over time; one object per robot.

    Parameters
    ----------
    field : Field or str
        The pitch, or the name of a built-in one, or the path of a field file.
    poses : PoseFilter, optional
        A pose filter; default: one with the settings' values, whose poses stay within the field's walls.
    objects : MovingObjects or None
        Tracks other robots. None: none are tracked.
    free_map : FreeSpaceMap or None
        Maps the free floor, by the sensor ``floor`` of its models. None: no map is made.
    object_radius_m : float, optional
        Radius of the robots that move on the field; by default that of the field's league.
    ego_motion : ViewMotion, optional
        Estimates the motion between the views of a mirror camera. It replaces missing odometry, and is fused with given
        odometry, since wheels may slip. Frames must then come in the order in which they were taken.
    half : {"own"}, optional
        The field half in which the robot starts, and again after `forget`: its own one, x < 0. Without it, and where
        nothing distinguishes the halves, both stay equally probable.
    limits : MotionLimits, optional
        Limits of this robot: odometry faster than 1.5 times its speed is ignored. Default: those of any robot.
    settings : MemorySettings, optional
        Settings of this object, and of those of its parts that it makes itself.

    Raises
    ------
    ArgumentError
        If the map has no sensor ``floor``, `half` is another value, or `limits` or `half` are given together with
        `poses`.

    Notes
    -----
    Call `predict` at each control step and `update` for each frame, or hand the object to `Vision`, which does both.
    Tracks and map are in the field frame, so there are none while the pose is unknown. Both are forgotten when the
    robot turns out to be elsewhere.
    """

    def __init__(
        self,
        field: Field | str | Path,
        *,
        poses: PoseFilter | None = None,
        objects: MovingObjects | None = None,
        free_map: FreeSpaceMap | None = None,
        object_radius_m: float | None = None,
        half: Half | None = None,
        ego_motion: ViewMotion | None = None,
        limits: MotionLimits | None = None,
        settings: MemorySettings = MemorySettings(),
    ) -> None:
        field = as_field(field)
        if ego_motion is not None:
            require_kind("ego_motion", ego_motion, ViewMotion, "a ViewMotion()")
        if limits is not None:
            require_kind("limits", limits, MotionLimits, "MotionLimits(speed_mps, ...)")
            if poses is not None:
                raise ArgumentError("limits are for the pose filter that Memory makes: leave out poses or limits")
            max_speed_mps = _MAX_SPEED_RATIO * limits.speed_mps
            settings = replace(settings, poses=replace(settings.poses, max_speed_mps=max_speed_mps))
        if half is not None and poses is not None:
            raise ArgumentError("half is for the pose filter that Memory makes: leave out poses or half")
        if free_map is not None and _FLOOR not in free_map.sensors:
            raise ArgumentError(f"the map needs a sensor {_FLOOR!r}, it has {', '.join(free_map.sensors)}")
        self.settings = settings
        self.field = field
        self._chooses_frame_errors = poses is None and settings.frames is None
        self.poses = poses or PoseFilter(
            odometry=settings.odometry, frames=settings.frames, settings=settings.poses, field=field, half=half
        )
        self.objects, self.free_map = objects, free_map
        self.ego_motion = ego_motion
        # odometry received since the last view; None: none was
        self._since_view: Pose2 | None = None
        self._predicted_s = -math.inf
        self.object_radius_m = field.robot_radius_m if object_radius_m is None else object_radius_m
        self._detector = None
        if objects is not None:
            floor = KnownFreeSpace.of_field(field)
            self._detector = ReturnDetector(floor, self.object_radius_m, longest_m=settings.longest_m)
        self._tracks: tuple[Track, ...] = ()
        self._last: tuple[float, Pose2] | None = None
        prepare("memory")

    @classmethod
    def of_everything(
        cls,
        field: Field | str | Path,
        settings: MemorySettings = MemorySettings(),
        limits: MotionLimits | None = None,
        half: Half | None = None,
    ) -> Memory:
        """Return a memory that also tracks other robots and maps the free floor, by the camera alone."""
        floor = {_FLOOR: default_sensors()[_FLOOR]}
        return cls(
            field,
            objects=MovingObjects(settings.objects),
            free_map=FreeSpaceMap(floor, settings.free_map),
            half=half,
            limits=limits,
            settings=settings,
        )

    def serve(self, camera: OmniCamera | PinholeCamera) -> None:
        """Set the error model of frames by the kind of camera, unless the user has given one; `Vision` calls this."""
        if self._chooses_frame_errors:
            self.poses.frame_errors = FORWARD_FRAME_ERRORS if isinstance(camera, PinholeCamera) else FrameErrors()

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Move the estimate by odometry: `PoseFilter.predict`."""
        self.poses.predict(odometry, t_s)
        if self.ego_motion is not None:
            self._predicted_s = t_s
            self._since_view = odometry if self._since_view is None else self._since_view.compose(odometry)

    def predict_by_view(self, view: View, odometry: Pose2 | None = None) -> None:
        """Move the estimate to a view by the motion that `ego_motion` finds in it.

        Parameters
        ----------
        view : View
            A view of a mirror camera with its time, which must be later than the view before and the last `predict`.
        odometry : Pose2, optional
            The robot's motion since the last `predict` or view, in the robot frame of that moment.

        Raises
        ------
        ArgumentError
            If there is no `ego_motion`, the view has no time or an earlier one, or it is not of a mirror camera.
        """
        t_s = view.t_s
        if t_s is None:
            raise ArgumentError(_NO_TIME)
        if self.ego_motion is None:
            raise ArgumentError(
                "predict_by_view needs a memory with ego_motion: Memory(field, ego_motion=ViewMotion())"
            )
        if t_s < self._predicted_s:
            raise ArgumentError(
                "with ego_motion no frame may be older than the last predict:"
                f" got {t_s!r} s after {self._predicted_s!r} s"
            )
        if odometry is not None and not self.can_move(odometry, t_s):
            odometry = None
        before = self._since_view
        reported = odometry if before is None else before if odometry is None else before.compose(odometry)
        motion = self.ego_motion.update(view, reported).motion
        # `predict` has already moved the estimate by the motion `before`
        self.poses.predict(motion if before is None else before.inverse().compose(motion), t_s)
        self._since_view = None

    def can_move(self, odometry: Pose2, t_s: float) -> bool:
        """Return whether a robot can have done this motion in the time since the last `predict`."""
        return self.poses.can_move(odometry, t_s)

    def prior(self, t_s: float) -> Pose2 | None:
        """Return the pose at a time, a prior for its frame: `PoseFilter.prior`."""
        return self.poses.prior(t_s)

    def prior_estimate(self, t_s: float) -> PoseEstimate | None:
        """Return the pose at a time, with its covariance: `PoseFilter.prior_estimate`."""
        return self.poses.prior_estimate(t_s)

    def update(self, view: View) -> Belief:
        """Update with the view of a frame.

        Parameters
        ----------
        view : View
            The view, with its time `t_s`. A view older than the last one updates the pose only.

        Raises
        ------
        ArgumentError
            If the view has no time.
        """
        if not isinstance(view, View):
            raise ArgumentError(f"update takes the view of a frame, got {type(view).__name__}")
        t_s = view.t_s
        if t_s is None:
            raise ArgumentError(_NO_TIME)
        self.poses.update(view.pose if view.measurement is None else view.measurement, t_s)
        if self.objects is not None or self.free_map is not None:
            self._update_surroundings(view, t_s)
        return self.belief(t_s)

    def belief(self, t_s: float) -> Belief:
        """Return the present estimates, marked with the time `t_s`."""
        picture = None
        pose = self.poses.belief
        if pose and self.free_map is not None and self._last is not None:
            picture = MapPicture(self.free_map.state, self.free_map.corner_m, self.free_map.cell_m)
        return Belief(t_s, pose, self.poses.hypotheses, self._tracks, picture)

    def forget(self) -> None:
        """Forget all estimates."""
        self.poses.forget()
        if self.ego_motion is not None:
            self.ego_motion.forget()
        self._since_view, self._predicted_s = None, -math.inf
        self._forget_surroundings()

    def _update_surroundings(self, view: View, t_s: float) -> None:
        then = self.poses.belief_at(t_s)
        if then is None:
            self._tracks = ()
        elif self._last is None or t_s > self._last[0]:
            if self._last is not None and self._has_jumped(*self._last):
                self._forget_surroundings()
            self._last = (t_s, then.pose)
            self._update_around(view, t_s, then)

    def _has_jumped(self, before_s: float, before: Pose2) -> bool:
        motion = self.poses.motion_since(before_s)
        now = self.poses.belief
        if motion is None or not now:
            return True
        away_m, away_rad = now.pose.error_to(before.compose(motion))
        return away_m > self.settings.jump_m or away_rad > self.settings.jump_rad

    def _update_around(self, view: View, t_s: float, robot: PoseEstimate) -> None:
        if self._detector is not None and self.objects is not None:
            detections = self._detector.in_obstacles(view.obstacles, robot.pose, robot.covariance)
            self._tracks = self.objects.update(t_s, detections, robot.pose, robot.covariance)
        if self.free_map is not None:
            around = self.object_radius_m + self.settings.mask_margin_m
            discs = np.array([(track.x_m, track.y_m, around) for track in self._tracks])
            self.free_map.move(robot.pose)
            for one in view.views:
                if one.marks.any():
                    self.free_map.update(_FLOOR, floor_profile(one), mask=discs)

    def _forget_surroundings(self) -> None:
        self._tracks, self._last = (), None
        if self.objects is not None:
            self.objects.forget()
        if self.free_map is not None:
            self.free_map.forget()
