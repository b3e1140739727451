"""Laws of the one object a robot embeds: the camera's symmetries, memory, masks, threads, frames that show nothing."""

import dataclasses
import math

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError, FrameError
from robocup_vision.camera import Table, Tangent
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.color_table import build_color_table
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.random_scenes import CONDITIONS, sample
from sim2d.rendering.scene import Box, Scene
from sim2d.rendering.sensor import Sensor


@pytest.fixture(scope="module")
def vision(ssl_field, paper_camera):
    return Vision(ssl_field, paper_camera)


@pytest.fixture(scope="module")
def plain_field(ssl_field):
    """Return the same field with goals that nothing tells apart."""
    goals = tuple(dataclasses.replace(goal, color="white") for goal in ssl_field.goals)
    return dataclasses.replace(ssl_field, goals=goals)


@pytest.fixture(scope="module")
def plain_vision(plain_field, paper_camera):
    return Vision(plain_field, paper_camera)


def look_alone(vision, frame, **options):
    vision.forget()
    return vision.look(frame, **options)


def assert_same_view(one, other):
    for name in ("boundary_radius_px", "marks", "wall_radius_px"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    np.testing.assert_array_equal(one.free_space.range_m, other.free_space.range_m)
    assert bool(one.pose) == bool(other.pose)
    if one.pose:
        assert one.pose.candidates == other.pose.candidates
        np.testing.assert_array_equal(one.pose.covariance, other.pose.covariance)
    else:
        assert one.pose == other.pose
    assert (one.ball is None) == (other.ball is None)
    if one.ball is not None:
        assert (one.ball.x_m, one.ball.y_m) == (other.ball.x_m, other.ball.y_m)


def assert_near(pose, truth, metres=0.02, degrees=1.0, *, symmetric=False):
    distance, angle = pose.error_to(truth, symmetric=symmetric)
    assert distance < metres
    assert math.degrees(angle) < degrees


def test_poses_are_found_and_honest(vision, nominal_samples):
    nees = []
    for one in nominal_samples:
        estimate = look_alone(vision, one.frame).pose
        assert isinstance(estimate, PoseEstimate)
        assert_near(estimate.pose, one.pose, symmetric=True)
        covariance = estimate.covariance
        np.testing.assert_allclose(covariance, covariance.T, rtol=1e-9)
        assert (np.linalg.eigvalsh(covariance) > 0).all()
        assert 0 < estimate.std[:2].max() < 0.05
        assert 0.3 < estimate.inlier_ratio <= 1
        best = min((estimate.pose, estimate.pose.half_turn()), key=lambda p: sum(p.error_to(one.pose)))
        off = Pose2(best.x_m - one.pose.x_m, best.y_m - one.pose.y_m, best.theta_rad - one.pose.theta_rad).array
        nees.append(off @ np.linalg.inv(covariance) @ off)
    assert np.median(nees) < 8


def test_goal_colours_choose_the_right_half(vision, nominal_samples):
    decided = 0
    for one in nominal_samples:
        estimate = look_alone(vision, one.frame).pose
        if len(estimate.candidates) == 1:
            decided += 1
            assert_near(estimate.pose, one.pose)
        else:
            assert estimate.candidates[1] == estimate.pose.half_turn()
    assert decided >= 8


def test_goals_alike_leave_two_candidates_half_a_turn_apart_and_a_prior_orders_them(plain_vision, nominal_samples):
    for one in nominal_samples[:4]:
        estimate = look_alone(plain_vision, one.frame).pose
        assert estimate.candidates == (estimate.pose, estimate.pose.half_turn())
        assert_near(estimate.pose, one.pose, symmetric=True)
        for truth in (one.pose, one.pose.half_turn()):
            told = look_alone(plain_vision, one.frame, prior=truth).pose
            assert_near(told.pose, truth)
            assert len(told.candidates) == 2


def test_a_quarter_turn_of_the_image_turns_the_heading_only(ssl_field):
    camera = sekimori_camera(256, 256)
    vision = Vision(ssl_field, camera)
    for one in sample(ssl_field, camera, CONDITIONS["nominal"], seed=8, count=3, supersample=2):
        poses = [look_alone(vision, np.rot90(one.frame, turns)).pose for turns in range(4)]
        for turns, estimate in enumerate(poses):
            expected = Pose2(poses[0].pose.x_m, poses[0].pose.y_m, poses[0].pose.theta_rad - turns * math.pi / 2)
            assert_near(estimate.pose, expected, 0.002, 0.1)


def test_a_mirrored_camera_sees_the_mirrored_picture_alike(vision, ssl_field, paper_camera, nominal_samples):
    mirrored = Vision(ssl_field, dataclasses.replace(paper_camera, mirrored=True, heading_rad=math.pi))
    for one in nominal_samples[:4]:
        straight, flipped = look_alone(vision, one.frame), look_alone(mirrored, one.frame[:, ::-1])
        assert_near(flipped.pose.pose, straight.pose.pose, 0.003, 0.2)
        assert len(flipped.pose.candidates) == len(straight.pose.candidates)


@pytest.mark.parametrize(
    "changes",
    [
        {"offset_m": (0.04, -0.03)},
        {"tilt_rad": (0.03, -0.02)},
        {"heading_rad": 2.2, "center_px": (124.0, 112.5)},
        {"floor_range": Tangent(0.25, 0.0138), "viewpoint_height_m": 0.22},
    ],
    ids=["offset", "tilt", "heading and centre", "tangent"],
)
def test_other_cameras_locate_what_they_see(ssl_field, changes):
    camera = dataclasses.replace(sekimori_camera(), **changes)
    vision = Vision(ssl_field, camera)
    for one in sample(ssl_field, camera, CONDITIONS["nominal"], seed=4, count=4, supersample=2):
        estimate = look_alone(vision, one.frame).pose
        assert_near(estimate.pose, one.pose, symmetric=len(estimate.candidates) > 1)


def test_a_table_of_the_same_curve_gives_the_same_pose(vision, ssl_field, paper_camera, nominal_samples):
    radius = np.linspace(26.0, 112.0, 200)
    table = Table(radius, 1 / paper_camera.floor_range.inverse_range_per_m(radius))
    camera = dataclasses.replace(paper_camera, floor_range=table, viewpoint_height_m=paper_camera.height_m)
    with_table = Vision(ssl_field, camera)
    # without a height the goals' colours cannot be looked at, the outline can
    without_height = Vision(ssl_field, dataclasses.replace(camera, viewpoint_height_m=None))
    for one in nominal_samples[:4]:
        expected = look_alone(vision, one.frame).pose
        assert_near(look_alone(with_table, one.frame).pose.pose, expected.pose, 0.002, 0.1)
        flat = look_alone(without_height, one.frame).pose
        assert_near(flat.pose, expected.pose, 0.002, 0.1, symmetric=True)
        assert len(flat.candidates) == 2


def struts(shape):
    mask = np.zeros(shape, dtype=np.uint8)
    height, width = shape
    for angle in (0.4, 2.5, 4.6):
        end = (round(width / 2 + width * math.cos(angle)), round(height / 2 + width * math.sin(angle)))
        cv2.line(mask, (width // 2, height // 2), end, 255, 3)
    return mask


def test_what_lies_under_the_mask_changes_nothing(ssl_field, paper_camera, nominal_samples):
    mask = struts((220, 256))
    vision = Vision(ssl_field, paper_camera, mask=mask)
    rng = np.random.default_rng(5)
    for one in nominal_samples:
        before = look_alone(vision, one.frame)
        painted = one.frame.copy()
        painted[mask > 0] = rng.choice([[30, 110, 235], [50, 130, 45], [230, 230, 230]], int((mask > 0).sum()))
        assert_same_view(look_alone(vision, painted), before)
        assert_near(before.pose.pose, one.pose, symmetric=True)


def test_the_mask_is_the_visions_own_copy(ssl_field, paper_camera, nominal_samples):
    mask = struts((220, 256))
    vision = Vision(ssl_field, paper_camera, mask=mask)
    before = look_alone(vision, nominal_samples[0].frame)
    mask[:] = 255
    assert_same_view(look_alone(vision, nominal_samples[0].frame), before)


def test_forgetting_makes_a_frame_stand_alone(vision, ssl_field, paper_camera, nominal_samples):
    expected = Vision(ssl_field, paper_camera).look(nominal_samples[3].frame)
    dark = (nominal_samples[5].frame * 0.4).astype(np.uint8)
    for earlier in (nominal_samples[4].frame, dark, np.zeros_like(dark)):
        vision.look(earlier)
        vision.forget()
        assert vision.colors is None
        assert_same_view(vision.look(nominal_samples[3].frame, odometry=Pose2(0.1, 0.0, 0.0)), expected)


def test_given_colours_are_never_changed(vision, ssl_field, paper_camera, nominal_samples):
    look_alone(vision, nominal_samples[0].frame)
    fixed = Vision(ssl_field, paper_camera, vision.colors)
    assert_same_view(fixed.look(nominal_samples[0].frame), look_alone(vision, nominal_samples[0].frame))
    fixed.look(nominal_samples[1].frame // 3)
    fixed.forget()
    assert fixed.colors is build_color_table(fixed.colors).colors
    assert fixed.colors.floor.level > 0


def test_a_prior_saves_time_not_accuracy(vision, nominal_samples):
    for one in nominal_samples:
        cold = look_alone(vision, one.frame).pose
        near = Pose2(one.pose.x_m + 0.02, one.pose.y_m - 0.02, one.pose.theta_rad + 0.03)
        for prior in (near, cold, one.pose):
            warm = look_alone(vision, one.frame, prior=prior).pose
            assert_near(warm.pose, cold.pose, 0.015, 0.6, symmetric=True)


@pytest.mark.parametrize("prior", [Pose2(-1.2, 0.7, 2.0), Pose2(50.0, -80.0, 0.0)])
def test_a_wrong_prior_is_overruled(vision, nominal_samples, prior):
    for one in nominal_samples[:4]:
        estimate = look_alone(vision, one.frame, prior=prior).pose
        assert_near(estimate.pose, one.pose, symmetric=len(estimate.candidates) > 1)


def test_odometry_makes_a_prior_of_the_last_pose(plain_vision, nominal_samples):
    first, second = nominal_samples[0], nominal_samples[1]
    turned = first.pose.half_turn()
    step = turned.inverse().compose(second.pose.half_turn())
    look_alone(plain_vision, first.frame, prior=turned)
    view = plain_vision.look(second.frame, odometry=step)
    assert_near(view.pose.pose, second.pose.half_turn())
    # a frame without a pose breaks the chain: nothing is made up
    plain_vision.look(np.zeros_like(first.frame))
    alone = look_alone(plain_vision, second.frame)
    plain_vision.forget()
    plain_vision.look(np.zeros_like(first.frame))
    assert_same_view(plain_vision.look(second.frame, odometry=step), alone)


def arrays_of(view):
    found = [view.boundary_radius_px, view.marks, view.wall_radius_px, view.free_space.range_m]
    found += [view.free_space.bearing_rad, view.boundary_px, view.line_points_px]
    return found + ([view.pose.covariance] if view.pose else []) + ([view.ball.covariance] if view.ball else [])


def test_views_stay_as_they_were(vision, nominal_samples):
    frames = [one.frame for one in nominal_samples] + [np.zeros_like(nominal_samples[0].frame)] * 2
    views = [look_alone(vision, frame) for frame in frames]
    kept = [[array.copy() for array in arrays_of(view)] for view in views]
    for frame in reversed(frames):
        vision.look(frame)
    for view, copies in zip(views, kept, strict=True):
        for array, copy in zip(arrays_of(view), copies, strict=True):
            np.testing.assert_array_equal(array, copy)
            assert not array.flags.writeable
        with pytest.raises(dataclasses.FrozenInstanceError):
            view.ball = None


def test_the_frame_is_left_alone_and_not_held(vision, nominal_samples):
    frame = nominal_samples[2].frame.copy()
    view = look_alone(vision, frame)
    np.testing.assert_array_equal(frame, nominal_samples[2].frame)
    kept = [array.copy() for array in arrays_of(view)]
    frame[:] = 0
    for array, copy in zip(arrays_of(view), kept, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_any_memory_layout_of_a_frame_is_read(vision, nominal_samples):
    frame = nominal_samples[0].frame
    assert not frame.flags.writeable
    expected = look_alone(vision, frame)
    wide = np.zeros((220, 600, 4), dtype=np.uint8)
    wide[:, 40:296, :3] = frame
    flipped = np.ascontiguousarray(frame[:, ::-1])
    message = np.frombuffer(frame.tobytes(), dtype=np.uint8).reshape(frame.shape)
    for same in (wide[:, 40:296, :3], flipped[:, ::-1], np.asfortranarray(frame), message, frame.copy()):
        assert_same_view(look_alone(vision, same), expected)


def test_timings_add_up(vision, nominal_samples):
    view = look_alone(vision, nominal_samples[0].frame)
    stages = [seconds for name, seconds in view.timings_s.items() if name != "total"]
    assert min(stages) > 0
    assert sum(stages) == pytest.approx(view.timings_s["total"])


def uniform(color):
    return np.full((220, 256, 3), color, dtype=np.uint8)


EMPTY = {
    "black": uniform(0),
    "white": uniform(255),
    "grey": uniform(128),
    "green": uniform((50, 130, 45)),
    "pure green": uniform((0, 255, 0)),
    "noise": np.random.default_rng(0).integers(0, 256, (220, 256, 3), dtype=np.uint8),
    "two": np.random.default_rng(1).choice(np.array([0, 255], dtype=np.uint8), (220, 256, 3)),
    "stripes": np.tile(np.repeat(np.array([40, 200], dtype=np.uint8), 8), 16)[None, :, None]
    .repeat(220, 0)
    .repeat(3, 2),
}


@pytest.mark.parametrize(
    ("method", "name"),
    [*(("field", name) for name in EMPTY), *((one, name) for one in ("floor", "hull") for name in ("green", "noise"))],
)
def test_frames_without_a_field_are_not_located(ssl_field, paper_camera, nominal_samples, method, name):
    vision = Vision(ssl_field, paper_camera, method=method)
    for _ in range(2):
        view = vision.look(EMPTY[name])
        assert isinstance(view.pose, NotLocated)
        assert len(view.pose.reason) > 10
        assert view.free_space.range_m.shape == view.free_space.bearing_rad.shape
        assert np.isfinite(view.free_space.range_m).all()
        assert isinstance(view.obstacles, tuple)
        assert view.line_points_px.shape[1] == 2
    # and the next good one is not spoilt
    good, fresh = look_alone(vision, nominal_samples[0].frame), Vision(ssl_field, paper_camera, method=method)
    np.testing.assert_allclose(good.pose.pose.array, fresh.look(nominal_samples[0].frame).pose.pose.array, atol=1e-9)


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (np.zeros((220, 256), dtype=np.uint8), r"\(220, 256, 3\) as the camera file says, got uint8 \(220, 256\)"),
        (np.zeros((220, 256, 4), dtype=np.uint8), r"got uint8 \(220, 256, 4\)"),
        (np.zeros((480, 640, 3), dtype=np.uint8), r"must be uint8 \(220, 256, 3\) as .*, got uint8 \(480, 640, 3\)"),
        (np.zeros((256, 220, 3), dtype=np.uint8), r"got uint8 \(256, 220, 3\)"),
        (np.zeros((0, 0, 3), dtype=np.uint8), r"got uint8 \(0, 0, 3\)"),
        (np.zeros((220, 256, 3), dtype=np.uint16), "must be uint8 .*, got uint16"),
        (np.zeros((220, 256, 3)), "must be uint8 .*, got float64"),
        ([[1, 2], [3, 4]], "must be uint8 .*, got list"),
    ],
)
def test_frames_of_another_kind_are_refused(vision, frame, message):
    with pytest.raises(FrameError, match=message):
        vision.look(frame)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mask": np.zeros((256, 220), dtype=np.uint8)}, r"mask must be \(220, 256\) uint8, got \(256, 220\) uint8"),
        ({"mask": np.zeros((220, 256), dtype=bool)}, r"mask must be \(220, 256\) uint8, got \(220, 256\) bool"),
        ({"mask": np.zeros((220, 256, 3), dtype=np.uint8)}, r"got \(220, 256, 3\) uint8"),
        ({"method": "goal"}, "method must be 'field', 'floor' or 'hull' for a mirror camera, got 'goal'"),
        ({"directions": 0}, "directions must be at least 3, got 0"),
        ({"directions": -8}, "directions must be at least 3, got -8"),
        ({"rings": 0}, "rings must be at least 1, got 0"),
        ({"rings": (0.5, 0.2)}, r"rings must be .* increasing .*, got \[0.5, 0.2\]"),
        ({"free_ratio": 0.0}, "free_ratio must be above 0 and at most 1, got 0.0"),
        ({"free_ratio": 1.1}, "free_ratio must be above 0 and at most 1, got 1.1"),
        ({"free_ratio": "all"}, "free_ratio must be a number"),
    ],
)
def test_wrong_arguments_are_reported(ssl_field, paper_camera, options, message):
    with pytest.raises(ArgumentError, match=message):
        Vision(ssl_field, paper_camera, **options)


def test_the_ratio_of_a_free_cell_makes_ranges_longer_or_shorter(ssl_field, paper_camera):
    scene = Scene(ssl_field, boxes=(Box(0.45, 0.1), Box(-0.2, 0.5, 0.3)))
    frame = render(paper_camera, scene, Pose2(0.0, 0.0, 0.4))
    strict, loose = (
        Vision(ssl_field, paper_camera, directions=32, rings=6, free_ratio=ratio).look(frame).free_space.range_m
        for ratio in (1.0, 0.4)
    )
    assert np.all(strict <= loose)
    assert np.any(strict < loose)


def test_method_floor_needs_walls(paper_camera):
    with pytest.raises(ArgumentError, match=r"method 'floor' needs walls or boards, .*'msl_6x4' is not bounded"):
        Vision(load_field("msl_6x4"), paper_camera, method="floor")


def render(camera, scene, pose, noise=4.0):
    light = MirrorRenderer(camera, 2).render(scene, pose)
    return Sensor(noise_sigma=noise, blur_px=0.7).expose(light, np.random.default_rng(0))


@pytest.mark.parametrize("pose", [Pose2(2.2, 0.3, 0.5), Pose2(0.0, 1.6, -1.0), Pose2(-6.0, 4.0, 2.0)])
def test_a_robot_outside_the_field_is_not_put_on_it(vision, ssl_field, paper_camera, pose):
    view = look_alone(vision, render(paper_camera, Scene(ssl_field), pose))
    assert not view.pose
    assert view.pose.reason


def test_a_robot_walled_in_knows_no_pose_and_no_way_out(vision, ssl_field, paper_camera):
    pose = Pose2(0.2, 0.1, 0.4)
    bearings = np.arange(16) * math.tau / 16
    boxes = tuple(
        Box(pose.x_m + 0.3 * math.cos(b), pose.y_m + 0.3 * math.sin(b), b, 0.13, 0.13, 0.4, (40, 40, 200))
        for b in bearings
    )
    view = look_alone(vision, render(paper_camera, Scene(ssl_field, boxes=boxes), pose))
    assert not view.pose
    assert view.pose.reason
    assert view.free_space.range_m.max() < 0.27


@pytest.mark.slow
def test_the_carpet_goes_on_and_the_lines_tell(mirror_camera, paint_field):
    """Only this finds a mirror on an open field that needs walls, or sees through its mask."""
    field = load_field("msl_6x4")
    mask = struts((240, 320))
    rng = np.random.default_rng(2)
    vision = Vision(field, mirror_camera, mask=mask)
    for truth in (Pose2(0.5, 0.3, 1.0), Pose2(-1.4, 0.6, -2.0)):
        frame = paint_field(mirror_camera, field, truth, noise=3.0, rng=rng)
        view = look_alone(vision, frame)
        assert_near(view.pose.pose, truth, 0.03, 1.0, symmetric=True)
        assert view.pose.candidates == (view.pose.pose, view.pose.pose.half_turn())
        assert np.isnan(view.wall_radius_px).all()
        painted = frame.copy()
        painted[mask > 0] = rng.integers(0, 256, (int((mask > 0).sum()), 3))
        assert_same_view(look_alone(vision, painted), view)
        told = look_alone(vision, frame, prior=truth.half_turn()).pose
        assert_near(told.pose, truth.half_turn(), 0.03, 1.0)


def test_a_view_carries_its_time(vision, nominal_samples):
    vision.forget()
    assert vision.look(nominal_samples[0].frame, t_s=1.25).t_s == 1.25
    assert vision.look(np.zeros_like(nominal_samples[0].frame), t_s=2.5).t_s == 2.5
    assert vision.look(nominal_samples[0].frame).t_s is None
