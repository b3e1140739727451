"""Compiled loops of steering: free ranges grown by the robot, and trajectories tried over them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit

FloatArray = npt.NDArray[np.float64]
Int64Array = npt.NDArray[np.int64]
Pair = tuple[float, float]
Limits = tuple[float, float, float, float, float, float, float]
Outcome = tuple[int, int, float, float]

# Bins of the grown profile (0.45 to 0.9 degrees) and the groups of them over which trajectories take long steps.
# Constants of the compiler, because a division by them is then a shift.
BINS = 512
FINE = 128
COARSE = 32
# The diamond angle turns at most as fast as the bearing, so a group is at least 4 / groups radians wide.
_FINE_SIN, _FINE_TAN = math.sin(4.0 / FINE), math.tan(4.0 / FINE)
_COARSE_SIN, _COARSE_TAN = math.sin(4.0 / COARSE), math.tan(4.0 / COARSE)


@njit(cache=True, nogil=True, error_model="numpy")
def _profile_bin(x: float, y: float) -> int:
    # The diamond angle grows with the bearing as atan2 does, at the price of one division.
    along = y / (abs(x) + abs(y))
    if x < 0.0:
        along = 2.0 - along
    elif along < 0.0:
        along += 4.0
    index = int(along * (0.25 * BINS))
    return index if index < BINS else index - BINS


@njit(cache=True, nogil=True, error_model="numpy")
def measure_sectors(bearing: FloatArray, sectors: FloatArray, sector_bins: Int64Array) -> bool:
    """Give each bearing its sector, halfway to its neighbours; False where the bearings do not ascend within one turn.

    Parameters
    ----------
    bearing : (J,) float64
        Radians.
    sectors : (J, 4) float64, written
        Unit vectors (x, y) of the lower and the upper edge.
    sector_bins : (J, 4) int64, written
        Profile bins of the edges; whether the lower and the upper neighbour follow without a gap.

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
            sector_bins[k, side] = _profile_bin(x, y)
            sector_bins[k, 2 + side] = 1 if joined else 0
    return True


@njit(cache=True, nogil=True, error_model="numpy")
def _widen(lows: FloatArray, count: int, out: FloatArray) -> None:
    """Smallest of each of the first `count` values and its two neighbours around the turn."""
    for k in range(count):
        out[k] = min(lows[k], min(lows[k - 1 if k > 0 else count - 1], lows[k + 1 if k + 1 < count else 0]))


