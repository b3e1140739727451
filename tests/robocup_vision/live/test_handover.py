"""Frames and moments handed to the page's process."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.geometry import Pose2
from robocup_vision.image_layers import ImageLayerMaker
from robocup_vision.live.handover.frame_slots import FrameSlots, Handed
from robocup_vision.live.handover.moment import MomentReader, MomentWriter, TrueRobot, TrueWorld
from robocup_vision.live.page.picture import describe


def test_a_moment_is_described_alike_on_both_sides(setup, remembered):
    writer, reader = MomentWriter(), MomentReader()
    layers = ImageLayerMaker(setup.field)
    data, changed = writer.write(remembered)
    got = reader.read(data, remembered.frame)
    assert describe(got, layers) == describe(remembered, layers)
    assert np.array_equal(got.view.belief.free_map.state, remembered.view.belief.free_map.state)
    assert set(changed) == {"polar", "grid", "camera", "colors", "map_state", "marking_finder"}
    there, here = ([one.start_m for one in view.markings.segments] for view in (got.view, remembered.view))
    assert there == here != []


def test_what_has_not_changed_is_sent_once(remembered):
    writer, reader = MomentWriter(), MomentReader()
    first, changed = writer.write(remembered)
    # until they are on their way, they are to be sent
    assert writer.write(remembered)[1].keys() == changed.keys()
    writer.sent(changed)
    second, nothing = writer.write(replace(remembered, t_s=9.0))
    assert nothing == {}
    assert len(second) < len(first) / 10
    reader.read(first, remembered.frame)
    got = reader.read(second, remembered.frame)
    assert got.t_s == 9.0
    assert got.view.polar.camera.center_px == remembered.view.polar.camera.center_px
    assert got.colors is not None


def test_a_moment_without_a_view_passes_too(remembered):
    world = TrueWorld((TrueRobot("robot 3", -1, Pose2(1.0, 0.0, 3.0)),), None)
    bare = replace(remembered, view=None, problem="too small", settings={"a": "b"}, world=world)
    got = MomentReader().read(MomentWriter().write(bare)[0], remembered.frame)
    assert (got.view, got.problem, got.settings, got.world) == (None, "too small", {"a": "b"}, world)


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
    (got,) = other.take()
    assert slots.empty_slot() == 0
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
