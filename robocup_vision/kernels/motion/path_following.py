"""Compiled path following: the controller's command, and the clearance along the path from an uncertain pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.motion.trajectories import predict_position, predict_velocity

Pair = tuple[float, float]

# distance, metres, at which the robot is back on the path; and time, seconds, after which the return is given up
_BACK_M, _LATEST_S = 0.01, 3.0
# greatest delay of the robot when it comes to rest
_LATE_S = 0.1


class Start(NamedTuple):
    """Estimated state of a robot.

    place, velocity, pending : m; m/s; and the command that it obeys until the next one, m/s.
    covariance : (3, 3) float64 of its pose.
    """

    place: Pair
    velocity: Pair
    pending: Pair
    covariance: FloatArray


class Following(NamedTuple):
    """Parameters of path following: speed, m/s; look-ahead distance, m; limits and periods, SI units.

    until_look : time until the next look, s; odometry : errors along and across the motion as ratios of its length.
    """

    speed: float
    ahead_m: float
    acceleration: float
    dead_time: float
    period: float
    until_look: float
    odometry: Pair


@compiled(error_model="numpy")
def nearest_on_path(path: FloatArray, place: Pair) -> tuple[float, float, float]:
    """Return (arc length, distance, length of the whole path), metres, of the path's point nearest to `place`.

    path : (P, 2) float64, m, P at least 2.
    """
    nearest, arc, length = np.inf, 0.0, 0.0
    for k in range(path.shape[0] - 1):
        dx, dy = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
        size = math.sqrt(dx * dx + dy * dy)
        along = 0.0
        if size > 0.0:
            along = min(max(((place[0] - path[k, 0]) * dx + (place[1] - path[k, 1]) * dy) / (size * size), 0.0), 1.0)
        away = math.hypot(path[k, 0] + along * dx - place[0], path[k, 1] + along * dy - place[1])
        if away < nearest:
            nearest, arc = away, length + along * size
        length += size
    return arc, nearest, length


@compiled(error_model="numpy")
def point_on_path(path: FloatArray, arc: float) -> Pair:
    """Return the path's point at an arc length, clipped to its ends."""
    remaining = max(arc, 0.0)
    for k in range(path.shape[0] - 1):
        dx, dy = path[k + 1, 0] - path[k, 0], path[k + 1, 1] - path[k, 1]
        size = math.sqrt(dx * dx + dy * dy)
        if remaining <= size and size > 0.0:
            return path[k, 0] + remaining / size * dx, path[k, 1] + remaining / size * dy
        remaining -= size
    return path[-1, 0], path[-1, 1]


@compiled(error_model="numpy")
def follow(path: FloatArray, place: Pair, speed: float, ahead_m: float, acceleration: float) -> Pair:
    """Return the velocity to command, m/s, path frame: to the path's point `ahead_m` further on, to rest at its end."""
    arc, _, length = nearest_on_path(path, place)
    x, y = point_on_path(path, arc + ahead_m)
    dx, dy = x - place[0], y - place[1]
    away = math.sqrt(dx * dx + dy * dy)
    if away < 1e-9:
        return 0.0, 0.0
    # stop at the path's end: v late + v^2 / (2 a) = remaining distance
    remaining_m = max(length - arc, away) if arc + ahead_m >= length else length - arc
    allowed = min(speed, acceleration * (math.sqrt(_LATE_S * _LATE_S + 2.0 * remaining_m / acceleration) - _LATE_S))
    return allowed * dx / away, allowed * dy / away


@compiled(error_model="numpy")
def drive(
    place: Pair, velocity: Pair, pending: Pair, target: Pair, acceleration: float, dead_time: float, period: float
) -> tuple[Pair, Pair]:
    """Return place and velocity after a period: the old command is obeyed during the dead time, then the new one."""
    late = min(dead_time, period)
    place = predict_position(place, velocity, pending, acceleration, late)
    velocity = predict_velocity(velocity, pending, acceleration, late)
    place = predict_position(place, velocity, target, acceleration, period - late)
    return place, predict_velocity(velocity, target, acceleration, period - late)


