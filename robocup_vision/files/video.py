"""Reads video files one frame at a time, in order: seeking is not used, because it is not exact in most containers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array


@dataclass(frozen=True, slots=True)
class VideoInfo:
    """Content of a video, found by decoding it, because containers only estimate the number of frames."""

    announced: int  #: number of frames that its header announces
    #: time at which each frame is shown, from the beginning, strictly increasing; empty if it is not a video
    times_s: tuple[float, ...]
    has_times: bool = True  #: false if the file contains neither times nor a rate: `times_s` then counts frames
    turn_deg: int = 0  #: rotation for display that its header specifies; it is not applied


def open_video(path: str | Path) -> cv2.VideoCapture:
    """Open a video to read its frames as stored; an orientation in its header is not applied."""
    capture = cv2.VideoCapture(str(path))
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0.0)
    return capture


def video_info(path: str | Path) -> VideoInfo:
    """Return the times of all frames of a file that can be decoded; there are none if it is not a video."""
    capture = open_video(path)
    try:
        shown_s = []
        while capture.isOpened() and capture.grab():
            shown_s.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
        if not shown_s:
            return VideoInfo(0, ())
        announced, rate = int(capture.get(cv2.CAP_PROP_FRAME_COUNT)), capture.get(cv2.CAP_PROP_FPS)
        turn_deg = int(capture.get(cv2.CAP_PROP_ORIENTATION_META))
    finally:
        capture.release()
    if np.isfinite(shown_s).all() and (np.diff(shown_s) > 0).all():
        return VideoInfo(announced, tuple(shown_s), turn_deg=turn_deg)
    has_rate = bool(np.isfinite(rate) and rate > 0)
    period_s = 1.0 / rate if has_rate else 1.0
    return VideoInfo(announced, tuple(index * period_s for index in range(len(shown_s))), has_rate, turn_deg)


def read_video(path: str | Path, count: int, size_px: tuple[int, int]) -> Iterator[UInt8Array | FrameError]:
    """Yield `count` frames, (H, W, 3) uint8 BGR, or the error instead of one that cannot be used."""
    capture = open_video(path)
    try:
        for index in range(count):
            name = f"frame_{index:06d}"
            read, frame = capture.read()
            if not read:
                yield FrameError(f"{name}: cannot be decoded")
            elif frame.dtype != np.uint8 or frame.ndim != 3 or frame.shape[2] != 3:
                yield FrameError(f"{name}: is not 8-bit colour")
            elif (frame.shape[1], frame.shape[0]) != tuple(size_px):
                yield FrameError(
                    f"{name}: is {frame.shape[1]}x{frame.shape[0]}, the camera file says {size_px[0]}x{size_px[1]}"
                )
            else:
                yield np.asarray(frame, dtype=np.uint8)
    finally:
        capture.release()
