"""Describes a run: field, camera, colours and all settings of its `Vision`, `Memory` and `Steering`, as values.

They are written into a recording, so that a replay can make the same objects again.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.avoidance.steering import Steering, SteeringSettings
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import FrameErrors, OdometryNoise
from robocup_vision.localization.filter.pose_filter import PoseFilter
from robocup_vision.localization.filter.settings import Half, PoseFilterSettings
from robocup_vision.mapping.ego_motion import EgoMotion, EgoMotionSettings
from robocup_vision.mapping.occupancy import FreeSpaceMap, FreeSpaceMapSettings
from robocup_vision.mapping.sensor_model import SensorModel
from robocup_vision.mapping.view_motion import ViewMotion, ViewMotionSettings
from robocup_vision.memory import Memory, MemorySettings
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.free_space import FREE_RATIO
from robocup_vision.tracking.branches import MovingObjectsSettings
from robocup_vision.tracking.moving_objects import MovingObjects
from robocup_vision.vision import Vision


@dataclass(frozen=True, slots=True, eq=False)
class MapRun:
    """Arguments of a `FreeSpaceMap`."""

    sensors: Mapping[str, SensorModel]
    settings: FreeSpaceMapSettings

    @classmethod
    def of(cls, free_map: FreeSpaceMap) -> MapRun:
        """Describe a map."""
        return cls(dict(free_map.sensors), free_map.settings)

    def make(self) -> FreeSpaceMap:
        """Make such a map, empty."""
        return FreeSpaceMap(self.sensors, self.settings)


@dataclass(frozen=True, slots=True, eq=False)
class EgoMotionRun:
    """Arguments of a `ViewMotion`; without `bearings` its `EgoMotion` is made at the first view."""

    odometry: OdometryNoise
    settings: ViewMotionSettings
    bearings: int | None = None
    comparison: EgoMotionSettings | None = None

    @classmethod
    def of(cls, motion: ViewMotion) -> EgoMotionRun:
        """Describe an estimator of ego-motion."""
        inner = motion.ego_motion
        if inner is None:
            return cls(motion.odometry, motion.settings)
        return cls(motion.odometry, motion.settings, inner.bearings, inner.settings)

    def make(self) -> ViewMotion:
        """Make such an estimator."""
        inner = None
        if self.bearings is not None:
            inner = EgoMotion(self.bearings, self.comparison or EgoMotionSettings())
        return ViewMotion(inner, self.odometry, self.settings)


@dataclass(frozen=True, slots=True, eq=False)
class MemoryRun:
    """Arguments of a `Memory` and its parts; `expected` is the argument of `PoseFilter.expect`, if it was called."""

    odometry: OdometryNoise
    frames: FrameErrors
    expected: Pose2 | None
    objects: MovingObjectsSettings | None
    free_map: MapRun | None
    object_radius_m: float
    ego_motion: EgoMotionRun | None
    poses: PoseFilterSettings
    settings: MemorySettings
    is_bounded: bool = True
    half: Half | None = None

    @classmethod
    def of(cls, memory: Memory) -> MemoryRun:
        """Describe a memory."""
        poses = memory.poses
        return cls(
            poses.odometry_noise,
            poses.frame_errors,
            poses.expected,
            None if memory.objects is None else memory.objects.settings,
            None if memory.free_map is None else MapRun.of(memory.free_map),
            memory.object_radius_m,
            None if memory.ego_motion is None else EgoMotionRun.of(memory.ego_motion),
            poses.settings,
            memory.settings,
            poses.is_bounded,
            poses.half,
        )

    def make(self, pitch: Field) -> Memory:
        """Make such a memory, empty."""
        poses = PoseFilter(
            odometry=self.odometry,
            frames=self.frames,
            settings=self.poses,
            field=pitch if self.is_bounded else None,
            half=self.half,
        )
        if self.expected is not None:
            poses.expect(self.expected)
        return Memory(
            pitch,
            poses=poses,
            objects=None if self.objects is None else MovingObjects(self.objects),
            free_map=None if self.free_map is None else self.free_map.make(),
            object_radius_m=self.object_radius_m,
            ego_motion=None if self.ego_motion is None else self.ego_motion.make(),
            settings=self.settings,
        )


@dataclass(frozen=True, slots=True, eq=False)
class VisionRun:
    """Arguments of a `Vision`."""

    field: Field
    camera: OmniCamera | PinholeCamera
    colors: Colors | None
    method: str
    mask: UInt8Array | None
    directions: int
    rings: int | tuple[float, ...]
    memory: MemoryRun | None
    free_ratio: float = FREE_RATIO

    @classmethod
    def of(cls, vision: Vision) -> VisionRun:
        """Describe a `Vision`, without the object that refines its camera (`online`)."""
        memory = None if vision.memory is None else MemoryRun.of(vision.memory)
        v = vision
        return cls(v.field, v.camera, v.fixed_colors, v.method, v.mask, v.directions, v.rings, memory, v.free_ratio)

    def make(self) -> Vision:
        """Make such a `Vision`, without any memory of frames."""
        return Vision(
            self.field,
            self.camera,
            self.colors,
            method=self.method,
            mask=self.mask,
            directions=self.directions,
            rings=self.rings,
            free_ratio=self.free_ratio,
            memory=None if self.memory is None else self.memory.make(self.field),
        )


@dataclass(frozen=True, slots=True, eq=False)
class SteeringRun:
    """Arguments of a `Steering`."""

    robot_radius_m: float
    limits: MotionLimits
    settings: SteeringSettings

    @classmethod
    def of(cls, steering: Steering) -> SteeringRun:
        """Describe a `Steering`."""
        limits = steering.limits
        plain = MotionLimits(limits.speed_mps, limits.acceleration_mps2, limits.dead_time_s)
        return cls(steering.robot_radius_m, plain, steering.settings)

    def make(self) -> Steering:
        """Make such a `Steering`, without any memory."""
        return Steering(self.robot_radius_m, self.limits, self.settings)


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """The description of a run."""

    #: the recorded loop: "vision" if the calls are those of `Vision` and `Steering` themselves, otherwise the name of
    #: an entry point of the group ``robocup_vision.loops``
    loop: str
    #: field and camera of the frames; colours are None if they were learnt
    field: Field
    camera: OmniCamera | PinholeCamera
    colors: Colors | None = None
    caveat: str = ""  #: why a replay cannot be equal bit for bit; empty if it can
    vision: VisionRun | None = None  #: for loop "vision"
    steering: SteeringRun | None = None  #: for loop "vision", if it steers
    setup: Mapping[str, object] = dataclasses.field(default_factory=dict)  #: for other loops: their arguments

    @classmethod
    def of(cls, vision: Vision, steering: Steering | None = None) -> Run:
        """Describe a run of `Vision` and, if there is one, `Steering`."""
        if vision.rig is not None:
            raise ArgumentError("a recording holds the frames of one camera, and this Vision looks through several")
        caveat = ""
        if vision.online is not None:
            caveat = "the camera was refined while it ran (online), which is not recorded"
        elif not vision.is_fresh or not (steering is None or steering.is_fresh):
            caveat = "the recording began in the middle of a run: what was remembered before is not in it"
        return cls(
            "vision",
            vision.field,
            vision.camera,
            vision.fixed_colors,
            caveat,
            VisionRun.of(vision),
            None if steering is None else SteeringRun.of(steering),
        )
