"""Where the league's recordings are, beside the project; tests that need them are skipped without."""

from pathlib import Path

import pytest

RECORDINGS = Path(__file__).resolve().parents[4] / "shared" / "ssl"


@pytest.fixture
def recordings():
    if not RECORDINGS.is_dir():
        pytest.skip("the league's recordings are not here")
    return RECORDINGS
