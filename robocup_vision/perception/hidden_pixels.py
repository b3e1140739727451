"""Pixels that are hidden by a mask, or next to hidden ones."""

from __future__ import annotations

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array


def hidden_pixels(mask: UInt8Array | None) -> UInt8Array:
    """Return 1 where the 3 x 3 neighbourhood has a pixel hidden by a mask (H, W), (H, W) uint8; (0, 0) without one."""
    if mask is None:
        return np.empty((0, 0), dtype=np.uint8)
    return np.asarray(cv2.dilate((mask > 0).astype(np.uint8), np.ones((3, 3), np.uint8)), dtype=np.uint8)
