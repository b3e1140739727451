"""Counts and seeds of commands: the least that is taken, and the line that names option and value where it is not."""

from __future__ import annotations

import argparse

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision import cli
from robocup_vision.commands.options import count, seed

# what the commands need besides the option
COMMANDS = {
    "evaluate": ["nowhere"],
    "calibrate omni": ["nowhere", "--field", "ssl_2001", "--out", "c.toml"],
    "calibrate forward": ["nowhere", "--field", "ssl_2001", "--out", "c.toml"],
    "warm-up": [],
    "tournament": [],
    "render": ["--field", "ssl_2001", "--camera", "sekimori", "out"],
    "render-goal": ["out"],
    "render-hall": ["out"],
    "sensors learn": ["--out", "s.toml"],
    "learn-goal-evidence": ["out.toml"],
}


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
    ("command", "option", "value", "problem"),
    [
        ("evaluate", "--jobs", "0", "must be at least 1, got 0"),
        ("evaluate", "--jobs", "many", "must be a whole number, got 'many'"),
        ("calibrate omni", "--jobs", "0", "must be at least 1, got 0"),
        ("calibrate forward", "--frames", "0", "must be at least 1, got 0"),
        ("warm-up", "--jobs", "-2", "must be at least 1, got -2"),
        ("tournament", "--jobs", "0", "must be at least 1, got 0"),
        ("render", "--count", "0", "must be at least 1, got 0"),
        ("render", "--seed", "-1", "must not be negative, got -1"),
        ("render-goal", "--count", "0", "must be at least 1, got 0"),
        ("render-goal", "--seed", "-1", "must not be negative, got -1"),
        ("render-hall", "--second", "0", "must be at least 1, got 0"),
        ("render-hall", "--count", "0", "must be at least 1, got 0"),
        ("render-hall", "--seed", "-1", "must not be negative, got -1"),
        ("calibrate omni", "--frames", "0", "must be at least 1, got 0"),
        ("sensors learn", "--runs", "0", "must be at least 1, got 0"),
        ("sensors learn", "--frames", "0", "must be at least 1, got 0"),
        ("learn-goal-evidence", "--seed", "-1", "must not be negative, got -1"),
    ],
)
def test_wrong_numbers_are_refused_before_anything_is_read(
    capsys: pytest.CaptureFixture[str], command: str, option: str, value: str, problem: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main([*command.split(), *COMMANDS[command], option, value])
    assert stop.value.code == 2
    prog = f"robocup-vision {command}"
    assert capsys.readouterr().err == f"{prog}: argument {option}: {problem} (see {prog} --help)\n"
