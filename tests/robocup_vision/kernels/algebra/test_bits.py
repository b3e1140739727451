"""Bits are found where Python finds them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.algebra.bits import lowest


@given(st.integers(1, 2**64 - 1))
def test_the_lowest_bit_is_the_one_that_divides_the_number(bits):
    assert 2 ** lowest(np.uint64(bits)) == bits & -bits


def test_every_place_is_told():
    assert [lowest(np.uint64(1 << place)) for place in range(64)] == list(range(64))
