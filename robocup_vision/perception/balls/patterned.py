"""White balls with dark patches, in frames of a pinhole camera: no blob of a colour, but round, patched, on carpet.

A ball's size says how far below the horizon its centre lies: by its radius in the picture, times the height of the
camera over that centre, by the radius in metres. So balls in one picture bear each other out, and where the camera's
tilt is not known they give it.
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
from robocup_vision.perception.balls.projection import SWAY_STD_RAD, BallProjection, PinholeBallProjection

_TURNS = np.arange(kernel.DIRECTIONS) * math.tau / kernel.DIRECTIONS
_DIRECTIONS = np.column_stack([np.cos(_TURNS), np.sin(_TURNS)])
_LOGS = np.log(np.arange(256) + patterned_carpet.NOISE_COUNTS)


@dataclass(frozen=True, slots=True)
class PatternedBallSettings:
    """What the search for patterned balls can be tuned by."""

    #: of the balls that are looked for, and the factor from one size to the next: half a step is blur
    min_radius_px: float = 5.0
    max_radius_px: float = 50.0
    radius_step: float = 1.12
    #: where rims are looked for
    search: kernel.DiscSearch = kernel.DiscSearch(0.82, 1.12, 1.5, 0.25, 0.8, 0.5, 0.7, 0.55, 0.04)
    #: below this hue and above this greenness (see the kernel) a pixel of the lower half may be carpet; so many of them
    #: must be
    carpet_hue: float = -0.12
    min_green: float = 0.1
    #: between the quartiles of the carpet's hue: it is of one material. In sun and shadow it is 0.25, of leaves of many
    #: plants 0.3 to 0.6.
    max_hue_range: float = 0.4
    #: carpet in the deepest shadow has so much of the usual one's brightness; less is black
    min_carpet_level: float = 0.3
    min_carpet_ratio: float = 0.5
    #: discs that are found and weighed at most
    max_discs: int = 20000
    max_kept: int = 80
    #: of the directions at a rim, those that part ball from carpet, at a ball and elsewhere; independent ones of a
    #: whole rim
    rim_ratio: float = 0.85
    chance_rim_ratio: float = 0.45
    rim_signs: float = 6.0
    #: of a disc, what is dark: mean and standard deviation at a ball, whose patches cover 28 % and fade with distance;
    #: mean elsewhere, and the ratio of discs elsewhere that have any
    dark_ratio: float = 0.24
    dark_std: float = 0.09
    chance_dark_ratio: float = 0.06
    chance_any: float = 0.1
    #: of places two and three radii away, those that are carpet, at a ball and elsewhere; independent ones
    around_ratio: float = 0.88
    chance_around_ratio: float = 0.6
    around_signs: float = 8.0
    #: of either at most so many for each pixel of the radius: neighbours that the blur covers say the same
    signs_per_px: float = 0.7
    #: the white is so many times as bright as the carpet at the ball's rim: more is a lamp, or before the dark
    min_white: float = 1.0
    max_white: float = 2.6
    #: of a measured radius, relative; angle over which the tilts lie that other discs would need
    radius_std: float = 0.12
    tilt_span_rad: float = 0.5
    outlier_ratio: float = 0.05  #: of balls, those whose size says nothing: half hidden, or half in the dark
    min_log_likelihood_ratio: float = 4.0  #: a find with less is no ball
    place_std: float = 0.1  #: of a disc's centre, of its radius


@dataclass(frozen=True, slots=True)
class _Disc:
    """A disc that may be a ball: place and radius, what speaks for it, and the camera's tilt if it is one."""

    u_px: float
    v_px: float
    radius_px: float
    nats: float
    tilt_rad: float
    tilt_std_rad: float


