"""The team's radio: at its rate and size, late and lossy as it is set, the same by the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from field_models.errors import ArgumentError
from sim2d.sensors.team_channel import MESSAGE_PERIOD_S, UNDISTURBED, ChannelSettings, TeamChannel, check_message


def channel(settings, robots=3, seed=1):
    return TeamChannel(settings, [np.random.default_rng([seed, k]) for k in range(robots)])


def test_an_undisturbed_message_comes_to_all_others_once():
    radio = channel(UNDISTURBED)
    radio.send(0, b"one", 0.0)
    assert [radio.received(k, 0.0) for k in range(3)] == [(), (b"one",), (b"one",)]
    assert [radio.received(k, 1.0) for k in range(3)] == [(), (), ()]


def test_messages_that_come_too_soon_are_not_sent():
    radio = channel(UNDISTURBED)
    for k in range(31):
        radio.send(0, bytes([k]), k / 30)
    assert radio.received(1, 2.0) == (b"\x00", b"\x0f", b"\x1e")
    assert MESSAGE_PERIOD_S == 0.5


def test_messages_are_late_and_lost_as_often_as_it_is_set():
    radio = channel(ChannelSettings(0.3, 0.05, 0.15), robots=2)
    delays = []
    for k in range(2000):
        radio.send(0, b"", float(k))
        delays += [step / 30 for step in range(6) if radio.received(1, k + step / 30)]
    assert len(delays) / 2000 == pytest.approx(0.7, abs=0.03)
    assert min(delays) >= 0.05
    assert max(delays) <= 0.15 + 1 / 30
    assert len(set(delays)) > 2


def test_each_receiver_loses_its_own():
    radio = channel(ChannelSettings(0.5, 0.0, 0.0))
    for k in range(200):
        radio.send(0, bytes([k]), float(k))
    first, second = radio.received(1, 300.0), radio.received(2, 300.0)
    assert set(first) != set(second)
    assert list(first) == sorted(first)


@pytest.mark.parametrize("seed", [1, 2])
def test_the_same_seed_loses_the_same(seed):
    def run(seed):
        radio = channel(ChannelSettings(), seed=seed)
        for k in range(50):
            radio.send(k % 3, bytes([k]), k / 4)
        return [radio.received(k, 20.0) for k in range(3)]

    assert run(seed) == run(seed)
    assert run(seed) != run(seed + 5)


def test_what_no_radio_carries_is_refused():
    radio = channel(UNDISTURBED)
    radio.send(0, bytes(128), 0.0)
    with pytest.raises(ArgumentError, match="a team message must be at most 128 bytes, got 129"):
        radio.send(0, bytes(129), 1.0)
    with pytest.raises(ArgumentError, match="a team message must be bytes, got str"):
        check_message("hello")
