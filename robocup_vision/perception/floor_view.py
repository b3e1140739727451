"""Unrolling of a pinhole camera's floor around the camera's foot: rows of bearings, columns of distances.

It is the counterpart of `PolarView`: an obstacle hides the floor behind it along a row. The rows cover the view only.
Some empty rows follow them, so that the last bearing is never joined to the first.
"""

from __future__ import annotations

import math
from copy import copy

import cv2
import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array, read_only
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.camera.pinhole import PinholeCamera, camera_rotation
from robocup_vision.kernels.floor.turned_view import sample_turned
from robocup_vision.perception.polar_view import BEARINGS, FARTHEST_HEIGHTS, hidden_pixels

COLUMNS = 144
# extent beyond the horizon, pixels, so that a wall is visible behind the last floor
_BEYOND_HORIZON_PX = 12.0
# greatest tangent of the depression
_STEEPEST = 8.0
# empty rows after those in view: loops use two neighbours on either side, and a ring's last row adjoins the first
_EMPTY_ROWS = 3
# points around a fisheye's rim
_AROUND = 1024
# step in pixels when the mask is searched for the nearest visible floor
_MASK_STEP = 4
# number of bearings that are tested at a time for the end of the view
_STEPS_AT_ONCE = 64


def sees_floor(camera: PinholeCamera) -> bool:
    """Whether a camera's view includes floor near enough to be measured."""
    return float(_rim(camera)[1].min()) < -1.0 / FARTHEST_HEIGHTS


