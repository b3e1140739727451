"""Reads and writes text files, with errors that name the file.

Also formats plain values as TOML, for camera and rig files.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from numbers import Integral
from pathlib import Path
from typing import Any

from field_models.errors import FileError
from robocup_vision.files.output_folder import telling_write_errors


def read_text(path: str | Path) -> str:
    """Read a text, without the byte order mark that some editors put in front.

    Raises
    ------
    FileError
        If the file cannot be read, or is not UTF-8 text.
    """
    try:
        return Path(path).read_text(encoding="utf-8-sig")
    except OSError as error:
        raise FileError(path, f"cannot be read ({error.strerror or error})") from None
    except UnicodeDecodeError:
        raise FileError(path, "is not UTF-8 text") from None


def toml_lines(values: Mapping[str, Any]) -> list[str]:
    """Return a line ``key = value`` for each number, Boolean, text or sequence of these; None is omitted."""
    return [f"{key} = {_toml(value)}" for key, value in values.items() if value is not None]


def _toml(value: Any) -> str:
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, str | bool):
        return json.dumps(value, ensure_ascii=False)
    return str(int(value)) if isinstance(value, Integral) else repr(float(value))


def write_text(path: str | Path, text: str) -> None:
    """Write a text.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    with telling_write_errors(path):
        # a file name in the text may not be valid Unicode
        Path(path).write_text(text, encoding="utf-8", errors="backslashreplace")


def write_lines(path: str | Path, lines: Iterable[str]) -> None:
    """Write lines, each with a line end; raises as `write_text` does."""
    write_text(path, "".join(f"{line}\n" for line in lines))


def write_json(path: str | Path, values: Mapping[str, Any]) -> None:
    """Write JSON values; raises as `write_text` does."""
    write_text(path, json.dumps(values, indent=2, allow_nan=False) + "\n")
