"""Every command adds its parser, sets what runs it, and is found by name."""

import argparse

import pytest

from robocup_vision.commands import registered

NAMES = {
    "evaluate", "compare", "calibrate", "check", "live", "map", "fields", "import-boxes", "match", "tournament",
    "render", "render-goal", "render-hall", "sensors", "learn-goal-evidence", "fit-evidence",
    "train-balls",
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
