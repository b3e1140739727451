"""Derives a steady time from the stamps of several cameras, whose clocks may step, restart and differ."""

from __future__ import annotations

import math

from robocup_vision.ssl.overview import MAX_CAMERAS
from robocup_vision.ssl.problems import Problems

# largest difference between the stamps of cameras with the same clock
_TOGETHER_S = 0.2
# a camera that was silent for this many frames of others no longer counts as sending
_SILENT_FRAMES = 20


class _CameraClock:
    """One camera: its last stamp, its clock's offset from steady time, and a stamp that is not accepted yet."""

    __slots__ = ("doubted_s", "frame", "last_s", "offset_s")

    def __init__(self) -> None:
        self.last_s: float | None = None
        self.offset_s = 0.0
        self.doubted_s: float | None = None
        self.frame = 0


class SteadyClock:
    """Converts stamps to steady time.

    Steady time equals the stamps as long as they are continuous. A stamp far from the expected one is not accepted
    until the next one of its camera agrees; then that camera's clock has stepped, and steady time continues.

    Parameters
    ----------
    max_gap_s : float
        Largest increase from one stamp of a camera to the next, unless its clock has stepped or it was silent.
    problems : Problems
        Collects notes on steps, and on stamps that are not used.
    """

    def __init__(self, max_gap_s: float, problems: Problems) -> None:
        self._max_gap_s, self._problems = max_gap_s, problems
        self._cameras: dict[int, _CameraClock] = {}
        self._reference: _CameraClock | None = None
        self._frames = 0
        self.newest_s = -math.inf

    @property
    def offset_s(self) -> float:
        """Offset of vision's clock from steady time, by the first camera for as long as it sends."""
        return 0.0 if self._reference is None else self._reference.offset_s

    def steady_s(self, camera_id: int, stamp_s: float) -> float | None:
        """Return the steady time of a camera's stamp; None if the stamp is not accepted (yet)."""
        if not math.isfinite(stamp_s):
            self._problems.add(f"camera {camera_id} sends a stamp that is no number")
            return None
        if camera_id not in self._cameras and len(self._cameras) >= MAX_CAMERAS:
            self._problems.add(f"there are more than {MAX_CAMERAS} cameras")
            return None
        camera = self._cameras.setdefault(camera_id, _CameraClock())
        self._frames += 1
        if self._reference is None:
            # steady time starts with the first stamp
            self._reference, camera.last_s = camera, stamp_s
        elif not self._is_continuous(camera, stamp_s):
            if not self._is_confirmed(camera, stamp_s):
                camera.doubted_s = stamp_s
                self._problems.add(
                    f"camera {camera_id} sends stamps out of order", self._description(camera_id, stamp_s)
                )
                return None
            self._set(camera_id, camera, stamp_s)
        camera.last_s, camera.doubted_s, camera.frame = stamp_s, None, self._frames
        if self._frames - self._reference.frame > _SILENT_FRAMES:
            self._reference = camera
        steady_s = stamp_s - camera.offset_s
        self.newest_s = max(self.newest_s, steady_s)
        return steady_s

    def _is_continuous(self, camera: _CameraClock, stamp_s: float) -> bool:
        if camera.last_s is None:
            # a new camera may have the same clock as the others
            camera.offset_s = self.offset_s
            return abs(stamp_s - camera.offset_s - self.newest_s) <= _TOGETHER_S
        return -_TOGETHER_S <= stamp_s - camera.last_s <= self._max_gap_s

    def _is_confirmed(self, camera: _CameraClock, stamp_s: float) -> bool:
        return camera.doubted_s is not None and 0 <= stamp_s - camera.doubted_s <= self._max_gap_s

    def _set(self, camera_id: int, camera: _CameraClock, stamp_s: float) -> None:
        """Accept the step of a camera's clock; steady time continues."""
        self._problems.add(f"camera {camera_id} has set its clock", self._description(camera_id, stamp_s))
        others_send = any(
            self._frames - other.frame <= _SILENT_FRAMES for other in self._cameras.values() if other is not camera
        )
        was_silent = camera.last_s is not None and stamp_s > camera.last_s and not others_send
        # after a silence the time advances beyond the gap, so that nothing from before it is used
        gone_s = 1.01 * self._max_gap_s if was_silent else 0.0
        camera.offset_s = stamp_s - self.newest_s - gone_s

    def _description(self, camera_id: int, stamp_s: float) -> str:
        camera = self._cameras[camera_id]
        if camera.last_s is None:
            apart_s = stamp_s - camera.offset_s - self.newest_s
            return f"the clock of camera {camera_id} is {apart_s:+.3f} s from the others'"
        return f"the clock of camera {camera_id} has gone from {camera.last_s:.3f} to {stamp_s:.3f} s"
