"""Once an object is made no call waits for a compiler: all loops that it reaches are compiled or loaded before."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from robocup_vision.compiling.listed_loop import spelled_type
from robocup_vision.compiling.prepared_kernels import groups, modules, prepare, prepare_module
from robocup_vision.kernels.floor.colors import tabulate

TESTS = Path(__file__).parents[2]
# runs a workload with other frames than those that the list was made by, and counts what is compiled after the making
COUNT = """
import sys
import cv2
import numba.core.event
import kernel_workloads as work

cv2.setNumThreads(0)
seen = []
class Listener(numba.core.event.Listener):
    def on_start(self, event):
        dispatcher = event.data["dispatcher"]
        if is_made and dispatcher.py_func.__module__.startswith("robocup_vision"):
            seen.append(f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__name__}")
    def on_end(self, event):
        pass

is_made = False
with numba.core.event.install_listener("numba:compile", Listener()):
    workload = eval(sys.argv[1])
    next(workload)
    next(workload)
    is_made = True
    for _ in workload:
        pass
print(seen)
"""


def test_the_list_names_loops_that_are_there() -> None:
    assert {"mirror_field", "pinhole_edges", "pinhole_goal", "steering", "memory", "planning"} <= set(groups())
    unique = {json.dumps(entry) for entries in groups().values() for entry in entries}
    assert sum(len(entries) for entries in modules().values()) == len(unique)


def test_a_listed_loop_is_ready() -> None:
    prepare_module("floor.colors")
    listed = [arguments for kernel, arguments in modules()["floor.colors"] if kernel.endswith("tabulate")]
    ready = [[spelled_type(one) for one in types] for types in tabulate.overloads]
    assert all(arguments in ready for arguments in listed)
    prepare("no such object has loops")


# two groups of few loops, of which the first has some that take no time
PREPARE = """
import logging, sys
if "silent" in sys.argv:
    logging.getLogger("robocup_vision").setLevel(logging.ERROR)
sys.stderr.isatty = lambda: "terminal" in sys.argv
from robocup_vision.compiling.prepared_kernels import prepare_kernel, groups
from robocup_vision.compiling.waiting import note_ready
for ready, entry in enumerate(groups()["landmarks"][-2:]):
    note_ready(ready, 2)
    prepare_kernel(*entry)
note_ready(2, 2)
"""


@pytest.mark.parametrize(
    "how", ["plain", *(pytest.param(how, marks=pytest.mark.slow) for how in ("terminal", "silent"))]
)
def test_people_are_told_at_once_and_once_what_they_wait_for(how: str, tmp_path: Path) -> None:
    for cache in ("empty", "full"):
        done = subprocess.run(
            [sys.executable, "-c", PREPARE, how],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout == ""
        line, _, drawn = done.stderr.partition("\n")
        if cache == "full" or how == "silent":
            assert "once" not in done.stderr
            continue
        assert "0 of 2 loops are ready" in line
        assert "`robocup-vision warm-up` or a compiled wheel" in line
        assert drawn.endswith("] 2/2\n") if how == "terminal" else drawn == ""


def compiled_by(program: str, workload: str, environment: dict[str, str]) -> str:
    """Run a workload in a process of its own; what it prints: the loops that it compiled, and what went wrong."""
    done = subprocess.run(
        [sys.executable, "-c", program, workload],
        env={**environment, "PYTHONPATH": str(TESTS)},
        capture_output=True,
        text=True,
        timeout=1800,
        check=False,
    )
    return done.stdout if done.stdout == "[]\n" else done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    "workload",
    [
        "work.mirror('field', seed=77, count=15)",
        "work.pinhole('edges', seed=77)",
        "work.memory(77)",
    ],
)
def test_nothing_is_compiled_after_the_making(workload: str, tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    assert compiled_by(COUNT, workload, environment) == "[]\n"


@pytest.mark.slow
def test_warm_up_leaves_nothing_to_compile(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-m", "robocup_vision.cli", "warm-up", "--jobs", "2"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=1800, check=False)
    assert "loops are ready" in done.stdout, done.stderr
    count = COUNT.replace("is_made = False", "is_made = True")
    assert compiled_by(count, "work.mirror('field', seed=78, count=1)", environment) == "[]\n"
