"""Points held out of a fit: each frame keeps some in either half, and families that explain them as well are told."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.calibration.omni.choice import halves


@given(st.lists(st.lists(st.integers(0, 31), min_size=2, max_size=20), min_size=1, max_size=4))
def test_every_frame_has_points_in_both_halves(sectors):
    frame = np.concatenate([np.full(len(own), index) for index, own in enumerate(sectors)])
    sector = np.concatenate(sectors)
    half = halves(sector, frame)
    for index, own in enumerate(sectors):
        assert set(half[frame == index].tolist()) == {0, 1}
        if len({one % 2 for one in own}) == 2:
            np.testing.assert_array_equal(half[frame == index], np.array(own) % 2)
