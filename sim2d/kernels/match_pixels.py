"""Compiled: the pixels of a match camera's frame, each the mean of its bearing's spans; and the sensor's noise."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robocup_vision.arrays import Float32Array, FloatArray, Int16Array, Int32Array, UInt8Array, UInt32Array
from sim2d.kernels.bearing_profile import FLOOR, PAINT
from sim2d.kernels.floor_lines import GAIN, ONE, SLOPE_HIGH, SLOPE_LOW, X, Y


@njit(cache=True, nogil=True)
def fill_carpet(
    floor: Float32Array, light: FloatArray, eye: FloatArray, color: Float32Array, body: UInt8Array, out: UInt8Array
) -> None:
    """Fill a frame with plain carpet, as if nothing stood or were painted on it.

    Parameters
    ----------
    floor : (3, N) float32
        Floor point of every pixel of the image in the eye's frame (m), and its gain.
    light, eye
        As in `draw_pixels`.
    color : (3,) float32
        BGR of the carpet.
    body : (3, N) uint8
        Added: what is seen where the gain is 0.
    out : (3, N) uint8
        The frame's planes.
    """
    here, along_x, along_y = _light_ahead(light, eye)
    least = np.float32(light[3])
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


@njit(cache=True, nogil=True)
def _light_ahead(light: FloatArray, eye: FloatArray) -> tuple[np.float32, np.float32, np.float32]:
    """Level at the eye, and its change per metre along the eye's own axes."""
    c, s = math.cos(eye[2]), math.sin(eye[2])
    here = light[0] + light[1] * eye[0] + light[2] * eye[1]
    return np.float32(here), np.float32(light[1] * c + light[2] * s), np.float32(light[2] * c - light[1] * s)


