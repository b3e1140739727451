"""Settings of the pose filter: what is out of range is refused, and what is set counts."""

from __future__ import annotations

import numpy as np

from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import PoseFilter, PoseFilterSettings


def test_a_filter_follows_no_more_modes_than_set():
    estimates = [PoseEstimate(Pose2(x, 0.0, 0.0), np.diag([0.01, 0.01, 0.01]) ** 2, 1.0, 0.5) for x in (-1.0, 0.0, 1.0)]
    counts = []
    for max_modes in (1, 8):
        filter_ = PoseFilter(settings=PoseFilterSettings(max_modes=max_modes))
        for k, estimate in enumerate(estimates):
            filter_.predict(Pose2(0.0, 0.0, 0.0), 0.1 * k)
            filter_.update(estimate, 0.1 * k)
        # each mode stands for both halves of the field
        counts.append(len(filter_.hypotheses) // 2)
    assert counts[0] == 1
    assert counts[1] > 1
