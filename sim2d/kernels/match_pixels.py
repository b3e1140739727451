"""Compiled renderer of a mirror camera's frame, each pixel the mean of its bearing's spans; and the sensor's noise."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Float32Array, Int8Array, Int32Array, UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.bearing_profile import FLOOR, OF_BALL, PAINT, meet_things, span_of, stack_spans
from sim2d.kernels.floor_lines import GAIN, ONE, SLOPE_HIGH, SLOPE_LOW, X, Y, mark_arcs, mark_lines
from sim2d.kernels.floor_paint import SHADE_REACH, light_beside_ball
from sim2d.kernels.frame_values import Bearings, Lighting, MirrorView, Viewpoint
from sim2d.kernels.nets import lay_nets
from sim2d.kernels.things import BALL, KIND, RADIUS, X0, Y0, meet_ball, row_of, rows_from_eye


@compiled
def fill_carpet(
    floor: Float32Array, light: Lighting, eye: Viewpoint, color: Float32Array, body: UInt8Array, out: UInt8Array
) -> None:
    """Fill a frame with plain carpet, without lines and objects.

    Parameters
    ----------
    floor : (3, N) float32
        x and y of every pixel's floor point in the eye's frame (m), and the pixel's gain.
    color : (3,) float32
        BGR of the carpet.
    body : (3, N) uint8
        Colours of the pixels with gain 0; added.
    out : (3, N) uint8
        Blue, green and red planes of the frame; overwritten.
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
    """Return the light level at the eye, and its change per metre along the eye's own axes."""
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    along_x, along_y = light.per_m_x, light.per_m_y
    here = light.level + along_x * eye.x_m + along_y * eye.y_m
    return np.float32(here), np.float32(along_x * c + along_y * s), np.float32(along_y * c - along_x * s)


@compiled
def paint_marked(view: MirrorView, marks: Bearings, count: int, out: UInt8Array) -> None:
    """Paint the pixels of the `count` marked rays, which meet lines, and clear their fractions."""
    pixels, light, eye, colors = view.pixels, view.light, view.eye, view.paint.colors
    here, along_x, along_y = _light_ahead(light, eye)
    least, most, half = np.float32(light.min_level), np.float32(255.0), np.float32(0.5)
    x_of, y_of, gain_of = pixels.rays[X], pixels.rays[Y], pixels.rays[GAIN]
    fraction, marked, pixel_of = marks.fraction, marks.marked, pixels.pixels
    blue, green, red = colors[0, 0], colors[0, 1], colors[0, 2]
    more_blue, more_green, more_red = colors[1, 0] - blue, colors[1, 1] - green, colors[1, 2] - red
    for m in range(count):
        i = np.uintp(marked[m])
        bright = max(here + along_x * x_of[i] + along_y * y_of[i], least) * gain_of[i]
        pixel, part = pixel_of[i], fraction[i]
        out[pixel, 0] = np.uint8(min(bright * (blue + part * more_blue) + half, most))
        out[pixel, 1] = np.uint8(min(bright * (green + part * more_green) + half, most))
        out[pixel, 2] = np.uint8(min(bright * (red + part * more_red) + half, most))
        fraction[i] = np.float32(0.0)


@compiled(error_model="numpy")
def draw_pixels(view: MirrorView, spans: Bearings, out: UInt8Array) -> None:
    """Draw the objects on the floor, and the room, over the painted carpet: along each bearing outwards."""
    pixels, eye, things, light = view.pixels, view.eye, view.things, view.light
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    most, half = np.float32(255.0), np.float32(0.5)
    ends, kinds, paint, pixel_of, directions = spans.ends, spans.kinds, spans.paint, pixels.pixels, pixels.directions
    low_of, high_of, gain_of = pixels.rays[SLOPE_LOW], pixels.rays[SLOPE_HIGH], pixels.rays[GAIN]
    rows, height = rows_from_eye(things, eye.x_m, eye.y_m), np.float32(eye.height_m)
    lamp = np.array([math.cos(light.lamp_rad), math.sin(light.lamp_rad)], dtype=np.float32)
    along_x, along_y = light.per_m_x, light.per_m_y
    here = light.level + along_x * eye.x_m + along_y * eye.y_m
    for k in range(len(pixels.first) - 1):
        bearing = np.uintp(k)
        i, stop, n = np.uintp(pixels.first[bearing]), np.uintp(pixels.first[k + 1]), np.uintp(0)
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
            # pixels at the boundary to the next span, and all pixels of a ball
            while i < stop and low_of[i] < end:
                low, high = low_of[i], high_of[i]
                of_ball = n if kind >= OF_BALL else n + ONE
                if kind >= OF_BALL or (high > end and kinds[bearing, of_ball] >= OF_BALL):
                    ball = row_of(rows, np.uintp(kinds[bearing, of_ball] - OF_BALL))
                    cos = np.float32(c * directions[bearing, 1] - s * directions[bearing, 2])
                    sin = np.float32(s * directions[bearing, 1] + c * directions[bearing, 2])
                    first, last = ends[bearing, of_ball - ONE], ends[bearing, of_ball]
                    slope = half * np.float32(max(low, first)) + half * np.float32(min(high, last))
                    _, color, shade = meet_ball(ball, cos, sin, slope, height, lamp)
                    bright = max(here + along_x * float(ball[X0]) + along_y * float(ball[Y0]), light.min_level) * shade
                    for channel in range(3):
                        paint[bearing, of_ball, channel] = bright * things.colors[color, channel]
                _mix_spans(low, high, gain_of[i], pixel_of[i], bearing, n, ends, kinds, paint, out)
                i += ONE
            n += ONE


