"""Error models: what lasts over a motion, and values of no sense refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import FORWARD_FRAME_ERRORS, FrameErrors, OdometryNoise

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


@pytest.mark.parametrize(
    "name", ["slip_ratio", "slip_s", "gain_std", "gain_s", "push_m", "push_rad", "shove_per_s", "kidnap_per_s"]
)
@pytest.mark.parametrize("value", [-0.1, math.nan, math.inf])
def test_odometry_noise_of_no_sense_is_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name} of the odometry must"):
        OdometryNoise(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("bias_ratio", 1.0),
        ("bias_ratio", -0.1),
        ("bias_distance_m", 0.0),
        ("bias_turn_rad", 0.0),
        ("bias_turn_rad", math.nan),
        ("outlier_rate", 0.0),
        ("half_error_rate", 0.5),
        ("spell_s", math.nan),
    ],
)
def test_frame_errors_of_no_sense_are_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name} of the frames must"):
        FrameErrors(**{name: value})
