"""Compiled: the pixels of a match camera's frame, each the mean of its bearing's spans; and the sensor's noise."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, Int8Array, Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.bearing_profile import BALL, FLOOR, PAINT
from sim2d.kernels.floor_lines import GAIN, ONE, SLOPE_HIGH, SLOPE_LOW, X, Y
from sim2d.kernels.frame_values import BallSphere, Lighting, PaintMarks, PixelRays, Spans, Viewpoint


@compiled
def fill_carpet(
    floor: Float32Array, light: Lighting, eye: Viewpoint, color: Float32Array, body: UInt8Array, out: UInt8Array
) -> None:
    """Fill a frame with plain carpet, as if nothing stood or were painted on it.

    Parameters
    ----------
    floor : (3, N) float32
        Floor point of every pixel of the image in the eye's frame (m), and its gain.
    color : (3,) float32
        BGR of the carpet.
    body : (3, N) uint8
        Added: what is seen where the gain is 0.
    out : (3, N) uint8
        The frame's planes.
    """
    here, along_x, along_y = _light_ahead(light, eye)
    least = np.float32(light.min_level)
    blue, green, red = color[0], color[1], color[2]
    most, half = np.float32(255.0), np.float32(0.5)
    x, y, gain = floor[0], floor[1], floor[2]
    out_b, out_g, out_r = out[0], out[1], out[2]
    body_b, body_g, body_r = body[0], body[1], body[2]
    for i in range(len(x)):
        bright = max(here + along_x * x[i] + along_y * y[i], least) * gain[i]
        out_b[i] = np.uint8(min(bright * blue + half, most)) + body_b[i]
        out_g[i] = np.uint8(min(bright * green + half, most)) + body_g[i]
        out_r[i] = np.uint8(min(bright * red + half, most)) + body_r[i]


@compiled
def _light_ahead(light: Lighting, eye: Viewpoint) -> tuple[np.float32, np.float32, np.float32]:
    """Return the level at the eye, and its change per metre along the eye's own axes."""
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    along_x, along_y = light.per_m_x, light.per_m_y
    here = light.level + along_x * eye.x_m + along_y * eye.y_m
    return np.float32(here), np.float32(along_x * c + along_y * s), np.float32(along_y * c - along_x * s)


@compiled
def paint_marked(
    pixels: PixelRays,
    light: Lighting,
    eye: Viewpoint,
    plain: Float32Array,
    marks: PaintMarks,
    count: int,
    out: UInt8Array,
) -> None:
    """Paint the rays that lines meet, and clear their fractions.

    Parameters
    ----------
    pixels, light, eye, plain, out
        As in `draw_pixels`.
    marks, count
        As `floor_lines.mark_lines` leaves them; all fractions become 0.
    """
    here, along_x, along_y = _light_ahead(light, eye)
    least, most, half = np.float32(light.min_level), np.float32(255.0), np.float32(0.5)
    x_of, y_of, gain_of = pixels.rays[X], pixels.rays[Y], pixels.rays[GAIN]
    fraction, marked, pixel_of = marks.fraction, marks.marked, pixels.pixels
    blue, green, red = plain[0, 0], plain[0, 1], plain[0, 2]
    more_blue, more_green, more_red = plain[1, 0] - blue, plain[1, 1] - green, plain[1, 2] - red
    for m in range(count):
        i = np.uintp(marked[m])
        bright = max(here + along_x * x_of[i] + along_y * y_of[i], least) * gain_of[i]
        pixel, part = pixel_of[i], fraction[i]
        out[pixel, 0] = np.uint8(min(bright * (blue + part * more_blue) + half, most))
        out[pixel, 1] = np.uint8(min(bright * (green + part * more_green) + half, most))
        out[pixel, 2] = np.uint8(min(bright * (red + part * more_red) + half, most))
        fraction[i] = np.float32(0.0)


@compiled(error_model="numpy")
def draw_pixels(
    pixels: PixelRays,
    eye: Viewpoint,
    spans: Spans,
    ball: BallSphere,
    plain: Float32Array,
    light: Lighting,
    out: UInt8Array,
) -> None:
    """Draw what stands on the floor, and the ball's shade, over the painted carpet: along each bearing outwards.

    Parameters
    ----------
    spans : Spans
        As `bearing_profile.stack_spans` leaves them.
    plain : (3, 3) float32
        BGR of carpet, line, ball.
    out : (H * W, 3) uint8
        The frame, filled with the painted carpet.
    """
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    most, half = np.float32(255.0), np.float32(0.5)
    ends, kinds, paint, pixel_of, directions = spans.ends, spans.kinds, spans.paint, pixels.pixels, pixels.directions
    low_of, high_of, gain_of = pixels.rays[SLOPE_LOW], pixels.rays[SLOPE_HIGH], pixels.rays[GAIN]
    at_ball = max(light.level + light.per_m_x * ball.x_m + light.per_m_y * ball.y_m, light.min_level)
    ball_light = np.float32(at_ball)
    for k in range(len(pixels.first) - 1):
        bearing = np.uintp(k)
        i, stop, n = np.uintp(pixels.first[bearing]), np.uintp(pixels.first[k + 1]), np.uintp(0)
        if spans.near_ball[bearing]:
            _shade_floor(pixels, i, stop, eye, ball, out)
        cos, sin = c * directions[bearing, 1] - s * directions[bearing, 2], c * directions[bearing, 2]
        sin += s * directions[bearing, 1]
        while i < stop:
            end, kind = ends[bearing, n], kinds[bearing, n]
            if kind == PAINT:
                b, g, r = paint[bearing, n, 0], paint[bearing, n, 1], paint[bearing, n, 2]
                while i < stop and high_of[i] <= end:
                    gain, pixel = gain_of[i], pixel_of[i]
                    out[pixel, 0] = np.uint8(min(b * gain + half, most))
                    out[pixel, 1] = np.uint8(min(g * gain + half, most))
                    out[pixel, 2] = np.uint8(min(r * gain + half, most))
                    i += ONE
            elif kind == FLOOR:
                while i < stop and high_of[i] <= end:
                    i += ONE
            # pixels at the edge to what comes next, and all of the ball
            while i < stop and low_of[i] < end:
                shade, low, high = np.float32(0.0), low_of[i], high_of[i]
                if kind == BALL or (high > end and kinds[bearing, n + ONE] == BALL):
                    slope = (low + high) / 2
                    shade = np.float32(ball_shade(cos, sin, slope, eye, ball, light.lamp_rad)) * ball_light
                _mix_spans(low, high, gain_of[i], pixel_of[i], bearing, n, ends, kinds, paint, plain, shade, out)
                i += ONE
            n += ONE


