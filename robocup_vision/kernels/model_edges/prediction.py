"""Predicts where the field's edges appear in the picture from a pose: samples with normals and derivatives.

A silhouette's point slides along its cylinder as the camera moves, but to first order only along its ray, which the
picture does not show. So its derivatives are those of a fixed point (after Harris, RAPiD, 1990).
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled, variable
from robocup_vision.kernels.algebra.lens import BENT, MAX_SLOPE2, MOUNT, TALL, WIDE, distorted, is_in_lens, slopes_at
from robocup_vision.kernels.algebra.pinhole import camera_axes
from robocup_vision.kernels.model_edges.tables import (
    EDGE,
    ON_FLOOR,
    RIDGE,
    UPRIGHT,
    FieldEdges,
    FloatArray,
    Samples,
)

NEAR_M = 0.05
MIN_DOWN = 0.02  # least downward component of a ray to the floor: what is nearer to the horizon is not used
RING_POINTS = 5
THIN_PX = 4.0
# least radius of curvature of a sampled curve in the picture: three times what is read on both sides of a thin line;
# where a lens bends the picture, normals turn sooner: over the 5 pixels of a search a curve leaves its tangent by less
# than half a pixel
MIN_RADIUS_PX, MIN_BENT_RADIUS_PX = 12.0, 30.0
# steps along a curve: over a part that is not sampled, and the greatest
ARC_STEP_RAD, MAX_ARC_STEP_RAD = 0.06, 0.25
BEND_STEP = 0.01  # of slopes, by which the bend of a lens is differenced
# numbers of a camera at a pose, see `pose_frame`
FRAME = 19
# least component upwards of the axis that is up in the picture, by which a horizon is sought
_MIN_UP = 1e-3
Triple = tuple[float, float, float]


@compiled(fastmath=True, error_model="numpy")
def pose_frame(p: FloatArray, lens: FloatArray, frame: FloatArray) -> None:
    """Fill in frame (FRAME,).

    It holds the camera's axes by rows, viewpoint, focal lengths, sine and cosine of the heading, and the axis about
    which the mounting rolls.
    """
    rows = camera_axes(p[2], p[3], p[4])
    for i in range(3):
        for j in range(3):
            frame[3 * i + j] = (
                rows[i][0] * lens[MOUNT + j] + rows[i][1] * lens[MOUNT + 3 + j] + rows[i][2] * lens[MOUNT + 6 + j]
            )
        frame[16 + i] = rows[i][0]
    frame[9], frame[10], frame[11] = p[0], p[1], p[5]
    scale = math.exp(p[6])
    frame[12], frame[13] = lens[0] * scale, lens[1] * scale
    frame[14], frame[15] = math.sin(p[2]), math.cos(p[2])


@compiled(fastmath=True, error_model="numpy", inline="always")
def ray(lens: FloatArray, frame: FloatArray, u: float, v: float) -> Triple:
    """Return the direction of a pixel's ray, field frame; its component along the optical axis is 1."""
    right, down = slopes_at(lens, u, v)
    right, down = right * lens[0] / frame[12], down * lens[1] / frame[13]
    return (
        frame[0] - right * frame[1] - down * frame[2],
        frame[3] - right * frame[4] - down * frame[5],
        frame[6] - right * frame[7] - down * frame[8],
    )


@compiled(fastmath=True, error_model="numpy")
def on_floor(lens: FloatArray, frame: FloatArray, u: float, v: float) -> tuple[float, float, bool]:
    """Return the floor point x, y (m) at a pixel, and whether it shows the floor.

    The point is relative to the camera's foot, along the field's axes. `frame` is as `pose_frame` fills it.
    """
    x, y, up = ray(lens, frame, u, v)
    if up > -MIN_DOWN or not is_in_lens(lens, u, v):
        return 0.0, 0.0, False
    scale = -frame[11] / up
    return x * scale, y * scale, True


@compiled(fastmath=True, error_model="numpy")
def horizon_row(lens: FloatArray, tilt: float, roll: float) -> float:
    """Return the row at which the middle column begins to show the floor; below 0 where it shows nothing else."""
    frame = np.empty(FRAME)
    pose_frame(np.array((0.0, 0.0, 0.0, tilt, roll, 1.0, 0.0)), lens, frame)
    return float(lens[3] + lens[1] * frame[6] / max(frame[8], _MIN_UP))


