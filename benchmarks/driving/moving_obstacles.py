"""Driving across the ways of robots that do not give way: steering with and without the obstacles' velocities.

A robot shuttles over 3 m for 20 s (--quick: 5 s) while six others cross its way to and fro at 0.3 to 1.0 m/s, blind to
it, on a field 4 m wide. It sees them as in tracking.py, by noisy ranges with misses and specks, 30 times a second;
`MovingObjects` tracks them. On ssl_2001, 1.5 m wide, four of them speed up or brake half of the time, which nothing
predicts: that row is no acceptance.
All ways of steering get the same ranges (the middle of three frames, as the player's). A contact is the robot's own
fault if it moves towards the other at more than 0.05 m/s when they touch: a standing robot that is run into is not to
blame. Legs are ways from one end to the other, so that nothing is won by standing still.
"""

from __future__ import annotations

import math
from argparse import Namespace
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.harness import Pool, Table, program, verdict
from benchmarks.worlds.crowd import LONGEST_M, Sensor
from field_models import Field, load_field
from robocup_vision.avoidance import SteadyFreeSpace, Steering, SteeringSettings
from robocup_vision.disc import Disc
from robocup_vision.geometry import Pose2
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.tracking import KnownFreeSpace, MovingObjects, ReturnDetector
from sim2d.players.driving.wheels import WheelVelocity
from sim2d.robot_link import CONTROL_PERIOD_S, Command, RobotLimits
from sim2d.world.world import World

LIMITS = RobotLimits(speed_mps=1.0)
SPEED_MPS, MARGIN_M = 0.6, 0.02
CROSSING_MPS = (0.3, 1.0)
AT_FAULT_MPS = 0.05
MAX_RATIO = 0.2
PLAIN, TRACKED, TOLD = METHODS = ("without velocities", "tracks", "true places and velocities")


@dataclass(frozen=True)
class Place:
    """Where it is driven."""

    name: str  #: for the table
    field: Field  #: the pitch
    others: int  #: how many cross
    lanes_m: float  #: half the length over which their ways lie


WIDE, NARROW = PLACES = (
    Place("4 m wide", load_field("msl_6x4"), 6, 1.1),
    Place("1.5 m wide", load_field("ssl_2001"), 4, 0.8),
)


@dataclass
class Outcome:
    """What happened in a run."""

    contacts: int = 0
    at_fault: int = 0
    legs: float = 0.0


class Crossing:
    """Drives to and fro across the field at a place `x_m` along it, towards +y (`side` 1) or -y (-1) first."""

    def __init__(self, width_m: float, x_m: float, speed_mps: float, side: float) -> None:
        self._x_m, self._speed_mps, self._side = x_m, speed_mps, side
        self._end_m = width_m / 2 - 0.15

    def command(self, pose: Pose2) -> Command:
        """Go on."""
        if pose.y_m * self._side > self._end_m - self._speed_mps**2 / (2 * LIMITS.acceleration_mps2):
            self._side = -self._side
        vx, vy = self._x_m - pose.x_m, self._side * self._speed_mps
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        return Command(c * vx + s * vy, c * vy - s * vx, 0.0)


