"""Finds a writable folder for compiled code, and digests of the sources that it was compiled from.

When the first loop is compiled, the logger ``robocup_vision`` gives one warning that explains the delay.

numba keeps compiled loops in the folder that ``NUMBA_CACHE_DIR`` names, else beside the source files, else in the
user's cache folder. If none of them is writable, numba refuses to define a loop; this module then uses a temporary one.
"""

from __future__ import annotations

import hashlib
import logging
import multiprocessing
import os
import re
import shutil
import stat
import sys
import tempfile
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.event import Listener, register

from field_models.errors import RobocupVisionError

VARIABLE = "NUMBA_CACHE_DIR"
_IMPORT, _WORD = re.compile(rb"^from (\S+) import (\([^)]*\)|.*)", re.MULTILINE), re.compile(rb"\w+")
# packages with loops, and the module that determines how they are compiled
_LOOPS = ("robocup_vision.kernels", "sim2d.kernels", "robocup_vision.compiling.loops")


class JitStaysOnWarning(RuntimeWarning):
    """`NUMBA_DISABLE_JIT` is ignored, since a frame would take minutes without compiled code."""


class CompileCacheWarning(RuntimeWarning):
    """Compiled code is kept in a temporary folder; after that is deleted, it must be compiled again."""


def ensure_compile_cache(kernels: Path) -> None:
    """Make sure that the compiled loops of a package can be stored; call it before the first of them is defined.

    Warns
    -----
    JitStaysOnWarning
        If compiling was disabled; it is enabled for this process.
    CompileCacheWarning
        If a temporary folder is used. The process and those that it starts then use it for all loops.

    Raises
    ------
    RobocupVisionError
        If no temporary folder can be written either.
    """
    tell_of_compiling(kernels)
    config: Any = numba.config  # its names are set when it is loaded
    if config.DISABLE_JIT:
        config.DISABLE_JIT = 0
        warnings.warn(
            "NUMBA_DISABLE_JIT is not obeyed: robocup_vision's loops are compiled all the same, and debuggers and"
            " coverage do not see into them",
            JitStaysOnWarning,
            stacklevel=2,
        )
    given = config.CACHE_DIR
    if given and _is_writable(Path(given)):
        return
    sources = sorted(kernels.rglob("__init__.py"))
    if not given and all(_numba_has_folder(source) for source in sources):
        _copy_shipped_loops(sources)
        return
    folder = _temporary_folder()
    # the variable is for child processes; numba has read it in this process already
    config.CACHE_DIR = os.environ[VARIABLE] = str(folder)
    _copy_shipped_loops(sources)
    tried = (
        f"{VARIABLE}={given} cannot be written"
        if given
        else f"neither {kernels} nor the user's cache folder can be written"
    )
    warnings.warn(
        f"{tried}: compiled code is kept in {folder}, which may be gone after the next start of this machine. "
        f"Set {VARIABLE} to a folder that stays",
        CompileCacheWarning,
        stacklevel=2,
    )


@cache
def source_digest(module: str) -> str | None:
    """Return a digest of the source text of a module and of our modules that it imports; None without a source file.

    A compiled loop contains loops and constants of other files. By this digest it is compiled again if any of them has
    changed, and kept if files have only been copied.
    """
    path = getattr(sys.modules.get(module), "__file__", None)
    if path is None or not Path(path).is_file():
        return None
    text = Path(path).read_bytes()
    imported = set()
    for package, names in _IMPORT.findall(text):
        imported |= {package.decode(), *(f"{package.decode()}.{name.decode()}" for name in _WORD.findall(names))}
    digest = hashlib.sha256(text)
    for name in sorted(imported & sys.modules.keys()):
        if name.startswith(_LOOPS):
            digest.update((source_digest(name) or "").encode())
    return digest.hexdigest()


def _copy_shipped_loops(sources: list[Path]) -> None:
    """Copy compiled loops that were shipped with a read-only installation to the folder that numba uses instead."""
    for source in sources:
        own, folder = source.parent / "__pycache__", Path(_probe(source).stats.cache_path)
        # loops that cannot be copied are compiled
        with suppress(OSError):
            for shipped in own.glob("*.nb[ci]") if folder != own else ():
                kept = folder / shipped.name
                if not kept.exists() or kept.stat().st_mtime < shipped.stat().st_mtime:
                    folder.mkdir(parents=True, exist_ok=True)
                    beside = folder / f"{shipped.name}.{os.getpid()}"
                    shutil.copyfile(shipped, beside)
                    beside.replace(kept)


def _numba_has_folder(source: Path) -> bool:
    """Return whether numba can store the loops of a source file, so that defining one does not fail."""
    try:
        _probe(source)
    except RuntimeError:
        return False
    return True


def _probe(source: Path) -> Any:
    """Define a loop with the file name of a source file."""
    scope: dict[str, Any] = {"__name__": __name__}
    exec(compile("def probe():\n    pass\n", str(source), "exec"), scope)
    return numba.njit(cache=True)(scope["probe"])


def _is_writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


def _temporary_folder() -> Path:
    """Return a folder of this user, the same one at each start; a new one if another user owns the folder of that name.

    Compiled code is executed when it is loaded, so no other user may be able to write it.
    """
    user = os.getuid() if hasattr(os, "getuid") else "user"
    try:
        folder = Path(tempfile.gettempdir()) / f"robocup_vision-compiled-{user}"
        try:
            folder.mkdir(mode=0o700, exist_ok=True)
            found = folder.lstat()
            is_own = not hasattr(os, "getuid") or (found.st_uid == os.getuid() and not found.st_mode & 0o022)
            if stat.S_ISDIR(found.st_mode) and is_own and _is_writable(folder):
                return folder
        except OSError:
            pass
        return Path(tempfile.mkdtemp(prefix="robocup_vision-compiled-"))
    except OSError as error:
        raise RobocupVisionError(
            f"no folder for compiled code can be written ({error}): set {VARIABLE} to one that can"
        ) from None


_LOG = logging.getLogger("robocup_vision")


class _Wait(Listener):
    """Listens to numba's events, which report that a loop is compiled because it is not in the cache."""

    def __init__(self) -> None:
        self.folders: set[Path] = set()
        self.has_announced = False

    def on_start(self, event: Any) -> None:
        source = Path(event.data["dispatcher"].py_func.__code__.co_filename)
        if self.has_announced or not any(folder in source.parents for folder in self.folders):
            return
        self.has_announced = True
        # a worker process does not log: its parent process has logged the warning
        if multiprocessing.parent_process() is None:
            _LOG.warning(
                "robocup_vision compiles loops for this machine, once: that takes up to some minutes "
                "(`robocup-vision warm-up` or a compiled wheel does it ahead)"
            )

    def on_end(self, event: Any) -> None:
        pass


_wait = _Wait()


def tell_of_compiling(kernels: Path) -> None:
    """Log a warning when the first loop of a folder or its subfolders is compiled."""
    if not _wait.folders:
        register("numba:compile", _wait)  # type: ignore[no-untyped-call]
    _wait.folders.add(kernels)
