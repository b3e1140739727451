"""The compiled unrolling against OpenCV's gathering and blur."""

import cv2
import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.floor.unrolled import unroll


@settings(deadline=None, max_examples=50)
@given(st.integers(0, 2**32 - 1), st.integers(2, 20), st.integers(2, 20), st.sampled_from([1, 40, 256]))
@example(seed=0, rows=2, columns=2, levels=256)
def test_samples_are_gathered_and_blurred_as_opencv_does(seed, rows, columns, levels):
    rng = np.random.default_rng(seed)
    height, width = rng.integers(1, 30, 2)
    frame = (255 - rng.integers(0, levels, (height, width, 3))).astype(np.uint8)
    u, v = rng.integers(0, width, (rows, columns)), rng.integers(0, height, (rows, columns))
    out = np.empty((rows, columns, 3), dtype=np.uint8)
    unroll(frame, (3 * (v * width + u)).astype(np.int32), out)
    np.testing.assert_array_equal(out, cv2.blur(frame[v, u], (3, 3)))