def drive(job: tuple[Place, str, int, int, float]) -> Outcome:
    """Drive a run: where, by which method, of which seed and number, for how many seconds."""
    place, method, seed, run, seconds = job
    rng = np.random.default_rng([seed, run])
    field, others = place.field, place.others
    lanes = np.linspace(-place.lanes_m, place.lanes_m, others) + rng.uniform(-0.08, 0.08, others)
    crossings = [
        Crossing(field.width_m, x, float(rng.uniform(*CROSSING_MPS)), float(rng.choice((-1.0, 1.0))))
        for x in lanes.tolist()
    ]
    ends = place.lanes_m + 0.4
    starts = [
        Pose2(-ends, 0.0, 0.0),
        *(Pose2(x, float(rng.uniform(-0.35, 0.35)) * field.width_m, 0.0) for x in lanes.tolist()),
    ]
    world = World.course(field, (), starts, LIMITS, rng)
    sensor = Sensor(field, others, LIMITS.radius_m, CONTROL_PERIOD_S, rng)
    detector = ReturnDetector(KnownFreeSpace.of_field(field), LIMITS.radius_m, longest_m=LONGEST_M)
    objects, floor, wheels = MovingObjects(), SteadyFreeSpace(), WheelVelocity(LIMITS)
    steering = Steering(LIMITS.radius_m + MARGIN_M, replace(LIMITS, speed_mps=SPEED_MPS), SteeringSettings(step_m=0.01))
    side, touching = 1.0, np.zeros(others, dtype=bool)
    outcome = Outcome()
    began_m = starts[0].x_m
    velocity_before = (0.0, 0.0)
    while world.t_s < seconds:
        robots = world.state.robots
        truth, places = robots[0].pose, np.array([[r.pose.x_m, r.pose.y_m] for r in robots[1:]])
        velocities = np.array([r.velocity_mps for r in robots[1:]])
        away = places - (truth.x_m, truth.y_m)
        distance = np.hypot(*away.T)
        touched = distance < 2 * LIMITS.radius_m + 1e-3
        fresh = touched & ~touching
        # what the touch itself has done to the velocity does not count
        towards = away @ np.array(velocity_before) / distance
        velocity_before = robots[0].velocity_mps
        outcome.contacts += int(fresh.sum())
        outcome.at_fault += int((fresh & (towards > AT_FAULT_MPS)).sum())
        touching = touched | (touching & (distance < 2 * LIMITS.radius_m + 0.03))

        odometry = world.odometry(0)
        wheels.sense(odometry)
        range_m, _ = sensor.ranges(truth, places)
        robot = sensor.estimated(truth)
        tracks = objects.update(
            world.t_s, detector.in_profile(sensor.bearing_rad, range_m, robot, sensor.pose_covariance), robot,
            sensor.pose_covariance,
        )  # fmt: skip
        free = floor.update(FreeSpace(sensor.bearing_rad, range_m), odometry)
        moving: tuple[Disc, ...] = ()
        if method == TRACKED:
            moving = tuple(track.as_disc(robot, LIMITS.radius_m) for track in tracks)
        elif method == TOLD:
            at = truth.inverse().transform(places)
            speeds = Pose2(0.0, 0.0, -truth.theta_rad).transform(velocities)
            moving = tuple(
                Disc(p[0], p[1], LIMITS.radius_m, vx_mps=v[0], vy_mps=v[1])
                for p, v in zip(at.tolist(), speeds.tolist(), strict=True)
            )
        if side * robot.x_m > ends - 0.1:
            outcome.legs += 1
            side, began_m = -side, robot.x_m
            steering.forget()
        goal = robot.inverse().transform((side * ends, 0.0))
        command = steering.steer(
            free,
            wheels.now_mps,
            math.atan2(goal[1], goal[0]),
            float(np.hypot(*goal)),
            wheels.pending_mps,
            moving=moving,
        )
        wanted = (float(command.velocity_mps[0]), float(command.velocity_mps[1]))
        wheels.command(wanted)
        world.step({0: Command(*wanted), **{k + 1: c.command(robots[k + 1].pose) for k, c in enumerate(crossings)}})
    outcome.legs += max(side * (robot.x_m - began_m), 0.0) / (2 * ends - 0.1)
    return outcome


@program(pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    runs, seconds = (2, 5.0) if arguments.quick else (60, 20.0) if arguments.full else (16, 20.0)
    count = {WIDE.name: runs, NARROW.name: runs // 2}
    ways = [(place, method) for place in PLACES for method in METHODS]
    jobs = [(*way, arguments.seed, run, seconds) for way in ways for run in range(count[way[0].name])]
    outcomes = list(pool.map(drive, jobs))
    columns = "field      | steering: label | runs | own contacts: count | all: count | legs a run: score | verdict"
    table = Table(columns, name="contacts", samples=runs)
    for place in PLACES:
        without = 0
        for method in METHODS:
            own = [o for job, o in zip(jobs, outcomes, strict=True) if job[:2] == (place, method)]
            at_fault = sum(o.at_fault for o in own)
            without = at_fault if method == PLAIN else without
            ok = None
            if place is WIDE and method == TRACKED:
                ok = at_fault <= MAX_RATIO * without
            table.row(
                place.name, method, len(own), at_fault, sum(o.contacts for o in own),
                float(np.mean([o.legs for o in own])), None if ok is None else verdict(ok),
            )  # fmt: skip
