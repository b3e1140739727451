"""Which overlay pictures of a run are kept: those of evenly spread images and of the worst ones.

Which images are worst is known only at the end, so a bounded heap keeps the worst so far as encoded JPEG. Several
processes may each keep their own heap: the worst of all are among the worst of each.
"""

from __future__ import annotations

import heapq

import cv2
import numpy as np

from robocup_vision.arrays import UInt8Array

WORST_COUNT = 8
SPREAD_COUNT = 16
_JPEG_QUALITY = 85

Severity = tuple[float, float]


def spread_indices(count: int) -> frozenset[int]:
    """Return at most `SPREAD_COUNT` indices, evenly spread over `count` images."""
    return frozenset(int(index) for index in np.linspace(0, count - 1, min(count, SPREAD_COUNT)).round())


class WorstSoFar:
    """The indices of the `WORST_COUNT` worst images, of equally bad ones the earlier, with a picture of each."""

    def __init__(self) -> None:
        self._heap: list[tuple[Severity, int, bytes]] = []

    def admits(self, index: int, severity: Severity) -> bool:
        """Whether this image belongs among the worst so far."""
        return len(self._heap) < WORST_COUNT or (severity, -index) > self._heap[0][:2]

    def add(self, index: int, severity: Severity, jpeg: bytes) -> None:
        """Add an image that `admits` lets in; the least bad one leaves."""
        push = heapq.heappush if len(self._heap) < WORST_COUNT else heapq.heapreplace
        push(self._heap, (severity, -index, jpeg))

    @property
    def pictures(self) -> list[tuple[int, bytes]]:
        """Index and JPEG of each, the worst first."""
        return [(-negative, jpeg) for _, negative, jpeg in sorted(self._heap, reverse=True)]


def encode_jpeg(image: UInt8Array) -> bytes:
    """Encode a BGR image for a report."""
    return cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()
