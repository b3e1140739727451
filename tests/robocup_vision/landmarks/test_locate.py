"""One camera on the short run's map: near a prior, without one, within a budget, and honest where it cannot tell."""

import dataclasses

import numpy as np
import pytest

from field_models.errors import ArgumentError, FrameError
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.landmarks.matching import Described
from robocup_vision.landmarks.features import Features, SiftExtractor, from_bytes, match, match_by_loop, near, to_bytes
from robocup_vision.landmarks.landmark_map import MapIndex, expect
from robocup_vision.landmarks.locate import LandmarkPoseEstimator
from robocup_vision.landmarks.selection import Selection, TimeBudget, delegates, select
from robocup_vision.landmarks.vision import LandmarkVision, draw_landmarks
from sim2d.rendering.hall.runs import HALL_CAMERA


def off(pose: Pose2) -> Pose2:
    return Pose2(pose.x_m + 0.04, pose.y_m - 0.03, pose.theta_rad + 0.03)


@pytest.mark.parametrize("choice", ["informative", "cells", "frequency", "all"])
@pytest.mark.parametrize("matching", ["loop", "product"])
def test_a_second_run_is_located_to_a_centimetre(short_run, choice, matching):
    estimator = LandmarkPoseEstimator(short_run.landmarks, HALL_CAMERA, selection=Selection(choice), matching=matching)
    frame = short_run.second[1]
    found = estimator.look(frame.images[0], off(frame.pose))
    error_m, error_rad = found.pose.pose.error_to(frame.pose)
    assert error_m < 0.02
    assert error_rad < 0.006
    assert choice == "all" or len(found.expected) <= 60 or choice == "cells"
    assert set(found.timings_s) == {"features", "select", "match", "fit"}


def test_without_a_prior_the_whole_map_is_searched(short_run):
    estimator = LandmarkPoseEstimator(short_run.landmarks, HALL_CAMERA)
    for frame in short_run.second:
        found = estimator.look(frame.images[0])
        assert found.pose.pose.error_to(frame.pose)[0] < 0.02
        assert "relocate" in found.timings_s
        # a wrong prior is seen through
        assert estimator.locate(frame.images[0], Pose2(-1.0, 1.0, -2.0)).pose.error_to(frame.pose)[0] < 0.02


def test_a_picture_of_nothing_is_not_located(short_run):
    estimator = LandmarkPoseEstimator(short_run.landmarks, HALL_CAMERA)
    noise = np.random.default_rng(0).integers(0, 255, (240, 320, 3), dtype=np.uint8)
    for frame in (np.full((240, 320, 3), 80, dtype=np.uint8), noise):
        for prior in (None, short_run.frames[0].pose):
            pose = estimator.locate(frame, prior)
            assert isinstance(pose, NotLocated)
            assert pose.reason
    with pytest.raises(FrameError, match="frame must be uint8"):
        estimator.locate(np.zeros((240, 320), dtype=np.uint8))


def test_a_camera_mounted_aside_locates_its_robot(short_run):
    # the same picture, said to be of a camera ahead of the robot's centre and turned against it
    camera = dataclasses.replace(HALL_CAMERA, offset_m=(0.1, 0.02), pan_rad=0.3)
    frame = short_run.second[0]
    robot = frame.pose.compose(Pose2(0.1, 0.02, 0.3).inverse())
    estimator = LandmarkPoseEstimator(short_run.landmarks, camera)
    for prior in (off(robot), None):
        assert estimator.locate(frame.images[0], prior).pose.error_to(robot)[0] < 0.02


