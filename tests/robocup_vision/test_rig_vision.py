"""Vision by several cameras on one body: one pose, the floor all around, frames that are missing or late."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from rig_pictures import CAMERAS, FIELD, POSE, render

from field_models.errors import ArgumentError, FrameError
from robocup_vision import Memory, MotionLimits, Rig, Steering, Vision, draw
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE
from robocup_vision.recording.run import Run


@pytest.fixture(scope="module")
def frames():
    return render(POSE, 1, things=True)


@pytest.fixture(scope="module")
def vision():
    return Vision(FIELD, CAMERAS)


@pytest.fixture
def prior():
    return PoseEstimate(POSE.compose(Pose2(0.03, -0.02, 0.01)), np.diag([0.05, 0.05, 0.03]) ** 2, 1.0, 0.0)


@pytest.fixture
def fresh(vision):
    vision.forget()
    return vision


def off_by(pose, truth):
    """Return by how many standard deviations an estimate is off, all three together."""
    here = pose.half_turn() if pose.pose.error_to(truth)[0] > pose.pose.half_turn().error_to(truth)[0] else pose
    error = here.pose.array - truth.array
    error[2] = math.remainder(error[2], math.tau)
    return math.sqrt(error @ np.linalg.solve(here.covariance, error))


def test_the_pose_is_found_without_a_prior_within_its_covariance(fresh, frames):
    view = fresh.look(frames)
    assert view.pose
    assert view.pose.pose.error_to(POSE, symmetric=True)[0] < 0.01
    assert off_by(view.pose, POSE) < 4.0
    assert len(view.views) == 4
    assert [one.camera.size_px for one in view.views] == [one.size_px for one in CAMERAS]


def test_poses_of_four_cameras_lie_within_their_covariance(fresh):
    distances = []
    for seed, pose in enumerate((Pose2(1.2, 0.7, 2.0), Pose2(-1.8, 0.9, -2.4), Pose2(0.2, -1.1, -0.6))):
        prior = PoseEstimate(pose.compose(Pose2(0.02, 0.03, -0.01)), np.diag([0.05, 0.05, 0.03]) ** 2, 1.0, 0.0)
        fresh.forget()
        view = fresh.look(render(pose, seed + 5), prior=prior)
        distances.append(off_by(view.pose, pose))
    # chi-square of three poses, 9 degrees of freedom: one in a thousand exceeds it
    assert sum(distance**2 for distance in distances) < 27.9


def test_a_rig_of_one_camera_answers_as_that_camera(frames, prior):
    alone, rig = Vision(FIELD, CAMERAS[0]), Vision(FIELD, (CAMERAS[0],))
    for given in (None, prior):
        one, other = alone.look(frames[0], prior=given), rig.look((frames[0],), prior=given)
        assert other.pose.candidates == one.pose.candidates
        assert np.array_equal(other.pose.covariance, one.pose.covariance)
        assert np.array_equal(other.measurement.covariance, one.measurement.covariance)
        assert other.obstacles == one.obstacles
        assert [(ball.x_m, ball.y_m) for ball in other.balls] == [(ball.x_m, ball.y_m) for ball in one.balls]
        assert np.nanmax(other.free_space.range_m) <= np.nanmax(one.free_space.range_m)


def test_the_order_of_the_cameras_does_not_matter(fresh, frames, prior):
    order = (2, 0, 3, 1)
    other = Vision(FIELD, tuple(CAMERAS[k] for k in order))
    for given in (None, prior):
        one, turned = fresh.look(frames, prior=given), other.look(tuple(frames[k] for k in order), prior=given)
        assert turned.pose.candidates == one.pose.candidates
        assert np.array_equal(turned.pose.covariance, one.pose.covariance)
        assert np.array_equal(turned.free_space.range_m, one.free_space.range_m, equal_nan=True)


def test_more_cameras_narrow_the_covariance_and_a_missing_frame_never_does(fresh, frames, prior):
    covariances = []
    for count in range(1, 5):
        fresh.forget()
        shown = tuple(frame if k < count else None for k, frame in enumerate(frames))
        covariances.append(fresh.look(shown, prior=prior).pose.covariance)
    for fewer, more in pairwise(covariances):
        # a camera that does not know the pose changes nothing
        assert np.linalg.eigvalsh(fewer - more)[0] > -1e-9
    assert np.linalg.eigvalsh(covariances[0] - covariances[1])[0] > 0.0
    assert np.linalg.det(covariances[-1]) < 0.1 * np.linalg.det(covariances[0])


def test_the_prior_counts_once(fresh, frames, prior):
    view = fresh.look(frames, prior=prior)
    information = np.linalg.inv(view.measurement.covariance) + np.linalg.inv(prior.covariance)
    assert np.linalg.inv(view.pose.covariance) == pytest.approx(information, rel=0.2, abs=5e3)
    assert np.linalg.det(view.pose.covariance) < np.linalg.det(view.measurement.covariance)


def test_ball_and_robot_between_two_cameras_are_told_once(fresh, frames, prior):
    view = fresh.look(frames, prior=prior)
    near = [ball for ball in view.balls if math.hypot(ball.x_m - 0.9, ball.y_m - 0.9) < 0.1]
    assert len(near) == 1
    ahead = [one for one in view.obstacles if abs(one.bearing_rad) < 0.15 and 1.0 < one.range_m < 1.6]
    assert len(ahead) == 1


def test_the_floor_is_free_all_around_up_to_what_stands_there(fresh, frames, prior):
    space = fresh.look(frames, prior=prior).free_space
    # four lenses that show more than a half turn each
    assert np.isfinite(space.range_m).all()
    assert space.range_m.min() > 1.0
    assert space.bearing_rad[-1] - space.bearing_rad[0] > 0.95 * math.tau
    ahead = np.abs(space.bearing_rad) < 0.1
    assert np.nanmax(space.range_m[ahead]) < 1.35
    assert np.nanmin(space.range_m[ahead]) > 1.0
    behind = np.abs(space.bearing_rad) > 2.9
    assert np.nanmin(space.range_m[behind]) > 0.8
    steering = Steering(0.26, MotionLimits(1.0, 1.0))
    command = steering.steer(space, (0.0, 0.0), math.pi, 0.5)
    assert command.velocity_mps[0] < 0.0


def test_a_camera_that_saw_nothing_leaves_its_directions_unknown(fresh, frames, prior):
    space = fresh.look((None, frames[1], None, None), prior=prior).free_space
    assert np.isnan(space.range_m[np.abs(space.bearing_rad + math.pi / 2) < 0.3]).all()
    assert np.isfinite(space.range_m[np.abs(space.bearing_rad - math.pi / 2) < 0.3]).all()


@pytest.mark.slow
def test_late_frames_are_moved_by_odometry():
    """Only this finds a late camera's frame that is taken as of now."""
    # the first frame was taken at the beginning of the step, the others at its end
    step = Pose2(0.10, 0.02, 0.08)
    before, after = render(POSE, 2), render(POSE.compose(step), 3)
    still, late = Vision(FIELD, CAMERAS), Vision(FIELD, Rig(CAMERAS, latency_s=(0.1, 0.0, 0.0, 0.0)))
    mixed = (before[0], *after[1:])
    for vision, t_s in ((still, (10.0, 10.1, 10.1, 10.1)), (late, 10.1)):
        vision.look(before, t_s=10.0, prior=POSE)
        view = vision.look(mixed, t_s=t_s, odometry=step)
        assert view.t_s == 10.1
        assert view.pose.pose.error_to(POSE.compose(step))[0] < 0.01
        assert off_by(view.pose, POSE.compose(step)) < 4.0
        assert view.views[0].t_s == pytest.approx(10.0)
        assert view.views[0].pose.pose.error_to(POSE)[0] < 0.02


