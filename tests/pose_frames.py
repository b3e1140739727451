"""What the tests of the pose filter share: frames that tell a pose, and drives of a robot that takes them."""

import numpy as np
from hypothesis import strategies as st

from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import PoseFilter

STD = np.array([0.005, 0.005, 0.01])
DT = 1 / 30
STILL = Pose2(0.0, 0.0, 0.0)
STEP = Pose2(0.02, 0.0, 0.03)
seeds = st.integers(0, 2**32 - 1)


def told(pose, *, half=True, std=STD):
    return PoseEstimate(pose, np.diag(std**2), 0.9, 0.3, (pose,) if half else (pose, pose.half_turn()))


def noisy(pose, rng):
    x, y, theta = pose.array + STD * rng.standard_normal(3)
    return Pose2(x, y, theta)


def run(truth, steps, rng, *, scale=1.0, filter_=None, start_s=0.0, half=True):
    """Drive on with odometry of this scale, a frame a step; return the filter, the truth and the time at the end."""
    filter_ = filter_ or PoseFilter()
    felt = Pose2(scale * STEP.x_m, scale * STEP.y_m, scale * STEP.theta_rad)
    for _ in range(steps):
        start_s += DT
        filter_.predict(felt, start_s)
        truth = truth.compose(STEP) if filter_.belief else truth
        filter_.update(told(noisy(truth, rng), half=half), start_s)
    return filter_, truth, start_s


def random_drive(rng, count=25):
    """Odometry, and frames of a robot that drives: some open, some wrong, some of the wrong half, some missing."""
    truth, steps, frames = Pose2(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3, 3)), [STILL], []
    for index in range(count):
        seen = noisy(truth, rng)
        kind = rng.random()
        if kind < 0.1:
            seen = Pose2(*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3, 3))
        elif kind < 0.2:
            seen = seen.half_turn()
        if kind < 0.8 or index == 0:
            frames.append((index, told(seen, half=bool(rng.random() < 0.5), std=STD * rng.uniform(0.5, 2.0))))
        steps.append(Pose2(*rng.uniform(-0.02, 0.02, 2), rng.uniform(-0.1, 0.1)))
        truth = truth.compose(steps[-1])
    return steps, frames
