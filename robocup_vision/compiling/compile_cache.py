"""Finds a folder for compiled code that can be written, and removes code from it that was made of other sources.

numba keeps compiled loops in the folder that ``NUMBA_CACHE_DIR`` names, else beside the source files, else in the
user's cache folder. Where none of them can be written it refuses to define a loop; here a temporary folder is used.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
import tempfile
import warnings
from pathlib import Path
from typing import Any

import numba

from field_models.errors import RobocupVisionError

VARIABLE = "NUMBA_CACHE_DIR"
_IMPORT, _WORD = re.compile(rb"^from (\S+) import (\([^)]*\)|.*)", re.MULTILINE), re.compile(rb"\w+")


class CompileCacheWarning(RuntimeWarning):
    """Compiled code is kept in a temporary folder: it will be compiled again when that is gone."""


def ensure_compile_cache(kernels: Path) -> None:
    """Make sure that the loops of a package can be kept somewhere; call it before the first of them is defined.

    Parameters
    ----------
    kernels : Path
        The package's folder.

    Warns
    -----
    CompileCacheWarning
        If a temporary folder is used. The process and those that it starts then use it for all loops.

    Raises
    ------
    RobocupVisionError
        If no temporary folder can be written either.
    """
    config: Any = numba.config  # its names are set when it is loaded
    given = config.CACHE_DIR
    if given and _is_writable(Path(given)):
        return
    if not given and all(_numba_finds_place(source) for source in sorted(kernels.rglob("__init__.py"))):
        return
    folder = _temporary_folder()
    # the variable is for the processes that this one starts: numba has read it already
    config.CACHE_DIR = os.environ[VARIABLE] = str(folder)
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


def remove_stale_loops(kernels: Path) -> None:
    """Remove a package's compiled loops whose sources have changed since; call it before the first is defined.

    numba compiles a loop anew when its own file has changed. A loop also holds the code of loops that it calls and the
    constants that it reads, of other files.

    Parameters
    ----------
    kernels : Path
        The package's folder.
    """
    texts: dict[str, bytes] = {}
    for path in sorted(kernels.rglob("*.py")):
        inner = path.relative_to(kernels).with_suffix("").parts
        texts[".".join((kernels.parent.name, kernels.name, *inner))] = path.read_bytes()
    digests = _digests(texts)
    for package in sorted(kernels.rglob("__init__.py")):
        name = ".".join((kernels.parent.name, kernels.name, *package.parent.relative_to(kernels).parts))
        made_of = {source.stem: digests[f"{name}.{source.stem}"] for source in sorted(package.parent.glob("*.py"))}
        folder = Path(_probe(package).stats.cache_path)
        kept = folder / "loops.json"
        try:
            before = json.loads(kept.read_text(encoding="ascii")) if kept.exists() else {}
            if made_of == before:
                continue
            for index in folder.glob("*.nbi"):
                source = index.name.partition(".")[0]
                if source not in made_of or made_of[source] != before.get(source):
                    index.unlink(missing_ok=True)
            folder.mkdir(parents=True, exist_ok=True)
            kept.write_text(json.dumps(made_of), encoding="ascii")
        except (OSError, ValueError):  # what cannot be removed was not written by this user
            continue


def _digests(texts: dict[str, bytes]) -> dict[str, str]:
    """Return for each module a digest of its source text and of all that it imports, of these modules."""
    imports = {}
    for name, text in texts.items():
        found = set()
        for module, names in _IMPORT.findall(text):
            found |= {module.decode(), *(f"{module.decode()}.{one.decode()}" for one in _WORD.findall(names))}
        imports[name] = found & texts.keys()
    own = {name: hashlib.sha256(text).hexdigest() for name, text in texts.items()}
    digests = {}
    for name in texts:
        reached, waiting = {name}, [name]
        while waiting:
            new = imports[waiting.pop()] - reached
            reached |= new
            waiting += new
        digests[name] = hashlib.sha256("".join(own[one] for one in sorted(reached)).encode()).hexdigest()
    return digests


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