@compiled(error_model="numpy")
def _shade_floor(
    pixels: PixelRays, i: np.uintp, stop: np.uintp, eye: Viewpoint, ball: BallSphere, out: UInt8Array
) -> None:
    """Darken the floor around the ball along one bearing, rays i to stop."""
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    half, zero, one = np.float32(0.5), np.float32(0.0), np.float32(1.0)
    x_of, y_of, low_of = pixels.rays[X], pixels.rays[Y], pixels.rays[SLOPE_LOW]
    dx, dy = ball.x_m - eye.x_m, ball.y_m - eye.y_m
    ball_x, ball_y = np.float32(c * dx + s * dy), np.float32(c * dy - s * dx)
    shade2 = np.float32(ball.shade_reach_m * ball.shade_reach_m)
    per_radius2 = np.float32(1 / max(ball.radius_m * ball.radius_m, 1e-12))
    while i < stop and low_of[i] < zero:
        away_x, away_y = x_of[i] - ball_x, y_of[i] - ball_y
        away2 = away_x * away_x + away_y * away_y
        if away2 < shade2:
            left, pixel = one - np.float32(0.55 * math.exp(-away2 * per_radius2)), pixels.pixels[i]
            for channel in range(3):
                out[pixel, channel] = np.uint8(np.float32(out[pixel, channel]) * left + half)
        i += ONE


@compiled(error_model="numpy", inline="always")
def _mix_spans(
    low: np.float32,
    high: np.float32,
    gain: np.float32,
    pixel: np.uint32,
    bearing: np.uintp,
    n: np.uintp,
    ends: Float32Array,
    kinds: Int32Array,
    paint: Float32Array,
    plain: Float32Array,
    shade: np.float32,
    out: UInt8Array,
) -> None:
    """Draw a ray's pixel, which covers spans n and n + 1 of a bearing, by the slopes in each."""
    most, half, one = np.float32(255.0), np.float32(0.5), np.float32(1.0)
    end, beyond = ends[bearing, n], min(n + ONE, np.uintp(ends.shape[1] - 1))
    part = one if high <= end else (end - low) / (high - low)
    kind, kind_beyond = kinds[bearing, n], kinds[bearing, beyond]
    # without branches, which no processor foresees here
    weight = part * (one if kind == FLOOR else gain)
    weight_beyond = (one - part) * (one if kind_beyond == FLOOR else gain)
    for channel in range(3):
        floor = np.float32(out[pixel, channel])
        color, color_beyond = paint[bearing, n, channel], paint[bearing, beyond, channel]
        color = floor if kind == FLOOR else color
        color_beyond = floor if kind_beyond == FLOOR else color_beyond
        if shade > np.float32(0.0):
            color = shade * plain[2, channel] if kind == BALL else color
            color_beyond = shade * plain[2, channel] if kind_beyond == BALL else color_beyond
        light = half + weight * color + weight_beyond * color_beyond
        out[pixel, channel] = np.uint8(min(light, most))


@compiled
def ball_shade(cos: float, sin: float, slope: float, eye: Viewpoint, ball: BallSphere, lamp_rad: float) -> float:
    """Return the shade of the ball where a ray (direction in the field frame, slope) meets it."""
    # lit from above and by the lamp
    dx, dy, dz = ball.x_m - eye.x_m, ball.y_m - eye.y_m, ball.radius_m - eye.height_m
    toward = cos * dx + sin * dy + slope * dz
    norm2 = 1 + slope * slope
    root2 = toward * toward - norm2 * (dx * dx + dy * dy + dz * dz - ball.radius_m * ball.radius_m)
    distance = (toward - math.sqrt(max(root2, 0.0))) / norm2
    facing = (distance * cos - dx) * 0.5 * math.cos(lamp_rad) + (distance * sin - dy) * 0.5 * math.sin(lamp_rad)
    facing += (distance * slope - dz) * math.sqrt(0.75)
    return float(0.62 + 0.42 * facing / ball.radius_m)


@compiled
def add_noise(frame: UInt8Array, noise: Int8Array) -> None:
    """Add noise (N,) int8 to a frame (N,) uint8 in place, clipped."""
    for i in range(len(frame)):
        # numba adds in 64 bits, of which a vector holds a quarter as many
        value = np.int16(np.int16(frame[i]) + np.int16(noise[i]))
        frame[i] = np.uint8(min(max(value, np.int16(0)), np.int16(255)))
