"""Method "edges" as `Vision` uses it: chosen by itself, followed with priors, found without."""

import math
import re
from dataclasses import replace
from functools import partial

import cv2
import numpy as np
import pytest

from field_models import load_field
from robocup_vision.calibration.online.calibration import OnlineCalibration
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.estimates import EdgeState, NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.find import floor_places
from robocup_vision.localization.model_edges.finder import EdgeFinder, FinderSettings
from robocup_vision.localization.model_edges.follower import ODDS_MEMORY_S, EdgeFollower
from robocup_vision.localization.model_edges.localizer import NEAR_S, PRIOR_STD_RAD
from robocup_vision.memory import Memory
from robocup_vision.vision import Vision
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, sample_goal
from sim2d.rendering.scene import Robot


def test_vision_chooses_it_where_the_tilt_is_known(fl_shot):
    vision = Vision(fl_shot.field, fl_shot.camera)
    assert vision.method == "edges"
    assert Vision(fl_shot.field, replace(fl_shot.camera, tilt_rad=None)).method == "goal"
    view = vision.look(fl_shot.frame, prior=fl_shot.pose)
    assert view.pose
    assert view.pose.pose.error_to(fl_shot.pose)[0] < 0.03
    assert view.measurement is not None
    assert view.measurement.pose.error_to(fl_shot.pose)[0] < 0.1
    assert view.camera.tilt_rad == pytest.approx(fl_shot.camera.tilt_rad + 0.017, abs=0.004)


def test_a_head_on_a_robot_is_followed_as_the_robot(fl_shot):
    pan_rad = 0.5
    camera = replace(fl_shot.camera, offset_m=(0.06, 0.01))
    robot = fl_shot.pose.compose(Pose2(0.06, 0.01, pan_rad).inverse())
    view = Vision(fl_shot.field, camera).look(fl_shot.frame, prior=robot, pan_rad=pan_rad)
    assert view.pose
    away, turn = view.pose.pose.error_to(robot)
    assert away < 0.03
    assert turn < math.radians(1.0)
    assert view.camera_pose.pose.error_to(fl_shot.pose)[0] < 0.03


def test_edge_points_stay_those_of_their_frame_when_they_are_asked_for_later(fl_shot):
    follower = EdgeFollower(fl_shot.field, fl_shot.camera)
    near = PoseEstimate(fl_shot.pose.compose(fl_shot.camera.camera_in_robot), np.diag([0.02] * 3) ** 2, 1.0, 0.0)
    assert follower.follow(fl_shot.frame, near)
    now, later = follower.edge_points(), follower.edge_points_when_asked()
    follower.follow(np.full_like(fl_shot.frame, 90), replace(near, pose=Pose2(-1.0, 0.5, 2.0), candidates=()))
    assert not np.array_equal(follower.edge_points().pixels, now.pixels)
    np.testing.assert_array_equal(later().pixels, now.pixels)
    np.testing.assert_array_equal(later().state, now.state)
    assert (now.state == EdgeState.FOUND).mean() > 0.5


def test_a_search_that_found_nothing_is_not_repeated_at_once(fl_shot, monkeypatch):
    searches = []
    monkeypatch.setattr(
        EdgeFinder,
        "find",
        lambda self, frame, near=None: searches.append(frame) or NotLocated("no pose explains what is in view"),
    )
    vision = Vision(fl_shot.field, fl_shot.camera)
    searches.clear()
    empty, prior = np.full_like(fl_shot.frame, 90), fl_shot.pose
    for t_s, count in ((0.0, 1), (0.033, 1), (0.067, 1), (0.11, 2), (0.12, 2), (0.02, 3), (None, 4), (None, 5)):
        assert not vision.look(empty, t_s, prior=prior).pose
        assert len(searches) == count