@compiled(fastmath=True, error_model="numpy", inline="always")
def _turned(frame: FloatArray, x: float, y: float, z: float) -> Triple:
    """Rotate a vector from the field frame into the camera's: ahead, left, up."""
    return (
        frame[0] * x + frame[3] * y + frame[6] * z,
        frame[1] * x + frame[4] * y + frame[7] * z,
        frame[2] * x + frame[5] * y + frame[8] * z,
    )


@compiled(fastmath=True, error_model="numpy", inline="always")
def _emit(
    frame: FloatArray,
    lens: FloatArray,
    channels: FloatArray,
    at: Triple,
    along: Triple,
    inside: Triple,
    rows: FloatArray,
    n: int,
    out: Samples,
    count: int,
) -> int:
    """Add a sample of the edge rows[n], a row like those of `FieldEdges.segments`; returns the new count.

    `at` is its place from the camera, `along` the edge's direction, `inside` that of its inside, all in the camera
    frame. A line wide enough to show two edges gets a sample of each.
    """
    room = out.width_px.shape[0] - 1
    depth, left, up = at
    if count >= room or depth < NEAR_M:
        return count
    inv = 1.0 / depth
    a, b = -left * inv, -up * inv
    if a * a + b * b > lens[MAX_SLOPE2]:
        return count
    xd, yd, xa, xb, ya, yb = distorted(lens, a, b)
    fu, fv = frame[12], frame[13]
    u, v = lens[2] + fu * xd, lens[3] + fv * yd
    if not (u >= 2.0 and v >= 2.0 and u <= lens[4] - 3.0 and v <= lens[5] - 3.0):
        return count
    # derivative of the pixel by a shift of the point
    fu, fv = fu * inv, fv * inv
    u0, u1, u2 = -(xa * a + xb * b) * fu, -xa * fu, -xb * fu
    v0, v1, v2 = -(ya * a + yb * b) * fv, -ya * fv, -yb * fv
    du = u0 * along[0] + u1 * along[1] + u2 * along[2]
    dv = v0 * along[0] + v1 * along[1] + v2 * along[2]
    length2 = du * du + dv * dv
    if length2 < 1e-18:
        return count
    scale = 1.0 / math.sqrt(length2)
    nu, nv = -dv * scale, du * scale
    j0, j1, j2 = nu * u0 + nv * v0, nu * u1 + nv * v1, nu * u2 + nv * v2
    into = j0 * inside[0] + j1 * inside[1] + j2 * inside[2]
    if into < 0.0:
        nu, nv, into, j0, j1, j2 = -nu, -nv, -into, -j0, -j1, -j2
    width_m, channel = rows[n, 9], int(rows[n, 10])
    width_px = width_m * into
    is_line = rows[n, 13] > 0.0
    is_wide = is_line and width_px >= THIN_PX
    # along the field's axes
    dx = frame[0] * depth + frame[1] * left + frame[2] * up
    dy = frame[3] * depth + frame[4] * left + frame[5] * up
    dz = frame[6] * depth + frame[7] * left + frame[8] * up
    jx = frame[0] * j0 + frame[1] * j1 + frame[2] * j2
    jy = frame[3] * j0 + frame[4] * j1 + frame[5] * j2
    jz = frame[6] * j0 + frame[7] * j1 + frame[8] * j2
    # about the axis (-sin, cos, 0), by minus the tilt
    s, c = frame[14], frame[15]
    by_heading = jx * dy - jy * dx
    by_tilt = (jx * c + jy * s) * dz - jz * (s * dy + c * dx)
    ahead, aside, above = frame[16], frame[17], frame[18]
    by_roll = jx * (above * dy - aside * dz) + jy * (ahead * dz - above * dx) + jz * (aside * dx - ahead * dy)
    by_focal = nu * (u - lens[2]) + nv * (v - lens[3])
    # a narrow line is a ridge; a wide one has two edges, each with its own inside
    for k in range(2 if is_wide else 1):
        if count >= room:
            return count
        sign, half = 1.0 - 2.0 * k, 0.0
        eu, ev = u, v
        if is_wide:
            # the near edge of a line lies half a width against the direction of its inside
            half = 0.5 * width_m * sign
            away = depth - half * inside[0]
            if away < NEAR_M:
                continue
            across, down = (half * inside[1] - left) / away, (half * inside[2] - up) / away
            across, down, _, _, _, _ = distorted(lens, across, down)
            eu, ev = lens[2] + frame[12] * across, lens[3] + frame[13] * down
            if not (eu >= 2.0 and ev >= 2.0 and eu <= lens[4] - 3.0 and ev <= lens[5] - 3.0):
                continue
        i, m = np.uintp(count), np.uintp(n)
        out.point_m[i, 0] = frame[9] + dx - half * rows[m, 6]
        out.point_m[i, 1] = frame[10] + dy - half * rows[m, 7]
        out.point_m[i, 2] = frame[11] + dz - half * rows[m, 8]
        out.uv[i, 0], out.uv[i, 1] = eu, ev
        out.normal[i, 0], out.normal[i, 1] = sign * nu, sign * nv
        out.jacobian[i, 0], out.jacobian[i, 1], out.jacobian[i, 5] = -sign * jx, -sign * jy, -sign * jz
        out.jacobian[i, 2] = sign * by_heading
        out.jacobian[i, 3] = sign * by_tilt
        out.jacobian[i, 4] = sign * by_roll
        out.jacobian[i, 6] = sign * by_focal
        out.width_px[i] = width_px
        out.expected[i] = channels[channel, 3]
        out.channel[i] = channel
        out.feature[i] = int(rows[m, 11]) + k
        out.kind[i] = RIDGE if is_line and not is_wide else EDGE
        out.place[i] = int(rows[m, 12])
        count += 1
    return count


