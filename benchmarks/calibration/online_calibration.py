"""Cameras that are not what their file says, estimated while a robot walks: what remains wrong, and what poses gain.

Two robots walk from place to place as legs or wheels carry them (sway, slip, drifting light; pinhole cameras also
motion blur and rolling shutter). Each true camera is drawn about its file: a pinhole camera's focal length by 1 %,
centre 3 px, tilt and roll 0.5 degrees, height 5 mm; a mirror camera's centre 1.5 px, curve 2 %, tilt 0.3 degrees
(standard deviations). The same frames, straightened as players do, go to a `Vision` with its memory, without and with
`OnlineCalibration`. A head pans to and fro. "FL": four_legged_2007; "SSL": forward cameras on board on ssl_division_b;
"mirror": ssl_2001.

Root mean squares over robots. "image": greatest distance between the pictures of the same places through the camera in
use and the true one; centre's and tilt's errors that have the same picture do no harm. "NEES": squared error of all
parameters by the covariance that the estimate states, a parameter; 1 is honest. Poses: root mean square distance and
share of frames located within 10 cm and 5 degrees (mirror: 3 cm and 3 degrees) in the time since the row before;
after the first of them poses must be no worse than by the file.
"steps": changes of the camera so far. "look": mean time of a look, calibration and the tables of changed cameras
included, thread seconds as a ratio to cv2.cvtColor(BGR2HSV) of such a frame; mean, not median, as few frames take all
that a calibration takes. The row after 0 s is what the camera file has wrong, and the first frame's estimate.
"""

from __future__ import annotations

import math
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from benchmarks.harness import Table, percent, program, verdict
from benchmarks.harness.timing import timed, unit_s
from benchmarks.scores.match_score import BOUNDS, Bound
from field_models import Field, load_field
from robocup_vision import Memory, Vision
from robocup_vision.arrays import FloatArray
from robocup_vision.calibration.online import OnlineCalibration
from robocup_vision.camera import OmniCamera, PinholeCamera, Rig
from robocup_vision.geometry import Pose2, wrap_angle
from sim2d.match.arena import Arena
from sim2d.match.disturbances import LEGS, WHEELS, Disturbances
from sim2d.match.setups import CAMERAS, camera_for
from sim2d.players.straight_frames import StraightFrames
from sim2d.robot_link import Command, Senses
from sim2d.sensors.true_cameras import CameraErrorSettings

Camera = OmniCamera | PinholeCamera

# (pairs of robots, seconds of the rows)
QUICK, DEFAULT, FULL = (1, (1.0, 2.0)), (1, (10.0, 30.0, 60.0)), (8, (10.0, 30.0, 60.0))
PAN_RAD, PAN_PERIOD_S = math.radians(60.0), 4.5
MAX_NEES = 2.0


@dataclass(frozen=True)
class Course:
    """What walks where, and how near counts as near."""

    field_name: str
    camera: Camera
    disturbances: Disturbances
    bound: Bound
    speed_mps: float


def courses() -> dict[str, Course]:
    """Return the rows by name."""
    wrong = CameraErrorSettings()
    four_legged, mirror = load_field("four_legged_2007"), load_field("ssl_2001")
    legs = replace(LEGS, latency=None, camera=wrong)
    wheels = replace(WHEELS, latency=None, camera=wrong)
    head = camera_for(four_legged)
    assert isinstance(head, PinholeCamera)
    assert legs.shutter is not None
    head = replace(head, readout_s=legs.shutter.readout_s)
    on_board = CAMERAS["ssl_forward"]()
    assert isinstance(on_board, PinholeCamera)
    on_board = replace(on_board, readout_s=legs.shutter.readout_s)
    return {
        "FL": Course(four_legged.name, head, legs, BOUNDS[four_legged.name], 0.25),
        "SSL": Course("ssl_division_b", on_board, wheels, Bound(0.10, math.radians(5.0)), 0.6),
        "mirror": Course(mirror.name, camera_for(mirror), replace(wheels, shutter=None), BOUNDS[mirror.name], 0.4),
    }


