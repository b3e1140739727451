"""Finds a folder for compiled code that can be written, and tells code that was made of other sources.

The logger ``robocup_vision`` tells once, as a warning, what a program waits for when the first loop is compiled.

numba keeps compiled loops in the folder that ``NUMBA_CACHE_DIR`` names, else beside the source files, else in the
user's cache folder. Where none of them can be written it refuses to define a loop; here a temporary folder is used.
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
# where loops are, and what tells how they are compiled
_LOOPS = ("robocup_vision.kernels", "sim2d.kernels", "robocup_vision.compiling.loops")


class JitStaysOnWarning(RuntimeWarning):
    """`NUMBA_DISABLE_JIT` is not obeyed: uncompiled, a frame would take minutes."""


class CompileCacheWarning(RuntimeWarning):
    """Compiled code is kept in a temporary folder: it will be compiled again when that is gone."""


def ensure_compile_cache(kernels: Path) -> None:
    """Make sure that the loops of a package can be kept somewhere; call it before the first of them is defined.

    Warns
    -----
    JitStaysOnWarning
        If compiling is disabled, which is then enabled for this process.
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
    if not given and all(_numba_finds_place(source) for source in sources):
        _take_along(sources)
        return
    folder = _temporary_folder()
    # the variable is for the processes that this one starts: numba has read it already
    config.CACHE_DIR = os.environ[VARIABLE] = str(folder)
    _take_along(sources)
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
    """Return a digest of a module's source text and of all of ours that it imports; None if it is no file's.

    A loop holds the code of loops that it calls, and the constants that it reads, of other files: by this digest it is
    compiled anew where any of them has changed, and kept where files have only been copied.
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


def _take_along(sources: list[Path]) -> None:
    """Copy loops that came with an installation that cannot be written to where numba keeps others of source files."""
    for source in sources:
        own, folder = source.parent / "__pycache__", Path(_probe(source).stats.cache_path)
        # what cannot be copied is compiled
        with suppress(OSError):
            for shipped in own.glob("*.nb[ci]") if folder != own else ():
                kept = folder / shipped.name
                if not kept.exists() or kept.stat().st_mtime < shipped.stat().st_mtime:
                    folder.mkdir(parents=True, exist_ok=True)
                    beside = folder / f"{shipped.name}.{os.getpid()}"
                    shutil.copyfile(shipped, beside)
                    beside.replace(kept)


def _numba_finds_place(source: Path) -> bool:
    """Return whether numba can keep the loops of a source file's folder: defining one must not fail."""
    try:
        _probe(source)
    except RuntimeError:
        return False
    return True


def _probe(source: Path) -> Any:
    """Define a loop as one of a source file."""
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
    """Return a folder of this user's own, the same one at each start; a new one where another user holds its name.

    Compiled code is run when it is read, so nobody else may write it.
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
    """Hears numba compile, which it tells when a loop is in no cache."""

    def __init__(self) -> None:
        self.folders: set[Path] = set()
        self.has_announced = False

    def on_start(self, event: Any) -> None:
        source = Path(event.data["dispatcher"].py_func.__code__.co_filename)
        if self.has_announced or not any(folder in source.parents for folder in self.folders):
            return
        self.has_announced = True
        # whoever started this worker tells it
        if multiprocessing.parent_process() is None:
            _LOG.warning(
                "robocup_vision compiles loops for this machine, once: that takes up to some minutes "
                "(`robocup-vision warm-up` or a compiled wheel does it ahead)"
            )

    def on_end(self, event: Any) -> None:
        pass


_wait = _Wait()


def tell_of_compiling(kernels: Path) -> None:
    """Tell when the first loop of a folder, or of those below it, is compiled."""
    if not _wait.folders:
        register("numba:compile", _wait)  # type: ignore[no-untyped-call]
    _wait.folders.add(kernels)
