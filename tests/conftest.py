"""What all tests share: tests/strategies.py becomes importable, and property tests draw the same examples every time.

`HYPOTHESIS_PROFILE=explore` looks for new examples instead.
"""

import os
import sys
from pathlib import Path

# `make test` runs a process a core: threads beside it would only wait for each other. Before numpy is first imported
if "PYTEST_XDIST_WORKER" in os.environ:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import cv2
import pytest
from hypothesis import settings

from robocup_vision import cli

if "PYTEST_XDIST_WORKER" in os.environ:
    cv2.setNumThreads(0)

# with --import-mode=importlib pytest puts no test folder on the path
sys.path.insert(0, str(Path(__file__).parent))

# fixtures that tests of several folders use: calibrated and miscalibrated frames, a short run for landmark maps, and
# peers of framed ports; modules that need protobuf are skipped without it
pytest_plugins = ["miscalibrated_frames", "needs_protobuf", "short_landmark_run", "ssl_sockets"]

# a law that needs more examples, or has dear ones, says how many itself
settings.register_profile("repeat", derandomize=True, deadline=None, max_examples=30)
settings.register_profile("explore", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeat"))


@pytest.fixture
def refused(capfd):
    """Return a function that runs a command which must be refused, and returns the one line that it says."""

    def line_of(*words: object) -> str:
        capfd.readouterr()
        try:
            status: object = cli.main([str(word) for word in words])
        except SystemExit as stop:
            status = stop.code
        _, error = capfd.readouterr()
        assert (status, error.count("\n")) == (2, 1), error
        assert error.startswith("robocup-vision")
        return error

    return line_of


@pytest.fixture
def without_plots(monkeypatch):
    """Leave the plots out of reports, which take longest; one test of each report draws them."""
    monkeypatch.setattr("robocup_vision.evaluation.report.draw_plots", lambda field, rows: [])
    monkeypatch.setattr("matplotlib.figure.Figure.savefig", lambda figure, stream, **how: stream.write(b"a plot"))


def pytest_collection_modifyitems(items):
    silent = {item.nodeid.split("[")[0] for item in items if item.get_closest_marker("slow") and not item.obj.__doc__}
    if silent:
        raise pytest.UsageError(
            f"slow tests say in a docstring what fault they alone find: {', '.join(sorted(silent))}"
        )