class FloorView:
    """Places of a frame's floor samples, for one camera and orientation.

    Parameters
    ----------
    camera : PinholeCamera
        Must have a known tilt and see floor (see `sees_floor`).
    seen_bearings : int
        Number of bearings in view.
    mask : (H, W) uint8, optional
        Non-zero pixels are never used.
    """

    def __init__(self, camera: PinholeCamera, seen_bearings: int = BEARINGS, mask: UInt8Array | None = None) -> None:
        self.camera, self.seen_bearings, self.mask = camera, seen_bearings, mask
        # the camera for which the tables were made; `camera` may be turned relative to it
        self._made_for = camera
        pan_rad, (bearing, slope) = camera.pan_rad or 0.0, _rim(camera)
        # (M,) float64: the columns' slopes, negative on the floor
        self._slopes = self._equal_steps(slope)
        ahead = camera.ray_to_pixel(self._directions(pan_rad, self._slopes))
        #: (M,) float64: image distance of the columns up the picture, straight ahead, from 0
        self.radius_px = read_only(np.append(0.0, np.cumsum(np.hypot(*np.diff(ahead, axis=0).T))))
        #: distance between columns straight ahead, pixels
        self.step_px = float(self.radius_px[-1]) / (COLUMNS - 1)
        #: number of columns, from the nearest, that show floor
        self.columns_in_use = int(np.count_nonzero(self._slopes < -1e-9))
        #: (M,) float64: floor range of the columns from the camera's foot, metres; a kilometre from the horizon on
        self.range_m = read_only(camera.height_m / np.maximum(-self._slopes, 1e-3 * camera.height_m))
        #: (M,) float64: width on the floor of one pixel across the bearing, metres
        self.across_m_per_px = read_only(np.hypot(self.range_m, camera.height_m) / camera.focal_px[0])
        # (M,) float64: the columns' distance on the floor; NaN from the horizon on
        self._distance_m = np.where(self._slopes < -1e-9, self.range_m, np.nan)
        seen = bearing[slope < self._slopes[-1] + 1e-9]
        #: angle between neighbouring bearings
        self.row_step_rad = float(np.ptp(seen)) / seen_bearings
        self._first_rad = float(seen.min()) + self.row_step_rad / 2 + pan_rad
        #: first bearing and width of the view, robot frame, without gaps beyond twice the nearest range
        self.span_rad = self._find_span()
        #: (H, W) uint8: 1 where no bilinear sample may be taken, (0, 0) without a mask
        self.hidden_px = hidden_pixels(mask)
        #: (K, M) uint8: 1 where a sample lies inside the frame and outside the mask, for a camera that is not turned.
        #: In a turned view some of them take a neighbour's colour, which suffices for learning colours.
        self.valid = self._find_valid()
        #: (K, M) uint8: as `valid`, but for a turned view of the last frame that was sampled
        self.shown = self.valid
        #: number of valid samples in the nearest third of the columns, at least 1
        self.near_count = max(1, int(np.count_nonzero(self.valid[:, : len(self.radius_px) // 3])))
        #: (K,) float64, all NaN: feet of a view without objects
        self.no_edges_px = read_only(np.full(self.bearings, np.nan))
        rays = self._directions(self.bearing_rad[:seen_bearings, None], self._slopes[None, :])
        # (2, K, M) float32: u and v of the samples in view for the camera without distortion
        self._planes = np.ascontiguousarray(
            np.moveaxis(camera.without_lens.ray_to_pixel(rays), -1, 0), dtype=np.float32
        )
        # the lens in the format of `sample_turned`
        self._lens = lens_table(camera).astype(np.float32)

    def held(self, camera: PinholeCamera) -> FloorView:
        """Return the view of the same samples by the same camera at a slightly different orientation.

        At another tilt and roll the same floor places are found in the frame by the homography of a rotation about the
        viewpoint; places that leave the frame show its border. At another pan the samples move around the robot and
        keep their places in the frame. No table is computed again.

        Parameters
        ----------
        camera : PinholeCamera
            The same camera at another orientation. The pan must be nearly the same unless the camera's foot is the
            robot's centre, because the view around the robot changes otherwise (see `panned`).
        """
        before, other = self.camera, copy(self)
        other.camera = camera
        turn_rad = (camera.pan_rad or 0.0) - (before.pan_rad or 0.0)
        if turn_rad:
            other._first_rad += turn_rad
            other.span_rad = self.span_rad[0] + turn_rad, self.span_rad[1]
        if _turn_of(before) != _turn_of(camera):
            other.shown = self.valid
        return other

    def panned(self, camera: PinholeCamera) -> FloorView:
        """Return the view of the same samples by the same camera at another pan, for any position of its foot."""
        other = self.held(camera)
        other.span_rad = other._find_span()
        return other

    def _steepest_shown(self, rim_slope: FloatArray) -> float:
        """Return the slope of the nearest visible floor; the lower end of a picture may be masked."""
        steepest = float(rim_slope.min())
        if self.mask is None:
            return steepest
        v, u = np.nonzero(self.mask[::_MASK_STEP, ::_MASK_STEP] == 0)
        ray = self.camera.pixel_to_ray(_MASK_STEP * np.stack([u, v], axis=1).astype(np.float64))
        slope = ray[:, 2] / np.maximum(np.hypot(ray[:, 0], ray[:, 1]), 1e-9)
        return max(steepest, float(np.nanmin(slope))) if np.isfinite(slope).any() else steepest

    def _equal_steps(self, rim_slope: FloatArray) -> FloatArray:
        """Return slopes (M,) from the nearest floor to beyond the horizon, at equal steps in the picture ahead."""
        beyond = _BEYOND_HORIZON_PX / self.camera.focal_px[1]
        low, high = max(self._steepest_shown(rim_slope), -_STEEPEST), min(float(rim_slope.max()), beyond)
        dense = np.linspace(math.atan(low), math.atan(high), 1024)
        pan = self.camera.pan_rad or 0.0
        ahead = np.stack([np.cos(dense) * math.cos(pan), np.cos(dense) * math.sin(pan), np.sin(dense)], axis=1)
        pixels = self.camera.ray_to_pixel(ahead)
        step = np.hypot(*np.diff(pixels, axis=0).T)
        way = np.append(0.0, np.cumsum(np.nan_to_num(step)))
        return np.asarray(np.tan(np.interp(np.linspace(0.0, way[-1], COLUMNS), way, dense)))

    @property
    def bearings(self) -> int:
        """Number K of rows, including empty ones."""
        return self.seen_bearings + _EMPTY_ROWS

    @property
    def bearing_rad(self) -> FloatArray:
        """(K,) float64: bearings of the rows about the camera's foot, ascending."""
        return read_only(self._first_rad + self.row_step_rad * np.arange(self.bearings))

    def _find_span(self) -> tuple[float, float]:
        pan, offset = self.camera.pan_rad or 0.0, np.array(self.camera.offset_m)
        ahead = self.range_m[: self._columns_measured, None] * [math.cos(pan), math.sin(pan)] + offset
        ranges = np.hypot(*ahead[self._is_shown(ahead)].T)
        if not len(ranges):
            return pan, self.row_step_rad
        # the visible floor is nearly convex, so that a few places on a ray suffice
        ranges = np.geomspace(min(2 * ranges.min(), ranges.max()), ranges.max(), 5)
        middle = math.atan2(ahead[-1, 1], ahead[-1, 0])
        left, right = (self._turns_shown(middle, side * self.row_step_rad / 2, ranges) for side in (-1.0, 1.0))
        return middle - left, left + right

    def _turns_shown(self, middle_rad: float, step_rad: float, range_m: FloatArray) -> float:
        """Return the angle from a bearing, in steps, within which the floor is visible at all ranges (N,)."""
        count = 0
        while count * abs(step_rad) < math.pi:
            # in batches, because most views are narrow
            bearing = middle_rad + step_rad * np.arange(count, count + _STEPS_AT_ONCE)[:, None]
            shown = self._is_shown(range_m[None, :, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=-1))
            whole = shown.all(axis=1)
            if not whole.all():
                return max(count + int(np.argmin(whole)) - 1, 1) * abs(step_rad)
            count += _STEPS_AT_ONCE
        return math.pi

    def _is_shown(self, floor_m: FloatArray) -> npt.NDArray[np.bool_]:
        pixels = self.camera.floor_to_pixel(floor_m)
        width, height = self.camera.size_px
        return np.asarray(((pixels >= 0) & (pixels <= (width - 1, height - 1))).all(axis=-1))

    @property
    def _columns_measured(self) -> int:
        return max(1, int(np.count_nonzero(self._slopes < -1.0 / FARTHEST_HEIGHTS)))

    def ring_bounds_m(self, rings: int, first_column: int) -> FloatArray:
        """Return bounds (I + 1,) float64, metres, of rings around the robot with equal ratios."""
        column = min(first_column, self._columns_measured - 1)
        near, far = float(self.range_m[column]), FARTHEST_HEIGHTS * self.camera.height_m
        pan = self.camera.pan_rad or 0.0
        ahead = np.geomspace(near, max(far, 1.01 * near), rings + 1)[:, None] * [math.cos(pan), math.sin(pan)]
        bounds = np.hypot(*(ahead + np.array(self.camera.offset_m)).T)
        return np.asarray(np.maximum.accumulate(bounds))

    @property
    def is_ring(self) -> bool:
        """Whether the last bearing is adjacent to the first."""
        return False

    def _directions(self, bearing_rad: npt.ArrayLike, slope: npt.ArrayLike) -> FloatArray:
        bearing, slopes = np.broadcast_arrays(np.asarray(bearing_rad, dtype=np.float64), slope)
        return np.stack([np.cos(bearing), np.sin(bearing), slopes], axis=-1)

    def to_pixel(self, bearing_rad: npt.ArrayLike, radius_px: npt.ArrayLike) -> FloatArray:
        """Return the pixels (..., 2) of image distances `radius_px` on bearings."""
        radius = np.asarray(radius_px, dtype=np.float64)
        slope = np.interp(radius, self.radius_px, self._slopes)
        return self.camera.ray_to_pixel(self._directions(bearing_rad, np.where(np.isfinite(radius), slope, np.nan)))

    def from_pixel(self, pixel: tuple[float, float]) -> tuple[float, float]:
        """Return bearing and `radius_px` of a pixel that shows floor."""
        ((right, down),) = self.camera.pixel_slopes([pixel])
        x, y, z = (ahead - left * right - up * down for ahead, left, up in self.camera.camera_to_robot.tolist())
        turn = math.remainder(math.atan2(y, x) - self._first_rad - math.pi / 2, math.tau) + math.pi / 2
        return self._first_rad + turn, float(np.interp(z / max(math.hypot(x, y), 1e-9), self._slopes, self.radius_px))

    @property
    def pixels(self) -> FloatArray:
        """(K, M, 2) float64: places of the samples in the frame; NaN in empty rows."""
        pixels = self.camera.ray_to_pixel(self._directions(self.bearing_rad[:, None], self._slopes[None, :]))
        pixels[self.seen_bearings :] = np.nan
        return read_only(pixels)

    @property
    def floor_m(self) -> FloatArray:
        """(K, M, 2) float64: places of the samples on the floor, robot frame, metres; NaN from the horizon on."""
        return read_only(self._places_m(self._distance_m))

    def floor_at(self, columns: npt.NDArray[np.int64]) -> FloatArray:
        """Return `floor_m` of one sample of each bearing, (K, 2).

        Parameters
        ----------
        columns : (K,) int64
            Column of each bearing's sample; M or more if there is none, whose place is NaN.
        """
        shown = np.minimum(columns, len(self._distance_m))
        return self._places_m(np.append(self._distance_m, np.nan)[shown, None])[:, 0]

    def _places_m(self, distance_m: FloatArray) -> FloatArray:
        """Return floor places (K, N, 2) at distances (N,) or (K, N) along each bearing; NaN in empty rows."""
        bearing = self.bearing_rad
        rays = np.stack([np.cos(bearing), np.sin(bearing)], axis=1)
        floor = self.camera.offset_m + distance_m[..., None] * rays[:, None]
        floor[self.seen_bearings :] = np.nan
        return np.asarray(floor)

    def _find_valid(self) -> UInt8Array:
        pixels = self.pixels
        width, height = self.camera.size_px
        u, v = np.moveaxis(pixels, -1, 0)
        inside = (u >= 0) & (u <= width - 1) & (v >= 0) & (v <= height - 1)
        if self.mask is not None:
            rim = np.clip(np.nan_to_num(pixels), 0, (width - 1, height - 1))
            u, v = np.rint(np.moveaxis(rim, -1, 0)).astype(np.intp)
            hidden = self.mask[v, u] > 0
            # the 3 x 3 blur of the samples extends by one in each direction
            inside &= cv2.dilate(hidden.astype(np.uint8), np.ones((3, 3), np.uint8)) == 0
        valid: UInt8Array = inside.astype(np.uint8)
        valid.flags.writeable = False
        return valid

    @property
    def _homography(self) -> FloatArray:
        """(3, 3) float64: homography from `_planes` to this camera's pixels without distortion, at the same pan."""
        camera, known = self.camera, self._made_for
        before, after = _turn_of(known), _turn_of(camera)
        if before == after:
            return np.eye(3)
        (fu, fv), (cu, cv) = camera.focal_px, camera.center_px
        # from directions in the camera's frame to pixels, and back
        pixel = np.array([[cu, -fu, 0.0], [cv, 0.0, -fv], [1.0, 0.0, 0.0]])
        ray = np.array([[0.0, 0.0, 1.0], [-1.0 / fu, 0.0, cu / fu], [0.0, -1.0 / fv, cv / fv]])
        return np.asarray(pixel @ camera_rotation(0.0, *after).T @ camera_rotation(0.0, *before) @ ray)

    def sample(self, frame: UInt8Array) -> UInt8Array:
        """Unroll a frame (H, W, 3) into (K, M, 3) uint8: the nearest pixels, averaged over 3 x 3 samples.

        In a turned view it also updates `shown`.
        """
        seen, shape = self.seen_bearings, (COLUMNS, 3)
        nearest, samples = np.empty((seen, *shape), np.uint8), np.empty((self.bearings, *shape), np.uint8)
        shown = np.empty((self.bearings, COLUMNS), np.uint8)
        sample_turned(frame, self._planes, self._homography, self._lens, self.hidden_px, shown, nearest)
        if _turn_of(self.camera) != _turn_of(self._made_for):
            shown.flags.writeable = False
            self.shown = shown
        cv2.blur(nearest, (3, 3), dst=samples[:seen], borderType=cv2.BORDER_REPLICATE)
        samples[seen:] = 0
        return samples


def _turn_of(camera: PinholeCamera) -> tuple[float, float]:
    return camera.tilt_rad or 0.0, camera.roll_rad or 0.0


def _rim(camera: PinholeCamera) -> tuple[FloatArray, FloatArray]:
    """Return the bearing relative to the optical axis and the slope (upwards) of the picture's border, (N,) each."""
    width, height = camera.size_px
    u, v = np.arange(width, dtype=np.float64), np.arange(height, dtype=np.float64)
    sides = [np.stack([np.full(height, side), v], axis=1) for side in (0.0, width - 1.0)]
    ends = [np.stack([u, np.full(width, end)], axis=1) for end in (0.0, height - 1.0)]
    ray = camera.pixel_to_ray(np.vstack([*sides, *ends, _circle_px(camera)]))
    ray = ray[np.isfinite(ray).all(axis=1)]
    bearing = np.arctan2(ray[:, 1], ray[:, 0]) - (camera.pan_rad or 0.0)
    level = np.hypot(ray[:, 0], ray[:, 1])
    slope = ray[:, 2] / np.maximum(level, 1e-9)
    return np.remainder(bearing + math.pi, math.tau) - math.pi, slope


def _circle_px(camera: PinholeCamera) -> FloatArray:
    """(N, 2) float64: the part of a fisheye's rim that lies in the picture."""
    if not isinstance(camera, FisheyeCamera) or camera.usable_radius_px is None:
        return np.empty((0, 2))
    turn = np.linspace(0.0, math.tau, _AROUND, endpoint=False)
    # slightly inside, so that rounding leaves it within the lens
    radius = (1.0 - 1e-9) * camera.usable_radius_px[1] / camera.focal_px[0]
    on_rim = camera.center_px + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1) * camera.focal_px
    return np.asarray(on_rim[((on_rim >= 0) & (on_rim <= np.array(camera.size_px) - 1.0)).all(axis=1)])