@dataclass
class Walker:
    """Drives a robot from place to place by the truth, and pans its head."""

    half: FloatArray
    rng: np.random.Generator
    speed_mps: float
    pans: bool
    goal: FloatArray = field(default_factory=lambda: np.zeros(2))

    def command(self, pose: Pose2, t_s: float) -> Command:
        """Return what the robot does now."""
        if math.hypot(self.goal[0] - pose.x_m, self.goal[1] - pose.y_m) < 0.3 or t_s % 8.0 < 1 / 60:
            self.goal = self.rng.uniform(-0.8, 0.8, 2) * self.half
        toward = math.atan2(self.goal[1] - pose.y_m, self.goal[0] - pose.x_m)
        turn = float(np.clip(1.5 * wrap_angle(toward - pose.theta_rad), -0.8, 0.8))
        pan = PAN_RAD * math.sin(math.tau * t_s / PAN_PERIOD_S) if self.pans else None
        return Command(self.speed_mps * (1.0 - 0.8 * abs(turn)), 0.0, turn, pan_rad=pan)


@dataclass
class Looks:
    """What looks came to: errors of located ones, whether each is near the truth, and its time."""

    error_m: list[float] = field(default_factory=list)
    near: list[bool] = field(default_factory=list)
    spent_s: list[float] = field(default_factory=list)


@dataclass
class Watched:
    """One way of looking, and its looks since the row before."""

    vision: Vision
    memory: Memory
    online: OnlineCalibration | None
    straight: StraightFrames | None
    looks: Looks = field(default_factory=Looks)

    def look(self, senses: Senses, truth: Pose2, course: Course) -> None:
        """Look at what a robot senses as a player does, and note the pose's error."""
        self.memory.predict(senses.odometry, senses.t_s)
        frame = senses.frame
        if frame is None:
            return
        if self.straight is not None:
            frame = self.straight.straighten(frame, senses.t_s, senses.frame_pan_rad or 0.0)
        seen = frame
        view, spent_s = timed(lambda: self.vision.look(seen, senses.t_s, pan_rad=senses.frame_pan_rad))
        self.looks.spent_s.append(spent_s)
        belief = None if view.belief is None else view.belief.pose
        self.looks.near.append(course.bound.holds(belief.pose if belief else None, truth))
        if belief:
            self.looks.error_m.append(belief.pose.error_to(truth)[0])


@dataclass
class Row:
    """What the robots' cameras and poses are off by at one time: one number a robot."""

    image_px: list[float] = field(default_factory=list)
    center_px: list[float] = field(default_factory=list)
    scale: list[float] = field(default_factory=list)
    tilt_rad: list[float] = field(default_factory=list)
    height_m: list[float] = field(default_factory=list)
    nees: list[float] = field(default_factory=list)
    steps: list[int] = field(default_factory=list)
    by_file: Looks = field(default_factory=Looks)
    calibrated: Looks = field(default_factory=Looks)
    unit_s: list[float] = field(default_factory=list)


def parameters(camera: Camera, file: Camera) -> FloatArray:
    """Return centre u, v, tilt (and roll), logarithm of the scale and, of a pinhole camera, height."""
    if isinstance(camera, PinholeCamera):
        assert isinstance(file, PinholeCamera)
        scale = camera.focal_px[0] / file.focal_px[0]
        return np.array(
            [*camera.center_px, camera.tilt_rad or 0.0, camera.roll_rad or 0.0, math.log(scale), camera.height_m]
        )
    assert isinstance(file, OmniCamera)
    scale = float(camera.floor_range.radius_px(1.0) / file.floor_range.radius_px(1.0))
    return np.array([*camera.center_px, *camera.tilt_rad, math.log(scale)])


def note(row: Row, true: Camera, file: Camera, online: OnlineCalibration) -> None:
    """Note what is wrong with the camera in use."""
    camera = online.camera
    assert not isinstance(camera, Rig)
    error = parameters(camera, file) - parameters(true, file)
    row.image_px.append(online.shift_px(true))
    row.center_px.append(float(np.hypot(error[0], error[1])))
    row.tilt_rad.append(float(np.hypot(error[2], error[3])))
    row.scale.append(float(error[4]))
    row.height_m.append(float(error[5]) if len(error) > 5 else math.nan)
    off = online.parameters_of(true) - online.mean
    row.nees.append(float(off @ np.linalg.solve(online.covariance, off)) / len(off))
    row.steps.append(online.state.steps)


