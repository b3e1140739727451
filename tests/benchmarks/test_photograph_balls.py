"""Boxes around balls that a picture's rim cuts."""

import pytest

from benchmarks.scores.photograph_balls import continued


@pytest.mark.parametrize(
    ("box", "whole"),
    [
        ([1.0, 100.0, 11.0, 130.0], [-19.0, 100.0, 11.0, 130.0]),
        ([210.0, 10.0, 223.0, 40.0], [210.0, 10.0, 240.0, 40.0]),
        ([100.0, 10.0, 111.0, 40.0], [100.0, 10.0, 111.0, 40.0]),
        ([0.0, 10.0, 40.0, 40.0], [0.0, 10.0, 40.0, 40.0]),
    ],
)
def test_a_box_that_the_rim_cuts_goes_on_to_the_width_of_its_height(box, whole):
    assert continued(box, 224) == whole
