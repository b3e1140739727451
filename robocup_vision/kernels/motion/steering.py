"""Compiled choice of a velocity command: trajectories are tested in the grown profile, and detours are remembered."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from robocup_vision.arrays import FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.algebra.copies import copy_vector
from robocup_vision.kernels.mapping.grown_profile import Profile, Sectors, grow_profile, measure_sectors, profile_bin
from robocup_vision.kernels.motion.contact_times import contact_time, contact_times
from robocup_vision.kernels.motion.moving_contact import moving_contact_then_stop, moving_contact_time
from robocup_vision.kernels.motion.trajectories import predict_position, predict_velocity

Pair = tuple[float, float]
Outcome = tuple[int, int, float, float]


class Motion(NamedTuple):
    """Present velocity of the robot, and the command that it obeys during the dead time; m/s."""

    velocity: Pair
    pending: Pair


class Target(NamedTuple):
    """Target of the motion.

    bearing, distance : radians; metres, inf if unknown or if the target is not in that direction.
    turn : in `steer` the detour, radians to the left of the target's bearing; in `choose_direction` the preferred side,
    -1, 0 or 1.
    """

    bearing: float
    distance: float
    turn: float


class Rules(NamedTuple):
    """The robot's limits and the settings of steering, see `SteeringSettings`.

    speed, acceleration, dead_time : m/s, m/s^2, s.
    period, threshold, step_m : interval of commands, s; the paper's T_th, derived if negative; sample distance.
    levels : number of speeds that are tested, each half of the one before.
    use_velocity : if false, the present velocity is assumed to equal the tested one.
    away_rad, other_side_rad, max_detour_rad : bounds of detours.
    """

    speed: float
    acceleration: float
    dead_time: float
    period: float
    threshold: float
    step_m: float
    levels: int
    use_velocity: bool
    away_rad: float
    other_side_rad: float
    max_detour_rad: float


class Directions(NamedTuple):
    """Directions that are tested.

    angles, units : (J,), (J, 2) float64, radians, within [0, 2 pi), and unit vectors.
    time_to_contact : (J,) float64; written: T_j at the top speed.
    """

    angles: FloatArray
    units: FloatArray
    time_to_contact: FloatArray


class Scan(NamedTuple):
    """Free ranges of a view.

    bearing, range_m : (J,) float64, radians; metres.
    known_bearing : (J,) float64; written: bearings to which `sectors` belongs.
    sectors : written if the bearings have changed.
    """

    bearing: FloatArray
    range_m: FloatArray
    known_bearing: FloatArray
    sectors: Sectors


class Start(NamedTuple):
    """State at the end of the dead time, and the time of a contact before that; m, m/s, s."""

    position: Pair
    velocity: Pair
    coasted: float


@compiled(error_model="numpy")
def unwind(detour: float, way_m: float, radius_m: float) -> float:
    """Return the rest of a detour (radians, signed) after driving back on an arc of the radius for some way."""
    rest = max(abs(detour) - way_m / radius_m, 0.0)
    return math.copysign(rest, detour)


@compiled(error_model="numpy")
def _coast(motion: Motion, rules: Rules, profile: Profile, smallest: float, moving: FloatArray) -> Start:
    """Predict the motion during the dead time, which the new command cannot change.

    Parameters as in `choose_direction`.
    """
    here = (0.0, 0.0)
    velocity, pending = motion.velocity, motion.pending
    acceleration, dead_time, step_m = rules.acceleration, rules.dead_time, rules.step_m
    coasted = contact_time(here, velocity, pending, acceleration, dead_time, step_m, profile, smallest)
    coasted = min(coasted, moving_contact_time(here, velocity, pending, acceleration, 0.0, dead_time, step_m, moving))
    position = predict_position(here, velocity, pending, acceleration, dead_time)
    return Start(position, predict_velocity(velocity, pending, acceleration, dead_time), coasted)


class Commands(NamedTuple):
    """Velocities to test and their contacts; the columns beyond the tested number are not used.

    direction, velocities : (J,) int64, index of the direction of each; (2, J) float64, m/s.
    times, needed : (J,) float64; written: time of the first contact, and least time of a safe one, seconds from now.
    meets : (J,) float64; written: time of contact with a moving disc, seconds from the end of the dead time.
    """

    direction: Int64Array
    velocities: FloatArray
    times: FloatArray
    needed: FloatArray
    meets: FloatArray


@compiled(error_model="numpy", inline="always")
def _try_commands(
    start: Start,
    tried: int,
    speed: float,
    rules: Rules,
    profile: Profile,
    smallest: float,
    moving: FloatArray,
    commands: Commands,
) -> None:
    """Predict the first `tried` commands, all of one speed (m/s): Steps 3 and 4 of the paper.

    Fills their `times`, `needed` and `meets`.
    """
    acceleration, dead_time, period, step_m = rules.acceleration, rules.dead_time, rules.period, rules.step_m
    targets, times, needed, meets = commands.velocities, commands.times, commands.needed, commands.meets
    present, horizons = targets.copy(), np.empty(tried)
    position, begin = (0.0, 0.0), 0.0
    if rules.use_velocity:
        position, begin = start.position, dead_time
        present[0], present[1] = start.velocity
    for n in range(tried):
        settle = math.sqrt((targets[0, n] - present[0, n]) ** 2 + (targets[1, n] - present[1, n]) ** 2) / acceleration
        needed[n] = rules.threshold
        if needed[n] < 0.0:
            needed[n] = 2.0 * dead_time + period + settle + 0.5 * speed / acceleration
        horizons[n], meets[n] = max(1.1 * needed[n] - begin, 0.0), np.inf
    if rules.use_velocity and start.coasted < np.inf:
        times[:tried] = start.coasted
        return
    contact_times(position, present, targets, acceleration, horizons, step_m, profile, smallest, times[:tried])
    for n in range(tried):
        times[n] += begin
    if not rules.use_velocity or moving.shape[0] == 0:
        return
    velocity = start.velocity
    for n in range(tried):
        target = targets[0, n], targets[1, n]
        settle = math.sqrt((target[0] - velocity[0]) ** 2 + (target[1] - velocity[1]) ** 2) / acceleration
        # safe if it can be executed completely, or given up at the next decision, and then stopped
        carried = settle + dead_time + period
        meets[n] = min(
            moving_contact_then_stop(position, velocity, target, acceleration, dead_time, carried, step_m, moving),
            moving_contact_then_stop(position, velocity, target, acceleration, dead_time, period, step_m, moving),
        )
        times[n] = min(times[n], dead_time + meets[n])


@compiled(error_model="numpy")
def _passes_target(start: Start, target: Pair, speed: float, t: float, distance: float, rules: Rules) -> bool:
    """Whether a contact at time t, straight towards a target, is beyond the target and the stopping distance."""
    if not (distance < np.inf and t >= rules.dead_time):
        return False
    if rules.use_velocity:
        after = t - rules.dead_time
        x, y = predict_position(start.position, start.velocity, target, rules.acceleration, after)
    else:
        x, y = target[0] * t, target[1] * t
    return math.hypot(x, y) >= distance + 0.5 * speed * speed / rules.acceleration


@compiled(error_model="numpy")
def _latest_contact(
    motion: Motion,
    start: Start,
    speed: float,
    rules: Rules,
    directions: Directions,
    profile: Profile,
    smallest: float,
    moving: FloatArray,
) -> Outcome:
    """Return the outcome if no direction is safe: brake, or, if that touches, the command with the latest contact.

    Parameters and result as in `choose_direction`.
    """
    here = (0.0, 0.0)
    acceleration, dead_time, step_m = rules.acceleration, rules.dead_time, rules.step_m
    position, velocity = start.position, start.velocity
    latest = start.coasted
    if latest == np.inf or not rules.use_velocity:
        stop = math.hypot(velocity[0], velocity[1]) / acceleration if rules.use_velocity else 0.0
        latest = dead_time + contact_time(position, velocity, here, acceleration, stop, step_m, profile, smallest)
        meets = moving_contact_time(position, velocity, here, acceleration, dead_time, stop, step_m, moving)
        latest = min(latest, dead_time + meets)
    # contacts within the resolution count as equal, because braking touches more softly
    latest += 0.1 * step_m / max(speed, math.hypot(motion.velocity[0], motion.velocity[1]), step_m)
    chosen = -1
    for j in range(directions.angles.shape[0]):
        if directions.time_to_contact[j] > latest:
            chosen, latest = j, directions.time_to_contact[j]
    return (1, -1, 0.0, 0.0) if chosen < 0 else (2, chosen, speed, 0.0)


@compiled(error_model="numpy")
def choose_direction(
    motion: Motion,
    wanted: Target,
    rules: Rules,
    directions: Directions,
    profile: Profile,
    smallest: float,
    moving: FloatArray,
) -> Outcome:
    """Predict every direction (paper's Steps 3 and 4) and choose one (Step 5); see `Steering` for the rule.

    directions : their times to contact are written.
    profile, smallest : from `grow_profile`.
    moving : (M, 8) as in `moving_contact_time`.

    Returns the outcome (0 a safe direction, 1 brake, 2 the command with the latest contact, if even braking touches),
    the index of the direction (-1 for braking), the speed, m/s, and the angle from the wanted bearing to the direction,
    radians to the left, within [-pi, pi).
    """
    speed = rules.speed
    count = directions.angles.shape[0]
    turn = 2.0 * math.pi
    resolution = math.pi / count * 1.001
    wanted_bearing = wanted.bearing % turn
    if wanted.distance < np.inf:
        lag = rules.acceleration * (rules.dead_time + rules.period)
        speed = min(speed, math.sqrt(lag * lag + 2.0 * rules.acceleration * wanted.distance) - lag)
    start = _coast(motion, rules, profile, smallest, moving)
    best, nearest, progress, best_turn, best_speed = -1, np.inf, -np.inf, 0.0, 0.0
    turns, deviations = np.empty(count), np.empty(count)
    for j in range(count):
        turned = directions.angles[j] - wanted_bearing
        if turned >= math.pi:
            turned -= turn
        elif turned < -math.pi:
            turned += turn
        turns[j], deviations[j] = turned, abs(turned)
        if turned * wanted.turn < 0.0 and deviations[j] > resolution:
            deviations[j] += rules.other_side_rad
    commands = Commands(
        np.empty(count, np.int64), np.empty((2, count)), np.empty(count), np.empty(count), np.empty(count)
    )
    for level in range(rules.levels):
        slower = speed * 0.5**level
        # no slower speed can make more progress than its own; directions that are no nearer are not tested at it
        if slower <= progress:
            break
        tried = 0
        for j in range(count):
            if level == 0 or deviations[j] <= nearest:
                commands.direction[tried] = j
                commands.velocities[0, tried] = slower * directions.units[j, 0]
                commands.velocities[1, tried] = slower * directions.units[j, 1]
                tried += 1
        _try_commands(start, tried, slower, rules, profile, smallest, moving, commands)
        if level == 0:
            copy_vector(commands.times, directions.time_to_contact)
        chosen, least, longest, least_turn = -1, nearest - 1e-9, 0.0, 0.0
        for n in range(tried):
            j, t = commands.direction[n], commands.times[n]
            turned, deviation = turns[j], deviations[j]
            if t < commands.needed[n] or commands.meets[n] < np.inf:
                target = commands.velocities[0, n], commands.velocities[1, n]
                if not (abs(turned) <= resolution and _passes_target(start, target, slower, t, wanted.distance, rules)):
                    continue
            if deviation < least - 1e-9 or (deviation < least + 1e-9 and t > longest):
                chosen, least, longest, least_turn = j, min(deviation, least), t, turned
        if chosen >= 0 and slower * math.cos(min(least, math.pi)) > progress:
            best, nearest, best_turn, best_speed = chosen, least, least_turn, slower
            progress = slower * math.cos(min(least, math.pi))
    if best >= 0:
        return 0, best, best_speed, best_turn
    return _latest_contact(motion, start, speed, rules, directions, profile, smallest, moving)


@compiled(error_model="numpy")
def steer(
    motion: Motion,
    target: Target,
    rules: Rules,
    directions: Directions,
    scan: Scan,
    radius_m: float,
    profile: Profile,
    moving: FloatArray,
) -> Outcome:
    """Run all steps in one call; the sectors are measured only if the bearings have changed.

    Takes the target with the detour, and returns the result of `choose_direction` with the new detour as last value;
    outcome -1 if the bearings do not ascend within one turn. `radius_m` is the robot's. The named tuples may be plain.
    """
    motion, target, rules, directions = Motion(*motion), Target(*target), Rules(*rules), Directions(*directions)
    profile = Profile(*profile)
    bearing, range_m, known_bearing, sectors = scan
    scan = Scan(bearing, range_m, known_bearing, Sectors(*sectors))
    detour = target.turn
    is_unchanged = True
    for k in range(scan.bearing.shape[0]):
        is_unchanged = is_unchanged and scan.bearing[k] == scan.known_bearing[k]
    if not is_unchanged:
        scan.known_bearing[:] = np.nan
        if not measure_sectors(scan.bearing, scan.sectors):
            return -1, -1, 0.0, detour
        copy_vector(scan.bearing, scan.known_bearing)
    smallest = grow_profile(scan.range_m, scan.sectors, radius_m, profile)
    resolution = math.pi / directions.angles.shape[0] * 1.001
    present = math.hypot(motion.velocity[0], motion.velocity[1])
    detour = unwind(detour, present * rules.period, max(radius_m, present * present / rules.acceleration))
    if target.distance < profile.ranges[profile_bin(math.cos(target.bearing), math.sin(target.bearing))]:
        detour = 0.0
    side = 0.0 if detour == 0.0 else math.copysign(1.0, detour)
    speed = rules.speed
    if abs(detour) > rules.away_rad:
        # slow enough to turn within its own length, so that it does not overshoot corners
        speed = min(speed, math.sqrt(rules.acceleration * 2.0 * radius_m))
    slower = Rules(
        speed, rules.acceleration, rules.dead_time, rules.period, rules.threshold, rules.step_m, rules.levels,
        rules.use_velocity, rules.away_rad, rules.other_side_rad, rules.max_detour_rad,
    )  # fmt: skip
    # during a detour the robot does not stop at the target's distance
    distance = target.distance if abs(detour) <= resolution else np.inf
    wanted = Target(target.bearing + detour, distance, side)
    outcome, index, speed, turned = choose_direction(motion, wanted, slower, directions, profile, smallest, moving)
    if outcome == 0 and abs(turned) > resolution:
        detour += turned
        while abs(detour) > rules.max_detour_rad:
            detour -= math.copysign(2.0 * math.pi, detour)
    return outcome, index, speed, detour
