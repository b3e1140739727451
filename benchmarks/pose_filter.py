"""The pose filter in the 2D simulation, on real frames: against the last single estimate plus odometry, and an EKF.

WANDERING: runs of 20 s on ssl_2001 with four robots that drive from place to place, turning, at 0.2 to 0.9 m/s, with
halts; the frames of one are rendered 30 times a second (256 x 220, noise sigma 18, blur 0.9 px) and looked at by
`Vision`, each alone. All three methods get the same poses, covariances and odometry, and are judged at each control
step from 1 s on. "single": the newest frame's candidate nearest to what the one before led to, carried by odometry.
"EKF": filterpy's, with the same odometry noise and covariances, each frame taken as it comes (a late one carried to the
present by odometry). NEES: 3 degrees of freedom. "flips": runs in which the belief is ever nearer to the half turn of
the truth than to the truth. Conditions, all made from the same frames:
- every frame
- 30 % missing: at random; 3 Hz: one frame in ten
- late: all by 100 ms; out of order: by 0 to 200 ms at random
- open halves: one frame in twenty tells the half, spells of wrong ones (a twentieth of those, 0.1 s); first candidate at
  random
- outliers: one frame in fifty begins a spell (0.1 s) that shows another place, the same for the whole spell

KIDNAPPED: a robot that drives is carried elsewhere, turned by 0.5 to 3 rad, or pushed by 0.25 m in 0.2 s, unfelt, every
4 s. Recovery: from then (a push's end) until the belief is within 5 cm and 3 degrees and stays there for half a second.

SYNTHETIC: the errors of the frames drawn by the model, by how long they last, to see what NEES a wrong guess costs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import multiprocessing
import numpy as np
from harness import Table, finish, parse_arguments, percent, verdict

from field_models import load_field
from robocup_vision import NotLocated, PoseEstimate, Vision
from robocup_vision.geometry import FloatArray, Pose2, half_turn_covariance, wrap_angle
from robocup_vision.localization.pose_filter import OdometryNoise, PoseFilter
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.match_camera import MATCH_SENSOR, MatchCamera
from sim2d.robot_link import Command, RobotLimits
from sim2d.world import CONTROL_PERIOD_S, World

try:
    from filterpy.kalman import ExtendedKalmanFilter
except ImportError:
    ExtendedKalmanFilter = None

FIELD = load_field("ssl_2001")
LIMITS = RobotLimits()
SENSOR = replace(MATCH_SENSOR, noise_sigma=18.0, blur_px=0.9)
WORKERS = 2
RUN_S, WARM_S = 20.0, 1.0
# runs of wandering, of kidnapping, synthetic ones of each kind
QUICK, DEFAULT, FULL = (4, 3, 4), (20, 10, 20), (200, 40, 100)
MOST_RATIO, NEES_BOUNDS, MOST_RECOVERY_S = 0.6, (1.5, 6.0), 1.0
NEES_95 = 7.815
NEAR_M, NEAR_RAD, STAYS_S = 0.05, math.radians(3.0), 0.5
KIDNAP_EVERY_S, PUSH_S = 4.0, 0.2
KINDS = ("carried", "turned", "pushed")
CONDITIONS = ("every frame", "30 % missing", "3 Hz", "100 ms late", "out of order", "open halves", "outliers")
METHODS = ("single", "EKF", "filter")


@dataclass(frozen=True)
class Step:
    """A control step: the truth, the odometry since the step before, and what the frame taken now tells."""

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


class Follower(Protocol):
    """What is compared."""

    def predict(self, odometry: Pose2, t_s: float) -> None: ...

    def update(self, estimate: PoseEstimate, t_s: float) -> None: ...

    @property
    def belief(self) -> PoseEstimate | NotLocated: ...


class Single:
    """The last single estimate, carried on by odometry."""

    def __init__(self) -> None:
        self._clock = PoseFilter()
        self._pose: Pose2 | None = None
        self._covariance = np.zeros((3, 3))

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Carry it."""
        self._clock.predict(odometry, t_s)
        if self._pose is not None:
            self._pose = self._pose.compose(odometry)

    def update(self, estimate: PoseEstimate, t_s: float) -> None:
        """Forget what was before."""
        motion = self._clock.motion_since(t_s)
        if motion is None:
            return
        self._pose, self._covariance = nearest(estimate, motion, self._pose)

    @property
    def belief(self) -> PoseEstimate | NotLocated:
        """The pose, with the covariance the frame gave."""
        if self._pose is None:
            return NotLocated("no frame yet")
        return PoseEstimate(self._pose, self._covariance, 0.0, 0.0)


