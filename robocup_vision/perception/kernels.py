"""Compiled kernels: the loops that NumPy and OpenCV cannot do in the time a frame has; each has a NumPy twin in the tests.

Everything here is a plain function of arrays. The wrappers that give them meaning live beside the concepts they serve.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit


# ---- the polar view: colours, floor boundary, sub-pixel edges -------------------------------------------------------


@njit(cache=True, nogil=True)
def classify(samples, packing, floor_llr, valid, out):
    """Look (K, M, 3) uint8 samples up in a colour table; 0 where not valid. Writes out (K, M) int8."""
    rows, columns = valid.shape
    for k in range(rows):
        for m in range(columns):
            index = packing[0, samples[k, m, 0]] + packing[1, samples[k, m, 1]] + packing[2, samples[k, m, 2]]
            out[k, m] = floor_llr[index] if valid[k, m] else np.int8(0)


@njit(cache=True, nogil=True)
def outer_boundary(llr, valid, certain, gap, least_strip, out):
    """Find the outermost floor sample of each bearing.

    Floor is five samples in a row, or three in a row on three neighbouring bearings (a far strip of floor is thin but
    long), whose mean reaches `certain`. From there a strip of floor behind a painted line still counts: two samples, not
    more than `gap` samples on, whose sum reaches `least_strip`.

    Writes out (K,) int64: its column, or -1 where a bearing has no floor, or where what follows cannot be seen.
    """
    rows, columns = llr.shape
    for k in range(rows):
        out[k] = -1
        before, after = k - 1, (k + 1) % rows
        for m in range(columns - 3, -1, -1):
            own = llr[k, m] + llr[k, m + 1] + llr[k, m + 2]
            if own < 2 * certain:
                continue
            beside = llr[before, m] + llr[before, m + 1] + llr[before, m + 2]
            beside += llr[after, m] + llr[after, m + 1] + llr[after, m + 2]
            if own + beside < 9 * certain:
                if m < 2 or own + llr[k, m - 1] + llr[k, m - 2] < 5 * certain:
                    continue
            edge = m + 2
            while edge > m and llr[k, edge] <= 0:
                edge -= 1
            ahead = edge + 1
            while ahead + 1 < columns and ahead <= edge + gap + 1:
                if llr[k, ahead] > 0 and llr[k, ahead] + llr[k, ahead + 1] >= least_strip:
                    edge = ahead + 1 if llr[k, ahead + 1] > 0 else ahead
                    ahead = edge
                ahead += 1
            if edge + 2 < columns and valid[k, edge + 1] and valid[k, edge + 2]:
                out[k] = edge
            break


@njit(cache=True, nogil=True)
def radial_edges(frame, center_u, center_v, step_u, step_v, start_px, column_step_px, half_width, least_contrast, out):
    """Locate the edge between two colours along each bearing to a fraction of a pixel.

    Around the coarse edge the frame is sampled every half pixel, averaged over three neighbouring lines of sight; the
    steepest place splits the samples into the inner and the outer colour, and the edge is where the projection on their
    difference crosses one half, by least squares against a smooth step. A cast, a shadow or the floor's own brightness
    so cannot bias it; channels that the outer side drives into saturation would, and are left out.

    Parameters
    ----------
    frame : (H, W, 3) uint8
    center_u, center_v : float
    step_u, step_v : (K,) float64
        Image direction of each bearing.
    start_px : (K,) float64
        Image radius of the last floor sample; NaN: skip.
    column_step_px : float
        Uncertainty of start_px outwards.
    half_width : float
        Angle between neighbouring lines of sight, radians.
    least_contrast : float
        Smallest colour difference (counts) that is an edge.
    out : (K,) float64
        Filled with the edge's image radius, NaN where there is none.
    """
    height, width = frame.shape[0], frame.shape[1]
    # blur takes the last sample that looks like floor about a column and a pixel inside the edge
    search = int(math.ceil(2 * (column_step_px + 1.0)))
    reach = search + 6
    count = 2 * reach + 1
    profile = np.empty((count, 3))
    inner = np.empty(3)
    outer = np.empty(3)
    gain = np.empty(3)
    for k in range(start_px.shape[0]):
        out[k] = np.nan
        if not start_px[k] > 0:
            continue
        near = start_px[k] + column_step_px + 0.5 - 0.5 * reach
        far = near + reach
        aside = half_width * start_px[k] + 1.0
        left = center_u + min(near * step_u[k], far * step_u[k]) - aside
        right = center_u + max(near * step_u[k], far * step_u[k]) + aside
        top = center_v + min(near * step_v[k], far * step_v[k]) - aside
        bottom = center_v + max(near * step_v[k], far * step_v[k]) + aside
        if left < 0 or right >= width - 1 or top < 0 or bottom >= height - 1:
            continue
        profile[:] = 0.0
        for side in range(-1, 2):
            du = step_u[k] - side * half_width * step_v[k]
            dv = step_v[k] + side * half_width * step_u[k]
            for i in range(count):
                radius = near + 0.5 * i
                u, v = center_u + radius * du, center_v + radius * dv
                x, y = int(u), int(v)
                fx, fy = u - x, v - y
                w11 = fx * fy
                w10, w01 = fy - w11, fx - w11
                w00 = 1.0 - fx - fy + w11
                for c in range(3):
                    profile[i, c] += (
                        frame[y, x, c] * w00
                        + frame[y, x + 1, c] * w01
                        + frame[y + 1, x, c] * w10
                        + frame[y + 1, x + 1, c] * w11
                    )
        steepest, place = -1.0, reach
        for i in range(reach - search, reach + search + 1):
            slope = 0.0
            for c in range(3):
                d = profile[i + 1, c] + profile[i + 2, c] - profile[i - 1, c] - profile[i - 2, c]
                slope += d * d
            if slope > steepest:
                steepest, place = slope, i
        contrast2, unsaturated2 = 0.0, 0.0
        for c in range(3):
            inner[c] = profile[place - 5, c] + profile[place - 4, c] + profile[place - 3, c]
            outer[c] = profile[place + 5, c] + profile[place + 4, c] + profile[place + 3, c]
            inner[c] /= 9.0
            outer[c] /= 9.0
            gain[c] = outer[c] - inner[c]
            contrast2 += gain[c] ** 2
            if outer[c] < 245.0:
                unsaturated2 += gain[c] ** 2
        if contrast2 < least_contrast * least_contrast:
            continue
        if unsaturated2 > 0.1 * contrast2 and unsaturated2 > least_contrast * least_contrast:
            contrast2 = unsaturated2
            for c in range(3):
                if outer[c] >= 245.0:
                    gain[c] = 0.0
        edge = float(place)
        for _ in range(3):
            numerator, denominator = 0.0, 0.0
            for i in range(max(0, int(edge) - 3), min(count, int(edge) + 5)):
                x = (i - edge) / 3.5
                if abs(x) >= 1.0:
                    continue
                value = 0.0
                for c in range(3):
                    value += (profile[i, c] / 3.0 - inner[c]) * gain[c]
                slope = 1.0 - x * x
                numerator += slope * (0.5 + 0.75 * x - 0.25 * x * x * x - value / contrast2)
                denominator += slope * slope
            edge += max(-1.5, min(1.5, numerator / denominator * 3.5 / 0.75))
        if abs(edge - place) < 4.0:
            out[k] = near + 0.5 * edge


# ---- the floor's outline against the field's walls ------------------------------------------------------------------


@njit(cache=True, nogil=True)
def hull_radius(cos_b, sin_b, radius, out):
    """Image radius of the convex hull of the points at (bearing, radius) along every bearing.

    `radius` is NaN where a bearing has no point. Writes out (K,) float64; returns how many bearings had points.
    """
    count = radius.shape[0]
    stack = np.empty(count + 1, np.int64)
    farthest, top, known = -1, 0, 0
    for k in range(count):
        if radius[k] > 0:
            known += 1
            if farthest < 0 or radius[k] > radius[farthest]:
                farthest = k
    if known < 3:
        return known
    for step in range(count + 1):
        k = (farthest + step) % count
        if not radius[k] > 0:
            continue
        x, y = radius[k] * cos_b[k], radius[k] * sin_b[k]
        while top >= 2:
            a, b = stack[top - 2], stack[top - 1]
            ax, ay = radius[a] * cos_b[a], radius[a] * sin_b[a]
            bx, by = radius[b] * cos_b[b], radius[b] * sin_b[b]
            if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                break
            top -= 1
        stack[top] = k
        top += 1
    for i in range(top - 1):
        a, b = stack[i], stack[i + 1]
        ax, ay = radius[a] * cos_b[a], radius[a] * sin_b[a]
        dx, dy = radius[b] * cos_b[b] - ax, radius[b] * sin_b[b] - ay
        span = (b - a) % count
        if span == 0:
            span = count
        for step in range(span + 1):
            k = (a + step) % count
            across = cos_b[k] * dy - sin_b[k] * dx
            out[k] = (ax * dy - ay * dx) / across if across > 1e-9 else radius[a]
    return known


@njit(cache=True, nogil=True)
def star_moments(cos_b, sin_b, range_m):
    """Centroid x, y and the principal axis's direction of the star-shaped polygon with corners at (bearing, range)."""
    area, mx, my, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    count = range_m.shape[0]
    for k in range(count):
        n = (k + 1) % count
        x0, y0 = range_m[k] * cos_b[k], range_m[k] * sin_b[k]
        x1, y1 = range_m[n] * cos_b[n], range_m[n] * sin_b[n]
        cross = x0 * y1 - x1 * y0
        area += cross / 2
        mx += cross * (x0 + x1) / 6
        my += cross * (y0 + y1) / 6
        sxx += cross * (x0 * x0 + x0 * x1 + x1 * x1) / 12
        syy += cross * (y0 * y0 + y0 * y1 + y1 * y1) / 12
        sxy += cross * (2 * x0 * y0 + x0 * y1 + x1 * y0 + 2 * x1 * y1) / 24
    mx, my = mx / area, my / area
    sxx, syy, sxy = sxx / area - mx * mx, syy / area - my * my, sxy / area - mx * my
    return mx, my, 0.5 * math.atan2(2 * sxy, sxx - syy)


