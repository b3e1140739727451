"""Walking sequences as a forward camera sees them, with truth: a head that sweeps, a body that nods and rolls.

Frames take longer to render than to look at, so they are kept in a folder of the system's temporary directory.
"""

from __future__ import annotations

import hashlib
import math
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES, Field, load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2, wrap_angle
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.pinhole import render_pinhole, smear
from sim2d.rendering.scene import Ball, Light, Robot, Room, Scene
from sim2d.rendering.sensor import Sensor

FORMAT = 3  # of the kept frames; a change of this file that changes them raises it


# least and greatest number of others
ROBOTS = (7, 9)
SENSOR = Sensor(noise_sigma=3.0, blur_px=0.6, vignette=0.15)


@dataclass(frozen=True, slots=True)
class Walk:
    """What is walked, by what, and what is wrong with it."""

    field_name: str  #: the pitch
    camera: PinholeCamera  #: as the robot's file says: `tilt_rad` and `roll_rad` are means over the steps, pan 0
    speed_mps: float  #: of the robot
    #: standard deviation of the body's nod and roll
    nod_rad: float
    roll_rad: float
    robot_size_m: tuple[float, float]  #: radius and height of the other robots
    exposure_s: float = 0.0  #: the head pans meanwhile: motion blur
    readout_s: float = 0.0  #: from the first row to the last while the head pans: rolling shutter
    odometry_error: float = 0.05  #: greatest relative error of the odometry's scale
    pan_error_rad: float = 0.0  #: standard deviation of the head's reported pan


def camera_ahead(
    size_px: tuple[int, int],
    focal_px: float,
    height_m: float,
    tilt_deg: float,
    *,
    height_std_m: float = 0.006,
    roll_std_deg: float = 1.4,
) -> PinholeCamera:
    """Return the camera of a robot that looks ahead, as its file says: level, centred."""
    width, height = size_px
    return PinholeCamera(
        size_px,
        (focal_px, focal_px),
        ((width - 1) / 2, (height - 1) / 2),
        height_m,
        pan_rad=0.0,
        tilt_rad=math.radians(tilt_deg),
        roll_rad=0.0,
        height_std_m=height_std_m,
        roll_std_rad=math.radians(roll_std_deg),
    )


FL = Walk(
    "four_legged_2007",
    camera_ahead((208, 160), 192.0, 0.185, -10.0),
    speed_mps=0.25,
    nod_rad=math.radians(1.2),
    roll_rad=math.radians(1.2),
    robot_size_m=(0.12, 0.25),
)
SPL = Walk(
    "spl_2020",
    camera_ahead((640, 480), 616.0, 0.46, -14.0),
    speed_mps=0.25,
    nod_rad=math.radians(1.5),
    roll_rad=math.radians(1.2),
    robot_size_m=(0.15, 0.55),
)
HEIGHT_ERROR_M = 0.004
LENS = (-0.12, 0.03, 0.001, -0.001)
STEP_S = 1 / 30

WALKS: dict[str, Walk] = {
    "FL": FL,
    "SPL": SPL,
    "FL blur": replace(FL, exposure_s=0.012),
    "SPL blur": replace(SPL, exposure_s=0.008),
    "FL rolling": replace(FL, readout_s=0.020),
    "SPL rolling": replace(SPL, readout_s=0.020),
    "FL lens": replace(FL, camera=replace(FL.camera, distortion=LENS)),
    "SPL lens": replace(SPL, camera=replace(SPL.camera, distortion=LENS)),
    "FL odometry 10 %": replace(FL, odometry_error=0.10),
    "SPL odometry 10 %": replace(SPL, odometry_error=0.10),
    "FL pan 0.5 deg": replace(FL, pan_error_rad=math.radians(0.5)),
    "SPL pan 0.5 deg": replace(SPL, pan_error_rad=math.radians(0.5)),
}


