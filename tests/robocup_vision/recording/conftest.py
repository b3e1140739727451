"""The recording of a short run, made once."""

from __future__ import annotations

from pathlib import Path

import pytest
from recorded_runs import make_vision, record_run

from robocup_vision.camera.files import save_camera


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the recording, which nobody may write to."""
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    record_run(path)
    return path


@pytest.fixture(scope="session")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return its camera file."""
    path = tmp_path_factory.mktemp("camera") / "camera.toml"
    save_camera(make_vision().camera, path)
    return path
