"""Where a pose lets the field's edges show in the picture: samples with normals and derivatives.

A silhouette's point slides along its cylinder as the camera moves, but only along the ray, which the picture does not
show: its derivatives are those of a fixed point (after Harris' RAPiD, 1990, which tracked corners of known shapes).
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled, variable
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
RING_POINTS = 5
THIN_PX = 4.0
MIN_RADIUS_PX = 12.0  # of a curve: three times what is read on both sides of a thin line


@compiled(fastmath=True, error_model="numpy")
def pose_frame(p: FloatArray, lens: FloatArray, frame: FloatArray) -> None:
    """Prepare projection: frame (16,) takes rotation by rows, viewpoint, focal lengths, heading's sine, cosine."""
    rows = camera_axes(p[2], p[3], p[4])
    for i in range(3):
        for j in range(3):
            frame[3 * i + j] = rows[i][j]
    frame[9], frame[10], frame[11] = p[0], p[1], p[5]
    scale = math.exp(p[6])
    frame[12], frame[13] = lens[0] * scale, lens[1] * scale
    frame[14], frame[15] = math.sin(p[2]), math.cos(p[2])


@compiled(fastmath=True, error_model="numpy")
def distorted(lens: FloatArray, a: float, b: float) -> tuple[float, float, float, float, float, float]:
    """Distort slopes; also the derivative, row by row. Not for slopes beyond the lens' fold."""
    if lens[6] == 0.0:
        return a, b, 1.0, 0.0, 0.0, 1.0
    k1, k2, p1, p2 = lens[7], lens[8], lens[9], lens[10]
    k3, k4, k5, k6 = lens[11], lens[12], lens[13], lens[14]
    r2 = a * a + b * b
    bottom = 1.0 + r2 * (k4 + r2 * (k5 + r2 * k6))
    f = (1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))) / bottom
    df = (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3) - f * (k4 + r2 * (2.0 * k5 + r2 * 3.0 * k6))) / bottom
    x = a * f + 2.0 * p1 * a * b + p2 * (r2 + 2.0 * a * a)
    y = b * f + p1 * (r2 + 2.0 * b * b) + 2.0 * p2 * a * b
    xa = f + 2.0 * a * a * df + 2.0 * p1 * b + 6.0 * p2 * a
    xb = 2.0 * a * b * df + 2.0 * p1 * a + 2.0 * p2 * b
    yb = f + 2.0 * b * b * df + 6.0 * p1 * b + 2.0 * p2 * a
    return x, y, xa, xb, xb, yb


