"""What a page asks and gets."""

import contextlib
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError, PacketError
from robocup_vision.live.handover.controls import Controls
from robocup_vision.live.page.feed import Feed
from robocup_vision.live.page.messages import read_message
from robocup_vision.live.page.page_link import PageLink
from robocup_vision.live.page.picture import split_picture


class Camera(Controls):
    """Goes on by itself."""


class _Film(Controls):
    """Stands still when it is told to."""

    offers = frozenset({"pause"})

    def __init__(self):
        self.calls = []

    def pause(self, on):
        self.calls.append(("pause", on))

    def step(self):
        self.calls.append(("step",))


@pytest.fixture
def fill(feed, moment):
    def put(*times):
        for t_s in times:
            feed.put(moment(t_s))
            assert feed.wait_until_made(20.0)

    return put


def times(link):
    """Return the times of the pictures that a page gets now, and draw them."""
    got = [split_picture(item)[0] for item in link.outgoing() if isinstance(item, bytes)]
    for told in got:
        ask(link, type="drawn", robot=told["robot"], number=told["number"])
    return [told["t_s"] for told in got]


def ask(link, **message):
    link.handle(read_message(json.dumps(message)))


def test_a_page_begins_with_the_robots_and_the_newest(feed, fill):
    fill(0.0, 1.0)
    link = PageLink(feed, Camera())
    hello, told, picture = link.outgoing()
    assert hello["robots"][0]["field"]["name"] == "ssl_2001"
    assert hello["offers"] == []
    assert told["stands_still"] is False
    assert split_picture(picture)[0]["t_s"] == 1.0
    assert list(link.outgoing()) == []


def test_a_page_that_does_not_draw_gets_two_pictures_and_then_the_newest(feed, fill):
    link = PageLink(feed, Camera())
    got = []
    for t_s in (0.0, 1.0, 2.0, 3.0):
        fill(t_s)
        got += [split_picture(item)[0]["t_s"] for item in link.outgoing() if isinstance(item, bytes)]
    assert got == [0.0, 1.0]
    ask(link, type="drawn", robot="robot", number=2)
    assert times(link) == [3.0]


def test_a_camera_goes_on_while_a_page_stands_still(feed, fill):
    fill(*(0.1 * number for number in range(5)))
    link = PageLink(feed, Camera())
    assert times(link) == [0.4]
    ask(link, type="pause", on=True)
    fill(0.5, 0.6)
    assert times(link) == []
    ask(link, type="step", frames=-1)
    assert times(link) == [0.3]
    ask(link, type="step", frames=-10)
    assert times(link) == [0.0]
    ask(link, type="step", frames=1)
    assert times(link) == [0.1]
    assert link.stands_still
    ask(link, type="pause", on=False)
    assert times(link) == [0.6]


def test_back_shows_what_was_so_long_ago(feed, fill):
    fill(0.0, 10.0, 20.0, 30.0)
    link = PageLink(feed, Camera())
    times(link)
    ask(link, type="back", seconds=12.0)
    assert times(link) == [10.0]
    ask(link, type="back", seconds=30.0)
    got = list(link.outgoing())
    assert got[0]["back_s"] == 30.0
    assert split_picture(got[1])[0]["t_s"] == 0.0


def test_what_a_page_stands_still_at_stays_though_it_is_kept_no_more(setup, moment):
    from robocup_vision.live.handover.page_settings import FeedSettings

    feed = Feed(FeedSettings(history_s=1.0))
    feed.set_robots((setup,))
    link = PageLink(feed, Camera())
    for t_s in (0.0, 0.5):
        feed.put(moment(t_s))
        feed.wait_until_made(20.0)
    ask(link, type="pause", on=True)
    feed.put(moment(10.0))
    feed.wait_until_made(20.0)
    ask(link, type="step", frames=-1)
    assert times(link) == [0.0]
    feed.close()


