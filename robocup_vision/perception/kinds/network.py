"""Classifier of obstacles: a small convolutional network, run by OpenCV, on upright pictures of fixed scale.

The camera projects an upright rectangle over the obstacle's foot into the frame. Pictures cut out like that have the
same number of pixels for each metre at any distance, and are upright all over a fisheye's picture.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from typing import Literal, get_args

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.perception.networks import Shrunk, read_network

Kind = Literal["robot", "person"]
KINDS: tuple[Kind, ...] = get_args(Kind)

# width and height of the network's input; size of a pixel, metres; row of the foot, counted from below
SEEN_PX, PIXEL_M, FOOT_PX = (36, 48), 0.036, 4
# grid of exactly projected pixels; others are interpolated
_GRID_PX = 4
# least log-odds of a reported kind, 20 to 1
MIN_NATS = 3.0
# greatest range of an obstacle, because farther ones have too few pixels and were not in the training set
MAX_RANGE_M = 8.0


def upright_pictures(shrunk: Shrunk, camera: PinholeCamera, places_m: FloatArray, rim_px: int = 0) -> UInt8Array:
    """Cut upright rectangles (N, 48, 36, 3) out of a frame, each over a foot and facing the camera.

    Parameters
    ----------
    camera : PinholeCamera
        The camera as held in the frame.
    places_m : (N, 2) float64
        Feet on the floor, robot frame.
    rim_px : int
        Additional pixels on each side.
    """
    width, height = (side + 2 * rim_px for side in SEEN_PX)
    foot = height - 1 - rim_px - FOOT_PX
    ahead = places_m - np.array(camera.offset_m)
    ahead = ahead / np.maximum(np.hypot(ahead[:, 0], ahead[:, 1]), 1e-6)[:, None]
    # distortion is nearly linear between these columns and rows
    columns, rows = (np.linspace(0, side - 1, side // _GRID_PX) for side in (width, height))
    aside = PIXEL_M * ((width - 1) / 2 - columns)
    points = np.empty((len(places_m), len(rows), len(columns), 3))
    points[..., 0] = (places_m[:, :1] - aside * ahead[:, 1:])[:, None]
    points[..., 1] = (places_m[:, 1:] + aside * ahead[:, :1])[:, None]
    points[..., 2] = PIXEL_M * (foot - rows)[:, None]
    grid = camera.point_to_pixel(points)
    beside, low, middle = columns[1], int(np.searchsorted(rows, foot)), len(columns) // 2
    scales = np.linalg.norm(grid[:, low, middle] - grid[:, low, middle - 1], axis=1) / beside
    scales = np.where(np.isfinite(scales), np.maximum(scales, 1e-3), 1.0)
    at_column, at_row = (
        np.arange(side) * ((len(lines) - 1) / (side - 1)) for side, lines in ((width, columns), (height, rows))
    )
    between_u, between_v = (one.astype(np.float32) for one in np.meshgrid(at_column, at_row))
    found = np.empty((len(places_m), height, width, 3), dtype=np.uint8)
    for one, at, scale in zip(found, grid, scales.tolist(), strict=True):
        one[:] = shrunk.bent_part(cv2.remap(at.astype(np.float32), between_u, between_v, cv2.INTER_LINEAR), scale)
    return found


class KindNetwork:
    """The network; not shared between threads.

    Parameters
    ----------
    content : bytes, optional
        ONNX file; the package's own by default.
    """

    def __init__(self, content: bytes | None = None) -> None:
        folder = files("robocup_vision.perception.kinds")
        self._network = read_network(content or (folder / "kind.onnx").read_bytes())

    def nats(self, pictures: UInt8Array) -> FloatArray:
        """Return the log-odds (N, 2) of each of `KINDS` in upright pictures (N, 48, 36, 3)."""
        answers = np.empty((len(pictures), len(KINDS) + 1))
        for answer, picture in zip(answers, pictures, strict=True):
            self._network.setInput(cv2.dnn.blobFromImage(picture))
            answer[:] = self._network.forward().reshape(-1)
        return log_odds(answers)


def log_odds(answers: FloatArray) -> FloatArray:
    """Return the log-odds (N, 2) of each of `KINDS` from the network's answers (N, 3), whose last is all else."""
    rest = [np.logaddexp.reduce(np.delete(answers, kind, axis=1), axis=1) for kind in range(len(KINDS))]
    return np.asarray(answers[:, : len(KINDS)] - np.stack(rest, axis=1))


class _OfThread(threading.local):
    """The network of each thread."""

    @cached_property
    def network(self) -> KindNetwork:
        return KindNetwork()


_OF_THREAD = _OfThread()


@dataclass(frozen=True, eq=False)
class KindSource:
    """A frame and its obstacles, of which the kinds are computed when needed."""

    frame: Callable[[], UInt8Array]  #: returns the frame, (H, W, 3) uint8, BGR
    camera: PinholeCamera  #: the camera as held in the frame
    places_m: FloatArray  #: (N, 2) float64: places of the obstacles, robot frame

    def kind(self, number: int) -> Kind | None:
        """Return the kind of an obstacle by its index; None if it is uncertain."""
        return self._kinds[number]

    @cached_property
    def _kinds(self) -> tuple[Kind | None, ...]:
        away_m = ((self.places_m - self.camera.offset_m) ** 2).sum(axis=1) ** 0.5
        pictures = upright_pictures(Shrunk(self.frame()), self.camera, self.places_m)
        nats = _OF_THREAD.network.nats(pictures)
        nats[away_m > MAX_RANGE_M] = -MIN_NATS
        return tuple(KINDS[int(one.argmax())] if one.max() >= MIN_NATS else None for one in nats)