def walk(course: Course, seed: int, seconds: float) -> Iterator[tuple[float, Arena, tuple[Senses, ...]]]:
    """Let two robots walk; yields the time, the arena and what they sense."""
    pitch = load_field(course.field_name)
    arena = Arena(pitch, 1, seed, camera=course.camera, disturbances=course.disturbances)
    half = np.array([pitch.length_m / 2, pitch.width_m / 2])
    pans = isinstance(course.camera, PinholeCamera) and course.field_name == "four_legged_2007"
    walkers = [Walker(half, np.random.default_rng([seed, 0x0C, k]), course.speed_mps, pans) for k in range(2)]
    while arena.state.t_s < seconds:
        yield arena.state.t_s, arena, arena.senses()
        state = arena.state
        arena.step({r.index: walkers[r.index].command(r.pose, state.t_s) for r in state.robots})


def watched(pitch: Field, camera: Camera, start: Pose2, calibrates: bool) -> Watched:
    """Return a way of looking that begins at a known place."""
    online = OnlineCalibration(pitch, camera) if calibrates else None
    memory = Memory(pitch)
    memory.poses.expect(start)
    straight = StraightFrames(camera, memory.poses) if isinstance(camera, PinholeCamera) else None
    return Watched(Vision(pitch, camera, memory=memory, online=online), memory, online, straight)


def measure(course: Course, seed: int, rows: dict[float, Row]) -> None:
    """Let two robots walk and note what is wrong at the rows' times."""
    pitch, ends = load_field(course.field_name), sorted(rows)
    ways: list[dict[bool, Watched]] = []
    units: list[float] = []
    for t_s, arena, sensed in walk(course, seed, ends[-1] + 0.05):
        truths = [robot.pose for robot in arena.state.robots]
        if not ways:
            ways = [{on: watched(pitch, course.camera, pose, on) for on in (False, True)} for pose in truths]
        for k, senses in enumerate(sensed):
            if senses.frame is not None and not senses.t_s % 1.0 > 1 / 60:
                units += [unit_s(senses.frame)]
            for way in ways[k].values():
                way.look(senses, truths[k], course)
        done = [end for end in ends if t_s >= end - 1e-9]
        if done:
            row = rows[done[0]]
            ends.remove(done[0])
            for k, both in enumerate(ways):
                online = both[True].online
                assert online is not None
                note(row, arena.true_camera(k), course.camera, online)
                for on, way in both.items():
                    total = row.calibrated if on else row.by_file
                    total.error_m += way.looks.error_m
                    total.near += way.looks.near
                    total.spent_s += way.looks.spent_s
                    way.looks = Looks()
            row.unit_s += units
        if not ends:
            return


def rms(values: list[float]) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values)))) if values else math.nan


def _poses(row: Row) -> tuple[float | str, ...]:
    both = row.by_file, row.calibrated
    return (
        *(1000 * rms(looks.error_m) for looks in both),
        *(percent(float(np.mean(looks.near))) for looks in both),
        *(float(np.mean(looks.spent_s) / np.median(row.unit_s)) for looks in both),
    )


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    pairs, ends = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    table = Table(
        (
            "camera | after s | image px: error | centre px: error | scale %: error | tilt deg: error | "
            "height mm: error | NEES: score | steps | pose mm, file: error | pose mm: error | "
            "near %, file: rate | near %: rate | look, file: time ratio | look: time ratio | verdict"
        ),
        f"{2 * pairs} robots a row",
        name="online",
        samples=2 * pairs,
    )
    for name, course in courses().items():
        rows: dict[float, Row] = {end: Row() for end in (0.0, *ends)}
        for index in range(pairs):
            measure(course, arguments.seed + index, rows)
        for end, row in rows.items():
            better = rms(row.calibrated.error_m) <= rms(row.by_file.error_m) or end <= ends[0]
            ok = better and float(np.mean(row.nees)) <= MAX_NEES
            table.row(
                name,
                f"{end:g}",
                rms(row.image_px),
                rms(row.center_px),
                100 * rms(row.scale),
                math.degrees(rms(row.tilt_rad)),
                1000 * rms(row.height_m) if isinstance(course.camera, PinholeCamera) else "-",
                float(np.mean(row.nees)),
                f"{np.mean(row.steps):.0f}",
                *(_poses(row) if end else ("-",) * 6),
                verdict(ok),
            )
