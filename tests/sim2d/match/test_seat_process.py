"""Players in a process of their own: they do what they would do here, and an ended process is told."""

import multiprocessing
import os
import threading

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import RobocupVisionError
from sim2d.match import match as match_module
from sim2d.match.match import Match
from sim2d.match.seat_process import SeatProcess, can_fork
from sim2d.players.built_in import BuiltInPlayer
from sim2d.robot_link import Command

forks = pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="no fork on this system")
PERIODS = 6


class Standing:
    """No built-in player: it may hold things that no fork copies."""

    status = None

    def __init__(self, setup):
        pass

    def act(self, senses):
        """Stand still."""
        return Command()


def new_match(**options):
    return Match(load_field("ssl_2001"), 1, 5, **options)


@pytest.fixture(scope="module")
def played_here():
    match = new_match()
    return [match.step() for _ in range(PERIODS)]


@forks
def test_a_match_on_two_cores_is_the_same_bit_for_bit(played_here, monkeypatch):
    monkeypatch.setattr(match_module, "can_fork", lambda: True)
    match, threads = new_match(), cv2.getNumThreads()
    with match.on_two_cores():
        assert len(multiprocessing.active_children()) == 1
        moments = [match.step() for _ in range(PERIODS)]
    assert not multiprocessing.active_children()
    assert cv2.getNumThreads() == threads
    for here, there in zip(played_here, moments, strict=True):
        assert here.state == there.state
        for one, other in zip(here.robots, there.robots, strict=True):
            assert one.command == other.command
            assert one.status.pose.pose == other.status.pose.pose
            np.testing.assert_array_equal(one.status.pose.covariance, other.status.pose.covariance)
            assert one.stopped == other.stopped
            np.testing.assert_array_equal(one.senses.frame, other.senses.frame)
            if one.status.view is not None:
                np.testing.assert_array_equal(one.status.view.marks, other.status.view.marks)
                assert len(one.status.view.obstacles) == len(other.status.view.obstacles)
    # the tables that all views share are sent once
    views = [moment.robots[1].status.view for moment in moments if moment.robots[1].status.view is not None]
    assert len({id(view.polar) for view in views}) == 1


@forks
def test_a_process_that_ends_is_told_in_one_line(monkeypatch):
    monkeypatch.setattr(match_module, "can_fork", lambda: True)
    monkeypatch.setattr(BuiltInPlayer, "act", lambda self, senses: os._exit(3))
    match = new_match()
    # the first player acts here
    monkeypatch.setattr(match._seats[0], "act", lambda senses: None)
    with match.on_two_cores(), pytest.raises(RobocupVisionError, match="the process of half of the players has ended"):
        match.step()
    assert not multiprocessing.active_children()


def test_players_of_others_stay_in_this_process(monkeypatch):
    monkeypatch.setattr(match_module, "can_fork", lambda: True)
    match = new_match(theirs=Standing)
    with match.on_two_cores():
        assert not multiprocessing.active_children()
        match.step()


def test_nothing_is_forked_beside_another_thread():
    done = threading.Event()
    thread = threading.Thread(target=done.wait)
    thread.start()
    try:
        assert not can_fork()
    finally:
        done.set()
        thread.join()


@forks
def test_the_process_ends_with_the_block():
    with SeatProcess([]) as process:
        assert len(multiprocessing.active_children()) == 1
        process.begin([])
        assert process.end() == ()
    assert not multiprocessing.active_children()
