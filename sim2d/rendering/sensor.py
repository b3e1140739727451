"""Conversion of linear light to a camera's bytes: vignette, blur, white balance, noise, clipping, compression."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arrays import Float32Array, UInt8Array

Bgr = tuple[float, float, float]
# standard deviations of scattered light in a lens, near and far, as fractions of the width
BLOOM_SPREAD = (0.005, 0.02)
MIN_LENGTH_PX = 1.0  # shorter motion is hidden by the lens's own blur
_POINTS = 64


@dataclass(frozen=True, slots=True)
class Sensor:
    """A camera's lens and sensor."""

    #: Standard deviation of the noise of each channel, grey levels.
    noise_sigma: float = 0.0
    #: Standard deviation of the Gaussian blur, pixels.
    blur_px: float = 0.0
    #: Fraction of the light lost in the image's corners; it grows with the squared distance from the image's middle.
    vignette: float = 0.0
    #: White balance gains.
    cast_bgr: Bgr = (1.0, 1.0, 1.0)
    #: Overall gain.
    gain: float = 1.0
    #: Compress and expand with chroma at half resolution, at this quality.
    jpeg_quality: int | None = None
    #: Fraction of the light beyond white that spreads around overexposed places.
    bloom: float = 0.0

    def __post_init__(self) -> None:
        for name in ("noise_sigma", "blur_px", "gain"):
            if not 0 <= getattr(self, name) < np.inf:
                raise ArgumentError(f"{name} must not be negative, got {getattr(self, name)}")
        for name in ("bloom", "vignette"):
            if not 0 <= getattr(self, name) <= 1:
                raise ArgumentError(f"{name} must be within 0 to 1, got {getattr(self, name)}")
        if not all(0 <= value < np.inf for value in self.cast_bgr):
            raise ArgumentError(f"cast_bgr must not be negative, got {self.cast_bgr}")
        if self.jpeg_quality is not None and not 1 <= self.jpeg_quality <= 100:
            raise ArgumentError(f"jpeg_quality must be within 1 to 100, got {self.jpeg_quality}")

    def expose(self, radiance: npt.NDArray[np.float32], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
        """Convert linear light (H, W, 3) float32, BGR, 255 is white, to a frame (H, W, 3) uint8; `rng` draws noise."""
        light = radiance.astype(np.float32)
        if self.vignette:
            light *= vignette_gain(light.shape[0], light.shape[1], self.vignette)[..., None]
        if self.bloom:
            beyond = np.maximum(light * np.float32(self.gain) - 255, 0) * np.float32(self.bloom)
            for spread_ratio in BLOOM_SPREAD:
                sigma_px = spread_ratio * light.shape[1]
                light += cv2.GaussianBlur(beyond, (0, 0), sigma_px, borderType=cv2.BORDER_REPLICATE)
        if self.blur_px:
            light = np.asarray(cv2.GaussianBlur(light, (0, 0), self.blur_px, borderType=cv2.BORDER_REPLICATE))
        light *= np.array(self.cast_bgr, dtype=np.float32) * np.float32(self.gain)
        if self.noise_sigma:
            light += rng.standard_normal(light.shape, dtype=np.float32) * np.float32(self.noise_sigma)
        frame = np.clip(np.rint(light), 0, 255).astype(np.uint8)
        return frame if self.jpeg_quality is None else _jpeg_round_trip(frame, self.jpeg_quality)


@lru_cache(maxsize=16)
def vignette_gain(height: int, width: int, strength: float) -> npt.NDArray[np.float32]:
    """Return the transmission (H, W) float32 of a lens: 1 in the middle, 1 - `strength` in the corners."""
    v, u = np.mgrid[:height, :width].astype(np.float32)
    squared = (u - (width - 1) / 2) ** 2 + (v - (height - 1) / 2) ** 2
    return np.asarray(1 - strength * squared / max(float(squared.max()), 1.0), dtype=np.float32)


def _jpeg_round_trip(frame: npt.NDArray[np.uint8], quality: int) -> npt.NDArray[np.uint8]:
    options = [cv2.IMWRITE_JPEG_QUALITY, quality]
    if hasattr(cv2, "IMWRITE_JPEG_SAMPLING_FACTOR"):
        options += [cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_420]
    _, packed = cv2.imencode(".jpg", frame, options)
    return np.asarray(cv2.imdecode(packed, cv2.IMREAD_COLOR), dtype=np.uint8)


def motion_kernel(du_px: float, dv_px: float) -> Float32Array:
    """Return the kernel (K, L) of a motion by this many pixels, centred; its sum is 1."""
    length = math.hypot(du_px, dv_px)
    # distributing points to whole pixels is itself a blur, of variance 1/6 like a motion by sqrt(2) pixels
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
    """Return a frame (H, W, 3) with motion blur of this many pixels right and down."""
    if math.hypot(du_px, dv_px) < MIN_LENGTH_PX:
        return frame
    blurred = cv2.filter2D(frame, -1, motion_kernel(du_px, dv_px), borderType=cv2.BORDER_REPLICATE)
    return np.asarray(blurred, dtype=np.uint8)
