"""Compiled choice of a command: trajectories tried over the grown profile, and the memory of a way round."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.kernels.mapping.grown_profile import grow_profile, measure_sectors, profile_bin
from robocup_vision.kernels.motion.moving_contact import moving_contact_then_stop, moving_contact_time
from robocup_vision.kernels.motion.trajectories import contact_time, predict_position, predict_velocity

Pair = tuple[float, float]
Limits = tuple[float, float, float, float, float, float, float]
Outcome = tuple[int, int, float, float]

# a detour by more than this leads away from the goal
AWAY_RAD = math.pi / 3.0
# the other side is taken where it is nearer by more than this
OTHER_SIDE_RAD = 0.25 * math.pi
# a detour to one side by more than this is one to the other side
MAX_TURNED_RAD = 1.25 * math.pi


@njit(cache=True, nogil=True, error_model="numpy")
def unwind(detour: float, way_m: float, radius_m: float) -> float:
    """Return what is left of a detour (radians, signed) after a way driven: it turns back in an arc of this radius."""
    left = max(abs(detour) - way_m / radius_m, 0.0)
    return math.copysign(left, detour)


@njit(cache=True, nogil=True, error_model="numpy")
def choose_direction(
    velocity: Pair,
    pending: Pair,
    wanted_bearing: float,
    target_distance: float,
    side: float,
    limits: Limits,
    use_velocity: bool,
    directions: FloatArray,
    units: FloatArray,
    profile: FloatArray,
    fine: FloatArray,
    coarse: FloatArray,
    smallest: float,
    moving: FloatArray,
    time_to_contact: FloatArray,
) -> Outcome:
    """Predict every direction (paper's Steps 3-4) and choose (Step 5); `Steering` explains the rule.

    Parameters
    ----------
    velocity, pending : (float, float)
        m/s: now, and of the command that is obeyed during the dead time.
    wanted_bearing, target_distance : float
        Radians; metres, inf when unknown, or when the goal does not lie in that direction.
    side : float
        -1, 0 or 1: the side to which it rather turns from the wanted bearing.
    limits : (float,) * 7
        Top speed, acceleration, dead time, period, threshold (negative: derived), sample distance; levels of speed.
    use_velocity : bool
        False: the present velocity is taken to be each direction's own.
    directions, units : (J,), (J, 2) float64
        Radians, within [0, 2 pi), and unit vectors.
    profile, fine, coarse, smallest
        From `grow_profile`.
    moving : (M, 8) float64
        As `moving_contact_time` takes it.
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
    turned : float
        Radians, to the left, from the wanted bearing to the direction, within [-pi, pi).
    """
    speed, acceleration, dead_time, period, threshold, step_m, levels = limits
    count = directions.shape[0]
    turn = 2.0 * math.pi
    same = math.pi / count * 1.001
    wanted_bearing %= turn
    if target_distance < np.inf:
        lag = acceleration * (dead_time + period)
        speed = min(speed, math.sqrt(lag * lag + 2.0 * acceleration * target_distance) - lag)
    here = (0.0, 0.0)
    # what happens before the new command is obeyed, no choice can change
    coasted = contact_time(
        here, velocity, pending, acceleration, dead_time, step_m, profile, fine, coarse, smallest
    )  # fmt: skip
    coasted = min(coasted, moving_contact_time(here, velocity, pending, acceleration, 0.0, dead_time, step_m, moving))
    start = predict_position(here, velocity, pending, acceleration, dead_time)
    obeying = predict_velocity(velocity, pending, acceleration, dead_time)
    best, nearest, progress, toward, pace = -1, np.inf, -np.inf, 0.0, 0.0
    for level in range(int(levels)):
        slower = speed * 0.5**level
        # At best it goes straight there; and a direction no nearer to it is not worth the lower speed.
        if slower <= progress:
            break
        chosen, least, longest, turned_least = -1, nearest - 1e-9, 0.0, 0.0
        for j in range(count):
            turned = directions[j] - wanted_bearing
            if turned >= math.pi:
                turned -= turn
            elif turned < -math.pi:
                turned += turn
            ahead = abs(turned) <= same
            away = abs(turned)
            if turned * side < 0.0 and not ahead:
                away += OTHER_SIDE_RAD
            if level > 0 and away > least + 1e-9:
                continue
            target = (slower * units[j, 0], slower * units[j, 1])
            present = obeying if use_velocity else target
            meets = np.inf
            settle = math.sqrt((target[0] - present[0]) ** 2 + (target[1] - present[1]) ** 2) / acceleration
            needed = threshold if threshold >= 0.0 else 2.0 * dead_time + period + settle + 0.5 * slower / acceleration
            horizon = 1.1 * needed
            if not use_velocity:
                t = contact_time(
                    here, target, target, acceleration, horizon, step_m, profile, fine, coarse, smallest
                )  # fmt: skip
            elif coasted < np.inf:
                t = coasted
            else:
                rest = max(horizon - dead_time, 0.0)
                t = dead_time + contact_time(
                    start, obeying, target, acceleration, rest, step_m, profile, fine, coarse, smallest
                )  # fmt: skip
                if moving.shape[0] > 0:
                    # safe where it can be carried out to its end, or given up at the next decision, and then stopped
                    meets = min(
                        moving_contact_then_stop(
                            start, obeying, target, acceleration, dead_time, settle + dead_time + period, step_m, moving
                        ),
                        moving_contact_then_stop(
                            start, obeying, target, acceleration, dead_time, period, step_m, moving
                        ),
                    )  # fmt: skip
                    t = min(t, dead_time + meets)
            if level == 0:
                time_to_contact[j] = t
            if t < needed or meets < np.inf:
                beyond = False
                if ahead and target_distance < np.inf and t >= dead_time:
                    if use_velocity:
                        x, y = predict_position(start, obeying, target, acceleration, t - dead_time)
                    else:
                        x, y = target[0] * t, target[1] * t
                    beyond = math.hypot(x, y) >= target_distance + 0.5 * slower * slower / acceleration
                if not beyond:
                    continue
            if away < least - 1e-9 or (away < least + 1e-9 and t > longest):
                chosen, least, longest, turned_least = j, min(away, least), t, turned
        if chosen >= 0 and slower * math.cos(min(least, math.pi)) > progress:
            best, nearest, toward, pace = chosen, least, turned_least, slower
            progress = slower * math.cos(min(least, math.pi))
    if best >= 0:
        return 0, best, pace, toward
    latest = coasted
    if latest == np.inf or not use_velocity:
        stop = math.hypot(obeying[0], obeying[1]) / acceleration if use_velocity else 0.0
        latest = dead_time + contact_time(
            start, obeying, here, acceleration, stop, step_m, profile, fine, coarse, smallest
        )  # fmt: skip
        latest = min(
            latest,
            dead_time + moving_contact_time(start, obeying, here, acceleration, dead_time, stop, step_m, moving),
        )
    # Later by less than contacts are told apart is no later, and braking then touches more softly.
    latest += 0.1 * step_m / max(speed, math.hypot(velocity[0], velocity[1]), step_m)
    chosen = -1
    for j in range(count):
        if time_to_contact[j] > latest:
            chosen, latest = j, time_to_contact[j]
    return (1, -1, 0.0, 0.0) if chosen < 0 else (2, chosen, speed, 0.0)


@njit(cache=True, nogil=True, error_model="numpy")
def steer(
    velocity: Pair,
    pending: Pair,
    target_bearing: float,
    target_distance: float,
    detour: float,
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
    moving: FloatArray,
    time_to_contact: FloatArray,
) -> Outcome:
    """Join the steps in one call; the sectors are measured again only when the bearings have changed.

    Takes the detour, radians to the left of the goal's bearing, and returns what `choose_direction` does, but last the
    detour to be handed in next time; outcome -1 where the bearings do not ascend within one turn.
    """
    same = True
    for k in range(bearing.shape[0]):
        same = same and bearing[k] == known_bearing[k]
    if not same:
        known_bearing[:] = np.nan
        if not measure_sectors(bearing, sectors, sector_bins):
            return -1, -1, 0.0, detour
        known_bearing[:] = bearing
    smallest = grow_profile(range_m, sectors, sector_bins, edges, radius_m, profile, fine, coarse)
    resolution = math.pi / directions.shape[0] * 1.001
    pace = math.hypot(velocity[0], velocity[1])
    detour = unwind(detour, pace * limits[3], max(radius_m, pace * pace / limits[1]))
    if target_distance < profile[profile_bin(math.cos(target_bearing), math.sin(target_bearing))]:
        detour = 0.0
    side = 0.0 if detour == 0.0 else math.copysign(1.0, detour)
    if abs(detour) > AWAY_RAD:
        # away from the goal no faster than it can turn within its own length: else it overshoots every corner
        speed, acceleration, dead_time, period, threshold, step_m, levels = limits
        slower = min(speed, math.sqrt(acceleration * 2.0 * radius_m))
        limits = (slower, acceleration, dead_time, period, threshold, step_m, levels)
    # a goal that is not driven towards is not arrived at
    distance = target_distance if abs(detour) <= resolution else np.inf
    outcome, index, speed, turned = choose_direction(
        velocity, pending, target_bearing + detour, distance, side, limits, use_velocity, directions, units,
        profile, fine, coarse, smallest, moving, time_to_contact,
    )  # fmt: skip
    if outcome == 0 and abs(turned) > resolution:
        detour += turned
        while abs(detour) > MAX_TURNED_RAD:
            detour -= math.copysign(2.0 * math.pi, detour)
    return outcome, index, speed, detour
