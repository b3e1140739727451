"""Finished pieces of a run survive it, whatever ends it; those of another run are not taken for its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from field_models.errors import FileError
from robocup_vision.files.resume_file import ResumeFile

RUN = {"format": 1, "seed": 5}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return the file of a run that ended after two pieces."""
    file = tmp_path / "deep" / "unfinished.jsonl"
    with ResumeFile(file, RUN, resume=False) as kept:
        kept.add(3, {"score": [1, 0]})
        kept.add(0, 0.1)
    return file


def test_what_was_finished_is_found(path: Path) -> None:
    with path.open("a") as stream:
        stream.write('[7, {"sco')  # the machine went off
    for _ in range(2):
        with ResumeFile(path, RUN, resume=True) as kept:
            assert kept.found == {3: {"score": [1, 0]}, 0: 0.1}
    kept.delete()
    assert not path.exists()


def test_without_resume_it_begins_anew(path: Path) -> None:
    with ResumeFile(path, RUN, resume=False) as kept:
        assert kept.found == {}
    with ResumeFile(path, RUN, resume=True) as kept:
        assert kept.found == {}


def test_what_does_not_fit_is_named(path: Path) -> None:
    with pytest.raises(FileError, match=r"unfinished\.jsonl: is of another run: seed was 5, is now 6; begin anew"):
        ResumeFile(path, {**RUN, "seed": 6}, resume=True)
    for text in ("nonsense\n", '{"format": 1, "seed": 5}\n[1, 2, 3]\n', ""):
        path.write_text(text)
        with pytest.raises(FileError, match="is damaged; begin anew without --resume"):
            ResumeFile(path, RUN, resume=True)
    (path.parent / "file").touch()
    with pytest.raises(FileError, match="cannot be written"):
        ResumeFile(path.parent / "file" / "unfinished.jsonl", RUN, resume=False)
