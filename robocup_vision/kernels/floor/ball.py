"""Compiled search for a small coloured blob on the floor, of the size a ball has there."""

from __future__ import annotations

import math

from numba import njit

from robocup_vision.arrays import FloatArray, Int8Array, Int32Array, UInt8Array, UInt16Array

NEVER = 2**31 - 1


@njit(cache=True, nogil=True)
def find_ball(
    frame: UInt8Array,
    seeds: Int32Array,
    stamps: Int32Array,
    first_stamp: int,
    stack: Int32Array,
    center_u: float,
    center_v: float,
    body_px: float,
    from_white: FloatArray,
    from_floor: FloatArray,
    min_level: float,
    sure: float,
    min_signal: float,
    radial_half_px: FloatArray,
    tangential_half_px: FloatArray,
    packing: UInt16Array,
    floor_llr: Int8Array,
    out: FloatArray,
) -> tuple[float, int]:
    """Find the blob that is most like a ball on open floor.

    Parameters
    ----------
    frame : (H, W, 3) uint8
    seeds : (N, 2) int32
        Pixels (v, u) so dense that a ball anywhere covers one.
    stamps : (H, W) int32
        Scratch that lives over frames: pixels that carry `first_stamp` or more have been visited in this one, those
        that carry NEVER are not to be.
    first_stamp : int
        Greater than any stamp of the frame before.
    stack : (N,) int32
        Scratch, N >= H W.
    center_u, center_v : float
        Image of the mirror's axis.
    body_px : float
        What is nearer to there shows the robot itself.
    from_white, from_floor : (3,) float64
        A pixel is of the ball's colour if both dot products with its B, G, R are positive.
    min_level : float
        Darker pixels (sum of B, G, R) have no colour.
    sure : float
        From this dot product with `from_floor` on a pixel is ball all over.
    min_signal : float
        The sum of these dot products over a blob must reach this times the root of its area: more than noise gives.
    radial_half_px, tangential_half_px : (R,) float64
        Half the ball's size in the image, by image radius in whole pixels.
    packing, floor_llr
        The colour table.
    out : (4,) float64
        Filled with the blob's centre u, v, its half sizes' mean ratio to the expected, and its share of floor before
        and beside it.

    Returns
    -------
    (float, int)
        The best blob's score: the share of floor before and beside it, less what has its own colour; 0 when none. And
        the last stamp used.
    """
    stamp = first_stamp
    height, width = frame.shape[0], frame.shape[1]
    w0, w1, w2 = from_white[0], from_white[1], from_white[2]
    f0, f1, f2 = from_floor[0], from_floor[1], from_floor[2]
    best = 0.0
    for n in range(seeds.shape[0]):
        v0, u0 = seeds[n, 0], seeds[n, 1]
        b, g, r = frame[v0, u0, 0], frame[v0, u0, 1], frame[v0, u0, 2]
        if f0 * b + f1 * g + f2 * r <= 0.0 or w0 * b + w1 * g + w2 * r <= 0.0:
            continue
        if float(b) + g + r < min_level or stamps[v0, u0] >= first_stamp:
            continue
        # flood over the ball's colour, but no farther than a ball here could reach; what touches an earlier flood is
        # the rest of a thing that was too large
        at_seed = int(math.sqrt((u0 - center_u) ** 2 + (v0 - center_v) ** 2) + 0.5)
        if at_seed >= radial_half_px.shape[0] or not radial_half_px[at_seed] > 0.0:
            continue
        largest = 3.0 * math.pi * (radial_half_px[at_seed] + 1.0) * (tangential_half_px[at_seed] + 1.0)
        stamp += 1
        stack[0] = v0 * width + u0
        stamps[v0, u0] = stamp
        top, area, alone = 1, 0, True
        total, sum_u, sum_v, sum_uu, sum_uv, sum_vv = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        signal = 0.0
        while top > 0 and alone:
            top -= 1
            v, u = stack[top] // width, stack[top] % width
            b, g, r = frame[v, u, 0], frame[v, u, 1], frame[v, u, 2]
            # a mixed pixel at the rim counts in part, a shaded one inside as a whole
            value = f0 * b + f1 * g + f2 * r
            signal += value
            weight = min(1.0, value / sure)
            area += 1
            total += weight
            du, dv = float(u - u0), float(v - v0)
            sum_u += weight * du
            sum_v += weight * dv
            sum_uu += weight * du * du
            sum_uv += weight * du * dv
            sum_vv += weight * dv * dv
            for side in range(4):
                nu = u + (1 if side == 0 else -1 if side == 1 else 0)
                nv = v + (1 if side == 2 else -1 if side == 3 else 0)
                if nu < 0 or nv < 0 or nu >= width or nv >= height or stamps[nv, nu] == stamp:
                    continue
                b, g, r = frame[nv, nu, 0], frame[nv, nu, 1], frame[nv, nu, 2]
                if f0 * b + f1 * g + f2 * r <= 0.0 or w0 * b + w1 * g + w2 * r <= 0.0:
                    continue
                if float(b) + g + r < min_level or stamps[nv, nu] == NEVER:
                    continue
                alone = alone and stamps[nv, nu] < first_stamp
                stamps[nv, nu] = stamp
                stack[top] = nv * width + nu
                top += 1
            alone = alone and area <= largest
        if not alone or signal < min_signal * math.sqrt(area):
            continue
        cu, cv = sum_u / total, sum_v / total
        x, y = u0 + cu - center_u, v0 + cv - center_v
        radius = math.sqrt(x * x + y * y)
        index = int(radius + 0.5)
        if index >= radial_half_px.shape[0] or not radial_half_px[index] > 0.0:
            continue
        a, t = radial_half_px[index], tangential_half_px[index]
        expected = math.pi * (a + 0.25) * (t + 0.25)
        if area < max(2.0, 0.15 * expected) or area > 2.2 * (a + 0.75) * (t + 0.75) * math.pi:
            continue
        # second moments along and across the ray: a quarter of the squared half sizes for an ellipse
        ex, ey = x / radius, y / radius
        uu = sum_uu / total - cu * cu + 1.0 / 12
        uv = sum_uv / total - cu * cv
        vv = sum_vv / total - cv * cv + 1.0 / 12
        radial = 2.0 * math.sqrt(max(0.0, ex * ex * uu + 2 * ex * ey * uv + ey * ey * vv))
        across = 2.0 * math.sqrt(max(0.0, ey * ey * uu - 2 * ex * ey * uv + ex * ex * vv))
        if radial > 1.6 * a + 1.0 or across > 1.6 * t + 1.0 or radial < 0.35 * a - 0.5 or across < 0.35 * t - 0.5:
            continue
        # floor before it and on both sides; behind it may be anything, but not more of its own colour. Where it lies at
        # the picture's edge, what is shown of its surroundings must do, the nearest first; before one that the robot
        # holds there is the robot
        floor, like, asked, wanted = 0, 0, 0, 9
        for k in range(16):
            step = 8 + ((k + 1) // 2 if k % 2 else -(k // 2))
            angle = step * math.pi / 8
            along = (1.35 * a + 2.0) * math.cos(angle)
            aside = (1.35 * t + 2.0) * math.sin(angle)
            u = int(center_u + x + along * ex - aside * ey + 0.5)
            v = int(center_v + y + along * ey + aside * ex + 0.5)
            if u < 1 or v < 1 or u >= width - 1 or v >= height - 1:
                continue
            if (u - center_u) ** 2 + (v - center_v) ** 2 < (body_px + 2.0) ** 2:
                wanted -= 1
                continue
            asked += 1
            blue, green, red = 0, 0, 0
            for nv in range(v - 1, v + 2):
                for nu in range(u - 1, u + 2):
                    blue += frame[nv, nu, 0]
                    green += frame[nv, nu, 1]
                    red += frame[nv, nu, 2]
            blue, green, red = blue // 9, green // 9, red // 9
            if f0 * blue + f1 * green + f2 * red > 0.0 and w0 * blue + w1 * green + w2 * red > 0.0:
                like += blue + green + red >= min_level
            elif asked <= wanted and floor_llr[packing[0, blue] + packing[1, green] + packing[2, red]] > 0:
                floor += 1
        if not wanted:
            continue
        score = floor / wanted - like / 8.0
        if score > best:
            best = score
            out[0] = center_u + x
            out[1] = center_v + y
            out[2] = 0.5 * (radial / a + across / t)
            out[3] = floor / wanted
    return best, stamp
