"""Selects the overlay pictures of a run that are kept: those of evenly spread images and of the worst ones.

The worst images are known only at the end, so a bounded heap keeps the worst ones so far as encoded JPEG. Several
processes may each keep their own heap, because the worst of all are among the worst of each.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from typing import NamedTuple

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.evaluation.detections import Detection

WORST_COUNT = 8
SPREAD_COUNT = 16
CROP_COUNT = 48
_JPEG_QUALITY = 85

Severity = tuple[float, float]
_BOX_COLOR = (0, 200, 255)
# margin of a crop around its box, in pixels and in sizes of the box, and the least size of the crop, pixels
_AROUND_PX, _AROUND, _CROP_PX = 16.0, 1.0, 160.0


def spread_indices(count: int) -> frozenset[int]:
    """Return at most `SPREAD_COUNT` indices, evenly spread over `count` images."""
    return frozenset(int(index) for index in np.linspace(0, count - 1, min(count, SPREAD_COUNT)).round())


class WorstSoFar:
    """Indices and pictures of the `WORST_COUNT` worst images; of equally bad ones the earlier are kept."""

    def __init__(self) -> None:
        self._heap: list[tuple[Severity, int, bytes]] = []

    def admits(self, index: int, severity: Severity) -> bool:
        """Whether this image belongs among the worst so far."""
        return len(self._heap) < WORST_COUNT or (severity, -index) > self._heap[0][:2]

    def add(self, index: int, severity: Severity, jpeg: bytes) -> None:
        """Add an image for which `admits` is true; if there are too many, the least bad one is dropped."""
        push = heapq.heappush if len(self._heap) < WORST_COUNT else heapq.heapreplace
        push(self._heap, (severity, -index, jpeg))

    @property
    def pictures(self) -> list[tuple[int, bytes]]:
        """Index and JPEG of each, the worst first."""
        return [(-negative, jpeg) for _, negative, jpeg in sorted(self._heap, reverse=True)]


class Crop(NamedTuple):
    """A part of an image with a missed thing or a false detection, as JPEG."""

    caption: str
    jpeg: bytes


def error_crops(image: str, frame: UInt8Array, detections: Iterable[Detection]) -> tuple[Crop, ...]:
    """Cut the missed things and false detections out of an image, with the box or a small square drawn."""
    return tuple(_crop(image, frame, one) for one in detections if not one.is_hit)


def _crop(image: str, frame: UInt8Array, one: Detection) -> Crop:
    if one.box is not None:
        what, (x0, y0, x1, y1) = "missed", one.box
    else:
        assert one.place_px is not None
        u, v = one.place_px
        what, (x0, y0, x1, y1) = "false", (u - 4.0, v - 4.0, u + 4.0, v + 4.0)
    around = _AROUND_PX + _AROUND * max(x1 - x0, y1 - y0)
    height, width = frame.shape[:2]
    left, top = (min(max(int(low - around), 0), size - 1) for low, size in ((x0, width), (y0, height)))
    right, bottom = (
        max(min(int(high + around), size), low + 1) for high, size, low in ((x1, width, left), (y1, height, top))
    )
    part = frame[top:bottom, left:right]
    scale = max(_CROP_PX / max(part.shape[:2]), 1.0)
    shown = np.ascontiguousarray(cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC), np.uint8)
    first, last = ((round(scale * (x - left)), round(scale * (y - top))) for x, y in ((x0, y0), (x1, y1)))
    cv2.rectangle(shown, first, last, _BOX_COLOR, 1)
    return Crop(f"{image}: {one.kind}, {what}", encode_jpeg(shown))


def encode_jpeg(image: UInt8Array) -> bytes:
    """Encode a BGR image for a report."""
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