@njit(cache=True, nogil=True)
def paint_marked(
    rays: Float32Array,
    pixels: UInt32Array,
    light: FloatArray,
    eye: FloatArray,
    plain: Float32Array,
    share: Float32Array,
    marked: Int32Array,
    count: int,
    out: UInt8Array,
) -> None:
    """Paint the rays that lines meet, and forget their shares.

    Parameters
    ----------
    rays, pixels, light, eye, plain, out
        As in `draw_pixels`.
    share, marked, count
        As `floor_lines.mark_lines` leaves them; all shares become 0.
    """
    here, along_x, along_y = _light_ahead(light, eye)
    least, most, half = np.float32(light[3]), np.float32(255.0), np.float32(0.5)
    x_of, y_of, gain_of = rays[X], rays[Y], rays[GAIN]
    blue, green, red = plain[0, 0], plain[0, 1], plain[0, 2]
    more_blue, more_green, more_red = plain[1, 0] - blue, plain[1, 1] - green, plain[1, 2] - red
    for m in range(count):
        i = np.uintp(marked[m])
        bright = max(here + along_x * x_of[i] + along_y * y_of[i], least) * gain_of[i]
        pixel, part = pixels[i], share[i]
        out[pixel, 0] = np.uint8(min(bright * (blue + part * more_blue) + half, most))
        out[pixel, 1] = np.uint8(min(bright * (green + part * more_green) + half, most))
        out[pixel, 2] = np.uint8(min(bright * (red + part * more_red) + half, most))
        share[i] = np.float32(0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_pixels(
    rays: Float32Array,
    pixels: UInt32Array,
    first: Int32Array,
    directions: FloatArray,
    eye: FloatArray,
    height_m: float,
    lamp_rad: float,
    ends: Float32Array,
    kinds: Int32Array,
    paint: Float32Array,
    near_ball: Int32Array,
    ball: FloatArray,
    plain: Float32Array,
    light: FloatArray,
    out: UInt8Array,
) -> None:
    """Draw what stands on the floor, and the ball's shade, over the painted carpet: along each bearing outwards.

    Parameters
    ----------
    rays : (9, P) float32
        See the rows' names in `floor_lines`: floor point in the eye's frame (m), least and greatest slope, gain,
        radial and tangential size of the patch of floor, distances where it begins and ends (m).
    pixels : (P,) uint32
        Flat indices of the pixels.
    first : (K + 1,) int32
        First pixel of each bearing, and P.
    directions : (K, 3) float64
        Bearing (rad), its cosine and sine, in the eye's frame.
    eye : (3,) float64
        x, y (m) and heading (rad) of the viewpoint.
    height_m, lamp_rad : float
        Of the viewpoint; direction of the light, field frame.
    ends, kinds, paint, near_ball
        The bearings' spans, as `bearing_profile.stack_spans` leaves them.
    ball : (4,) float64
        As in `stack_spans`.
    plain : (3, 3) float32
        BGR of carpet, line, ball.
    light : (4,) float64
        As in `stack_spans`.
    out : (H * W, 3) uint8
        The frame, filled with the painted carpet.
    """
    c, s = math.cos(eye[2]), math.sin(eye[2])
    most, half, zero, one = np.float32(255.0), np.float32(0.5), np.float32(0.0), np.float32(1.0)
    x_of, y_of, low_of, high_of, gain_of = rays[X], rays[Y], rays[SLOPE_LOW], rays[SLOPE_HIGH], rays[GAIN]
    at_ball = np.float32(max(light[0] + light[1] * ball[0] + light[2] * ball[1], light[3]))
    dx, dy = ball[0] - eye[0], ball[1] - eye[1]
    ball_x, ball_y = np.float32(c * dx + s * dy), np.float32(c * dy - s * dx)
    shade2, per_radius2 = np.float32(ball[3] * ball[3]), np.float32(1 / max(ball[2] * ball[2], 1e-12))
    for k in range(len(first) - 1):
        bearing = np.uintp(k)
        i, stop, n = np.uintp(first[bearing]), np.uintp(first[k + 1]), np.uintp(0)
        if near_ball[bearing]:
            while i < stop and low_of[i] < zero:
                away_x, away_y = x_of[i] - ball_x, y_of[i] - ball_y
                away2 = away_x * away_x + away_y * away_y
                if away2 < shade2:
                    left, pixel = one - np.float32(0.55 * math.exp(-away2 * per_radius2)), pixels[i]
                    for channel in range(3):
                        out[pixel, channel] = np.uint8(np.float32(out[pixel, channel]) * left + half)
                i += ONE
            i = np.uintp(first[bearing])
        cos, sin = c * directions[bearing, 1] - s * directions[bearing, 2], c * directions[bearing, 2]
        sin += s * directions[bearing, 1]
        while i < stop:
            end, kind = ends[bearing, n], kinds[bearing, n]
            if kind == PAINT:
                b, g, r = paint[bearing, n, 0], paint[bearing, n, 1], paint[bearing, n, 2]
                while i < stop and high_of[i] <= end:
                    gain, pixel = gain_of[i], pixels[i]
                    out[pixel, 0] = np.uint8(min(b * gain + half, most))
                    out[pixel, 1] = np.uint8(min(g * gain + half, most))
                    out[pixel, 2] = np.uint8(min(r * gain + half, most))
                    i += ONE
            elif kind == FLOOR:
                while i < stop and high_of[i] <= end:
                    i += ONE
            # pixels at the edge to what comes next, and all of the ball
            while i < stop and low_of[i] < end:
                low, high = low_of[i], high_of[i]
                part = one if high <= end else (end - low) / (high - low)
                gain, pixel = gain_of[i], pixels[i]
                blue, green, red = half, half, half
                for turn in range(2):
                    span = n if turn == 0 else n + ONE
                    weight = part if turn == 0 else one - part
                    if weight == zero:
                        break
                    if kinds[bearing, span] == FLOOR:
                        blue += weight * np.float32(out[pixel, 0])
                        green += weight * np.float32(out[pixel, 1])
                        red += weight * np.float32(out[pixel, 2])
                        continue
                    weight *= gain
                    if kinds[bearing, span] == PAINT:
                        blue += weight * paint[bearing, span, 0]
                        green += weight * paint[bearing, span, 1]
                        red += weight * paint[bearing, span, 2]
                    else:
                        shade = ball_shade(cos, sin, (low + high) / 2, eye, height_m, ball, lamp_rad)
                        weight *= np.float32(shade) * at_ball
                        blue += weight * plain[2, 0]
                        green += weight * plain[2, 1]
                        red += weight * plain[2, 2]
                out[pixel, 0] = np.uint8(min(blue, most))
                out[pixel, 1] = np.uint8(min(green, most))
                out[pixel, 2] = np.uint8(min(red, most))
                i += ONE
            n += ONE


@njit(cache=True, nogil=True)
def ball_shade(
    cos: float, sin: float, slope: float, eye: FloatArray, height_m: float, ball: FloatArray, lamp_rad: float
) -> float:
    """Shade of a ball where a ray (direction in the field frame, slope) meets it: light from above and the lamp."""
    dx, dy, dz = ball[0] - eye[0], ball[1] - eye[1], ball[2] - height_m
    toward = cos * dx + sin * dy + slope * dz
    norm2 = 1 + slope * slope
    root2 = toward * toward - norm2 * (dx * dx + dy * dy + dz * dz - ball[2] * ball[2])
    distance = (toward - math.sqrt(max(root2, 0.0))) / norm2
    facing = (distance * cos - dx) * 0.5 * math.cos(lamp_rad) + (distance * sin - dy) * 0.5 * math.sin(lamp_rad)
    facing += (distance * slope - dz) * math.sqrt(0.75)
    return float(0.62 + 0.42 * facing / ball[2])


@njit(cache=True, nogil=True)
def add_noise(frame: UInt8Array, noise: Int16Array) -> None:
    """Add noise (N,) int16 to a frame (N,) uint8 in place, clipped."""
    for i in range(len(frame)):
        value = np.int16(frame[i]) + noise[i]
        frame[i] = np.uint8(min(max(value, np.int16(0)), np.int16(255)))