class Ekf:
    """filterpy's extended Kalman filter over the pose, odometry as its control."""

    def __init__(self) -> None:
        self._clock, self._noise = PoseFilter(), OdometryNoise()
        self._filter = None
        self._t_s = 0.0

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Carry it."""
        self._clock.predict(odometry, t_s)
        if self._filter is not None:
            ekf = self._filter
            theta = float(ekf.x[2])
            c, s = math.cos(theta), math.sin(theta)
            jacobian = np.eye(3)
            jacobian[:2, 2] = (-s * odometry.x_m - c * odometry.y_m, c * odometry.x_m - s * odometry.y_m)
            turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            moved = Pose2(*ekf.x).compose(odometry)
            ekf.F = jacobian
            ekf.Q = turn @ white_noise(self._noise, odometry, t_s - self._t_s) @ turn.T
            ekf.predict_x = lambda u=0: setattr(ekf, "x", moved.array)
            ekf.predict()
        self._t_s = t_s

    def update(self, estimate: PoseEstimate, t_s: float) -> None:
        """Correct it."""
        motion = self._clock.motion_since(t_s)
        if motion is None:
            return
        if self._filter is None:
            pose, covariance = nearest(estimate, motion, None)
            self._filter = ExtendedKalmanFilter(3, 3)
            self._filter.x, self._filter.P = pose.array, covariance
            return
        pose, covariance = nearest(estimate, motion, Pose2(*self._filter.x))
        self._filter.update(pose.array, lambda x: np.eye(3), lambda x: x, R=covariance, residual=_residual)

    @property
    def belief(self) -> PoseEstimate | NotLocated:
        """Its state."""
        if self._filter is None:
            return NotLocated("no frame yet")
        return PoseEstimate(Pose2(*self._filter.x), self._filter.P, 0.0, 0.0)


def white_noise(noise: OdometryNoise, motion: Pose2, seconds: float) -> FloatArray:
    """Covariance (3, 3) of a step's odometry, slip that lasts replaced by independent errors that add up to the same."""
    slip = noise.slip(motion)
    return 2 * noise.slip_s / max(seconds, 0.01) * slip @ slip + noise.push(seconds)


