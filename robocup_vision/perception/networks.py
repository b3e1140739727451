"""Scaled parts of frames, and loading of network files, shared by the small networks."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, UInt8Array


def read_network(content: bytes) -> Any:
    """Return the network of an ONNX file for OpenCV.

    Raises
    ------
    ArgumentError
        If the content is no such file.
    """
    try:
        return cv2.dnn.readNetFromONNX(np.frombuffer(content, dtype=np.uint8))
    except cv2.error as error:
        raise ArgumentError("the network's content is no ONNX file that OpenCV reads") from error


class Shrunk:
    """Parts of a frame at any scale, anti-aliased."""

    def __init__(self, frame: UInt8Array) -> None:
        self._frame = frame

    def part(self, left: float, top: float, scale: float, size: tuple[int, int]) -> UInt8Array:
        """Return a part as (H, W, 3) uint8; it is black outside the frame.

        Parameters
        ----------
        left, top : float
            Position of its first pixel's middle in the frame.
        scale : float
            Frame pixels for each pixel of the part.
        """
        width, height = size
        halved = self._halved((left, top, left + scale * width, top + scale * height), scale)
        if halved is None:
            return np.zeros((height, width, 3), dtype=np.uint8)
        shown, begin_u, begin_v, block = halved
        turned = np.array(
            [
                [scale / block, 0.0, (left - begin_u + 0.5) / block - 0.5],
                [0.0, scale / block, (top - begin_v + 0.5) / block - 0.5],
            ]
        )
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        return np.asarray(cv2.warpAffine(shown, turned, size, flags=flags), dtype=np.uint8)

    def bent_part(self, pixels: FloatArray, scale: float) -> UInt8Array:
        """Return the frame at given pixels as (H, W, 3) uint8; it is black outside the frame and for NaN.

        Parameters
        ----------
        pixels : (H, W, 2) float64
            Position in the frame of each pixel of the part.
        scale : float
            Approximate frame pixels for each pixel of the part.
        """
        height, width = self._frame.shape[:2]
        flat = pixels.reshape(-1, 2)
        is_in = ((flat > -1.0) & (flat < (width, height))).all(axis=1)
        inside = flat[is_in]
        halved = self._halved((*inside.min(axis=0), *inside.max(axis=0)), scale) if len(inside) else None
        if halved is None:
            return np.zeros((*pixels.shape[:2], 3), dtype=np.uint8)
        shown, begin_u, begin_v, block = halved
        at = (flat + 0.5 - (begin_u, begin_v)) / block - 0.5
        at[~is_in] = -9.0
        at_u, at_v = np.moveaxis(at.reshape(pixels.shape).astype(np.float32), -1, 0)
        return np.asarray(cv2.remap(shown, at_u, at_v, cv2.INTER_LINEAR), dtype=np.uint8)

    def _halved(self, box: tuple[float, float, float, float], scale: float) -> tuple[UInt8Array, int, int, int] | None:
        """Return the frame around a box, halved for a scale; its corner; and the side of its pixels in frame pixels.

        None if the box is outside the frame.
        """
        # averaged by halving before strong reductions, to avoid aliasing
        halvings = max(round(math.log2(scale)), 0)
        block = 2**halvings
        reach = max(scale, block)
        begin_u, end_u = _whole_blocks(box[0] - reach, box[2] + reach, block, self._frame.shape[1])
        begin_v, end_v = _whole_blocks(box[1] - reach, box[3] + reach, block, self._frame.shape[0])
        if end_u <= begin_u or end_v <= begin_v:
            return None
        shown = self._frame[begin_v:end_v, begin_u:end_u]
        for _ in range(halvings):
            half = (shown.shape[1] // 2, shown.shape[0] // 2)
            shown = np.asarray(cv2.resize(shown, half, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        return shown, begin_u, begin_v, block


def _whole_blocks(low: float, high: float, block: int, side: int) -> tuple[int, int]:
    """Return begin and end of the whole blocks of pixels that cover a stretch of a side of the frame."""
    begin, end = max(math.floor(low / block), 0), min(math.ceil(high / block), side // block)
    return begin * block, end * block
