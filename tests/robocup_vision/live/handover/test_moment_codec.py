"""Moments pass between processes whole; what seldom changes passes once."""

from dataclasses import replace

import numpy as np

from robocup_vision.geometry import Pose2
from robocup_vision.image_layers import ImageLayerMaker
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


def test_where_everything_is_in_a_simulation_passes(remembered):
    world = TrueWorld((TrueRobot("robot 3", -1, Pose2(1.0, 0.0, 3.0)),), None)
    data, _ = MomentWriter().write(replace(remembered, world=world))
    assert MomentReader().read(data, remembered.frame).world == world


def test_what_has_not_changed_is_sent_once(remembered):
    writer, reader = MomentWriter(), MomentReader()
    first, changed = writer.write(remembered)
    writer.sent(changed)
    second, nothing = writer.write(replace(remembered, t_s=9.0))
    assert nothing == {}
    assert len(second) < len(first) / 10
    reader.read(first, remembered.frame)
    got = reader.read(second, remembered.frame)
    assert got.t_s == 9.0
    assert got.view.polar.camera.center_px == remembered.view.polar.camera.center_px
    assert got.colors is not None


def test_what_was_not_sent_is_sent_again(remembered):
    writer = MomentWriter()
    _, changed = writer.write(remembered)
    _, again = writer.write(remembered)
    assert again.keys() == changed.keys()


def test_a_moment_without_a_view_passes_too(remembered):
    writer, reader = MomentWriter(), MomentReader()
    data, _ = writer.write(replace(remembered, view=None, problem="too small", settings={"a": "b"}))
    got = reader.read(data, remembered.frame)
    assert (got.view, got.problem, got.settings) == (None, "too small", {"a": "b"})
