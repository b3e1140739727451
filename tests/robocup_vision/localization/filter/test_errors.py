"""Error models: what lasts over a motion, and values of no sense refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import FORWARD_FRAME_ERRORS, FrameErrors

ways = st.floats(-1.0, 1.0)


@given(ways, ways, ways)
def test_a_common_error_lasts_the_less_the_farther_a_robot_drives_and_turns(x_m, y_m, turn_rad):
    motion, farther = Pose2(x_m, y_m, turn_rad), Pose2(2 * x_m, 2 * y_m, 2 * turn_rad)
    for errors in (FrameErrors(), FORWARD_FRAME_ERRORS):
        kept = errors.bias_kept(motion)
        assert 0 < kept <= 1
        # in two halves as much as at once
        assert errors.bias_kept(farther) == pytest.approx(kept**2)
    assert FrameErrors().bias_kept(motion) == FrameErrors().bias_kept(Pose2(x_m, y_m, 0.0))
