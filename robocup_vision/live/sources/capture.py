"""Reads cameras, streams and videos with OpenCV.

A camera is read by a thread of its own, so that the newest frame is always available, and a camera that hangs or was
unplugged does not block the program. It is opened again until it is back. A video waits while it is not read.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol, cast

import cv2
import numpy as np

from field_models.errors import FileError, FrameError, RobocupVisionError
from robocup_vision.arrays import UInt8Array
from robocup_vision.files.video import open_video
from robocup_vision.live.handover.moment import RobotSetup
from robocup_vision.live.sources.source import (
    Newest,
    Source,
    SourceFrame,
    SourceOptions,
    setup_by_options,
    vision_by_options,
)
from robocup_vision.vision import Vision

# period at which a lost camera is opened again
_AGAIN_S = 1.0
# rate of a video that does not specify one
_USUAL_RATE_HZ = 30.0
_CLOSE_S = 2.0


class Capture(Protocol):
    """The used part of `cv2.VideoCapture`."""

    def isOpened(self) -> bool:
        """Whether it can be read."""
        ...

    def read(self) -> tuple[bool, UInt8Array | None]:
        """Read a frame."""
        ...

    def release(self) -> None:
        """Release the device."""
        ...


class CameraSource(Source):
    """A camera or a stream, which sets the rate of frames. Raises RobocupVisionError if it cannot be opened."""

    waits = False

    def __init__(
        self,
        name: str,
        device: int | str,
        options: SourceOptions,
        open_capture: Callable[[int | str], Capture] | None = None,
    ) -> None:
        self.name = name
        self._device, self._options = device, options
        self._open = open_capture or _open_capture
        self.setups = (setup_by_options(name, options),)
        capture = self._open(device)
        if not capture.isOpened():
            capture.release()
            raise RobocupVisionError(f"{name}: no camera or stream can be opened there")
        self._newest = Newest[tuple[float, UInt8Array]]()
        self._begin_s = time.monotonic()
        self._thread = threading.Thread(target=self._follow, args=(capture,), name=f"camera {name}", daemon=True)
        self._thread.start()

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return what looks at the frames."""
        return vision_by_options(setup, self._options, has_odometry=False)

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Return the newest frame, if there is one that has not been read; raises as `Source.read`."""
        newest = self._newest.take(timeout_s)
        if newest is None:
            return None if self._newest.is_closed else ()
        t_s, frame = newest
        return (SourceFrame(self.name, checked_frame(frame), t_s),)

    def close(self) -> None:
        """Release the camera."""
        self._newest.close()
        self._thread.join(_CLOSE_S)

    def _follow(self, capture: Capture) -> None:
        while not self._newest.is_closed:
            read, frame = capture.read() if capture.isOpened() else (False, None)
            if read and frame is not None:
                self.problem = ""
                self._newest.put((time.monotonic() - self._begin_s, frame))
                continue
            self.problem = "gives no frames (unplugged?); it is opened again until it does"
            capture.release()
            self._newest.wait_until_closed(_AGAIN_S)
            if not self._newest.is_closed:
                capture = self._open(self._device)
        capture.release()


class VideoSource(Source):
    """A video file, at its own rate; seeking is not offered, because it is not exact in most containers.

    Raises FileError if the file is not a video that can be read.
    """

    waits = True

    def __init__(self, path: str | Path, options: SourceOptions) -> None:
        self.name = str(path)
        self._options = options
        self.setups = (setup_by_options(self.name, options),)
        self._capture = open_video(path)
        if not self._capture.isOpened():
            self._capture.release()
            raise FileError(path, "is no video that can be read")
        announced = float(self._capture.get(cv2.CAP_PROP_FPS))
        self._rate_hz = announced if 0.1 < announced < 1000.0 else _USUAL_RATE_HZ
        self._number = 0

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return what looks at the frames."""
        return vision_by_options(setup, self._options, has_odometry=False)

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Return the next frame; raises as `Source.read`."""
        read, frame = self._capture.read()
        if not read:
            return None
        t_s = self._number / self._rate_hz
        self._number += 1
        return (SourceFrame(self.name, checked_frame(frame), t_s),)

    def close(self) -> None:
        """Close the file."""
        self._capture.release()


def _open_capture(device: int | str) -> Capture:
    return cast(Capture, cv2.VideoCapture(device))


def checked_frame(frame: object) -> UInt8Array:
    """Return a frame of 8-bit colour; raises FrameError if it is something else."""
    array = np.asarray(frame)
    if array.dtype != np.uint8 or array.ndim != 3 or array.shape[2] != 3:
        raise FrameError(f"a frame is not 8-bit colour: {array.shape} {array.dtype}")
    return array
