"""Runs of a robot for memory/pose_filter.py: driven, kidnapped, looked at, and which of its frames come when."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from field_models import load_field
from robocup_vision import NotLocated, PoseEstimate, Vision
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import OdometryNoise
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import CONTROL_PERIOD_S, Command, RobotLimits
from sim2d.sensors.match_camera import MATCH_SENSOR, MatchCamera
from sim2d.world.world import World

FIELD = load_field("ssl_2001")
LIMITS = RobotLimits()
SENSOR = replace(MATCH_SENSOR, noise_sigma=18.0, blur_px=0.9)
WARM_S = 1.0
KIDNAP_EVERY_S, PUSH_S = 4.0, 0.2
KINDS = ("carried", "turned", "pushed")
# seconds that frames which err together last
SPELL_S = 0.1


@dataclass(frozen=True)
class Step:
    """A control step: the truth, the odometry since the step before, and the estimate of the frame taken now."""

    t_s: float
    truth: Pose2
    odometry: Pose2
    estimate: PoseEstimate | NotLocated


@dataclass(frozen=True)
class Arrival:
    """A frame's pose, when it was taken, and the index of the step at which it comes."""

    index: int
    t_s: float
    estimate: PoseEstimate


class Wanderer:
    """Drives robots from place to place, by the truth."""

    def __init__(self, robots: int, rng: np.random.Generator) -> None:
        self._rng = rng
        self._reach = (FIELD.length_m / 2 - 0.2, FIELD.width_m / 2 - 0.2)
        self._plans = [self._plan(0.0) for _ in range(robots)]

    def _plan(self, t_s: float) -> tuple[tuple[float, float], float, float, float]:
        rng = self._rng
        place = (rng.uniform(-self._reach[0], self._reach[0]), rng.uniform(-self._reach[1], self._reach[1]))
        speed, turn, until_s = rng.uniform(0.2, 0.9), rng.uniform(-2.5, 2.5), t_s + rng.uniform(1.0, 4.0)
        halts = rng.random() < 0.2
        return place, 0.0 if halts else speed, 0.0 if halts else turn, until_s

    def commands(self, poses: Iterable[Pose2], t_s: float) -> dict[int, Command]:
        """Return each robot's command."""
        commands = {}
        for index, pose in enumerate(poses):
            place, speed, turn, until_s = self._plans[index]
            x, y = pose.inverse().transform(place).tolist()
            far = math.hypot(x, y)
            if t_s > until_s or (far < 0.1 and speed):
                self._plans[index] = self._plan(t_s)
            fraction = min(speed, 1.5 * far) / max(far, 1e-6)
            commands[index] = Command(fraction * x, fraction * y, turn)
        return commands


def record(seed: int, run: int, seconds: float, *, kidnaps: bool) -> tuple[list[Step], list[tuple[float, str]]]:
    """Drive, look, and return the steps of robot 0, and when what was done to it (from a push's end)."""
    rng = np.random.default_rng([seed, run, int(kidnaps)])
    starts = [Pose2(-0.8 + 0.5 * k, (-1) ** k * 0.3, rng.uniform(-3.0, 3.0)) for k in range(4)]
    world = World.course(FIELD, (), starts, LIMITS, rng)
    camera = sekimori_camera()
    eye = MatchCamera(FIELD, camera, LIMITS, rng, sensor=SENSOR)
    vision, wanderer = Vision(FIELD, camera), Wanderer(4, rng)
    steps: list[Step] = []
    done: list[tuple[float, str]] = []
    for index in range(round(seconds / CONTROL_PERIOD_S)):
        due = KIDNAP_EVERY_S * (len(done) + 1)
        # the odometry is the same before and after a hand
        odometry = world.odometry(0)
        if kidnaps and world.t_s >= due - 1e-6 and due + KIDNAP_EVERY_S <= seconds + 1e-6:
            done.append(hands_in(world, KINDS[(len(done) + run) % len(KINDS)], rng))
        state = world.state
        view = vision.look(eye.render(state, 0), state.t_s)
        steps.append(Step(state.t_s, state.robots[0].pose, odometry if index else Pose2(0.0, 0.0, 0.0), view.pose))
        world.step(wanderer.commands([robot.pose for robot in state.robots], state.t_s))
    return steps, done


def hands_in(world: World, kind: str, rng: np.random.Generator) -> tuple[float, str]:
    """Kidnap robot 0; return from when on it should be found again, and the kind."""
    pose, angle = world.state.robots[0].pose, rng.uniform(-math.pi, math.pi)
    if kind == "pushed":
        world.push(0, 0.25 * math.cos(angle), 0.25 * math.sin(angle), 0.3 * angle)
        return world.t_s + PUSH_S, kind
    if kind == "turned":
        turn = math.copysign(rng.uniform(0.5, 3.0), angle)
        world.place(0, Pose2(pose.x_m, pose.y_m, pose.theta_rad + turn))
    else:
        while True:
            there = Pose2(rng.uniform(-1.0, 1.0), rng.uniform(-0.55, 0.55), angle)
            others = [robot.pose for robot in world.state.robots[1:]]
            if all(there.error_to(other)[0] > 0.25 for other in others) and there.error_to(pose)[0] > 0.3:
                break
        world.place(0, there)
    return world.t_s, kind


