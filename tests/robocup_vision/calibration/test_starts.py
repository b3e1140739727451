"""The starts of a calibration: each tried once, kept bit for bit, and found again by an interrupted calibration."""

import argparse
from pathlib import Path

import pytest

from field_models.errors import FileError
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.commands.calibrate_options import start_trials
from robocup_vision.files.resume_file import ResumeFile


class Start:
    """Squares numbers, and counts them; raises at one."""

    def __init__(self, interrupted_at=None):
        self.tried, self.interrupted_at = [], interrupted_at

    def __call__(self):  # noqa: D102
        def square(piece):
            if piece == self.interrupted_at:
                raise KeyboardInterrupt
            self.tried.append(piece)
            return piece**2

        return square


def test_what_is_finished_is_not_tried_again(tmp_path):
    path = tmp_path / "kept.jsonl"
    first, second = Start(), Start(interrupted_at=12)
    with ResumeFile(path, {}, resume=False) as kept:
        trials = StartTrials(kept=kept)
        assert trials.results(first, [1, 2, 3], "first") == [1, 4, 9]
        with pytest.raises(KeyboardInterrupt):
            trials.results(second, [10, 11, 12, 13], "second")
        assert trials.done == 5
    first, second = Start(), Start()
    with ResumeFile(path, {}, resume=True) as kept:
        trials = StartTrials(kept=kept)
        assert trials.done == 5
        assert trials.results(first, [1, 2, 3], "first") == [1, 4, 9]
        assert trials.results(second, [10, 11, 12, 13], "second") == [100, 121, 144, 169]
        assert trials.done == 7
    assert (first.tried, second.tried) == ([], [12, 13])


def options(out: Path, **changes: object) -> argparse.Namespace:
    given = {"out": str(out), "resume": False, "jobs": 1, "dask": None, "frames": 24, "field": "ssl_2001"}
    return argparse.Namespace(**{**given, "start": None, **changes})


def interrupt(args: argparse.Namespace, images: list[Path], at: int | None) -> None:
    with start_trials(args, images) as trials:
        trials.results(Start(interrupted_at=at), [1, 2, 3], "starts")


def test_an_interrupt_says_what_is_kept_and_an_end_keeps_nothing(tmp_path):
    image = tmp_path / "image.png"
    image.write_bytes(b"1")
    out, unfinished = tmp_path / "camera.toml", tmp_path / "camera.unfinished.jsonl"
    with pytest.raises(KeyboardInterrupt, match=r"^$"):
        interrupt(options(out), [image], 1)
    assert not unfinished.exists()
    with pytest.raises(
        KeyboardInterrupt, match=r"2 starts are finished and kept in .*camera\.unfinished\.jsonl; --resum"
    ):
        interrupt(options(out), [image], 3)
    # interrupted before it has come as far again
    with (
        pytest.raises(KeyboardInterrupt, match="2 starts are finished"),
        start_trials(options(out, resume=True), [image]),
    ):
        raise KeyboardInterrupt
    with pytest.raises(FileError, match="is of another run: field was 'ssl_2001', is now 'other'"):
        interrupt(options(out, resume=True, field="other"), [image], None)
    image.write_bytes(b"22")
    with pytest.raises(FileError, match="is of another run: images was "):
        interrupt(options(out, resume=True), [image], None)
    interrupt(options(out), [image], None)
    assert not unfinished.exists()