@compiled(fastmath=True, error_model="numpy")
def _angle_between(a: Triple, b: Triple) -> float:
    """Return the angle between two directions of any length, radians."""
    x, y, z = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    return math.atan2(math.sqrt(x * x + y * y + z * z), a[0] * b[0] + a[1] * b[1] + a[2] * b[2])


@compiled(fastmath=True, error_model="numpy", inline="always")
def _clip(frame: FloatArray, lens: FloatArray, a: Triple, b: Triple) -> Triple:
    """Clip a segment, whose ends are in the camera frame, to the view; returns fractions and the length in pixels."""
    low, high = 0.0, 1.0
    # planes of the view: what lies inside is positive
    wide, tall = lens[WIDE], lens[TALL]
    for f0, f1 in (
        (a[0] - NEAR_M, b[0] - NEAR_M),
        (wide * a[0] + a[1], wide * b[0] + b[1]),
        (wide * a[0] - a[1], wide * b[0] - b[1]),
        (tall * a[0] + a[2], tall * b[0] + b[2]),
        (tall * a[0] - a[2], tall * b[0] - b[2]),
    ):
        if f0 < 0.0 and f1 < 0.0:
            return 0.0, 0.0, 0.0
        if f0 < 0.0:
            low = max(low, f0 / (f0 - f1))
        elif f1 < 0.0:
            high = min(high, f0 / (f0 - f1))
    if high <= low:
        return 0.0, 0.0, 0.0
    if lens[BENT] != 0.0:
        # a lens with distortion shows equal angles with about equal lengths
        near = a[0] + low * (b[0] - a[0]), a[1] + low * (b[1] - a[1]), a[2] + low * (b[2] - a[2])
        far = a[0] + high * (b[0] - a[0]), a[1] + high * (b[1] - a[1]), a[2] + high * (b[2] - a[2])
        return low, high, math.sqrt(frame[12] * frame[13]) * _angle_between(near, far)
    d0, d1 = 1.0 / (a[0] + low * (b[0] - a[0])), 1.0 / (a[0] + high * (b[0] - a[0]))
    du = (a[1] + high * (b[1] - a[1])) * d1 - (a[1] + low * (b[1] - a[1])) * d0
    dv = (a[2] + high * (b[2] - a[2])) * d1 - (a[2] + low * (b[2] - a[2])) * d0
    return low, high, math.sqrt((frame[12] * du) ** 2 + (frame[13] * dv) ** 2)


