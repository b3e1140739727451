"""The compiled vote on the goals' colours against the camera's own projection."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from strategies import PAPER_MIRROR, numbers

from robocup_vision.camera import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.goal.colors import GoalPalette, MirrorProjection, vote_goal_colors

NO_MASK = np.empty((0, 0), dtype=np.uint8)
HUES = np.array([-0.4, 0.5, 0.0])  # yellow, blue, white
# log R/G and B/G of yellow, blue, both with red and blue swapped, and white
LOG_RATIOS = np.array([[0.1, -1.8], [-0.8, 0.9], [-1.8, 0.1], [0.9, -0.8], [0.0, 0.0]])
Q_STEP = 0.002
TABLE = np.nan_to_num(PAPER_MIRROR.radius_px(np.arange(5000) * Q_STEP))


@st.composite
def level_or_tilted(draw):
    return OmniCamera(
        (256, 220),
        (127.5 + draw(numbers(-3, 3)), 109.5),
        (26.0, 112.0),
        PAPER_MIRROR,
        mirrored=draw(st.booleans()),
        heading_rad=draw(numbers(-3, 3)),
        offset_m=(draw(numbers(-0.1, 0.1)), 0.02),
        tilt_rad=(draw(numbers(-0.05, 0.05)), draw(numbers(-0.05, 0.05))),
    )


def vote(frame, pose, points, sides, camera, hidden=NO_MASK):
    to_camera = np.ascontiguousarray(camera.camera_to_robot.T)
    projection = MirrorProjection(
        np.array(camera.viewpoint_m), to_camera, camera.center_px, camera.heading_rad, camera.mirrored,
        camera.usable_radius_px, Q_STEP, TABLE,
    )  # fmt: skip
    return vote_goal_colors(frame, tuple(pose.array), points, sides, projection, GoalPalette(HUES, LOG_RATIOS), hidden)


def twin(frame, pose, points, sides, camera, hidden):
    """Votes (right, wrong, own, swapped), and how many points lie so near a border that either pixel may be meant."""
    robot = np.column_stack([pose.inverse().transform(points[:, :2]), points[:, 2]])
    pixels = camera.point_to_pixel(robot)
    votes, doubtful, nearest = [0, 0], 0, []
    height, width = frame.shape[:2]
    inner, outer = camera.usable_radius_px
    for (u, v), side in zip(pixels, sides, strict=True):
        radius = math.hypot(u - camera.center_px[0], v - camera.center_px[1])
        if not (inner - 1 < radius < outer + 1):
            continue
        near_border = abs(u - math.floor(u) - 0.5) < 0.1 or abs(v - math.floor(v) - 0.5) < 0.1
        if near_border or radius < inner + 0.2 or radius > outer - 0.2:
            doubtful += 1
            continue
        column, row = math.floor(u + 0.5), math.floor(v + 0.5)
        if not (1 <= column < width - 1 and 1 <= row < height - 1) or (hidden.size and hidden[row, column]):
            continue
        patch = frame[row - 1 : row + 2, column - 1 : column + 2].astype(float)
        blue, green, red = np.log(patch.sum(axis=(0, 1)) + 9)
        away = np.linalg.norm(LOG_RATIOS - (red - green, blue - green), axis=1)
        nearest.append((int(away.argmin()), side > 0))
        hue = (patch[..., 0].sum() - patch[..., 2].sum()) / (patch.sum() + 1)
        to_positive, to_negative, to_white = np.abs(hue - HUES)
        if to_white > min(to_positive, to_negative):
            votes[int((to_positive < to_negative) != (side > 0))] += 1
    order = []
    for first in (0, 2):
        here = [nearest.count((first, True)) + nearest.count((first + 1, False))]
        order.append(max(*here, nearest.count((first + 1, True)) + nearest.count((first, False))))
    return votes + order, doubtful


@settings(deadline=None, max_examples=40)
@given(level_or_tilted(), st.integers(0, 2**32 - 1), st.booleans())
def test_votes_agree_with_the_camera(camera, seed, masked):
    rng = np.random.default_rng(seed)
    frame = rng.integers(0, 256, (220, 256, 3), dtype=np.uint8)
    hidden = (rng.random((220, 256)) < 0.3).astype(np.uint8) if masked else NO_MASK
    points = np.column_stack([rng.uniform(-1.5, 1.5, (60, 2)), rng.uniform(0, 0.18, 60)])
    sides = rng.choice([-1.0, 1.0], 60)
    pose = Pose2(*rng.uniform(-1, 1, 2), rng.uniform(-3, 3))
    (right, wrong, own, swapped), doubtful = twin(frame, pose, points, sides, camera, hidden)
    found = vote(frame, pose, points, sides, camera, hidden)
    assert right <= found[0] <= right + doubtful
    assert wrong <= found[1] <= wrong + doubtful
    assert found[0] + found[1] <= right + wrong + doubtful
    assert own <= found[2] <= own + doubtful
    assert swapped <= found[3] <= swapped + doubtful


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
