"""Shared memory between two processes: what goes in comes out, in order, and nothing is overwritten."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.live.handover.frame_slots import FrameSlots, Handed


@pytest.fixture
def slots():
    made = FrameSlots.create(3, 4000)
    yield made
    made.remove()


def handed(number, height=8, width=6, rest=b"rest"):
    rng = np.random.default_rng(number)
    return Handed(number, 1, 0, 2, rng.integers(0, 256, (height, width, 3), dtype=np.uint8), rest)


@given(st.integers(1, 20), st.integers(1, 20), st.binary(max_size=500), st.integers(0, 2**40))
def test_what_goes_in_comes_out_in_another_mapping(height, width, rest, number):
    slots = FrameSlots.create(1, 4000)
    other = FrameSlots(slots.path, slots.count, slots.slot_bytes)
    slots.remove()
    sent = handed(number, height, width, rest)
    slots.fill(0, sent)
    assert not other.are_empty
    (got,) = other.take()
    assert slots.are_empty
    assert got[:4] == sent[:4]
    assert got.rest == rest
    assert np.array_equal(got.frame, sent.frame)


def test_filled_slots_are_not_given_again_until_they_are_taken(slots):
    for number in (5, 3, 4):
        slot = slots.empty_slot()
        slots.fill(slot, handed(number))
    assert slots.empty_slot() is None
    assert [got.number for got in slots.take()] == [3, 4, 5]
    assert slots.empty_slot() == 0
    assert slots.take() == []


def test_a_taken_frame_is_a_copy(slots):
    slots.fill(0, handed(1))
    (first,) = slots.take()
    kept = first.frame.copy()
    slots.fill(0, handed(2))
    assert np.array_equal(first.frame, kept)


def test_a_frame_that_is_a_part_of_another_is_copied_as_it_looks(slots):
    whole = np.arange(2 * 10 * 10 * 3, dtype=np.uint8).reshape(20, 10, 3)
    part = whole[::2, ::-1]
    slots.fill(0, Handed(1, 0, 0, 0, part, b""))
    assert np.array_equal(slots.take()[0].frame, part)


def test_processor_time_passes_the_other_way(slots):
    FrameSlots(slots.path, slots.count, slots.slot_bytes).cpu_s = 12.5
    assert slots.cpu_s == 12.5


def test_only_this_user_can_read_it(slots):
    assert slots.path.stat().st_mode & 0o077 == 0