@compiled(fastmath=True, error_model="numpy")
def _segments(
    frame: FloatArray,
    lens: FloatArray,
    channels: FloatArray,
    rows: FloatArray,
    number: int,
    spacing_px: float,
    out: Samples,
) -> int:
    """Sample the first `number` straight edges (N, 14) evenly in the image; returns the number of samples."""
    count = variable(0)
    x, y, z = frame[9], frame[10], frame[11]
    for n in range(number):
        a = _turned(frame, rows[n, 0] - x, rows[n, 1] - y, rows[n, 2] - z)
        b = _turned(frame, rows[n, 3] - x, rows[n, 4] - y, rows[n, 5] - z)
        low, high, length = _clip(frame, lens, a, b)
        if length < 2.0:
            continue
        inside = _turned(frame, rows[n, 6], rows[n, 7], rows[n, 8])
        along = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        near, far = a[0] + low * along[0], a[0] + high * along[0]
        parts = max(int(length / spacing_px), 1)
        step, angle_rad = 1.0 / parts, 0.0
        if lens[BENT] != 0.0:
            angle_rad = length / math.sqrt(frame[12] * frame[13])
            near = math.sqrt(near**2 + (a[1] + low * along[1]) ** 2 + (a[2] + low * along[2]) ** 2)
            far = math.sqrt(far**2 + (a[1] + high * along[1]) ** 2 + (a[2] + high * along[2]) ** 2)
        for k in range(parts):
            t = (k + 0.5) * step
            # evenly in the image: each fraction is weighted with the other end's depth; with distortion evenly by
            # angle: the sines of the angles are weighted with the other end's distance
            begin, end = 1.0 - t, t
            if lens[BENT] != 0.0:
                begin, end = math.sin(begin * angle_rad), math.sin(end * angle_rad)
            s = low + (high - low) * end * near / (begin * far + end * near)
            at = a[0] + s * along[0], a[1] + s * along[1], a[2] + s * along[2]
            count = _emit(frame, lens, channels, at, along, inside, rows, n, out, count)
    return count


@compiled(fastmath=True, error_model="numpy")
def _silhouettes(field: FieldEdges, frame: FloatArray, rows: FloatArray, count: int) -> int:
    """Append the silhouettes of cylinders, corners and bars from a viewpoint to rows (K, 14).

    Rows are like those of `FieldEdges.segments`. `count` is their number before; the new number is returned.
    """
    corners = field.corners
    for n in range(corners.shape[0]):
        is_farther_out = corners[n, 6] * (frame[10] - corners[n, 1]) > 0.0
        if is_farther_out != (corners[n, 7] > 0.0):
            continue
        row = rows[count]
        for k in range(2):
            row[3 * k], row[3 * k + 1], row[3 * k + 2] = corners[n, 0], corners[n, 1], corners[n, 2 + k]
        row[6], row[7], row[8] = 0.0, -corners[n, 6], 0.0
        row[9], row[10], row[11], row[12], row[13] = corners[n, 8], corners[n, 4], corners[n, 5], UPRIGHT, 0.0
        count += 1
    for n in range(field.cylinders.shape[0] + field.bars.shape[0]):
        is_level = n >= field.cylinders.shape[0]
        solid = field.bars[n - field.cylinders.shape[0]] if is_level else field.cylinders[n]
        radius = solid[4] if is_level else solid[2]
        dx = solid[0] - frame[9]
        da = solid[3] - frame[11] if is_level else solid[1] - frame[10]
        away2 = dx * dx + da * da
        if away2 < 2.25 * radius * radius:
            continue
        if not is_level and dx * frame[0] + da * frame[3] < -radius:
            continue
        away = math.sqrt(away2)
        sine = radius / away
        cosine = math.sqrt(1.0 - sine * sine)
        for k in range(2):
            side = 1.0 - 2.0 * k
            # unit vector from the axis to where the ray touches the surface: nearly across, a little towards the camera
            ox = -dx / away * sine - side * da / away * cosine
            oa = -da / away * sine + side * dx / away * cosine
            row = rows[count]
            row[0] = solid[0] + radius * ox
            row[3] = row[0]
            row[6] = -ox
            if is_level:
                row[1], row[4] = solid[1], solid[2]
                row[2] = solid[3] + radius * oa
                row[5] = row[2]
                row[7], row[8] = 0.0, -oa
            else:
                row[1] = solid[1] + radius * oa
                row[4] = row[1]
                row[2], row[5] = solid[3], solid[4]
                row[7], row[8] = -oa, 0.0
            row[9], row[10], row[11], row[12], row[13] = 2.0 * radius, solid[5], solid[6] + k, UPRIGHT, 0.0
            count += 1
    return count


