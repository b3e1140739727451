"""How much of an object others leave in view."""

import numpy as np
import pytest

from robocup_vision.kernels.tracking.branches import (
    Eye,
    cast_shadows,
    visible_ratio,
)


def test_the_visible_ratio_runs_from_hidden_to_open():
    eye = Eye(0.0, 0.0, 0.09)
    shadows = cast_shadows(np.array([[0.5, 0.0]]), eye)
    points = [(1.0, 0.0), (1.0, 0.18), (1.0, 0.27), (1.0, 0.5), (0.3, 0.0)]
    hidden, half, most, beside, before = (visible_ratio(x, y, shadows, eye) for x, y in points)
    assert hidden == pytest.approx(0.0)
    assert 0.0 < half < most <= 1.0
    assert beside == before == 1.0
