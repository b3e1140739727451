"""Compiled: the pixels of a match camera's frame, each the mean of its bearing's spans; and the sensor's noise."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from sim2d.kernels.bearing_profile import FLOOR, PAINT

Floats = npt.NDArray[np.float32]
Doubles = npt.NDArray[np.float64]
Int32Array = npt.NDArray[np.int32]
Int16Array = npt.NDArray[np.int16]
UInt8Array = npt.NDArray[np.uint8]
UInt32Array = npt.NDArray[np.uint32]
UInt64Array = npt.NDArray[np.uint64]

# unsigned indices need no check for negative ones
ONE = np.uintp(1)
# rows of `rays`
X, Y, SLOPE_LOW, SLOPE_HIGH, GAIN, RADIAL, TANGENTIAL, ALONG, REACH = range(9)


@njit(cache=True, nogil=True, inline="always")
def _overlap(offset: float, half: float, size: float) -> float:
    """Share of an interval of `size` around `offset` that lies within `half` of 0."""
    reach = max(size, 1e-6) / 2
    return max(min(offset + reach, half) - max(offset - reach, -half), 0.0) / (2 * reach)


@njit(cache=True, nogil=True, inline="always")
def painted_share(
    x: float,
    y: float,
    cos: float,
    sin: float,
    radial: float,
    tangential: float,
    half: float,
    near: np.uint64,
    lines: Doubles,
    arcs: Doubles,
) -> float:
    """Painted share of a rectangular patch of floor.

    Parameters
    ----------
    x, y : float
        Its middle, field frame, metres.
    cos, sin : float
        Direction of its radial side, field frame.
    radial, tangential : float
        Its sizes, metres.
    half : float
        Half a line's width, metres.
    near : uint64
        Bit i: line or arc i (or i + 64, ...) may be met; lines are counted first.
    lines : (N, 5) float64
        Start x, y, unit direction x, y, length (m).
    arcs : (M, 6) float64
        Centre x, y, radius (m), direction x, y of its middle, cosine of half its sweep (-2: a full circle).
    """
    share = 0.0
    for i in range(len(lines) + len(arcs)):
        if not (near >> np.uint64(i % 64)) & np.uint64(1):
            continue
        if i < len(lines):
            tx, ty, length = lines[i, 2], lines[i, 3], lines[i, 4]
            along_ray, across_ray = abs(cos * tx + sin * ty), abs(cos * ty - sin * tx)
            dx, dy = x - lines[i, 0], y - lines[i, 1]
            covered = _overlap(dx * ty - dy * tx, half, across_ray * radial + along_ray * tangential)
            if covered > 0:
                offset = dx * tx + dy * ty - length / 2
                covered *= _overlap(offset, length / 2 + half, along_ray * radial + across_ray * tangential)
        else:
            arc = arcs[i - len(lines)]
            dx, dy = x - arc[0], y - arc[1]
            from_center = max(math.sqrt(dx * dx + dy * dy), 1e-6)
            if dx * arc[3] + dy * arc[4] < from_center * arc[5]:
                continue
            across_ray, along_ray = abs(cos * dx + sin * dy) / from_center, abs(cos * dy - sin * dx) / from_center
            covered = _overlap(from_center - arc[2], half, across_ray * radial + along_ray * tangential)
        share = max(share, covered)
    return share


@njit(cache=True, nogil=True)
def fill_carpet(floor: Floats, light: Doubles, eye: Doubles, color: Floats, body: UInt8Array, out: UInt8Array) -> None:
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
def _light_ahead(light: Doubles, eye: Doubles) -> tuple[np.float32, np.float32, np.float32]:
    """Level at the eye, and its change per metre along the eye's own axes."""
    c, s = math.cos(eye[2]), math.sin(eye[2])
    here = light[0] + light[1] * eye[0] + light[2] * eye[1]
    return np.float32(here), np.float32(light[1] * c + light[2] * s), np.float32(light[2] * c - light[1] * s)