@compiled(fastmath=True, error_model="numpy")
def _bend(
    lens: FloatArray,
    fu: float,
    fv: float,
    at: tuple[float, float],
    first: tuple[float, float],
    second: tuple[float, float],
) -> tuple[float, float]:
    """Return the length (pixels) that a curve covers for each unit of its parameter, and its radius of curvature.

    `at` are the place's slopes to the left and upwards, `first` and `second` their derivatives by the parameter.
    """
    (a, b), (a1, b1), (a2, b2) = at, first, second
    _, _, xa, xb, ya, yb = distorted(lens, -a, -b)
    u1, v1 = fu * (xa * a1 + xb * b1), fv * (ya * a1 + yb * b1)
    u2, v2 = fu * (xa * a2 + xb * b2), fv * (ya * a2 + yb * b2)
    if lens[BENT] != 0.0:
        # the lens bends what is straight
        step = BEND_STEP / math.sqrt(a1 * a1 + b1 * b1 + 1e-12)
        _, _, pa, pb, qa, qb = distorted(lens, -a - step * a1, -b - step * b1)
        _, _, ra, rb, sa, sb = distorted(lens, -a + step * a1, -b + step * b1)
        half = 0.5 / step
        u2 += fu * half * ((pa - ra) * a1 + (pb - rb) * b1)
        v2 += fv * half * ((qa - sa) * a1 + (qb - sb) * b1)
    speed2 = u1 * u1 + v1 * v1
    speed_px = math.sqrt(speed2)
    return speed_px, speed_px * speed2 / max(abs(u1 * v2 - u2 * v1), 1e-12)


@compiled(fastmath=True, error_model="numpy")
def _arcs(
    field: FieldEdges,
    lens: FloatArray,
    frame: FloatArray,
    spacing_px: float,
    rows: FloatArray,
    n: int,
    out: Samples,
    count: int,
) -> int:
    """Sample curved lines evenly in the image; rows[n] is overwritten. Returns the new count.

    A curve is not sampled where it bends so sharply that its profile differs from that of a straight line.
    """
    row, arcs, fu, fv = rows[n], field.arcs, frame[12], frame[13]
    least_px = MIN_RADIUS_PX if lens[BENT] == 0.0 else MIN_BENT_RADIUS_PX
    row[8], row[12], row[13] = 0.0, ON_FLOOR, 1.0
    for m in range(arcs.shape[0]):
        radius, direction = arcs[m, 2], math.copysign(1.0, arcs[m, 4])
        middle = _turned(frame, arcs[m, 0] - frame[9], arcs[m, 1] - frame[10], -frame[11])
        row[9], row[10], row[11] = arcs[m, 5], arcs[m, 6], arcs[m, 7]
        # no samples at its very ends: a straight line may continue the arc
        angle, end = 0.5 * ARC_STEP_RAD, abs(arcs[m, 4]) - 0.5 * ARC_STEP_RAD
        remaining_px = 0.0
        while angle <= end:
            ox, oy = math.cos(arcs[m, 3] + direction * angle), math.sin(arcs[m, 3] + direction * angle)
            out_d, out_l, out_u = _turned(frame, radius * ox, radius * oy, 0.0)
            depth, left, up = middle[0] + out_d, middle[1] + out_l, middle[2] + out_u
            speed_px, is_straight = 0.0, False
            if depth >= NEAR_M:
                inv = 1.0 / depth
                a, b = left * inv, up * inv
                if a * a + b * b <= lens[MAX_SLOPE2]:
                    # first and second derivatives by the angle, of the place and of the slopes
                    d1, l1, u1 = _turned(frame, -radius * oy, radius * ox, 0.0)
                    a1, b1 = (l1 - a * d1) * inv, (u1 - b * d1) * inv
                    a2 = (-out_l - 2.0 * a1 * d1 + a * out_d) * inv
                    b2 = (-out_u - 2.0 * b1 * d1 + b * out_d) * inv
                    speed_px, radius_px = _bend(lens, fu, fv, (a, b), (a1, b1), (a2, b2))
                    is_straight = radius_px >= least_px
            if not is_straight:
                angle, remaining_px = angle + ARC_STEP_RAD, 0.0
                continue
            if remaining_px <= 0.0:
                at, along, inside = (depth, left, up), (d1, l1, u1), (out_d / radius, out_l / radius, out_u / radius)
                row[6], row[7] = ox, oy
                count = _emit(frame, lens, field.channels, at, along, inside, rows, n, out, count)
                remaining_px = spacing_px
            step = min(remaining_px / speed_px, MAX_ARC_STEP_RAD)
            angle += step
            remaining_px -= step * speed_px * 1.0001
    return count