def test_a_film_is_paused_itself_and_steps_on_at_its_end(feed, fill):
    film = _Film()
    fill(0.0, 0.1, 0.2)
    link = PageLink(feed, film)
    times(link)
    ask(link, type="pause", on=True)
    ask(link, type="step", frames=1)
    assert film.calls == [("pause", True), ("pause", True), ("step",)]
    fill(0.3)
    assert times(link) == [0.3]
    ask(link, type="step", frames=-2)
    assert times(link) == [0.1]
    ask(link, type="step", frames=1)
    assert times(link) == [0.2]
    ask(link, type="step", frames=1)
    assert times(link) == [0.3]
    film.calls.clear()
    ask(link, type="step", frames=1)
    assert ("step",) in film.calls


def test_steps_and_back_without_any_picture_do_nothing(feed):
    link = PageLink(feed, Camera())
    for message in ({"type": "step", "frames": -1}, {"type": "back", "seconds": 3}, {"type": "pause", "on": True}):
        ask(link, **message)
    assert times(link) == []


ASKED = [
    ({"type": "seek", "t_s": 3}, ("seek", 3.0)),
    ({"type": "open", "recording": "a.mcap"}, ("open", "a.mcap", 0.0)),
    ({"type": "record", "on": True}, ("record", True)),
    ({"type": "save", "robot": "robot", "number": 1}, ("save", "robot", 1)),
    ({"type": "place", "thing": "ball", "x_m": 1, "y_m": -0.5}, ("place", "ball", 1.0, -0.5, None)),
    ({"type": "place", "thing": "r", "x_m": 1, "y_m": 0, "theta_rad": 3}, ("place", "r", 1.0, 0.0, 3.0)),
    ({"type": "collect", "on": True}, ("collect", True)),
    ({"type": "calibrate", "kind": "omni"}, ("calibrate", "omni")),
]


@pytest.mark.parametrize(("message", "asked"), ASKED)
def test_what_is_not_offered_is_refused_and_all_else_is_asked_for(feed, message, asked):
    with pytest.raises(ArgumentError):
        ask(PageLink(feed, Camera()), **message)
    controls, calls = Controls(), []
    controls.ask = lambda *call: calls.append(call)
    ask(PageLink(feed, controls), **message)
    assert calls == [asked]


def test_markings_are_found_as_long_as_one_page_wants_them(feed, fill):
    def has_markings(t_s):
        fill(t_s)
        return bool(split_picture(feed.newest("robot").data)[0]["layers"]["markings"])

    one, other = PageLink(feed, Camera()), PageLink(feed, Camera())
    assert not has_markings(0.0)
    ask(one, type="markings", on=True)
    ask(other, type="markings", on=True)
    ask(one, type="markings", on=False)
    assert has_markings(1.0)
    other.close()
    assert not has_markings(2.0)


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "null", "{", '{"type": "eval"}', '{"type": "pause"}', '{"type": "pause", "on": 1}',
        '{"type": "pause", "on": true, "more": 1}', '{"type": "step", "frames": 1.5}',
        '{"type": "step", "frames": 100000}', '{"type": "back", "seconds": -1}', '{"type": "back", "seconds": NaN}',
        '{"type": "back", "seconds": 1e999}', '{"type": "save", "robot": "", "number": 1}',
        '{"type": "save", "robot": "r", "number": -1}', '{"type": "calibrate", "kind": "fisheye"}',
        '{"type": "place", "thing": "ball", "x_m": 1}', '{"type": "place", "thing": "ball", "x_m": 1e999, "y_m": 0}',
        '{"type": "place", "thing": "ball", "x_m": 1, "y_m": NaN}',
        '{"type": "place", "thing": "", "x_m": 1, "y_m": 0}',
        '{"type": "open", "recording": "' + "a" * 300 + '"}', '{"type": "pause", "on": true}' + " " * 2000,
        '"\\ud800"', "\ud800",
    ],
)  # fmt: skip
def test_what_is_no_message_is_refused(text):
    with pytest.raises(PacketError, match="message of a page"):
        read_message(text)


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text):
    with contextlib.suppress(PacketError):
        read_message(text)