def _residual(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.array([a[0] - b[0], a[1] - b[1], wrap_angle(a[2] - b[2])])


def nearest(estimate: PoseEstimate, motion: Pose2, near: Pose2 | None) -> tuple[Pose2, FloatArray]:
    """The candidate nearest to a pose, carried by a motion, and its covariance."""
    poses = [pose.compose(motion) for pose in estimate.candidates]
    index = 0 if near is None else min(range(len(poses)), key=lambda k: sum(poses[k].error_to(near)))
    is_turned = sum(estimate.candidates[index].error_to(estimate.pose.half_turn())) < 1e-6
    return poses[index], half_turn_covariance(estimate.covariance) if is_turned else estimate.covariance


FOLLOWERS: dict[str, Callable[[], Follower]] = {"single": Single, "EKF": Ekf, "filter": PoseFilter}


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
        """Return what each shall do."""
        commands = {}
        for index, pose in enumerate(poses):
            place, speed, turn, until_s = self._plans[index]
            x, y = pose.inverse().transform(place).tolist()
            far = math.hypot(x, y)
            if t_s > until_s or (far < 0.1 and speed):
                self._plans[index] = self._plan(t_s)
            share = min(speed, 1.5 * far) / max(far, 1e-6)
            commands[index] = Command(share * x, share * y, turn)
        return commands


def record(seed: int, run: int, seconds: float, *, kidnaps: bool) -> tuple[list[Step], list[tuple[float, str]]]:
    """Drive, look, and return the steps of robot 0, and when what was done to it (from a push's end)."""
    cv2.setNumThreads(1)
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
    """When which frame comes, and what it says, under a condition."""
    found = []
    spell: tuple[int, Pose2 | None] = (-1, None)
    length = max(1, round(0.1 / CONTROL_PERIOD_S))
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
                wrong_until = telling_until if rng.random() < 0.05 and step.t_s > WARM_S else -1
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
                estimate = PoseEstimate(spell[1], estimate.covariance, estimate.inlier_share, estimate.residual_px)
        found.append(Arrival(index + late, step.t_s, estimate))
    # those of one step in the order in which they are looked at: a younger one may come first
    return sorted(found, key=lambda arrival: (arrival.index, -arrival.t_s))


@dataclass
class Tally:
    """Squares and counts over many runs."""

    moments: int = 0
    lost: int = 0
    squares_m2: float = 0.0
    squares_rad2: float = 0.0
    nees: list[FloatArray] | None = None
    flips: int = 0

    def add(self, other: Tally) -> None:
        """Count another one's too."""
        self.moments += other.moments
        self.lost += other.lost
        self.squares_m2 += other.squares_m2
        self.squares_rad2 += other.squares_rad2
        self.flips += other.flips
        self.nees = (self.nees or []) + (other.nees or [])

    @property
    def rms_m(self) -> float:
        """Of the position, metres."""
        return math.sqrt(self.squares_m2 / max(self.moments, 1))

    @property
    def rms_rad(self) -> float:
        """Of the heading, radians."""
        return math.sqrt(self.squares_rad2 / max(self.moments, 1))

    @property
    def all_nees(self) -> FloatArray:
        """Over all moments."""
        return np.concatenate(self.nees) if self.nees else np.array([math.nan])


def follow(follower: Follower, steps: list[Step], coming: list[Arrival]) -> list[PoseEstimate | NotLocated]:
    """Run one method; what it believes at each step."""
    beliefs, at = [], 0
    for index, step in enumerate(steps):
        follower.predict(step.odometry, step.t_s)
        while at < len(coming) and coming[at].index <= index:
            follower.update(coming[at].estimate, coming[at].t_s)
            at += 1
        beliefs.append(follower.belief)
    return beliefs


def judge(steps: list[Step], beliefs: list[PoseEstimate | NotLocated]) -> Tally:
    """Compare beliefs with the truth, from 1 s on."""
    tally, nees, flipped = Tally(), [], False
    for step, belief in zip(steps, beliefs, strict=True):
        if step.t_s < WARM_S:
            continue
        if not isinstance(belief, PoseEstimate):
            tally.lost += 1
            continue
        error = _residual(belief.pose.array, step.truth.array)
        tally.moments += 1
        tally.squares_m2 += float(error[:2] @ error[:2])
        tally.squares_rad2 += float(error[2] ** 2)
        nees.append(float(error @ np.linalg.solve(belief.covariance, error)))
        turned = belief.pose.half_turn()
        flipped |= sum(turned.error_to(step.truth)) < sum(belief.pose.error_to(step.truth))
    tally.flips, tally.nees = int(flipped), [np.array(nees)]
    return tally


def wander(task: tuple[int, int]) -> dict[tuple[str, str], Tally]:
    """One run under all conditions, by all methods."""
    seed, run = task
    steps, _ = record(seed, run, RUN_S, kidnaps=False)
    return judge_all(steps, seed, run)


def judge_all(steps: list[Step], seed: int, run: int) -> dict[tuple[str, str], Tally]:
    """All conditions and methods on one run."""
    results = {}
    for number, condition in enumerate(CONDITIONS):
        coming = arrivals(steps, condition, np.random.default_rng([seed, run, 2, number]))
        for method in METHODS:
            if method == "EKF" and ExtendedKalmanFilter is None:
                continue
            results[condition, method] = judge(steps, follow(FOLLOWERS[method](), steps, coming))
    return results


def kidnap(task: tuple[int, int]) -> list[tuple[str, str, float]]:
    """Kind, method and recovery time of each kidnapping of one run."""
    seed, run = task
    steps, done = record(seed, run, RUN_S + KIDNAP_EVERY_S, kidnaps=True)
    return recoveries(steps, done)


def recoveries(steps: list[Step], done: list[tuple[float, str]]) -> list[tuple[str, str, float]]:
    """See `kidnap`."""
    found = []
    coming = arrivals(steps, "every frame", np.random.default_rng(0))
    for method in METHODS:
        if method == "EKF" and ExtendedKalmanFilter is None:
            continue
        beliefs = follow(FOLLOWERS[method](), steps, coming)
        near = np.array([_is_near(belief, step.truth) for step, belief in zip(steps, beliefs, strict=True)])
        times = np.array([step.t_s for step in steps])
        for from_s, kind in done:
            recovery_s = math.inf
            for t_s in times[(times >= from_s - 1e-6) & (times <= from_s + 3.0)]:
                if near[(times >= t_s - 1e-6) & (times <= t_s + STAYS_S)].all():
                    recovery_s = float(t_s - from_s)
                    break
            found.append((kind, method, recovery_s))
    return found


def _is_near(belief: PoseEstimate | NotLocated, truth: Pose2) -> bool:
    if not isinstance(belief, PoseEstimate):
        return False
    position, turn = belief.pose.error_to(truth)
    return position <= NEAR_M and turn <= NEAR_RAD


def synthetic_steps(lasting_share: float, lasting_m: float, rng: np.random.Generator) -> list[Step]:
    """A robot that wanders by itself, and frames whose errors last as the model says."""
    std = np.array([0.003, 0.003, 0.002])
    steps, truth, slip, b = [], Pose2(0.0, 0.0, 0.0), np.zeros(3), rng.standard_normal(3)
    speed, heading, turn = 0.0, 0.0, 0.0
    dt = CONTROL_PERIOD_S
    step = Pose2(0.0, 0.0, 0.0)
    for index in range(round(RUN_S / dt)):
        if index % 45 == 0:
            speed, heading, turn = rng.uniform(0.0, 0.9), rng.uniform(-math.pi, math.pi), rng.uniform(-2.5, 2.5)
            back = math.atan2(-truth.y_m, -truth.x_m)
            heading = back - truth.theta_rad if math.hypot(truth.x_m, truth.y_m) > 1.0 else heading
        scale = rng.uniform(0.5, 2.0)
        error = scale * std * (math.sqrt(lasting_share) * b + math.sqrt(1 - lasting_share) * rng.standard_normal(3))
        x, y, theta = (truth.array + error).tolist()
        estimate = PoseEstimate(Pose2(x, y, theta), np.diag((scale * std) ** 2), 1.0, 0.0)
        steps.append(Step(index * dt, truth, step, estimate))
        kept = math.exp(-dt / 0.1)
        sizes = OdometryNoise().slip_share * np.array([speed, speed, math.hypot(turn, speed)])
        slip = kept * slip + math.sqrt(1 - kept**2) * sizes * rng.standard_normal(3)
        step = Pose2(speed * math.cos(heading) * dt, speed * math.sin(heading) * dt, turn * dt)
        pushed = math.sqrt(dt) * np.array([0.005, 0.005, 0.01]) * rng.standard_normal(3)
        dx, dy, da = (step.array + slip * dt + pushed).tolist()
        truth = truth.compose(Pose2(dx, dy, da))
        kept = math.exp(-speed * dt / lasting_m)
        b = kept * b + math.sqrt(1 - kept**2) * rng.standard_normal(3)
    return steps


def synthesize(task: tuple[int, int, float, float]) -> dict[str, Tally]:
    """All methods on one synthetic run."""
    seed, run, lasting_share, lasting_m = task
    steps = synthetic_steps(lasting_share, lasting_m, np.random.default_rng([seed, run, 3]))
    coming = arrivals(steps, "every frame", np.random.default_rng(0))
    methods = [method for method in METHODS if method != "EKF" or ExtendedKalmanFilter is not None]
    return {method: judge(steps, follow(FOLLOWERS[method](), steps, coming)) for method in methods}


def main() -> None:
    """Measure and print."""
    arguments = parse_arguments(str(__doc__))
    wandering, kidnapped, synthetic = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    if ExtendedKalmanFilter is None:
        print("filterpy: not installed")
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context) as pool:
        all_ok = print_wandering(list(pool.map(wander, [(arguments.seed, run) for run in range(wandering)])))
        all_ok &= print_kidnapped(list(pool.map(kidnap, [(arguments.seed, run) for run in range(kidnapped)])))
        kinds = [(share, way) for way in (0.5, 5.0) for share in (0.0, 0.2, 0.5, 0.9)]
        tasks = [(arguments.seed, run, share, way) for share, way in kinds for run in range(synthetic)]
        print_synthetic(kinds, synthetic, list(pool.map(synthesize, tasks)))
    finish(arguments.check, all_ok)