def test_a_followed_camera_is_searched_for_in_the_second_look_that_does_not_confirm_it(fl_shot, monkeypatch):
    vision, finder = Vision(fl_shot.field, fl_shot.camera), EdgeFinder
    proposed, searches = [], []
    judge = finder.judge
    monkeypatch.setattr(finder, "judge", lambda self, frame, poses: proposed.append(poses) or judge(self, frame, poses))
    monkeypatch.setattr(
        finder, "find", lambda self, frame, near=None: searches.append(near) or NotLocated("none is right")
    )
    empty = np.full_like(fl_shot.frame, 90)
    near = PoseEstimate(fl_shot.pose, np.diag([0.02, 0.02, 0.02]) ** 2, 1.0, 0.0)
    wide = replace(near, covariance=np.diag([0.3, 0.3, 0.2]) ** 2)
    for frame, prior, tried, searched in (
        (fl_shot.frame, near, 0, 0),
        (empty, near, 1, 0),
        (empty, near, 1, 1),
        (fl_shot.frame, near, 1, 1),
        # so wide a prior may be anywhere
        (empty, wide, 1, 2),
    ):
        assert bool(vision.look(frame, prior=prior).pose) == (frame is fl_shot.frame)
        assert (len(proposed), len(searches)) == (tried, searched)
    assert proposed[0] == (near.seen_from(fl_shot.camera.camera_in_robot).pose,)


def test_a_frame_that_does_not_confirm_a_prior_may_confirm_the_place(fl_shot, monkeypatch):
    vision = Vision(fl_shot.field, fl_shot.camera)
    near = PoseEstimate(fl_shot.pose, np.diag([0.02, 0.02, 0.02]) ** 2, 1.0, 0.0)
    assert vision.look(fl_shot.frame, prior=near).pose
    follow = EdgeFollower.follow

    def doubt(self, frame, prior, dt_s=1 / 30, **how):
        answer = follow(self, frame, prior, dt_s, **how)
        return answer if how.get("is_proposal") else NotLocated("some line points are not explained")

    monkeypatch.setattr(EdgeFollower, "follow", doubt)
    view = vision.look(fl_shot.frame, prior=near)
    assert view.pose
    assert view.pose.pose.error_to(fl_shot.pose)[0] < 0.03


def test_what_vision_forgets_and_what_is_long_ago_vouch_for_no_prior(fl_shot):
    vision = Vision(fl_shot.field, fl_shot.camera)
    near = PoseEstimate(fl_shot.pose, np.diag([0.02, 0.02, 0.02]) ** 2, 1.0, 0.0)
    # robots that stand close before the camera leave little of the picture, which fits many a pose
    hidden = fl_shot.frame.copy()
    hidden[100:] = hidden[34:, 40:] = (30, 30, 34)
    assert not vision.look(hidden, 0.0, prior=near).pose
    vision.forget()
    assert vision.look(fl_shot.frame, 0.0, prior=near).pose
    assert vision.look(hidden, 0.03, prior=near).pose
    vision.forget()
    assert not vision.look(hidden, 0.06, prior=near).pose
    assert vision.look(fl_shot.frame, 1.0, prior=near).pose
    assert not vision.look(hidden, 60.0, prior=near).pose


@pytest.mark.parametrize(
    ("pose", "robot", "turn_rad"),
    [
        (Pose2(0.222, -0.64, 2.354), (-0.138, -0.369), 0.148),
        (Pose2(-1.091, 1.107, 2.308), (-1.416, 1.364), 0.122),
        (Pose2(1.544, -0.421, -0.828), (2.113, -0.885), -0.142),
    ],
)
def test_a_robot_that_slipped_is_followed_by_what_its_frames_show(pose, robot, turn_rad, take_shot):
    shot = take_shot("four_legged_2007", pose, robots=(Robot(*robot, 0.12, 0.25),))
    vision, sure = Vision(shot.field, shot.camera), np.diag([0.02, 0.02, math.radians(1.2)]) ** 2
    # wheels that spin turn the prior away, which does not know of it
    for step, off_rad in enumerate((0.0, 0.0, 0.0, turn_rad, turn_rad, turn_rad)):
        near = PoseEstimate(pose.compose(Pose2(0.0, 0.0, off_rad)), sure, 1.0, 0.0)
        view = vision.look(shot.frame, step / 30, prior=near)
        assert view.pose
        assert view.pose.pose.error_to(pose)[1] < math.radians(1.0)


