"""Where a command's file goes: looked at before the work that fills it, named when it cannot be written."""

from __future__ import annotations

from pathlib import Path

from field_models.errors import FileError


def require_folder(out: str | Path) -> None:
    """Refuse a file to write whose folder does not exist.

    Raises
    ------
    FileError
        If it does not.
    """
    if not Path(out).resolve().parent.is_dir():
        raise FileError(out, "cannot be written: its folder does not exist")