@njit(cache=True, nogil=True)
def predict_walls(pose, walls, offset_x, offset_y, height, robot_to_camera, cos_b, sin_b, best_q, best_wall, planes):
    """Inverse range at which each bearing meets the nearest wall's foot, from a pose.

    A wall's foot and the viewpoint span a plane with normal n; the ray (cos, sin, -q h) of a bearing lies in it where
    q = (n_x cos + n_y sin) / (h n_z): walls are straight in q, whatever the mirror and its tilt.

    Parameters
    ----------
    pose : (3,) float64
        x, y, theta of the robot.
    walls : (W, 4) float64
        Feet, field frame.
    robot_to_camera : (3, 3) float64
    cos_b, sin_b : (K,) float64
        Evenly spaced camera-frame bearings from 0 counter-clockwise.
    best_q : (K,) float64
        Filled with the inverse range; 0 where no wall is met.
    best_wall : (K,) int64
        Filled with the wall's index, -1 where none.
    planes : (W, 4, 3) float64
        Filled with each wall's normal and its derivatives by x, y and theta.
    """
    count = cos_b.shape[0]
    per_rad = count / (2 * math.pi)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    end = np.empty((2, 4, 3))
    best_q[:] = 0.0
    best_wall[:] = -1
    for w in range(walls.shape[0]):
        for e in range(2):
            dx, dy = walls[w, 2 * e] - pose[0], walls[w, 2 * e + 1] - pose[1]
            x, y = c * dx + s * dy, -s * dx + c * dy
            for i in range(3):
                t0, t1, t2 = robot_to_camera[i, 0], robot_to_camera[i, 1], robot_to_camera[i, 2]
                end[e, 0, i] = t0 * (x - offset_x) + t1 * (y - offset_y) - t2 * height
                end[e, 1, i] = -t0 * c + t1 * s
                end[e, 2, i] = -t0 * s - t1 * c
                end[e, 3, i] = t0 * y - t1 * x
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            planes[w, 0, i] = end[0, 0, j] * end[1, 0, k] - end[0, 0, k] * end[1, 0, j]
            for p in range(1, 4):
                planes[w, p, i] = (
                    end[0, p, j] * end[1, 0, k]
                    + end[0, 0, j] * end[1, p, k]
                    - end[0, p, k] * end[1, 0, j]
                    - end[0, 0, k] * end[1, p, j]
                )
        nx, ny, nz = planes[w, 0, 0], planes[w, 0, 1], planes[w, 0, 2] * height
        if abs(nz) < 1e-12:
            continue
        first = math.atan2(end[0, 0, 1], end[0, 0, 0])
        span = math.atan2(end[1, 0, 1], end[1, 0, 0]) - first
        span -= 2 * math.pi * math.floor(span / (2 * math.pi) + 0.5)
        if span < 0:
            first, span = first + span, -span
        low = int(math.ceil(first * per_rad))
        high = int(math.floor((first + span) * per_rad))
        for step in range(low, high + 1):
            b = step % count
            q = (nx * cos_b[b] + ny * sin_b[b]) / nz
            if q > best_q[b]:
                best_q[b] = q
                best_wall[b] = w