def arrivals(steps: list[Step], condition: str, rng: np.random.Generator) -> list[Arrival]:
    """When which frame comes, and its estimate, under a condition."""
    found = []
    spell: tuple[int, Pose2 | None] = (-1, None)
    length = max(1, round(SPELL_S / CONTROL_PERIOD_S))
    telling_until, wrong_until = -1, -1
    for index, step in enumerate(steps):
        estimate, late = step.estimate, 0
        if not isinstance(estimate, PoseEstimate):
            continue
        if condition == "30 % missing" and rng.random() < 0.3:
            continue
        if condition == "3 Hz" and index % 10:
            continue
        if condition == "100 ms late":
            late = 3
        elif condition == "out of order":
            late = int(rng.integers(0, 7))
        elif condition == "open halves":
            if index > telling_until and rng.random() < 0.05 / length:
                telling_until = index + length - 1
                wrong_until = telling_until if rng.random() < 0.02 and step.t_s > WARM_S else -1
            if index <= telling_until or step.t_s < 0.1:
                estimate = estimate.half_turn() if index <= wrong_until else estimate
            else:
                estimate = estimate.half_turn() if rng.random() < 0.5 else estimate
                estimate = replace(estimate, candidates=(estimate.pose, estimate.pose.half_turn()))
        elif condition == "outliers" and step.t_s > 0.1:
            if index > spell[0] and rng.random() < 0.02:
                place = Pose2(rng.uniform(-1.0, 1.0), rng.uniform(-0.6, 0.6), rng.uniform(-3.0, 3.0))
                spell = (index + length - 1, place)
            if index <= spell[0] and spell[1] is not None:
                estimate = PoseEstimate(spell[1], estimate.covariance, estimate.inlier_ratio, estimate.residual_px)
        found.append(Arrival(index + late, step.t_s, estimate))
    # those of one step in the order in which they are looked at: a younger one may come first
    return sorted(found, key=lambda arrival: (arrival.index, -arrival.t_s))


def with_odometry(steps: list[Step], gain: float) -> list[Step]:
    """Return the steps with odometry that is too long or too short."""
    scaled = []
    for step in steps:
        x, y, theta = (gain * step.odometry.array).tolist()
        scaled.append(replace(step, odometry=Pose2(x, y, theta)))
    return scaled


def synthetic_steps(bias_ratio: float, bias_distance_m: float, seconds: float, rng: np.random.Generator) -> list[Step]:
    """Return the steps of a robot that wanders by itself, whose frames err as the model says."""
    std = np.array([0.003, 0.003, 0.002])
    steps, truth, slip, b = [], Pose2(0.0, 0.0, 0.0), np.zeros(3), rng.standard_normal(3)
    speed, heading, turn = 0.0, 0.0, 0.0
    dt = CONTROL_PERIOD_S
    step = Pose2(0.0, 0.0, 0.0)
    for index in range(round(seconds / dt)):
        if index % 45 == 0:
            speed, heading, turn = rng.uniform(0.0, 0.9), rng.uniform(-math.pi, math.pi), rng.uniform(-2.5, 2.5)
            back = math.atan2(-truth.y_m, -truth.x_m)
            heading = back - truth.theta_rad if math.hypot(truth.x_m, truth.y_m) > 1.0 else heading
        scale = rng.uniform(0.5, 2.0)
        error = scale * std * (math.sqrt(bias_ratio) * b + math.sqrt(1 - bias_ratio) * rng.standard_normal(3))
        x, y, theta = (truth.array + error).tolist()
        estimate = PoseEstimate(Pose2(x, y, theta), np.diag((scale * std) ** 2), 1.0, 0.0)
        steps.append(Step(index * dt, truth, step, estimate))
        kept = math.exp(-dt / 0.1)
        sizes = OdometryNoise().slip_ratio * np.array([speed, speed, math.hypot(turn, speed)])
        slip = kept * slip + math.sqrt(1 - kept**2) * sizes * rng.standard_normal(3)
        step = Pose2(speed * math.cos(heading) * dt, speed * math.sin(heading) * dt, turn * dt)
        pushed = np.sqrt(np.diag(OdometryNoise().push(dt))) * rng.standard_normal(3)
        dx, dy, da = (step.array + slip * dt + pushed).tolist()
        truth = truth.compose(Pose2(dx, dy, da))
        kept = math.exp(-speed * dt / bias_distance_m)
        b = kept * b + math.sqrt(1 - kept**2) * rng.standard_normal(3)
    return steps
