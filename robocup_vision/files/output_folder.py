"""Checks output paths before the work begins, and writes output folders completely or not at all."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from fnmatch import fnmatch
from pathlib import Path

from field_models.errors import ArgumentError, FileError

_UNFINISHED = ".unfinished"


def require_folder(out: str | Path) -> None:
    """Refuse an output file whose folder does not exist.

    Raises
    ------
    FileError
        If the folder does not exist.
    """
    if not Path(out).resolve().parent.is_dir():
        raise FileError(out, "cannot be written: its folder does not exist")


def refuse_existing(out: str | Path, *, force: bool) -> None:
    """Refuse to replace an existing file unless `force` is set.

    Raises
    ------
    FileError
        If the file exists, and may not be replaced.
    """
    if not force and Path(out).exists():
        raise FileError(out, "is there already, nothing was written: choose another name, or replace it with --force")


@contextmanager
def telling_write_errors(path: str | Path) -> Iterator[None]:
    """Replace an OSError in a block by an error that names the path that cannot be written.

    Raises
    ------
    FileError
        Instead of an OSError.
    """
    try:
        yield
    except OSError as error:
        raise FileError(path, f"cannot be written ({error.strerror or error})") from None


def refuse_foreign_files(folder: Path, own: Sequence[str]) -> None:
    """Refuse a folder with files of other programs or of the user; the folder may be absent.

    Own files are those whose names match one of `own`, in which ``*`` stands for any text. Hidden files are ignored.

    Raises
    ------
    FileError
        If there are other files, or it is not a folder.
    """
    if not folder.exists():
        return
    if not folder.is_dir():
        raise FileError(folder, f"cannot be written ({os.strerror(errno.EEXIST)})")
    with telling_write_errors(folder):
        foreign = sorted(entry.name for entry in folder.iterdir() if not _is_own(entry.name, (*own, ".*")))
    if foreign:
        more = f" and {len(foreign) - 1} more" if len(foreign) > 1 else ""
        raise FileError(
            folder,
            f"holds files of others ({foreign[0]}{more}), nothing was written: choose another folder, or go on with "
            "--force, which keeps them",
        )


def require_empty_folder(folder: Path) -> None:
    """Refuse a folder that is not empty.

    Raises
    ------
    ArgumentError
        If there is anything in it, or it is a file.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ArgumentError(f"{folder} is not an empty folder; nothing was written")


@contextmanager
def written_at_once(folder: Path, own: Sequence[str]) -> Iterator[Path]:
    """Yield an empty folder to write into, whose content is moved to `folder` at the end of the block.

    If the block fails, `folder` is left unchanged. If missing, it is made with its parents. Files of an earlier run,
    whose names match `own` (see `refuse_foreign_files`), are replaced or deleted at the end.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    # in the same file system as the result, so that files can be renamed
    work = (folder.parent if made else folder) / f"{_UNFINISHED}-{folder.name}-{os.getpid()}"
    done = False
    try:
        with telling_write_errors(folder):
            work.mkdir(parents=True)
        try:
            yield work
        except FileError as error:
            path = _final_path(error.path, work, folder)
            raise FileError(path, error.problem, key=error.key, value=error.value, hint=error.hint) from None
        except OSError as error:
            # errors of reading are reported by other exceptions
            path = _final_path(Path(error.filename), work, folder) if isinstance(error.filename, str) else folder
            raise FileError(path, f"cannot be written ({error.strerror or error})") from None
        with telling_write_errors(folder):
            if made:
                work.rename(folder)
            else:
                _move_into(work, folder, own)
        done = True
    finally:
        if not done:
            shutil.rmtree(work, ignore_errors=True)
            for parent in made[1:]:
                with suppress(OSError):
                    parent.rmdir()


def _final_path(path: Path, work: Path, folder: Path) -> Path:
    """Return the final path of a file in `work`, which is the one that the user knows."""
    return folder / path.relative_to(work) if path.is_relative_to(work) else path


def _move_into(work: Path, folder: Path, own: Sequence[str]) -> None:
    fresh = {entry.name for entry in work.iterdir()}
    for entry in list(folder.iterdir()):
        if _is_own(entry.name, own) and entry.name not in fresh:
            entry.unlink()
    for name in sorted(fresh):
        (work / name).replace(folder / name)
    work.rmdir()


def _is_own(name: str, own: Sequence[str]) -> bool:
    return any(fnmatch(name, pattern) for pattern in own)
