"""Points held out of a fit: each frame keeps some in either half, and families that explain them as well are told."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.calibration.omni.choice import Choice, Chooser, _Trial, halves
from robocup_vision.calibration.omni.settings import ChoiceSettings


@given(st.lists(st.lists(st.integers(0, 31), min_size=2, max_size=20), min_size=1, max_size=4))
def test_every_frame_has_points_in_both_halves(sectors):
    frame = np.concatenate([np.full(len(own), index) for index, own in enumerate(sectors)])
    sector = np.concatenate(sectors)
    half = halves(sector, frame)
    for index, own in enumerate(sectors):
        assert set(half[frame == index].tolist()) == {0, 1}
        if len({one % 2 for one in own}) == 2:
            np.testing.assert_array_equal(half[frame == index], np.array(own) % 2)


def test_families_that_explain_the_held_out_points_as_well_are_named():
    groups = 9
    chooser = object.__new__(Chooser)
    chooser._settings, chooser._group = ChoiceSettings(), np.arange(groups)
    chooser.points = SimpleNamespace(weight=np.ones(groups))
    # of nine groups that all agree the mean is three standard errors away, of a mixed lot less than two
    loss = {"hyperboloid": np.full(groups, 0.1), "tangent": np.full(groups, 0.2)}
    loss["table"] = np.where(np.arange(groups) < 5, 0.2, 0.05)
    chooser._tried = tuple(_Trial(Choice(curve, True, 0.1, 0.3), one) for curve, one in loss.items())
    chosen = chooser._tried[0].choice
    assert [one.curve for one in chooser.as_good(chosen)] == ["table"]
    assert [one.curve for one in chooser.as_good(chooser._tried[1].choice)] == ["hyperboloid", "table"]
    # a level camera was not tried by every family
    assert chooser.as_good(Choice("hyperboloid", False, 0.1, 0.3)) == ()
