"""What is kept for pages: the newest, 30 s of pictures, frames as they came, and no more than is allowed."""

import threading

import pytest

from field_models.errors import ArgumentError
from robocup_vision.live.handover.page_settings import FeedSettings
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.picture import split_picture


@pytest.fixture
def feed(setup):
    made = Feed(FeedSettings(history_s=2.0))
    made.set_robots((setup,))
    yield made
    made.close()


def put(feed, *moments):
    for moment in moments:
        feed.put(moment)
        assert feed.wait_until_made(20.0)


def test_the_newest_is_kept_with_what_came_before(feed, moment):
    first, second = moment(0.0), moment(0.5)
    put(feed, first, second)
    assert [picture.t_s for picture in feed.history("robot")] == [0.0, 0.5]
    assert feed.newest("robot").number == 2
    assert feed.raw("robot", 1) is first
    assert feed.raw("robot", 7) is None


def test_history_is_limited_in_time(feed, moment):
    put(feed, *(moment(t_s) for t_s in (0.0, 1.0, 2.5, 3.5)))
    assert [picture.t_s for picture in feed.history("robot")] == [2.5, 3.5]
    assert feed.raw("robot", 1) is None


def test_history_is_limited_in_bytes(setup, moment):
    feed = Feed(FeedSettings(max_history_bytes=1, max_raw_bytes=1))
    feed.set_robots((setup,))
    put(feed, *(moment(t_s) for t_s in (0.0, 0.1, 0.2)))
    assert [picture.number for picture in feed.history("robot")] == [3]
    assert feed.raw("robot", 2) is None
    assert feed.raw("robot", 3) is not None
    feed.close()


def test_a_late_moment_gives_way_to_the_newest(setup, moment):
    feed = Feed()
    feed.set_robots((setup,))
    gate, is_late = threading.Event(), threading.Event()

    def wait() -> None:
        is_late.set()
        assert gate.wait(20.0)

    # who makes the pictures says so when it has made one
    feed.on_news = wait
    feed.put(moment(0.0))
    assert is_late.wait(20.0)
    for number in range(1, 6):
        feed.put(moment(float(number)))
    gate.set()
    assert feed.wait_until_made(20.0)
    pictures = feed.history("robot")
    assert [picture.t_s for picture in pictures] == [0.0, 5.0]
    assert [split_picture(picture.data)[0]["dropped"] for picture in pictures] == [0, 4]
    feed.close()


def test_what_was_forgotten_does_not_come_back(feed, moment):
    put(feed, moment(5.0))
    feed.forget()
    assert feed.newest("robot") is None
    put(feed, moment(1.0))
    assert [picture.t_s for picture in feed.history("robot")] == [1.0]


def test_a_moment_that_cannot_be_shown_does_not_end_the_thread(feed, moment):
    broken = moment(0.0)
    object.__setattr__(broken, "frame", broken.frame[:, :, :2])
    put(feed, broken, moment(1.0))
    assert feed.newest("robot").t_s == 1.0
    assert "cannot be shown" in feed.status[1]["lines"][0]


def test_status_changes_are_numbered_and_told(feed):
    calls = []
    feed.on_news = lambda: calls.append(1)
    before = feed.status[0]
    feed.set_status(problem="none")
    feed.set_status(problem="none")
    feed.say("hello")
    version, status = feed.status
    assert version == before + 2
    assert len(calls) == 2
    assert status["problem"] == "none"
    assert status["lines"][0].endswith("hello")


def test_unknown_robots_are_refused(feed, moment):
    with pytest.raises(ArgumentError, match="no robot 'nobody'"):
        feed.put(moment(robot="nobody"))
    assert feed.newest("nobody") is None
    assert feed.history("nobody") == ()
