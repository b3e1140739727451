"""The recording of a short run, made once."""

from __future__ import annotations

from pathlib import Path

import pytest
from recorded_runs import record_run


@pytest.fixture(scope="session")
def recorded_digests(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """Return the recording, which nobody may write to, and the digests of what its calls gave."""
    path = tmp_path_factory.mktemp("recorded") / "run.mcap"
    return path, record_run(path)


@pytest.fixture(scope="session")
def recorded(recorded_digests: tuple[Path, list[str]]) -> Path:
    return recorded_digests[0]