class PatternedLook:
    """White balls with dark patches in frames of one pinhole camera; holds scratch memory: one object a thread.

    Parameters
    ----------
    radius_m : float
        Of a ball.
    camera : PinholeCamera
        Its tilt may be unknown: then two balls in view give it, or one that is clear.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
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
        """See `BallLook.forget`: nothing is remembered."""

    def sightings(self, seen: BallFrame) -> tuple[list[Sighting], BallProjection | None]:
        """See `BallLook.sightings`; where the tilt is unknown the balls' own sizes give it, and so their places."""
        camera, projection = seen.camera, seen.projection
        assert isinstance(camera, PinholeCamera)
        tilt_std, roll_std = camera.sway_std_rad(SWAY_STD_RAD)
        if isinstance(projection, PinholeBallProjection):
            tilt_std, roll_std = projection.sway_std_rad
        discs = self._discs(seen.frame, camera, projection, tilt_std)
        if camera.tilt_rad is None:
            voted = self._voted_tilt(discs)
            if voted is None:
                return [], None
            tilt, tilt_std, is_alone = voted
            # a disc that alone says what the tilt is cannot be borne out by it
            ratios = [min(self._ratio(disc, tilt), disc.nats if is_alone else math.inf) for disc in discs]
            held = camera.with_orientation(camera.pan_rad or 0.0, tilt, camera.roll_rad or 0.0)
            projection = PinholeBallProjection(held, self._radius_m, (tilt_std, roll_std))
        else:
            tilt = camera.tilt_rad
            ratios = [self._ratio(disc, tilt) for disc in discs]
        apart, std = _apart(discs, ratios, self.settings.min_log_likelihood_ratio), self.settings.place_std
        return [Sighting(disc.u_px, disc.v_px, std * disc.radius_px, ratio) for ratio, disc in apart], projection

    def _voted_tilt(self, discs: list[_Disc]) -> tuple[float, float, bool] | None:
        """Return the tilt that most speaks for, its standard deviation, and whether one disc alone speaks for it.

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
        # half-way from white to the carpet
        patterned_carpet.classify(
            blurred, top, 0.5 * hue, 0.5 * green, settings.min_carpet_level * level, levels, kinds
        )
        if self._mask is not None:
            kinds[self._mask > 0] = patterned_carpet.COLORED
        search = self._search
        found = self._found[: kernel.find_discs(kinds, _DIRECTIONS, self._radii_px, row_radii, search, self._found)]
        count = kernel.best_discs(kinds, levels, _DIRECTIONS, search, found, self._kept)
        kept = self._kept[:count]
        # a disc may have shrunk below what is looked for when its place and size were fitted
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
        """Return the least and greatest radius (H, 2) of a ball on the floor in each row, and the first row of use.

        A tilt that is not known leaves every size open in every row.
        """
        height = len(self._kinds)
        if projection is None:
            return np.tile((0.0, math.inf), (height, 1)), 0
        bounds = projection.sizes.row_radii_px(self.settings.radius_std)
        reach = np.arange(height) - patterned_carpet.BEYOND * bounds[:, 1]
        reached = reach[bounds[:, 1] >= self.settings.min_radius_px]
        # beyond the frame's upper rim nothing is looked at, however large the ball
        return bounds, int(max(reached.min(initial=height), 0.0))

    def _weighed(
        self, row: list[float], ray: list[float], lens_scale: float, camera: PinholeCamera, tilt_std_rad: float
    ) -> _Disc:
        """Return a disc of the search and what speaks for it; its ray is the camera's, with the roll undone."""
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
        # the depression of the ray to the centre by the ball's size, and the tilt that puts the ray there
        half = radius / lens_scale * ray[0] / camera.focal_px[0]
        fall = min((camera.height_m - self._radius_m) / self._radius_m * math.sin(half), 0.99)
        reach = math.hypot(ray[0], ray[2])
        tilt = math.asin(max(-fall / reach, -1.0)) - math.atan2(ray[2], ray[0])
        std = math.hypot(tilt_std_rad, settings.radius_std * fall / math.sqrt(1 - fall * fall))
        return _Disc(u, v, radius, nats, tilt, std)

    def _ratio(self, disc: _Disc, tilt_rad: float) -> float:
        """Return the log-likelihood ratio of a disc, its size included, for a tilt of the camera."""
        settings = self.settings
        off = (disc.tilt_rad - tilt_rad) / disc.tilt_std_rad
        density = math.exp(-0.5 * off * off) / (disc.tilt_std_rad * math.sqrt(math.tau))
        likelihood = (1 - settings.outlier_ratio) * density * settings.tilt_span_rad + 0.1 * settings.outlier_ratio
        return disc.nats + math.log(likelihood)


def _lens_scale(camera: PinholeCamera, pixels: FloatArray) -> FloatArray:
    """How many times larger (N,) than without distortion a lens shows what is at some pixels (N, 2)."""
    if not camera.is_bent:
        return np.ones(len(pixels))
    beside = pixels[:, None] + [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]
    right, left, low, high = np.moveaxis(camera.ideal_pixels(beside) / 2.0, 1, 0)
    (au, av), (bu, bv) = (right - left).T, (low - high).T
    return np.asarray(np.abs(au * bv - av * bu) ** -0.5)


def _apart(discs: list[_Disc], ratios: list[float], needed: float) -> list[tuple[float, _Disc]]:
    """Return the discs of at least the needed ratio, the best first, of those that lie over each other the best."""
    likely = [(ratio, disc) for ratio, disc in zip(ratios, discs, strict=True) if ratio >= needed]
    likely.sort(key=lambda one: -one[0])
    return [likely[n] for n in lie_apart([(disc.u_px, disc.v_px, disc.radius_px) for _, disc in likely], 1.0)]


def _sign_nats(ratio: float, expected: float, by_chance: float) -> float:
    """Log-likelihood ratio a sign, where a ratio of signs speaks for a ball."""
    return ratio * math.log(expected / by_chance) + (1 - ratio) * math.log((1 - expected) / (1 - by_chance))
