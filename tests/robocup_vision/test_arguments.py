"""Misuse of the public objects ends in one line that says what belongs there, never in an AttributeError."""

import math

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.avoidance.steering import Steering
from robocup_vision.avoidance.wayfinder import Wayfinder
from robocup_vision.camera import load_camera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.pose_filter import PoseFilter
from robocup_vision.memory import Memory
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.perception.color_table import load_colors
from robocup_vision.vision import Vision

NAN_POSE = Pose2(math.nan, 0.0, 0.0)
LIMITS = MotionLimits(0.4, 0.3)


@pytest.fixture(scope="module")
def vision(ssl_field, paper_camera):
    return Vision(ssl_field, paper_camera, memory=Memory(ssl_field))


@pytest.fixture(scope="module")
def plain(ssl_field, paper_camera):
    return Vision(ssl_field, paper_camera)


@pytest.fixture(scope="module")
def view(plain, nominal_samples):
    return plain.look(nominal_samples[0].frame)


def test_the_name_of_a_field_serves_for_it(paper_camera):
    assert Vision("ssl_2001", paper_camera).field.name == "ssl_2001"
    assert Memory("ssl_2001").field.name == "ssl_2001"
    assert Memory.of_everything("ssl_2001").field.name == "ssl_2001"
    field = load_field("msl_6x4")
    assert load_field(field) is field
    with pytest.raises(ArgumentError, match=r"field 'ssl_2002' is neither a \.toml file nor one of: four_legged_2005"):
        Vision("ssl_2002", paper_camera)


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        (("camera", "field"), {}, "field must be a Field, or the name or file of one, got a value of type OmniCamera"),
        (("field", "field"), {}, r"camera must be what load_camera\(path\) returns, got a value of type Field"),
        (("field", None), {}, r"camera must be what load_camera\(path\) returns, got NoneType None"),
        ((3, "camera"), {}, "field must be a Field, or the name or file of one, got int 3"),
        (("field", "camera", "camera"), {}, r"colors must be what load_colors\(path\) returns, got OmniCamera"),
        (("field", "camera"), {"memory": True}, r"memory must be a Memory\(field\), got bool"),
        (("field", "camera"), {"directions": 10**9}, "directions must be at most 3600, got 1000"),
        (("field", "camera"), {"directions": 80.5}, "directions must be a whole number, got float 80.5"),
        (("field", "camera"), {"rings": 0}, "rings must be at least 1, got 0"),
        (("field", "camera"), {"online": 3}, "online must be made for this very camera"),
        (("field", "camera"), {"method": 7}, "method must be 'field', 'floor' or 'hull' for a mirror camera, got 7"),
    ],
)
def test_vision_is_made_of_what_belongs_there(ssl_field, paper_camera, arguments, options, message):
    named = {"field": ssl_field, "camera": paper_camera}
    with pytest.raises(ArgumentError, match=message):
        Vision(*(named.get(value, value) if isinstance(value, str) else value for value in arguments), **options)


def test_memory_of_another_field_is_refused(ssl_field, paper_camera):
    with pytest.raises(ArgumentError, match="memory is of field 'msl_6x4', this Vision of 'ssl_2001'"):
        Vision(ssl_field, paper_camera, memory=Memory(load_field("msl_6x4")))
    assert Vision(ssl_field, paper_camera, memory=Memory(load_field("ssl_2001"))).memory is not None


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"odometry": (0.1, 0.0, 0.0)}, r"odometry must be a Pose2\(x_m, y_m, theta_rad\), got tuple \(0.1"),
        ({"odometry": NAN_POSE}, "odometry must be finite, got Pose2"),
        ({"odometry": Pose2(0.0, None, 0.0)}, "odometry must be finite, got Pose2"),
        ({"prior": [0.0, 0.0, 0.0]}, r"prior must be a Pose2\(x_m, y_m, theta_rad\), got list"),
        ({"odometry": Pose2(1e9, 0.0, 0.0)}, "odometry must be in metres, within 100 m"),
        ({"prior": Pose2(-1250.0, 300.0, 0.0)}, "prior must be in metres, within 100 m"),
        ({"pan_rad": -30.0}, "pan_rad must be in radians, within one turn, got -30.0; -30 degrees are -0.5236 rad"),
        ({"prior": NAN_POSE}, "prior must be finite"),
        ({"prior": PoseEstimate(NAN_POSE, np.eye(3), 1.0, 0.0)}, "prior must be finite"),
        ({"prior": PoseEstimate(Pose2(0, 0, 0), np.full((3, 3), np.nan), 1.0, 0.0)}, "covariance must be finite"),
        ({"t_s": math.nan}, "t_s must be finite, got nan"),
        ({"t_s": "1.0"}, "t_s must be a number, got str '1.0'"),
        ({"t_s": math.inf}, "t_s must be finite, got inf"),
        ({"t_s": 1e308}, r"t_s must be in seconds, at most 1e\+12, got 1e\+308"),
        ({"pan_rad": math.nan}, "pan_rad must be finite, got nan"),
    ],
)
def test_looks_take_poses_and_times(vision, plain, nominal_samples, options, message):
    for one in (vision, plain):
        with pytest.raises(ArgumentError, match=message):
            one.look(nominal_samples[0].frame, **{"t_s": 1.0, **options})


def test_what_is_not_located_is_no_prior(plain, nominal_samples):
    assert plain.look(nominal_samples[0].frame, prior=NotLocated("lost")).pose


