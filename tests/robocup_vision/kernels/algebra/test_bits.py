"""Bits are found where Python finds them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.kernels.algebra.bits import eight_bytes, eight_equal, four_bytes, lowest


@given(st.integers(1, 2**64 - 1))
def test_the_lowest_bit_is_the_one_that_divides_the_number(bits):
    assert 2 ** lowest(np.uint64(bits)) == bits & -bits


def test_every_place_is_told():
    assert [lowest(np.uint64(1 << place)) for place in range(64)] == list(range(64))


@given(st.binary(min_size=8, max_size=40), st.data())
def test_bytes_in_a_row_are_a_number_with_the_first_one_lowest(row, data):
    values = np.frombuffer(row, np.uint8).copy()
    at = data.draw(st.integers(0, len(row) - 8))
    assert four_bytes(values, np.uint64(at)) == int.from_bytes(row[at : at + 4], "little")
    assert eight_bytes(values, np.uint64(at)) == int.from_bytes(row[at : at + 8], "little")


@given(st.lists(st.integers(0, 3), min_size=8, max_size=40), st.integers(0, 3), st.data())
def test_bytes_that_are_a_value_have_a_bit(row, value, data):
    at = data.draw(st.integers(0, len(row) - 8))
    bits = int(eight_equal(np.array(row, np.uint8), np.uint64(at), value))
    assert bits == sum(1 << k for k in range(8) if row[at + k] == value)
