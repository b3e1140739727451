"""Moving objects followed through misses, shadows and crossings; what is refused; what is never reported."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.belief import Track
from robocup_vision.geometry import Pose2
from robocup_vision.tracking import Detection, MovingObjects, MovingObjectsSettings
from robocup_vision.tracking.branches import Branches

HOME = Pose2(0.0, 0.0, 0.0)
PERIOD_S = 1 / 15
NOISE_M = 0.02
# evidence of a new branch 0, so that a test reads what a frame adds
SETTINGS = MovingObjectsSettings(speed_mps=0.5, first_log_odds=0.0)


def seen(places, rng=None, robot=HOME):
    local = robot.inverse().transform(np.reshape(places, (-1, 2)))
    noise = np.zeros_like(local) if rng is None else rng.normal(0, NOISE_M, local.shape)
    return [Detection(x, y, NOISE_M**2 * np.eye(2)) for x, y in (local + noise).tolist()]


def follow(frames, objects=None, robot=HOME):
    """Tracks of each frame of places (or of detections)."""
    objects = objects or MovingObjects()
    rng = np.random.default_rng(1)
    return [
        objects.update(k * PERIOD_S, f if f and isinstance(f[0], Detection) else seen(f, rng, robot), robot)
        for k, f in enumerate(frames)
    ]


def straight(start, velocity, count):
    return [np.add(start, np.multiply(velocity, k * PERIOD_S)).tolist() for k in range(count)]


def test_time_must_advance():
    objects = MovingObjects()
    objects.update(1.0, [], HOME)
    with pytest.raises(ArgumentError, match=r"t_s must advance, got 1\.0 after 1\.0"):
        objects.update(1.0, [], HOME)


def test_an_object_is_reported_after_some_frames_with_its_velocity_and_one_number():
    frames = follow([[p] for p in straight((1.0, -0.5), (0.0, 0.6), 30)])
    assert not any(frames[:2])
    assert all(len(tracks) == 1 for tracks in frames[4:])
    assert len({tracks[0].number for tracks in frames[4:]}) == 1
    last = frames[-1][0]
    assert math.hypot(last.vx_mps, last.vy_mps - 0.6) < 0.15
    assert math.hypot(last.x_m - 1.0, last.y_m - (-0.5 + 0.6 * 29 * PERIOD_S)) < 0.05
    assert last.frames == 30
    assert last.missed == 0
    assert last.probability > 0.9
    with pytest.raises(ValueError, match="read-only"):
        last.covariance[0, 0] = 1.0


def test_the_robots_own_motion_is_no_motion_of_the_object():
    objects, last = MovingObjects(), ()
    for k in range(30):
        robot = Pose2(0.3 * k * PERIOD_S, 0.0, 0.5 * k * PERIOD_S)
        last = objects.update(k * PERIOD_S, seen([(1.0, 0.4)], robot=robot), robot, np.eye(3) * 1e-4)
    assert math.hypot(last[0].x_m - 1.0, last[0].y_m - 0.4) < 0.02
    assert math.hypot(last[0].vx_mps, last[0].vy_mps) < 0.05


def test_an_object_coasts_through_misses_and_is_given_up_in_the_open():
    way = straight((1.0, -0.5), (0.0, 0.5), 60)
    frames = follow([[p] if k < 20 or k in (23, 24) else [] for k, p in enumerate(way)])
    assert frames[22][0].missed == 3
    assert frames[22][0].number == frames[24][0].number
    assert frames[-1] == ()
    gone = next(k for k, tracks in enumerate(frames) if k > 24 and not tracks)
    assert gone < 40


def test_an_object_hidden_by_another_keeps_its_number():
    # one stands; the other passes behind it, unseen for a second
    front = (0.5, 0.0)
    way = straight((1.0, -0.7), (0.0, 0.5), 45)
    hidden = [abs(math.atan2(y, x)) < math.asin(0.09 / 0.5) for x, y in way]
    assert sum(hidden) > 8
    frames = follow([[front] if away else [front, p] for p, away in zip(way, hidden, strict=True)])
    before = hidden.index(True) - 1
    numbers = {t.number for t in frames[before]}
    assert len(numbers) == 2
    assert {t.number for t in frames[-1]} == numbers
    # nothing hides it: then it is soon given up
    alone = follow([[] if away else [p] for p, away in zip(way, hidden, strict=True)])
    assert alone[-1][0].number != alone[before][0].number or len(alone[hidden.index(True) + 8]) == 0


def test_two_that_cross_keep_their_numbers():
    a, b = straight((1.0, -0.6), (0.15, 0.6), 30), straight((1.2, 0.6), (-0.15, -0.6), 30)
    frames = follow([[p, q] for p, q in zip(a, b, strict=True)])
    first, last = ({t.number: (t.x_m, t.y_m) for t in frames[k]} for k in (8, -1))
    assert set(first) == set(last)
    for start, end in ((a, a), (b, b)):
        number = min(first, key=lambda n: math.dist(first[n], start[8]))
        assert math.dist(last[number], end[-1]) < 0.08


def test_one_that_is_seen_in_two_pieces_is_one():
    rng = np.random.default_rng(2)
    frames = []
    for k, (x, y) in enumerate(straight((1.0, -0.5), (0.0, 0.5), 40)):
        frames.append(seen([(x, y - 0.06), (x, y + 0.06)] if k % 10 == 9 else [(x, y)], rng))
    tracks = follow(frames)
    assert max(len(t) for t in tracks) == 1


@settings(max_examples=8)
@given(st.integers(0, 2**32 - 1))
def test_clutter_alone_is_reported_next_to_never(seed):
    rng = np.random.default_rng(seed)
    frames = [rng.uniform((-1.3, -0.7), (1.3, 0.7), (rng.poisson(0.6), 2)).tolist() for _ in range(60)]
    numbers = {t.number for tracks in follow(frames) for t in tracks}
    assert len(numbers) <= 1


def one_branch(covariance):
    none = np.empty(0, dtype=np.int64)
    begun = Branches.initiated(np.array([1]), np.array([[1.0, 0.0]]), 0.01 * np.eye(2)[None], np.array([0]), SETTINGS)
    assert len(Branches.initiated(none, np.empty((0, 2)), np.empty((0, 2, 2)), none, SETTINGS)) == 0
    begun.covariance[0] = covariance
    return begun


@given(st.integers(0, 2**32 - 1))
def test_a_detection_updates_a_branch_as_a_kalman_filter(seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(0, 0.1, (4, 4))
    covariance = root @ root.T + 1e-3 * np.eye(4)
    spread = np.diag(rng.uniform(0.001, 0.01, 2))
    place = np.array([1.0, 0.0]) + rng.normal(0, 0.03, 2)
    both = one_branch(covariance).split(0.0, place[None], spread[None], np.array([7]), np.zeros(2), SETTINGS)
    assert len(both) == 2
    seen_one = int(np.flatnonzero(both.missed == 0)[0])
    h = np.eye(2, 4)
    innovation = h @ covariance @ h.T + spread
    gain = covariance @ h.T @ np.linalg.inv(innovation)
    off = place - (1.0, 0.0)
    np.testing.assert_allclose(both.mean[seen_one], np.array([1.0, 0, 0, 0]) + gain @ off, atol=1e-9)
    np.testing.assert_allclose(both.covariance[seen_one], (np.eye(4) - gain @ h) @ covariance, atol=1e-9)
    density = math.exp(-0.5 * off @ np.linalg.solve(innovation, off)) / math.sqrt(np.linalg.det(math.tau * innovation))
    assert both.evidence[seen_one] == pytest.approx(math.log(0.8 * density / 0.2))
    assert both.history[seen_one, :2].tolist() == [7, 0]


def test_a_miss_in_the_open_leaves_the_position_and_beside_a_shadow_moves_it_there():
    covariance = np.diag([0.01, 0.01, 0.1, 0.1])
    covariance[1, 3] = covariance[3, 1] = 0.02
    nothing = np.empty((0, 2))
    unseen = np.empty((0, 2, 2)), np.empty(0, dtype=np.int64)
    opened = one_branch(covariance).split(0.0, nothing, *unseen, np.zeros(2), SETTINGS)
    assert opened.evidence[0] == pytest.approx(math.log(0.2))
    np.testing.assert_allclose(opened.mean[0], [1, 0, 0, 0], atol=1e-12)
    far = np.array([[0.4, 0.1]])  # hides what is to the left
    hidden = one_branch(covariance).split(0.0, far, 1e-4 * np.eye(2)[None], np.array([3]), np.zeros(2), SETTINGS)
    assert len(hidden) == 1
    assert hidden.mean[0, 1] > 0.02
    assert hidden.mean[0, 3] > 0.02
    assert math.log(0.2) < hidden.evidence[0] < 0.0
    assert np.linalg.eigvalsh(hidden.covariance[0]).min() > 0


def test_a_track_becomes_an_obstacle_of_the_robot_frame():
    covariance = np.diag([0.04, 0.01, 0.09, 0.25])
    track = Track(3, 1.0, 2.0, 0.5, 0.0, covariance, 0.9, 5, 0)
    obstacle = track.as_disc(Pose2(1.0, 1.0, math.pi / 2), 0.09, seconds=0.2)
    assert (obstacle.x_m, obstacle.y_m) == pytest.approx((1.0, -0.1))
    assert (obstacle.vx_mps, obstacle.vy_mps) == pytest.approx((0.0, -0.5))
    assert (obstacle.std_m, obstacle.velocity_std_mps) == pytest.approx((0.2, 0.5))
    assert obstacle.radius_m == 0.09
    assert track.place_after(0.2) == pytest.approx((1.1, 2.0))
