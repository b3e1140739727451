"""What a recording's values may be: what calls took and gave, and what a run was made of."""

from __future__ import annotations

from collections.abc import Mapping

from robocup_vision.files.value_codec import ValueCodec

# by class name: the module it is in
VALUE_TYPES: Mapping[str, str] = {
    "Pose2": "robocup_vision.geometry",
    "PoseEstimate": "robocup_vision.estimates",
    "NotLocated": "robocup_vision.estimates",
    "SwappedChannels": "robocup_vision.estimates",
    "Disc": "robocup_vision.disc",
    "FreeSpace": "robocup_vision.perception.free_space",
    "Ball": "robocup_vision.perception.balls.ball",
    "Field": "field_models.field",
    "Goal": "field_models.field",
    "Mark": "field_models.field",
    "Beacon": "field_models.field",
    "Net": "field_models.field",
    "Mounting": "robocup_vision.camera.pinhole",
    "OmniCamera": "robocup_vision.camera.omni",
    "PinholeCamera": "robocup_vision.camera.pinhole",
    "Hyperboloid": "robocup_vision.camera.floor_range",
    "Tangent": "robocup_vision.camera.floor_range",
    "Table": "robocup_vision.camera.floor_range",
    "Colors": "robocup_vision.perception.color_table",
    "FloorColor": "robocup_vision.perception.floor_color",
    "PaintColor": "robocup_vision.perception.floor_color",
    "MotionLimits": "robocup_vision.motion_limits",
    "SteeringSettings": "robocup_vision.avoidance.steering",
    "OdometryNoise": "robocup_vision.localization.filter.errors",
    "FrameErrors": "robocup_vision.localization.filter.errors",
    "PoseFilterSettings": "robocup_vision.localization.filter.settings",
    "MovingObjectsSettings": "robocup_vision.tracking.branches",
    "FreeSpaceMapSettings": "robocup_vision.mapping.occupancy",
    "MemorySettings": "robocup_vision.memory",
    "SensorModel": "robocup_vision.mapping.sensor_model",
    "OnlineSettings": "robocup_vision.calibration.online.settings",
    "MirrorCalibrationSettings": "robocup_vision.calibration.online.settings",
    "PinholeCalibrationSettings": "robocup_vision.calibration.online.settings",
    "Robust": "robocup_vision.calibration.least_squares",
    "Noise": "robocup_vision.calibration.least_squares",
    "ParameterFilterSettings": "robocup_vision.calibration.online.parameter_filter",
    "ViewMotionSettings": "robocup_vision.mapping.view_motion",
    "EgoMotionSettings": "robocup_vision.mapping.ego_motion",
    "VisionRun": "robocup_vision.recording.run",
    "MemoryRun": "robocup_vision.recording.run",
    "MapRun": "robocup_vision.recording.run",
    "EgoMotionRun": "robocup_vision.recording.run",
    "SteeringRun": "robocup_vision.recording.run",
    "Run": "robocup_vision.recording.run",
}


def value_codec(types: Mapping[str, str] | None = None) -> ValueCodec:
    """Return the codec of recordings; with further classes, class name to module."""
    return ValueCodec({**VALUE_TYPES, **(types or {})})
