"""Recordings: what recording costs a robot's loop, and whether a match comes back bit for bit.

Cost: `Vision` with memory and `Steering` at 640 x 480 and 30 frames a second, rounds of 2 s with and without a
`Recorder` in turn, so that the machine's load falls on both alike; the time of the loop's own work a frame (look and
steer) less that without, as medians, means and 99th percentiles over all rounds. Where the machine has other work, the
clock measures that, too: what counts is the clock's time less the time that the thread was ready to run and got no
processor, as Linux tells it; waiting for the recorder's thread, which shares the interpreter, is in it. The writer's
thread runs beside the loop; its processor time is told.

Replay: a match of 60 s, one against one, planning players; each robot's recording is replayed, and every call compared
in every bit. Beside it the match's own speed while it is recorded, and the size of the files.
"""

from __future__ import annotations

import os
import time
from argparse import Namespace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.harness import Table, program, verdict
from field_models import load_field
from robocup_vision import Memory, MotionLimits, Steering, Vision
from robocup_vision.arrays import UInt8Array
from robocup_vision.geometry import Pose2
from robocup_vision.recording import Recorder, Recording
from robocup_vision.recording.replay import Differences, replay
from sim2d.match.arena import Arena
from sim2d.match.match import Match
from sim2d.match.recorded import MatchRecorders
from sim2d.players.catalog import PLAYERS
from sim2d.rendering.cameras import sekimori_camera
from sim2d.robot_link import Command

FIELD = load_field("ssl_2001")
MAX_COST_MS = 1.0
FRAMES_A_ROUND, PERIOD_S = 60, 1 / 30
# of Linux: nanoseconds on a processor, nanoseconds of waiting for one, time slices
SCHEDULE = Path("/proc/thread-self/schedstat")


def measure_cost(rounds: int, seed: int) -> None:
    """Print what recording costs the loop."""
    camera = sekimori_camera(640, 480)
    frames = drive(Arena(FIELD, 2, seed, camera=camera))
    vision = Vision(FIELD, camera, memory=Memory.of_everything(FIELD))
    steering = Steering(0.09, MotionLimits(0.4, 0.3, 0.03))
    plain: list[tuple[float, float]] = []
    recorded: list[tuple[float, float]] = []
    shares: list[float] = []
    mebibytes = 0.0
    with TemporaryDirectory() as folder:
        path = Path(folder) / "cost.mcap"
        loop(vision, steering, frames)
        for _ in range(rounds):
            vision.forget()
            plain += loop(vision, steering, frames)
            vision.forget()
            with Recorder(path, vision, steering) as recorder:
                began_s, own_s = time.process_time(), time.thread_time()
                recorded += loop(recorder, recorder, frames)
                other_s = time.process_time() - began_s - (time.thread_time() - own_s)
            shares.append(other_s / (FRAMES_A_ROUND * PERIOD_S))
            mebibytes = path.stat().st_size / 2**20 / (FRAMES_A_ROUND * PERIOD_S)
    columns = "of the loop's time a frame | ms without | ms with | ms more: by row | target | verdict"
    table = Table(columns, "Cost of recording, 640 x 480, 30 frames a second", name="cost")
    both = [1e3 * np.array(times) for times in (plain, recorded)]
    load = os.getloadavg()[0]
    for name, column, of, counts in (
        ("median by the clock", 0, np.median, False),
        ("mean by the clock", 0, np.mean, False),
        ("99th percentile by the clock", 0, lambda times: np.percentile(times, 99), False),
        ("mean, less the wait for a processor", 1, np.mean, True),
        ("99th percentile, less that wait", 1, lambda times: np.percentile(times, 99), False),
    ):
        without, with_recorder = (float(of(times[:, column])) for times in both)
        is_ok = with_recorder - without <= MAX_COST_MS
        bound, word = (f"<= {MAX_COST_MS:g}", verdict(is_ok)) if counts else ("", "")
        table.row(name, round(without, 3), round(with_recorder, 3), round(with_recorder - without, 3), bound, word)
    table.note(f"load of the machine: {load:.1f} on {os.cpu_count()} CPUs")
    table.note(f"the writer's thread: {100 * float(np.median(shares)):.0f} % of a core, {mebibytes:.1f} MiB a second")


def waited_s() -> float:
    """Return how long this thread has been ready to run without a processor; 0 where the system does not tell."""
    try:
        return 1e-9 * float(SCHEDULE.read_text().split()[1])
    except OSError:
        return 0.0


def drive(arena: Arena) -> list[tuple[UInt8Array, Pose2]]:
    """Return frames, with odometry, of a robot that drives a curve."""
    frames = []
    for _ in range(FRAMES_A_ROUND):
        senses = arena.senses()[0]
        assert senses.frame is not None
        frames.append((senses.frame.copy(), senses.odometry))
        arena.step({index: Command(0.3, 0.05 * index, 0.8) for index in range(4)})
    return frames


def loop(
    looks: Vision | Recorder, steers: Steering | Recorder, frames: list[tuple[UInt8Array, Pose2]]
) -> list[tuple[float, float]]:
    """Run the loop at its rate; return each frame's time by the clock, and that less the wait for a processor."""
    times = []
    next_s = time.monotonic()
    for number, (frame, odometry) in enumerate(frames):
        next_s += PERIOD_S
        begin_s, begin_wait_s = time.perf_counter(), waited_s()
        view = looks.look(frame, t_s=number * PERIOD_S, odometry=odometry)
        steers.steer(view.free_space, (0.0, 0.0), 0.3)
        took_s = time.perf_counter() - begin_s
        times.append((took_s, took_s - (waited_s() - begin_wait_s)))
        time.sleep(max(0.0, next_s - time.monotonic()))
    return times


def measure_replay(seconds: float, seed: int) -> None:
    """Print whether a match comes back bit for bit."""
    table = Table(
        "robot | calls | the same in every bit: rate | file | target | verdict",
        f"A match of {seconds:g} s replayed",
        name="replay",
    )
    planning = PLAYERS["planning"]
    with TemporaryDirectory() as folder:
        match = Match(FIELD, 1, seed, ours=planning, theirs=planning)
        recorders = MatchRecorders(Path(folder), match, ("planning", "planning"))
        began_s = time.perf_counter()
        for moment in match.play(seconds):
            recorders.add(moment)
        recorders.close()
        took_s = time.perf_counter() - began_s
        for number, path in enumerate(recorders.paths):
            differences = Differences()
            for call in replay(Recording(path)):
                differences.add(call)
            same = f"{differences.same}/{differences.calls}"
            size = f"{path.stat().st_size / 2**20:.0f} MiB"
            table.row(str(number), differences.calls, same, size, "all", verdict(differences.is_same))
    table.note(f"played and recorded at {seconds / took_s:.1f} times real time")


@program()
def main(arguments: Namespace) -> None:
    """Run all parts."""
    rounds = 1 if arguments.quick else 24 if arguments.full else 8
    seconds = 1.0 if arguments.quick else 60.0
    measure_cost(rounds, arguments.seed)
    measure_replay(seconds, arguments.seed)
