"""Command lines of any words: exit status 0 or 2, one line on standard error, never a traceback."""

import contextlib
import io
import os
from pathlib import Path

import numpy as np
import pytest

from robocup_vision import cli

CORPUS = Path(__file__).parent / "corpus"
# those that neither play nor serve for long, whatever words they get
COMMANDS = (
    "check", "evaluate", "fields", "calibrate omni", "calibrate colors", "calibrate forward", "render --count 0",
    "replay", "log info", "log convert", "log score", "map", "tournament --matches 0", "match --seconds -1",
    "render-goal --count 0", "",
)  # fmt: skip
WORDS = (
    "dataset", "camera.toml", "truth.csv", "nowhere", "", ".", "-", "--", "ssl_2001", "ssl_9999", "sekimori", "-1", "0",
    "nan", "1e400", "99999999999999999999", "--field", "--camera", "--colors", "--method", "--jobs", "--out", "--seed",
    "--noise", "--tilt", "--cast", "--count", "--symmetry", "--condition", "--players", "--truth", "\x00", "é",
    "a" * 500, "field", "landmarks", "--ours", "--map", "--obstacles", "--gain", "--jpeg", "--from", "--to",
)  # fmt: skip


@pytest.mark.slow
def test_any_words_end_in_a_status_and_at_most_one_line(tmp_path, monkeypatch):
    """Only this finds a command that ends in a traceback on words that nobody thought of."""
    monkeypatch.chdir(tmp_path)
    for name in ("camera.toml", "truth.csv"):
        (tmp_path / name).write_bytes((CORPUS / "dataset" / name).read_bytes())
    os.symlink(CORPUS / "dataset", tmp_path / "dataset")
    rng = np.random.default_rng(10)
    statuses = []
    for _ in range(400):
        line = str(rng.choice(COMMANDS)).split() + [str(w) for w in rng.choice(WORDS, rng.integers(0, 6))]
        out, err = io.StringIO(), io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            try:
                status = cli.main(line)
            except SystemExit as stop:
                status = stop.code
        assert status in (0, 1, 2), line
        if status == 2:
            assert len(err.getvalue().splitlines()) == 1, (line, err.getvalue())
        statuses.append(status)
    assert statuses.count(2) > 200
