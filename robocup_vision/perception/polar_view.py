"""Unrolling of a mirror camera's frame: rows of bearings, columns of image radii, independent of the resolution.

Most steps use these about 12,000 samples. Only sub-pixel edges, line points and balls are measured in the frame.
"""

from __future__ import annotations

import math

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array, plain_frame, read_only
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.kernels.floor.unrolled import unroll

BEARINGS = 160
RADII = 72
# the 3 x 3 blur and the lens mix the robot's body into the innermost columns, which therefore show no obstacle
BODY_COLUMNS = 2
# beyond this range, in viewpoint heights, the floor is within a few pixels of the horizon for any mirror
FARTHEST_HEIGHTS = 40.0


class PolarView:
    """Places of a frame's polar samples, for one camera.

    Parameters
    ----------
    bearings : int
        Number K of bearings.
    mask : (H, W) uint8, optional
        Non-zero pixels are not used.
    """

    def __init__(self, camera: OmniCamera, bearings: int = BEARINGS, mask: UInt8Array | None = None) -> None:
        self.camera, self.bearings, self.mask = camera, bearings, mask
        #: (K,) float64: camera-frame bearings of the rows, from 0 counter-clockwise
        self.bearing_rad = read_only(np.arange(bearings) * (math.tau / bearings))
        #: (M,) float64: image radii of the columns, inside out
        self.radius_px = read_only(np.linspace(*camera.usable_radius_px, RADII))
        #: radial distance between columns, pixels
        self.step_px = float(self.radius_px[1] - self.radius_px[0])
        q = camera.floor_range.inverse_range_per_m(self.radius_px)
        #: number of columns, from the innermost, that show floor to a level camera
        self.columns_in_use = int(np.count_nonzero(q > 0))
        # NaN where a table ends before the usable radius
        #: (M,) float64: floor range of the columns, metres; a kilometre from the horizon on
        self.range_m = read_only(1.0 / np.maximum(np.nan_to_num(q), 1e-3))
        #: (M,) float64: width on the floor of one pixel across the bearing, metres
        self.across_m_per_px = read_only(self.range_m / self.radius_px)
        #: (K, M, 2) float64: the samples' places in the frame
        self.pixels = read_only(camera.polar_to_pixel(self.bearing_rad[:, None], self.radius_px[None, :]))
        #: (K, M, 2) float64: the samples' places on the floor, robot frame, metres; NaN from the horizon on
        self.floor_m = read_only(camera.pixel_to_floor(self.pixels))
        #: (H, W) uint8: 1 where no bilinear sample may be taken, (0, 0) without a mask
        self.hidden_px = hidden_pixels(mask)
        #: (K, M) uint8: 1 where a sample lies inside the frame and outside the mask
        self.valid = self._find_valid()
        #: number of valid samples in the nearest third of the columns, at least 1
        self.near_count = max(1, int(np.count_nonzero(self.valid[:, : len(self.radius_px) // 3])))
        width, height = camera.size_px
        nearest = np.rint(self.pixels)
        u, v = np.clip(nearest[..., 0], 0, width - 1), np.clip(nearest[..., 1], 0, height - 1)
        #: (K, M) int32: nearest pixel of each sample, as an index into the frame's bytes. Places outside are moved to
        #: the frame's edge, so that the average does not darken the samples along it.
        self.places = np.ascontiguousarray(3 * (v * width + u), dtype=np.int32)

    @property
    def is_ring(self) -> bool:
        """Whether the last bearing is adjacent to the first."""
        return True

    @property
    def span_rad(self) -> tuple[float, float]:
        """First bearing and width of the view, robot frame."""
        return -math.pi, math.tau

    def ring_bounds_m(self, rings: int, first_column: int) -> FloatArray:
        """Return bounds (I + 1,) float64, metres, of rings around the robot with equal steps in image radius."""
        camera = self.camera
        farthest = FARTHEST_HEIGHTS * (camera.height_m if camera.height_m is not None else 0.5)
        inner, outer = self.radius_px[first_column] - self.step_px / 2, self.radius_px[-1]
        horizon = float(np.nan_to_num(camera.floor_range.radius_px(1.0 / farthest), nan=outer))
        q = camera.floor_range.inverse_range_per_m(np.linspace(inner, min(outer, horizon), rings + 1))
        return np.asarray(1.0 / q)

    @property
    def row_step_rad(self) -> float:
        """Angle between neighbouring bearings."""
        return math.tau / self.bearings

    def to_pixel(self, bearing_rad: npt.ArrayLike, radius_px: npt.ArrayLike) -> FloatArray:
        """Return the pixels (..., 2) of image radii on bearings."""
        return self.camera.polar_to_pixel(bearing_rad, radius_px)

    def from_pixel(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return bearing and image radius of a pixel."""
        u, v = pixel[0] - self.camera.center_px[0], pixel[1] - self.camera.center_px[1]
        return math.atan2(v if self.camera.mirrored else -v, u) + self.camera.heading_rad, math.hypot(u, v)

    def floor_at(self, columns: npt.NDArray[np.int64]) -> FloatArray:
        """Return `floor_m` of one sample of each bearing, (K, 2).

        Parameters
        ----------
        columns : (K,) int64
            Column of each bearing's sample; M if there is none, for any place.
        """
        return np.asarray(self.floor_m[np.arange(self.bearings), np.minimum(columns, len(self.radius_px) - 1)])

    @property
    def shown(self) -> UInt8Array:
        """The same as `valid`, because this view is never turned."""
        return self.valid

    def _find_valid(self) -> UInt8Array:
        width, height = self.camera.size_px
        u, v = self.pixels[..., 0], self.pixels[..., 1]
        inside = (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)
        if self.mask is not None:
            columns = np.clip(np.rint(u).astype(int), 0, width - 1)
            rows = np.clip(np.rint(v).astype(int), 0, height - 1)
            # the 3 x 3 blur of the samples extends by one in each direction
            hidden = np.pad(self.hidden_px[rows, columns], ((1, 1), (0, 0)), "wrap")
            inside &= cv2.dilate(hidden, np.ones((3, 3), np.uint8))[1:-1] == 0
        valid = inside.astype(np.uint8)
        valid.flags.writeable = False
        return valid

    def sample(self, frame: UInt8Array) -> UInt8Array:
        """Unroll a frame (H, W, 3) into (K, M, 3) uint8: the nearest pixels, averaged over 3 x 3 samples.

        Averages of different pixels reduce noise more than interpolation does.
        """
        samples = np.empty((*self.places.shape, 3), dtype=np.uint8)
        unroll(plain_frame(frame), self.places, samples)
        return samples


def hidden_pixels(mask: UInt8Array | None) -> UInt8Array:
    """Return 1 where the 3 x 3 neighbourhood has a pixel hidden by a mask (H, W), (H, W) uint8; (0, 0) without one."""
    if mask is None:
        return np.empty((0, 0), dtype=np.uint8)
    return np.asarray(cv2.dilate((mask > 0).astype(np.uint8), np.ones((3, 3), np.uint8)), dtype=np.uint8)