@njit(cache=True, nogil=True)
def score_bank(bank, radius, width_px, out):
    """Compare a measured outline with the outlines expected at many places, at every heading.

    Parameters
    ----------
    bank : (P, B) float64
        Expected image radius at B evenly spaced bearings, for heading 0.
    radius : (B,) float64
        Measured image radius, NaN where none.
    width_px : float
        Differences beyond this count as this.
    out : (P, B) float64
        Filled with the mean cost, 0 to 1, of place p with the heading of minus shift times the bearings' step.
    """
    places, count = bank.shape
    for p in range(places):
        for shift in range(count):
            cost, used = 0.0, 0
            for b in range(count):
                if radius[b] > 0:
                    e = radius[b] - bank[p, (b - shift) % count]
                    used += 1
                    cost += min(abs(e), width_px)
            out[p, shift] = cost / (max(used, 1) * width_px)


@njit(cache=True, nogil=True)
def fit_walls(
    poses,
    walls,
    offset_x,
    offset_y,
    height,
    robot_to_camera,
    cos_b,
    sin_b,
    radius,
    stride,
    q_step,
    radius_of_q,
    scales,
    unit_px,
    out_pose,
    out_information,
    out_scatter,
    out_residual,
):
    """Fit poses to a measured floor outline by Gauss-Newton on the image radius, with annealed redescending weights.

    Parameters
    ----------
    poses : (N, 3) float64
        Starts; the one that ends with the least truncated cost wins.
    radius : (K,) float64
        Measured image radius of the floor's edge, NaN where none.
    stride : int
        Use every stride-th bearing.
    q_step, radius_of_q : float, (Q,) float64
        Image radius tabulated over the inverse range 0, q_step, 2 q_step ...
    scales : (I,) float64
        Width of the weights in pixels, one iteration each.
    unit_px : float
        Half the residual at which the cost is truncated.
    out_pose : (3,) float64
    out_information : (3, 3) float64
        Sum of w J^T J at the winner.
    out_scatter : (3, 3) float64
        Sum over groups of neighbouring bearings of g g^T, g the group's sum of w e J: the residuals' true scatter.
    out_residual : (K,) float64
        Residual in pixels along the edge's normal, positive where floor is seen beyond the wall; NaN where none.

    Returns
    -------
    float
        The winner's truncated mean cost, 0 (all fits) to 1 (nothing fits).
    """
    count = cos_b.shape[0]
    best_q = np.empty(count)
    best_wall = np.empty(count, np.int64)
    planes = np.empty((walls.shape[0], 4, 3))
    jacobian = np.empty(3)
    pose = np.empty(3)
    group = np.empty(3)
    a = np.empty((3, 3))
    g = np.empty(3)
    residual = np.empty(count)
    last_q = radius_of_q.shape[0] - 2
    best_cost = 2.0
    for n in range(poses.shape[0]):
        pose[:] = poses[n]
        for iteration in range(scales.shape[0] + 1):
            final = iteration == scales.shape[0]
            scale = scales[min(iteration, scales.shape[0] - 1)]
            predict_walls(
                pose, walls, offset_x, offset_y, height, robot_to_camera, cos_b, sin_b, best_q, best_wall, planes
            )
            a[:] = 0.0
            g[:] = 0.0
            cost, used = 0.0, 0
            scatter = np.zeros((3, 3))
            group[:] = 0.0
            in_group = 0
            for k in range(0, count, stride):
                residual[k] = np.nan
                if not radius[k] > 0:
                    continue
                used += 1
                w = best_wall[k]
                if w < 0:
                    cost += 1.0
                    continue
                q = best_q[k]
                place = min(q / q_step, last_q + 0.999)
                cell = int(place)
                slope = (radius_of_q[cell + 1] - radius_of_q[cell]) / q_step
                predicted = radius_of_q[cell] + (q - cell * q_step) * slope
                nz = planes[w, 0, 2] * height
                turn = slope * (planes[w, 0, 1] * cos_b[k] - planes[w, 0, 0] * sin_b[k]) / nz / predicted
                # the edge is oblique to the ray: what is uniform in the image is the distance along its normal
                oblique = 1.0 / math.sqrt(1.0 + turn * turn)
                e = (radius[k] - predicted) * oblique
                residual[k] = e
                for p in range(3):
                    d = planes[w, p + 1, 0] * cos_b[k] + planes[w, p + 1, 1] * sin_b[k]
                    jacobian[p] = slope * (d - q * height * planes[w, p + 1, 2]) / nz * oblique
                # an obstacle hides floor, so an edge nearer than the wall says little; floor beyond a wall cannot be
                ratio = e / scale if e < 0 else e / (3.0 * scale)
                weight = 1.0 / (1.0 + ratio * ratio) ** 2
                loss = (e / (2.0 * unit_px)) ** 2
                cost += min(1.0, loss) if e < 0 else min(2.0, loss)
                for i in range(3):
                    g[i] += weight * e * jacobian[i]
                    group[i] += weight * e * jacobian[i]
                    for j in range(3):
                        a[i, j] += weight * jacobian[i] * jacobian[j]
                in_group += 1
                if in_group == 4:
                    for i in range(3):
                        for j in range(3):
                            scatter[i, j] += group[i] * group[j]
                    group[:] = 0.0
                    in_group = 0
            if final:
                cost = cost / max(used, 1)
                if cost < best_cost:
                    best_cost = cost
                    out_pose[:] = pose
                    out_information[:] = a
                    out_scatter[:] = scatter
                    out_residual[:] = residual
                break
            for i in range(3):
                a[i, i] += 1e-6
            # 3 x 3 by Cramer's rule: no LAPACK call in the loop
            c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
            c01 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
            c02 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
            det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
            if not det > 0.0:
                continue
            x = (g[0] * c00 + g[1] * c01 + g[2] * c02) / det
            y = (
                g[0] * (a[0, 2] * a[2, 1] - a[0, 1] * a[2, 2])
                + g[1] * (a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0])
                + g[2] * (a[0, 1] * a[2, 0] - a[0, 0] * a[2, 1])
            ) / det
            t = (
                g[0] * (a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1])
                + g[1] * (a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2])
                + g[2] * (a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0])
            ) / det
            # a step is trusted as far as the linearised wall stays near
            length = math.sqrt(x * x + y * y)
            shrink = min(1.0, 0.5 / max(length, 1e-9), 0.5 / max(abs(t), 1e-9))
            pose[0] += shrink * x
            pose[1] += shrink * y
            pose[2] += shrink * t
    return best_cost


