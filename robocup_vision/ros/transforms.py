"""Interpolates how a camera is mounted at a time, from /tf and /tf_static or from joint positions."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator
from typing import Any, Generic, TypeVar

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.messages.types import to_seconds

Value = TypeVar("Value")

# time for which values are kept, and largest gap that is interpolated
_KEPT_S, _MAX_GAP_S = 5.0, 0.5
_SAME_S = 1e-6
# time of a value that does not change
FOR_GOOD = -math.inf
# axes of a camera (ahead, left, up) in its optical frame (right, down, ahead), REP-103
_CAMERA_AXES = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
# a robot's tree of frames is not deeper; it limits the search if there is a loop
_MAX_FRAMES = 100


class Timeline(Generic[Value]):
    """The newest values of one quantity, by their times."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._values: list[Value] = []

    @property
    def newest(self) -> Value:
        """The value with the latest time."""
        return self._values[-1]

    def add(self, t_s: float, value: Value) -> None:
        """Add a value, in any order of time; one at `FOR_GOOD` replaces all others, until one with a time comes."""
        times, values = self._times, self._values
        if times and (FOR_GOOD in (times[-1], t_s) or t_s < times[-1] - _KEPT_S):
            # time went back, or the value for good changes
            times.clear()
            values.clear()
        at = bisect.bisect_left(times, t_s)
        times.insert(at, t_s)
        values.insert(at, value)
        while times[-1] - times[0] > _KEPT_S:
            del times[0], values[0]

    def bracketing(self, t_s: float) -> tuple[Value, Value, float] | None:
        """Return the values before and after a time, and the fraction of the interval before it; None: not known."""
        times, values = self._times, self._values
        if times[:1] == [FOR_GOOD]:
            return values[0], values[0], 0.0
        at = bisect.bisect_left(times, t_s)
        if at < len(times) and times[at] - t_s < _SAME_S:
            return values[at], values[at], 0.0
        if not 0 < at < len(times) or times[at] - times[at - 1] > _MAX_GAP_S:
            return None
        return values[at - 1], values[at], (t_s - times[at - 1]) / (times[at] - times[at - 1])


class Transforms:
    """The newest transforms of each frame relative to its parent."""

    def __init__(self) -> None:
        self._steps: dict[str, Timeline[tuple[str, FloatArray, FloatArray]]] = {}

    def add(self, message: Any, *, is_static: bool) -> None:
        """Add a tf2_msgs/TFMessage; transforms that are not finite, or whose quaternion is about 0, are skipped."""
        for one in message.transforms:
            place, turn = one.transform.translation, one.transform.rotation
            quaternion = np.array([turn.w, turn.x, turn.y, turn.z])
            values = np.array([place.x, place.y, place.z])
            length = float(np.linalg.norm(quaternion))
            if not (math.isfinite(length) and length > 1e-6 and np.isfinite(values).all()):
                continue
            t_s = FOR_GOOD if is_static else to_seconds(one.header.stamp)
            steps = self._steps.setdefault(one.child_frame_id.lstrip("/"), Timeline())
            steps.add(t_s, (one.header.frame_id.lstrip("/"), values, quaternion / length))

    def lookup(self, target: str, source: str, t_s: float) -> tuple[FloatArray, FloatArray] | None:
        """Return rotation (3, 3) and translation (3,), metres, of `source` in `target` at a time; None: not known."""
        above = list(self._ancestors(target))
        # transforms above the common frame, such as the robot's pose, are not needed
        common = next((frame for frame in self._ancestors(source) if frame in above), None)
        if common is None:
            return None
        one, other = self._pose_in(common, source, t_s), self._pose_in(common, target, t_s)
        if one is None or other is None:
            return None
        back = other[0].T
        return back @ one[0], back @ (one[1] - other[1])

    def _ancestors(self, frame: str) -> Iterator[str]:
        """Yield a frame, its parent, and so on up to the root."""
        for _ in range(_MAX_FRAMES):
            yield frame
            if frame not in self._steps:
                return
            frame = self._steps[frame].newest[0]

    def _pose_in(self, above: str, frame: str, t_s: float) -> tuple[FloatArray, FloatArray] | None:
        rotation, place = np.eye(3), np.zeros(3)
        for child in self._ancestors(frame):
            if child == above:
                break
            step = self._step_at(child, t_s)
            if step is None:
                return None
            turn = _matrix(step[1])
            rotation, place = turn @ rotation, turn @ place + step[0]
        return rotation, place

    def _step_at(self, child: str, t_s: float) -> tuple[FloatArray, FloatArray] | None:
        found = self._steps[child].bracketing(t_s)
        if found is None:
            return None
        (_, a, p), (_, b, q), part = found
        # between close quaternions linear interpolation is accurate enough
        mixed = (1.0 - part) * p + part * (q if float(p @ q) >= 0.0 else -q)
        return (1.0 - part) * a + part * b, mixed / float(np.linalg.norm(mixed))


class HeadJoints:
    """The newest positions of the joints that pan and tilt a camera, from sensor_msgs/JointState.

    Parameters
    ----------
    pan, tilt : str
        Names of the joints; empty: no such joint. A leading ``-`` reverses the sign.
    at_zero : PinholeCamera
        The camera with its joints at 0; their positions are added to its pan and tilt.
    """

    def __init__(self, pan: str, tilt: str, at_zero: PinholeCamera) -> None:
        signed = {"pan_rad": pan, "tilt_rad": tilt}
        self._joints = {key: (name.lstrip("-"), -1.0 if name.startswith("-") else 1.0) for key, name in signed.items()}
        self._at_zero = {key: getattr(at_zero, key) or 0.0 for key in signed}
        self._positions: dict[str, Timeline[float]] = {name: Timeline() for name, _ in self._joints.values() if name}

    def add(self, message: Any, t_s: float) -> None:
        """Add a JointState; positions that are not finite are skipped."""
        for name, position in zip(message.name, message.position, strict=False):
            if name in self._positions and math.isfinite(position):
                self._positions[name].add(t_s, float(position))

    def mounting_at(self, t_s: float) -> Mounting | None:
        """Return how the camera was mounted at a time; None: not known."""
        values: dict[str, float] = {}
        for key, (name, sign) in self._joints.items():
            if name:
                found = self._positions[name].bracketing(t_s)
                if found is None:
                    return None
                before, after, part = found
                values[key] = self._at_zero[key] + sign * ((1.0 - part) * before + part * after)
        return Mounting(**values)


def mounting_of(rotation: FloatArray, place_m: FloatArray) -> Mounting:
    """Return a camera's mounting, from rotation (3, 3) and place (3,) of its optical frame in the robot frame.

    The camera's horizontal offset is not part of it. Raises ArgumentError if the camera lies below the floor.
    """
    ahead, left, up = (rotation @ _CAMERA_AXES).T
    pan, tilt = math.atan2(ahead[1], ahead[0]), math.asin(max(-1.0, min(1.0, float(ahead[2]))))
    return Mounting(pan, tilt, math.atan2(float(left[2]), float(up[2])), float(place_m[2]))


def _matrix(quaternion: FloatArray) -> FloatArray:
    w, x, y, z = quaternion.tolist()
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