@njit(cache=True, nogil=True, error_model="numpy")
def draw_pixels(
    rays: Floats,
    pixels: UInt32Array,
    levels: Int32Array,
    first: Int32Array,
    eye: Doubles,
    height_m: float,
    lamp_rad: float,
    ends: Floats,
    kinds: Int32Array,
    paint: Floats,
    near_ball: Int32Array,
    ball: Doubles,
    plain: Floats,
    light: Doubles,
    clear_m: Floats,
    cells: UInt64Array,
    grids: Doubles,
    half_line_m: float,
    lines: Doubles,
    arcs: Doubles,
    out: UInt8Array,
) -> None:
    """Draw all pixels that are not plain carpet, bearing by bearing and outwards along each.

    Parameters
    ----------
    rays : (9, P) float32
        See the rows' names: floor point in the eye's frame (m), least and greatest slope, gain, size of the patch of
        floor, distance of the floor point and distance up to which the patch reaches (m).
    pixels : (P,) uint32
        Flat indices of the pixels.
    levels : (P,) int32
        Level of the line grids that knows all lines a patch may meet.
    first : (K + 1,) int32
        First pixel of each bearing, and P.
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
    clear_m : (G0,) float32
        For each cell of the finest grid, the distance around any point in it without lines.
    cells : (G,) uint64
        Line grids, one after the other: which lines may be met from each cell.
    grids : (L, 6) float64
        Of each level: x, y of its corner (m), cells per metre, columns, rows, first cell.
    half_line_m, lines, arcs
        As in `painted_share`.
    out : (H * W, 3) uint8
        The frame, filled with carpet.
    """
    c, s = np.float32(math.cos(eye[2])), np.float32(math.sin(eye[2]))
    eye_x, eye_y = np.float32(eye[0]), np.float32(eye[1])
    here, along_x, along_y = _light_ahead(light, eye)
    least = np.float32(light[3])
    low_x, low_y, per_m = np.float32(grids[0, 0]), np.float32(grids[0, 1]), np.float32(grids[0, 2])
    columns, rows = np.int32(grids[0, 3]), np.int32(grids[0, 4])
    most, half, zero, one = np.float32(255.0), np.float32(0.5), np.float32(0.0), np.float32(1.0)
    x_of, y_of, low_of, high_of, gain_of = rays[X], rays[Y], rays[SLOPE_LOW], rays[SLOPE_HIGH], rays[GAIN]
    along_of, reach_of, radial_of, tangential_of = rays[ALONG], rays[REACH], rays[RADIAL], rays[TANGENTIAL]
    at_ball = np.float32(max(light[0] + light[1] * ball[0] + light[2] * ball[1], light[3]))
    # the ball's shade lies between these distances
    away = math.hypot(ball[0] - eye[0], ball[1] - eye[1])
    shade_from, shade_until = np.float32(away - ball[3]), np.float32(away + ball[3])
    for k in range(len(first) - 1):
        bearing = np.uintp(k)
        i, stop, n = np.uintp(first[bearing]), np.uintp(first[k + 1]), np.uintp(0)
        # up to which distance there are no lines, and no shade
        safe, unshaded = zero, np.float32(math.inf)
        if near_ball[bearing]:
            unshaded = shade_from
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
                plain_until = min(safe, unshaded)
                while i < stop and high_of[i] <= end and reach_of[i] <= plain_until:
                    i += ONE
            # this and the next pixel may see floor: paint on it, the ball's shade, the edge to what comes next
            while i < stop and low_of[i] < end:
                low, high = low_of[i], high_of[i]
                part = one if high <= end else (end - low) / (high - low)
                after = n + ONE if high > end else n
                may_be_painted = reach_of[i] > safe
                is_shaded = reach_of[i] > unshaded
                if is_shaded and along_of[i] > shade_until:
                    is_shaded, unshaded = False, np.float32(math.inf)
                if kind == FLOOR and part == one and not is_shaded and not may_be_painted:
                    i += ONE
                    continue
                rx, ry = x_of[i], y_of[i]
                x, y = eye_x + c * rx - s * ry, eye_y + s * rx + c * ry
                share = zero
                if may_be_painted and (kind == FLOOR or kinds[bearing, after] == FLOOR):
                    column, row = np.int32((x - low_x) * per_m), np.int32((y - low_y) * per_m)
                    if 0 <= column < columns and 0 <= row < rows:
                        safe = along_of[i] + clear_m[row * columns + column]
                        if reach_of[i] > safe:
                            level = levels[i]
                            column = np.int32((x - low_x) * np.float32(grids[level, 2]))
                            row = np.int32((y - low_y) * np.float32(grids[level, 2]))
                            near = cells[int(grids[level, 5]) + row * int(grids[level, 3]) + column]
                            if near:
                                per_along = one / along_of[i]
                                cos, sin = (x - eye_x) * per_along, (y - eye_y) * per_along
                                radial, tangential = radial_of[i], tangential_of[i]
                                share = np.float32(
                                    painted_share(x, y, cos, sin, radial, tangential, half_line_m, near, lines, arcs)
                                )
                    if kind == FLOOR and part == one and share == zero and not is_shaded:
                        i += ONE
                        plain_until = min(safe, unshaded)
                        while i < stop and high_of[i] <= end and reach_of[i] <= plain_until:
                            i += ONE
                        continue
                blue, green, red = zero, zero, zero
                for turn in range(2):
                    span = n if turn == 0 else after
                    weight = part if turn == 0 else one - part
                    if weight == zero:
                        break
                    if kinds[bearing, span] == PAINT:
                        b, g, r = paint[bearing, span, 0], paint[bearing, span, 1], paint[bearing, span, 2]
                    elif kinds[bearing, span] == FLOOR:
                        lit = max(here + along_x * rx + along_y * ry, least)
                        if is_shaded:
                            dx, dy = x - ball[0], y - ball[1]
                            away2 = (dx * dx + dy * dy) / (ball[2] * ball[2])
                            if away2 < 9.0:
                                lit *= np.float32(1 - 0.55 * math.exp(-away2))
                        b = (plain[0, 0] + share * (plain[1, 0] - plain[0, 0])) * lit
                        g = (plain[0, 1] + share * (plain[1, 1] - plain[0, 1])) * lit
                        r = (plain[0, 2] + share * (plain[1, 2] - plain[0, 2])) * lit
                    else:
                        cos, sin = (x - eye_x) / along_of[i], (y - eye_y) / along_of[i]
                        lit = (
                            np.float32(ball_shade(cos, sin, (low + high) / 2, eye, height_m, ball, lamp_rad)) * at_ball
                        )
                        b, g, r = plain[2, 0] * lit, plain[2, 1] * lit, plain[2, 2] * lit
                    blue, green, red = blue + weight * b, green + weight * g, red + weight * r
                gain, pixel = gain_of[i], pixels[i]
                out[pixel, 0] = np.uint8(min(blue * gain + half, most))
                out[pixel, 1] = np.uint8(min(green * gain + half, most))
                out[pixel, 2] = np.uint8(min(red * gain + half, most))
                i += ONE
            n += ONE


@njit(cache=True, nogil=True)
def ball_shade(
    cos: float, sin: float, slope: float, eye: Doubles, height_m: float, ball: Doubles, lamp_rad: float
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