@compiled(fastmath=True, error_model="numpy")
def _rings(
    field: FieldEdges, lens: FloatArray, frame: FloatArray, rows: FloatArray, n: int, out: Samples, count: int
) -> int:
    """Sample the rings around cylinders; rows[n] is overwritten. Returns the new count."""
    row, rings = rows[n], field.rings
    row[6], row[7], row[8], row[12], row[13] = 0.0, 0.0, 1.0, UPRIGHT, 0.0
    inside = _turned(frame, 0.0, 0.0, 1.0)
    for m in range(rings.shape[0]):
        dx, dy, radius = rings[m, 0] - frame[9], rings[m, 1] - frame[10], rings[m, 2]
        depth, left, _ = _turned(frame, dx, dy, rings[m, 3] - frame[11])
        away2 = dx * dx + dy * dy
        if away2 < 2.25 * radius * radius or abs(left) > lens[WIDE] * (depth + radius) + radius:
            continue
        away = math.sqrt(away2)
        row[9], row[10], row[11] = rings[m, 5], rings[m, 4], rings[m, 6]
        for k in range(RING_POINTS):
            across = 0.8 * (2.0 * (k + 0.5) / RING_POINTS - 1.0)
            ahead = math.sqrt(1.0 - across * across)
            ox = -dx / away * ahead - dy / away * across
            oy = -dy / away * ahead + dx / away * across
            at = _turned(frame, dx + radius * ox, dy + radius * oy, rings[m, 3] - frame[11])
            count = _emit(frame, lens, field.channels, at, _turned(frame, -oy, ox, 0.0), inside, rows, n, out, count)
    return count


@compiled(fastmath=True, error_model="numpy")
def predict(field: FieldEdges, lens: FloatArray, p: FloatArray, spacing_px: float, out: Samples) -> int:
    """Sample all edges of the field that the camera sees from a pose; returns the number of samples.

    Parameters
    ----------
    field : FieldEdges
        The field.
    lens : (L,) float64
        See `camera.lens_table`.
    p : (7,) float64
        The unknowns, see `tables`.
    spacing_px : float
        Distance between samples.
    out : Samples
        Result; samples beyond its size are left out.
    """
    frame = np.empty(FRAME)
    pose_frame(p, lens, frame)
    straight = field.segments.shape[0]
    upright = 2 * (field.cylinders.shape[0] + field.bars.shape[0]) + field.corners.shape[0]
    rows = np.empty((straight + upright + 1, 14))
    for n in range(straight):
        for k in range(14):
            rows[n, k] = field.segments[n, k]
    straight = _silhouettes(field, frame, rows, straight)
    count = _segments(frame, lens, field.channels, rows, straight, spacing_px, out)
    count = _arcs(field, lens, frame, spacing_px, rows, straight, out, count)
    return _rings(field, lens, frame, rows, straight, out, count)
