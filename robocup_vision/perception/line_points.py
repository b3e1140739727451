"""White line points of one frame: narrow bright ridges on the floor that have the width of the field's lines there.

The floor's tone is estimated from the nearest pixels, and the expected width at each pixel and direction follows from
the camera. A line point is brighter in min(R, B) than the floor on both sides. If only one side shows floor, because
the carpet ends at the line, the other side must still be darker, and the point has less weight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from robocup_vision.arguments import as_frame
from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array, plain_frame, read_only
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.kernels.lines.floor_tone import ToneRules, learn_tone
from robocup_vision.kernels.lines.ridges import (
    floor_mask_by_tone,
    least_of_red_and_blue,
    line_ridge_points,
    line_widths,
)

# image steps of the four axes along which a line may be crossed, u right, v down
AXES_PX: tuple[tuple[int, int], ...] = ((1, 0), (1, 1), (0, 1), (-1, 1))
# widths are stored in sixteenths of a pixel
WIDTH_UNITS_PER_PX = 16
# distance from a line's middle at which the floor beside it is sampled, in line widths and pixels, beyond its blur
_SIDE_WIDTHS, _SIDE_PX = 0.7, 1.8
# narrower lines are lost in blur, and wider ones are painted areas
_WIDTH_PX = (0.6, 60.0)
# greatest ratio of candidates to pixels in use; a frame with more is noise
_MAX_POINT_RATIO = 0.1
# least contrast relative to the clear lines, because paint has one whiteness: less is dirt or glare
_MIN_CONTRAST_RATIO = 0.35
# least contrast to the floor, in standard deviations of the noise, and in levels
_NOISE_STDS, _MIN_THRESHOLD = 5.0, 6
# weight of points with floor on one side only, where the carpet ends at the line
_ONE_SIDED_WEIGHT = 0.5
# width from which a line is always visible, so that floor without a line point is bare
_RESOLVED_PX = 1.5
_TONE = ToneRules()


class FloorCamera(Protocol):
    """Any camera that maps pixels to the floor and back."""

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height."""
        ...

    def pixel_to_floor(self, pixels: npt.ArrayLike) -> FloatArray:
        """Floor points (..., 2), robot frame, metres, of pixels (..., 2); NaN if there is none."""
        ...

    def floor_to_pixel(self, points_m: npt.ArrayLike) -> FloatArray:
        """Pixels (..., 2) of floor points (..., 2), robot frame, metres; NaN if not visible."""
        ...


@dataclass(frozen=True, eq=False)
class LinePoints:
    """White line points of a frame."""

    pixels: FloatArray  #: (N, 2) float64: sub-pixel centres of the line's cross-section
    floor_m: FloatArray  #: (N, 2) float64: the same points on the floor, robot frame, metres
    #: (N, 2, 2) float64: derivative of `floor_m` by the pixel, columns u and v, metres for each pixel
    floor_per_px: FloatArray
    weight: FloatArray  #: (N,) float64: 1 for points with floor on both sides, less for others
    #: (H, W) bool: pixels that, with their neighbours, show floor and no line: evidence against a pose that predicts a
    #: line there
    bare_floor: npt.NDArray[np.bool_] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        for name, shape in (("pixels", (2,)), ("floor_m", (2,)), ("floor_per_px", (2, 2)), ("weight", ())):
            array = read_only(getattr(self, name))
            if array.shape != (len(self.pixels), *shape):
                raise ArgumentError(f"{name} must be {('N', *shape)} with N = {len(self.pixels)}, got {array.shape}")
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.pixels)

    def take(self, chosen: npt.NDArray[np.generic]) -> LinePoints:
        """Return the points at these indices, or where this mask is true."""
        return LinePoints(
            self.pixels[chosen], self.floor_m[chosen], self.floor_per_px[chosen], self.weight[chosen], self.bare_floor
        )

    @classmethod
    def from_pixels(
        cls,
        camera: FloorCamera,
        pixels: npt.ArrayLike,
        weight: npt.ArrayLike | None = None,
        bare_floor: npt.NDArray[np.bool_] | None = None,
    ) -> LinePoints:
        """Map pixels (N, 2) to the floor; those above the horizon are dropped.

        Parameters
        ----------
        weight : (N,) array-like, optional
            1 by default.
        """
        points = np.asarray(pixels, dtype=np.float64).reshape(-1, 2)
        weights = np.ones(len(points)) if weight is None else np.asarray(weight, dtype=np.float64)
        step = 0.5
        around = points[:, None] + step * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
        floor = camera.pixel_to_floor(around)
        per_px = np.stack([floor[:, 1] - floor[:, 2], floor[:, 3] - floor[:, 4]], axis=-1) / (2 * step)
        good = np.isfinite(floor).all(axis=(1, 2))
        return cls(points[good], floor[good, 0], per_px[good], weights[good], bare_floor)


