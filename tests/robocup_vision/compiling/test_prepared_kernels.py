"""Loops made ready: by the lists, with a second process, with less optimization, told to who waits."""

from __future__ import annotations

import contextlib
import gc
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from robocup_vision.compiling.prepared_kernels import (
    groups,
    modules,
    prepare,
    prepare_loops,
    quick_compiling,
    spelled_type,
)
from robocup_vision.kernels.floor.colors import tabulate

TESTS = Path(__file__).parents[2]
# runs a workload with other frames than those that the list was made by, and names the loops that a call made ready,
# whether compiled or loaded: so it tells the same with a cache that is full; of one package, as others make the frames
COUNT = """
import sys
import cv2
from numba.core.dispatcher import Dispatcher
import kernel_workloads as work

cv2.setNumThreads(0)
seen, compile_one = [], Dispatcher.compile

def counted(dispatcher, types):
    before = len(dispatcher.overloads)
    done = compile_one(dispatcher, types)
    of = dispatcher.py_func
    if is_made and len(dispatcher.overloads) > before and of.__module__.startswith(sys.argv[2]):
        seen.append(f"{of.__module__}.{of.__name__}")
    return done

is_made, Dispatcher.compile = False, counted
workload = eval(sys.argv[1])
next(workload)
next(workload)
is_made = True
for _ in workload:
    pass
print(seen)
"""
# a package of two small loops, as the library's own take long to compile
FEW_LOOPS = {
    "__init__": "",
    "kernels/__init__": """
from pathlib import Path
from robocup_vision.compiling.compile_cache import ensure_compile_cache
ensure_compile_cache(Path(__file__).parent)
""",
    **{
        f"kernels/{name}": f"""
from robocup_vision.compiling.loops import compiled
@compiled
def {name}(value):
    return value + 1
"""
        for name in ("first", "second")
    },
}
# a warm-up of few loops, and then which of them a program that needs them still compiles
WARM_UP = """
import sys
from robocup_vision.compiling import prepared_kernels
few = prepared_kernels.modules(["few_loops"])
prepared_kernels.modules = lambda packages: few
from robocup_vision import cli
sys.exit(cli.main(["warm-up", "--jobs", "2"]))
"""
MISSED = """
import logging, sys
import numba.core.event
if "silent" in sys.argv:
    logging.getLogger("robocup_vision").setLevel(logging.ERROR)
from robocup_vision.compiling.prepared_kernels import prepare
sys.executable = [sys.executable, *sys.argv[1:]][-1]
with numba.core.event.install_recorder("numba:compile") as recorder:
    prepare("few", "few_loops")
print(sum(event.is_start for _, event in recorder.buffer))
"""