@compiled(error_model="numpy")
def spread(covariance: FloatArray, odometry: Pair, moved: Pair) -> tuple[float, float, float]:
    """Return the covariance (xx, xy, yy), square metres, of the place after a motion by odometry.

    covariance : (3, 3) float64 of the pose before; odometry : errors as fractions of the way, along and across;
    moved : m.
    """
    dx, dy = moved
    along, aside = odometry[0] * odometry[0], odometry[1] * odometry[1]
    turn = covariance[2, 2]
    xx = covariance[0, 0] - 2.0 * dy * covariance[0, 2] + dy * dy * (turn + aside) + dx * dx * along
    yy = covariance[1, 1] + 2.0 * dx * covariance[1, 2] + dx * dx * (turn + aside) + dy * dy * along
    xy = covariance[0, 1] + dx * covariance[0, 2] - dy * covariance[1, 2] + dx * dy * (along - turn - aside)
    return xx, xy, yy


@compiled(error_model="numpy")
def _toward(disc: FloatArray, place: Pair, spread_m2: tuple[float, float, float]) -> tuple[float, float]:
    """Return (distance, m, variance along it, m2) to a disc from a place with covariance (xx, xy, yy)."""
    dx, dy = disc[0] - place[0], disc[1] - place[1]
    away = max(math.sqrt(dx * dx + dy * dy), 1e-9)
    ux, uy = dx / away, dy / away
    variance = ux * ux * (spread_m2[0] + disc[3]) + uy * uy * (spread_m2[2] + disc[5])
    return away, variance + 2.0 * ux * uy * (spread_m2[1] + disc[4])


@compiled(error_model="numpy")
def _turned(vector: Pair, angle: float) -> Pair:
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * vector[0] - sine * vector[1], sine * vector[0] + cosine * vector[1]


@compiled(error_model="numpy")
def _allowances(discs: FloatArray, start: Start, sigmas: float) -> FloatArray:
    """Return (M,) metres by which each disc is already too near, as motions away from it must remain allowed."""
    given = np.empty(discs.shape[0])
    now = (start.covariance[0, 0], start.covariance[0, 1], start.covariance[1, 1])
    for m in range(discs.shape[0]):
        away, variance = _toward(discs[m], start.place, now)
        given[m] = max(discs[m, 2] + sigmas * math.sqrt(variance) - away, 0.0)
    return given


@compiled(error_model="numpy")
def _clearance_until_look(
    path: FloatArray, start: Start, way: Following, discs: FloatArray, given: FloatArray, sigmas: float
) -> tuple[float, int, Pair, Pair, Pair]:
    """Simulate the motion until the next look and a stop; return (clearance, disc), place, velocity, command then."""
    least, disc = np.inf, -1
    place, velocity, command = start.place, start.velocity, start.pending
    steps = max(1, int(round(way.until_look / way.period)))
    viewpoint, velocity_then, command_then = place, velocity, command
    step = 0
    while True:
        target = follow(path, place, way.speed, way.ahead_m, way.acceleration) if step < steps else (0.0, 0.0)
        place, velocity = drive(place, velocity, command, target, way.acceleration, way.dead_time, way.period)
        command = target
        covariance = spread(start.covariance, way.odometry, (place[0] - start.place[0], place[1] - start.place[1]))
        for m in range(discs.shape[0]):
            away, variance = _toward(discs[m], place, covariance)
            clearance = away - discs[m, 2] - sigmas * math.sqrt(variance) + given[m]
            if clearance < least:
                least, disc = clearance, m
        step += 1
        if step == steps:
            viewpoint, velocity_then, command_then = place, velocity, command
        if least < 0.0 or (step > steps and velocity[0] == 0.0 and velocity[1] == 0.0):
            break
    return least, disc, viewpoint, velocity_then, command_then


