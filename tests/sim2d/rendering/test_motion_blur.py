"""Motion blurs a frame along its way, by its length."""

import math

import numpy as np
import pytest

from sim2d.rendering.motion_blur import motion_blur, motion_kernel


@pytest.mark.parametrize(("du", "dv"), [(4.0, 0.0), (0.0, 5.5), (3.0, -4.0), (9.0, 2.0)])
def test_the_kernel_has_the_mean_and_the_variance_of_the_way(du, dv):
    kernel = motion_kernel(du, dv)
    assert kernel.sum() == pytest.approx(1.0)
    v, u = np.mgrid[: kernel.shape[0], : kernel.shape[1]]
    u, v = u - (kernel.shape[1] - 1) / 2, v - (kernel.shape[0] - 1) / 2
    assert abs((kernel * u).sum()) < 1e-6
    assert abs((kernel * v).sum()) < 1e-6
    length = math.hypot(du, dv)
    along = (u * du + v * dv) / length
    assert (kernel * along**2).sum() == pytest.approx(length**2 / 12, rel=0.1)
    # a way along an axis leaves the other one sharp
    assert kernel.shape[0] == 1 or dv
    assert kernel.shape[1] == 1 or du


def test_a_frame_is_blurred_along_its_way_alone():
    frame = np.zeros((20, 30, 3), dtype=np.uint8)
    frame[:, 15:] = 200
    assert motion_blur(frame, 0.6, 0.3) is frame
    assert (motion_blur(frame, 0.0, 6.0) == frame).all()
    blurred = motion_blur(frame, 6.0, 0.0)
    assert blurred[5, 15, 0] == pytest.approx(117, abs=4)
    assert (blurred[:, :11] == 0).all()
    assert (blurred[:, 19:] == 200).all()
