"""Pieces of a run: each done once for the caller whoever is lost, few at a time, and in order where that is asked."""

from __future__ import annotations

from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import contextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.workers import Pool, Workers, find_workers, in_order, local_workers, run_pieces, this_process
from robocup_vision.workers.processes import Doer


def thrice():
    return lambda piece: 3 * piece


class Fake(Executor):
    """Does what is handed out when it likes to: `lost` batches end with their worker, `breaks_at` refuses one."""

    def __init__(self, lost=(), breaks_at=None, late=()):
        self.lost, self.breaks_at, self.late = list(lost), breaks_at, list(late)
        self.handed_out, self.finished, self.opened = 0, 0, 0
        self._held = []

    def submit(self, fn, batch):  # noqa: D102
        if self.handed_out == self.breaks_at:
            self.breaks_at = None
            raise BrokenExecutor
        self.handed_out += 1
        future = Future()
        if batch[0] in self.lost:
            self.lost.remove(batch[0])
            future.set_exception(BrokenExecutor())
        elif batch[0] in self.late:
            self.late.remove(batch[0])
            self._held.append((future, fn, batch))
            return future
        else:
            self._finish(future, fn, batch)
        return future

    def _finish(self, future, fn, batch):
        self.finished += len(batch)
        try:
            future.set_result(fn(batch))
        except RobocupVisionError as error:
            future.set_exception(error)

    def release(self):  # noqa: D102
        for held in self._held:
            self._finish(*held)
        self._held = []


def workers_of(fake, slots=2):
    @contextmanager
    def open_pool(start):
        fake.opened += 1
        yield Pool(fake, Doer(start), lambda: slots, fake.release)

    return Workers(open_pool)


@pytest.fixture(autouse=True)
def soon(monkeypatch):
    monkeypatch.setattr("robocup_vision.workers.pieces._LOOK_AFTER_S", 0.001)


@given(
    count=st.integers(0, 60),
    batch=st.integers(1, 7),
    slots=st.integers(1, 4),
    lost=st.lists(st.integers(0, 60), max_size=8),
    late=st.lists(st.integers(0, 60), max_size=3),
    breaks_at=st.none() | st.integers(0, 30),
)
def test_each_piece_is_yielded_once_whatever_is_lost(count, batch, slots, lost, late, breaks_at):
    with pytest.MonkeyPatch.context() as patch:
        # as often as a piece is lost here
        patch.setattr("robocup_vision.workers.pieces._BARREN_ROUNDS", 20)
        patch.setattr("robocup_vision.workers.pieces._LOOK_AFTER_S", 0.001)
        fake = Fake(lost, breaks_at, late)
        found = list(run_pieces(thrice, iter(range(count)), workers_of(fake, slots), batch=batch))
        assert sorted(found) == [(index, 3 * index) for index in range(count)]
        fake = Fake(lost, breaks_at, late)
        ordered = in_order(run_pieces(thrice, iter(range(count)), workers_of(fake, slots), batch=batch))
        assert list(ordered) == [3 * index for index in range(count)]


def test_pieces_are_taken_as_they_are_needed():
    taken = 0

    def source():
        nonlocal taken
        for piece in range(1_000_000):
            taken += 1
            yield piece

    # the first piece is not finished: nobody runs far ahead of it
    fake = Fake(late=[0])
    running = run_pieces(thrice, source(), workers_of(fake), batch=3)
    for _ in range(20):
        next(running)
    assert taken <= 4 * 2 * 3
    for index, _ in running:
        if index == 300:
            break
    assert taken <= 300 + 2 * 4 * 2 * 3
    here = run_pieces(thrice, source(), this_process())
    before = taken
    next(here)
    assert taken == before + 1


def test_a_piece_that_ends_its_workers_is_named():
    fake = Fake(lost=[6] * 99)
    running = run_pieces(thrice, range(30), workers_of(fake), describe=lambda piece: f"image {piece}.png")
    found = []
    with pytest.raises(RobocupVisionError, match=r"^image 6\.png is not done: 3 times all workers ended before they"):
        found += iter(running)
    assert fake.opened <= 6
    fake = Fake(lost=[0] * 99)
    with pytest.raises(RobocupVisionError, match=r"^0 is not done"):
        list(run_pieces(thrice, range(3), workers_of(fake)))


def test_what_a_piece_raises_is_raised():
    def start():
        def refuse(piece):
            raise RobocupVisionError(f"not {piece}")

        return refuse

    for workers in (workers_of(Fake()), this_process()):
        with pytest.raises(RobocupVisionError, match="not 0"):
            list(run_pieces(start, range(3), workers))


def test_a_worker_starts_when_it_gets_work():
    started = []

    def start():
        started.append(True)
        return lambda piece: piece

    assert list(run_pieces(start, [], this_process())) == []
    assert started == []
    assert [result for _, result in run_pieces(start, "abc", this_process())] == ["a", "b", "c"]
    assert started == [True]


def test_stopping_early_ends_the_work():
    ended = []

    @contextmanager
    def open_pool(start):
        try:
            yield Pool(Fake(), Doer(start), lambda: 1)
        except GeneratorExit:
            ended.append(True)
            raise

    running = in_order(run_pieces(thrice, range(9), Workers(open_pool)))
    next(running)
    running.close()
    assert ended == [True]


def test_what_is_no_worker_is_refused():
    with pytest.raises(ArgumentError, match="workers must be what find_workers\\(jobs\\) returns, got int"):
        list(run_pieces(thrice, [1], 3))
    with pytest.raises(ArgumentError, match="batch must be at least 1, got 0"):
        list(run_pieces(thrice, [1], this_process(), batch=0))
    for jobs, problem in ((1.5, "must be a whole number, got float 1.5"), (10**6, "must be at most 1024, got 1000000")):
        with pytest.raises(ArgumentError, match=f"jobs {problem}"):
            find_workers(jobs)


def test_no_processes_are_refused():
    for find in (local_workers, find_workers):
        with pytest.raises(ArgumentError, match="jobs must be at least 1, got 0"):
            find(0)
    assert find_workers(1).is_here
    assert not find_workers(2).is_here