# ---- white lines: ridges in the image, nearest field line, poses scored and refined by them -------------------------


@njit(cache=True, nogil=True)
def floor_mask_by_tone(smooth, seen, tone):
    """Tell which pixels have the floor's tone. Returns (H, W) uint8 of 0 and 1.

    tone is (7,): least and greatest R/G, B/G and G, then the slack of each channel in grey levels.
    """
    height, width = seen.shape
    out = np.zeros((height, width), dtype=np.uint8)
    for y in range(height):
        for x in range(width):
            if seen[y, x] == 0:
                continue
            b = np.float32(smooth[y, x, 0])
            g = np.float32(smooth[y, x, 1])
            r = np.float32(smooth[y, x, 2])
            if (
                g >= tone[4]
                and g <= tone[5]
                and r >= tone[0] * g - tone[6]
                and r <= tone[1] * g + tone[6]
                and b >= tone[2] * g - tone[6]
                and b <= tone[3] * g + tone[6]
            ):
                out[y, x] = 1
    return out


@njit(cache=True, nogil=True)
def _half_crossing(whiteness, x, y, dx, dy, reach, level):
    """Count the steps from (x, y) along (dx, dy) until whiteness falls to the level; -1 if not within reach."""
    before = float(whiteness[y, x])
    for step in range(1, reach + 1):
        here = float(whiteness[y + step * dy, x + step * dx])
        if here <= level:
            return step - (level - here) / (before - here)
        before = here
    return -1.0


