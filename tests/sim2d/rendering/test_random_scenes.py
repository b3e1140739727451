"""Random scenes: repeatable one by one, nothing overlaps, and conditions do what they say."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from field_models import field_names, load_field
from field_models.errors import ArgumentError
from sim2d.commands.render import CONDITION_NAMES
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, RING_RANGE_M, Condition, random_scene, sample
from sim2d.rendering.scene import Scene

SSL = load_field("ssl_2001")
SMALL = sekimori_camera(128, 110)


def test_a_sample_depends_on_seed_and_number_alone():
    condition = CONDITIONS["bad_day"]
    all_of_them = list(sample(SSL, SMALL, condition, 11, 4))
    some = list(sample(SSL, SMALL, condition, 11, 4, indices=[3, 1]))
    assert [s.index for s in all_of_them] == [0, 1, 2, 3]
    for drawn in some:
        twin = all_of_them[drawn.index]
        np.testing.assert_array_equal(drawn.frame, twin.frame)
        assert drawn.pose == twin.pose
        assert drawn.scene.boxes == twin.scene.boxes
    other = next(iter(sample(SSL, SMALL, condition, 12, 1)))
    assert np.any(other.frame != all_of_them[0].frame)
    assert all_of_them[0].frame.shape == (110, 128, 3)


@pytest.mark.parametrize(
    ("name", "ring"),
    [
        ("ssl_2001", False),
        ("spl_2020", False),
        *(
            pytest.param(name, False, marks=pytest.mark.slow)
            for name in field_names()
            if name not in ("ssl_2001", "spl_2020")
        ),
        pytest.param("ssl_2001", True, marks=pytest.mark.slow),
    ],
)
def test_nothing_overlaps(name: str, ring: bool):
    """The slow cases alone find boxes that stand in each other in a crowd, or on fields of other sizes."""
    field = load_field(name)
    condition = dataclasses.replace(CONDITIONS["crowd" if ring else "nominal"], ball_rate=1.0)
    bare = Scene(field)
    balls = 0
    for index in range(12):
        scene, pose = random_scene(field, SMALL, condition, np.random.default_rng([5, index]))
        assert condition.obstacles[0] <= len(scene.boxes) <= condition.obstacles[1]
        assert bare.clearance_m(pose.x_m, pose.y_m) >= field.robot_radius_m
        assert field.contains([pose.x_m, pose.y_m])
        for k, box in enumerate(scene.boxes):
            assert field.contains(box.corners).all()
            assert box.distance_m(pose.x_m, pose.y_m) > field.robot_radius_m
            outline = np.concatenate(
                [np.linspace(a, b, 9) for a, b in zip(box.corners, np.roll(box.corners, 1, 0), strict=True)]
            )
            for other in scene.boxes[k + 1 :]:
                assert min(other.distance_m(x, y) for x, y in outline) > 0
        if scene.ball is not None:
            balls += 1
            away = math.hypot(scene.ball.x_m - pose.x_m, scene.ball.y_m - pose.y_m)
            assert field.robot_radius_m + field.ball_radius_m < away <= 1.5
            assert scene.clearance_m(scene.ball.x_m, scene.ball.y_m) >= field.ball_radius_m
            assert field.contains([scene.ball.x_m, scene.ball.y_m])
    assert balls >= 9


@pytest.mark.slow
def test_crowd_stands_around_the_robot():
    """Only this finds a crowd that stands elsewhere."""
    distances, full = [], 0
    for index in range(40):
        scene, pose = random_scene(SSL, SMALL, CONDITIONS["crowd"], np.random.default_rng([1, index]))
        near = [box.distance_m(pose.x_m, pose.y_m) for box in scene.boxes]
        inside = [d for d in near if RING_RANGE_M[0] - 1e-3 <= d <= RING_RANGE_M[1] + 1e-3]
        distances += inside
        full += len(inside) == len(near)
        assert min(near) > RING_RANGE_M[0] - 1e-3
    assert full > 20
    assert min(distances) < 0.2
    assert max(distances) > 0.38


def test_poses_cover_the_floor_and_all_headings():
    poses = np.array(
        [random_scene(SSL, SMALL, CONDITIONS["nominal"], np.random.default_rng([2, i]))[1].array for i in range(150)]
    )
    counts, *_ = np.histogram2d(poses[:, 0], poses[:, 1], bins=(4, 3), range=((-1.37, 1.37), (-0.7625, 0.7625)))
    assert counts.min() >= 3
    assert np.histogram(poses[:, 2], bins=6, range=(-math.pi, math.pi))[0].min() >= 10
    assert np.abs(poses[:, 1]).max() > 0.62


def test_ball_ratio_and_obstacle_range():
    condition = Condition(obstacles=(2, 4), ball_rate=0.0)
    drawn = [random_scene(SSL, SMALL, condition, np.random.default_rng([3, i]))[0] for i in range(30)]
    assert {len(scene.boxes) for scene in drawn} == {2, 3, 4}
    assert all(scene.ball is None for scene in drawn)
    drawn = [random_scene(SSL, SMALL, Condition(), np.random.default_rng([4, i]))[0] for i in range(100)]
    shares = [scene.ball is not None for scene in drawn]
    assert 0.35 < np.mean(shares) < 0.65


def test_conditions():
    assert tuple(CONDITIONS) == CONDITION_NAMES
    assert CONDITIONS["nominal"].sensor.noise_sigma == 8
    assert CONDITIONS["warm"].cast_bgr == CONDITIONS["cold"].cast_bgr[::-1]
    true = CONDITIONS["miscalibrated"].true_camera(sekimori_camera())
    assert true.center_px == pytest.approx((128.1, 109.0))
    assert true.tilt_rad == pytest.approx((math.radians(0.3), math.radians(-0.2)))
    given = dataclasses.replace(sekimori_camera(), tilt_rad=(0.01, 0.0))
    assert CONDITIONS["miscalibrated"].true_camera(given).tilt_rad[0] == pytest.approx(0.01 + math.radians(0.3))


def test_miscalibrated_picture_is_shifted():
    still = dataclasses.replace(CONDITIONS["nominal"], noise_sigma=0.0, obstacles=(0, 0), ball_rate=0.0)
    moved = dataclasses.replace(still, center_offset_px=(3.0, -2.0))
    camera = sekimori_camera()
    for plain, shifted in zip(sample(SSL, camera, still, 1, 2), sample(SSL, camera, moved, 1, 2), strict=True):
        difference = np.abs(np.roll(plain.frame, (-2, 3), axis=(0, 1)).astype(int) - shifted.frame)[30:190, 30:220]
        assert np.percentile(difference, 95) <= 5


def test_bad_day_has_all_of_it():
    scene, _ = random_scene(SSL, SMALL, CONDITIONS["bad_day"], np.random.default_rng(0))
    assert scene.light.texture == 0.10
    assert scene.light.shadow is not None
    assert scene.light.shadow.factor_bgr[0] > scene.light.shadow.factor_bgr[2]
    assert len(scene.light.highlights) == 3


def test_field_without_room_for_the_robot():
    crowded = dataclasses.replace(SSL, robot_radius_m=0.9)
    with pytest.raises(ArgumentError, match=r"no room for a robot of radius 0\.9 m"):
        random_scene(crowded, SMALL, Condition(), np.random.default_rng(0))
