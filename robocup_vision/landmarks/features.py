"""SIFT features with pixel, contrast and scale, and their matching.

After Ogawa et al. (2011), section 2.1: contrast is |D| of the difference of Gaussians, and the sample spacing d_s of
the octave in which a keypoint was found determines its precision.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.arguments import as_frame
from robocup_vision.arrays import Float32Array, FloatArray, Int64Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.kernels.landmarks.matching import Described, best_two

RATIO = 0.7  # greatest ratio of the distances of the nearest and the second nearest descriptor, eq. 3
# greatest ratio in the small window around a landmark's pixel by a known pose, which contains few rivals
KNOWN_RATIO = 0.85
# greatest factor between a feature's diameter and the expected one: half an octave and some noise
SIZE_RATIO = 1.6
# greatest distance of matching unit descriptors, also without a rival; that of orthogonal ones is 1.41
MAX_DISTANCE = 0.75
# factor on unit descriptors stored as bytes; the largest entries are near 0.4 after SIFT's own clipping
BYTE_SCALE = 512.0
# the paper's standard deviation 0.5 * d_s is that of quantisation, as if keypoints were not interpolated
PIXEL_STD_PER_SPACING = 0.5
# side of the tiles of `extract_near`, and width of their rim in which keypoints are dropped
TILE_PX = 56
TILE_MARGIN_PX = 5


@dataclass(frozen=True, slots=True, eq=False)
class Features:
    """Keypoints of one image."""

    pixels: FloatArray  #: (N, 2) float64: u and v without the lens's distortion (ideal pixels)
    size_px: FloatArray  #: (N,) float64: diameter of the described region
    spacing_px: FloatArray  #: (N,) float64: sample spacing d_s of the keypoint's octave
    contrast: FloatArray  #: (N,) float64: contrast |D|
    descriptors: Float32Array  #: (N, D) float32: unit vectors; D is 128 for SIFT

    def __len__(self) -> int:
        return len(self.pixels)

    def take(self, index: npt.NDArray[np.intp] | npt.NDArray[np.int64] | npt.NDArray[np.bool_]) -> Features:
        """Return some of them, in this order."""
        return Features(*(getattr(self, f.name)[index] for f in fields(self)))


class Extractor(Protocol):
    """Finds features in a camera's frames."""

    @property
    def camera(self) -> PinholeCamera:
        """The camera."""
        ...

    def extract(self, frame: UInt8Array) -> Features:
        """Find the features of a frame, (H, W, 3) uint8 BGR."""
        ...


