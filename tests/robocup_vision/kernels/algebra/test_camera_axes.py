"""The kernels' camera axes are those of the camera model."""

import numpy as np
from hypothesis import given
from strategies import numbers

from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.kernels.algebra.camera_axes import camera_axes


@given(numbers(-3.2, 3.2), numbers(-1.5, 1.5), numbers(-1.5, 1.5))
def test_axes_are_those_of_the_camera_model(pan, tilt, roll):
    np.testing.assert_allclose(camera_axes(pan, tilt, roll), camera_rotation(pan, tilt, roll), atol=1e-15)