def print_wandering(results: list[dict[tuple[str, str], Tally]]) -> bool:
    """Print a row for each condition and method; tell whether the filter's are as wanted."""
    table = Table(
        (
            "condition   ",
            "method",
            "RMS mm",
            "RMS deg",
            "ratio",
            "NEES mean",
            "median",
            "in 95 %",
            "flips",
            "lost %",
            "",
        ),
        f"wandering: {len(results)} runs of {RUN_S:g} s; wanted: ratio at most {MOST_RATIO}, NEES {NEES_BOUNDS[0]:g} to "
        f"{NEES_BOUNDS[1]:g}, no flips",
    )
    all_ok = True
    for condition in CONDITIONS:
        tallies = {}
        for method in METHODS:
            tally = Tally()
            for result in results:
                if (condition, method) in result:
                    tally.add(result[condition, method])
            tallies[method] = tally
        for method, tally in tallies.items():
            if not tally.moments:
                table.row(condition, method, *["not installed"] + [None] * 8)
                continue
            nees = tally.all_nees
            ratio, mean = tally.rms_m / tallies["single"].rms_m, float(nees.mean())
            ok = ratio <= MOST_RATIO and NEES_BOUNDS[0] <= mean <= NEES_BOUNDS[1] and not tally.flips
            all_ok &= ok or method != "filter"
            table.row(
                condition if method == METHODS[0] else "",
                method,
                1e3 * tally.rms_m,
                math.degrees(tally.rms_rad),
                ratio,
                mean,
                float(np.median(nees)),
                percent(float(np.mean(nees <= NEES_95))),
                f"{tally.flips}",
                percent(tally.lost / (tally.lost + tally.moments)),
                verdict(ok) if method == "filter" else None,
            )
    return all_ok