@pytest.fixture
def run(tmp_path: Path) -> Callable[..., tuple[str, str]]:
    """Return a function that runs a program in a process of its own, with a cache that is empty at first.

    The program is a text or a module's name. The function returns what it prints, and its errors.
    """
    package = tmp_path / "few_loops"
    (package / "kernels").mkdir(parents=True)
    for name, text in FEW_LOOPS.items():
        (package / f"{name}.py").write_text(text, encoding="ascii")
    listed = {"few": [[f"{name}.{name}", ["int64"]] for name in ("first", "second")]}
    (package / "kernels" / "signatures.json").write_text(json.dumps(listed), encoding="ascii")

    def run(program: str, *words: str) -> tuple[str, str]:
        folders = {"PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
        done = subprocess.run(
            [sys.executable, *(["-c", program] if "\n" in program else ["-m", program]), *words],
            env={**os.environ, **folders},
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        return done.stdout, done.stderr

    return run


def test_the_lists_name_loops_that_are_there() -> None:
    assert {"mirror_field", "pinhole_edges", "pinhole_goal", "steering", "memory", "planning"} <= set(groups())
    assert {"mirror_frames", "forward_frames", "pictures", "hall"} == set(groups("sim2d"))
    listed = [*groups().values(), *groups("sim2d").values()]
    unique = {json.dumps(entry) for entries in listed for entry in entries}
    assert sum(map(len, modules(["robocup_vision", "sim2d"]))) == len(unique)


def test_a_package_without_a_list_has_no_loops() -> None:
    assert groups("field_models") == {}


def test_a_listed_loop_is_ready() -> None:
    (entries,) = (
        one for one in modules(["robocup_vision"]) if one[0][0].startswith("robocup_vision.kernels.floor.colors.")
    )
    prepare_loops(entries)
    listed = [arguments for kernel, arguments in entries if kernel.endswith("tabulate")]
    ready = [[spelled_type(one) for one in types] for types in tabulate.overloads]
    assert all(arguments in ready for arguments in listed)
    prepare("no such object has loops")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("workload", "package"),
    [
        ("work.mirror('field', seed=77, count=3)", "robocup_vision"),
        ("work.pinhole('edges', seed=77, count=3)", "robocup_vision"),
        ("work.memory(77)", "robocup_vision"),
        ("work.hall(77)", "sim2d"),
    ],
)
def test_no_loop_is_compiled_or_loaded_after_the_making(workload: str, package: str) -> None:
    """Only this finds a loop that the list lacks, so that a robot's first frames wait."""
    done = subprocess.run(
        [sys.executable, "-c", COUNT, workload, package],
        env={**os.environ, "PYTHONPATH": str(TESTS)},
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert done.stdout == "[]\n", done.stderr


@pytest.mark.slow
def test_warm_up_leaves_nothing_to_compile(run: Callable[..., tuple[str, str]]) -> None:
    """Only this finds a warm-up whose processes keep what they compile where no start looks for it."""
    assert run(WARM_UP)[0].startswith("2 loops are ready")
    assert run(MISSED)[0] == "0\n"


def test_a_type_that_is_not_known_is_told() -> None:
    from numba import types

    with pytest.raises(TypeError, match="cannot be listed"):
        spelled_type(types.ListType(types.int64))
    assert spelled_type(types.Array(types.uint8, 2, "A", readonly=True)) == ["array", "uint8", 2, "A", False]


@pytest.mark.parametrize("named", [None, "1"])
def test_prepared_loops_are_optimized_less_unless_the_user_names_a_level_and_the_level_comes_back(
    monkeypatch: pytest.MonkeyPatch, named: str | None
) -> None:
    from numba.core import config

    monkeypatch.delenv("NUMBA_OPT", raising=False)
    if named is not None:
        monkeypatch.setenv("NUMBA_OPT", named)
    before, thresholds = config.OPT, gc.get_threshold()
    with contextlib.suppress(KeyError), quick_compiling():
        assert (2 if named is None else before) == config.OPT
        assert gc.get_threshold() > thresholds
        raise KeyError
    assert (config.OPT, gc.get_threshold()) == (before, thresholds)


@pytest.mark.slow
def test_a_second_process_is_asked_once_for_the_same_loops_and_people_are_told_once(
    run: Callable[..., tuple[str, str]], tmp_path: Path
) -> None:
    """Only this finds a first start that compiles alone, and a wait that nobody is told of."""
    helper = tmp_path / "helper"
    helper.write_text('#!/bin/sh\necho "$@" >> "$0.asked"\n', encoding="ascii")
    helper.chmod(0o755)
    count, told = run(MISSED, str(helper))
    assert (count, told.count("`robocup-vision warm-up` or a compiled wheel"), told.count("\n")) == ("2\n", 1, 1)
    asked = helper.with_suffix(".asked").read_text(encoding="ascii")
    assert asked == "-m robocup_vision.compiling.prepared_kernels few few_loops\n"
    assert run(MISSED) == ("0\n", "")


@pytest.mark.slow
def test_loops_are_compiled_in_silence_and_without_a_second_process(run: Callable[..., tuple[str, str]]) -> None:
    """Only this finds a first start that needs the other process, or a line where nobody asked for it."""
    assert run(MISSED, "silent", "no_such_program") == ("2\n", "")


@pytest.mark.slow
def test_what_the_second_process_compiles_is_found(run: Callable[..., tuple[str, str]]) -> None:
    """Only this finds a second process that compiles for nothing."""
    run("robocup_vision.compiling.prepared_kernels", "few", "few_loops")
    assert run(MISSED)[0] == "0\n"
