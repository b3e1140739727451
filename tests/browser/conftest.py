"""A browser for the tests of pages: `make browser-test` installs it."""

import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
MODULES = HERE.parents[1] / ".venv" / "browser"


@pytest.fixture(scope="session")
def node():
    """Return a function that runs one of the programs beside this file.

    Skips where neither npm's Chromium nor Debian's could be installed.
    """
    if shutil.which("node") is None or not (MODULES / "node_modules").is_dir():
        pytest.skip("not run: no browser could be installed (make browser-test)")

    def run(program, *arguments):
        for path in HERE.glob("*.mjs"):
            # programs find packages beside themselves only
            shutil.copy(path, MODULES)
        return subprocess.run(
            ["node", str(MODULES / program), *map(str, arguments)], capture_output=True, text=True, timeout=400
        )

    probe = run("launch.mjs")
    if probe.returncode:
        pytest.skip(f"not run: {probe.stderr.strip().splitlines()[-1] if probe.stderr else 'no Chromium starts'}")
    return run