@dataclass(frozen=True, slots=True, eq=False)
class WalkFrame:
    """One picture with what the robot is told and what is true."""

    t_s: float  #: when it was taken
    pan_rad: float  #: as the head reports it
    odometry: Pose2  #: motion of the robot since the picture before, as it is told
    robot: Pose2  #: where the robot truly is
    camera_pose: Pose2  #: the camera's foot and the heading of its optical axis, truly
    #: as the camera truly was
    tilt_rad: float
    roll_rad: float
    height_m: float
    pan_rate_rps: float
    scene: Scene  #: what truly is around it
    #: (H, W, 3) uint8: the picture; empty before it is drawn
    frame: npt.NDArray[np.uint8] = field(default_factory=lambda: np.empty(0, dtype=np.uint8))

    @property
    def ball(self) -> Ball | None:
        """Where the ball truly is, field frame."""
        return self.scene.ball


def walk(what: Walk, seed: int, count: int) -> list[WalkFrame]:
    """Return a sequence; it depends on `seed` alone, and a longer one begins with the shorter one's motion."""
    steps = list(_motion(what, load_field(what.field_name), seed, count))
    frames = _kept_frames(what, seed, steps)
    return [replace(step, frame=frame) for step, frame in zip(steps, frames, strict=True)]


def _motion(what: Walk, pitch: Field, seed: int, count: int) -> Iterator[WalkFrame]:
    rng = np.random.default_rng([seed, 0xF0])
    half = np.array([pitch.length_m / 2, pitch.width_m / 2])
    x, y = (rng.uniform(-0.7, 0.7, 2) * half).tolist()
    pose = Pose2(x, y, float(rng.uniform(-math.pi, math.pi)))
    goal = rng.uniform(-0.8, 0.8, 2) * half
    number = int(rng.integers(ROBOTS[0], ROBOTS[1] + 1))
    others = rng.uniform(-1.0, 1.0, (number, 2)) * half
    drift = rng.normal(0.0, 0.15, (number, 2))
    ball = rng.uniform(-0.8, 0.8, 2) * half
    scale = 1.0 + what.odometry_error * rng.uniform(-1.0, 1.0, 2)
    light = Light(
        level=float(rng.uniform(0.85, 1.05)),
        gradient=float(rng.uniform(0.0, 0.15)),
        gradient_direction_rad=float(rng.uniform(-math.pi, math.pi)),
        texture=0.05,
        texture_seed=int(rng.integers(2**31)),
    )
    room = Room(seed=int(rng.integers(2**31)), distance_m=float(rng.uniform(0.3, 1.5)))
    phase = rng.uniform(0.0, math.tau, 6)
    pace_hz, period_s = float(rng.uniform(1.5, 1.9)), float(rng.uniform(3.5, 5.0))
    nod = roll = pan_off = 0.0
    turn_rate, before = 0.0, pose
    spread = math.radians(80.0)
    for index in range(count):
        t = index * STEP_S
        if index:
            toward = math.atan2(goal[1] - pose.y_m, goal[0] - pose.x_m)
            wanted = float(np.clip(1.5 * wrap_angle(toward - pose.theta_rad), -0.6, 0.6))
            turn_rate += 0.2 * (wanted - turn_rate)
            speed = what.speed_mps * (1.0 - min(abs(turn_rate), 0.6))
            side = 0.03 * math.sin(math.tau * pace_hz / 2 * t + phase[4])
            pose = pose.compose(Pose2(speed * STEP_S, side * STEP_S, turn_rate * STEP_S))
            if math.hypot(goal[0] - pose.x_m, goal[1] - pose.y_m) < 0.3:
                goal = rng.uniform(-0.8, 0.8, 2) * half
            drift = 0.97 * drift + rng.normal(0.0, 0.04, drift.shape)
            others = others + drift * STEP_S
        # half of nod and roll are the gait's swing, half chance
        nod = 0.85 * nod + math.sqrt(1 - 0.85**2) * float(rng.standard_normal())
        roll = 0.85 * roll + math.sqrt(1 - 0.85**2) * float(rng.standard_normal())
        pan_off = 0.9 * pan_off + math.sqrt(1 - 0.9**2) * float(rng.standard_normal())
        tilt = (what.camera.tilt_rad or 0.0) + what.nod_rad * (
            math.sin(math.tau * pace_hz * t + phase[0]) + math.sqrt(0.5) * nod
        )
        roll_now = what.roll_rad * (math.sin(math.tau * pace_hz / 2 * t + phase[1]) + math.sqrt(0.5) * roll)
        height = what.camera.height_m + HEIGHT_ERROR_M * math.sin(math.tau * pace_hz * t + phase[2])
        pan = spread * math.sin(math.tau * t / period_s + phase[3])
        pan_rate = spread * math.tau / period_s * math.cos(math.tau * t / period_s + phase[3])
        away = np.hypot(others[:, 0] - pose.x_m, others[:, 1] - pose.y_m)
        radius, tall = what.robot_size_m
        push = away < radius + 0.3
        if push.any():
            direction = (others[push] - (pose.x_m, pose.y_m)) / np.maximum(away[push, None], 1e-6)
            others[push] = np.array([pose.x_m, pose.y_m]) + direction * (radius + 0.3)
        moved = before.inverse().compose(pose)
        wrong = rng.normal(0.0, 0.02, 3)
        odometry = Pose2(
            moved.x_m * (scale[0] + wrong[0]),
            moved.y_m * (scale[0] + wrong[1]),
            moved.theta_rad * (scale[1] + wrong[2]),
        )
        before = pose
        scene = Scene(
            field=pitch,
            robots=tuple(
                Robot(float(x), float(y), radius, tall, marker_bgr=COLOR_NAMES["yellow" if k % 2 else "blue"])
                for k, (x, y) in enumerate(others)
            ),
            ball=Ball(float(ball[0]), float(ball[1]), pitch.ball_radius_m, COLOR_NAMES[pitch.ball_color])
            if math.hypot(ball[0] - pose.x_m, ball[1] - pose.y_m) > 0.3
            else None,
            light=light,
            room=room,
            carpet_margin_m=0.2,
        )
        yield WalkFrame(
            t,
            pan + what.pan_error_rad * pan_off,
            odometry,
            pose,
            Pose2(pose.x_m, pose.y_m, pose.theta_rad + pan),
            tilt,
            roll_now,
            height,
            pan_rate,
            scene,
        )


