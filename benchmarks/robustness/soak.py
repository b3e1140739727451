"""Growth of memory while a robot's loop runs for long, on right, wrong and missing frames.

One process plays the loop of a robot at 15 frames a second: a mirror camera's `Vision` with everything that memory can
hold, steering, drawing now and then, and a pinhole camera's `Vision` beside it. Frames are rendered ones with odometry,
pictures that show no field, frames of another size or type (which must end in `FrameError`), and dropped ones. Colours
are learnt anew each time the light changes, which is often; memory and colours are forgotten once a minute.

What the process holds is read from the system each second. The growth is the median of the last fifth of the run less
the median of the second fifth: the first fills caches, whose size is bounded. Beside it: how many objects Python's
collector follows, after a collection. A run lasts 2 minutes (--quick: 20 s, --full: 30 minutes).
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401 - before NumPy is loaded

# isort: split
import gc
import time
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.harness import Table, program, verdict
from benchmarks.harness.machine import resident_mb
from field_models import load_field
from field_models.errors import FrameError
from robocup_vision import Memory, MotionLimits, Pose2, Steering, Vision, draw, load_camera
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.no_field import no_field_picture
from sim2d.rendering.random_scenes import CONDITIONS, sample

FRAME_S = 1 / 15
RIGHT_FRAMES = 48
# one allocator arena more or less is no growth; a leak of one frame a second would be 300 MB in half an hour
MAX_GROWTH_MB = 4.0
MAX_OBJECTS = 2000
GOAL_PICTURES = Path(__file__).parents[2] / "images" / "goal_four_legged"
LIMITS = MotionLimits(speed_mps=0.4, acceleration_mps2=0.3, dead_time_s=0.03)
STEP = Pose2(0.01, 0.002, 0.01)

UInt8Array = npt.NDArray[np.uint8]


@dataclass
class Soaked:
    """What was read each second: seconds since the start, MB in use; and what the loop met."""

    seconds: list[float] = field(default_factory=list)
    used_mb: list[float] = field(default_factory=list)
    objects: list[int] = field(default_factory=list)
    frames: int = 0
    refused: int = 0
    processor_s: float = 0.0

    def growth_mb(self) -> float:
        """Median of the last fifth less that of the second fifth."""
        fifth = max(1, len(self.used_mb) // 5)
        return float(np.median(self.used_mb[-fifth:]) - np.median(self.used_mb[fifth : 2 * fifth]))

    def more_objects(self) -> int:
        """Objects at the end less those a fifth after the start."""
        return self.objects[-1] - self.objects[len(self.objects) // 5]


def wrong_frame(size_px: tuple[int, int], index: int) -> object:
    """Return one of the things that are no frame of this camera."""
    width, height = size_px
    wrong: tuple[object, ...] = (
        np.zeros((height, width), dtype=np.uint8),
        np.zeros((height + 1, width, 3), dtype=np.uint8),
        np.zeros((height, width, 4), dtype=np.uint8),
        np.zeros((height, width, 3), dtype=np.float32),
        b"frame",
    )
    return wrong[index % len(wrong)]


def frames_of(right: list[UInt8Array], size_px: tuple[int, int], seed: int) -> Iterator[object]:
    """Yield right, wrong and missing frames without end."""
    index = 0
    while True:
        turn = index % 12
        if turn == 5:
            yield no_field_picture(size_px, index, seed)[1]
        elif turn == 8:
            yield None
        elif turn == 10:
            yield wrong_frame(size_px, index // 12)
        elif turn == 11:
            # other light, a view of another memory layout
            yield (right[index % len(right)] // 2)[:, ::-1][:, ::-1]
        else:
            yield right[index % len(right)]
        index += 1


def soak(minutes: float, seed: int) -> Soaked:
    """Run the loop."""
    pitch, camera = load_field("ssl_2001"), sekimori_camera()
    right = [one.frame for one in sample(pitch, camera, CONDITIONS["nominal"], seed, RIGHT_FRAMES, supersample=2)]
    mirror = Vision(pitch, camera, memory=Memory.of_everything(pitch))
    steering = Steering(robot_radius_m=pitch.robot_radius_m, limits=LIMITS)
    ahead = load_camera(GOAL_PICTURES / "camera.toml")
    goals = [np.asarray(cv2.imread(str(path)), np.uint8) for path in sorted((GOAL_PICTURES / "images").iterdir())[:8]]
    forward = Vision(load_field("four_legged_2007"), ahead)
    seen, goals_seen = frames_of(right, camera.size_px, seed), frames_of(goals, ahead.size_px, seed)
    soaked, begin = Soaked(), time.monotonic()
    next_read_s, processor_s = 0.0, time.process_time()
    while (now_s := time.monotonic() - begin) < 60 * minutes:
        frame = next(seen)
        t_s = soaked.frames * FRAME_S
        try:
            view = mirror.look(frame, t_s, odometry=STEP)  # type: ignore[arg-type]
            command = steering.steer(view.free_space, (0.2, 0.0), 0.3)
            if soaked.frames % 30 == 0 and isinstance(frame, np.ndarray):
                draw(view, frame, mirror)
            assert command.reason
        except FrameError:
            soaked.refused += 1
        if soaked.frames % 15 == 7:
            try:
                forward.look(next(goals_seen), t_s)  # type: ignore[arg-type]
            except FrameError:
                soaked.refused += 1
        soaked.frames += 1
        if soaked.frames % round(60 / FRAME_S) == 0:
            mirror.forget()
            forward.forget()
        if now_s >= next_read_s:
            next_read_s = now_s + 1.0
            soaked.seconds.append(now_s)
            soaked.used_mb.append(resident_mb())
            if len(soaked.seconds) % 5 == 1:
                gc.collect()
                soaked.objects.append(len(gc.get_objects()))
        time.sleep(max(0.0, begin + soaked.frames * FRAME_S - time.monotonic()))
    soaked.processor_s = time.process_time() - processor_s
    gc.collect()
    soaked.objects.append(len(gc.get_objects()))
    return soaked


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    minutes = 1 / 3 if arguments.quick else 30.0 if arguments.full else 2.0
    soaked = soak(minutes, arguments.seed)
    growth_mb, more = soaked.growth_mb(), soaked.more_objects()
    table = Table("figure               | measured | target | verdict: verdict", "The loop", name="soak")
    grows, follows = growth_mb <= MAX_GROWTH_MB, more <= MAX_OBJECTS
    table.row("minutes", minutes, None, None)
    table.row("frames", soaked.frames, None, None)
    table.row("frames refused", soaked.refused, "> 0", verdict(soaked.refused > 0))
    table.row("cores", soaked.processor_s / (60 * minutes), None, None)
    table.row("MB at the start", soaked.used_mb[0], None, None)
    table.row("MB at the end", soaked.used_mb[-1], None, None)
    table.row("growth, MB", growth_mb, f"<= {MAX_GROWTH_MB:g}", verdict(grows))
    table.row("growth, objects", more, f"<= {MAX_OBJECTS}", verdict(follows))