def test_regions_and_half_size_find_the_same_place(short_run):
    frame = short_run.second[1]
    whole = SiftExtractor(HALL_CAMERA).extract(frame.images[0])
    half = SiftExtractor(HALL_CAMERA, shrink=2).extract(frame.images[0])
    assert 20 < len(half) < len(whole)
    estimator = LandmarkPoseEstimator(short_run.landmarks, HALL_CAMERA, regions=True)
    found = estimator.look(frame.images[0], Pose2(frame.pose.x_m + 0.01, frame.pose.y_m, frame.pose.theta_rad))
    assert found.pose.pose.error_to(frame.pose)[0] < 0.03
    # features of the tiles are those of the whole frame
    expected = expect(short_run.landmarks, HALL_CAMERA, frame.pose.array)
    tiles = SiftExtractor(HALL_CAMERA).extract_near(frame.images[0], expected.pixels, 0.25)
    apart = np.hypot(*(tiles.pixels[:, None] - whole.pixels[None]).transpose(2, 0, 1)).min(axis=1)
    assert 0 < len(tiles) < len(whole)
    assert np.median(apart) < 0.3
    # far off, the tiles show nothing of use and the whole frame is looked at
    assert estimator.look(frame.images[0], Pose2(-1.0, 1.0, -2.0)).pose.pose.error_to(frame.pose)[0] < 0.03


def test_distortion_is_taken_out(short_run):
    image = short_run.frames[0].images[0]
    bent = dataclasses.replace(HALL_CAMERA, distortion=(-0.1, 0.01, 0.0, 0.0))
    straight, undone = (SiftExtractor(c).extract(image).pixels for c in (HALL_CAMERA, bent))
    robot = np.column_stack([np.ones(len(undone)), *(-(undone - bent.center_px) / bent.focal_px).T])
    np.testing.assert_allclose(bent.camera_ray_to_pixel(robot), straight, atol=1e-5)


def test_the_loop_and_the_product_match_the_same(short_run):
    rng = np.random.default_rng(1)

    def random_features(count):
        unit = rng.random((count, 128)).astype(np.float32) ** 8
        unit /= np.linalg.norm(unit, axis=1, keepdims=True)
        return Features(rng.uniform(0, 300, (count, 2)), rng.uniform(2, 6, count), np.ones(count), np.ones(count), unit)

    for _ in range(10):
        first, second = random_features(40), random_features(150)
        gate = (60.0, 40.0)
        allowed = near(first.pixels, first.size_px, second, gate)
        product = match(first.descriptors, second.descriptors, allowed, ratio=0.9)
        loop = match_by_loop(Described(first.descriptors, first.pixels, first.size_px), second, gate, ratio=0.9)
        for a, b in zip(product, loop, strict=True):
            np.testing.assert_array_equal(a, b)


def test_contested_partners_are_dropped_or_go_to_the_nearest():
    unit = np.eye(4, 128, dtype=np.float32)
    close = unit[0] + 0.1 * unit[1]
    first = np.stack([unit[0], close / np.linalg.norm(close), unit[2]])
    allowed = np.ones((3, 4), dtype=bool)
    rows, partners = match(first, unit, allowed)
    assert (rows.tolist(), partners.tolist()) == ([2], [2])
    rows, partners = match(first, unit, allowed, best_claim_wins=True)
    assert (rows.tolist(), partners.tolist()) == ([0, 2], [0, 2])
    assert len(match(first[:0], unit, allowed[:0])[0]) == 0


def test_bytes_keep_descriptors(short_run):
    features = SiftExtractor(HALL_CAMERA).extract(short_run.frames[0].images[0])
    again = from_bytes(to_bytes(features.descriptors))
    assert (again * features.descriptors).sum(axis=1).min() > 0.995


def test_the_index_finds_what_the_whole_map_does(short_run):
    landmarks = short_run.landmarks
    every = MapIndex(landmarks, keep=10**6, reach_m=40.0)
    for frame in short_run.frames:
        expected, found = (
            e(HALL_CAMERA, frame.pose.array) for e in (lambda c, p: expect(landmarks, c, p), every.expect)
        )
        np.testing.assert_array_equal(found.view, expected.view)
        np.testing.assert_allclose(found.pixels, expected.pixels, atol=1e-9)
        np.testing.assert_allclose(found.depth_m, expected.depth_m, atol=1e-9)
        few = MapIndex(landmarks, keep=1, cell_m=1.0).expect(HALL_CAMERA, frame.pose.array)
        assert 0 < len(few) < len(expected)
        assert set(few.landmark.tolist()) <= set(expected.landmark.tolist())
    with pytest.raises(ArgumentError, match="must be positive"):
        MapIndex(landmarks, cell_m=0.0)


