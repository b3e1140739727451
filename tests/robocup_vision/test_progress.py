"""The progress bar: drawn at a terminal, silent elsewhere, never in the way of the items."""

from __future__ import annotations

import io
import sys

import pytest

from robocup_vision.progress import progress


class Terminal(io.StringIO):
    """A stderr that claims to be a terminal."""

    def isatty(self) -> bool:
        """Say yes."""
        return True


def test_terminal_sees_how_many_are_done(monkeypatch: pytest.MonkeyPatch):
    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    assert list(progress(iter("abcd"), 4, "work")) == list("abcd")
    drawn = screen.getvalue()
    assert drawn.startswith("\rwork [")
    assert drawn.endswith("#] 4/4\n")


def test_silent_elsewhere(capsys: pytest.CaptureFixture[str]):
    assert list(progress(range(3), 3, "work")) == [0, 1, 2]
    assert capsys.readouterr() == ("", "")


def test_wrong_totals_do_no_harm(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert list(progress(range(3), 0, "work")) == [0, 1, 2]
