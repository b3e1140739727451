"""The hand-over of the newest value: one place, taken once, waited for no longer than said."""

import threading

from robocup_vision.live.sources.source import Newest


def test_a_newer_value_takes_the_place_of_an_older_one_and_is_taken_once() -> None:
    newest: Newest[int] = Newest()
    newest.put(1)
    newest.put(2)
    assert newest.take(0.0) == 2
    assert newest.take(0.0) is None


def test_a_value_put_by_another_thread_wakes_the_one_that_waits() -> None:
    newest: Newest[str] = Newest()
    sender = threading.Timer(0.02, newest.put, args=("frame",))
    sender.start()
    assert newest.take(10.0) == "frame"
    sender.join()


def test_closing_ends_every_wait_and_hides_what_was_left() -> None:
    newest: Newest[int] = Newest()
    newest.put(1)
    closer = threading.Timer(0.02, newest.close)
    closer.start()
    newest.wait_until_closed(10.0)
    closer.join()
    assert newest.is_closed
    assert newest.take(10.0) is None
