"""Video files read one frame at a time, in order: seeking is not exact in most containers, so nobody seeks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array


def count_video_frames(path: str | Path) -> tuple[int, int]:
    """Return how many frames can be decoded, 0 if it is no video, and how many its header announces.

    They are counted by decoding, because containers only estimate their number.
    """
    capture = cv2.VideoCapture(str(path))
    try:
        count = 0
        while capture.isOpened() and capture.grab():
            count += 1
        return count, int(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if count else 0
    finally:
        capture.release()


def read_video(path: str | Path, count: int, size_px: tuple[int, int]) -> Iterator[UInt8Array | FrameError]:
    """Yield `count` frames, (H, W, 3) uint8 BGR, or the error in place of one that cannot be used."""
    capture = cv2.VideoCapture(str(path))
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
