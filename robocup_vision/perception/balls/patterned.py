"""Search for white balls with dark patches in frames of a pinhole camera: round, with patches, on carpet.

A ball's size determines how far below the horizon its centre is: its radius in the picture, times the height of the
camera above that centre, divided by its radius in metres. Balls of one picture must therefore agree, and they determine
the camera's tilt if that is not known.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera, camera_rotation
from robocup_vision.kernels.balls import patterned as kernel
from robocup_vision.perception.balls.ball import Sighting, lie_apart
from robocup_vision.perception.balls.projection import (
    BallFrame,
    BallProjection,
    PinholeBallProjection,
    Sightings,
)
from robocup_vision.perception.balls.sizes import MEASURED_RADIUS_STD

# radii to search, pixels, and the ratio of successive sizes: half a step is within the blur
_MIN_RADIUS_PX, _MAX_RADIUS_PX, _RADIUS_STEP = 5.0, 50.0, 1.12
# greatest interquartile range of the carpet's hue, because carpet is of one material, unlike leaves of many plants
_MAX_HUE_RANGE = 0.4
# least brightness of carpet in the deepest shadow relative to its median: less is black; least ratio of carpet in the
# lower half
_MIN_CARPET_LEVEL, _MIN_CARPET_RATIO = 0.3, 0.5
# greatest numbers of discs that are found, and that are weighed
_MAX_DISCS, _MAX_KEPT = 20000, 80
# ratio of directions at a rim that are ball inside and carpet outside, at a ball and elsewhere; number of independent
# directions of a whole rim
_RIM_RATIO, _CHANCE_RIM_RATIO, _RIM_SIGNS = 0.85, 0.45, 6.0
# dark ratio of a disc: mean and standard deviation at a ball, whose patches cover 28 % and fade with distance; mean
# elsewhere, and the ratio of other discs that have any
_DARK_RATIO, _DARK_STD, _CHANCE_DARK_RATIO, _CHANCE_ANY = 0.24, 0.09, 0.06, 0.1
# ratio of places two and three radii away that are carpet, at a ball and elsewhere; number of independent ones
_AROUND_RATIO, _CHANCE_AROUND_RATIO, _AROUND_SIGNS = 0.88, 0.6, 8.0
# greatest number of independent ones of either for each pixel of the radius, because blur correlates neighbours
_SIGNS_PER_PX = 0.7
# bounds of the white's brightness relative to the carpet at the rim: more is a lamp or in front of the dark
_MIN_WHITE, _MAX_WHITE = 1.0, 2.6
# span of the tilts that other discs would imply
_TILT_SPAN_RAD = 0.5
# ratio of balls whose size is an outlier: half hidden, or half in the dark
_OUTLIER_RATIO = 0.05
# least log-likelihood ratio of a ball
_MIN_LOG_LIKELIHOOD_RATIO = 4.0
# standard deviation of a disc's centre, in radii
_PLACE_STD = 0.1


@dataclass(frozen=True, slots=True)
class _Disc:
    """A candidate disc: place and radius, log-likelihood ratio, and the camera's tilt if it is a ball."""

    u_px: float
    v_px: float
    radius_px: float
    nats: float
    tilt_rad: float
    tilt_std_rad: float


