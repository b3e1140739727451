"""Ctrl-C at a terminal: long commands end, say how much is done, and go on from there when asked to.

A terminal sends the signal to a command and to all processes it has started; no test within one process shows that.
"""

from __future__ import annotations

import csv
import functools
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from robocup_vision import cli
from robocup_vision.calibration.omni.starts import Observer
from robocup_vision.files.resume_file import ResumeFile

DATASET = Path(__file__).parents[2] / "images" / "omni_ssl_2001"
WAIT_S = 120
pytestmark = [pytest.mark.slow, pytest.mark.usefixtures("without_plots")]


# the signal comes from inside, at a moment that is the same on any machine, to command and workers at once
INTERRUPTED_COMMAND = """
import importlib, os, signal, sys
from robocup_vision import cli

module, kind, name, times, *words = sys.argv[1:]
kind = getattr(importlib.import_module(module), kind)
method, calls = getattr(kind, name), []

def counted(*arguments, **keywords):
    result = method(*arguments, **keywords)
    calls.append(name)
    if len(calls) == int(times):
        os.killpg(0, signal.SIGINT)
    return result

setattr(kind, name, counted)
sys.exit(cli.main(words))
"""


def interrupt_at(method: Callable[..., object], times: int, *words: object, terminal: int | None = None) -> str:
    """Run a command, interrupt it and its processes when it has called a method so often, and return its errors."""
    # a test run in the background ignores interrupts, and what it starts would, too
    heed = functools.partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    place = [method.__module__, *method.__qualname__.split("."), str(times)]
    command = [sys.executable, "-c", INTERRUPTED_COMMAND, *place, *map(str, words)]
    error = subprocess.PIPE if terminal is None else terminal
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=error, text=True, start_new_session=True, preexec_fn=heed
    ) as process:
        try:
            _, text = process.communicate(timeout=WAIT_S)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130, text
    wait_until(lambda: not works(process.pid), "leaves workers behind")
    return text or ""


def wait_until(ready: Callable[[], bool], problem: str) -> None:
    end_s = time.monotonic() + WAIT_S
    while not ready():
        assert time.monotonic() < end_s, problem
        time.sleep(0.05)


def works(group: int) -> bool:
    """Return whether a process of a group still runs; one that has ended may not have been reaped yet."""
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, group_of_it = status.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(group_of_it) == group and state not in "ZX":
            return True
    return False


def test_evaluate_in_processes_goes_on_where_it_was(tmp_path: Path) -> None:
    """Only this finds rows that an interrupt of the command and its processes loses or doubles."""
    data, out = tmp_path / "data", tmp_path / "out"
    (data / "images").mkdir(parents=True)
    for name in ("dataset.toml", "camera.toml"):
        shutil.copy(DATASET / name, data)
    lines = [line for line in (data / "dataset.toml").read_text().splitlines() if not line.startswith("truth")]
    (data / "dataset.toml").write_text("\n".join(lines))
    sources = sorted((DATASET / "images").iterdir())
    for index in range(30):
        (data / "images" / f"{index:04d}.png").symlink_to(sources[index % len(sources)])
    error = interrupt_at(ResumeFile.add, 6, "evaluate", data, "--jobs", 2, "--out", out)
    assert error.startswith("robocup-vision evaluate: interrupted: ")
    assert "of 30 images are done and kept in" in error
    with (out / "results.csv").open() as stream:
        done = list(csv.DictReader(stream))
    assert 5 <= len(done) < 30
    assert cli.main(["evaluate", str(data), "--jobs", "2", "--out", str(out), "--resume"]) == 0
    with (out / "results.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert rows[: len(done)] == done
    assert len({row["image"] for row in rows}) == len(rows) == 30


def test_a_tournament_goes_on_where_it_was(tmp_path: Path) -> None:
    """Only this finds matches that an interrupt loses or doubles."""
    words = ["tournament", "--players", "1", "--seconds", "1", "--matches", "4", "--jobs", "2", "--out"]
    out = tmp_path / "out"
    error = interrupt_at(ResumeFile.add, 2, *words, out)
    assert error.startswith("robocup-vision tournament: interrupted: ")
    assert "of 4 matches are played and kept in" in error
    assert [path.name for path in out.iterdir()] == ["unfinished.jsonl"]
    assert cli.main([*words, str(out), "--resume"]) == 0
    assert cli.main([*words, str(tmp_path / "whole")]) == 0
    assert [path.name for path in out.iterdir()] == ["tournament.json"]
    assert (out / "tournament.json").read_bytes() == (tmp_path / "whole" / "tournament.json").read_bytes()


def test_a_calibration_says_how_far_it_has_come(tmp_path: Path) -> None:
    """Only this finds a bar that a terminal does not get, or a file that is left of an early interrupt."""
    screen, terminal = os.openpty()
    out = tmp_path / "camera.toml"
    words = ["calibrate", "omni", DATASET / "images", "--field", "ssl_2001", "--frames", "3", "--out", out]
    interrupt_at(Observer.look, 2, *words, terminal=terminal)
    os.close(terminal)
    seen = os.read(screen, 65536)
    os.close(screen)
    assert b"robocup-vision calibrate: interrupted: points " in seen
    assert b"/3" in seen
    assert list(tmp_path.iterdir()) == []


def test_a_calibration_goes_on_where_it_was(tmp_path: Path) -> None:
    """Only this finds a calibration that ends elsewhere once it was interrupted."""
    words = ["calibrate", "omni", str(DATASET / "images"), "--field", "ssl_2001", "--frames", "2", "--out"]
    unfinished = tmp_path / "camera.unfinished.jsonl"
    error = interrupt_at(ResumeFile.add, 4, *words, tmp_path / "camera.toml")
    assert error.startswith("robocup-vision calibrate: interrupted: ")
    assert f"starts are finished and kept in {unfinished}; --resume goes on" in error
    assert list(tmp_path.iterdir()) == [unfinished]
    assert cli.main([*words, str(tmp_path / "camera.toml"), "--resume"]) == 0
    assert not unfinished.exists()
    assert cli.main([*words, str(tmp_path / "whole.toml")]) == 0
    assert (tmp_path / "camera.toml").read_bytes() == (tmp_path / "whole.toml").read_bytes()