def test_a_memory_takes_the_fused_pose_and_moves_late_frames():
    memory = Memory.of_everything(FIELD, half="own")
    vision = Vision(FIELD, CAMERAS, memory=memory)
    pose, step = POSE, Pose2(0.03, 0.0, 0.02)
    for number in range(4):
        frames = render(pose, 20 + number)
        if number == 2:
            frames = (None, frames[1], None, frames[3])
        view = vision.look(frames, t_s=5.0 + 0.1 * number, odometry=step if number else Pose2(0.0, 0.0, 0.0))
        assert view.belief.pose.pose.error_to(pose, symmetric=True)[0] < 0.01
        pose = pose.compose(step)
    assert (view.belief.free_map.state == FREE).sum() > 200
    nothing = vision.look((None,) * 4, t_s=5.5, odometry=step)
    assert not nothing.pose
    assert nothing.belief.pose
    assert vision.look(None, t_s=5.6, odometry=step).belief.pose


def test_the_pictures_are_drawn_side_by_side(fresh, frames, prior):
    view = fresh.look((frames[0], None, frames[2], frames[3]), prior=prior)
    picture = draw(view, (frames[0], None, frames[2], frames[3]), fresh)
    assert picture.shape == (600, 3 * (3 * 264 + 256), 3)
    # each alone is drawn as the view of any camera is
    assert np.array_equal(picture[:, :792], draw(view.views[0], frames[0], fresh))
    assert picture[300:, 792:1584].max() == 0
    with pytest.raises(ArgumentError, match="takes the 4 frames of a rig's view"):
        draw(view, frames[0], fresh)


