"""Links name the recording and the time, whatever the recording is called."""

from urllib.parse import parse_qs, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.evaluation.moment_links import LIVE_PORT, moment_link
from robocup_vision.live.handover.page_settings import DEFAULT_PORT


@given(st.text(min_size=1), st.floats(0.0, 1e6))
def test_a_link_says_what_was_asked(name, t_s):
    address = urlsplit(moment_link(name, t_s))
    told = parse_qs(address.query, keep_blank_values=True)
    assert told["recording"] == [name]
    assert float(told["t"][0]) == pytest.approx(t_s, abs=1e-3)
    assert address.netloc == f"127.0.0.1:{LIVE_PORT}"
    assert LIVE_PORT == DEFAULT_PORT


def test_a_time_before_the_beginning_is_the_beginning():
    assert moment_link("a.mcap", -3.0).endswith("t=0.000")
