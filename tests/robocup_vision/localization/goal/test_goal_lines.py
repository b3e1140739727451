"""What lines around a goal say for a camera."""

import numpy as np
import pytest

from robocup_vision.localization.goal.goal_lines import Marks, MarkSettings


@pytest.mark.parametrize("width", [0.4, 3.0])
def test_what_clutter_shows_speaks_for_no_camera_on_the_whole(width):
    settings = MarkSettings(seen_ratio=0.8, full_width_px=1.0, spread_px=0.5, clutter_ratio=0.3)
    off = np.linspace(-8.0, 8.0, 8001)
    none = np.empty((1, 2))

    def nats(residual_px, is_seen):
        one = Marks(none, none, none, np.array([width]), np.array([8.0]), np.array([is_seen]))
        return one.nats(np.array([residual_px]), settings)

    seen, missing = [nats(one, True) for one in off], nats(np.nan, False)
    # odds by clutter's own chances: a ridge anywhere within reach, or none
    mean = 0.3 * np.mean(np.exp(seen)) + 0.7 * np.exp(missing)
    assert mean == pytest.approx(1.0, abs=2e-3)
    assert seen[len(off) // 2] > 0 > missing