def test_a_frame_that_confirms_another_place_too_is_no_evidence_for_its_prior(take_shot):
    pose = Pose2(0.769, 0.379, -0.766)
    shot = take_shot("four_legged_2007", pose, robots=(Robot(1.321, -0.501, 0.12, 0.25),))
    vision, sure = Vision(shot.field, shot.camera), np.diag([0.02, 0.02, math.radians(1.2)]) ** 2
    for step in range(4):
        assert vision.look(shot.frame, step / 30, prior=PoseEstimate(pose, sure, 1.0, 0.0)).pose
    # a prior supported by frames before, and near it a few samples that agree with it without fixing it
    near, located = PoseEstimate(pose.compose(Pose2(0.0, 0.0, -0.143)), sure, 1.0, 0.0), 0
    for step in range(4, 10):
        view = vision.look(shot.frame, step / 30, prior=near)
        located += bool(view.pose)
        assert not view.pose or view.pose.pose.error_to(pose)[1] < math.radians(2.0)
    assert located >= 3


def test_only_a_robot_located_lately_can_have_slipped(fl_shot, monkeypatch):
    vision, follow, stds = Vision(fl_shot.field, fl_shot.camera), EdgeFollower.follow, []

    def note(self, frame, prior, dt_s=1 / 30, **how):
        if not how.get("is_proposal"):
            stds.append(prior.std[2])
        return follow(self, frame, prior, dt_s, **how)

    monkeypatch.setattr(EdgeFollower, "follow", note)
    monkeypatch.setattr(EdgeFinder, "find", lambda self, frame, near=None: NotLocated("none is right"))
    near = PoseEstimate(fl_shot.pose, np.diag([0.02, 0.02, 0.02]) ** 2, 1.0, 0.0)
    empty, memory_s = np.full_like(fl_shot.frame, 90), ODDS_MEMORY_S
    for frame, t_s, is_looked_beside in (
        (empty, 0.0, False),
        (fl_shot.frame, 0.1, False),
        (empty, 0.2, True),
        (empty, 0.05 + memory_s, True),
        (empty, 0.2 + memory_s, False),
        (fl_shot.frame, 0.3 + memory_s, False),
    ):
        stds.clear()
        vision.look(frame, t_s, prior=near)
        assert (max(stds) > PRIOR_STD_RAD) == is_looked_beside


def test_memory_takes_the_frame_s_own_word(fl_shot):
    memory = Memory(fl_shot.field)
    vision = Vision(fl_shot.field, fl_shot.camera, memory=memory)
    vision.look(fl_shot.frame, 0.0, prior=fl_shot.pose)
    prior = memory.prior_estimate(0.0)
    assert isinstance(prior, PoseEstimate)
    for k in range(1, 6):
        view = vision.look(fl_shot.frame, 0.05 * k, odometry=Pose2(0.0, 0.0, 0.0))
    assert view.belief is not None
    assert view.belief.pose
    assert view.belief.pose.pose.error_to(fl_shot.pose)[0] < 0.05


@pytest.mark.parametrize(("pose", "off_px"), [(Pose2(0.38, -1.03, math.pi), -8.0), (Pose2(0.38, 1.03, math.pi), 7.0)])
def test_memory_does_not_believe_a_camera_that_the_frame_finds_to_be_wrong(pose, off_px, take_shot, fl_shot):
    file = fl_shot.camera
    true = replace(file, center_px=(file.center_px[0] + off_px, file.center_px[1]))
    shot = take_shot("four_legged_2007", pose, camera=true)
    memory = Memory(shot.field)
    vision = Vision(shot.field, file, memory=memory, online=OnlineCalibration(shot.field, file))
    at_start = PoseEstimate(pose, np.diag([0.05, 0.05, math.radians(3.0)]) ** 2, 1.0, 0.0)
    memory.poses.update(at_start, 0.0)
    belief = vision.look(shot.frame, 0.0, odometry=Pose2(0.0, 0.0, 0.0)).belief
    assert belief is not None
    assert belief.pose
    assert belief.pose.pose.error_to(pose)[0] < 0.06


@pytest.fixture(scope="module")
def spl_finder(spl_shot):
    return EdgeFinder(EdgeFollower(spl_shot.field, spl_shot.camera))


