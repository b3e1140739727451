"""Time of one frame of the mirror camera, look and steer together, as a ratio to cv2.cvtColor(BGR2HSV) of that frame.

Frames: 40 different ones (--quick: 4) of ssl_2001 in the nominal condition, cycled; colours are learnt before. Each of
500 frames (--quick: 60, --full: 2000) is copied into one buffer, as a camera's driver would, looked at without a prior
and with one (its own estimate from before, off by a normally distributed 10 mm and 1 degree, which is about what
odometry adds), and converted to HSV: the three in turns, in changing order, in one thread, so that a slow moment of the
machine meets all of them. Ratios are of medians; times are those of the thread, so that other work on the machine does
not count.

Further figures: the 99th percentile over the median, and in how many looks the colours were learnt anew; median and
99th percentile per stage; the 40 to 45 ms a frame that Sekimori et al. print for the computer of their robot, and their
way of locating as implemented here (method "hull", the rest of the frame the same); a first frame, whose colours must
be learnt (`Vision.forget` before it); the cold search by lines alone on rendered images of msl_6x4, whose carpet goes
on beyond the lines (`EdgeLocalizer.locate`, no prior, the carpet unknown); and the time to make a `Vision` in a
fresh process once compiled code is on the disk, without the imports.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401 - before NumPy is loaded

# isort: split
import math
import subprocess
import sys
from argparse import Namespace
from time import thread_time

import cv2
import numpy as np

from benchmarks.harness import Table, program, verdict
from field_models import load_field
from robocup_vision import MotionLimits, Steering, Vision
from robocup_vision.camera.downward import downward
from robocup_vision.geometry import Pose2
from robocup_vision.localization.localizer import frame_alone
from robocup_vision.localization.mirror import ALL_SAMPLES
from robocup_vision.localization.model_edges.field_edges import lines_only
from robocup_vision.localization.model_edges.localizer import EdgeLocalizer
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, sample

FIELD, CARPET_FIELD = load_field("ssl_2001"), load_field("msl_6x4")
# greatest ratio without a prior, with one
TARGETS = {(256, 220): (4.0, 3.5), (640, 480): (1.0, 0.85)}
MAX_SEARCH_MS, MAX_CONSTRUCTION_S = 150.0, 1.0
PRIOR_STD = (0.01, 0.01, math.radians(1.0))
VELOCITY_MPS, GOAL_BEARING_RAD = (0.2, 0.1), 0.3
PAPER_MS = "40-45"
CONSTRUCTION = """
from time import perf_counter
from field_models import load_field
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera
field, camera = load_field("ssl_2001"), sekimori_camera({width}, {height})
begin = perf_counter()
Vision(field, camera)
print(perf_counter() - begin)
"""


class Times:
    """Seconds of each look and steer, and of its stages."""

    def __init__(self) -> None:
        self.learnt = 0
        self.whole: list[float] = []
        self.stages: dict[str, list[float]] = {}

    def look(self, vision: Vision, steering: Steering, frame: np.ndarray, prior: Pose2 | None) -> Pose2 | None:
        """Time one frame; return the pose."""
        known = vision.colors
        begin = thread_time()
        view = vision.look(frame, prior=prior)
        seen = thread_time()
        steering.steer(view.free_space, VELOCITY_MPS, GOAL_BEARING_RAD)
        end = thread_time()
        self.whole.append(end - begin)
        self.learnt += vision.colors is not known
        for name, seconds in (*view.timings_s.items(), ("steer", end - seen)):
            if name != "total":
                self.stages.setdefault(name, []).append(seconds)
        return view.pose.pose if view.pose else None


def milliseconds(seconds: list[float]) -> float:
    """Median in milliseconds."""
    return 1e3 * float(np.median(seconds))


def measure_frames(size: tuple[int, int], frames: list[np.ndarray], count: int, rng: np.random.Generator) -> None:
    """Print the ratios, stages and first frames of one image size."""
    vision = Vision(FIELD, sekimori_camera(*size))
    steering = Steering(0.09, MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03))
    hull = Vision(FIELD, vision.camera, method="hull")
    without, with_prior, first, by_hull = Times(), Times(), Times(), Times()
    hsv: list[float] = []
    offsets = rng.normal(size=(count, 3)) * PRIOR_STD
    poses = [without.look(vision, steering, frame, None) for frame in frames]
    without = Times()
    buffer = np.empty_like(frames[0])
    for i in range(count):
        np.copyto(buffer, frames[i % len(frames)])
        pose = poses[i % len(frames)]
        prior = None if pose is None else Pose2(*(pose.array + offsets[i]))
        # in any order: what a `Vision` does in each third look would else fall on looks of one kind
        for turn in rng.permutation(3):
            if turn == 0:
                without.look(vision, steering, buffer, None)
            elif turn == 1:
                with_prior.look(vision, steering, buffer, prior)
            else:
                begin = thread_time()
                cv2.cvtColor(buffer, cv2.COLOR_BGR2HSV)
                hsv.append(thread_time() - begin)
    for frame in frames:
        vision.forget()
        first.look(vision, steering, frame, None)
        by_hull.look(hull, steering, frame, None)
    by_hull.whole.pop(0)  # learns the colours

    table = Table(
        f"{size[0]} x {size[1]}      | ms | ratio: time ratio | target | p99 / median | learnt anew | verdict",
        f"Whole frame, {count} frames; cvtColor(BGR2HSV) {milliseconds(hsv):.3f} ms; the paper: {PAPER_MS} ms",
        name=f"{size[0]} x {size[1]}",
    )
    for name, times, target in zip(("no prior", "prior"), (without, with_prior), TARGETS[size], strict=True):
        ratio = milliseconds(times.whole) / milliseconds(hsv)
        tail = float(np.percentile(times.whole, 99) / np.median(times.whole))
        figures = f"{milliseconds(times.whole):.3f}", f"{ratio:.2f}", f"{target:g}", f"{tail:.2f}"
        table.row(name, *figures, str(times.learnt), verdict(ratio <= target))
    for name, times in (("first frame", first), ('method "hull"', by_hull)):
        ratio = milliseconds(times.whole) / milliseconds(hsv)
        table.row(name, f"{milliseconds(times.whole):.3f}", f"{ratio:.2f}", None, None, None, None)
    stages = Table(("ms, median ", *(f"{name:>8}" for name in without.stages)), name=f"stages of {size[0]} x {size[1]}")
    for name, times in (("no prior", without), ("prior", with_prior), ("first frame", first)):
        stages.row(name, *(f"{milliseconds(seconds):.3f}" for seconds in times.stages.values()))
        if times is not first:
            stages.row("  p99", *(f"{1e3 * np.percentile(seconds, 99):.3f}" for seconds in times.stages.values()))


def measure_line_search(size: tuple[int, int], count: int, seed: int) -> tuple[list[float], int]:
    """Seconds of the search by the lines alone, each frame as if it were the first, and how many were located."""
    camera = sekimori_camera(*size)
    looking_down = downward(camera)
    localizer = EdgeLocalizer(lines_only(CARPET_FIELD), looking_down, ALL_SAMPLES)
    seconds: list[float] = []
    located = 0
    for drawn in sample(CARPET_FIELD, camera, CONDITIONS["nominal"], seed, count):
        evidence = frame_alone(drawn.frame, looking_down)
        if not seconds:  # compiled code is loaded before the clock runs
            localizer.locate(evidence)
        localizer.forget()
        begin = thread_time()
        located += bool(localizer.locate(evidence).pose)
        seconds.append(thread_time() - begin)
    return seconds, located


def measure_construction(size: tuple[int, int], times: int) -> float:
    """Seconds to make a `Vision` in a fresh process, compiled code cached."""
    program = CONSTRUCTION.format(width=size[0], height=size[1])
    runs = [subprocess.run([sys.executable, "-c", program], capture_output=True, text=True) for _ in range(times)]
    for run in runs:
        if run.returncode:
            raise SystemExit(run.stderr)
    return float(np.median([float(run.stdout) for run in runs]))


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    different, count = (4, 60) if arguments.quick else (40, 2000) if arguments.full else (40, 500)
    rows: list[tuple[str | None, ...]] = []
    for size in TARGETS:
        drawn = sample(FIELD, sekimori_camera(*size), CONDITIONS["nominal"], arguments.seed, different)
        frames = [one.frame for one in drawn]
        measure_frames(size, frames, count, np.random.default_rng(arguments.seed))
        label = f"{size[0]} x {size[1]}"
        search, located = measure_line_search(size, different, arguments.seed)
        slowest_ms = 1e3 * max(search)
        is_judged, ok = size == (640, 480), slowest_ms <= MAX_SEARCH_MS
        rows.append(
            (
                f"search by lines alone, {label}",
                f"{milliseconds(search):.1f}",
                f"{slowest_ms:.1f}",
                f"{located}/{different}",
                f"<= {MAX_SEARCH_MS:g} ms" if is_judged else None,
                verdict(ok) if is_judged else None,
            )
        )
        construction_s = measure_construction(size, 1 if arguments.quick else 3)
        ok = construction_s < MAX_CONSTRUCTION_S
        target = f"< {MAX_CONSTRUCTION_S:g} s"
        rows.append((f"making a Vision, {label}", f"{1e3 * construction_s:.0f}", None, None, target, verdict(ok)))
    columns = "once                               | ms | slowest | located: rate | target | verdict"
    table = Table(columns, name="once")
    for row in rows:
        table.row(*row)
