"""Frames a second of several threads, each with its own `Vision`, beside one thread and beside several processes.

Cameras: the mirror camera of ssl_2001 at 256 x 220 and 640 x 480, look and steer, and a walking dog's forward camera of
208 x 160, look. Each of 20 different frames (--quick: 3) is looked at by a prior off by about what odometry adds; those
of the forward camera are 6 of a walk, each by its own pose before.

Rounds of 300 mirror frames or 100 forward ones a worker (--quick: 20 and 6; --full: 1000 and 300) are run by one
thread, by two threads, by four threads (four cameras) and by two processes, in turns, 7 rounds each (--quick: 3), so
that a slow moment of the machine meets all of them; figures are of medians. "2 threads" over one thread is at most 2
on two cores that nothing else uses; the column of two processes says how much of the second core the machine gave
during this run. What is left between the two is Python's lock (compiled loops hand it on, what lies between them does
not), and the memory and caches that threads share. OpenCV and NumPy are kept to one thread.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401 - before NumPy is loaded

# isort: split
import math
import multiprocessing
from argparse import Namespace
from collections.abc import Callable, Sequence
from threading import Barrier, Thread
from time import perf_counter, thread_time
from typing import Any

import numpy as np

from benchmarks.harness import Table, program
from benchmarks.worlds.walks import FL, walk
from field_models import load_field
from robocup_vision import MotionLimits, PoseEstimate, Steering, Vision
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, sample

MIRROR_FIELD = "ssl_2001"
MIRROR_SIZES = ((256, 220), (640, 480))
LIMITS = MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03)
PRIOR_STD = (0.01, 0.01, math.radians(1.0))
WORKERS = 4
# one worker's round: number of frames
Work = Callable[[int], None]


def mirror_worker(size: tuple[int, int], frames: Sequence[np.ndarray], priors: Sequence[Pose2 | None]) -> Work:
    """Return the loop of a robot with a mirror camera, which has looked at all frames once."""
    vision, steering = Vision(load_field(MIRROR_FIELD), sekimori_camera(*size)), Steering(0.09, LIMITS)

    def run(count: int) -> None:
        for index in range(count):
            turn = index % len(frames)
            view = vision.look(frames[turn], prior=priors[turn])
            steering.steer(view.free_space, (0.2, 0.1), 0.3)

    run(len(frames))
    return run


def mirror_workers(size: tuple[int, int], different: int, seed: int) -> list[Work]:
    """Return workers of the same frames and priors, each with a `Vision` of its own."""
    field, camera = load_field(MIRROR_FIELD), sekimori_camera(*size)
    drawn = list(sample(field, camera, CONDITIONS["nominal"], seed, different))
    frames = [one.frame for one in drawn]
    offsets = np.random.default_rng(seed).normal(size=(different, 3)) * PRIOR_STD
    priors = [Pose2(*(one.pose.array + offset)) for one, offset in zip(drawn, offsets, strict=True)]
    return [mirror_worker(size, frames, priors) for _ in range(WORKERS)]


def forward_workers(seed: int) -> list[Work]:
    """Return workers that follow the frames of a walk."""
    frames = walk(FL, seed, 6)

    def worker() -> Work:
        vision = Vision(load_field(FL.field_name), FL.camera)
        covariance = np.diag([0.02, 0.02, 0.02]) ** 2
        robots = [one.camera_pose.compose(Pose2(0.0, 0.0, -one.pan_rad)) for one in frames]
        priors = [PoseEstimate(robot, covariance, 1.0, 0.0) for robot in robots]

        def run(count: int) -> None:
            for index in range(count):
                turn = index % len(frames)
                vision.look(frames[turn].frame, prior=priors[turn], pan_rad=frames[turn].pan_rad)

        run(len(frames))
        return run

    return [worker() for _ in range(WORKERS)]


def threads_s(workers: Sequence[Work], count: int) -> float:
    """Seconds of a round by threads."""
    gate = Barrier(len(workers) + 1)
    return _round_s([Thread(target=_behind, args=(gate, one, count)) for one in workers], gate)


def processes_s(workers: Sequence[Work], count: int) -> float:
    """Seconds of a round by processes, which begin as copies of this one."""
    context = multiprocessing.get_context("fork")
    gate = context.Barrier(len(workers) + 1)
    return _round_s([context.Process(target=_behind, args=(gate, one, count)) for one in workers], gate)


def _behind(gate: Any, work: Work, count: int) -> None:
    gate.wait()
    work(count)


def _round_s(members: Sequence[Any], gate: Any) -> float:
    for member in members:
        member.start()
    gate.wait()
    begin = perf_counter()
    for member in members:
        member.join()
    return perf_counter() - begin


def measure(name: str, workers: list[Work], count: int, rounds: int, table: Table) -> None:
    """Run the rounds of one camera and print its row."""
    seconds: dict[str, list[float]] = {"one": [], "two": [], "four": [], "processes": []}
    cpu: list[float] = []
    for _ in range(rounds):
        begin = thread_time()
        wall = perf_counter()
        workers[0](count)
        seconds["one"].append(perf_counter() - wall)
        cpu.append(thread_time() - begin)
        seconds["two"].append(threads_s(workers[:2], count))
        seconds["processes"].append(processes_s(workers[:2], count))
        seconds["four"].append(threads_s(workers, count // 2))
    one, two, four, processes = (float(np.median(taken)) / count for taken in seconds.values())
    table.row(
        name,
        f"{1e3 * float(np.median(cpu)) / count:.2f}",
        f"{1 / one:.0f}",
        f"{2 * one / two:.2f}",
        f"{2 * one / four:.2f}",
        f"{2 * one / processes:.2f}",
        f"{processes / two:.2f}",
    )


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    different, rounds = (3, 3) if arguments.quick else (20, 7)
    mirror, forward = (20, 6) if arguments.quick else (1000, 300) if arguments.full else (300, 100)
    columns = (
        "camera            | ms of processor | frames/s | 2 threads: score | 4 threads: score | 2 processes | "
        "threads/processes: score"
    )
    table = Table(columns, "Frames a second, one thread; and by several over those of one", name="frames a second")
    for size in MIRROR_SIZES:
        workers = mirror_workers(size, different, arguments.seed)
        measure(f"mirror {size[0]} x {size[1]}", workers, mirror, rounds, table)
    width, height = FL.camera.size_px
    measure(f"forward {width} x {height}", forward_workers(arguments.seed), forward, rounds, table)
