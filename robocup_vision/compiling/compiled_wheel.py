"""Puts compiled loops into a wheel, so that a robot that installs it need not compile anything.

numba finds them beside the source files, where it would have cached them itself. They are for the present version of
Python and numba and this kind of processor; a different machine compiles as if they were not there.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import sysconfig
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

from field_models.errors import FileError, RobocupVisionError
from robocup_vision.compiling.compile_cache import VARIABLE

_WARM_UP = "import sys; from robocup_vision import cli; sys.exit(cli.main(['warm-up', '--jobs', sys.argv[1]]))"
_PLAIN = "py3-none-any"


def compile_wheel(wheel: str | Path, jobs: int) -> Path:
    """Compile all loops of this library's wheel, as ``pip wheel`` writes it, and return a new wheel that contains them.

    It is written to the same folder, with the version of Python and the kind of machine in its name.

    Raises
    ------
    FileError
        If the wheel cannot be read, is not this library's wheel for any machine, or the new one cannot be written.
    RobocupVisionError
        If the loops cannot be compiled, or the package ``wheel`` is not installed.
    """
    wheel = Path(wheel)
    try:
        wheelfile: Any = import_module("wheel.wheelfile")
    except ImportError:
        raise RobocupVisionError("wheels are read and written by the package `wheel`: pip install wheel") from None
    if not re.fullmatch(rf"robocup_vision-[^-]+-{_PLAIN}\.whl", wheel.name):
        raise FileError(wheel, f"must be a wheel of this library for any machine, robocup_vision-...-{_PLAIN}.whl")
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    tag = f"{python}-{python}-{re.sub(r'[-.]', '_', sysconfig.get_platform())}"
    compiled = wheel.with_name(wheel.name.replace(_PLAIN, tag))
    with tempfile.TemporaryDirectory() as folder:
        try:
            with wheelfile.WheelFile(wheel) as unpacked:
                unpacked.extractall(folder)
        except (OSError, ValueError, BadZipFile, wheelfile.WheelError) as error:
            raise FileError(wheel, f"cannot be read ({getattr(error, 'strerror', None) or error})") from None
        _compile(Path(folder), jobs)
        (metadata,) = Path(folder).glob("*.dist-info/WHEEL")
        text = metadata.read_text(encoding="utf-8")
        text = text.replace(f"Tag: {_PLAIN}", f"Tag: {tag}").replace("Is-Purelib: true", "Is-Purelib: false")
        metadata.write_text(text, encoding="utf-8")
        try:
            with wheelfile.WheelFile(compiled, "w") as packed:
                packed.write_files(folder)
        except OSError as error:
            raise FileError(compiled, f"cannot be written ({error.strerror or error})") from None
    return compiled


def _compile(site: Path, jobs: int) -> None:
    """Compile all loops of the library in a folder, each cached beside its source."""
    environment = {**os.environ, "PYTHONPATH": str(site), "PYTHONDONTWRITEBYTECODE": "1"}
    environment.pop(VARIABLE, None)
    command = [sys.executable, "-c", _WARM_UP, str(jobs)]
    if subprocess.run(command, cwd=site, env=environment, stdout=subprocess.DEVNULL, check=False).returncode:
        raise RobocupVisionError("the wheel's loops could not be compiled: see above")
