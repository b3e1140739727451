"""Classes of the values in a recording: inputs and outputs of calls, and the settings of a run."""

from __future__ import annotations

from collections.abc import Mapping

from robocup_vision.files.value_codec import ValueCodec

_CLASSES = {
    "field_models.field": ("Field", "Goal", "Mark", "Beacon", "Net"),
    "robocup_vision.avoidance.steering": ("SteeringSettings",),
    "robocup_vision.camera.fisheye": ("FisheyeCamera",),
    "robocup_vision.camera.floor_range": ("Hyperboloid", "Tangent", "Table"),
    "robocup_vision.camera.omni": ("OmniCamera",),
    "robocup_vision.camera.pinhole": ("Mounting", "PinholeCamera"),
    "robocup_vision.disc": ("Disc",),
    "robocup_vision.estimates": ("PoseEstimate", "NotLocated", "SwappedChannels"),
    "robocup_vision.geometry": ("Pose2",),
    "robocup_vision.localization.filter.errors": ("OdometryNoise", "FrameErrors"),
    "robocup_vision.localization.filter.settings": ("PoseFilterSettings",),
    "robocup_vision.mapping.ego_motion": ("EgoMotionSettings",),
    "robocup_vision.mapping.occupancy": ("FreeSpaceMapSettings",),
    "robocup_vision.mapping.sensor_model": ("SensorModel",),
    "robocup_vision.mapping.view_motion": ("ViewMotionSettings",),
    "robocup_vision.memory": ("MemorySettings",),
    "robocup_vision.motion_limits": ("MotionLimits",),
    "robocup_vision.perception.balls.ball": ("Ball",),
    "robocup_vision.perception.color_table": ("Colors",),
    "robocup_vision.perception.floor_color": ("FloorColor", "PaintColor"),
    "robocup_vision.perception.free_space": ("FreeSpace",),
    "robocup_vision.recording.run": ("VisionRun", "MemoryRun", "MapRun", "EgoMotionRun", "SteeringRun", "Run"),
    "robocup_vision.tracking.branches": ("MovingObjectsSettings",),
}
# module of each class, by the class's name
VALUE_TYPES: Mapping[str, str] = {name: module for module, names in _CLASSES.items() for name in names}


def value_codec(types: Mapping[str, str] | None = None) -> ValueCodec:
    """Return the codec of recordings, optionally with further classes (class name to module)."""
    return ValueCodec({**VALUE_TYPES, **(types or {})})