@compiled(error_model="numpy")
def shade_carpet(view: MirrorView, ball: int, out: UInt8Array) -> None:
    """Darken the floor around a ball, given by its index among the things."""
    pixels, eye, row = view.pixels, view.eye, view.things.rows[ball]
    x_m, y_m, radius_m = row[X0], row[Y0], row[RADIUS]
    c, s = math.cos(eye.heading_rad), math.sin(eye.heading_rad)
    half, zero = np.float32(0.5), np.float32(0.0)
    x_of, y_of, low_of = pixels.rays[X], pixels.rays[Y], pixels.rays[SLOPE_LOW]
    dx, dy, turns = x_m - eye.x_m, y_m - eye.y_m, len(pixels.directions)
    x, y, away, reach_m = c * dx + s * dy, c * dy - s * dx, math.hypot(dx, dy), SHADE_REACH * radius_m
    ball_x, ball_y, reach2 = np.float32(x), np.float32(y), np.float32(reach_m * reach_m)
    per_radius2 = np.float32(1 / (radius_m * radius_m))
    within = math.asin(reach_m / away) if away > reach_m else math.pi
    # a pixel's own bearing differs from its table bearing by up to half a step
    within += math.tau / turns
    start, stop = span_of(math.atan2(y, x) - within, 2 * within, turns)
    for turned in range(start, stop):
        k = turned if turned < turns else turned - turns
        i, last = np.uintp(pixels.first[k]), np.uintp(pixels.first[k + 1])
        while i < last and low_of[i] < zero:
            off_x, off_y = x_of[i] - ball_x, y_of[i] - ball_y
            away2 = off_x * off_x + off_y * off_y
            if away2 < reach2:
                left, pixel = light_beside_ball(away2, per_radius2), pixels.pixels[i]
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
    out: UInt8Array,
) -> None:
    """Draw a pixel that covers spans n and n + 1 of a bearing, as their mean weighted by slopes."""
    most, half, one = np.float32(255.0), np.float32(0.5), np.float32(1.0)
    end, beyond = ends[bearing, n], min(n + ONE, np.uintp(ends.shape[1] - 1))
    part = one if high <= end else (end - low) / (high - low)
    kind, kind_beyond = kinds[bearing, n], kinds[bearing, beyond]
    # without branches, since the processor cannot predict them here
    weight = part * (one if kind == FLOOR else gain)
    weight_beyond = (one - part) * (one if kind_beyond == FLOOR else gain)
    for channel in range(3):
        floor = np.float32(out[pixel, channel])
        color, color_beyond = paint[bearing, n, channel], paint[bearing, beyond, channel]
        color = floor if kind == FLOOR else color
        color_beyond = floor if kind_beyond == FLOOR else color_beyond
        light = half + weight * color + weight_beyond * color_beyond
        out[pixel, channel] = np.uint8(min(light, most))


@compiled
def add_noise(frame: UInt8Array, noise: Int8Array) -> None:
    """Add noise (N,) int8 to a frame (N,) uint8 in place, clipped."""
    for i in range(len(frame)):
        # numba would add in 64 bits; in 16 bits a vector instruction adds four times as many
        value = np.int16(np.int16(frame[i]) + np.int16(noise[i]))
        frame[i] = np.uint8(min(max(value, np.int16(0)), np.int16(255)))


@compiled
def draw_over_carpet(view: MirrorView, bearings: Bearings, out: UInt8Array) -> None:
    """Draw lines, objects and the room over plain carpet.

    This is a single call, because unpacking tuples of arrays at a call from Python takes longer than some of the loops.

    Parameters
    ----------
    out : (H * W, 3) uint8
        The frame, as `fill_carpet` fills it.
    """
    meet_things(view, bearings)
    stack_spans(view, bearings)
    count = mark_arcs(view, bearings, mark_lines(view, bearings))
    paint_marked(view, bearings, count, out)
    for k in range(len(view.things.rows)):
        if view.things.rows[k, KIND] == BALL:
            shade_carpet(view, k, out)
    draw_pixels(view, bearings, out)
    lay_nets(view, bearings, out)