def test_a_camera_is_found_without_a_prior(fl_shot, spl_shot):
    finder = EdgeFinder(EdgeFollower(fl_shot.field, fl_shot.camera))
    assert any(pose.error_to(fl_shot.pose)[0] < 0.4 for pose in next(finder.propose(fl_shot.frame)))
    answer = finder.find(fl_shot.frame)
    assert not answer or answer.estimate.pose.error_to(fl_shot.pose)[0] < 0.1
    near = finder.judge(fl_shot.frame, [fl_shot.pose])
    assert near
    assert near.estimate.pose.error_to(fl_shot.pose)[0] < 0.05
    assert len(near.estimate.candidates) == 1
    finder = EdgeFinder(EdgeFollower(spl_shot.field, spl_shot.camera))
    answer = finder.find(spl_shot.frame)
    if answer:
        # its halves look alike: one of them stands for both
        assert answer.estimate.pose.error_to(spl_shot.pose, symmetric=True)[0] < 0.1
        assert len(answer.estimate.candidates) == len(answer.measurement.candidates) == 1
    near = finder.judge(spl_shot.frame, [spl_shot.pose])
    assert near
    assert near.estimate.pose.error_to(spl_shot.pose)[0] < 0.1


@pytest.mark.parametrize(
    ("pose", "turn_rad"),
    [
        (Pose2(-1.22, -0.15, -0.13), -0.2),
        (Pose2(1.41, -0.79, -1.15), 0.19),
        (Pose2(-1.02, 0.97, 1.5), -0.25),
        (Pose2(0.99, 0.35, 1.1), 0.19),
    ],
)
def test_a_lost_camera_is_found_near_where_it_was_believed_to_be(pose, turn_rad, take_shot):
    shot = take_shot("four_legged_2007", pose)
    finder, blurred = EdgeFinder(EdgeFollower(shot.field, shot.camera)), cv2.blur(shot.frame, (9, 1))
    # the frame alone leaves it open, and so does a belief that is wrong
    assert not finder.find(blurred)
    assert not finder.find(blurred, Pose2(-pose.x_m, -pose.y_m, pose.theta_rad + 2.0))
    found = finder.find(blurred, pose.compose(Pose2(0.1, -0.05, turn_rad)))
    assert found
    away, turned = found.estimate.pose.error_to(pose)
    assert away < 0.1
    assert turned < math.radians(3.0)


def test_what_a_frame_alone_tells_is_found_wherever_it_was_believed_to_be(take_shot):
    pose = Pose2(0.79, -0.45, -3.0)
    shot = take_shot("four_legged_2007", pose)
    finder = EdgeFinder(EdgeFollower(shot.field, shot.camera))
    for near in (None, pose, Pose2(-1.5, 1.0, 0.5)):
        found = finder.find(shot.frame, near)
        assert found
        assert found.estimate.pose.error_to(pose)[0] < 0.05


def test_a_camera_located_lately_is_searched_for_about_its_prior(fl_shot, monkeypatch):
    vision, nears = Vision(fl_shot.field, fl_shot.camera), []
    monkeypatch.setattr(
        EdgeFinder, "find", lambda self, frame, near=None: nears.append(near) or NotLocated("none is right")
    )
    wide = PoseEstimate(fl_shot.pose, np.diag([0.3, 0.3, 0.2]) ** 2, 1.0, 0.0)
    empty, near_s = np.full_like(fl_shot.frame, 90), NEAR_S
    vision.look(empty, 0.0, prior=wide)
    assert vision.look(fl_shot.frame, 1.0, prior=fl_shot.pose).pose
    vision.look(empty, 1.0 + 0.9 * near_s, prior=wide)
    vision.look(empty, 1.0 + 1.1 * near_s, prior=wide)
    expected = wide.seen_from(fl_shot.camera.camera_in_robot).pose
    assert nears == [None, expected, None]


@pytest.mark.parametrize("condition", ["clean_208x160", pytest.param("heavy_glare_208x160", marks=pytest.mark.slow)])
def test_a_goal_is_found_from_cold_where_edges_alone_do_not_know(condition):
    """Heavy glare alone finds a search that needs a goal's own colour."""
    field, given = load_field("four_legged_2007"), GOAL_CONDITIONS[condition]
    for sample in sample_goal(field, given, 611, 3, supersample=4):
        camera = replace(given.camera, pan_rad=0.0, tilt_rad=sample.camera.tilt_rad, roll_rad=0.0)
        view = Vision(field, camera).look(sample.frame)
        assert view.pose
        away, turn = view.pose.pose.error_to(sample.pose)
        assert away < 0.2
        assert turn < math.radians(5.0)