@compiled(error_model="numpy")
def _clearance_of_return(
    path: FloatArray,
    worst: tuple[Pair, Pair, Pair],
    far: float,
    way: Following,
    discs: FloatArray,
    given: FloatArray,
    sigmas: float,
    best: tuple[float, int],
) -> tuple[float, int]:
    """Simulate the return to the path and a stop; return the least clearance and its disc, or `best` if that is less.

    worst : place, velocity and command at the look, at the end of an axis of the error ellipse; far : that axis, m.
    """
    least, disc = best
    place, velocity, command = worst
    step, is_back = 0, False
    while True:
        _, distance, _ = nearest_on_path(path, place)
        is_back = is_back or distance <= _BACK_M or step * way.period >= _LATEST_S
        target = (0.0, 0.0) if is_back else follow(path, place, way.speed, way.ahead_m, way.acceleration)
        place, velocity = drive(place, velocity, command, target, way.acceleration, way.dead_time, way.period)
        command = target
        step += 1
        for m in range(discs.shape[0]):
            away, variance = _toward(discs[m], place, (0.0, 0.0, 0.0))
            # variances add up; the part of the pose is already in the simulated start
            margin = sigmas * (math.sqrt(far * far + variance) - far)
            clearance = away - discs[m, 2] - margin + given[m]
            if clearance < least:
                least, disc = clearance, m
        if least < 0.0 or (is_back and velocity[0] == 0.0 and velocity[1] == 0.0):
            break
    return least, disc


@compiled(error_model="numpy")
def min_clearance(
    path: FloatArray, start: Start, way: Following, discs: FloatArray, sigmas: float
) -> tuple[float, int]:
    """Return the least clearance, metres, to a disc at this speed, and the index of that disc (-1 without discs).

    path : (P, 2) m.
    discs : (M, 6) x, y, sum of the radii of disc and robot, and the covariance (xx, xy, yy) of the centre.
    sigmas : number of standard deviations of the errors to keep clear of.

    Stops at the first negative clearance. Until the next look the robot relies on odometry: the motion is simulated
    from its estimated place, followed by a stop, and each disc must be `sigmas` standard deviations of the error away.
    At the look the robot may be at the worst point of its error ellipse (Miura 2004, section 6.2), with the heading
    error that is correlated with that point: from the ends of both axes the return to the path is simulated, followed
    by a stop. The error after the look is left to the next plan, which can still stop.
    """
    if discs.shape[0] == 0:
        return np.inf, -1
    given = _allowances(discs, start, sigmas)
    least, disc, viewpoint, velocity, command = _clearance_until_look(path, start, way, discs, given, sigmas)
    if least < 0.0:
        return least, disc
    covariance = start.covariance
    dx, dy = viewpoint[0] - start.place[0], viewpoint[1] - start.place[1]
    xx, xy, yy = spread(covariance, way.odometry, (dx, dy))
    # covariance of the heading's error with that of the place
    turned_x, turned_y = covariance[0, 2] - dy * covariance[2, 2], covariance[1, 2] + dx * covariance[2, 2]
    middle, half = 0.5 * (xx + yy), 0.5 * (xx - yy)
    longer = math.sqrt(half * half + xy * xy)
    axis = 0.5 * math.atan2(2.0 * xy, xx - yy)
    for case in range(4):
        cosine, sine = math.cos(axis + 0.5 * math.pi * case), math.sin(axis + 0.5 * math.pi * case)
        far = math.sqrt(max(middle + (longer if case % 2 == 0 else -longer), 1e-18))
        place = (viewpoint[0] + sigmas * far * cosine, viewpoint[1] + sigmas * far * sine)
        turn = sigmas * (turned_x * cosine + turned_y * sine) / far
        worst = (place, _turned(velocity, turn), _turned(command, turn))
        least, disc = _clearance_of_return(path, worst, far, way, discs, given, sigmas, (least, disc))
        if least < 0.0:
            break
    return least, disc