@compiled(fastmath=True, error_model="numpy", inline="always")
def _emit(
    frame: FloatArray,
    lens: FloatArray,
    channels: FloatArray,
    place: FloatArray,
    row: FloatArray,
    out: Samples,
    count: int,
) -> int:
    """Add a sample; returns the new count.

    place (6,) is the point and its edge's direction; row (14,) as one of `FieldEdges.segments`, its ends left out.
    """
    x, y, z, tx, ty, tz = place[0], place[1], place[2], place[3], place[4], place[5]
    ix, iy, iz, width_m = row[6], row[7], row[8], row[9]
    channel = int(row[10])
    if count >= out.width_px.shape[0] - 1:
        return count
    dx, dy, dz = x - frame[9], y - frame[10], z - frame[11]
    depth = frame[0] * dx + frame[3] * dy + frame[6] * dz
    if depth < NEAR_M:
        return count
    left = frame[1] * dx + frame[4] * dy + frame[7] * dz
    up = frame[2] * dx + frame[5] * dy + frame[8] * dz
    inv = 1.0 / depth
    a, b = -left * inv, -up * inv
    if a * a + b * b > lens[15]:
        return count
    xd, yd, xa, xb, ya, yb = distorted(lens, a, b)
    fu, fv = frame[12], frame[13]
    u, v = lens[2] + fu * xd, lens[3] + fv * yd
    if not (u >= 2.0 and v >= 2.0 and u <= lens[4] - 3.0 and v <= lens[5] - 3.0):
        return count
    # derivative of the slopes by a shift of the point along the camera's axes, then along the field's
    uc0, uc1, uc2 = -(xa * a + xb * b) * inv * fu, -xa * inv * fu, -xb * inv * fu
    vc0, vc1, vc2 = -(ya * a + yb * b) * inv * fv, -ya * inv * fv, -yb * inv * fv
    ux = uc0 * frame[0] + uc1 * frame[1] + uc2 * frame[2]
    uy = uc0 * frame[3] + uc1 * frame[4] + uc2 * frame[5]
    uz = uc0 * frame[6] + uc1 * frame[7] + uc2 * frame[8]
    vx = vc0 * frame[0] + vc1 * frame[1] + vc2 * frame[2]
    vy = vc0 * frame[3] + vc1 * frame[4] + vc2 * frame[5]
    vz = vc0 * frame[6] + vc1 * frame[7] + vc2 * frame[8]
    du, dv = ux * tx + uy * ty + uz * tz, vx * tx + vy * ty + vz * tz
    length = math.sqrt(du * du + dv * dv)
    if length < 1e-9:
        return count
    nu, nv = -dv / length, du / length
    inside = nu * (ux * ix + uy * iy + uz * iz) + nv * (vx * ix + vy * iy + vz * iz)
    if inside < 0.0:
        nu, nv, inside = -nu, -nv, -inside
    width_px = width_m * inside
    edges = 1
    kind = EDGE
    if row[13] > 0.0:
        if width_px < THIN_PX:
            kind = RIDGE
        else:
            edges = 2
    jx, jy, jz = nu * ux + nv * vx, nu * uy + nv * vy, nu * uz + nv * vz
    by_heading = jx * dy - jy * dx
    # about the axis (-sin, cos, 0), by minus the tilt
    s, c = frame[14], frame[15]
    by_tilt = jx * (c * dz) + jy * (s * dz) + jz * (-s * dy - c * dx)
    by_roll = (nu * uc1 + nv * vc1) * up - (nu * uc2 + nv * vc2) * left
    # a line that is a ridge when narrow has two edges when wide, each with its own inside
    for k in range(edges):
        side = 0.0 if edges == 1 else 1.0 - 2.0 * k
        if count >= out.width_px.shape[0] - 1:
            return count
        # the near edge of a line lies half a width against the direction of its inside
        half = 0.5 * width_m * side
        eu, ev = u, v
        if side != 0.0:
            ex, ey, ez = dx - ix * half, dy - iy * half, dz - iz * half
            ahead = frame[0] * ex + frame[3] * ey + frame[6] * ez
            if ahead < NEAR_M:
                continue
            across = -(frame[1] * ex + frame[4] * ey + frame[7] * ez) / ahead
            down = -(frame[2] * ex + frame[5] * ey + frame[8] * ez) / ahead
            across, down, _, _, _, _ = distorted(lens, across, down)
            eu, ev = lens[2] + fu * across, lens[3] + fv * down
        if not (eu >= 2.0 and ev >= 2.0 and eu <= lens[4] - 3.0 and ev <= lens[5] - 3.0):
            continue
        turn = -1.0 if side < 0 else 1.0
        out.point_m[count, 0], out.point_m[count, 1], out.point_m[count, 2] = (
            x - ix * half,
            y - iy * half,
            z - iz * half,
        )
        out.uv[count, 0], out.uv[count, 1] = eu, ev
        out.normal[count, 0], out.normal[count, 1] = turn * nu, turn * nv
        out.jacobian[count, 0], out.jacobian[count, 1], out.jacobian[count, 5] = -turn * jx, -turn * jy, -turn * jz
        out.jacobian[count, 2] = turn * by_heading
        out.jacobian[count, 3] = turn * by_tilt
        out.jacobian[count, 4] = turn * by_roll
        out.jacobian[count, 6] = turn * (nu * (u - lens[2]) + nv * (v - lens[3]))
        out.width_px[count] = width_px
        out.expected[count] = channels[channel, 3]
        out.channel[count] = channel
        out.feature[count] = int(row[11]) + k
        out.kind[count] = kind
        out.place[count] = int(row[12])
        count += 1
    return count


