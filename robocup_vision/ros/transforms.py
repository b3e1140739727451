"""Transforms between coordinate frames as /tf and /tf_static tell them, looked up at a time."""

from __future__ import annotations

import bisect
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.mounting import Mounting
from robocup_vision.messages.types import to_seconds

# transforms are kept for so long, and two of a frame that are farther apart do not tell what was between them
_KEPT_S, _MAX_GAP_S = 5.0, 0.5
_STATIC = -math.inf
# axes of a camera (ahead, left, up) in its optical frame (right, down, ahead), REP-103
_OF_OPTICAL = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
# a tree of a robot is not deeper
_MOST_FRAMES = 100


class Transforms:
    """The newest transforms of each frame in its parent."""

    def __init__(self) -> None:
        self._times: dict[str, list[float]] = {}
        self._steps: dict[str, list[tuple[str, FloatArray, FloatArray]]] = {}

    def add(self, message: Any, *, is_static: bool) -> None:
        """Take a tf2_msgs/TFMessage in; what is not finite, or turns by no quaternion, is left out."""
        for one in message.transforms:
            place, turn = one.transform.translation, one.transform.rotation
            quaternion = np.array([turn.w, turn.x, turn.y, turn.z])
            values = np.array([place.x, place.y, place.z])
            length = float(np.linalg.norm(quaternion))
            if not (math.isfinite(length) and length > 1e-6 and np.isfinite(values).all()):
                continue
            t_s = _STATIC if is_static else to_seconds(one.header.stamp)
            child = one.child_frame_id.lstrip("/")
            times, steps = self._times.setdefault(child, []), self._steps.setdefault(child, [])
            if times and (times[-1] == _STATIC or is_static or t_s < times[-1] - _KEPT_S):
                # time went back, or another transform for good
                times.clear()
                steps.clear()
            at = bisect.bisect_left(times, t_s)
            times.insert(at, t_s)
            steps.insert(at, (one.header.frame_id.lstrip("/"), values, quaternion / length))
            while times[-1] - times[0] > _KEPT_S:
                del times[0], steps[0]

    def lookup(self, target: str, source: str, t_s: float) -> tuple[FloatArray, FloatArray] | None:
        """Return rotation (3, 3) and translation (3,) of `source` in `target` at a time; None: tf does not tell it."""
        above = list(self._ancestors(target))
        # what moves the whole robot is not asked for
        common = next((frame for frame in self._ancestors(source) if frame in above), None)
        if common is None:
            return None
        one, other = self._in(common, source, t_s), self._in(common, target, t_s)
        if one is None or other is None:
            return None
        back = other[0].T
        return back @ one[0], back @ (one[1] - other[1])

    def _ancestors(self, frame: str) -> Iterator[str]:
        """Yield a frame, its parent and so on."""
        for _ in range(_MOST_FRAMES):
            yield frame
            if frame not in self._steps:
                return
            frame = self._steps[frame][-1][0]

    def _in(self, above: str, frame: str, t_s: float) -> tuple[FloatArray, FloatArray] | None:
        rotation, place = np.eye(3), np.zeros(3)
        for child in self._ancestors(frame):
            if child == above:
                break
            step = self._at(child, t_s)
            if step is None:
                return None
            turn = _matrix(step[1])
            rotation, place = turn @ rotation, turn @ place + step[0]
        return rotation, place

    def _at(self, child: str, t_s: float) -> tuple[FloatArray, FloatArray] | None:
        times, steps = self._times[child], self._steps[child]
        if times[0] == _STATIC:
            return steps[0][1:]
        at = bisect.bisect_left(times, t_s)
        if at < len(times) and times[at] - t_s < 1e-6:
            return steps[at][1:]
        if not 0 < at < len(times) or times[at] - times[at - 1] > _MAX_GAP_S:
            return None
        (_, a, p), (_, b, q) = steps[at - 1], steps[at]
        part = (t_s - times[at - 1]) / (times[at] - times[at - 1])
        # so near each other a straight line between quaternions is as good as an arc
        mixed = (1.0 - part) * p + part * (q if float(p @ q) >= 0.0 else -q)
        return (1.0 - part) * a + part * b, mixed / float(np.linalg.norm(mixed))


def mounting_of(rotation: FloatArray, place_m: FloatArray) -> Mounting:
    """Return how a camera is held, by its optical frame in the robot's; offset apart.

    Parameters
    ----------
    rotation : (3, 3) float64
        Of the optical frame.
    place_m : (3,) float64
        Of the centre of projection.

    Raises
    ------
    ArgumentError
        If it lies below the floor.
    """
    ahead, left, up = (rotation @ _OF_OPTICAL).T
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
