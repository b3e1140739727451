"""Compiled trajectories of a robot with limited acceleration, and the times at which they leave the grown profile."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.mapping.grown_profile import BINS, COARSE, FINE, Profile, profile_bin

Pair = tuple[float, float]

# the diamond angle changes at most as fast as the bearing, so that a group is at least 4 / groups radians wide
FINE_SIN, FINE_TAN = math.sin(4.0 / FINE), math.tan(4.0 / FINE)
COARSE_SIN, COARSE_TAN = math.sin(4.0 / COARSE), math.tan(4.0 / COARSE)


@compiled(error_model="numpy")
def predict_position(start: Pair, velocity: Pair, target: Pair, acceleration: float, t: float) -> Pair:
    """Return (x, y), metres, t seconds after the robot begins to obey: eq. 12 with a corrected second branch.

    start : pair of float, m; velocity, target : pair of float, m/s.
    """
    dv_x, dv_y = target[0] - velocity[0], target[1] - velocity[1]
    settle = math.sqrt(dv_x * dv_x + dv_y * dv_y) / acceleration
    # 1/2 alpha t^2 dv/|dv| as 1/2 dv t^2/settle, which is defined for dv = 0
    if t < settle:
        gained = 0.5 * t * t / settle
        return start[0] + velocity[0] * t + gained * dv_x, start[1] + velocity[1] * t + gained * dv_y
    lost = 0.5 * settle
    return start[0] + target[0] * t - lost * dv_x, start[1] + target[1] * t - lost * dv_y


@compiled(error_model="numpy")
def predict_velocity(velocity: Pair, target: Pair, acceleration: float, t: float) -> Pair:
    """Return the velocity, m/s, t seconds after the robot begins to obey (eq. 10)."""
    dv_x, dv_y = target[0] - velocity[0], target[1] - velocity[1]
    size = math.sqrt(dv_x * dv_x + dv_y * dv_y)
    gained = acceleration * t
    if gained >= size:
        return target
    return velocity[0] + gained / size * dv_x, velocity[1] + gained / size * dv_y


@compiled(error_model="numpy")
def _sure_time(
    r: float, clear: float, out: float, inward: float, sideward: float, sine: float, tangent: float
) -> float:
    """Return the seconds for which a point at range r certainly stays within a wedge (sine, tangent) and its range.

    The speeds are multiplied by r. Written with one division, because divisions dominate its time.
    """
    over_range, over_wedge = out + sideward * sine, sideward + inward * tangent
    if clear * over_wedge < r * tangent * over_range:
        return r * clear / over_range
    return r * r * tangent / over_wedge


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
    """Return T_j (eq. 15), the last time that is certainly free before the trajectory leaves the profile; inf if never.

    The next sample is as late as the profile's minima nearby certainly allow, at least `step_m` on. The contact is then
    bracketed to a tenth of that from the free side, because a late T_j is a collision.

    The velocity changes straight towards its target, so that no component exceeds the greater of its present and target
    values. With outward speed u, inward speed d and sideward speed w bounded like that, the bearing changes by less
    than phi while w t <= (r - d t) tan(phi), and until then the range grows by at most (u + w sin(phi)) t.
    """
    fastest = math.sqrt(max(velocity[0] ** 2 + velocity[1] ** 2, target[0] ** 2 + target[1] ** 2))
    if fastest == 0.0:
        return np.inf
    dv_x, dv_y = target[0] - velocity[0], target[1] - velocity[1]
    size = math.sqrt(dv_x * dv_x + dv_y * dv_y)
    push = acceleration / size if size > 0.0 else 0.0
    settle = size / acceleration
    lag = 0.5 * settle
    least = step_m / fastest
    slowness = 1.0 / fastest
    free = 0.0
    # the start is not tested, because a robot in contact may leave
    t = min(max((smallest - math.sqrt(start[0] * start[0] + start[1] * start[1])) * slowness, least), horizon)
    while True:
        # predict_position with constant terms computed once, and with the velocity
        if t < settle:
            change = push * t
            gained = 0.5 * change * t
            x, y = start[0] + velocity[0] * t + gained * dv_x, start[1] + velocity[1] * t + gained * dv_y
            v_x, v_y = velocity[0] + change * dv_x, velocity[1] + change * dv_y
        else:
            x, y = (
                start[0] + velocity[0] * lag + target[0] * (t - lag),
                start[1] + velocity[1] * lag + target[1] * (t - lag),
            )
            v_x, v_y = target
        r = math.sqrt(x * x + y * y)
        later = least
        if r > 1e-12:
            index = profile_bin(x, y)
            if r >= profile.ranges[index]:
                break
            out_now, out_then = v_x * x + v_y * y, target[0] * x + target[1] * y
            out = max(out_now, out_then, 0.0)
            inward = max(-out_now, -out_then, 0.0)
            sideward = max(abs(v_y * x - v_x * y), abs(target[1] * x - target[0] * y)) + 1e-12
            clear_coarse = profile.coarse[index // (BINS // COARSE)] - r
            clear_fine = profile.fine[index // (BINS // FINE)] - r
            later = max(
                later,
                (smallest - r) * slowness,
                _sure_time(r, clear_coarse, out, inward, sideward, COARSE_SIN, COARSE_TAN),
                _sure_time(r, clear_fine, out, inward, sideward, FINE_SIN, FINE_TAN),
            )
        free = t
        if t >= horizon:
            return np.inf
        t = min(t + later, horizon)
    hit = t
    while (hit - free) * fastest > 0.1 * step_m:
        t = 0.5 * (free + hit)
        x, y = predict_position(start, velocity, target, acceleration, t)
        r = math.sqrt(x * x + y * y)
        if r > 1e-12 and r >= profile.ranges[profile_bin(x, y)]:
            hit = t
        else:
            free = t
    return free
