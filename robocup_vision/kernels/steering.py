"""Compiled loops of steering: free ranges grown by the robot, and trajectories tried over them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numba import njit


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
