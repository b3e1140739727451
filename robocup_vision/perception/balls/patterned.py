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
from robocup_vision.compiling.loops import plain
from robocup_vision.kernels.balls import patterned as kernel
from robocup_vision.kernels.balls import patterned_carpet
from robocup_vision.perception.balls.ball import Sighting, lie_apart
from robocup_vision.perception.balls.look import BallFrame
from robocup_vision.perception.balls.projection import BallProjection, PinholeBallProjection

_TURNS = np.arange(kernel.DIRECTIONS) * math.tau / kernel.DIRECTIONS
_DIRECTIONS = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_LOGS = np.log(np.arange(256) + patterned_carpet.NOISE_COUNTS)


@dataclass(frozen=True, slots=True)
class PatternedBallSettings:
    """Settings of the search for patterned balls."""

    #: radii to search, and the ratio of successive sizes: half a step is within the blur
    min_radius_px: float = 5.0
    max_radius_px: float = 50.0
    radius_step: float = 1.12
    #: sampling of rims
    search: kernel.DiscSearch = kernel.DiscSearch(0.82, 1.12, 1.5, 0.25, 0.8, 0.5, 0.7, 0.55, 0.04)
    #: greatest hue and least greenness (see the kernel) of a carpet pixel in the lower half
    carpet_hue: float = -0.12
    min_green: float = 0.1
    #: greatest interquartile range of the carpet's hue, because carpet is of one material, unlike leaves of many plants
    max_hue_range: float = 0.4
    #: least brightness of carpet in the deepest shadow relative to its median; less is black
    min_carpet_level: float = 0.3
    min_carpet_ratio: float = 0.5
    #: greatest numbers of discs that are found, and that are weighed
    max_discs: int = 20000
    max_kept: int = 80
    #: ratio of directions at a rim that are ball inside and carpet outside, at a ball and elsewhere; number of
    #: independent directions of a whole rim
    rim_ratio: float = 0.85
    chance_rim_ratio: float = 0.45
    rim_signs: float = 6.0
    #: dark ratio of a disc: mean and standard deviation at a ball, whose patches cover 28 % and fade with distance;
    #: mean elsewhere, and the ratio of other discs that have any
    dark_ratio: float = 0.24
    dark_std: float = 0.09
    chance_dark_ratio: float = 0.06
    chance_any: float = 0.1
    #: ratio of places two and three radii away that are carpet, at a ball and elsewhere; number of independent ones
    around_ratio: float = 0.88
    chance_around_ratio: float = 0.6
    around_signs: float = 8.0
    #: greatest number of independent ones of either for each pixel of the radius, because blur correlates neighbours
    signs_per_px: float = 0.7
    #: bounds of the white's brightness relative to the carpet at the rim: more is a lamp or in front of the dark
    min_white: float = 1.0
    max_white: float = 2.6
    #: relative standard deviation of a measured radius; span of the tilts that other discs would imply
    radius_std: float = 0.12
    tilt_span_rad: float = 0.5
    outlier_ratio: float = 0.05  #: ratio of balls whose size is an outlier: half hidden, or half in the dark
    min_log_likelihood_ratio: float = 4.0  #: least log-likelihood ratio of a ball
    place_std: float = 0.1  #: standard deviation of a disc's centre, in radii


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

    def __init__(
        self,
        radius_m: float,
        camera: PinholeCamera,
        mask: UInt8Array | None = None,
        settings: PatternedBallSettings = PatternedBallSettings(),
    ) -> None:
        self.settings = settings
        self._radius_m = radius_m
        self._mask = mask
        width, height = camera.size_px
        self._search = plain(settings.search)
        count = math.log(settings.max_radius_px / settings.min_radius_px) / math.log(settings.radius_step)
        self._radii_px = settings.min_radius_px * settings.radius_step ** np.arange(int(count) + 1, dtype=np.float64)
        self._blurred = np.empty((height, width, 3), dtype=np.uint8)
        self._levels, self._kinds = np.empty((2, height, width), dtype=np.uint8)
        looked_at = -(-height // patterned_carpet.STRIDE) * -(-width // patterned_carpet.STRIDE)
        self._scratch = np.empty((4, looked_at + 1))
        self._found = np.empty((settings.max_discs, kernel.COLUMNS))
        self._kept = np.empty((settings.max_kept, kernel.COLUMNS))

    def forget(self) -> None:
        """See `BallLook.forget`: there is no state."""

    def sightings(self, seen: BallFrame) -> tuple[list[Sighting], BallProjection | None]:
        """See `BallLook.sightings`; an unknown tilt, and so the places, are estimated from the balls' sizes."""
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
        apart, std = _apart(discs, ratios, self.settings.min_log_likelihood_ratio), self.settings.place_std
        return [Sighting(disc.u_px, disc.v_px, std * disc.radius_px, ratio) for ratio, disc in apart], projection

    def _voted_tilt(self, discs: list[_Disc]) -> tuple[float, float, bool] | None:
        """Return the most likely tilt, its standard deviation, and whether it is implied by one disc only.

        None if no disc may be a ball.
        """
        needed = self.settings.min_log_likelihood_ratio
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
        settings = self.settings
        row_radii, top = self._row_radii_px(projection)
        half = frame.shape[0] // 2
        first = min(top, half)
        blurred, levels = self._blurred, self._levels
        cv2.blur(frame[first:], (3, 3), dst=blurred[first:])
        ratio, quarter, hue, three_quarters, green, level = patterned_carpet.measure_carpet(
            blurred, half, _LOGS, settings.carpet_hue, settings.min_green, self._scratch
        )
        has_carpet = ratio >= settings.min_carpet_ratio and three_quarters - quarter <= settings.max_hue_range
        if top == frame.shape[0] or not has_carpet:
            return []
        kinds = self._kinds
        # thresholds half-way from white to the carpet
        patterned_carpet.classify(
            blurred, top, 0.5 * hue, 0.5 * green, settings.min_carpet_level * level, levels, kinds
        )
        if self._mask is not None:
            kinds[self._mask > 0] = patterned_carpet.COLORED
        search = self._search
        found = self._found[: kernel.find_discs(kinds, _DIRECTIONS, self._radii_px, row_radii, search, self._found)]
        count = kernel.best_discs(kinds, levels, _DIRECTIONS, search, found, self._kept)
        kept = self._kept[:count]
        # fitting may have reduced a disc below the least size
        kept = kept[kept[:, kernel.RADIUS] >= settings.min_radius_px]
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
        bounds = projection.sizes.row_radii_px(self.settings.radius_std)
        reach = np.arange(height) - patterned_carpet.BEYOND * bounds[:, 1]
        reached = reach[bounds[:, 1] >= self.settings.min_radius_px]
        # clipped at the frame's upper border
        return bounds, int(max(reached.min(initial=height), 0.0))

    def _weighed(
        self, row: list[float], ray: list[float], lens_scale: float, camera: PinholeCamera, tilt_std_rad: float
    ) -> _Disc:
        """Return a disc with its log-likelihood ratio; `ray` is in the camera frame without roll."""
        settings = self.settings
        u, v, radius, rim, _, white, dark, carpet, around, shown = row
        nats = (
            shown
            * min(settings.rim_signs, settings.signs_per_px * radius)
            * _sign_nats(rim, settings.rim_ratio, settings.chance_rim_ratio)
        )
        nats += min(settings.around_signs, settings.signs_per_px * radius) * _sign_nats(
            around, settings.around_ratio, settings.chance_around_ratio
        )
        off = (dark - settings.dark_ratio) / settings.dark_std
        at_ball = math.exp(-0.5 * off * off) / (settings.dark_std * math.sqrt(math.tau))
        elsewhere = math.exp(-dark / settings.chance_dark_ratio) / settings.chance_dark_ratio
        nats += math.log((at_ball + settings.outlier_ratio) / (elsewhere + settings.chance_any))
        if not settings.min_white * carpet <= white <= settings.max_white * carpet:
            nats -= settings.min_log_likelihood_ratio
        # depression of the ray to the centre by the ball's size, and the tilt that gives the ray this depression
        half = radius / lens_scale * ray[0] / camera.focal_px[0]
        fall = min((camera.height_m - self._radius_m) / self._radius_m * math.sin(half), 0.99)
        reach = math.hypot(ray[0], ray[2])
        tilt = math.asin(max(-fall / reach, -1.0)) - math.atan2(ray[2], ray[0])
        std = math.hypot(tilt_std_rad, settings.radius_std * fall / math.sqrt(1 - fall * fall))
        return _Disc(u, v, radius, nats, tilt, std)

    def _ratio(self, disc: _Disc, tilt_rad: float) -> float:
        """Return the log-likelihood ratio of a disc, including its size, for a tilt of the camera."""
        settings = self.settings
        off = (disc.tilt_rad - tilt_rad) / disc.tilt_std_rad
        density = math.exp(-0.5 * off * off) / (disc.tilt_std_rad * math.sqrt(math.tau))
        likelihood = (1 - settings.outlier_ratio) * density * settings.tilt_span_rad + 0.1 * settings.outlier_ratio
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
