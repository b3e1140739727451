"""What is said of a file that must be refused."""

from collections.abc import Callable
from pathlib import Path

import pytest

from field_models.errors import RobocupVisionError


def problem_of(load: Callable[[Path], object], path: Path, text: str, old: str, new: str) -> str:
    """Write a text, one place of it changed, and load it: return the one line that refuses it, less the file's name."""
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(RobocupVisionError) as refused:
        load(path)
    line, name = str(refused.value), f"{path}: "
    assert line.startswith(name)
    assert "\n" not in line
    return line.removeprefix(name)