def test_predictions_take_poses_and_times(vision):
    with pytest.raises(ArgumentError, match="odometry must be a Pose2"):
        vision.predict((0.0, 0.0, 0.0), 1.0)
    with pytest.raises(ArgumentError, match="t_s must be a number, got NoneType None"):
        vision.predict(Pose2(0, 0, 0), None)
    with pytest.raises(ArgumentError, match="odometry must be a Pose2"):
        PoseFilter().predict((0.0, 0.0, 0.0), 1.0)
    with pytest.raises(ArgumentError, match="pose must be a Pose2"):
        PoseFilter().expect((0.0, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="update takes a PoseEstimate or NotLocated, got Pose2"):
        PoseFilter().update(Pose2(0, 0, 0), 1.0)
    with pytest.raises(ArgumentError, match="update takes the view of a frame, got PoseEstimate"):
        Memory("ssl_2001").update(PoseEstimate(Pose2(0, 0, 0), np.eye(3), 1.0, 0.0))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"free_space": "view"}, r"must be the free space of a view, view\.free_space, got View"),
        ({"free_space": None}, "free_space must be the free space of a view, bearing_rad and range_m, got NoneType"),
        ({"velocity_mps": (400.0, 0.0)}, "velocity_mps must be at most 100 m/s long"),
        ({"target_bearing_rad": None}, "target_bearing_rad must be a number, got NoneType None"),
        ({"target_distance_m": "far"}, "target_distance_m must be a number, got 'far'"),
        ({"moving": [(1.0, 0.0)]}, "moving must be a sequence of Disc"),
        ({"moving": None}, "moving must be a sequence of Disc"),
        ({"speed_mps": math.nan}, "speed_mps must be positive, got nan"),
    ],
)
def test_steering_takes_free_space_and_numbers(view, changes, message):
    given = {"free_space": view.free_space, "velocity_mps": (0.0, 0.0), "target_bearing_rad": 0.0, **changes}
    if isinstance(given["free_space"], str):
        given["free_space"] = view
    with pytest.raises(ArgumentError, match=message):
        Steering(0.09, LIMITS).steer(**given)


def test_memories_are_made_of_what_belongs_there():
    with pytest.raises(ArgumentError, match=r"limits must be MotionLimits\(speed_mps, ...\), got float"):
        Memory("ssl_2001", limits=0.4)
    with pytest.raises(ArgumentError, match=r"ego_motion must be a ViewMotion\(\), got bool"):
        Memory("ssl_2001", ego_motion=True)


@pytest.mark.parametrize("value", ["0.4", None, True])
def test_limits_are_numbers(value):
    with pytest.raises(ArgumentError, match="acceleration_mps2 must be a number, got "):
        MotionLimits(0.4, value)


def test_what_steers_is_made_of_what_belongs_there(view):
    with pytest.raises(ArgumentError, match=r"limits must be MotionLimits\(speed_mps, ...\), got float"):
        Steering(0.09, 0.4)
    with pytest.raises(ArgumentError, match="robot_radius_m must be a number, got a value of type MotionLimits"):
        Steering(LIMITS, 0.09)
    with pytest.raises(ArgumentError, match=r"must be the free space of a view, view\.free_space, got View"):
        Wayfinder(0.09).update(view, Pose2(0, 0, 0))
    with pytest.raises(ArgumentError, match="motion must be a Pose2"):
        Wayfinder(0.09).update(view.free_space, (0.0, 0.0, 0.0))


@pytest.mark.parametrize("load", [load_camera, load_colors])
@pytest.mark.parametrize("path", [None, 3, b"camera.toml"])
def test_files_are_named_by_paths(load, path):
    with pytest.raises(RobocupVisionError, match="the path of a file must be a str or Path, got"):
        load(path)


@pytest.mark.parametrize("step", [Pose2(3.0, 0.0, 0.0), Pose2(0.0, 0.0, 2.5), Pose2(0.0, -900.0 / 10, 0.0)])
@pytest.mark.parametrize("remembers", [True, False])
def test_odometry_that_no_robot_can_do_is_told(ssl_field, paper_camera, nominal_samples, step, remembers):
    vision = Vision(ssl_field, paper_camera, memory=Memory(ssl_field) if remembers else None)
    frame = nominal_samples[0].frame
    still = vision.look(frame, 0.0)
    assert still.warnings == vision.look(frame, 0.04, odometry=Pose2(0.02, 0.0, 0.01)).warnings == ()
    view = vision.look(frame, 0.08, odometry=step)
    (warning,) = view.warnings
    assert "is not believed: no robot moves so fast" in warning
    assert f"{math.hypot(step.x_m, step.y_m):.3g} m and {step.theta_rad:.3g} rad at 0.08 s" in warning
    assert view.pose.pose.error_to(still.pose.pose, symmetric=True)[0] < 0.01
    assert vision.look(frame, 0.12, odometry=Pose2(0.0, 0.0, 0.0)).warnings == ()
    # in as much time it may have been
    assert vision.look(frame, 60.0, odometry=step).warnings == ()


def test_a_control_step_that_no_robot_can_do_is_told_by_the_next_view(ssl_field, paper_camera, nominal_samples):
    vision = Vision(ssl_field, paper_camera, memory=Memory(ssl_field))
    vision.look(nominal_samples[0].frame, 0.0)
    vision.predict(Pose2(3.0, 0.0, 0.0), 0.01)
    assert len(vision.look(None, 0.02).warnings) == 1
    assert vision.look(None, 0.03).warnings == ()