class LineFinder:
    """Finds line points in successive frames of one camera.

    Parameters
    ----------
    mask : (H, W) array, optional
        Non-zero pixels are never used.
    cell_bits : int
        The expected width is computed once for each square of 2^cell_bits pixels to a side; more than one pixel for
        large frames of a camera that is new in each.
    """

    def __init__(
        self, camera: FloorCamera, line_width_m: float, mask: npt.NDArray[np.generic] | None = None, cell_bits: int = 0
    ) -> None:
        self.camera, self._cell_bits = camera, cell_bits
        width, height = camera.size_px
        if mask is not None and mask.shape[:2] != (height, width):
            raise ArgumentError(f"mask must be {width}x{height}, got {mask.shape[1]}x{mask.shape[0]}")
        cell = 2**cell_bits
        middles = cell_middles(camera.size_px, cell_bits)
        floor = camera.pixel_to_floor(middles)
        seen: npt.NDArray[np.bool_] = np.isfinite(floor[..., 0]) & np.isfinite(floor[..., 1])
        if isinstance(camera, OmniCamera):
            from_center = middles - camera.center_px
            radius = np.hypot(from_center[..., 0], from_center[..., 1])
            inner, outer = camera.usable_radius_px
            seen &= (radius >= inner) & (radius <= outer)
        if mask is not None:
            seen &= np.asarray(mask).reshape(height, width, -1)[cell // 2 :: cell, cell // 2 :: cell, 0] == 0
        self._width_units = np.empty((len(AXES_PX), *seen.shape), dtype=np.uint16)
        # the floor's derivatives are differences from cell to cell
        line_widths(floor, seen.astype(np.uint8), float(line_width_m) * cell, _WIDTH_PX, self._width_units)
        self._reach_px = _reaches_px(self._width_units)
        self._seen = np.ascontiguousarray((seen & (self._width_units > 0).any(axis=0)).astype(np.uint8))
        # cells in which a line is too wide to be missed
        self._resolved = (self._width_units.min(axis=0) >= _RESOLVED_PX * WIDTH_UNITS_PER_PX).astype(np.uint8)
        flat = np.flatnonzero(self._seen)
        ahead, left = floor.reshape(-1, 2)[flat].T
        # the nearest quarter of the visible floor, in which there is hardly anything but carpet
        range_m = np.hypot(ahead, left)
        count = max(1, len(flat) // 4)
        farthest_m = np.partition(range_m, count - 1)[count - 1] if len(flat) else 0.0
        nearest = np.flatnonzero(range_m < farthest_m)
        alike = np.flatnonzero(range_m == farthest_m)[: count - len(nearest)]
        near = flat[np.sort(np.concatenate([nearest, alike]))][::4]
        row, column = np.divmod(near, seen.shape[1])
        self._near = (row * cell + cell // 2) * width + column * cell + cell // 2

    def find(self, frame: npt.NDArray[np.uint8]) -> LinePoints:
        """Find line points, and the bare floor.

        Raises
        ------
        FrameError
            If the frame is not a BGR uint8 image of the camera's size.
        """
        width, height = self.camera.size_px
        frame = plain_frame(as_frame(frame, (width, height)))
        smooth = np.asarray(cv2.blur(frame, (3, 3)), dtype=np.uint8)
        tone = self._tone(smooth)
        if tone is None:
            return LinePoints.from_pixels(self.camera, np.empty((0, 2)))
        floor = floor_mask_by_tone(smooth, self._seen, self._cell_bits, tone)
        whiteness = np.empty((height, width), np.uint8)
        least_of_red_and_blue(frame, whiteness)
        limit = int(_MAX_POINT_RATIO * 4**self._cell_bits * np.count_nonzero(self._seen)) + 1
        found = line_ridge_points(
            whiteness,
            frame[..., 1],
            floor,
            self._width_units,
            self._reach_px,
            self._cell_bits,
            self._noise_threshold(whiteness, floor),
            limit,
        )
        if not 0 < len(found) < limit:
            return LinePoints.from_pixels(self.camera, np.empty((0, 2)))
        contrast, two_sided = found[:, 2], found[:, 3] > 0
        strong = contrast >= _MIN_CONTRAST_RATIO * np.percentile(
            contrast[two_sided] if two_sided.any() else contrast, 80
        )
        return LinePoints.from_pixels(
            self.camera,
            found[strong, :2],
            np.where(two_sided[strong], 1.0, _ONE_SIDED_WEIGHT),
            self._bare(floor),
        )

    def _bare(self, floor: UInt8Array) -> npt.NDArray[np.bool_]:
        """Mark pixels that show floor, with all neighbours, where a line would be visible."""
        resolved = self._resolved
        if self._cell_bits:
            size_px = self.camera.size_px
            resolved = np.asarray(cv2.resize(resolved, size_px, interpolation=cv2.INTER_NEAREST), np.uint8)
        return cv2.erode(floor & resolved, np.ones((9, 9), dtype=np.uint8)).view(np.bool_)

    def _tone(self, smooth: npt.NDArray[np.uint8]) -> Float32Array | None:
        """Estimate the floor's tone (7,) from the nearest pixels, see `floor_mask_by_tone`; None if there is none."""
        tone = np.empty(7, dtype=np.float32)
        return tone if learn_tone(smooth, self._near, _TONE, tone) else None

    def _noise_threshold(self, whiteness: npt.NDArray[np.uint8], floor: npt.NDArray[np.uint8]) -> int:
        values = whiteness.ravel()
        near = self._near[self._near + 1 < values.size]
        near = near[floor.ravel()[near] > 0]
        if not len(near):
            return 255
        step = np.abs(values[near].astype(np.int16) - values[near + 1])
        return max(
            _MIN_THRESHOLD,
            math.ceil(_NOISE_STDS * 1.48 / math.sqrt(2) * float(np.median(step))),
        )


def cell_middles(size_px: tuple[int, int], cell_bits: int) -> FloatArray:
    """Return the middles (R, C, 2) of an image's cells, pixels, see `LineFinder`."""
    (width, height), cell = size_px, 2**cell_bits
    v, u = np.mgrid[cell // 2 : height : cell, cell // 2 : width : cell].astype(np.float64)
    return np.stack([u, v], axis=-1)


def _reaches_px(width_units: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint8]:
    """Return the steps along each of `AXES_PX`, (4, H, W), from a line's middle to the floor beside it; 0: no line."""
    step_px = np.hypot(*np.transpose(AXES_PX))[:, None]
    units = np.arange(int(width_units.max(initial=0)) + 1)
    steps = np.ceil((_SIDE_WIDTHS * units / WIDTH_UNITS_PER_PX + _SIDE_PX) / step_px).astype(np.uint8)
    steps[:, 0] = 0
    return np.stack([of_axis[units] for of_axis, units in zip(steps, width_units, strict=True)])
