"""The vote on the goals' colours in painted frames."""

import numpy as np
import pytest
from strategies import PAPER_MIRROR

from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.goal.colors import GoalPalette, MirrorProjection, vote_goal_colors

NO_MASK = np.empty((0, 0), dtype=np.uint8)
HUES = np.array([-0.4, 0.5, 0.0])  # yellow, blue, white
# log R/G and B/G of yellow, blue, both with red and blue swapped, and white
LOG_RATIOS = np.array([[0.1, -1.8], [-0.8, 0.9], [-1.8, 0.1], [0.9, -0.8], [0.0, 0.0]])
Q_STEP = 0.002
TABLE = np.nan_to_num(PAPER_MIRROR.radius_px(np.arange(5000) * Q_STEP))


def vote(frame, pose, points, sides, camera, hidden=NO_MASK):
    to_camera = np.ascontiguousarray(camera.camera_to_robot.T)
    projection = MirrorProjection(
        np.array(camera.viewpoint_m), to_camera, camera.center_px, camera.heading_rad, camera.mirrored,
        camera.usable_radius_px, Q_STEP, TABLE,
    )  # fmt: skip
    return vote_goal_colors(frame, tuple(pose.array), points, sides, projection, GoalPalette(HUES, LOG_RATIOS), hidden)


@pytest.mark.parametrize(
    ("color", "expected", "order"),
    [
        ((35, 205, 225), (1, 0), (1, 0)),
        ((190, 80, 35), (0, 1), (1, 0)),
        ((230,) * 3, (0, 0), (0, 0)),
        ((225, 205, 35), (0, 1), (0, 1)),
        ((35, 80, 190), (1, 0), (0, 1)),
    ],
)
def test_a_painted_frame_votes_for_its_colour(color, expected, order):
    frame = np.full((220, 256, 3), color, dtype=np.uint8)
    camera = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
    points, sides = np.array([[1.5, 0.1, 0.1]]), np.array([1.0])
    assert vote(frame, Pose2(0.4, 0.0, 0.3), points, sides, camera) == expected + order
    # the half turn sees the other goal there
    assert vote(frame, Pose2(0.4, 0.0, 0.3), points, -sides, camera) == expected[::-1] + order


def test_a_point_straight_above_the_mirror_is_not_looked_at():
    camera = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), PAPER_MIRROR)
    frame = np.zeros((220, 256, 3), dtype=np.uint8)
    assert vote(frame, Pose2(0.0, 0.0, 0.0), np.zeros((1, 3)), np.ones(1), camera) == (0, 0, 0, 0)
