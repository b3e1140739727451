"""The rate of a camera is measured, and a change that lasts is told once."""

import pytest

from robocup_vision.live.sources.source import FrameRate


def feed(rate, begin_s, step_s, seconds):
    told = []
    t_s = begin_s
    while t_s < begin_s + seconds:
        told.append(rate.add(t_s))
        t_s += step_s
    return [change for change in told if change is not None], t_s


@pytest.mark.parametrize("hz", [5.0, 30.0, 60.0])
def test_a_steady_rate_is_measured_and_never_a_change(hz):
    rate = FrameRate()
    assert rate.rate_hz is None
    changes, _ = feed(rate, 0.0, 1 / hz, 8.0)
    assert changes == []
    assert rate.rate_hz == pytest.approx(hz, rel=0.01)


@pytest.mark.parametrize("other", [15.0, 60.0])
def test_a_change_is_told_once(other):
    rate = FrameRate()
    _, t_s = feed(rate, 0.0, 1 / 30, 5.0)
    changes, _ = feed(rate, t_s, 1 / other, 10.0)
    assert len(changes) == 1
    assert changes[0].before_hz == pytest.approx(30.0, rel=0.02)
    assert changes[0].now_hz == pytest.approx(other, rel=0.25)


def test_another_time_is_no_change():
    rate = FrameRate()
    feed(rate, 100.0, 1 / 30, 4.0)
    changes, _ = feed(rate, 0.0, 1 / 10, 4.0)
    assert changes == []
    assert rate.rate_hz == pytest.approx(10.0, rel=0.01)
