"""Sides of posts end at their feet; borders of somebody who stands before them do not."""

import cv2
import numpy as np
import pytest

from robocup_vision.kernels.model_edges.borders import leave_out_borders
from robocup_vision.kernels.model_edges.tables import EDGE, ON_FLOOR, UPRIGHT, empty_buffers

WALL, CARPET, POST, ROBOT = (190, 185, 200), (45, 125, 42), (235, 235, 235), (35, 35, 38)
HORIZON, FOOT, PER_M = 60, 70, 100.0
SAMPLE_V, CLEAR_PX, NOISE = 40.0, 5.0, 3.0


def picture(*, post_from=None, robot_from=None, robot_until=110, noise=NOISE, turned_deg=0.0):
    """Paint wall and carpet, and on them a post and a robot that reach from a column to the right and to the left."""
    frame = np.empty((120, 160, 3), np.float64)
    frame[:HORIZON], frame[HORIZON:] = WALL, CARPET
    # a line behind the post's foot
    frame[FOOT - 2 : FOOT + 1] = POST
    if post_from is not None:
        frame[10:FOOT, post_from : post_from + 8] = POST
    if robot_from is not None:
        frame[:robot_until, 20:robot_from] = ROBOT
    turn = cv2.getRotationMatrix2D((80.0, SAMPLE_V), turned_deg, 1.0)
    frame = cv2.warpAffine(frame, turn, (160, 120), borderMode=cv2.BORDER_REPLICATE)
    frame = cv2.GaussianBlur(frame, (0, 0), 0.6) + np.random.default_rng(4).normal(0.0, noise, frame.shape)
    return np.clip(frame, 0, 255).astype(np.uint8)


def left(frame, offsets=(0.0,), normal=(1.0, 0.0), place=UPRIGHT, foot_v=FOOT):
    """Offsets of the candidates that are left of a sample at column 80, whose inside lies to the right."""
    buffers = empty_buffers(1, 1)
    buffers.samples.uv[0], buffers.samples.normal[0] = (79.5, SAMPLE_V), normal
    buffers.samples.point_m[0] = 0.0, 0.0, (foot_v - SAMPLE_V) / PER_M
    buffers.samples.jacobian[0] = 0.0
    buffers.samples.jacobian[0, 1] = PER_M
    buffers.samples.kind[0], buffers.samples.place[0] = EDGE, place
    buffers.found.candidates[0] = len(offsets)
    buffers.found.offset_px[0, : len(offsets)] = offsets
    buffers.found.strength[0, : len(offsets)] = np.arange(len(offsets), 0, -1)
    leave_out_borders(frame, NOISE, CLEAR_PX, buffers, 1)
    return buffers.found.offset_px[0, : buffers.found.candidates[0]].tolist()


def test_a_post_keeps_its_side():
    assert left(picture(post_from=80)) == [0.0]


@pytest.mark.parametrize("turned_deg", [-2.0, 0.0, 2.0])
def test_a_border_that_goes_on_below_the_foot_is_none(turned_deg):
    assert left(picture(robot_from=80, turned_deg=turned_deg)) == []


def test_of_both_the_post_is_left():
    frame = picture(post_from=80, robot_from=74)
    assert left(frame, offsets=(-6.0, 0.0)) == [0.0]
    assert left(frame, offsets=(0.0, -6.0)) == [0.0]


def test_whoever_stands_farther_off_than_the_post_is_not_told_from_it():
    assert left(picture(robot_from=80, robot_until=FOOT)) == [0.0]


def test_a_foot_below_the_picture_tells_nothing():
    assert left(picture(robot_from=80, robot_until=120), foot_v=118.0) == [0.0]


def test_what_lies_level_or_on_the_floor_is_not_asked():
    frame = picture(robot_from=80)
    assert left(frame, normal=(0.0, 1.0)) == [0.0]
    assert left(frame, place=ON_FLOOR) == [0.0]


@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_noise_on_the_carpet_is_no_border(noise):
    for seed_shift in range(5):
        frame = np.roll(picture(post_from=80, noise=noise), seed_shift, axis=0)
        assert left(frame, foot_v=FOOT + seed_shift) == [0.0]