@pytest.mark.parametrize(
    ("pose", "nod_rad"),
    [(Pose2(2.568, 0.087, 2.757), -0.0496), (Pose2(1.4, 0.0, -0.24), -0.038), (Pose2(-0.2, -0.1, -0.24), 0.04)],
)
def test_a_body_that_nods_is_searched_for_again(pose, nod_rad, take_shot, spl_shot, spl_finder):
    shot = take_shot("spl_2020", pose, nod_rad=nod_rad, camera=spl_shot.camera)
    answer = spl_finder.find(shot.frame)
    assert answer
    assert min(one.error_to(pose, symmetric=True)[0] for one in answer.estimate.candidates) < 0.03
    # the first search alone does not tell it
    assert not EdgeFinder(spl_finder.follower, FinderSettings(nods=())).find(shot.frame)


def test_nothing_is_found_where_nothing_is(fl_shot):
    finder = EdgeFinder(EdgeFollower(fl_shot.field, fl_shot.camera))
    for level in (0, 128, 255):
        assert not finder.find(np.full_like(fl_shot.frame, level))
    noise = np.random.default_rng(0).integers(0, 256, fl_shot.frame.shape, dtype=np.uint8)
    assert not finder.find(noise)


def test_line_points_are_put_on_the_floor(fl_shot):
    camera = fl_shot.camera
    pixels = np.random.default_rng(1).uniform((0.0, 80.0), (207.0, 159.0), (40, 2))
    out = np.zeros((40, 3))
    points = np.column_stack([pixels, np.zeros(40)])
    count = floor_places(points, 40, lens_table(camera), camera.tilt_rad, 0.0, camera.height_m, 5.0, out)
    expected = camera.pixel_to_floor(pixels)
    expected = expected[np.hypot(*expected.T) <= 5.0]
    order = np.lexsort(expected.T)
    kept = out[:count, :2]
    np.testing.assert_allclose(kept[np.lexsort(kept.T)], expected[order], atol=1e-9)


def test_both_halves_are_told_where_the_goal_is_hidden(fl_shot):
    follower = EdgeFollower(fl_shot.field, fl_shot.camera)
    finder = EdgeFinder(follower)
    found = finder.judge(fl_shot.frame, [fl_shot.pose])
    assert found
    assert len(found.estimate.candidates) == 1
    # the goal and what is beyond the field are hidden
    lines = fl_shot.frame.copy()
    green = (lines[..., 1] > lines[..., 2] + 25) & (lines[..., 1] > lines[..., 0] + 25)
    white = lines.min(axis=-1) > 120
    rows = np.arange(len(lines))[:, None]
    first = np.argmax(green.mean(axis=1) > 0.5)
    lines[~(green | white) | (rows < first)] = (30, 30, 34)
    for proposal in (fl_shot.pose, fl_shot.pose.half_turn()):
        both = finder.judge(lines, [proposal])
        assert not both or len(both.estimate.candidates) == 2


def _upside_down(frame):
    return np.ascontiguousarray(frame[::-1, ::-1])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (np.zeros_like, r"^no lines, goals or beacons stand out .* row 41 of 240\) \(mean brightness 0 of 255\)$"),
        (partial(np.full_like, fill_value=120), r"^no lines, goals .* \(mean brightness 120 of 255\)$"),
        (_upside_down, r"\d+ of \d+ visible places on edges are found.*, \d+ of \d+ line points are explained"),
    ],
)
def test_a_reason_names_what_was_seen_and_what_is_missing(change, reason, spl_shot):
    vision = Vision(spl_shot.field, spl_shot.camera)
    assert re.search(reason, vision.look(change(spl_shot.frame)).pose.reason)
    by_prior = vision.look(change(spl_shot.frame), prior=spl_shot.pose).pose.reason
    assert re.search(r"\d+ of \d+ (visible )?places on edges .* \(mean brightness \d+ of 255\)$", by_prior)
