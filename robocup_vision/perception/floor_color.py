"""Estimation of the floor's colour from the robot's surroundings in one frame.

The floor's chromaticity (R/G, B/G) is tracked over brightness, from the ring around the robot's body step by step into
darker and brighter samples of the frame. The same rules therefore hold under a colour cast, in a dark hall, in a hard
shadow, which is darker and a little bluer, and in noise, which widens the chromaticity of dark samples by a known
amount.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.kernels.floor import colors as kernel
from robocup_vision.kernels.floor.common_tone import greenest_common_tone
from robocup_vision.kernels.floor.polar import RING_COLUMNS

# log brightness relative to the ring, from a deep shadow to a highlight; colour files have a value for each
LEVEL_STEP = 0.25
LEVELS = np.arange(-7, 6) * LEVEL_STEP
_CENTER = 7
# least ratio of a channel, also where the floor has none of its colour
_MIN_RATIO = 0.01
# log brightness that the steps reach at least
_SUN = float(LEVELS[-2]) - 0.1
# weight of samples of the ring around the robot, which are most probably floor, relative to others
_RING_WEIGHT = 2.0
# greatest change of a ratio's logarithm from one brightness step to the next, and in total: a sky-lit shadow is about
# 20 % bluer, and a highlight adds white until green is half-way to it
_MAX_STEP_DRIFT, _MAX_DRIFT = 0.15, 0.45
# greatest total change towards grey in a shadow; with a larger one it is something black
_MAX_GREY_DRIFT = 0.2
# bounds of a ratio's relative standard deviation in addition to the noise
_MIN_SPREAD, _MAX_SPREAD = 0.05, 0.15
# least number of samples that determine a colour
_MIN_SAMPLES = 50
# chi-square gate of a floor sample: 2 degrees of freedom, 95 %
_GATE = 6.0


@dataclass(frozen=True, slots=True)
class PaintColor:
    """The colour of a painted object in a frame, as ratios to green."""

    #: r/G and B/G
    red_ratio: float
    blue_ratio: float


@dataclass(frozen=True, eq=False)
class FloorColor:
    """The floor's colour in one frame."""

    level: float  #: brightness (R + 2G + B)/4 of the lit floor, counts
    noise: float  #: standard deviation of one channel of one blurred sample, counts
    #: (L,) float64: r/G and B/G of the floor over the log-brightness steps
    red_ratio: FloatArray
    blue_ratio: FloatArray
    spread: FloatArray  #: (2,) float64: relative standard deviation of R/G and B/G in addition to the noise

    @property
    def lit(self) -> PaintColor:
        """The floor's colour at its usual brightness."""
        return PaintColor(float(self.red_ratio[_CENTER]), float(self.blue_ratio[_CENTER]))

    def log_likelihood_ratio(
        self, blue: FloatArray, green: FloatArray, red: FloatArray, white: PaintColor | None = None
    ) -> FloatArray:
        """Return the log-likelihood ratio of floor to any colour, nats, for colours of any shape (levels).

        With `white`, the alternative includes grey of any brightness: walls and black things, which resemble floor in
        the dark and in noise.
        """
        of_floor, of_white = self.densities(white or PaintColor(1.0, 1.0))
        if white is None:
            of_white[kernel.PEAK] = -np.inf
        colors = np.stack(np.broadcast_arrays(blue, green, red)).astype(np.float64)
        out = np.empty(colors.shape[1:])
        kernel.log_ratios(colors.reshape(3, -1), of_floor, of_white, out.reshape(-1))
        return out

    def densities(self, white: PaintColor) -> tuple[FloatArray, FloatArray]:
        """Parameters (8, S), (6, S) float64 of floor's and white's densities over brightness, see the kernel."""
        level = np.arange(255 * int(kernel.FINE) + 1) / kernel.FINE
        log_level = np.log(np.maximum(level, 0.5) / self.level)
        red_ratio = np.interp(log_level, LEVELS, self.red_ratio)
        blue_ratio = np.interp(log_level, LEVELS, self.blue_ratio)
        background = -np.log(4 * self._green_of(level, red_ratio, blue_ratio) ** 2)
        outside = np.maximum(LEVELS[0] - log_level, 0.0) + np.maximum(log_level - LEVELS[-2], 0.0)
        numbers = self._density_numbers(level, red_ratio, blue_ratio)
        floor = np.vstack([numbers, _purer(white, red_ratio, blue_ratio, numbers[kernel.RED_RED : kernel.PEAK])])
        floor[kernel.PEAK] -= background + 0.5 * (outside / 0.2) ** 2
        of_white = np.full_like(level, white.red_ratio), np.full_like(level, white.blue_ratio)
        rival = self._density_numbers(level, *of_white)
        rival[kernel.PEAK] -= background
        return floor, rival

    @staticmethod
    def _green_of(level: FloatArray, red_ratio: FloatArray, blue_ratio: FloatArray) -> FloatArray:
        return np.asarray(np.maximum(4 * level / (2 + red_ratio + blue_ratio), 1.0))

    def _density_numbers(self, level: FloatArray, red_ratio: FloatArray, blue_ratio: FloatArray) -> FloatArray:
        """Parameters (6, S) of the density of (R, B) given the brightness, for paint of these ratios in this noise."""
        expected_green = self._green_of(level, red_ratio, blue_ratio)
        n2 = self.noise**2 + 0.25
        var_red = n2 * (1 + red_ratio**2) + (self.spread[0] * red_ratio * expected_green) ** 2
        var_blue = n2 * (1 + blue_ratio**2) + (self.spread[1] * blue_ratio * expected_green) ** 2
        cov = n2 * red_ratio * blue_ratio
        det = var_red * var_blue - cov**2
        peak = -0.5 * np.log(det) - math.log(math.tau)
        return np.stack([red_ratio, blue_ratio, var_blue / det, -cov / det, var_red / det, peak])