def _kept_frames(what: Walk, seed: int, steps: list[WalkFrame]) -> list[npt.NDArray[np.uint8]]:
    look = (what.field_name, what.camera, what.speed_mps, what.nod_rad, what.roll_rad, what.robot_size_m, SENSOR)
    name = repr((FORMAT, look, what.exposure_s, what.readout_s, ROBOTS, seed))
    nets = [goal.net for goal in load_field(what.field_name).goals if goal.net is not None]
    name += repr(nets) if nets else ""
    folder = Path(tempfile.gettempdir()) / "robocup_vision_walks" / hashlib.sha256(name.encode()).hexdigest()[:16]
    folder.mkdir(parents=True, exist_ok=True)
    frames = []
    for index, step in enumerate(steps):
        path = folder / f"{index:04d}.npy"
        if path.exists():
            frames.append(np.load(path))
            continue
        frame = _render(what, step, seed, index)
        partial = path.with_suffix(".part.npy")
        np.save(partial, frame)
        partial.replace(path)
        frames.append(frame)
    return frames


def _render(what: Walk, step: WalkFrame, seed: int, index: int) -> npt.NDArray[np.uint8]:
    rng = np.random.default_rng([seed, index, 0x5E])
    camera = replace(what.camera, height_m=step.height_m).with_orientation(0.0, step.tilt_rad, step.roll_rad)
    light = render_pinhole(
        camera,
        step.scene,
        step.camera_pose,
        backdrop=Backdrop("hall", seed=seed),
        supersample=4,
        turn_rad=step.pan_rate_rps * what.readout_s,
    )
    light = smear(light, abs(step.pan_rate_rps) * what.exposure_s * what.camera.focal_px[0])
    return SENSOR.expose(light, rng)