@njit(cache=True, nogil=True)
def line_ridge_points(whiteness, green, floor, width_units, threshold, limit):
    """Find ridges as wide as a line should be, with floor beside them.

    Parameters
    ----------
    whiteness, green : (H, W) uint8
        min(R, B) and G.
    floor : (H, W) uint8
        1 where a pixel has the floor's tone.
    width_units : (4, H, W) uint16
        Expected width along the axes (1, 0), (1, 1), (0, 1), (-1, 1), in 1/16 px; 0 where not to be looked at.
    threshold : int
        Least height of a ridge over both its sides, grey levels.
    limit : int
        At most so many points are returned.

    Returns
    -------
    (N, 4) float64
        Sub-pixel u, v, contrast (height over the floor's G) and 1 for floor on both sides, 0 for one.
    """
    height, width = whiteness.shape
    out = np.empty((limit, 4))
    count = 0
    for y in range(height):
        for x in range(width):
            value = np.int64(whiteness[y, x])
            if value < threshold:
                continue
            best, best_axis, best_reach, best_two = 0.0, -1, 0, 0
            for k in range(4):
                units = width_units[k, y, x]
                if units == 0:
                    continue
                dx = 1 if k < 2 else (0 if k == 2 else -1)
                dy = 0 if k == 0 else 1
                step_px = 1.0 if k == 0 or k == 2 else 1.4142135623730951
                reach = math.ceil((0.7 * units / 16.0 + 1.8) / step_px)
                xa, ya, xb, yb = x + reach * dx, y + reach * dy, x - reach * dx, y - reach * dy
                if xa < 0 or xa >= width or xb < 0 or xb >= width or ya >= height or yb < 0:
                    continue
                rise = value - max(np.int64(whiteness[ya, xa]), np.int64(whiteness[yb, xb]))
                if rise < threshold:
                    continue
                two = np.int64(floor[ya, xa]) + np.int64(floor[yb, xb])
                # a ridge with floor on both sides goes before a higher one with floor on one
                if two == 0 or two < best_two or (two == best_two and rise <= best):
                    continue
                best, best_axis, best_reach, best_two = float(rise), k, reach, two
            if best_axis < 0:
                continue
            k, reach = best_axis, best_reach
            dx = 1 if k < 2 else (0 if k == 2 else -1)
            dy = 0 if k == 0 else 1
            side_a = np.int64(whiteness[y + reach * dy, x + reach * dx])
            side_b = np.int64(whiteness[y - reach * dy, x - reach * dx])
            to_a = _half_crossing(whiteness, x, y, dx, dy, reach, 0.5 * (value + side_a))
            to_b = _half_crossing(whiteness, x, y, -dx, -dy, reach, 0.5 * (value + side_b))
            if to_a < 0.0 or to_b < 0.0:
                continue
            shift = 0.5 * (to_a - to_b)
            if shift > 0.5 or shift <= -0.5:
                continue
            step_px = 1.0 if k == 0 or k == 2 else 1.4142135623730951
            seen_px = (to_a + to_b) * step_px
            expected_px = width_units[k, y, x] / 16.0
            if seen_px < 0.5 * expected_px or seen_px > 1.5 * expected_px + 1.5:
                continue
            if count == limit:
                return out[:count]
            ground = 0.0
            if floor[y + reach * dy, x + reach * dx]:
                ground = float(green[y + reach * dy, x + reach * dx])
            if floor[y - reach * dy, x - reach * dx]:
                ground = max(ground, float(green[y - reach * dy, x - reach * dx]))
            out[count, 0] = x + shift * dx
            out[count, 1] = y + shift * dy
            out[count, 2] = best / max(ground, 1.0)
            out[count, 3] = 1.0 if best_two == 2 else 0.0
            count += 1
    return out[:count]


