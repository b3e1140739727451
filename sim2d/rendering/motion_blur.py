"""The blur of a frame whose camera turns while it is exposed."""

from __future__ import annotations

import math

import cv2
import numpy as np

from robocup_vision.arrays import Float32Array, UInt8Array

MIN_LENGTH_PX = 1.0  # a shorter way does not show beside the lens's own blur
_POINTS = 64


def motion_kernel(du_px: float, dv_px: float) -> Float32Array:
    """Return the mean of pixels (K, L) along a way of so many pixels, in the middle of the kernel; its sum is 1."""
    length = math.hypot(du_px, dv_px)
    # points are shared out among whole pixels, which is itself a blur: of variance 1/6, as a way of sqrt(2) pixels
    shorter = math.sqrt(max(length * length - 2.0, 0.0)) / max(length, 1e-9)
    half_u, half_v = math.ceil(abs(du_px) / 2), math.ceil(abs(dv_px) / 2)
    kernel = np.zeros((2 * half_v + 3, 2 * half_u + 3))
    along = ((np.arange(_POINTS) + 0.5) / _POINTS - 0.5) * shorter
    u, v = along * du_px + half_u + 1, along * dv_px + half_v + 1
    whole_u, whole_v = np.floor(u).astype(int), np.floor(v).astype(int)
    part_u, part_v = u - whole_u, v - whole_v
    for du, dv, weight in (
        (0, 0, (1 - part_u) * (1 - part_v)),
        (1, 0, part_u * (1 - part_v)),
        (0, 1, (1 - part_u) * part_v),
        (1, 1, part_u * part_v),
    ):
        np.add.at(kernel, (whole_v + dv, whole_u + du), weight)
    if not (kernel[0].any() or kernel[-1].any()):
        kernel = kernel[1:-1]
    if not (kernel[:, 0].any() or kernel[:, -1].any()):
        kernel = kernel[:, 1:-1]
    return np.asarray(kernel / kernel.sum(), dtype=np.float32)


def motion_blur(frame: UInt8Array, du_px: float, dv_px: float) -> UInt8Array:
    """Return a frame (H, W, 3) as exposed while its picture moves by so many pixels right and down."""
    if math.hypot(du_px, dv_px) < MIN_LENGTH_PX:
        return frame
    blurred = cv2.filter2D(frame, -1, motion_kernel(du_px, dv_px), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.uint8)
