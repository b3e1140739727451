"""A second process takes what waits at the front of a list; where none can be had, everything stays in the list."""

from __future__ import annotations

import sys
from collections import deque

import pytest

from robocup_vision.compiling import prepared_kernels as module
from robocup_vision.compiling.prepared_kernels import groups, second_process


def entries() -> deque[module.Entry]:
    return deque(groups()["planning"])


def test_it_takes_all_that_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_cores", lambda: 2)
    waiting = entries()
    with second_process(waiting):
        pass
    assert not waiting


@pytest.mark.parametrize("program", ["/no/such/program", "/bin/false"])
def test_without_a_process_that_runs_nothing_is_taken(program: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_cores", lambda: 2)
    monkeypatch.setattr(sys, "executable", program)
    waiting = entries()
    with second_process(waiting):
        pass
    assert waiting == entries()


def test_one_core_compiles_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_cores", lambda: 1)
    waiting = entries()
    with second_process(waiting):
        pass
    assert waiting == entries()


def test_an_exception_ends_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_cores", lambda: 2)
    with pytest.raises(KeyboardInterrupt), second_process(entries()):
        raise KeyboardInterrupt
