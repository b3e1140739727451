"""Which pixels have the ball's colour under a frame's light, and how much the frame looks like a field at all."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.kernels.balls import blobs as kernel
from robocup_vision.perception.balls.ball import BallSettings
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.floor_color import PaintColor

# a ball whose logarithms of R/G and B/G change by less is not told from one with red and blue swapped
_MIN_SWAP_DISTANCE = 0.5
# a polar sample is the mean of 3 x 3 pixels
_RAW_NOISE = 3.0
# beyond it the logarithm of 1 + exp(x) is x, and the exponential may overflow
_MAX_EXPONENT = 50.0


def ball_colors(
    colors: Colors, settings: BallSettings, white_ratios: tuple[float, ...]
) -> tuple[kernel.BallColor, ...]:
    """Return what is of the ball's colour, from so far on the way from white on; noise may make several the same."""
    found = [_ball_color(colors, settings, ratio) for ratio in white_ratios]
    return tuple(one for n, one in enumerate(found) if n == 0 or one.plane_ratio < found[n - 1].plane_ratio)


def _ball_color(colors: Colors, settings: BallSettings, min_ratio: float) -> kernel.BallColor:
    """Return planes that part the ball's colour from white and from the floor, and how bright and clear it must be."""
    ball, floor, white = (_direction(color) for color in (colors.ball, colors.floor.lit, colors.line))
    raw_noise = _RAW_NOISE * colors.floor.noise
    # a small ball is mixed with floor all over: the plane lies as near to the floor's colour as its noise allows
    floor_counts = 4 * colors.floor.level / float(floor @ [1.0, 2.0, 1.0])
    apart = math.acos(min(1.0, float(ball @ floor)))
    noise_ratio = settings.floor_stds * raw_noise / floor_counts / max(apart, 1e-3)
    ratio = min(0.5, max(1 / 3, noise_ratio))
    from_floor = _plane(ball, floor, ratio)
    white_ratio = min(0.5, max(min_ratio, noise_ratio))
    min_level = settings.min_level * colors.floor.level
    on_dark_ball = min_level * float(np.dot(from_floor, ball) / ball.sum())
    beside_white = np.log(ball / white)
    weak, middle, _ = (int(channel) for channel in np.argsort(beside_white, kind="stable"))
    fall = settings.clipped_ratio * float(beside_white[weak] - beside_white[middle])
    return kernel.BallColor(
        from_white=_plane(ball, white, white_ratio),
        from_floor=from_floor,
        half_white=_plane(ball, white, 0.5),
        plane_ratio=white_ratio,
        apart_rad=max(math.acos(min(1.0, float(ball @ white))), 1e-3),
        min_hue=settings.white_noise_stds * raw_noise,
        weak=weak,
        middle=middle,
        clipped_ratio=float(white[weak] / white[middle]) * math.exp(fall),
        min_level=min_level,
        sure=on_dark_ball,
        min_signal=settings.min_signal * raw_noise,
    )


def with_swapped_ball(colors: Colors) -> Colors | None:
    """Return colours with the ball's as if its red and blue were swapped; None where that is nearly its own colour.

    Light falls on the paint as it is: only what the paint adds to white is swapped.
    """
    white = np.log([colors.line.red_ratio, colors.line.blue_ratio])
    beside = np.log([colors.ball.red_ratio, colors.ball.blue_ratio]) - white
    if np.linalg.norm(beside - beside[::-1]) < _MIN_SWAP_DISTANCE:
        return None
    red, blue = np.exp(white + beside[::-1]).tolist()
    return replace(colors, ball=PaintColor(red, blue))


def floor_evidence(near_floor_nats: float, green_nats: float, settings: BallSettings) -> float:
    """Return how much more likely the frame shows a ball's floor than anything: carpet all around, and it is green.

    The second is what `green_evidence` tells of the frame's colours.
    """
    missing = max(settings.floor_nats - near_floor_nats, 0.0) / settings.floor_std
    return settings.max_floor - 0.5 * missing * missing + green_nats


def green_evidence(colors: Colors, settings: BallSettings) -> float:
    """Return how much more likely a floor of these colours is carpet than anything, as it is green: nats, 0 or less."""
    floor, white = colors.floor.lit, colors.line
    # under a cast of light carpet is greener than white; what passes for white may be some paint: than grey, too
    ratios = (floor.red_ratio, floor.blue_ratio, floor.red_ratio / white.red_ratio, floor.blue_ratio / white.blue_ratio)
    green = -math.log(max(ratios))
    return -settings.green_nats * math.log1p(math.exp(min(-green / settings.green_scale, _MAX_EXPONENT)))


def _direction(color: PaintColor) -> FloatArray:
    """Return the unit vector (3,), B, G, R, of a colour."""
    vector = np.array([color.blue_ratio, 1.0, color.red_ratio])
    return np.asarray(vector / np.linalg.norm(vector))


def _plane(color: FloatArray, other: FloatArray, ratio: float) -> kernel.Bgr:
    """Return the unit normal, B, G, R, of a plane through black, at a ratio of the way from `other` to `color`."""
    within = other + ratio * (color - other)
    normal = color - float(color @ within) / float(within @ within) * within
    length = float(np.linalg.norm(normal))
    blue, green, red = (normal / length if length > 0 else normal).tolist()
    return blue, green, red