class SiftExtractor:
    """Finds SIFT features in a camera's frames.

    Parameters
    ----------
    camera : PinholeCamera
        Frames must have its size; its distortion is removed from the keypoints' pixels.
    shrink : int
        Factor by which frames are reduced: without the fine octaves most of the time is saved.
    """

    def __init__(self, camera: PinholeCamera, *, shrink: int = 1) -> None:
        self.camera = camera
        self.shrink = shrink
        # keypoints with less contrast are unstable
        self._sift = cv2.SIFT.create(contrastThreshold=0.02, enable_precise_upscale=True)

    def extract(self, frame: UInt8Array) -> Features:
        """Find the features of a frame, (H, W, 3) uint8 BGR.

        Raises
        ------
        FrameError
            If the frame has the wrong type, shape or size.
        """
        as_frame(frame, self.camera.size_px)
        grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        if self.shrink > 1:
            width, height = self.camera.size_px
            grey = cv2.resize(grey, (width // self.shrink, height // self.shrink), interpolation=cv2.INTER_AREA)
        keypoints, descriptors = self._sift.detectAndCompute(grey, None)
        return features_of(self.camera, keypoints, descriptors, float(self.shrink))

    def extract_near(self, frame: UInt8Array, places_px: FloatArray, max_ratio: float) -> Features:
        """Find the features only near some pixels (K, 2) of a frame, of which the first have priority.

        Tiles around these pixels are joined to one small picture, of up to `max_ratio` of the frame's area. Keypoints
        near a tile's edge are dropped, because the neighbouring tile shows another part of the frame.
        """
        as_frame(frame, self.camera.size_px)
        tiles = _tiles(places_px, self.camera.size_px, max_ratio)
        if not tiles:
            return features_of(self.camera, (), None)
        grey = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
        columns = max(math.isqrt(len(tiles)), 1)
        mosaic = np.zeros((-(-len(tiles) // columns) * TILE_PX, columns * TILE_PX), dtype=np.uint8)
        for k, (u, v) in enumerate(tiles):
            row, column = k // columns * TILE_PX, k % columns * TILE_PX
            mosaic[row : row + TILE_PX, column : column + TILE_PX] = grey[v : v + TILE_PX, u : u + TILE_PX]
        keypoints, descriptors = self._sift.detectAndCompute(mosaic, None)
        if descriptors is None:
            return features_of(self.camera, (), None)
        place = np.array([k.pt for k in keypoints])
        cell = np.clip(np.floor((place + 0.5) / TILE_PX).astype(np.int64), 0, (columns - 1, len(mosaic) // TILE_PX - 1))
        number = cell[:, 1] * columns + cell[:, 0]
        inside = place - cell * TILE_PX
        margin = np.minimum(inside, TILE_PX - 1 - inside).min(axis=1)
        kept = np.flatnonzero((margin >= TILE_MARGIN_PX) & (number < len(tiles)))
        shift = np.array(tiles)[number[kept]] - cell[kept] * TILE_PX
        moved = tuple(keypoints[k] for k in kept.tolist())
        for keypoint, (du, dv) in zip(moved, shift, strict=True):
            keypoint.pt = (keypoint.pt[0] + float(du), keypoint.pt[1] + float(dv))
        return features_of(self.camera, moved, descriptors[kept])


def _tiles(places_px: FloatArray, size_px: tuple[int, int], max_ratio: float) -> list[tuple[int, int]]:
    """Return corners of tiles around places that are not well inside an earlier tile, up to a ratio of the area."""
    width, height = size_px
    most = max(int(max_ratio * width * height / TILE_PX**2), 1)
    tiles: list[tuple[int, int]] = []
    for u, v in places_px:
        if any(
            TILE_PX // 4 <= u - a < TILE_PX - TILE_PX // 4 and TILE_PX // 4 <= v - b < TILE_PX - TILE_PX // 4
            for a, b in tiles
        ):
            continue
        corner = (
            int(np.clip(round(u) - TILE_PX // 2, 0, width - TILE_PX)),
            int(np.clip(round(v) - TILE_PX // 2, 0, height - TILE_PX)),
        )
        if corner not in tiles:
            tiles.append(corner)
        if len(tiles) >= most:
            break
    return tiles


def features_of(
    camera: PinholeCamera, keypoints: Sequence[cv2.KeyPoint], descriptors: npt.NDArray[Any] | None, scale: float = 1.0
) -> Features:
    """Turn OpenCV's keypoints, found in a frame reduced by `scale`, into features."""
    count = len(keypoints)
    if descriptors is None or not count:
        none = np.empty(0)
        return Features(np.empty((0, 2)), none, none, none, np.empty((0, 128), dtype=np.float32))
    raw = np.array([(*k.pt, k.size, k.response, k.octave) for k in keypoints], dtype=np.float64)
    # a pixel of a reduced frame covers `scale` pixels, centred between the outer ones
    pixels = raw[:, :2] * scale + (scale - 1) / 2
    octave = raw[:, 4].astype(np.int64) & 255
    octave = np.where(octave >= 128, octave - 256, octave)
    length = np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-9)
    unit = np.ascontiguousarray(descriptors / length, dtype=np.float32)
    spacing = np.asarray(2.0**octave * scale, dtype=np.float64)
    return Features(camera.ideal_pixels(pixels), raw[:, 2] * scale, spacing, raw[:, 3], unit)


def to_bytes(descriptors: Float32Array) -> UInt8Array:
    """Pack unit descriptors into bytes, which need a quarter of the memory."""
    return np.asarray(np.clip(np.rint(descriptors * BYTE_SCALE), 0, 255), dtype=np.uint8)


def from_bytes(packed: UInt8Array) -> Float32Array:
    """Unpack what `to_bytes` packed."""
    descriptors = packed.astype(np.float32)
    length = np.maximum(np.linalg.norm(descriptors, axis=1, keepdims=True), 1e-9)
    return np.asarray(descriptors / length, dtype=np.float32)


def match(
    first: Float32Array,
    second: Float32Array,
    allowed: npt.NDArray[np.bool_],
    *,
    ratio: float = RATIO,
    best_claim_wins: bool = False,
) -> tuple[Int64Array, Int64Array]:
    """Match descriptors by the ratio test, one to one.

    Parameters
    ----------
    first, second : (N, D), (M, D) float32
        Unit descriptors.
    allowed : (N, M) bool
        Whether each pair may match; the ratio test only compares these.
    ratio : float
        Greatest ratio of the distances of the nearest and the second nearest, eq. 3.
    best_claim_wins : bool
        If several of `first` have the same nearest partner, whether the nearest of them is matched, or none as in the
        paper.

    Returns
    -------
    (K,), (K,) int64
        Indices of the partners in `first` and in `second`.
    """
    if not len(first) or not len(second):
        none = np.empty(0, dtype=np.int64)
        return none, none
    product = np.where(allowed, first @ second.T, np.float32(-1.0))
    best = product.argmax(axis=1)
    rows = np.arange(len(first))
    nearest = product[rows, best]
    product[rows, best] = -1.0
    runner_up = product.max(axis=1)
    return _accept(best, nearest, runner_up, len(second), ratio, best_claim_wins)


def match_by_loop(
    first: Described, second: Features, gate_px: tuple[float, float], *, ratio: float = RATIO
) -> tuple[Int64Array, Int64Array]:
    """Match as `match` does, by a compiled loop, within half windows `gate_px` (u, v) around each expected pixel."""
    features = Described(second.descriptors, second.pixels, second.size_px)
    best, nearest, runner_up = best_two(first, features, gate_px, SIZE_RATIO)
    return _accept(best, nearest, runner_up, len(second), ratio)


def _accept(
    best: Int64Array,
    nearest: Float32Array,
    runner_up: Float32Array,
    count: int,
    ratio: float,
    best_claim_wins: bool = False,
) -> tuple[Int64Array, Int64Array]:
    squared, second_squared = np.maximum(2 - 2 * nearest, 0), 2 - 2 * runner_up
    good = (nearest > -1) & (squared <= ratio**2 * second_squared) & (squared <= MAX_DISTANCE**2)
    rows = np.flatnonzero(good)
    if best_claim_wins:
        rows = rows[np.argsort(-nearest[rows], kind="stable")]
        rows = np.sort(rows[np.unique(best[rows], return_index=True)[1]])
        return rows, best[rows]
    claims = np.bincount(best[rows], minlength=count)
    rows = rows[claims[best[rows]] == 1]
    return rows, best[rows]


def near(
    first_px: FloatArray,
    first_size: FloatArray,
    second: Features,
    gate_px: tuple[float, float],
) -> npt.NDArray[np.bool_]:
    """Return whether features (M) lie in the windows of expected pixels and have about their sizes, (N, M) bool."""
    du = np.abs(first_px[:, :1] - second.pixels[None, :, 0]) <= gate_px[0]
    dv = np.abs(first_px[:, 1:] - second.pixels[None, :, 1]) <= gate_px[1]
    scale = np.abs(np.log(first_size)[:, None] - np.log(second.size_px)[None, :]) <= np.log(SIZE_RATIO)
    return np.asarray(du & dv & scale)