def learn_floor_color(samples: UInt8Array, valid: UInt8Array) -> FloorColor | None:
    """Estimate the floor's colour from an unrolled, slightly blurred frame.

    Parameters
    ----------
    samples : (K, M, 3) uint8
        Bearings, radii inside out, BGR.
    valid : (K, M) uint8
        1 where a sample may be used.

    Returns
    -------
    FloorColor or None
        None if the ring around the robot is too dark, or too little of it is in view.
    """
    # counted among the valid samples, because a mask may hide the body, and more of it at some bearings
    outwards = np.cumsum(valid > 0, axis=1)
    ring = (valid > 0) & (outwards <= RING_COLUMNS)
    if np.count_nonzero(ring) < _MIN_SAMPLES:
        return None
    noise = _noise(samples, ring)
    # the samples around the ring count, too, because it may be in a highlight or beside a robot
    near = (valid > 0) & ~ring & (outwards <= samples.shape[1] // 2)
    blue, green, red = np.hstack([pick_colors(samples, ring), pick_colors(samples, near)])
    weight = np.where(np.arange(len(green)) < np.count_nonzero(ring), _RING_WEIGHT, 1.0)
    level = brightness_of(blue, green, red)
    bright = (level > 4) & (green > 2)
    if np.count_nonzero(bright) < _MIN_SAMPLES:
        return None
    log_red = np.log((red[bright] + 1) / (green[bright] + 1))
    log_blue = np.log((blue[bright] + 1) / (green[bright] + 1))
    red0, blue0, member = _mode(log_red, log_blue, weight[bright])
    level0 = _lit_level(level[bright][member])
    red_ratio, blue_ratio, spread = _follow(samples, valid, level0, noise, (math.exp(red0), math.exp(blue0)))
    return FloorColor(level0, noise, red_ratio, blue_ratio, spread)


def follow_floor_color(
    samples: UInt8Array, valid: UInt8Array, is_floor: npt.NDArray[np.bool_], before: FloorColor, lift: float
) -> FloorColor | None:
    """Estimate the floor's colour again under changed light, from samples that are still known to be floor.

    Unlike `learn_floor_color` it cannot take a robot or a wall that fills most of the frame for the floor.

    Parameters
    ----------
    samples, valid
        As in `learn_floor_color`.
    is_floor : (K, M) bool
        Samples that are floor by the previous colours.
    lift : float
        Shift of the brightness steps upwards, log brightness.

    Returns
    -------
    FloorColor or None
        None if too few samples are floor.
    """
    usable = is_floor[:, :RING_COLUMNS]
    noise = _noise(samples[:, :RING_COLUMNS], usable) if np.count_nonzero(usable) >= _MIN_SAMPLES else before.noise
    # every other bearing suffices, because neighbours share pixels
    samples, valid, is_floor = samples[::2], valid[::2], is_floor[::2]
    blue, green, red = pick_colors(samples, is_floor)
    level = brightness_of(blue, green, red)
    bright = (level > 4) & (green > 2)
    if np.count_nonzero(bright) < _MIN_SAMPLES:
        return None
    level0 = _lit_level(level[bright]) * math.exp(lift)
    near = bright & (np.abs(np.log(np.maximum(level, 0.5) / level0)) < 2 * LEVEL_STEP)
    near = near if np.count_nonzero(near) >= _MIN_SAMPLES else bright
    green1 = green[near] + 1
    red0, blue0 = (float(np.median((c[near] + 1) / green1)) for c in (red, blue))
    return FloorColor(level0, noise, *_follow(samples, valid, level0, noise, (red0, blue0)))


def pick_colors(samples: UInt8Array, wanted: npt.NDArray[np.bool_] | UInt8Array) -> FloatArray:
    """Return the channels (3, N) of the wanted (K, M) samples (K, M, 3)."""
    # separate channels, because picking rows of three bytes takes five times as long
    places = np.flatnonzero(wanted)
    return np.stack([samples[..., c].ravel()[places] for c in range(3)]).astype(np.float64)


def brightness_of(blue: FloatArray, green: FloatArray, red: FloatArray) -> FloatArray:
    """Return the brightness of colours, levels; arrays of one shape."""
    return np.asarray((red + 2 * green + blue) / 4)


def _purer(white: PaintColor, red_ratio: FloatArray, blue_ratio: FloatArray, inverse: FloatArray) -> FloatArray:
    """Return (2, ...) weights of R and B minus the floor's that give the distance towards a purer floor colour.

    The distance is in standard deviations, and `inverse` (3, ...) the inverse covariance of R and B: red, mixed, blue.
    Reflections, stray light and haze add white to the carpet's colour by varying amounts. With less of it than where
    the colour was learnt, floor is farther from white in the same direction.
    """
    red, blue = red_ratio - white.red_ratio, blue_ratio - white.blue_ratio
    weighed = np.stack([inverse[0] * red + inverse[1] * blue, inverse[1] * red + inverse[2] * blue])
    return np.asarray(weighed / np.sqrt(np.maximum(weighed[0] * red + weighed[1] * blue, 1e-300)))


def _lit_level(level: FloatArray) -> float:
    """Return the median brightness, or a brighter one if the steps would not reach from there to the sunlit floor."""
    usual, sunny = np.percentile(level, (50, 95))
    return float(max(usual, sunny * math.exp(-_SUN)))


def _noise(samples: UInt8Array, usable: npt.NDArray[np.bool_]) -> float:
    # samples three bearings apart share no pixels; texture counts as noise here
    both = usable[:-3] & usable[3:]
    difference = np.abs(samples[:-3][both].astype(np.float64) - samples[3:][both]).max(axis=1)
    # the lower quartile of the largest of three half-normal channels is about 0.83 sigma sqrt(2)
    return float(np.percentile(difference, 25)) / (0.83 * math.sqrt(2.0)) if len(difference) else 1.0


def _mode(log_red: FloatArray, log_blue: FloatArray, weight: FloatArray) -> tuple[float, float, npt.NDArray[np.bool_]]:
    """Return the median of the greenest common tone, and the colours (N,) that belong to it."""
    red, blue = greenest_common_tone(log_red, log_blue, weight)
    member = np.ones(len(log_red), dtype=bool)
    for _ in range(3):
        member = np.hypot(log_red - red, log_blue - blue) < 0.3
        red, blue = float(np.median(log_red[member])), float(np.median(log_blue[member]))
    return red, blue, member


def _follow(
    samples: UInt8Array, valid: UInt8Array, level0: float, noise: float, ratios: tuple[float, float]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Track the ratios R/G and B/G over brightness; returns both curves (L,) and their spread (2,)."""
    red0, blue0 = ratios
    channels, first = _by_step(samples, valid, level0)
    red_ratio, blue_ratio = [red0] * len(LEVELS), [blue0] * len(LEVELS)
    spread = _MIN_SPREAD, _MIN_SPREAD
    min_samples = max(40, channels.shape[1] // 300)
    order = [(_CENTER, _CENTER), *((i, i - 1) for i in range(_CENTER + 1, len(LEVELS)))]
    order += [(i, i + 1) for i in range(_CENTER - 1, -1, -1)]
    for here, before in order:
        last_red, last_blue = red_ratio[before], blue_ratio[before]
        b, g, r = channels[:, first[here] : first[here + 1]]
        red_slack, blue_slack = (width + _MAX_STEP_DRIFT / 2 for width in spread)
        # a highlight changes the ratio towards white, a shadow in proportion
        red_scale, blue_scale = (
            max(ratio, 1.0 - ratio) if here > _CENTER else ratio for ratio in (last_red, last_blue)
        )
        green2 = g * g
        var_red = noise**2 * (1 + last_red**2) + 0.25 + (red_slack * red_scale) ** 2 * green2
        var_blue = noise**2 * (1 + last_blue**2) + 0.25 + (blue_slack * blue_scale) ** 2 * green2
        member = (r - last_red * g) ** 2 / var_red + (b - last_blue * g) ** 2 / var_blue < _GATE
        red_ratio[here], blue_ratio[here] = last_red, last_blue
        b, g, r = b[member], g[member], r[member]
        if len(g) < min_samples:
            continue
        drifts = []
        for c, last, start in ((r, last_red, red0), (b, last_blue, blue0)):
            seen = max(float(c.sum()), 1.0) / max(float(g.sum()), 1.0)
            if here > _CENTER:
                # on the scale of the distance to white, because the ratio itself may be near zero
                scale = max(start, 1.0 - start)
                step = _within((seen - last) / scale, _MAX_STEP_DRIFT)
                ratio = start + scale * _within((last - start) / scale + step, _MAX_DRIFT)
                drifts.append(math.log(max(ratio, _MIN_RATIO) / start))
            else:
                drift = math.log(last / start) + _within(math.log(seen / last), _MAX_STEP_DRIFT)
                drifts.append(_within(drift, _MAX_DRIFT))
        if here < _CENTER:
            # a shadow does not make paint grey: grey samples are something black
            grey = max(0.0, sum(drifts) - _MAX_GREY_DRIFT) / 2
            drifts = [drift - grey for drift in drifts]
        red_ratio[here], blue_ratio[here] = red0 * math.exp(drifts[0]), blue0 * math.exp(drifts[1])
        if here == _CENTER:
            red0, blue0 = red_ratio[here], blue_ratio[here]
            red_ratio, blue_ratio = [red0] * len(LEVELS), [blue0] * len(LEVELS)
            spread = _spread(r, g, red0, noise), _spread(b, g, blue0, noise)
    return np.array(red_ratio), np.array(blue_ratio), np.minimum(spread, _MAX_SPREAD)


def _within(value: float, most: float) -> float:
    return min(max(value, -most), most)


def _spread(channel: FloatArray, green: FloatArray, ratio: float, noise: float) -> float:
    """Return the relative standard deviation of a ratio of channels (N,) in addition to the noise."""
    beyond = float(np.mean((channel - ratio * green) ** 2)) - noise**2 * (1 + ratio**2)
    return max(_MIN_SPREAD, math.sqrt(max(beyond, 0.0) / float(np.mean(green**2))) / ratio)


def _by_step(samples: UInt8Array, valid: UInt8Array, level0: float) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Sort a frame's valid samples by their brightness step.

    Returns the three channels (3, N), and the first index of each step with the end of the last, (L + 1,).
    """
    blue, green, red = pick_colors(samples, valid)
    level = np.log(np.maximum(brightness_of(blue, green, red), 0.5) / level0)
    # 8 bits, which are sorted by counting
    step = np.rint(level / LEVEL_STEP).astype(np.int8) + np.int8(_CENTER)
    order = np.argsort(step, kind="stable")
    first = np.searchsorted(step[order], np.arange(len(LEVELS) + 1))
    return np.stack([blue[order], green[order], red[order]]), first
