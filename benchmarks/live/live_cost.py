"""What the live page costs a robot's loop: time of `Viewer.show`, of the vision beside it, processor and memory.

Loop: 640 x 480 frames of ssl_2001 in the nominal condition, 30 a second; blocks without `Viewer.show`, and blocks with
it and two pages open, in turns, so that a slow moment of the machine meets both. A page here is a process that reads
every picture and answers as a browser does; what a browser draws with is not counted. Vision: the 99th percentile of
`look`, with over without. Processor: time of the page's own process (pictures, sending) over the time of the blocks
with pages. Times by the clock say something on an undisturbed machine only: the load is told, and beside them stand
times of the loop's own thread on the processor, which other programs disturb less.

Memory: 6000 frames (--quick: 150; --full: 108000, an hour's) of 256 x 220 with their times 1/30 s apart, as fast as
they are shown, with a history of 2 s; how much the page's process, and this one, grew after the first third.
"""

from __future__ import annotations

import benchmarks.one_thread  # noqa: F401 - before NumPy is loaded

# isort: split
import os
import subprocess
import sys
import time
from argparse import Namespace

import numpy as np

from benchmarks.harness import Table, program, verdict
from benchmarks.harness.machine import resident_mb
from field_models import load_field
from robocup_vision import Vision
from robocup_vision.live import FeedSettings, Viewer
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, sample

FIELD = load_field("ssl_2001")
PAGES, RATE_HZ, FRAMES = 2, 30, 8
MAX_SHOW_MS, MAX_P99_RATIO, MAX_CPU, MAX_GROWTH_MB = 0.5, 1.2, 0.2, 8.0
_PAGE = """
import json, struct, sys
from websockets.sync.client import connect
address = sys.argv[1]
live, origin = address.replace("http", "ws") + "live", address.rstrip("/")
with connect(live, origin=origin, compression=None, max_size=None) as page:
    for got in page:
        if isinstance(got, bytes):
            (length,) = struct.unpack_from("<I", got)
            told = json.loads(got[12 : 12 + length])
            page.send(json.dumps({"type": "drawn", "robot": told["robot"], "number": told["number"]}))
"""


def frames_of(width: int, height: int, seed: int) -> tuple[Vision, list[np.ndarray]]:
    """Return a warm `Vision` and frames for it."""
    camera = sekimori_camera(width, height)
    vision = Vision(FIELD, camera)
    frames = [one.frame for one in sample(FIELD, camera, CONDITIONS["nominal"], seed, FRAMES)]
    for frame in frames:
        vision.look(frame)
    return vision, frames


def measure_loop(blocks: int, seconds: float, seed: int) -> None:
    """Print what the loop's time is with pages and without."""
    vision, frames = frames_of(640, 480, seed)
    look_ms: dict[bool, list[float]] = {False: [], True: []}
    busy_ms: dict[bool, list[float]] = {False: [], True: []}
    show_ms: list[float] = []
    show_busy_ms: list[float] = []
    cpu_s = wall_s = 0.0
    with Viewer(vision, port=0) as viewer:
        # memory that is shared is taken page by page at first
        for frame in frames:
            viewer.show(frame, vision.look(frame))
        for block in range(2 * blocks):
            watched = block % 2 == 1
            pages = [subprocess.Popen([sys.executable, "-c", _PAGE, viewer.address]) for _ in range(PAGES * watched)]
            time.sleep(1.5)
            begin_cpu_s, begin_s = viewer.cpu_s, time.monotonic()
            for number in range(round(seconds * RATE_HZ)):
                frame = frames[number % FRAMES]
                begin, begin_busy = time.perf_counter(), time.thread_time()
                view = vision.look(frame)
                seen, seen_busy = time.perf_counter(), time.thread_time()
                look_ms[watched].append(1e3 * (seen - begin))
                busy_ms[watched].append(1e3 * (seen_busy - begin_busy))
                if watched:
                    viewer.show(frame, view)
                    show_ms.append(1e3 * (time.perf_counter() - seen))
                    show_busy_ms.append(1e3 * (time.thread_time() - seen_busy))
                time.sleep(max(0.0, begin_s + (number + 1) / RATE_HZ - time.monotonic()))
            if watched:
                cpu_s += viewer.cpu_s - begin_cpu_s
                wall_s += time.monotonic() - begin_s
            for page in pages:
                page.terminate()
                page.wait()
    without, beside = (np.percentile(look_ms[watched], [50, 99]) for watched in (False, True))
    show = np.percentile(show_ms, [50, 90, 99])
    ratio, cpu = beside[1] / without[1], cpu_s / wall_s
    table = Table("figure | measured | target | verdict", "Loop, 640 x 480, 30 a second, two pages", name="loop")
    oks = [show[0] <= MAX_SHOW_MS, ratio <= MAX_P99_RATIO, cpu <= MAX_CPU]
    table.row("show, median ms", round(float(show[0]), 3), f"<= {MAX_SHOW_MS:g}", verdict(oks[0]))
    table.row("show, 90 % ms", round(float(show[1]), 3), "", "")
    table.row("show, p99 ms", round(float(show[2]), 3), "", "")
    table.row("look without pages, median ms", round(float(without[0]), 3), "", "")
    table.row("look with pages, median ms", round(float(beside[0]), 3), "", "")
    table.row("look without pages, p99 ms", round(float(without[1]), 3), "", "")
    table.row("look with pages, p99 ms", round(float(beside[1]), 3), "", "")
    table.row("p99 with over without", round(float(ratio), 3), f"<= {MAX_P99_RATIO:g}", verdict(oks[1]))
    busy = [float(np.percentile(busy_ms[watched], 99)) for watched in (False, True)]
    table.row("on the processor: p99 of show, ms", round(float(np.percentile(show_busy_ms, 99)), 3), "", "")
    table.row("on the processor: p99 of look, with over without", round(busy[1] / busy[0], 3), "", "")
    table.row("page's processor, cores", round(cpu, 3), f"<= {MAX_CPU:g}", verdict(oks[2]))
    table.row("load of the machine", round(os.getloadavg()[0], 1), "", "")


def measure_memory(count: int, seed: int) -> None:
    """Print how memory grew."""
    vision, frames = frames_of(256, 220, seed)
    views = [vision.look(frame, t_s=0.0) for frame in frames]
    sizes: dict[str, list[float]] = {"page": [], "robot": []}
    with Viewer(vision, port=0, settings=FeedSettings(history_s=2.0)) as viewer:
        for number in range(count):
            view = views[number % FRAMES]
            object.__setattr__(view, "t_s", number / RATE_HZ)
            viewer.show(frames[number % FRAMES], view)
            viewer.wait()
            if number in (count // 3, count - 1):
                sizes["page"].append(resident_mb(viewer.process_id))
                sizes["robot"].append(resident_mb())
    table = Table("process | frames | MB | grew by MB | target | verdict", "Memory", name="memory")
    for name, (before, after) in sizes.items():
        ok = after - before <= MAX_GROWTH_MB
        table.row(name, count, round(after, 1), round(after - before, 2), f"<= {MAX_GROWTH_MB:g}", verdict(ok))


@program()
def main(arguments: Namespace) -> None:
    """Run both parts."""
    blocks, seconds = (1, 1.5) if arguments.quick else (8, 15.0) if arguments.full else (5, 8.0)
    measure_loop(blocks, seconds, arguments.seed)
    measure_memory(150 if arguments.quick else 108_000 if arguments.full else 6000, arguments.seed)
