"""Laws of memory: what moves is followed and not mapped, the halves of a field, jumps, late frames, bad calls."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.camera.files import load_camera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import FORWARD_FRAME_ERRORS, FrameErrors
from robocup_vision.localization.filter.pose_filter import PoseFilter
from robocup_vision.mapping import ViewMotion
from robocup_vision.mapping.occupancy import FREE, NO_GO, FreeSpaceMap
from robocup_vision.mapping.sensor_model import default_sensors
from robocup_vision.memory import Memory, MemorySettings
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.vision import Vision
from sim2d.robot_link import CONTROL_PERIOD_S, Command, RobotLimits
from sim2d.sensors.match_camera import MatchCamera
from sim2d.world.world import World

_NOWHERE = Pose2(0.0, 0.0, 0.0)
ROOT = Path(__file__).parents[2]


def drive(vision, eye, world, periods, commands=None, after=None):
    """Let a world go on, seen by robot 0; return the last view."""
    view = None
    for period in range(periods):
        state = world.state
        view = vision.look(np.array(eye.render(state, 0)), state.t_s, world.odometry(0))
        if after is not None:
            after(period, view)
        world.step(commands or {})
    return view


@pytest.fixture
def eye(ssl_field, paper_camera):
    return MatchCamera(ssl_field, paper_camera, RobotLimits(), np.random.default_rng(5))


@pytest.fixture
def world(ssl_field):
    world = World(ssl_field, 1, RobotLimits(), np.random.default_rng(4))
    world.place_ball(-1.2, -0.7)
    world.place(0, Pose2(-0.5, -0.2, 0.2))
    world.place(1, Pose2(0.3, -0.6, math.pi / 2))
    return world


def test_an_opponent_is_followed_and_not_mapped(ssl_field, paper_camera, eye, world):
    memory = Memory.of_everything(ssl_field)
    vision = Vision(ssl_field, paper_camera, memory=memory)
    view = drive(vision, eye, world, 45, {1: Command(forward_mps=0.5)})
    belief, truth = view.belief, world.state.robots
    assert belief.pose.pose.error_to(truth[0].pose)[0] < 0.03
    (track,) = belief.tracks
    there = truth[1].pose
    assert math.hypot(track.x_m - there.x_m, track.y_m - there.y_m) < 0.08
    assert track.vy_mps == pytest.approx(0.5, abs=0.2)
    assert abs(track.vx_mps) < 0.2
    # nothing of its way is left behind in the map, and the walls are
    state, low = belief.free_map.state, np.array(belief.free_map.corner_m)
    begun = tuple(((np.array([0.3, -0.45]) - low) / belief.free_map.cell_m).astype(int))
    assert state[begun] != NO_GO
    assert (state == NO_GO).sum() > 20
    assert (state == FREE).mean() > 0.2


def test_without_parts_there_is_a_pose_alone(ssl_field, paper_camera, eye, world):
    view = drive(Vision(ssl_field, paper_camera, memory=Memory(ssl_field)), eye, world, 4)
    assert view.belief.pose
    assert view.belief.hypotheses[0].probability > 0.5
    assert view.belief.tracks == ()
    assert view.belief.free_map is None
    assert view.belief.t_s == view.t_s


def test_a_vision_without_memory_believes_nothing(ssl_field, paper_camera, eye, world):
    assert drive(Vision(ssl_field, paper_camera), eye, world, 1).belief is None


def test_nobody_is_followed_while_the_pose_is_unknown(ssl_field, paper_camera, eye, world):
    memory = Memory.of_everything(ssl_field)
    view = drive(Vision(ssl_field, paper_camera), eye, world, 1)
    belief = memory.update(dataclasses.replace(view, pose=NotLocated("dark")))
    assert not belief.pose
    assert belief.tracks == ()
    assert belief.free_map is None


def test_elsewhere_the_map_begins_anew(ssl_field, paper_camera, eye, world):
    memory = Memory.of_everything(ssl_field)
    vision = Vision(ssl_field, paper_camera, memory=memory)
    drive(vision, eye, world, 20)
    seen_before = memory.free_map.observations("floor").max()
    world.place(0, Pose2(0.8, 0.5, -2.0))
    counts = []
    drive(vision, eye, world, 30, after=lambda *_: counts.append(int(memory.free_map.observations("floor").max())))
    assert seen_before == 20
    # in between everything was forgotten
    assert min(counts) < 5
    assert memory.poses.belief.pose.error_to(world.state.robots[0].pose)[0] < 0.03


def test_a_late_frame_serves_the_pose_alone(ssl_field, paper_camera, eye, world):
    memory = Memory.of_everything(ssl_field)
    vision = Vision(ssl_field, paper_camera, memory=memory)
    view = drive(vision, eye, world, 10)
    counts = memory.free_map.observations("floor")
    memory.update(dataclasses.replace(view, t_s=view.t_s - CONTROL_PERIOD_S))
    np.testing.assert_array_equal(memory.free_map.observations("floor"), counts)


def test_to_forget_is_to_begin_anew(ssl_field, paper_camera, eye, world):
    memory = Memory.of_everything(ssl_field)
    vision = Vision(ssl_field, paper_camera, memory=memory)
    drive(vision, eye, world, 8)
    vision.forget()
    assert not memory.poses.belief
    assert not memory.belief(0.0).tracks
    assert memory.free_map.observations("floor").max() == 0


def test_bad_calls_say_what_is_wrong(ssl_field, paper_camera, eye, world):
    frame = np.array(eye.render(world.state, 0))
    with pytest.raises(ArgumentError, match="hand t_s to look"):
        Vision(ssl_field, paper_camera, memory=Memory(ssl_field)).look(frame)
    view = Vision(ssl_field, paper_camera).look(frame)
    with pytest.raises(ArgumentError, match="hand t_s to look"):
        Memory(ssl_field).update(view)
    only_range = {"range": default_sensors()["range"]}
    with pytest.raises(ArgumentError, match="needs a sensor 'floor', it has range"):
        Memory(ssl_field, free_map=FreeSpaceMap(only_range))
    with pytest.raises(ArgumentError, match="predict needs a memory"):
        Vision(ssl_field, paper_camera).predict(_NOWHERE, 0.0)


def test_an_estimate_seen_from_a_mount_and_back_is_itself():
    cov = np.diag([1e-4, 4e-4, 9e-4])
    estimate = PoseEstimate(Pose2(1.0, -0.5, 2.0), cov, 0.9, 0.3, (Pose2(1.0, -0.5, 2.0), Pose2(-1.0, 0.5, -1.14)))
    mount = Pose2(0.1, 0.02, 0.5)
    there = estimate.seen_from(mount)
    assert there.pose == estimate.pose.compose(mount)
    # a lever arm turns doubt of heading into doubt of place
    assert np.trace(there.covariance[:2, :2]) > np.trace(cov[:2, :2])
    back = there.seen_from(mount.inverse())
    np.testing.assert_allclose(back.covariance, cov, atol=1e-12)
    for one, other in zip(back.candidates, estimate.candidates, strict=True):
        assert one.error_to(other) == pytest.approx((0.0, 0.0), abs=1e-9)


class BlindAfter(PoseFilter):
    """Takes the first poses only: from then on the belief goes by the motion alone."""

    taken = 0

    def update(self, estimate, t_s):
        """Take a pose, or leave it."""
        self.taken += 1
        if self.taken <= 6:
            super().update(estimate, t_s)


def blind_drive(field, camera, eye, world, ego_motion, slip=None, steps=1):
    """Return how far off the belief is after a drive; `slip`: of the wheels, None without wheels."""
    memory = Memory(field, poses=BlindAfter(), ego_motion=ego_motion)
    vision = Vision(field, camera, memory=memory)
    world.place(0, Pose2(-0.5, -0.2, 0.2))
    for _ in range(30):
        state, moved = world.state, None
        if slip is not None:
            o = world.odometry(0)
            moved = Pose2(slip * o.x_m, slip * o.y_m, slip * o.theta_rad)
            if steps == 2:
                vision.predict(moved, state.t_s)
                moved = None
        view = vision.look(np.array(eye.render(state, 0)), state.t_s, moved)
        truth = world.state.robots[0].pose
        world.step({0: Command(0.4, 0.1, 0.6)})
    assert truth.error_to(Pose2(-0.5, -0.2, 0.2))[0] > 0.2
    return view.belief.pose.pose.error_to(truth)[0]


def test_a_drive_without_odometry_keeps_its_pose_by_ego_motion(ssl_field, paper_camera, eye, world):
    assert blind_drive(ssl_field, paper_camera, eye, world, ViewMotion()) < 0.04


def test_a_drive_without_odometry_and_ego_motion_loses_its_pose(ssl_field, paper_camera, eye, world):
    assert blind_drive(ssl_field, paper_camera, eye, world, None) > 0.1


@pytest.mark.parametrize("steps", [1, 2])
def test_ego_motion_corrects_wheels_that_slip(ssl_field, paper_camera, eye, world, steps):
    """Whether odometry comes with the frame, or at a control step before it."""
    alone, fused = (
        blind_drive(ssl_field, paper_camera, eye, world, ego_motion, 1.1, steps) for ego_motion in (None, ViewMotion())
    )
    assert fused < 0.5 * alone


def test_forgetting_begins_the_ego_motion_anew(ssl_field, paper_camera, eye, world):
    memory = Memory(ssl_field, ego_motion=ViewMotion())
    vision = Vision(ssl_field, paper_camera, memory=memory)
    frame = np.array(eye.render(world.state, 0))
    vision.look(frame, 1.0)
    with pytest.raises(ArgumentError, match="later than that of the view before"):
        vision.look(frame, 0.5)
    vision.predict(_NOWHERE, 2.0)
    with pytest.raises(ArgumentError, match=r"no frame may be older than the last predict: got 1\.5 s after 2\.0 s"):
        vision.look(frame, 1.5)
    vision.forget()
    assert vision.look(frame, 0.5).belief.pose


def test_ego_motion_needs_a_mirror_camera_and_predictions_by_view_need_ego_motion(ssl_field, paper_camera, eye, world):
    camera = load_camera(ROOT / "images" / "goal_four_legged" / "camera.toml")
    with pytest.raises(ArgumentError, match="ego_motion needs a mirror camera"):
        Vision(ssl_field, camera, memory=Memory(ssl_field, ego_motion=ViewMotion()))
    view = drive(Vision(ssl_field, paper_camera), eye, world, 1)
    with pytest.raises(ArgumentError, match="needs a memory with ego_motion"):
        Memory(ssl_field).predict_by_view(view)
    with pytest.raises(ArgumentError, match="hand t_s to look"):
        Memory(ssl_field, ego_motion=ViewMotion()).predict_by_view(dataclasses.replace(view, t_s=None))


@pytest.mark.parametrize("ego_motion", [None, ViewMotion])
def test_one_glitch_of_the_odometry_does_not_move_the_belief(ssl_field, paper_camera, eye, world, ego_motion):
    memory = Memory(ssl_field, ego_motion=None if ego_motion is None else ego_motion())
    vision = Vision(ssl_field, paper_camera, memory=memory)
    drive(vision, eye, world, 8)
    for period in range(4):
        odometry = Pose2(3.0, 0.0, 0.0) if period == 0 else world.odometry(0)
        belief = vision.look(np.array(eye.render(world.state, 0)), world.state.t_s, odometry).belief
        assert belief.pose.pose.error_to(world.state.robots[0].pose)[0] < 0.03
        assert ssl_field.is_on_floor(belief.pose.pose.x_m, belief.pose.pose.y_m)
        world.step({})


def test_the_limits_of_the_robot_say_what_a_glitch_is(ssl_field):
    limits = MotionLimits(speed_mps=0.4, acceleration_mps2=1.0)
    memory = Memory(ssl_field, limits=limits)
    memory.predict(_NOWHERE, 0.0)
    assert memory.can_move(Pose2(0.02, 0.0, 0.0), 1 / 30)
    assert not memory.can_move(Pose2(0.1, 0.0, 0.0), 1 / 30)
    assert Memory.of_everything(ssl_field, limits=limits).poses.settings == memory.poses.settings
    with pytest.raises(ArgumentError, match="leave out poses or limits"):
        Memory(ssl_field, poses=PoseFilter(), limits=limits)


def test_how_frames_err_is_chosen_by_the_camera_unless_it_is_said():
    own = FrameErrors(bias_ratio=0.1)
    for name, by_kind in (("ssl_mirror", FrameErrors()), ("ssl_forward", FORWARD_FRAME_ERRORS)):
        camera = load_camera(ROOT / "field_models" / "cameras" / f"{name}.toml")
        memories = (
            Memory("ssl_division_b"),
            Memory("ssl_division_b", settings=MemorySettings(frames=own)),
            Memory("ssl_division_b", poses=PoseFilter(frames=own)),
        )
        for memory, wanted in zip(memories, (by_kind, own, own), strict=True):
            Vision("ssl_division_b", camera, memory=memory)
            assert memory.poses.frame_errors == wanted