@njit(cache=True, nogil=True)
def _nearest_line(x, y, lines, arcs):
    """Nearest point of the field's lines and arcs: distance, unit normal (from the line towards the point), index."""
    best, foot_x, foot_y, index = 1e30, 0.0, 0.0, -1
    for i in range(lines.shape[0]):
        x0, y0 = lines[i, 0], lines[i, 1]
        dx, dy = lines[i, 2] - x0, lines[i, 3] - y0
        length2 = dx * dx + dy * dy
        t = ((x - x0) * dx + (y - y0) * dy) / length2 if length2 > 0.0 else 0.0
        t = min(1.0, max(0.0, t))
        fx, fy = x0 + t * dx, y0 + t * dy
        d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy)
        if d2 < best:
            best, foot_x, foot_y, index = d2, fx, fy, i
    for j in range(arcs.shape[0]):
        cx, cy, radius, start, sweep = arcs[j, 0], arcs[j, 1], arcs[j, 2], arcs[j, 3], arcs[j, 4]
        if sweep < 0.0:
            start, sweep = start + sweep, -sweep
        angle = math.atan2(y - cy, x - cx)
        if sweep < 2.0 * math.pi:
            past = (angle - start) % (2.0 * math.pi)
            if past > sweep:
                # beyond the arc: the nearer of its two ends
                angle = start + sweep if past - sweep < 2.0 * math.pi - past else start
        fx, fy = cx + radius * math.cos(angle), cy + radius * math.sin(angle)
        d2 = (x - fx) * (x - fx) + (y - fy) * (y - fy)
        if d2 < best:
            best, foot_x, foot_y, index = d2, fx, fy, lines.shape[0] + j
    distance = math.sqrt(best)
    if distance > 1e-9:
        return distance, (x - foot_x) / distance, (y - foot_y) / distance, index
    # on the line itself: any unit vector across it
    if index < lines.shape[0]:
        dx, dy = lines[index, 2] - lines[index, 0], lines[index, 3] - lines[index, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length > 0.0:
            return distance, -dy / length, dx / length, index
        return distance, 1.0, 0.0, index
    j = index - lines.shape[0]
    dx, dy = foot_x - arcs[j, 0], foot_y - arcs[j, 1]
    length = max(1e-12, math.sqrt(dx * dx + dy * dy))
    return distance, dx / length, dy / length, index


@njit(cache=True, nogil=True)
def nearest_lines(points, lines, arcs):
    """Nearest field line of each point (N, 2).

    Returns distance (N,), unit normal (N, 2) from the line towards the point, and index (N,): lines first, then arcs.
    """
    count = points.shape[0]
    distance, normal, index = np.empty(count), np.empty((count, 2)), np.empty(count, dtype=np.int64)
    for i in range(count):
        distance[i], normal[i, 0], normal[i, 1], index[i] = _nearest_line(points[i, 0], points[i, 1], lines, arcs)
    return distance, normal, index


@njit(cache=True, nogil=True)
def score_pose_grid(points, headings, table, origin_x, origin_y, cell, first_x, first_y, step, count_x, count_y, far):
    """Sum the tabulated distances of points seen from every pose of a grid. Returns (K, count_y, count_x) int32.

    Positions are first + i * step in cells of the table, so that a pose only shifts the points' cells. Points that fall
    outside the table count as far.
    """
    rows, columns = table.shape
    number = points.shape[0]
    cost = np.zeros((headings.shape[0], count_y, count_x), dtype=np.int32)
    for k in range(headings.shape[0]):
        c, s = math.cos(headings[k]), math.sin(headings[k])
        for i in range(number):
            px = math.floor((c * points[i, 0] - s * points[i, 1] - origin_x) / cell + 0.5) + first_x
            py = math.floor((s * points[i, 0] + c * points[i, 1] - origin_y) / cell + 0.5) + first_y
            for iy in range(count_y):
                y = py + iy * step
                if y < 0 or y >= rows:
                    for ix in range(count_x):
                        cost[k, iy, ix] += far
                    continue
                for ix in range(count_x):
                    x = px + ix * step
                    cost[k, iy, ix] += table[y, x] if 0 <= x < columns else far
    return cost


@njit(cache=True, nogil=True)
def _solve3(a, b):
    """Solve a symmetric positive definite 3x3 system by LDL'; NaN where it is singular."""
    d0 = a[0, 0]
    l10, l20 = a[1, 0] / d0, a[2, 0] / d0
    d1 = a[1, 1] - l10 * l10 * d0
    l21 = (a[2, 1] - l20 * l10 * d0) / d1
    d2 = a[2, 2] - l20 * l20 * d0 - l21 * l21 * d1
    y0 = b[0]
    y1 = b[1] - l10 * y0
    y2 = b[2] - l20 * y0 - l21 * y1
    x2 = y2 / d2
    x1 = y1 / d1 - l21 * x2
    x0 = y0 / d0 - l10 * x1 - l20 * x2
    return x0, x1, x2


@njit(cache=True, nogil=True)
def refine_line_poses(poses, points, noise_m, weight, lines, arcs, scales_m):
    """Gauss-Newton of several poses by point-to-line distances with a Cauchy loss that narrows step by step.

    Parameters
    ----------
    poses : (K, 3) float64
        Starts x, y, theta; refined in place.
    points : (N, 2) float64
        Line points in the robot frame, metres.
    noise_m, weight : (N,) float64
        What each point is uncertain by on the floor, added to the loss's scale in quadrature, and its weight.
    lines, arcs : (L, 4), (M, 5) float64
        Of the field.
    scales_m : (T,) float64
        Scale of the loss at each step.

    Returns
    -------
    (K,) float64
        Mean loss at the last scale: weighted mean of log(1 + (d/scale)^2).
    """
    total = max(weight.sum(), 1e-12)
    loss = np.empty(poses.shape[0])
    a, b = np.empty((3, 3)), np.empty(3)
    for k in range(poses.shape[0]):
        for turn in range(scales_m.shape[0] + 1):
            scale = scales_m[min(turn, scales_m.shape[0] - 1)]
            c, s = math.cos(poses[k, 2]), math.sin(poses[k, 2])
            a[:] = 0.0
            b[:] = 0.0
            loss[k] = 0.0
            for i in range(points.shape[0]):
                rx, ry = c * points[i, 0] - s * points[i, 1], s * points[i, 0] + c * points[i, 1]
                d, nx, ny, _ = _nearest_line(poses[k, 0] + rx, poses[k, 1] + ry, lines, arcs)
                v2 = scale * scale + noise_m[i] * noise_m[i]
                loss[k] += weight[i] * math.log(1.0 + d * d / v2)
                w = weight[i] / (v2 + d * d)
                jt = ny * rx - nx * ry
                a[0, 0] += w * nx * nx
                a[1, 0] += w * nx * ny
                a[1, 1] += w * ny * ny
                a[2, 0] += w * nx * jt
                a[2, 1] += w * ny * jt
                a[2, 2] += w * jt * jt
                b[0] -= w * nx * d
                b[1] -= w * ny * d
                b[2] -= w * jt * d
            if turn == scales_m.shape[0]:
                break
            damping = 1e-3 * (a[0, 0] + a[1, 1]) + 1e-9
            a[0, 0] += damping
            a[1, 1] += damping
            a[2, 2] += damping
            dx, dy, dt = _solve3(a, b)
            reach = math.sqrt(dx * dx + dy * dy)
            if not (reach < 1e3 and abs(dt) < 1e3):
                break
            shrink = min(1.0, 0.5 / max(reach, 1e-12), 0.2 / max(abs(dt), 1e-12))
            poses[k, 0] += shrink * dx
            poses[k, 1] += shrink * dy
            poses[k, 2] += shrink * dt
        loss[k] /= total
    return loss


# ---- avoidance: a profile of free ranges, grown by the robot, and trajectories over it -------------------------------


@njit(cache=True, nogil=True)
def _profile_bin(x, y, bins):
    # The diamond angle grows with the bearing as atan2 does, at the price of one division.
    along = y / (abs(x) + abs(y))
    if x < 0.0:
        along = 2.0 - along
    elif along < 0.0:
        along += 4.0
    index = int(along * (0.25 * bins))
    return index if index < bins else index - bins


@njit(cache=True, nogil=True)
def measure_sectors(bearing, sectors, sector_bins, bins):
    """Give each bearing its sector, halfway to its neighbours; False where the bearings do not ascend within one turn.

    Parameters
    ----------
    bearing : (J,) float64
        Radians.
    sectors : (J, 4) float64, written
        Unit vectors (x, y) of the lower and the upper edge.
    sector_bins : (J, 4) int64, written
        Profile bins of the edges; whether the lower and the upper neighbour follow without a gap.
    bins : int
        Number of bins of the profile.

    A gap of more than 1.5 times the smallest spacing belongs to nobody (a camera that does not see all around): there
    a sector reaches half the smallest spacing, and the rest is unseen.
    """
    count = bearing.shape[0]
    turn = 2.0 * np.pi
    spacing = turn
    for k in range(count):
        ahead = bearing[k + 1] - bearing[k] if k + 1 < count else bearing[0] + turn - bearing[k]
        if not ahead > 0.0:
            return False
        spacing = min(spacing, ahead)
    for k in range(count):
        for side in range(2):
            if side == 0:
                gap = bearing[k] - bearing[k - 1] if k > 0 else bearing[0] + turn - bearing[count - 1]
            else:
                gap = bearing[k + 1] - bearing[k] if k + 1 < count else bearing[0] + turn - bearing[k]
            joined = gap <= 1.5 * spacing
            half = 0.5 * (gap if joined else spacing)
            angle = bearing[k] - half if side == 0 else bearing[k] + half
            x, y = np.cos(angle), np.sin(angle)
            sectors[k, 2 * side] = x
            sectors[k, 2 * side + 1] = y
            sector_bins[k, side] = _profile_bin(x, y, bins)
            sector_bins[k, 2 + side] = 1 if joined else 0
    return True


@njit(cache=True, nogil=True)
def grow_profile(range_m, sectors, sector_bins, edges, radius_m, profile, coarse):
    """Fill the grown profile: per bin the smallest centre range at which a disc touches a sector's arc or its shadow.

    Parameters
    ----------
    range_m : (J,) float64
        Metres; NaN is unseen: its own bins become 0 and nothing grows from it.
    sectors, sector_bins : (J, 4)
        From `measure_sectors`.
    edges : (N + 1, 2) float64
        Unit vectors of the profile's bin edges.
    radius_m : float
        The robot's.
    profile : (N,) float64, written
        Metres; inf where nothing is ever touched.
    coarse : (C,) float64, written
        Smallest profile over each C-th of the bins and its two neighbours.

    Returns
    -------
    float
        Smallest profile of all.
    """
    count = range_m.shape[0]
    bins = profile.shape[0]
    squared = radius_m * radius_m
    # Bins that no sector covers are unseen; -1 marks them until all sectors are in.
    profile[:] = -1.0
    for k in range(count):
        index = sector_bins[k, 0]
        while True:
            profile[index] = np.inf
            if index == sector_bins[k, 1]:
                break
            index = index + 1 if index + 1 < bins else 0
    for index in range(bins):
        if profile[index] < 0.0:
            profile[index] = 0.0
    for k in range(count):
        reach = range_m[k]
        seen = not np.isnan(reach)
        reach = max(reach, radius_m) if seen else radius_m
        index = sector_bins[k, 0]
        while True:
            profile[index] = min(profile[index], reach - radius_m)
            if index == sector_bins[k, 1]:
                break
            index = index + 1 if index + 1 < bins else 0
        if not seen or np.isinf(reach):
            continue
        for side in range(2):
            if sector_bins[k, 2 + side] == 1:
                other = range_m[(k + 1) % count] if side == 1 else range_m[k - 1]
                # A nearer neighbour holds this end point in its own shadow.
                if other <= range_m[k]:
                    continue
            x = reach * sectors[k, 2 * side]
            y = reach * sectors[k, 2 * side + 1]
            index = sector_bins[k, side]
            for _ in range(bins):
                if side == 1:
                    index = index + 1 if index + 1 < bins else 0
                    edge = index
                else:
                    edge = index
                    index = index - 1 if index > 0 else bins - 1
                ahead = edges[edge, 0] * x + edges[edge, 1] * y
                beside = edges[edge, 0] * y - edges[edge, 1] * x
                rest = squared - beside * beside
                if ahead <= 0.0 or rest < 0.0:
                    break
                touch = ahead - np.sqrt(rest)
                if touch < profile[index]:
                    profile[index] = max(touch, 0.0)
    groups = coarse.shape[0]
    wide = bins // groups
    smallest = np.inf
    lows = np.empty(groups)
    for c in range(groups):
        low = np.inf
        for index in range(c * wide, (c + 1) * wide):
            low = min(low, profile[index])
        lows[c] = low
        smallest = min(smallest, low)
    for c in range(groups):
        coarse[c] = min(lows[c], min(lows[c - 1], lows[(c + 1) % groups]))
    return smallest


@njit(cache=True, nogil=True)
def predict_position(velocity, target, acceleration, dead_time, t):
    """Return (x, y), metres, t seconds after the decision: eq. 12 with its second branch corrected, dead time included.

    velocity, target : pair of float, m/s.
    """
    dv_x, dv_y = target[0] - velocity[0], target[1] - velocity[1]
    settle = math.sqrt(dv_x * dv_x + dv_y * dv_y) / acceleration
    pushed = max(t - dead_time, 0.0)
    coasted = min(t, dead_time)
    # 1/2 alpha t^2 dv/|dv| is 1/2 dv t^2/settle, which needs no direction of a vanishing dv.
    if pushed < settle:
        gained = 0.5 * pushed * pushed / settle
        return velocity[0] * t + gained * dv_x, velocity[1] * t + gained * dv_y
    lost = 0.5 * settle
    return (
        velocity[0] * coasted + target[0] * pushed - lost * dv_x,
        velocity[1] * coasted + target[1] * pushed - lost * dv_y,
    )


@njit(cache=True, nogil=True)
def contact_time(velocity, target, acceleration, dead_time, horizon, step_m, profile, coarse, smallest):
    """Return T_j (eq. 15), the last moment sure to be free before the trajectory leaves the profile; inf: no contact.

    The next sample is as far away as the coarse profile is sure to allow, at least `step_m`; the contact is then
    bracketed to a tenth of that from the free side, because a late T_j is a collision.
    """
    fastest = math.sqrt(max(velocity[0] ** 2 + velocity[1] ** 2, target[0] ** 2 + target[1] ** 2))
    if fastest == 0.0:
        return np.inf
    bins = profile.shape[0]
    groups = coarse.shape[0]
    # The diamond angle turns at most as fast as the bearing, so a group is at least 4 / groups radians wide.
    beside = math.sin(4.0 / groups)
    free = 0.0
    hit = -1.0
    t = min(max(smallest, step_m) / fastest, horizon)
    while True:
        x, y = predict_position(velocity, target, acceleration, dead_time, t)
        r = math.sqrt(x * x + y * y)
        blocked = False
        moved = max(smallest, step_m)
        if r > 1e-12:
            index = _profile_bin(x, y, bins)
            blocked = r >= profile[index]
            moved = max(min(coarse[index * groups // bins] - r, beside * r), smallest - r, step_m)
        if blocked:
            hit = t
        else:
            free = t
            if t >= horizon:
                return np.inf
        if hit < 0.0:
            t = min(t + moved / fastest, horizon)
        elif (hit - free) * fastest > 0.1 * step_m:
            t = 0.5 * (free + hit)
        else:
            return free


@njit(cache=True, nogil=True)
def choose_direction(
    velocity, goal_bearing, goal_distance, side, limits, use_velocity, directions, units,
    profile, coarse, smallest, times, time_to_contact,
):  # fmt: skip
    """Predict every direction (paper's Steps 3-4) and choose (Step 5); `Steering` explains the rule.

    Parameters
    ----------
    velocity : (float, float)
        m/s.
    goal_bearing, goal_distance : float
        Radians; metres, inf when unknown.
    side : float
        -1, 0 or 1: the side on which obstacles are being passed.
    limits : (float,) * 7
        Top speed, acceleration, dead time, period, threshold (negative: derived), sample distance; levels of speed.
    use_velocity : bool
        False: the present velocity is taken to be each direction's own.
    directions, units : (J,), (J, 2) float64
        Radians and unit vectors.
    profile, coarse, smallest
        From `grow_profile`.
    times : (J,) float64
        Scratch.
    time_to_contact : (J,) float64, written
        T_j at the top speed.

    Returns
    -------
    outcome : int
        0 a safe direction, 1 brake, 2 no way to brake without contact: the command with the latest contact.
    index : int
        The direction; -1 for braking.
    speed : float
        m/s.
    side : float
        To be handed in next time.
    """
    speed, acceleration, dead_time, period, threshold, step_m, levels = limits
    count = directions.shape[0]
    turn = 2.0 * math.pi
    same = math.pi / count * 1.001
    if goal_distance < np.inf:
        lag = acceleration * (dead_time + period)
        speed = min(speed, math.sqrt(lag * lag + 2.0 * acceleration * goal_distance) - lag)
    for level in range(int(levels)):
        slower = speed * 0.5**level
        chosen, nearest, longest, toward = -1, np.inf, 0.0, 0.0
        for j in range(count):
            turned = (directions[j] - goal_bearing + math.pi) % turn - math.pi
            ahead = abs(turned) <= same
            away = turn - abs(turned) if turned * side < 0.0 and not ahead else abs(turned)
            if level > 0 and away > nearest + 1e-9:
                continue
            target = (slower * units[j, 0], slower * units[j, 1])
            present = velocity if use_velocity else target
            settle = math.hypot(target[0] - present[0], target[1] - present[1]) / acceleration
            needed = threshold if threshold >= 0.0 else 2.0 * dead_time + period + settle + 0.5 * slower / acceleration
            horizon = 1.1 * needed
            t = contact_time(present, target, acceleration, dead_time, horizon, step_m, profile, coarse, smallest)
            if level == 0:
                time_to_contact[j] = t
            if t < needed:
                beyond = False
                if ahead and goal_distance < np.inf:
                    x, y = predict_position(present, target, acceleration, dead_time, t)
                    beyond = math.hypot(x, y) >= goal_distance + 0.5 * slower * slower / acceleration
                if not beyond:
                    continue
            if away < nearest - 1e-9 or (away < nearest + 1e-9 and t > longest):
                chosen, nearest, longest, toward = j, min(away, nearest), t, turned
        if chosen >= 0:
            if abs(toward) <= same:
                side = 0.0
            elif side == 0.0:
                side = 1.0 if toward > 0.0 else -1.0
            return 0, chosen, slower, side
    standing = (0.0, 0.0)
    present = velocity if use_velocity else standing
    stop = dead_time + math.hypot(present[0], present[1]) / acceleration
    latest = contact_time(present, standing, acceleration, dead_time, stop, step_m, profile, coarse, smallest)
    chosen = -1
    for j in range(count):
        if time_to_contact[j] > latest:
            chosen, latest = j, time_to_contact[j]
    return (1, -1, 0.0, side) if chosen < 0 else (2, chosen, speed, side)


@njit(cache=True, nogil=True)
def steer(
    velocity, goal_bearing, goal_distance, side, limits, use_velocity, directions, units,
    bearing, range_m, known_bearing, sectors, sector_bins, edges, radius_m, profile, coarse, times, time_to_contact,
):  # fmt: skip
    """Join the three steps in one call; the sectors are measured again only when the bearings have changed.

    Returns what `choose_direction` does; outcome -1 where the bearings do not ascend within one turn.
    """
    same = True
    for k in range(bearing.shape[0]):
        same = same and bearing[k] == known_bearing[k]
    if not same:
        known_bearing[:] = np.nan
        if not measure_sectors(bearing, sectors, sector_bins, profile.shape[0]):
            return -1, -1, 0.0, side
        known_bearing[:] = bearing
    smallest = grow_profile(range_m, sectors, sector_bins, edges, radius_m, profile, coarse)
    return choose_direction(
        velocity, goal_bearing, goal_distance, side, limits, use_velocity, directions, units,
        profile, coarse, smallest, times, time_to_contact,
    )  # fmt: skip
