"""The pixels beside those that a mask hides."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array


def hidden_pixels(mask: UInt8Array | None) -> UInt8Array:
    """Return 1 where a mean over 3 x 3 pixels has one that a mask (H, W) hides, (H, W) uint8; (0, 0) without a mask."""
    if mask is None:
        return np.empty((0, 0), dtype=np.uint8)
    return np.asarray(cv2.dilate((mask > 0).astype(np.uint8), np.ones((3, 3), np.uint8)), dtype=np.uint8)