def print_kidnapped(results: list[list[tuple[str, str, float]]]) -> bool:
    """Print a row for each kind; tell whether the filter recovers in time."""
    table = Table(
        ("kidnapped", "method", "times", "median s", "worst s", "in 1 s %", ""),
        f"kidnapped: {len(results)} runs; wanted: every recovery within {MOST_RECOVERY_S:g} s",
    )
    all_ok = True
    for kind in KINDS:
        for method in METHODS:
            times = [t for result in results for k, m, t in result if (k, m) == (kind, method)]
            if not times:
                continue
            ok = max(times) <= MOST_RECOVERY_S
            all_ok &= ok or method != "filter"
            table.row(
                kind if method == METHODS[0] else "",
                method,
                len(times),
                float(np.median(times)),
                max(times),
                percent(float(np.mean(np.array(times) <= MOST_RECOVERY_S))),
                verdict(ok) if method == "filter" else None,
            )
    return all_ok


def print_synthetic(kinds: list[tuple[float, float]], runs: int, results: list[dict[str, Tally]]) -> None:
    """Print NEES by how long errors truly last; the filter believes 0.2 and 0.5 m throughout."""
    table = Table(
        ("lasting share", "for m", "method", "RMS mm", "ratio", "NEES mean", "in 95 %"),
        f"synthetic: {runs} runs of {RUN_S:g} s each; the filter's guess is a share of 0.2 for 0.5 m",
    )
    for number, (share, way) in enumerate(kinds):
        part = results[number * runs : (number + 1) * runs]
        tallies = {method: Tally() for method in part[0]}
        for result in part:
            for method, tally in result.items():
                tallies[method].add(tally)
        for method, tally in tallies.items():
            nees = tally.all_nees
            table.row(
                f"{share:g}" if method == METHODS[0] else "",
                f"{way:g}" if method == METHODS[0] else "",
                method,
                1e3 * tally.rms_m,
                tally.rms_m / tallies["single"].rms_m,
                float(nees.mean()),
                percent(float(np.mean(nees <= NEES_95))),
            )


if __name__ == "__main__":
    main()