class PatternedLook:
    """White balls with dark patches in frames of one pinhole camera; has scratch memory, not shared between threads.

    Parameters
    ----------
    radius_m : float
        Radius of a ball.
    camera : PinholeCamera
        Its tilt may be unknown: then it is estimated from two balls in view, or from one that is clear.
    mask : (H, W) uint8, optional
        Non-zero pixels are never used.
    """

    def __init__(self, radius_m: float, camera: PinholeCamera, mask: UInt8Array | None = None) -> None:
        self._radius_m = radius_m
        self._mask = mask
        width, height = camera.size_px
        count = math.log(_MAX_RADIUS_PX / _MIN_RADIUS_PX) / math.log(_RADIUS_STEP)
        self._radii_px = _MIN_RADIUS_PX * _RADIUS_STEP ** np.arange(int(count) + 1, dtype=np.float64)
        self._blurred = np.empty((height, width, 3), dtype=np.uint8)
        self._levels, self._kinds = np.empty((2, height, width), dtype=np.uint8)
        looked_at = -(-height // kernel.STRIDE) * -(-width // kernel.STRIDE)
        self._scratch = np.empty((4, looked_at + 1))
        self._found = np.empty((_MAX_DISCS, kernel.COLUMNS))
        self._kept = np.empty((_MAX_KEPT, kernel.COLUMNS))

    def forget(self) -> None:
        """Forget the previous frames: there is no state."""

    def sightings(self, seen: BallFrame) -> Sightings:
        """Return the sightings in a frame; an unknown tilt, and so the places, are estimated from the balls' sizes."""
        camera, projection = seen.camera, seen.projection
        assert isinstance(camera, PinholeCamera)
        tilt_std, roll_std = camera.sway_std_rad
        if isinstance(projection, PinholeBallProjection):
            tilt_std, roll_std = projection.sway_std_rad
        discs = self._discs(seen.frame, camera, projection, tilt_std)
        if camera.tilt_rad is None:
            voted = self._voted_tilt(discs)
            if voted is None:
                return [], None
            tilt, tilt_std, is_alone = voted
            # a single disc cannot confirm the tilt that it implies itself
            ratios = [min(self._ratio(disc, tilt), disc.nats if is_alone else math.inf) for disc in discs]
            held = camera.with_orientation(camera.pan_rad or 0.0, tilt, camera.roll_rad or 0.0)
            projection = PinholeBallProjection(held, self._radius_m, (tilt_std, roll_std))
        else:
            tilt = camera.tilt_rad
            ratios = [self._ratio(disc, tilt) for disc in discs]
        apart = _apart(discs, ratios, _MIN_LOG_LIKELIHOOD_RATIO)
        return [Sighting(one.u_px, one.v_px, _PLACE_STD * one.radius_px, ratio) for ratio, one in apart], projection

    def _voted_tilt(self, discs: list[_Disc]) -> tuple[float, float, bool] | None:
        """Return the most likely tilt, its standard deviation, and whether it is implied by one disc only.

        None if no disc may be a ball.
        """
        needed = _MIN_LOG_LIKELIHOOD_RATIO
        likely = [disc for disc in discs if disc.nats > 0]
        if not likely:
            return None

        def apart(tilt: float, least: float) -> list[tuple[float, _Disc]]:
            return _apart(discs, [self._ratio(disc, tilt) for disc in discs], least)

        best = max(likely, key=lambda disc: sum(ratio for ratio, _ in apart(disc.tilt_rad, 0.0)))
        clear = [disc for _, disc in apart(best.tilt_rad, needed)]
        if len(clear) < 2:
            return best.tilt_rad, best.tilt_std_rad, True
        weights = [disc.tilt_std_rad**-2 for disc in clear]
        tilt = float(np.average([disc.tilt_rad for disc in clear], weights=weights))
        return tilt, sum(weights) ** -0.5, False

    def _discs(
        self, frame: UInt8Array, camera: PinholeCamera, projection: BallProjection | None, tilt_std_rad: float
    ) -> list[_Disc]:
        row_radii, top = self._row_radii_px(projection)
        half = frame.shape[0] // 2
        first = min(top, half)
        blurred, levels = self._blurred, self._levels
        cv2.blur(frame[first:], (3, 3), dst=blurred[first:])
        ratio, quarter, hue, three_quarters, green, level = kernel.measure_carpet(blurred, half, self._scratch)
        has_carpet = ratio >= _MIN_CARPET_RATIO and three_quarters - quarter <= _MAX_HUE_RANGE
        if top == frame.shape[0] or not has_carpet:
            return []
        kinds = self._kinds
        # thresholds half-way from white to the carpet
        kernel.classify(blurred, top, 0.5 * hue, 0.5 * green, _MIN_CARPET_LEVEL * level, levels, kinds)
        if self._mask is not None:
            kinds[self._mask > 0] = kernel.COLORED
        found = self._found[: kernel.find_discs(kinds, self._radii_px, row_radii, self._found)]
        count = kernel.best_discs(kinds, levels, found, self._kept)
        kept = self._kept[:count]
        # fitting may have reduced a disc below the least size
        kept = kept[kept[:, kernel.RADIUS] >= _MIN_RADIUS_PX]
        if not len(kept):
            return []
        rays = (
            camera.pixel_to_camera_ray(kept[:, : kernel.RADIUS]) @ camera_rotation(0.0, 0.0, camera.roll_rad or 0.0).T
        )
        shrunk = _lens_scale(camera, kept[:, : kernel.RADIUS]).tolist()
        return [
            self._weighed(*one, camera, tilt_std_rad) for one in zip(kept.tolist(), rays.tolist(), shrunk, strict=True)
        ]

    def _row_radii_px(self, projection: BallProjection | None) -> tuple[FloatArray, int]:
        """Return the least and greatest radius (H, 2) of a ball on the floor in each row, and the first row in use.

        Without a tilt any size is possible in any row.
        """
        height = len(self._kinds)
        if projection is None:
            return np.tile((0.0, math.inf), (height, 1)), 0
        bounds = projection.sizes.row_radii_px
        reach = np.arange(height) - kernel.BEYOND * bounds[:, 1]
        reached = reach[bounds[:, 1] >= _MIN_RADIUS_PX]
        # clipped at the frame's upper border
        return bounds, int(max(reached.min(initial=height), 0.0))

    def _weighed(
        self, row: list[float], ray: list[float], lens_scale: float, camera: PinholeCamera, tilt_std_rad: float
    ) -> _Disc:
        """Return a disc with its log-likelihood ratio; `ray` is in the camera frame without roll."""
        u, v, radius, rim, _, white, dark, carpet, around, shown = row
        nats = shown * min(_RIM_SIGNS, _SIGNS_PER_PX * radius) * _sign_nats(rim, _RIM_RATIO, _CHANCE_RIM_RATIO)
        nats += min(_AROUND_SIGNS, _SIGNS_PER_PX * radius) * _sign_nats(around, _AROUND_RATIO, _CHANCE_AROUND_RATIO)
        off = (dark - _DARK_RATIO) / _DARK_STD
        at_ball = math.exp(-0.5 * off * off) / (_DARK_STD * math.sqrt(math.tau))
        elsewhere = math.exp(-dark / _CHANCE_DARK_RATIO) / _CHANCE_DARK_RATIO
        nats += math.log((at_ball + _OUTLIER_RATIO) / (elsewhere + _CHANCE_ANY))
        if not _MIN_WHITE * carpet <= white <= _MAX_WHITE * carpet:
            nats -= _MIN_LOG_LIKELIHOOD_RATIO
        # depression of the ray to the centre by the ball's size, and the tilt that gives the ray this depression
        half = radius / lens_scale * ray[0] / camera.focal_px[0]
        fall = min((camera.height_m - self._radius_m) / self._radius_m * math.sin(half), 0.99)
        reach = math.hypot(ray[0], ray[2])
        tilt = math.asin(max(-fall / reach, -1.0)) - math.atan2(ray[2], ray[0])
        std = math.hypot(tilt_std_rad, MEASURED_RADIUS_STD * fall / math.sqrt(1 - fall * fall))
        return _Disc(u, v, radius, nats, tilt, std)

    def _ratio(self, disc: _Disc, tilt_rad: float) -> float:
        """Return the log-likelihood ratio of a disc, including its size, for a tilt of the camera."""
        off = (disc.tilt_rad - tilt_rad) / disc.tilt_std_rad
        density = math.exp(-0.5 * off * off) / (disc.tilt_std_rad * math.sqrt(math.tau))
        likelihood = (1 - _OUTLIER_RATIO) * density * _TILT_SPAN_RAD + 0.1 * _OUTLIER_RATIO
        return disc.nats + math.log(likelihood)


def _lens_scale(camera: PinholeCamera, pixels: FloatArray) -> FloatArray:
    """Return the lens' magnification (N,) at pixels (N, 2), relative to a lens without distortion."""
    if not camera.is_bent:
        return np.ones(len(pixels))
    beside = pixels[:, None] + [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
    right, left, low, high = np.moveaxis(camera.ideal_pixels(beside) / 2.0, 1, 0)
    (au, av), (bu, bv) = (right - left).T, (low - high).T
    return np.asarray(np.abs(au * bv - av * bu) ** -0.5)


def _apart(discs: list[_Disc], ratios: list[float], needed: float) -> list[tuple[float, _Disc]]:
    """Return the discs of at least the needed ratio, the best first, without those that overlap a better one."""
    likely = [(ratio, disc) for ratio, disc in zip(ratios, discs, strict=True) if ratio >= needed]
    likely.sort(key=lambda one: -one[0])
    return [likely[n] for n in lie_apart([(disc.u_px, disc.v_px, disc.radius_px) for _, disc in likely], 1.0)]


def _sign_nats(ratio: float, expected: float, by_chance: float) -> float:
    """Return the log-likelihood ratio of a ball for each of some binary signs, of which a ratio is positive."""
    return ratio * math.log(expected / by_chance) + (1 - ratio) * math.log((1 - expected) / (1 - by_chance))
