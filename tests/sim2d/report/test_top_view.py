"""The match from above: robots can be seen, and told apart, on fields of every size."""

import numpy as np
import pytest

from field_models import load_field
from field_models.catalog import field_names
from robocup_vision.geometry import Pose2
from sim2d.report.top_view import SIDE_COLORS, TopView
from sim2d.world.state import RobotState, WorldState

SIZE_PX = (620, 380)


@pytest.mark.parametrize("name", field_names())
def test_robots_are_seen_on_every_field(name):
    view = TopView(load_field(name), SIZE_PX, 0.09)
    robots = tuple(
        RobotState(i, side, 0, Pose2(x, 0.3, 0.0), (0.0, 0.0), 0.0)
        for i, (side, x) in enumerate(((1, -0.8), (-1, 0.8)))
    )
    empty = WorldState(0.0, (), None, (0, 0), "play", 1, ())
    with_them = WorldState(0.0, robots, None, (0, 0), "play", 1, ())
    changed = (view.draw(with_them) != view.draw(empty)).any(axis=2)
    left, right = changed[:, : SIZE_PX[0] // 2], changed[:, SIZE_PX[0] // 2 :]
    for half in (left, right):
        # a disc of 16 pixels across at least
        assert half.any(axis=0).sum() >= 16
        assert half.any(axis=1).sum() >= 16
    picture = view.draw(with_them)
    for color, half in (
        (SIDE_COLORS[1], picture[:, : SIZE_PX[0] // 2]),
        (SIDE_COLORS[-1], picture[:, SIZE_PX[0] // 2 :]),
    ):
        assert (np.abs(half.astype(int) - color).max(axis=2) < 12).sum() > 20