def test_delegates_are_the_best_of_their_cells(short_run):
    landmarks, pose = short_run.landmarks, short_run.frames[2].pose.array
    expected = expect(landmarks, HALL_CAMERA, pose)
    success, contrast = landmarks.success[expected.landmark], landmarks.view_contrast[expected.view]
    how = Selection("cells")
    chosen = delegates(expected, success, contrast, how)
    spread = np.array([*expected.pixels.std(axis=0), expected.depth_m.std()]) * (0.2, 0.2, 0.5)
    cell = [tuple(row) for row in np.floor(np.column_stack([expected.pixels, expected.depth_m]) / spread)]
    assert len({cell[k] for k in chosen}) == len(chosen) == len(set(cell))
    for k in chosen:
        rivals = [i for i in range(len(expected)) if cell[i] == cell[k]]
        assert (success[k], contrast[k]) == max((success[i], contrast[i]) for i in rivals)


def test_selections_keep_to_their_number(short_run):
    landmarks, pose = short_run.landmarks, short_run.frames[2].pose.array
    expected = expect(landmarks, HALL_CAMERA, pose)
    known = np.diag([0.01, 0.01, 0.01])
    rng = np.random.default_rng(0)
    for choice in ("informative", "frequency", "response", "random"):
        chosen = select(Selection(choice, at_most=20), landmarks, expected, HALL_CAMERA, pose, known, rng=rng)
        assert len(set(chosen.tolist())) == 20
    assert len(select(Selection("all"), landmarks, expected, HALL_CAMERA, pose, known)) == len(expected)
    with pytest.raises(ArgumentError, match="needs an rng"):
        select(Selection("random"), landmarks, expected, HALL_CAMERA, pose, known)
    for wrong in ({"choice": "best"}, {"at_most": 0}, {"alpha": 0.0}):
        with pytest.raises(ArgumentError):
            Selection(**wrong)


def test_a_time_budget_learns():
    budget = TimeBudget(1e-3)
    for _ in range(60):
        budget.learn(0.4e-3, 60e-6, 60)
    # 0.6 ms are left, at a microsecond each
    assert budget.landmarks == pytest.approx(600, rel=0.02)
    for _ in range(60):
        budget.learn(5e-3, 60e-6, 60)
    assert budget.landmarks == 16
    with pytest.raises(ArgumentError, match="must be positive"):
        TimeBudget(0.0)


def test_vision_tracks_forgets_and_draws(short_run):
    mask = np.zeros((240, 320), dtype=np.uint8)
    mask[200:] = 1
    vision = LandmarkVision(short_run.landmarks, HALL_CAMERA, limit_s=1.0, mask=mask)
    frames = [frame.images[0] for frame in short_run.second]
    first = vision.look(frames[0], t_s=0.5)
    assert first.t_s == 0.5
    assert "relocate" in first.timings_s
    step = short_run.second[0].pose.inverse().compose(short_run.second[1].pose)
    assert "relocate" not in vision.look(frames[1], odometry=step).timings_s
    dark = np.zeros_like(frames[0])
    lost = vision.look(dark, odometry=Pose2(0.0, 0.0, 0.0))
    assert not lost.pose
    assert "relocate" not in vision.look(frames[1]).timings_s  # odometry had carried on
    vision.forget()
    assert "relocate" in vision.look(frames[2]).timings_s
    picture = draw_landmarks(first, frames[0])
    assert picture.shape == (480, 640, 3)
    assert (picture != draw_landmarks(lost, frames[0])).any()
    with pytest.raises(ArgumentError, match="mask must be"):
        LandmarkVision(short_run.landmarks, HALL_CAMERA, mask=mask[:10])


def test_cameras_that_cannot_be_placed_are_refused(short_run):
    loose = PinholeCamera((320, 240), (277.0, 277.0), (159.5, 119.5), 0.6)
    with pytest.raises(ArgumentError, match="known tilt_rad"):
        LandmarkPoseEstimator(short_run.landmarks, loose)
