"""The README's commands exist and it stays short; tests/docs/test_pages.py runs its programs."""

import re
import shlex
from pathlib import Path

import pytest

from robocup_vision import cli

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


PROGRAMS = blocks("python")
COMMANDS = [line for block in blocks("console") for line in block.splitlines()]


def test_there_is_a_program_for_each_use():
    assert len(PROGRAMS) >= 3


def test_the_readme_stays_short():
    text = re.sub(r"^<!-- figures: .*?^<!-- end of figures -->$", "", README, flags=re.MULTILINE | re.DOTALL)
    assert len(text.splitlines()) <= 120


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_are_understood(command):
    name, *arguments = shlex.split(command)
    assert name == "robocup-vision"
    assert cli.command_parser().parse_args(arguments).run


def test_linked_files_are_there():
    for target in re.findall(r"\]\(([^)#]+)", README):
        assert target.startswith("https://") or (ROOT / target).exists(), target