def test_recordings_are_of_one_camera(vision):
    with pytest.raises(ArgumentError, match="a recording holds the frames of one camera"):
        Run.of(vision)


def test_the_view_of_one_camera_has_the_belief_of_the_body(frames):
    vision = Vision(FIELD, CAMERAS[:2], memory=Memory(FIELD))
    view = vision.look(frames[:2], t_s=1.0, odometry=Pose2(0.0, 0.0, 0.0))
    assert view.of_camera(1).belief is view.belief
    assert view.of_camera(1).camera.pan_rad == pytest.approx(CAMERAS[1].pan_rad)


def test_a_camera_that_does_not_confirm_what_another_found_is_left_out(fresh):
    elsewhere = Pose2(1.6, 0.8, -1.0)
    one, other = render(POSE, 1)[0], render(elsewhere, 7)[1]
    for truth, look in ((POSE, (one, None, None, None)), (elsewhere, (None, other, None, None))):
        fresh.forget()
        assert fresh.look(look).pose.pose.error_to(truth, symmetric=True)[0] < 0.02
    fresh.forget()
    view = fresh.look((one, other, None, None))
    assert view.pose.pose.error_to(POSE, symmetric=True)[0] < 0.02
    assert not view.of_camera(1).measurement


@pytest.mark.parametrize(
    ("error", "message", "call"),
    [
        (FrameError, "sequence of 4 frames", lambda v, f: v.look(f[:3])),
        (FrameError, "sequence of 4 frames, None where there is none, got a ndarray", lambda v, f: v.look(f[0])),
        (FrameError, "camera 2: frame must be .* are they in the order", lambda v, f: v.look((f[0], f[1], f[3], f[2]))),
        (FrameError, "camera 1: frame must be uint8 .* got int", lambda v, f: v.look((f[0], 3, None, None))),
        (ArgumentError, "one for each of its 4 frames, got 2", lambda v, f: v.look(f, t_s=(1.0, 2.0))),
        (ArgumentError, "no time for the frame of camera 1", lambda v, f: v.look(f, t_s=(1.0, None, 1.0, 1.0))),
        (ArgumentError, "fixed to the body", lambda v, f: v.look(f, pan_rad=0.1)),
        (ArgumentError, "have floor samples of their own", lambda v, f: v.grid),
    ],
)
def test_what_is_no_look_of_a_rig_is_told(vision, frames, error, message, call):
    with pytest.raises(error, match=message):
        call(vision, frames)


def test_what_is_no_rig_is_told():
    with pytest.raises(ArgumentError, match="at least one camera"):
        Vision(FIELD, ())
    with pytest.raises(ArgumentError, match="have the same offset_m"):
        Vision(FIELD, (CAMERAS[0], CAMERAS[0]))
    with pytest.raises(ArgumentError, match="need one method"):
        Vision(FIELD, (CAMERAS[0], replace(CAMERAS[1], tilt_rad=None)))
    with pytest.raises(ArgumentError, match="mask of a rig"):
        Vision(FIELD, CAMERAS[:2], mask=np.zeros((200, 264), np.uint8))


def test_a_frame_too_old_is_told_and_not_used(fresh, frames, prior):
    view = fresh.look((frames[0], frames[1], None, None), t_s=(10.0, 14.0, None, None), prior=prior)
    assert view.warnings == ("camera 0: its frame is 4.00 s old and is not used",)
    assert not view.views[0].pose
    assert view.pose
