"""What a `with` block closes is closed, also when the block raises."""

import pytest

from robocup_vision.closing import Closing


class Door(Closing):
    """Counts how often it is closed."""

    closed = 0

    def close(self):
        """Count."""
        self.closed += 1


def test_a_block_closes_what_it_opened():
    with Door() as door:
        assert door.closed == 0
    assert door.closed == 1


def test_a_block_that_raises_closes_too():
    door = Door()
    with pytest.raises(KeyError), door:
        raise KeyError
    assert door.closed == 1
