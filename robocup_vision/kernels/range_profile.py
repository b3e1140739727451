"""Compiled loops that compare a range profile with earlier ones, seen again from a candidate pose."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]

# neighbours are of one thing if they differ by less than this share of their inverse range, beyond their noise
_STEP_SHARE = 0.1


@njit(cache=True, nogil=True)
def is_step(one: float, other: float, variance: float) -> bool:
    """Whether two neighbouring inverse ranges (1/m), NaN for none, lie on different things."""
    return not abs(one - other) < 3.0 * math.sqrt(2.0 * variance) + _STEP_SHARE * other


@njit(cache=True, nogil=True)
def smooth(
    inverse: FloatArray, variance: FloatArray, reach: int, value: FloatArray, spread: FloatArray, slope: FloatArray
) -> None:
    """Fit a straight wall through each direction's neighbours that lie on the same thing.

    In inverse range a straight wall is a cos(angle) + b sin(angle), whatever its distance; b, the slope, is fitted too.

    inverse, variance : (J,) inverse range, 1/m, NaN where none; and its variance.
    reach : neighbours on either side that may take part.
    value, spread, slope : (J,); written: 1/m, its variance, and 1/m per step; NaN where `inverse` is.
    """
    count = inverse.shape[0]
    step_rad = math.tau / count
    for j in range(count):
        middle = inverse[j]
        value[j], spread[j], slope[j] = math.nan, math.nan, math.nan
        if not middle > 0.0:
            continue
        cc, cs, ss, c, s = 1.0, 0.0, 0.0, middle, 0.0
        for side in (-1, 1):
            last = middle
            for step in range(1, reach + 1):
                near = inverse[(j + side * step) % count]
                # noise from one direction to the next is far smaller than a step in depth
                if is_step(near, last, variance[j]):
                    break
                last = near
                cos, sin = math.cos(step * step_rad), math.sin(side * step * step_rad)
                cc += cos * cos
                cs += cos * sin
                ss += sin * sin
                c += cos * near
                s += sin * near
        size = cc * ss - cs * cs
        if ss > 0.0:
            value[j] = (ss * c - cs * s) / size
            slope[j] = (cc * s - cs * c) / size * step_rad
            spread[j] = variance[j] * ss / size
        else:
            slope[j], value[j], spread[j] = 0.0, middle, variance[j]


@njit(cache=True, nogil=True)
def part(inverse: FloatArray, variance: FloatArray, thing: Int64Array) -> int:
    """Number the things seen: neighbouring directions with no step in depth between them.

    inverse, variance : (J,) inverse range, 1/m, NaN where none; and its variance.
    thing : (J,); written: numbers from 0; -1 where there is nothing.

    Returns how many there are.
    """
    count = inverse.shape[0]
    # begin at a gap, so that no thing is cut in two at direction 0
    first = 0
    for j in range(count):
        if is_step(inverse[j - 1], inverse[j], variance[j]):
            first = j
            break
    things = 0
    for step in range(count):
        j = (first + step) % count
        if not inverse[j] > 0.0:
            thing[j] = -1
            continue
        if step == 0 or is_step(inverse[j - 1], inverse[j], variance[j]):
            things += 1
        thing[j] = things - 1
    return things


@njit(cache=True, nogil=True)
def widths(xy: FloatArray, thing: Int64Array, things: int, width: FloatArray) -> None:
    """How wide each thing is: the diagonal of the box around its points; `width` (things,) is written, metres."""
    low, high = np.full((things, 2), math.inf), np.full((things, 2), -math.inf)
    for m in range(xy.shape[0]):
        if thing[m] >= 0:
            for axis in range(2):
                low[thing[m], axis] = min(low[thing[m], axis], xy[m, axis])
                high[thing[m], axis] = max(high[thing[m], axis], xy[m, axis])
    for t in range(things):
        width[t] = math.hypot(high[t, 0] - low[t, 0], high[t, 1] - low[t, 1])


@njit(cache=True, nogil=True)
def free_to_move(
    one_normal: FloatArray, one_slope: FloatArray, moved_variance: float, normal: FloatArray, slope: FloatArray
) -> None:
    """Add what one thing says of the pose, if it may itself have moved.

    A thing that moves looks like a robot that moves the other way, so its own displacement, of variance
    `moved_variance` (m^2) along x and along y, has the columns of the pose's x and y; integrated out, it leaves
    N - N_t^T (N_tt + I / m^2)^-1 N_t of a thing's normal matrix N.

    one_normal, one_slope : (3, 3) and (3,) as if it stood still; cleared.
    normal, slope : (3, 3) and (3,); added to.
    """
    xx, xy, yy = 0.0, 0.0, 0.0
    if moved_variance > 0.0:
        a, b, d = one_normal[0, 0] + 1.0 / moved_variance, one_normal[0, 1], one_normal[1, 1] + 1.0 / moved_variance
        size = a * d - b * b
        xx, xy, yy = d / size, -b / size, a / size
    for a in range(3):
        by_x = one_normal[a, 0] * xx + one_normal[a, 1] * xy
        by_y = one_normal[a, 0] * xy + one_normal[a, 1] * yy
        slope[a] += one_slope[a] - by_x * one_slope[0] - by_y * one_slope[1]
        for b in range(3):
            normal[a, b] += one_normal[a, b] - by_x * one_normal[0, b] - by_y * one_normal[1, b]
    one_normal[:] = 0.0
    one_slope[:] = 0.0


@njit(cache=True, nogil=True)
def compare(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    moved_variance: FloatArray,
    thing: Int64Array,
    x: float,
    y: float,
    phi: float,
    gate: float,
    worth: float,
    nearest: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
) -> tuple[float, int, int]:
    """Difference of a profile from one earlier profile seen from the pose (x, y, phi): one i of Miura's eq. 1.

    inverse, variance : (J,) inverse range at bearings j * 2 pi / J, 1/m, NaN where none; and its variance.
    along : (J,) its slope, 1/m a bearing.
    past_xy, past_range_variance : (M, 2) and (M,) the earlier profile's points in the frame of the pose, metres, NaN
    where none; and the variance of their range as measured then, m^2.
    moved_variance : (M,) how far what stands there may have moved since, along each axis; m^2, the same for all of a
    thing.
    thing : (M,) which thing a point lies on; those of one are next to each other (and around the end).
    gate : differences over this many standard deviations are skipped.
    worth : independent measurements a bearing; below 1 where bearings have been smoothed over their neighbours.
    nearest : (J,) scratch.
    normal, slope : (3, 3) and (3,); the sums of J^T J and of J^T r are added to them.

    Returns the sum of squared normalised differences, how many were counted, and how many could have been.
    """
    bearings, points = inverse.shape[0], past_xy.shape[0]
    per_rad = bearings / math.tau
    nearest[:] = 0.0
    for m in range(points):
        dx, dy = past_xy[m, 0] - x, past_xy[m, 1] - y
        distance = math.hypot(dx, dy)
        if distance > 0.0:
            j = int(math.floor((math.atan2(dy, dx) - phi) * per_rad + 0.5)) % bearings
            nearest[j] = max(nearest[j], 1.0 / distance)
    start = 0
    while start < points - 1 and thing[start] == thing[-1]:
        start += 1
    total, counted, comparable = 0.0, 0, 0
    row, one_normal, one_slope = np.empty(3), np.zeros((3, 3)), np.zeros(3)
    last = -1
    for step in range(points):
        m = (start + step) % points
        dx, dy = past_xy[m, 0] - x, past_xy[m, 1] - y
        squared = dx * dx + dy * dy
        if not squared > 0.0:
            continue
        seen = 1.0 / math.sqrt(squared)
        turn = (math.atan2(dy, dx) - phi) * per_rad
        place = int(math.floor(turn + 0.5))
        j = place % bearings
        if not inverse[j] > 0.0:
            continue
        spread = variance[j] + past_range_variance[m] * seen * seen * seen * seen
        limit = gate * math.sqrt(spread)
        # what a nearer thing of the earlier profile hides is not seen again
        if nearest[j] - seen > limit:
            continue
        comparable += 1
        difference = inverse[j] + (turn - place) * along[j] - seen
        if abs(difference) > limit:
            continue
        if last >= 0 and thing[m] != thing[last]:
            free_to_move(one_normal, one_slope, moved_variance[last], normal, slope)
        last = m
        turned = along[j] * per_rad
        cube = seen * seen * seen
        row[0] = turned * dy * seen * seen - dx * cube
        row[1] = -turned * dx * seen * seen - dy * cube
        row[2] = -turned
        total += difference * difference / spread
        counted += 1
        for a in range(3):
            one_slope[a] += row[a] * difference * worth / spread
            for b in range(3):
                one_normal[a, b] += row[a] * row[b] * worth / spread
    if last >= 0:
        free_to_move(one_normal, one_slope, moved_variance[last], normal, slope)
    return total, counted, comparable


@njit(cache=True, nogil=True)
def difference(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    moved_variance: FloatArray,
    thing: Int64Array,
    pose: FloatArray,
    gate: float,
    least_share: float,
    worth: float,
    nearest: FloatArray,
    normal: FloatArray,
    slope: FloatArray,
) -> tuple[float, int, float]:
    """Miura's Diff(x, y, phi), its normal matrix and its gradient over k earlier profiles.

    past_xy, past_range_variance, moved_variance, thing : (k, M, ...) as in `compare`.
    pose : (3,) x, y, phi.
    least_share : an earlier profile is used if at least this share of what could be compared is within the gate.
    normal, slope : (3, 3) and (3,); overwritten: per profile the mean, times the largest number of bearings that one of
    them gave, since they share the noise of the present profile and together weigh as one of them does.

    Returns the mean over profiles of the mean squared difference, how many profiles were used, and the share of all
    that could be compared which agree.
    """
    one_normal, one_slope = np.empty((3, 3)), np.empty(3)
    normal[:] = 0.0
    slope[:] = 0.0
    total, used, most, agreeing, all_comparable = 0.0, 0, 0, 0, 0
    for i in range(past_xy.shape[0]):
        one_normal[:] = 0.0
        one_slope[:] = 0.0
        cost, counted, comparable = compare(
            inverse, variance, along, past_xy[i], past_range_variance[i], moved_variance[i], thing[i],
            pose[0], pose[1], pose[2], gate, worth, nearest, one_normal, one_slope,
        )  # fmt: skip
        agreeing += counted
        all_comparable += comparable
        if counted < 3 or counted < least_share * comparable:
            continue
        used += 1
        most = max(most, counted)
        total += cost / counted
        slope += one_slope / counted
        normal += one_normal / counted
    if used > 0:
        slope *= most / used
        normal *= most / used
    return total / max(used, 1), used, agreeing / max(all_comparable, 1)


@njit(cache=True, nogil=True)
def refine(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    moved_variance: FloatArray,
    thing: Int64Array,
    pose: FloatArray,
    predicted: FloatArray,
    information: FloatArray,
    gates: FloatArray,
    least_share: float,
    worth: float,
    normal: FloatArray,
) -> tuple[float, int, float]:
    """Gauss-Newton on `difference` and the prediction, one step a gate; moves `pose` (3,) and leaves its `normal`.

    predicted, information : (3,) and (3, 3) the pose that odometry says and the inverse of its covariance.

    Returns what `difference` does at the last step.
    """
    nearest, slope = np.empty(inverse.shape[0]), np.empty(3)
    total, used, share = 0.0, 0, 0.0
    for gate in gates:
        total, used, share = difference(
            inverse, variance, along, past_xy, past_range_variance, moved_variance, thing,
            pose, gate, least_share, worth, nearest, normal, slope,
        )  # fmt: skip
        if used == 0:
            return 0.0, 0, 0.0
        normal += information
        slope += information @ (pose - predicted)
        pose -= np.linalg.solve(normal, slope)
    return total, used, share


@njit(cache=True, nogil=True)
def search(
    inverse: FloatArray,
    variance: FloatArray,
    along: FloatArray,
    past_xy: FloatArray,
    past_range_variance: FloatArray,
    moved_variance: FloatArray,
    thing: Int64Array,
    poses: FloatArray,
    gate: float,
) -> int:
    """Which of the candidate poses (N, 3) lets the largest share of bearings agree with the earlier profiles."""
    nearest, normal, slope = np.empty(inverse.shape[0]), np.empty((3, 3)), np.empty(3)
    best, best_share = 0, -1.0
    for n in range(poses.shape[0]):
        share = difference(
            inverse, variance, along, past_xy, past_range_variance, moved_variance, thing,
            poses[n], gate, 0.0, 1.0, nearest, normal, slope,
        )[2]  # fmt: skip
        if share > best_share:
            best, best_share = n, share
    return best
