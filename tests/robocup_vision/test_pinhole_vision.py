"""Vision by a pinhole camera: its floor, what stands on it, the ball, and its pose by a goal or by lines."""

import dataclasses
import math

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError, FrameError
from robocup_vision import MotionLimits, Steering
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.overlay import FIELD_COLOR, FREE_COLOR, draw
from robocup_vision.vision import Vision
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, paper_places, sample_goal

GREEN, WHITE, BLACK, ORANGE = (60, 130, 50), (235, 235, 235), (25, 25, 25), (30, 120, 240)


@pytest.fixture(scope="module")
def camera():
    return PinholeCamera((320, 240), (300.0, 300.0), (159.5, 119.5), 0.2, offset_m=(0.09, 0.0), tilt_rad=-0.3)


@pytest.fixture(scope="module")
def field():
    return load_field("ssl_division_b")


@pytest.fixture(scope="module")
def vision(field, camera):
    return Vision(field, camera, method="field")


def painted(camera, field=None, pose=None, wall_at_m=2.5, box=None, ball=None):
    """Paint a floor that ends at a black wall straight ahead, with a field's lines, a box's foot and a ball."""
    width, height = camera.size_px
    fine = np.stack(np.meshgrid(np.arange(width * 2) / 2 - 0.25, np.arange(height * 2) / 2 - 0.25), axis=-1)
    floor = camera.pixel_to_floor(fine)
    x = floor[..., 0]
    colors = np.full((*x.shape, 3), BLACK, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        colors[x < wall_at_m] = GREEN
        if field is not None:
            world = pose.transform(np.nan_to_num(floor, nan=99.0).reshape(-1, 2))
            for x0, y0, x1, y1 in field.lines:
                start, along = np.array([x0, y0]), np.array([x1 - x0, y1 - y0])
                t = np.clip((world - start) @ along / (along @ along), 0, 1)
                near = np.hypot(*(world - start - t[:, None] * along).T) <= field.line_width_m / 2
                colors[near.reshape(x.shape) & (x < wall_at_m)] = WHITE
        if box is not None:
            # from its foot upwards, as far as the picture goes
            foot_v = camera.floor_to_pixel(np.array([box, (box[0], box[1] + 0.1)]))
            left, right = sorted(foot_v[:, 0])
            colors[(fine[..., 0] > left) & (fine[..., 0] < right) & (fine[..., 1] < foot_v[0, 1])] = BLACK
    if ball is not None:
        ray = camera.pixel_to_ray(fine)
        to_ball = np.array([*ball, 0.0215]) - camera.viewpoint_m
        off = np.linalg.norm(np.cross(ray, to_ball), axis=-1)
        colors[off < 0.0215] = ORANGE
    frame = colors.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    noise = np.random.default_rng(0).normal(0, 2, frame.shape)
    return np.clip(frame + noise, 0, 255).astype(np.uint8)


def farther_by_px(camera, range_m, pixels):
    """Return ranges about so many pixels beyond these."""
    return 1 / (1 / range_m - pixels / (camera.height_m * camera.focal_px[1]))


def test_free_floor_ends_at_the_wall(vision, camera):
    view = vision.look(painted(camera))
    bearing, range_m = view.free_space.bearing_rad, view.free_space.range_m
    assert np.all(np.diff(bearing) > 0)
    assert np.ptp(bearing) == pytest.approx(2 * math.atan(160 / 300), abs=0.15)
    truth = 2.5 / np.cos(bearing)
    assert np.all(range_m <= farther_by_px(camera, truth, 1.5))
    assert np.median(range_m / truth) > 0.8
    edge = view.boundary_px[np.isfinite(view.boundary_px).all(axis=1)]
    assert len(edge) > 120
    np.testing.assert_allclose(camera.pixel_to_floor(edge)[:, 0], 2.5, rtol=0.15)


@pytest.mark.parametrize("wall_at_m", [1.2, 2.0, 3.0])
@pytest.mark.parametrize("blur_px", [0.0, 2.0])
def test_free_floor_ends_at_the_foot_of_a_black_board_however_blurred(vision, camera, wall_at_m, blur_px):
    frame = painted(camera, wall_at_m=wall_at_m)
    vision.forget()
    view = vision.look(cv2.GaussianBlur(frame, (0, 0), blur_px) if blur_px else frame)
    truth = wall_at_m / np.cos(view.free_space.bearing_rad)
    ratio = view.free_space.range_m / truth
    assert np.median(ratio) == pytest.approx(0.99, abs=0.02)
    assert np.mean(np.abs(ratio - 1) < 0.08) > 0.95


def test_a_box_blocks_its_bearings_and_is_an_obstacle(vision, camera):
    view = vision.look(painted(camera, box=(0.8, 0.0)))
    bearing, range_m = view.free_space.bearing_rad, view.free_space.range_m
    behind = (bearing > math.atan2(0.01, 0.8)) & (bearing < math.atan2(0.09, 0.8))
    assert np.all(range_m[behind] <= 0.83)
    assert np.all(range_m[behind] > 0.6)
    assert np.median(range_m[~behind]) > 1.8
    (thing,) = [o for o in view.obstacles if o.range_m < 1.2]
    assert thing.x_m == pytest.approx(0.8, abs=0.06)
    assert thing.y_m == pytest.approx(0.05, abs=0.03)
    assert thing.width_m == pytest.approx(0.1, abs=0.05)


def test_what_fills_the_nearest_floor_in_view_may_be_anywhere_nearer(vision, camera):
    frame = painted(camera)
    vision.look(frame)
    frame[:, :80] = BLACK
    view = vision.look(frame)
    left = view.free_space.bearing_rad > math.atan(105 / 300)
    assert np.all(view.free_space.range_m[left] == 0.0)
    assert np.any(view.free_space.range_m > 1.5)


@pytest.mark.parametrize("ball", [(0.7, 0.1), (1.2, -0.2)])
def test_the_ball_is_found_and_blocks_nothing(vision, camera, ball):
    vision.forget()
    view = vision.look(painted(camera, ball=ball))
    assert view.ball is not None
    distance = math.hypot(view.ball.x_m - ball[0], view.ball.y_m - ball[1])
    assert distance < 0.03 * math.hypot(*ball)
    beside = np.argmin(np.abs(view.free_space.bearing_rad - math.atan2(ball[1], ball[0])))
    assert view.free_space.range_m[beside] > 1.5


@pytest.mark.parametrize("hidden", [0.25, 0.4, 0.5])
@pytest.mark.parametrize("aside_px", [0.0, 60.0])
def test_a_near_ball_that_the_picture_cuts_is_found_where_it_is(vision, camera, hidden, aside_px):
    half_px = 0.0215 * 300 / 0.36
    ray = camera.pixel_to_ray((159.5 + aside_px, 239.5 + (2 * hidden - 1) * half_px))
    ball = (camera.viewpoint_m - ray * (camera.height_m - 0.0215) / ray[2])[:2]
    vision.forget()
    view = vision.look(painted(camera, ball=tuple(ball)))
    assert view.ball is not None
    assert math.hypot(view.ball.x_m - ball[0], view.ball.y_m - ball[1]) < 0.01


def test_a_lone_orange_strip_at_the_picture_s_edge_is_no_ball(vision, camera):
    frame = painted(camera)
    frame[-8:, 60:200] = ORANGE
    vision.forget()
    assert vision.look(frame).ball is None


def test_steering_takes_bearings_in_view(vision, camera):
    view = vision.look(painted(camera))
    command = Steering(0.09, MotionLimits(1.0, 3.0, 0.1)).steer(view.free_space, (0.0, 0.0), 0.0)
    assert command.bearing_rad is not None


def test_lines_refine_a_prior_and_contradict_a_wrong_one(field, camera, vision):
    truth = Pose2(3.0, -1.2, 0.25)
    frame = painted(camera, field, truth, wall_at_m=1.9)
    covariance = np.diag([0.1, 0.1, math.radians(5)]) ** 2
    near = Pose2(2.93, -1.15, 0.25 + math.radians(4))
    vision.forget()
    view = vision.look(frame, prior=PoseEstimate(near, covariance, 1.0, 0.0))
    assert view.pose
    distance, turn = view.pose.pose.error_to(truth)
    assert distance < 0.03
    assert turn < math.radians(1)
    assert len(view.line_points_px) > 20
    away = vision.look(frame, prior=PoseEstimate(Pose2(0.0, 1.0, 2.0), covariance, 1.0, 0.0))
    # a search may find what the prior is not
    assert not away.pose or min(pose.error_to(truth)[0] for pose in away.pose.candidates) < 0.03
    assert vision.look(painted(camera), prior=near).pose.reason.startswith("only")


@pytest.mark.slow
def test_a_goal_places_a_camera_of_unknown_tilt_and_reports_where_the_floor_is():
    """Only this finds floor that is not told although the goal told the tilt, or told although it did not."""
    field, condition = load_field("four_legged_2007"), GOAL_CONDITIONS["clean_416x320"]
    vision = Vision(field, condition.camera)
    assert vision.method == "goal"
    one = next(iter(sample_goal(field, condition, 0, 30, places=paper_places(field)[20:])))
    view = vision.look(one.frame)
    assert view.pose
    assert view.pose.pose.error_to(one.pose)[0] < 0.2
    assert view.polar is vision.polar
    assert np.median(view.free_space.range_m) > 0.3
    shown = view.boundary_px[np.isfinite(view.boundary_px).all(axis=1)]
    assert len(shown) > 80
    picture = draw(view, one.frame, vision)
    assert np.mean(np.abs(picture.astype(int) - FIELD_COLOR).max(axis=-1) <= 12) > 1e-4
    assert view.camera.tilt_rad is not None
    # the next frame goes on from there only where the neck's pan is known
    again = vision.look(one.frame, odometry=Pose2(0.0, 0.0, 0.0))
    assert again.pose
    # a frame that tells no pose tells no floor
    blank = vision.look(np.full_like(one.frame, 90))
    assert not blank.pose
    assert blank.polar is None
    assert blank.free_space.bearing_rad.shape == blank.free_space.range_m.shape == (0,)
    assert blank.ball is None
    assert blank.obstacles == ()
    assert blank.boundary_px.shape == blank.line_points_px.shape == (0, 2)
    with pytest.raises(ArgumentError, match="tilt_rad"):
        _ = vision.polar
    with pytest.raises(ArgumentError, match="tilt_rad"):
        _ = vision.grid


@pytest.mark.slow
def test_a_goal_places_a_robot_whose_head_is_panned():
    """Only this finds a pan that the pose by a goal leaves out."""
    field, condition = load_field("four_legged_2007"), GOAL_CONDITIONS["clean_416x320"]
    one = next(iter(sample_goal(field, condition, 0, 30, places=paper_places(field)[20:])))
    head = dataclasses.replace(condition.camera, offset_m=(0.05, -0.02), pan_rad=0.0)
    mounted = dataclasses.replace(head, pan_rad=0.6)
    robot = one.pose.compose(mounted.camera_in_robot.inverse())
    at_once = Vision(field, mounted, method="goal").look(one.frame)
    panned = Vision(field, head, method="goal").look(one.frame, pan_rad=0.6)
    for view in (at_once, panned):
        assert view.pose
        assert view.pose.pose.error_to(robot)[0] < 0.05
        assert view.camera_pose.pose.error_to(one.pose)[0] < 0.05
    assert panned.pose.pose.error_to(at_once.pose.pose) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_a_head_that_pans_sees_what_a_camera_mounted_at_that_pan_sees(field):
    offset_m = (0.05, -0.02)
    camera = PinholeCamera(
        (320, 240), (300.0, 300.0), (159.5, 119.5), 0.2, offset_m=offset_m, pan_rad=0.0, tilt_rad=-0.3
    )
    # the wall is painted where the field has one: elsewhere, whether it tells another tilt hangs by a hair
    before_wall = Pose2(field.walls[:, 0].max() - 2.4, -1.2, 0.0) if field.is_bounded else Pose2(3.0, -1.2, 0.25)
    pan_rad, robot = 0.6, before_wall
    turned = dataclasses.replace(camera, pan_rad=pan_rad)
    ball = tuple(Pose2(*offset_m, pan_rad).transform((0.7, -0.1)))
    frame = painted(turned, field, robot, wall_at_m=2.4, ball=ball)
    mounted, head = Vision(field, turned, method="field"), Vision(field, camera, method="field")
    head.look(frame)
    head.forget()
    one, other = mounted.look(frame, prior=robot), head.look(frame, prior=robot, pan_rad=pan_rad)
    assert one.pose
    assert other.pose
    assert one.pose.pose.error_to(robot)[0] < 0.1
    alike = pytest.approx((0.0, 0.0), abs=1e-6)
    assert other.pose.pose.error_to(one.pose.pose) == alike
    assert other.camera_pose.pose.error_to(one.camera_pose.pose) == alike
    assert one.camera_pose.pose.error_to(one.pose.pose.compose(Pose2(*offset_m, pan_rad)))[0] < 1e-9
    np.testing.assert_allclose(other.free_space.bearing_rad, one.free_space.bearing_rad, atol=0.02)
    np.testing.assert_allclose(np.median(other.free_space.range_m), np.median(one.free_space.range_m), rtol=0.1)
    assert one.ball is not None
    assert other.ball is not None
    assert math.dist((one.ball.x_m, one.ball.y_m), ball) < 0.03
    # it lies as far off as the tilts differ that both frames told
    nod = np.abs([other.camera.tilt_rad - one.camera.tilt_rad, other.camera.roll_rad - one.camera.roll_rad]).sum()
    reach_m = 0.2 + (ball[0] ** 2 + ball[1] ** 2) / 0.15
    assert math.dist((other.ball.x_m, other.ball.y_m), (one.ball.x_m, one.ball.y_m)) < 1e-6 + nod * reach_m
    assert other.camera.pan_rad == pan_rad


def test_only_a_head_pans(ssl_field, paper_camera):
    frame = np.zeros((220, 256, 3), dtype=np.uint8)
    with pytest.raises(ArgumentError, match="a mirror camera has no pan"):
        Vision(ssl_field, paper_camera).look(frame, pan_rad=0.1)


def test_a_view_over_the_floor_is_drawn(vision, camera, field):
    frame = painted(camera, field, Pose2(3.0, -1.2, 0.25), wall_at_m=1.9, box=(0.8, 0.0), ball=(0.7, -0.1))
    vision.forget()
    view = vision.look(frame, prior=Pose2(3.0, -1.2, 0.25))
    assert view.pose
    picture = draw(view, frame, vision)
    for color in (FREE_COLOR, FIELD_COLOR):
        assert np.mean(np.abs(picture.astype(int) - color).max(axis=-1) <= 12) > 1e-4


def test_masked_pixels_tell_nothing(field, camera):
    mask = np.zeros((240, 320), dtype=np.uint8)
    mask[:, :100] = 1
    vision = Vision(field, camera, method="field", mask=mask)
    frame = painted(camera)
    vision.forget()
    one = vision.look(frame)
    vision.forget()
    changed = frame.copy()
    changed[mask > 0] = 255
    other = vision.look(changed)
    np.testing.assert_array_equal(one.marks, other.marks)
    np.testing.assert_array_equal(one.free_space.range_m, other.free_space.range_m)


def test_a_dark_frame_frees_nothing(vision):
    vision.forget()
    view = vision.look(np.zeros((240, 320, 3), dtype=np.uint8))
    assert not view.pose
    assert np.all(view.free_space.range_m == 0.0)
    assert view.ball is None


def test_a_rolled_and_panned_camera_sees_the_same_floor(field, camera):
    turned = dataclasses.replace(camera, pan_rad=0.5, roll_rad=0.1, distortion=(-0.05, 0.01, 0.001, 0.0))
    view = Vision(field, turned, method="field").look(painted(turned, box=(0.75, 0.4)))
    bearing = view.free_space.bearing_rad
    assert 0.3 < bearing.mean() < 0.7
    behind = (bearing > math.atan2(0.41, 0.75)) & (bearing < math.atan2(0.47, 0.75))
    assert np.all(view.free_space.range_m[behind] < 0.95)
    assert np.all(view.free_space.range_m <= farther_by_px(camera, 2.5 / np.cos(bearing), 2.5))


def test_a_camera_that_looks_up_reports_no_floor(field, camera):
    vision = Vision(load_field("four_legged_2007"), dataclasses.replace(camera, tilt_rad=0.6))
    view = vision.look(painted(camera))
    assert len(view.free_space.range_m) == 0


def test_what_does_not_fit_is_refused(field, camera):
    with pytest.raises(ArgumentError, match="'field', 'floor' or 'angles' for a pinhole camera, got 'hull'"):
        Vision(field, camera, method="hull")
    with pytest.raises(ArgumentError, match="tilt_rad"):
        Vision(field, camera.with_orientation(None, None, None), method="field")
    with pytest.raises(ArgumentError, match="no goals of posts"):
        Vision(field, camera, method="goal")
    with pytest.raises(ArgumentError, match="mask must be"):
        Vision(field, camera, method="field", mask=np.zeros((3, 3), np.uint8))
    with pytest.raises(FrameError, match="as the camera file says"):
        Vision(field, camera, method="field").look(np.zeros((10, 10, 3), np.uint8))


def test_a_corner_alone_gives_no_pose_without_a_prior(field, camera, vision):
    truth = Pose2(3.0, 1.9, 0.75)
    frame = painted(camera, field, truth, wall_at_m=2.4)
    vision.forget()
    assert not vision.look(frame).pose
    near = PoseEstimate(Pose2(2.95, 1.94, 0.79), np.diag([0.1, 0.1, 0.08]) ** 2, 1.0, 0.0)
    assert vision.look(frame, prior=near).pose.pose.error_to(truth)[0] < 0.05
