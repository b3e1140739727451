"""Time that a fresh installation takes to make its first objects, compiled on the spot and from a compiled wheel.

Each object is made in a process of its own by an empty cache of compiled loops, with a second core to help: a mirror
camera's `Vision` and a forward camera's, `Steering`, `Memory`, and all loops at once by ``robocup-vision warm-up``
(--quick: `Memory` alone). "warm" is the same with the cache that the first left. Seconds are those of the making,
without the imports before it; "processor" counts both processes; where it is not nearly twice "cold s", other programs
had the second core. "verdict" is that of "cold s", on an idle machine. One making each (--full: medians of 3).

"from a wheel" (not --quick): this library's wheel is built, ``robocup-vision warm-up --wheel`` puts compiled loops into
it, pip installs that into an empty folder, and the first process that makes the object there is timed, without a cache
of its own. Building the two wheels is not part of it: that is done once for all robots of a kind.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

from benchmarks.harness import Table, program, verdict
from robocup_vision.compiling.compiled_wheel import compile_wheel

ROOT = Path(__file__).parents[2]
# made by a program of its own, which prints the seconds on the wall and those of all its processes
MAKE = """
import json, os, time
from field_models import load_field
from robocup_vision import Memory, MotionLimits, Steering, Vision, cli
from sim2d.rendering.cameras import sekimori_camera
from benchmarks.worlds.walks import FL

begin, before = time.perf_counter(), os.times()
{making}
after = os.times()
print(json.dumps([time.perf_counter() - begin, sum(after[:4]) - sum(before[:4])]))
"""


class Making(NamedTuple):
    """What is made, by which statement, and within how many seconds it is to be made; None: no aim."""

    name: str
    statement: str
    aim_s: float | None


MIRROR = Making("mirror camera's Vision", "Vision(load_field('ssl_2001'), sekimori_camera())", 8.0)
FORWARD = Making("forward camera's Vision", "Vision(load_field(FL.field_name), FL.camera)", 12.0)
STEERING = Making("Steering", "Steering(0.09, MotionLimits(0.4, 0.3, dead_time_s=0.03))", None)
MEMORY = Making("Memory", "Memory(load_field('ssl_2001'))", None)
ALL = Making("everything, by warm-up", "cli.main(['warm-up'])", 60.0)


def made_s(statement: str, cache: str, path: str = str(ROOT)) -> tuple[float, float]:
    """Seconds on the wall and of the processor for one making, by a cache folder and where modules are looked for."""
    done = subprocess.run(
        [sys.executable, "-c", MAKE.replace("{making}", statement)],
        cwd=tempfile.gettempdir(),  # modules of the present folder would come first
        env={**os.environ, "NUMBA_CACHE_DIR": cache, "PYTHONPATH": path},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        check=True,
    )
    wall_s, cpu_s = json.loads(done.stdout.splitlines()[-1])
    return wall_s, cpu_s


def install_compiled(folder: Path) -> Path:
    """Build this library's wheel, compile its loops, and install it in a folder; return where it is installed."""
    pip = [sys.executable, "-m", "pip", "--quiet", "--disable-pip-version-check"]
    source, wheels, site = folder / "source", folder / "wheels", folder / "site"
    # building in place would leave files behind
    hidden = shutil.ignore_patterns("__pycache__", "*.egg-info")
    for package in ("field_models", "robocup_vision", "sim2d"):
        shutil.copytree(ROOT / package, source / package, ignore=hidden)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    subprocess.run([*pip, "wheel", "--no-deps", "--wheel-dir", str(wheels), str(source)], check=True)
    (wheel,) = wheels.iterdir()
    compiled = compile_wheel(wheel, jobs=2)
    subprocess.run([*pip, "install", "--no-deps", "--target", str(site), str(compiled)], check=True)
    return site


def measure_installed(makings: tuple[Making, ...]) -> None:
    """Print what the first makings of an installation from a compiled wheel take."""
    columns = "made                     | cold s | target | verdict"
    table = Table(columns, "The first making in an installation from a wheel with compiled loops", name="from a wheel")
    with tempfile.TemporaryDirectory() as folder:
        site = install_compiled(Path(folder))
        for making in makings:
            wall_s, _ = made_s(making.statement, "", f"{site}{os.pathsep}{ROOT}")
            is_ok = making.aim_s is None or wall_s <= making.aim_s
            aim = None if making.aim_s is None else f"<= {making.aim_s:.0f}"
            table.row(making.name, f"{wall_s:.2f}", aim, None if making.aim_s is None else verdict(is_ok))


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    rounds = 3 if arguments.full else 1
    columns = "made                     | cold s | processor s | target | cold/processor | warm s | verdict"
    table = Table(columns, "The first making in a fresh installation", name="cold start")
    for making in (MEMORY,) if arguments.quick else (MIRROR, FORWARD, STEERING, MEMORY, ALL):
        cold: list[tuple[float, float]] = []
        warm: list[float] = []
        for _ in range(rounds):
            with tempfile.TemporaryDirectory() as cache:
                cold.append(made_s(making.statement, cache))
                warm.append(made_s(making.statement, cache)[0])
        wall_s, cpu_s = (statistics.median(column) for column in zip(*cold, strict=True))
        is_ok = making.aim_s is None or wall_s <= making.aim_s
        table.row(
            making.name,
            f"{wall_s:.1f}",
            f"{cpu_s:.1f}",
            None if making.aim_s is None else f"<= {making.aim_s:.0f}",
            f"{wall_s / cpu_s:.2f}",
            f"{statistics.median(warm):.2f}",
            None if making.aim_s is None else verdict(is_ok),
        )
    if not arguments.quick:
        measure_installed((MIRROR, FORWARD, STEERING, MEMORY))
