"""Commands: their registration, options, counts and seeds, and evaluated recordings."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import cv2
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import load_field
from robocup_vision import Vision, cli, load_camera
from robocup_vision.commands import registered
from robocup_vision.commands.options import count, seed
from robocup_vision.recording.recorder import Recorder


@given(st.integers(max_value=0))
def test_counts_begin_at_one(value: int) -> None:
    assert count(str(1 - value)) == 1 - value
    with pytest.raises(argparse.ArgumentTypeError, match=f"^must be at least 1, got {value}$"):
        count(str(value))


@given(st.integers(min_value=0))
def test_seeds_begin_at_zero(value: int) -> None:
    assert seed(str(value)) == value
    with pytest.raises(argparse.ArgumentTypeError, match=f"^must not be negative, got {-1 - value}$"):
        seed(str(-1 - value))


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        ("evaluate nowhere --jobs 0", "--jobs: must be at least 1, got 0"),
        ("render --field ssl_2001 --camera sekimori out --seed -1", "--seed: must not be negative, got -1"),
    ],
)
def test_wrong_numbers_are_refused_before_anything_is_read(
    refused: Callable[..., str], words: str, problem: str
) -> None:
    prog = f"robocup-vision {words.split()[0]}"
    assert refused(*words.split()) == f"{prog}: argument {problem} (see {prog} --help)\n"


NAMES = {
    "evaluate", "compare", "calibrate", "check", "live", "map", "fields", "import-boxes", "match", "tournament",
    "render", "render-goal", "render-hall", "sensors", "learn-goal-evidence", "fit-evidence",
    "fit-edge-evidence", "train-balls",
    "train-kinds",
}  # fmt: skip


@pytest.fixture(scope="module")
def parsers():
    subparsers = argparse.ArgumentParser().add_subparsers()
    for add_parser in registered():
        add_parser(subparsers)
    return subparsers.choices


def test_own_and_registered_commands_are_found(parsers):
    assert set(parsers) >= NAMES


@pytest.mark.parametrize("name", sorted(NAMES))
def test_each_command_or_its_parts_say_what_runs_them(parsers, name):
    parser = parsers[name]
    parts = [a for a in parser._actions if isinstance(a, argparse._SubParsersAction)]
    runs = [p.get_default("run") for part in parts for p in part.choices.values()] + [parser.get_default("run")]
    assert any(callable(run) for run in runs)


def test_counts_and_seeds_of_all_commands_are_numbers_of_their_kind(parsers):
    todo, kinds = list(parsers.values()), {}
    while todo:
        for action in todo.pop()._actions:
            if isinstance(action, argparse._SubParsersAction):
                todo += action.choices.values()
            for option in action.option_strings:
                kinds.setdefault(option, set()).add(action.type)
    for option in ("--jobs", "--count", "--frames", "--second", "--runs", "--scenes", "--steps"):
        assert kinds[option] == {count}, option
    # matches check theirs themselves
    assert kinds["--seed"] <= {seed, int}


DATASET = Path(__file__).parents[3] / "images" / "omni_ssl_2001"


@pytest.mark.slow
def test_images_of_a_recording_are_linked_to_their_moments(tmp_path):
    """Only this finds a report whose images lead to other moments of the recording."""
    vision = Vision(load_field("ssl_2001"), load_camera(DATASET / "camera.toml"))
    frames = [cv2.imread(str(path)) for path in sorted((DATASET / "images").glob("*.png"))[:3]]
    with Recorder(tmp_path / "run.mcap", vision) as recorder:
        for number, frame in enumerate(frames):
            recorder.look(frame, t_s=100.0 + 0.5 * number)
    assert cli.main(["evaluate", str(tmp_path / "run.mcap"), "--out", str(tmp_path / "out")]) == 0
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    for t_s in ("0.000", "0.500", "1.000"):
        assert f'href="http://127.0.0.1:8090/?recording=run.mcap&amp;t={t_s}"' in page
