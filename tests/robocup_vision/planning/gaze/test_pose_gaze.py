"""Gaze for the own pose: the paper's sum, what hides, what is out of reach, and when to sweep."""

import math

import numpy as np
import pytest
from hypothesis import given
from strategies import numbers

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.planning.gaze.pose_gaze import GOAL_DETECTORS, Detector, Neck, PoseGaze, PoseGazeSettings

FIELD = load_field("four_legged_2007")
CAMERA = PinholeCamera((208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, tilt_rad=-0.2, roll_rad=0.0)
NECK = Neck(1.4, 8.0)
SURE = 1e-10 * np.eye(2)


def _belief(x: float, y: float, theta: float, std: tuple[float, float, float] = (0.1, 0.1, 0.05)) -> PoseEstimate:
    return PoseEstimate(Pose2(x, y, theta), np.diag(np.square(std)), 1.0, 0.0)


def _bearing(belief: PoseEstimate, x: float, y: float) -> float:
    at = belief.pose.inverse().transform((x, y))
    return wrap_angle(math.atan2(at[1], at[0]))


def test_posts_alone_draw_the_head_to_the_near_goal() -> None:
    belief = _belief(1.0, 0.3, math.pi / 4)
    gaze = PoseGaze(FIELD, CAMERA, NECK, detectors=GOAL_DETECTORS).choose(belief, 0.0)
    left, right = (_bearing(belief, 2.7, y) for y in (0.45, -0.45))
    half_view = math.atan(104 / 192)
    assert gaze.planned
    assert abs(gaze.pan_rad - left) < half_view
    assert abs(gaze.pan_rad - right) < half_view
    # foot and top of both posts
    assert 2.5 < gaze.landmarks <= 4
    assert gaze.reason == f"{gaze.landmarks:.1f} landmarks there leave {gaze.position_std_m:.3f} m of 0.141 m"


def test_looks_away_from_what_is_hidden() -> None:
    # both goals lie within reach, the one at +x nearer
    belief = _belief(0.3, -1.5, math.pi / 2, (0.02, 0.02, 0.02))
    planner = PoseGaze(FIELD, CAMERA, NECK, detectors=GOAL_DETECTORS)
    assert planner.choose(belief, 0.0).pan_rad < 0
    walls = [
        Disc(*(np.array([0.3, -1.5]) * 0.6 + np.array([2.7, y]) * 0.4), 0.3, SURE, height_m=1.0) for y in (0.45, -0.45)
    ]
    hidden = planner.choose(belief, 0.0, blockers=walls)
    assert hidden.planned
    assert hidden.pan_rad > 0


def test_plain_sum_of_information_without_neck_error() -> None:
    """The paper's formula: one landmark, one frame, a pose sure enough that it is in view or not."""
    detectors = {"beacon": Detector(1.0, 1.0, 2.0)}
    belief = _belief(0.6, 1.5, 0.0, (0.01, 0.01, 0.01))
    neck = Neck(0.9, 1e9, std_rad=0.0)
    planner = PoseGaze(FIELD, CAMERA, neck, detectors=detectors, settings=PoseGazeSettings(horizon_s=0.1, frame_s=0.1))
    gaze = planner.choose(belief, 0.0)
    way = np.array([1.35 - 0.6, 1.95 - 1.5])
    r2 = float(way @ way)
    information = np.linalg.inv(belief.covariance)
    for up in (-0.185, 0.4 - 0.185):
        pixel = CAMERA.ray_to_pixel([math.hypot(*way), 0.0, up])
        if not (0 <= pixel[1] <= 159):
            continue
        bearing = np.array([way[1] / r2, -way[0] / r2, -1.0])
        slope = up / (r2 + up**2) / math.sqrt(r2)
        elevation = np.array([slope * way[0], slope * way[1], 0.0])
        for row in (bearing, elevation):
            information += np.outer(row, row) * 192.0**2
    left = np.linalg.inv(information)
    assert gaze.position_std_m == pytest.approx(math.sqrt(left[0, 0] + left[1, 1]), rel=1e-6)


@given(numbers(-2.3, 2.3), numbers(-1.5, 1.5), numbers(-3.1, 3.1))
def test_laws_of_a_choice(x: float, y: float, theta: float) -> None:
    belief = _belief(x, y, theta)
    for criterion in ("position", "volume"):
        planner = PoseGaze(FIELD, CAMERA, NECK, settings=PoseGazeSettings(criterion=criterion))
        gaze = planner.choose(belief, 0.0, blockers=[Disc(1.0, 0.0, 0.15, 0.01 * np.eye(2), height_m=0.28)])
        assert abs(gaze.pan_rad) <= NECK.limit_rad
        if gaze.planned:
            assert gaze.position_std_m <= math.sqrt(0.02) + 1e-9
        # the field turned by half a turn looks the same
        turned = planner.choose(
            belief.half_turn(), 0.0, blockers=[Disc(-1.0, 0.0, 0.15, 0.01 * np.eye(2), height_m=0.28)]
        )
        assert turned.position_std_m == pytest.approx(gaze.position_std_m, rel=1e-6)


def test_far_pans_leave_time_for_fewer_frames() -> None:
    belief = _belief(0.0, 0.0, math.pi / 2)  # a goal on either side
    planner = PoseGaze(FIELD, CAMERA, Neck(1.57, 2.0), detectors=GOAL_DETECTORS)
    assert planner.choose(belief, 0.0, pan_rad=1.2).pan_rad > 0
    assert planner.choose(belief, 0.0, pan_rad=-1.2).pan_rad < 0


def test_sweeps_after_two_misses_until_something_is_seen() -> None:
    belief = _belief(1.0, 0.0, 0.0)
    planner = PoseGaze(FIELD, CAMERA, NECK)
    planner.observe(False, 0.0)  # before any plan: no miss
    wanted = planner.choose(belief, 0.2).pan_rad
    for _ in range(5):
        planner.observe(False, wanted + 0.5)  # on the way
    planner.observe(False, wanted)
    assert planner.choose(belief, 0.2).planned
    planner.observe(False, wanted)
    swept = planner.choose(belief, 0.2)
    assert not swept.planned
    assert swept.pan_rad == NECK.sweep(0.2)
    assert swept.reason == "sweep: 2 frames in a row had no pose"
    planner.observe(False, wanted)  # of a sweep nothing was expected
    assert planner.choose(belief, 0.3).reason == "sweep: 2 frames in a row had no pose"
    planner.observe(True, 1.0)
    assert planner.choose(belief, 0.2).planned


def test_sweeps_without_a_pose_or_a_landmark() -> None:
    planner = PoseGaze(FIELD, CAMERA, NECK, detectors=GOAL_DETECTORS)
    assert planner.choose(NotLocated("fog"), 0.3).reason == "sweep: the pose is not known"
    away = planner.choose(_belief(-2.4, 1.6, math.pi, (0.01, 0.01, 0.01)), 0.3)
    assert away.planned or away.reason == "sweep: no landmark can be in view"
    blind = PoseGaze(load_field("msl_6x4"), CAMERA, NECK, detectors=GOAL_DETECTORS)
    assert blind.choose(_belief(0.0, 0.0, 0.0), 0.3).reason == "sweep: no landmark can be in view"


def test_sweep_swings_from_limit_to_limit() -> None:
    pans = [NECK.sweep(t) for t in np.linspace(0, 1.5, 301)]
    assert max(pans) == pytest.approx(1.4)
    assert min(pans) == pytest.approx(-1.4)
    assert pans[0] == pytest.approx(pans[-1], abs=1e-9)


def test_head_turns_no_faster_and_no_farther_than_it_can() -> None:
    assert NECK.turned(0.0, 0.1, 0.1) == pytest.approx(0.1)
    assert NECK.turned(0.0, 1.3, 0.1) == pytest.approx(0.8)
    assert NECK.turned(0.0, -1.3, 0.1) == pytest.approx(-0.8)
    assert NECK.turned(1.3, 9.0, 0.1) == pytest.approx(1.4)


def test_refuses_bad_values() -> None:
    planner = PoseGaze(FIELD, CAMERA, NECK)
    belief = _belief(0.0, 0.0, 0.0)
    with pytest.raises(ArgumentError, match="time and pan must be finite"):
        planner.choose(belief, math.nan)
    with pytest.raises(ArgumentError, match=r"drift must be a finite \(3, 3\) array"):
        planner.choose(belief, 0.0, drift=np.eye(2))
