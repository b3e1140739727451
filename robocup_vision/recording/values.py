"""Values as plain data, exactly: what a call took and gave, and what a run was made of, for the file and back.

Floats come back bit for bit, infinities and NaN too. Only the classes in a table can be written or read, so that a file
from elsewhere can name nothing but values.
"""

from __future__ import annotations

import base64
import dataclasses
import math
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import msgspec
import numpy as np

from field_models.errors import ArgumentError, PacketError

# by class name: the module it is in. Fields that a class's __init__ does not take are its state, and are left out.
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


class ValueCodec:
    """Turns values into bytes and back.

    Parameters
    ----------
    types : mapping of str to str, optional
        Further classes: class name to module.
    """

    def __init__(self, types: Mapping[str, str] | None = None) -> None:
        self._types = {**VALUE_TYPES, **(types or {})}

    def pack(self, value: Any) -> bytes:
        """Return a value as MessagePack."""
        return msgspec.msgpack.encode(self.to_plain(value))

    def unpack(self, data: bytes) -> Any:
        """Return the value that `pack` was given.

        Raises
        ------
        PacketError
            If the bytes are no such value.
        """
        try:
            return self.from_plain(msgspec.msgpack.decode(data))
        except (msgspec.MsgspecError, TypeError, KeyError, ValueError, AttributeError, ImportError) as error:
            raise PacketError(f"a recorded value cannot be read ({error})") from None

    def to_json(self, value: Any) -> bytes:
        """Return a value as JSON: what a person may want to read."""
        return msgspec.json.format(msgspec.json.encode(self.to_plain(value)), indent=1)

    def from_json(self, data: bytes) -> Any:
        """Return the value that `to_json` was given; raises as `unpack`."""
        try:
            return self.from_plain(msgspec.json.decode(data))
        except (msgspec.MsgspecError, TypeError, KeyError, ValueError, AttributeError, ImportError) as error:
            raise PacketError(f"a recorded value cannot be read ({error})") from None

    def to_plain(self, value: Any) -> Any:
        """Return a value as numbers, strings, lists and mappings.

        Raises
        ------
        ArgumentError
            If it is of a class that is not in the table.
        """
        if value is None or isinstance(value, bool | str | bytes):
            return value
        if isinstance(value, int | np.integer):
            return int(value)
        if isinstance(value, float | np.floating):
            number = float(value)
            return number if math.isfinite(number) else {"float": repr(number)}
        if isinstance(value, np.ndarray):
            if value.dtype.hasobject:
                raise ArgumentError(f"an array of {value.dtype} cannot be recorded")
            return {"array": value.dtype.str, "shape": list(value.shape), "data": value.tobytes()}
        if isinstance(value, Mapping):
            return {"map": [[self.to_plain(key), self.to_plain(item)] for key, item in value.items()]}
        if isinstance(value, Sequence):
            return [self.to_plain(item) for item in value]
        return self._object(value)

    def _object(self, value: Any) -> Any:
        kind = type(value)
        name = kind.__name__
        if self._types.get(name) != kind.__module__ or not dataclasses.is_dataclass(kind):
            raise ArgumentError(f"a value of class {kind.__module__}.{name} cannot be recorded")
        fields = {f.name: self.to_plain(getattr(value, f.name)) for f in dataclasses.fields(kind) if f.init}
        return {"class": name, "fields": fields}

    def from_plain(self, plain: Any) -> Any:
        """Return the value that `to_plain` was given; sequences come back as tuples, arrays read-only."""
        if isinstance(plain, list):
            return tuple(self.from_plain(item) for item in plain)
        if not isinstance(plain, dict):
            return plain
        if "float" in plain:
            return float(plain["float"])
        if "array" in plain:
            data = plain["data"]
            raw = base64.b64decode(data) if isinstance(data, str) else data
            return np.frombuffer(raw, dtype=np.dtype(plain["array"])).reshape(plain["shape"])
        if "map" in plain:
            return {self.from_plain(key): self.from_plain(item) for key, item in plain["map"]}
        name = plain["class"]
        fields = {key: self.from_plain(item) for key, item in plain["fields"].items()}
        kind = getattr(import_module(self._types[name]), name)
        return kind(**fields)
