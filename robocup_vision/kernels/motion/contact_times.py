"""Compiled times at which trajectories leave the grown profile, of many commands in parallel lanes.

A lane that has ended takes the next command, so that few long trajectories do not delay many short ones. The loops over
lanes have neither branches nor look-ups, so that they vectorise.

The velocity changes straight towards its target, so that no component exceeds the greater of its present and target
values. With outward speed u, inward speed d and sideward speed w bounded like that, the bearing changes by less than
phi while w t <= (r - d t) tan(phi), and until then the range grows by at most (u + w sin(phi)) t.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import FloatArray, UInt32Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.mapping.grown_profile import BINS, COARSE, FINE, Profile
from robocup_vision.kernels.motion.trajectories import Pair

# the diamond angle changes at most as fast as the bearing, so that a group is at least 4 / groups radians wide
FINE_SIN, FINE_TAN = math.sin(4.0 / FINE), math.tan(4.0 / FINE)
COARSE_SIN, COARSE_TAN = math.sin(4.0 / COARSE), math.tan(4.0 / COARSE)
LANES = 16
# rows of a command: velocity now and commanded, end of the horizon, the greater speed and its inverse, time at which
# the command is reached, change of velocity per second as a ratio, shortest step
VX, VY, TX, TY, END, FASTEST, SLOWNESS, SETTLE, PUSH, LEAST = range(10)
# rows of its state: last free time (inf: no contact), present time, whether it is still running
FREE, TIME, RUNS = range(10, 13)
COMMAND = 13
# rows of place and velocity at the present time, and of the profile there
X, Y, NOW_X, NOW_Y, RANGE, NEAR_COARSE, NEAR_FINE = range(13, 20)
ROWS = 20
PER_COARSE, PER_FINE = np.uint32(BINS // COARSE), np.uint32(BINS // FINE)
LAST_BIN = np.uint32(BINS - 1)


@compiled(error_model="numpy")
def contact_times(
    start: Pair,
    velocities: FloatArray,
    targets: FloatArray,
    acceleration: float,
    horizons: FloatArray,
    step_m: float,
    profile: Profile,
    smallest: float,
    out: FloatArray,
) -> None:
    """Fill out (N,) with T_j (eq. 15), the last time that is certainly free before a trajectory leaves the profile.

    The next sample is as late as the profile's minima nearby certainly allow, at least `step_m` on. The contact is then
    bracketed to a tenth of that from the free side, because a late T_j is a collision.

    start, acceleration : as in `predict_position`. The start is not tested, because a robot in contact may leave.
    velocities, targets : (2, N) present and commanded velocity, m/s.
    horizons : (N,) lengths of the trajectories, seconds.
    step_m : sample distance close to an obstacle.
    profile, smallest : from `grow_profile`.
    out : (N,); written: seconds; inf: no contact within the horizon.
    """
    count = out.shape[0]
    commands = np.empty((COMMAND, count))
    _prepare(start, velocities, targets, acceleration, horizons, step_m, smallest, commands)
    lanes, bins, job = np.zeros((ROWS, LANES)), np.zeros(LANES, np.uint32), np.full(LANES, -1)
    given, running, left = 0, 0, 0
    while given < count or left > 0:
        if left < running or running == 0:
            running = 0
            for n in range(LANES):
                if lanes[RUNS, n] > 0.0:
                    running += 1
                    continue
                if job[n] >= 0:
                    commands[FREE, job[n]], commands[TIME, job[n]] = lanes[FREE, n], lanes[TIME, n]
                    job[n] = -1
                if given < count:
                    for row in range(COMMAND):
                        lanes[row, n] = commands[row, given]
                    job[n] = given
                    given += 1
                    running += 1
        left = _step(start, profile, smallest, lanes, bins)
    for n in range(LANES):
        if job[n] >= 0:
            commands[FREE, job[n]], commands[TIME, job[n]] = lanes[FREE, n], lanes[TIME, n]
    _bracket(start, 0.1 * step_m, profile, commands, out)


@compiled(error_model="numpy")
def contact_time(
    start: Pair,
    velocity: Pair,
    target: Pair,
    acceleration: float,
    horizon: float,
    step_m: float,
    profile: Profile,
    smallest: float,
) -> float:
    """Return the time to contact of one command; parameters as in `contact_times`."""
    velocities, targets, horizons, out = np.empty((2, 1)), np.empty((2, 1)), np.empty(1), np.empty(1)
    velocities[0, 0], velocities[1, 0] = velocity
    targets[0, 0], targets[1, 0] = target
    horizons[0] = horizon
    contact_times(start, velocities, targets, acceleration, horizons, step_m, profile, smallest, out)
    return float(out[0])


@compiled(error_model="numpy")
def _prepare(
    start: Pair,
    velocities: FloatArray,
    targets: FloatArray,
    acceleration: float,
    horizons: FloatArray,
    step_m: float,
    smallest: float,
    commands: FloatArray,
) -> None:
    """Fill commands (COMMAND, N)."""
    away = math.sqrt(start[0] * start[0] + start[1] * start[1])
    for n in range(horizons.shape[0]):
        v_x, v_y, target_x, target_y = velocities[0, n], velocities[1, n], targets[0, n], targets[1, n]
        fastest = math.sqrt(max(v_x * v_x + v_y * v_y, target_x * target_x + target_y * target_y))
        dv_x, dv_y = target_x - v_x, target_y - v_y
        size = math.sqrt(dv_x * dv_x + dv_y * dv_y)
        slowness, least = 1.0 / fastest, step_m / fastest
        commands[VX, n], commands[VY, n], commands[TX, n], commands[TY, n] = v_x, v_y, target_x, target_y
        commands[END, n], commands[FASTEST, n], commands[SLOWNESS, n] = horizons[n], fastest, slowness
        commands[SETTLE, n], commands[PUSH, n] = size / acceleration, acceleration / size if size > 0.0 else 0.0
        commands[LEAST, n] = least
        moves = fastest > 0.0
        commands[FREE, n] = 0.0 if moves else np.inf
        commands[TIME, n] = min(max((smallest - away) * slowness, least), horizons[n]) if moves else 0.0
        commands[RUNS, n] = 1.0 if moves else 0.0


@compiled(error_model="numpy", inline="always")
def _bin(x: float, y: float) -> np.uint32:
    """`profile_bin` without branches; any bin at (0, 0)."""
    size = abs(x) + abs(y)
    along = y / (size if size > 0.0 else 1.0)
    along = 2.0 - along if x < 0.0 else along + 4.0 if along < 0.0 else along
    return np.uint32(np.int32(along * (0.25 * BINS))) & LAST_BIN


@compiled(error_model="numpy", inline="always")
def _sure_time(
    r: float, clear: float, out: float, inward: float, sideward: float, sine: float, tangent: float
) -> float:
    """Return the seconds for which a point at range r certainly stays within a wedge (sine, tangent) and its range.

    The speeds are multiplied by r. Written with one division, because divisions dominate its time.
    """
    over_range, over_wedge = out + sideward * sine, sideward + inward * tangent
    by_range = clear * over_wedge < r * tangent * over_range
    return float((r * clear if by_range else r * r * tangent) / (over_range if by_range else over_wedge))


@compiled(error_model="numpy", inline="always")
def _step(start: Pair, profile: Profile, smallest: float, lanes: FloatArray, bins: UInt32Array) -> int:
    """Test each lane at its time, and advance it; returns the number of lanes still running."""
    for n in range(LANES):
        t, settle = lanes[TIME, n], lanes[SETTLE, n]
        v_x, v_y, target_x, target_y = lanes[VX, n], lanes[VY, n], lanes[TX, n], lanes[TY, n]
        dv_x, dv_y = target_x - v_x, target_y - v_y
        change, lag = lanes[PUSH, n] * t, 0.5 * settle
        gained = 0.5 * change * t
        is_settling = t < settle
        x = start[0] + v_x * t + gained * dv_x if is_settling else start[0] + v_x * lag + target_x * (t - lag)
        y = start[1] + v_y * t + gained * dv_y if is_settling else start[1] + v_y * lag + target_y * (t - lag)
        lanes[X, n], lanes[Y, n] = x, y
        lanes[NOW_X, n] = v_x + change * dv_x if is_settling else target_x
        lanes[NOW_Y, n] = v_y + change * dv_y if is_settling else target_y
        bins[n] = _bin(x, y)
    for n in range(LANES):
        lanes[RANGE, n] = profile.ranges[bins[n]]
        lanes[NEAR_COARSE, n] = profile.coarse[bins[n] // PER_COARSE]
        lanes[NEAR_FINE, n] = profile.fine[bins[n] // PER_FINE]
    left = 0
    for n in range(LANES):
        x, y, v_x, v_y = lanes[X, n], lanes[Y, n], lanes[NOW_X, n], lanes[NOW_Y, n]
        target_x, target_y, t = lanes[TX, n], lanes[TY, n], lanes[TIME, n]
        r = math.sqrt(x * x + y * y)
        is_away = r > 1e-12
        hits = is_away & (r >= lanes[RANGE, n])
        out_now, out_then = v_x * x + v_y * y, target_x * x + target_y * y
        out = max(out_now, out_then, 0.0)
        inward = max(-out_now, -out_then, 0.0)
        sideward = max(abs(v_y * x - v_x * y), abs(target_y * x - target_x * y)) + 1e-12
        clear_coarse, clear_fine = lanes[NEAR_COARSE, n] - r, lanes[NEAR_FINE, n] - r
        later = max(
            (smallest - r) * lanes[SLOWNESS, n],
            _sure_time(r, clear_coarse, out, inward, sideward, COARSE_SIN, COARSE_TAN),
            _sure_time(r, clear_fine, out, inward, sideward, FINE_SIN, FINE_TAN),
        )
        later = max(lanes[LEAST, n], later if is_away else 0.0)
        runs, is_over = lanes[RUNS, n] > 0.0, t >= lanes[END, n]
        goes_on = runs & (not hits) & (not is_over)
        ends = runs & (not hits) & is_over
        lanes[FREE, n] = t if goes_on else np.inf if ends else lanes[FREE, n]
        lanes[TIME, n] = min(t + later, lanes[END, n]) if goes_on else t
        lanes[RUNS, n] = 1.0 if goes_on else 0.0
        left += 1 if goes_on else 0
    return left


@compiled(error_model="numpy")
def _bracket(start: Pair, apart_m: float, profile: Profile, commands: FloatArray, out: FloatArray) -> None:
    """Bisect the time between the last free time and the contact of each command until the way between is short."""
    lanes, bins = np.zeros((ROWS, LANES)), np.zeros(LANES, np.uint32)
    count = out.shape[0]
    for first in range(0, count, LANES):
        size = min(LANES, count - first)
        for row in range(COMMAND):
            for n in range(size):
                lanes[row, n] = commands[row, first + n]
        left = 1
        while left > 0:
            left = _halve(start, apart_m, profile, lanes, bins)
        for n in range(size):
            out[first + n] = lanes[FREE, n]


@compiled(error_model="numpy", inline="always")
def _halve(start: Pair, apart_m: float, profile: Profile, lanes: FloatArray, bins: UInt32Array) -> int:
    """Bisect once in each lane; returns the number of lanes that were not finished."""
    for n in range(LANES):
        t, settle = 0.5 * (lanes[FREE, n] + lanes[TIME, n]), lanes[SETTLE, n]
        v_x, v_y, target_x, target_y = lanes[VX, n], lanes[VY, n], lanes[TX, n], lanes[TY, n]
        dv_x, dv_y = target_x - v_x, target_y - v_y
        gained, lost = 0.5 * t * t / settle, 0.5 * settle
        is_settling = t < settle
        x = start[0] + v_x * t + gained * dv_x if is_settling else start[0] + target_x * t - lost * dv_x
        y = start[1] + v_y * t + gained * dv_y if is_settling else start[1] + target_y * t - lost * dv_y
        # without a contact the time is infinite
        is_known = t < np.inf
        lanes[X, n] = math.sqrt(x * x + y * y)
        bins[n] = _bin(x if is_known else 0.0, y if is_known else 0.0)
    for n in range(LANES):
        lanes[RANGE, n] = profile.ranges[bins[n]]
    left = 0
    for n in range(LANES):
        free, hit, r = lanes[FREE, n], lanes[TIME, n], lanes[X, n]
        is_apart = (hit - free) * lanes[FASTEST, n] > apart_m
        hits, t = (r > 1e-12) & (r >= lanes[RANGE, n]), 0.5 * (free + hit)
        lanes[FREE, n] = t if is_apart & (not hits) else free
        lanes[TIME, n] = t if is_apart & hits else hit
        left += 1 if is_apart else 0
    return left
