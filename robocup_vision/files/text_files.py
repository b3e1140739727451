"""Writes text files, and names the file where it cannot be written."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from robocup_vision.files.output_folder import telling_write_errors


def write_text(path: str | Path, text: str) -> None:
    """Write a text.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    with telling_write_errors(path):
        # the name of a file, which a text may hold, may be no text
        Path(path).write_text(text, encoding="utf-8", errors="backslashreplace")


def write_lines(path: str | Path, lines: Iterable[str]) -> None:
    """Write lines, each with its end; raises as `write_text` does."""
    write_text(path, "".join(f"{line}\n" for line in lines))


def write_json(path: str | Path, values: Mapping[str, Any]) -> None:
    """Write JSON values; raises as `write_text` does."""
    write_text(path, json.dumps(values, indent=2, allow_nan=False) + "\n")