@compiled(fastmath=True, error_model="numpy", inline="always")
def _seen_from(frame: FloatArray, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a point of the field along the camera's axes: ahead, left, up."""
    dx, dy, dz = x - frame[9], y - frame[10], z - frame[11]
    return (
        frame[0] * dx + frame[3] * dy + frame[6] * dz,
        frame[1] * dx + frame[4] * dy + frame[7] * dz,
        frame[2] * dx + frame[5] * dy + frame[8] * dz,
    )


@compiled(fastmath=True, error_model="numpy")
def _clip(frame: FloatArray, lens: FloatArray, ends: FloatArray, part: FloatArray) -> float:
    """Clip a segment (6,) to what the camera sees; part takes the ends' fractions, depths; returns the length in px."""
    a0, a1, a2 = _seen_from(frame, ends[0], ends[1], ends[2])
    b0, b1, b2 = _seen_from(frame, ends[3], ends[4], ends[5])
    low, high = 0.0, 1.0
    # planes of the view: what lies inside is positive
    wide, tall = lens[16], lens[17]
    for f0, f1 in (
        (a0 - NEAR_M, b0 - NEAR_M),
        (wide * a0 + a1, wide * b0 + b1),
        (wide * a0 - a1, wide * b0 - b1),
        (tall * a0 + a2, tall * b0 + b2),
        (tall * a0 - a2, tall * b0 - b2),
    ):
        if f0 < 0.0 and f1 < 0.0:
            return 0.0
        if f0 < 0.0:
            low = max(low, f0 / (f0 - f1))
        elif f1 < 0.0:
            high = min(high, f0 / (f0 - f1))
    if high <= low:
        return 0.0
    d0, d1 = a0 + low * (b0 - a0), a0 + high * (b0 - a0)
    du = (a1 + high * (b1 - a1)) / d1 - (a1 + low * (b1 - a1)) / d0
    dv = (a2 + high * (b2 - a2)) / d1 - (a2 + low * (b2 - a2)) / d0
    part[0], part[1], part[2], part[3] = low, high, d0, d1
    return math.sqrt((frame[12] * du) ** 2 + (frame[13] * dv) ** 2)


@compiled(fastmath=True, error_model="numpy")
def _segment(
    frame: FloatArray,
    lens: FloatArray,
    channels: FloatArray,
    row: FloatArray,
    spacing_px: float,
    room: FloatArray,
    out: Samples,
    count: int,
) -> int:
    """Sample a straight edge (14,) evenly in the image; room is (10,)."""
    part, place = room[:4], room[4:]
    length = _clip(frame, lens, row, part)
    if length < 2.0:
        return count
    number = max(int(length / spacing_px), 1)
    tx, ty, tz = row[3] - row[0], row[4] - row[1], row[5] - row[2]
    for k in range(number):
        t = (k + 0.5) / number
        # evenly in the image: fractions are weighted with the other end's depth
        s = t * part[2] / ((1.0 - t) * part[3] + t * part[2])
        s = part[0] + s * (part[1] - part[0])
        place[0], place[1], place[2] = row[0] + s * tx, row[1] + s * ty, row[2] + s * tz
        place[3], place[4], place[5] = tx, ty, tz
        count = _emit(frame, lens, channels, place, row, out, count)
    return count


@compiled(fastmath=True, error_model="numpy")
def _silhouettes(field: FieldEdges, frame: FloatArray, rows: FloatArray) -> int:
    """Edges that cylinders and bars show a viewpoint, as rows (K, 14) like `FieldEdges.segments`; returns how many."""
    count = 0
    for n in range(field.cylinders.shape[0] + field.bars.shape[0]):
        level = n >= field.cylinders.shape[0]
        known = field.bars[n - field.cylinders.shape[0]] if level else field.cylinders[n]
        radius = known[4] if level else known[2]
        dx = known[0] - frame[9]
        da = known[3] - frame[11] if level else known[1] - frame[10]
        away2 = dx * dx + da * da
        if away2 < 2.25 * radius * radius:
            continue
        if not level and dx * frame[15] + da * frame[14] < -radius:
            continue
        away = math.sqrt(away2)
        half = radius / away
        rest = math.sqrt(1.0 - half * half)
        for k in range(2):
            side = 1.0 - 2.0 * k
            # from the axis to where the ray touches: nearly across, a little towards the camera
            ox = -dx / away * half - side * da / away * rest
            oa = -da / away * half + side * dx / away * rest
            row = rows[count]
            row[0] = known[0] + radius * ox
            row[3] = row[0]
            row[6] = -ox
            if level:
                row[1], row[4] = known[1], known[2]
                row[2] = known[3] + radius * oa
                row[5] = row[2]
                row[7], row[8] = 0.0, -oa
            else:
                row[1] = known[1] + radius * oa
                row[4] = row[1]
                row[2], row[5] = known[3], known[4]
                row[7], row[8] = -oa, 0.0
            row[9], row[10], row[11], row[12], row[13] = 2.0 * radius, known[5], known[6] + k, UPRIGHT, 0.0
            count += 1
    return count


@compiled(fastmath=True, error_model="numpy")
def _projected(frame: FloatArray, point: FloatArray) -> tuple[float, float, float]:
    """Project a point on the floor without distortion: pixels from the centre, the other way round, and its depth."""
    dx, dy, dz = point[0] - frame[9], point[1] - frame[10], -frame[11]
    depth = frame[0] * dx + frame[3] * dy + frame[6] * dz
    inv = 1.0 / max(depth, NEAR_M)
    u = frame[12] * (frame[1] * dx + frame[4] * dy + frame[7] * dz) * inv
    v = frame[13] * (frame[2] * dx + frame[5] * dy + frame[8] * dz) * inv
    return u, v, depth


@compiled(fastmath=True, error_model="numpy")
def _is_sharp(u0: float, v0: float, u1: float, v1: float, after: tuple[float, float, float]) -> bool:
    """Whether a curve bends too sharply at its middle point of three for a search along the normal.

    The profile across a line is that of a straight one only where the curve's radius is great against what is read.
    """
    u2, v2, depth = after
    if depth < NEAR_M:
        return True
    au, av, bu, bv = u1 - u0, v1 - v0, u2 - u1, v2 - v1
    turn = abs(math.atan2(au * bv - av * bu, au * bu + av * bv))
    return 0.5 * (math.sqrt(au * au + av * av) + math.sqrt(bu * bu + bv * bv)) < MIN_RADIUS_PX * turn


@compiled(fastmath=True, error_model="numpy")
def _curves(
    field: FieldEdges,
    lens: FloatArray,
    frame: FloatArray,
    spacing_px: float,
    row: FloatArray,
    place: FloatArray,
    out: Samples,
    count: int,
) -> int:
    """Sample curved lines and the rings around cylinders."""
    done, before_u, before_v, has = 0.0, 0.0, 0.0, False
    for n in range(field.arcs.shape[0]):
        arc = field.arcs[n]
        u, v, depth = _projected(frame, arc)
        if depth < NEAR_M:
            has = False
            continue
        # at the ends of a curve its curvature is not known
        if not has or arc[7] != 0.0:
            done = spacing_px
        elif n + 1 < field.arcs.shape[0] and field.arcs[n + 1, 7] == 0.0:
            done += math.sqrt((u - before_u) ** 2 + (v - before_v) ** 2)
            if done >= spacing_px and not _is_sharp(before_u, before_v, u, v, _projected(frame, field.arcs[n + 1])):
                done = 0.0
                place[0], place[1], place[2], place[3], place[4], place[5] = arc[0], arc[1], 0.0, -arc[3], arc[2], 0.0
                row[6], row[7], row[8], row[9], row[10], row[11] = arc[2], arc[3], 0.0, arc[4], arc[5], arc[6]
                row[12], row[13] = ON_FLOOR, 1.0
                count = _emit(frame, lens, field.channels, place, row, out, count)
        before_u, before_v, has = u, v, True
    for n in range(field.rings.shape[0]):
        ring = field.rings[n]
        dx, dy = ring[0] - frame[9], ring[1] - frame[10]
        away = math.sqrt(dx * dx + dy * dy)
        if away < 1.5 * ring[2] or dx * frame[15] + dy * frame[14] < 0.0:
            continue
        row[6], row[7], row[8], row[9], row[10], row[11] = 0.0, 0.0, 1.0, ring[5], ring[4], ring[6]
        row[12], row[13] = UPRIGHT, 0.0
        for k in range(RING_POINTS):
            across = 0.8 * (2.0 * (k + 0.5) / RING_POINTS - 1.0)
            ahead = math.sqrt(1.0 - across * across)
            ox = -dx / away * ahead - dy / away * across
            oy = -dy / away * ahead + dx / away * across
            place[0], place[1], place[2] = ring[0] + ring[2] * ox, ring[1] + ring[2] * oy, ring[3]
            place[3], place[4], place[5] = -oy, ox, 0.0
            count = _emit(frame, lens, field.channels, place, row, out, count)
    return count


@compiled(fastmath=True, error_model="numpy")
def predict(field: FieldEdges, lens: FloatArray, p: FloatArray, spacing_px: float, out: Samples) -> int:
    """Sample all edges of the field that the camera sees from a pose.

    Parameters
    ----------
    field : FieldEdges
        The field.
    lens : (18,) float64
        fu, fv, centre u, v, width, height, whether distorted, OpenCV's k1, k2, p1, p2, k3 to k6, greatest squared
        slope, greatest slopes along u and v.
    p : (7,) float64
        The unknowns.
    spacing_px : float
        Between samples.
    out : Samples
        Result.

    Returns
    -------
    int
        How many.
    """
    frame, room = np.empty(16), np.empty(10)
    pose_frame(p, lens, frame)
    seen = np.empty((2 * (field.cylinders.shape[0] + field.bars.shape[0]) + 1, 14))
    upright = _silhouettes(field, frame, seen)
    count = variable(0)
    for n in range(field.segments.shape[0] + upright):
        standing = n >= field.segments.shape[0]
        row = seen[n - field.segments.shape[0]] if standing else field.segments[n]
        count = _segment(frame, lens, field.channels, row, spacing_px, room, out, count)
    return _curves(field, lens, frame, spacing_px, seen[seen.shape[0] - 1], room[4:], out, count)
