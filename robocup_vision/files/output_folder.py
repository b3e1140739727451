"""Where output files go: a path is checked before the work, a folder holds no files of others, a failed run none."""

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


def refuse_foreign_files(folder: Path, own: Sequence[str]) -> None:
    """Refuse a folder, which may be absent, in which another program, or the user, keeps files.

    Its own files are those whose names match one of `own`, in which ``*`` stands for any text. Hidden files count as
    nobody's.

    Raises
    ------
    FileError
        If there are other files, or it is no folder.
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
        If it holds anything, or is a file.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ArgumentError(f"{folder} is not an empty folder; nothing was written")


@contextmanager
def written_at_once(folder: Path, own: Sequence[str]) -> Iterator[Path]:
    """Yield an empty folder to write into; its content goes to `folder` at the end of the block.

    Where the block fails, `folder` is as it was. It is made if missing, with those it lies in. Files of an earlier run,
    those of the names in `own` (`refuse_foreign_files`), are replaced or deleted at the end.

    Raises
    ------
    FileError
        If it cannot be written.
    """
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    # in the same file system as the result, whatever is mounted where
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
            # what a block reads it tells by errors of its own
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
    """Return where a file of `work` will lie, which is the name that the user knows."""
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