@njit(cache=True, nogil=True, error_model="numpy")
def grow_profile(
    range_m: FloatArray,
    sectors: FloatArray,
    sector_bins: Int64Array,
    edges: FloatArray,
    radius_m: float,
    profile: FloatArray,
    fine: FloatArray,
    coarse: FloatArray,
) -> float:
    """Fill the grown profile: per bin the smallest centre range at which a disc touches a sector's arc or its shadow.

    Parameters
    ----------
    range_m : (J,) float64
        Metres; NaN is unseen: its own bins become 0 and nothing grows from it.
    sectors, sector_bins : (J, 4)
        From `measure_sectors`.
    edges : (BINS + 1, 2) float64
        Unit vectors of the profile's bin edges.
    radius_m : float
        The robot's.
    profile : (BINS,) float64, written
        Metres; inf where nothing is ever touched.
    fine, coarse : (FINE,), (COARSE,) float64, written
        Smallest profile over each group of bins and its two neighbours.

    Returns
    -------
    float
        Smallest profile of all.
    """
    count = range_m.shape[0]
    squared = radius_m * radius_m
    # Bins that no sector covers are unseen; -1 marks them until all sectors are in.
    profile[:] = -1.0
    for k in range(count):
        index = sector_bins[k, 0]
        while True:
            profile[index] = np.inf
            if index == sector_bins[k, 1]:
                break
            index = index + 1 if index + 1 < BINS else 0
    for index in range(BINS):
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
            index = index + 1 if index + 1 < BINS else 0
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
            for _ in range(BINS):
                if side == 1:
                    index = index + 1 if index + 1 < BINS else 0
                    edge = index
                else:
                    edge = index
                    index = index - 1 if index > 0 else BINS - 1
                ahead = edges[edge, 0] * x + edges[edge, 1] * y
                beside = edges[edge, 0] * y - edges[edge, 1] * x
                rest = squared - beside * beside
                if ahead <= 0.0 or rest < 0.0:
                    break
                touch = ahead - np.sqrt(rest)
                if touch < profile[index]:
                    profile[index] = max(touch, 0.0)
    lows = np.empty(FINE)
    for group in range(FINE):
        low = np.inf
        for index in range(group * (BINS // FINE), (group + 1) * (BINS // FINE)):
            low = min(low, profile[index])
        lows[group] = low
    _widen(lows, FINE, fine)
    for group in range(COARSE):
        low = np.inf
        for index in range(group * (FINE // COARSE), (group + 1) * (FINE // COARSE)):
            low = min(low, lows[index])
        lows[group] = low
    _widen(lows, COARSE, coarse)
    smallest = np.inf
    for group in range(COARSE):
        smallest = min(smallest, lows[group])
    return smallest


@njit(cache=True, nogil=True, error_model="numpy")
def predict_position(velocity: Pair, target: Pair, acceleration: float, dead_time: float, t: float) -> Pair:
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


@njit(cache=True, nogil=True, error_model="numpy")
def _sure_time(
    r: float, clear: float, out: float, inward: float, sideward: float, sine: float, tangent: float
) -> float:
    """Seconds for which a point at range r stays within a wedge (of its half angle's sine and tangent) and its range.

    The speeds are times r, which saves their division. A quotient costs as much as all the rest here, hence one only.
    """
    over_range, over_wedge = out + sideward * sine, sideward + inward * tangent
    if clear * over_wedge < r * tangent * over_range:
        return r * clear / over_range
    return r * r * tangent / over_wedge


@njit(cache=True, nogil=True, error_model="numpy")
def contact_time(
    velocity: Pair,
    target: Pair,
    acceleration: float,
    dead_time: float,
    horizon: float,
    step_m: float,
    profile: FloatArray,
    fine: FloatArray,
    coarse: FloatArray,
    smallest: float,
) -> float:
    """Return T_j (eq. 15), the last moment sure to be free before the trajectory leaves the profile; inf: no contact.

    The next sample is as late as the profile's minima around the present one are sure to allow, at least `step_m` on;
    the contact is then bracketed to a tenth of that from the free side, because a late T_j is a collision.

    How late: the velocity goes straight to its target, so from now on no component of it exceeds the greater of its
    present and its target value. With the outward speed u, the inward speed d and the sideward speed w so bounded, the
    bearing turns by less than phi while w t <= (r - d t) tan(phi), and until then the range grows by at most
    (u + w sin(phi)) t.
    """
    fastest = math.sqrt(max(velocity[0] ** 2 + velocity[1] ** 2, target[0] ** 2 + target[1] ** 2))
    if fastest == 0.0:
        return np.inf
    dv_x, dv_y = target[0] - velocity[0], target[1] - velocity[1]
    size = math.sqrt(dv_x * dv_x + dv_y * dv_y)
    push = acceleration / size if size > 0.0 else 0.0
    settle = size / acceleration
    lag = dead_time + 0.5 * settle
    least = step_m / fastest
    slowness = 1.0 / fastest
    free = 0.0
    t = min(max(smallest * slowness, least), horizon)
    while True:
        # predict_position, written out to share what does not change along a trajectory, and with the velocity.
        if t < dead_time:
            x, y = velocity[0] * t, velocity[1] * t
            v_x, v_y = velocity
        elif t < dead_time + settle:
            share = push * (t - dead_time)
            gained = 0.5 * share * (t - dead_time)
            x, y = velocity[0] * t + gained * dv_x, velocity[1] * t + gained * dv_y
            v_x, v_y = velocity[0] + share * dv_x, velocity[1] + share * dv_y
        else:
            x, y = velocity[0] * lag + target[0] * (t - lag), velocity[1] * lag + target[1] * (t - lag)
            v_x, v_y = target
        r = math.sqrt(x * x + y * y)
        later = least
        if r > 1e-12:
            index = _profile_bin(x, y)
            if r >= profile[index]:
                break
            out_now, out_then = v_x * x + v_y * y, target[0] * x + target[1] * y
            out = max(out_now, out_then, 0.0)
            inward = max(-out_now, -out_then, 0.0)
            sideward = max(abs(v_y * x - v_x * y), abs(target[1] * x - target[0] * y)) + 1e-12
            later = max(
                later,
                (smallest - r) * slowness,
                _sure_time(r, coarse[index // (BINS // COARSE)] - r, out, inward, sideward, _COARSE_SIN, _COARSE_TAN),
                _sure_time(r, fine[index // (BINS // FINE)] - r, out, inward, sideward, _FINE_SIN, _FINE_TAN),
            )
        free = t
        if t >= horizon:
            return np.inf
        t = min(t + later, horizon)
    hit = t
    while (hit - free) * fastest > 0.1 * step_m:
        t = 0.5 * (free + hit)
        x, y = predict_position(velocity, target, acceleration, dead_time, t)
        r = math.sqrt(x * x + y * y)
        if r > 1e-12 and r >= profile[_profile_bin(x, y)]:
            hit = t
        else:
            free = t
    return free


@njit(cache=True, nogil=True, error_model="numpy")
def choose_direction(
    velocity: Pair,
    goal_bearing: float,
    goal_distance: float,
    side: float,
    limits: Limits,
    use_velocity: bool,
    directions: FloatArray,
    units: FloatArray,
    profile: FloatArray,
    fine: FloatArray,
    coarse: FloatArray,
    smallest: float,
    time_to_contact: FloatArray,
) -> Outcome:
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
        Radians, within [0, 2 pi), and unit vectors.
    profile, fine, coarse, smallest
        From `grow_profile`.
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
    goal_bearing %= turn
    if goal_distance < np.inf:
        lag = acceleration * (dead_time + period)
        speed = min(speed, math.sqrt(lag * lag + 2.0 * acceleration * goal_distance) - lag)
    best, nearest, progress, toward, pace = -1, np.inf, -np.inf, 0.0, 0.0
    for level in range(int(levels)):
        slower = speed * 0.5**level
        # At best it goes straight to the goal; and a direction no nearer to the goal is not worth the lower speed.
        if slower <= progress:
            break
        chosen, least, longest, turned_least = -1, nearest - 1e-9, 0.0, 0.0
        for j in range(count):
            turned = directions[j] - goal_bearing
            if turned >= math.pi:
                turned -= turn
            elif turned < -math.pi:
                turned += turn
            ahead = abs(turned) <= same
            away = turn - abs(turned) if turned * side < 0.0 and not ahead else abs(turned)
            if level > 0 and away > least + 1e-9:
                continue
            target = (slower * units[j, 0], slower * units[j, 1])
            present = velocity if use_velocity else target
            settle = math.sqrt((target[0] - present[0]) ** 2 + (target[1] - present[1]) ** 2) / acceleration
            needed = threshold if threshold >= 0.0 else 2.0 * dead_time + period + settle + 0.5 * slower / acceleration
            horizon = 1.1 * needed
            t = contact_time(present, target, acceleration, dead_time, horizon, step_m, profile, fine, coarse, smallest)
            if level == 0:
                time_to_contact[j] = t
            if t < needed:
                beyond = False
                if ahead and goal_distance < np.inf:
                    x, y = predict_position(present, target, acceleration, dead_time, t)
                    beyond = math.hypot(x, y) >= goal_distance + 0.5 * slower * slower / acceleration
                if not beyond:
                    continue
            if away < least - 1e-9 or (away < least + 1e-9 and t > longest):
                chosen, least, longest, turned_least = j, min(away, least), t, turned
        if chosen >= 0 and slower * math.cos(min(least, math.pi)) > progress:
            best, nearest, toward, pace = chosen, least, turned_least, slower
            progress = slower * math.cos(min(least, math.pi))
    if best >= 0:
        if abs(toward) <= same:
            side = 0.0
        elif side == 0.0:
            side = 1.0 if toward > 0.0 else -1.0
        return 0, best, pace, side
    standing = (0.0, 0.0)
    present = velocity if use_velocity else standing
    stop = dead_time + math.hypot(present[0], present[1]) / acceleration
    latest = contact_time(present, standing, acceleration, dead_time, stop, step_m, profile, fine, coarse, smallest)
    # Later by less than contacts are told apart is no later, and braking then touches more softly.
    latest += 0.1 * step_m / max(speed, math.hypot(present[0], present[1]), step_m)
    chosen = -1
    for j in range(count):
        if time_to_contact[j] > latest:
            chosen, latest = j, time_to_contact[j]
    return (1, -1, 0.0, side) if chosen < 0 else (2, chosen, speed, side)


@njit(cache=True, nogil=True, error_model="numpy")
def steer(
    velocity: Pair,
    goal_bearing: float,
    goal_distance: float,
    side: float,
    limits: Limits,
    use_velocity: bool,
    directions: FloatArray,
    units: FloatArray,
    bearing: FloatArray,
    range_m: FloatArray,
    known_bearing: FloatArray,
    sectors: FloatArray,
    sector_bins: Int64Array,
    edges: FloatArray,
    radius_m: float,
    profile: FloatArray,
    fine: FloatArray,
    coarse: FloatArray,
    time_to_contact: FloatArray,
) -> Outcome:
    """Join the three steps in one call; the sectors are measured again only when the bearings have changed.

    Returns what `choose_direction` does; outcome -1 where the bearings do not ascend within one turn.
    """
    same = True
    for k in range(bearing.shape[0]):
        same = same and bearing[k] == known_bearing[k]
    if not same:
        known_bearing[:] = np.nan
        if not measure_sectors(bearing, sectors, sector_bins):
            return -1, -1, 0.0, side
        known_bearing[:] = bearing
    smallest = grow_profile(range_m, sectors, sector_bins, edges, radius_m, profile, fine, coarse)
    return choose_direction(
        velocity, goal_bearing, goal_distance, side, limits, use_velocity, directions, units,
        profile, fine, coarse, smallest, time_to_contact,
    )  # fmt: skip
