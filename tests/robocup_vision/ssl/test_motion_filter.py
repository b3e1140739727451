"""The filter of robots' motion: exact where nothing is noisy, better than detections where they are, rows apart."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robocup_vision.ssl.motion_filter import MotionFilter, MotionFilterSettings, MotionModel

RATE = 60.0


def follow(places, times, settings=MotionFilterSettings()):
    """Return a filter with one row that has taken in places (N, 2) at times (N,), and its estimates after each."""
    made = MotionFilter(settings)
    row = np.array([made.add()])
    made.start(0, times[0], *places[0])
    out = []
    for t_s, place in zip(times[1:], places[1:], strict=True):
        made.predict(row, t_s)
        made.update(row, place[None], t_s)
        position, velocity = made.at(row, t_s)
        out.append([*position[0], *velocity[0]])
    return made, np.array(out)


def driven(seconds, seed):
    """Return times, true places and velocities of a robot that speeds up and brakes at 4 m/s^2, as the league's do."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, seconds, 1 / RATE)
    velocity, wanted, place = np.zeros(2), np.zeros(2), np.zeros(2)
    rows = []
    for k in range(len(times)):
        if k % 90 == 0:
            wanted = rng.uniform(-1.5, 1.5, 2)
        change = wanted - velocity
        size = np.hypot(*change)
        velocity = velocity + change * min(1.0, 4.0 / RATE / max(size, 1e-9))
        place = place + velocity / RATE
        rows.append([*place, *velocity])
    return times, np.array(rows)


def test_what_drives_straight_is_known_exactly_and_foretold():
    times = np.arange(0.0, 1.0, 1 / RATE)
    places = np.stack([1.0 + 0.8 * times, -0.5 * times], axis=1)
    made, found = follow(places, times)
    assert found[-1] == pytest.approx([*places[-1], 0.8, -0.5], abs=1e-3)
    ahead, velocity = made.at(np.array([0]), times[-1] + 0.05)
    assert ahead[0] == pytest.approx(places[-1] + 0.05 * np.array([0.8, -0.5]), abs=1e-3)
    assert velocity[0] == pytest.approx([0.8, -0.5], abs=1e-2)


@pytest.mark.slow
def test_several_models_are_better_than_detections_and_than_each_alone():
    """Only this finds a mixture of motions that is worse than one of them."""
    times, true = driven(20.0, 5)
    noisy = true[:, :2] + np.random.default_rng(6).normal(0.0, 0.0013, (len(times), 2))

    def errors(settings):
        _, found = follow(noisy, times, settings)
        rest = (found - true[1:])[60:]
        return math.sqrt(np.mean(rest[:, :2] ** 2)), math.sqrt(np.mean(rest[:, 2:] ** 2))

    place, velocity = errors(MotionFilterSettings())
    assert place < 0.8 * 0.0013
    assert velocity < 0.05
    for model in MotionFilterSettings().models:
        alone = errors(MotionFilterSettings(models=(model,)))
        assert place < alone[0] or velocity < alone[1]
    straight = errors(MotionFilterSettings(models=(MotionModel(0.0, 0.1),)))
    assert velocity < straight[1]


def test_rows_do_not_touch_each_other():
    times, true = driven(2.0, 7)
    _, alone = follow(true[:, :2], times)
    both = MotionFilter()
    rows = np.array([both.add(), both.add()])
    both.start(0, times[0], *true[0, :2])
    both.start(1, times[0], 3.0, 3.0)
    for k, t_s in enumerate(times[1:], start=1):
        both.predict(rows, t_s)
        # the second is seen now and then
        seen = rows if k % 3 == 0 else rows[:1]
        both.update(seen, np.array([true[k, :2], [3.0, 3.0]])[: len(seen)], t_s)
    place, velocity = both.at(rows, times[-1])
    assert [*place[0], *velocity[0]] == pytest.approx(alone[-1], abs=1e-9)
    assert place[1] == pytest.approx([3.0, 3.0], abs=1e-6)


def test_a_frame_that_comes_late_counts_for_its_own_time():
    times = np.arange(0.0, 0.5, 1 / RATE)
    made, _ = follow(np.stack([2.0 * times, 0.0 * times], axis=1), times)
    row, late_s = np.array([0]), times[-1] - 0.01
    assert made.innovations(row, np.array([[2.0 * late_s, 0.0]]), late_s) == pytest.approx(np.zeros((1, 2)), abs=2e-3)
    made.predict(row, late_s)
    assert made.times_s(row)[0] == times[-1]
    made.update(row, np.array([[2.0 * late_s, 0.0]]), late_s)
    assert made.at(row, times[-1])[0][0] == pytest.approx([2.0 * times[-1], 0.0], abs=2e-3)


def test_nobody_is_foretold_to_speed_up_for_ever():
    times = np.arange(0.0, 0.5, 1 / RATE)
    made, _ = follow(np.stack([2.0 * times**2, 0.0 * times], axis=1), times)
    _, soon = made.at(np.array([0]), times[-1] + 0.2)
    _, late = made.at(np.array([0]), times[-1] + 5.0)
    assert late[0] == pytest.approx(soon[0], abs=1e-2)
