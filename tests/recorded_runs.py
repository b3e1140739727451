"""A short run of a simulated robot that drives on its field, as frames with odometry, and a recording of it."""

from __future__ import annotations

import math
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from field_models import load_field
from robocup_vision import Memory, MotionLimits, Steering, Vision
from robocup_vision.arrays import UInt8Array
from robocup_vision.geometry import Pose2
from robocup_vision.recording import Recorder, RecorderSettings
from sim2d.match.arena import Arena
from sim2d.robot_link import CONTROL_PERIOD_S, Command

FIELD = load_field("ssl_2001")
LIMITS = MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03)
FRAMES = 16


class RunFrame(NamedTuple):
    """A frame, when it was taken, the motion since the one before, and where the robot truly was."""

    t_s: float
    frame: UInt8Array
    odometry: Pose2
    truth: Pose2


@lru_cache(maxsize=1)
def run_frames() -> tuple[RunFrame, ...]:
    """Return `FRAMES` frames of one robot that drives a curve, 2 against 2 robots on the field."""
    arena = Arena(FIELD, 2, seed=5)
    frames = []
    for _ in range(FRAMES):
        state, senses = arena.state, arena.senses()
        robot = state.robots[0]
        assert senses[0].frame is not None
        frames.append(RunFrame(state.t_s, senses[0].frame, senses[0].odometry, robot.pose))
        arena.step({index: Command(0.3, 0.05 * index, 0.8) for index in range(4)})
    return tuple(frames)


def make_vision() -> Vision:
    """Return a fresh `Vision` with a memory of everything."""
    arena = Arena(FIELD, 1, seed=0)
    return Vision(FIELD, arena.camera, memory=Memory.of_everything(FIELD))


def make_steering() -> Steering:
    """Return a fresh `Steering`."""
    return Steering(0.09, LIMITS)


def record_run(path: Path, settings: RecorderSettings = RecorderSettings()) -> None:
    """Record the run by look, predict and steer."""
    with Recorder(path, make_vision(), make_steering(), settings) as recorder:
        velocity = (0.0, 0.0)
        for index, now in enumerate(run_frames()):
            odometry = now.odometry
            if index % 3 == 2:
                # a control step without a frame, half-way
                half = Pose2(now.odometry.x_m / 2, now.odometry.y_m / 2, 0.0)
                recorder.predict(half, now.t_s - CONTROL_PERIOD_S / 2)
                odometry = half.inverse().compose(now.odometry)
            view = recorder.look(now.frame, t_s=now.t_s, odometry=odometry)
            moving = () if view.belief is None or not view.belief.pose else tuple(
                track.as_disc(view.belief.pose.pose, 0.09) for track in view.belief.tracks
            )  # fmt: skip
            command = recorder.steer(view.free_space, velocity, math.sin(now.t_s), 1.0, None, moving)
            velocity = (float(command.velocity_mps[0]), float(command.velocity_mps[1]))
            recorder.add_truth(now.truth, now.t_s, (0.1, 0.2))


def is_same(a: object, b: object) -> bool:
    """Whether two plain values are the same, bit for bit: arrays, numbers (NaN is NaN), and what is made of them."""
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if isinstance(a, float) and isinstance(b, float):
        return np.float64(a).tobytes() == np.float64(b).tobytes() or (math.isnan(a) and math.isnan(b))
    if isinstance(a, tuple) and isinstance(b, tuple):
        return len(a) == len(b) and all(map(is_same, a, b))
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(is_same(a[key], b[key]) for key in a)
    return type(a) is type(b) and a == b
