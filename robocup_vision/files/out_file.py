"""Where a command's file goes: looked at before the work that fills it, named when it cannot be written."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
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


def refuse_existing(out: str | Path, *, force: bool) -> None:
    """Refuse to replace a file that is there, unless that is asked for.

    Raises
    ------
    FileError
        If it is there, and may not be replaced.
    """
    if not force and Path(out).exists():
        raise FileError(out, "is there already, nothing was written: choose another name, or replace it with --force")


@contextmanager
def telling_write_errors(path: str | Path) -> Iterator[None]:
    """Turn the system's errors of a block into one that names what cannot be written.

    Raises
    ------
    FileError
        In place of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise FileError(path, f"cannot be written ({error.strerror or error})") from None
