"""What is counted of one robot, on courses of beliefs and truths made by hand."""

import math

import numpy as np
import pytest

from robocup_vision.calibration.online import OnlineState
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from sim2d.report.robot_figures import CalibrationFigures, RobotLog
from sim2d.robot_link import Command
from sim2d.sensors.faults import BodyFault, SenseFault

PERIOD_S = 1 / 30
PLACE = Pose2(0.4, -0.2, 0.3)
NOWHERE = NotLocated("asleep")
AHEAD = Command(forward_mps=0.2)


def believe(pose):
    return PoseEstimate(pose, np.eye(3) * 1e-4, 1.0, 0.0)


def off_by(x_m, theta_rad=0.0):
    return believe(PLACE.compose(Pose2(x_m, 0.0, theta_rad)))


def log_of(periods, faults=()):
    """Log (truth, belief, command) triples, one a control period."""
    log = RobotLog(0, 1, 0, 1.2, faults)
    for index, (truth, belief, command) in enumerate(periods):
        log.add(index * PERIOD_S, truth, belief, command, index % 4 == 0)
    return log


def test_errors_are_of_estimated_poses_and_ratios_of_all_frames():
    beliefs = [off_by(0.01)] * 40 + [off_by(0.07)] * 20 + [off_by(0.2)] * 20 + [NOWHERE] * 20
    figures = log_of([(PLACE, belief, Command()) for belief in beliefs]).figures
    assert figures.frames == 100
    assert figures.within_5cm_3deg == pytest.approx(0.4)
    assert figures.lost_ratio == pytest.approx(0.4)
    assert figures.longest_lost_s == pytest.approx(40 * PERIOD_S)
    assert figures.median_error_m == pytest.approx(0.04, abs=0.031)
    assert figures.p95_error_m == pytest.approx(0.2)
    assert figures.possession == pytest.approx(0.25)


@pytest.mark.parametrize(("degrees", "near", "lost"), [(2.0, 1.0, 0.0), (4.0, 0.0, 0.0), (6.0, 0.0, 1.0)])
def test_headings_count_like_places(degrees, near, lost):
    figures = log_of([(PLACE, off_by(0.0, math.radians(degrees)), Command())] * 3).figures
    assert (figures.within_5cm_3deg, figures.lost_ratio) == (near, lost)
    assert figures.median_error_rad == pytest.approx(math.radians(degrees), rel=1e-5)


def test_the_half_of_the_field_counts_after_two_seconds():
    wrong, right = believe(PLACE.half_turn()), believe(PLACE)
    figures = log_of([(PLACE, wrong, Command())] * 60 + [(PLACE, right, Command())] * 30).figures
    assert figures.right_half_ratio == 1.0
    figures = log_of([(PLACE, right, Command())] * 60 + [(PLACE, wrong, Command())] * 30).figures
    assert figures.right_half_ratio == 0.0
    assert log_of([(PLACE, right, Command())] * 60).figures.right_half_ratio is None


def standing(seconds, command):
    return [(PLACE, NOWHERE, command)] * round(seconds / PERIOD_S)


def test_a_robot_that_pushes_in_vain_is_stuck():
    assert log_of(standing(8.0, AHEAD)).figures.longest_stuck_s == pytest.approx(8.0, abs=2 * PERIOD_S)
    assert log_of(standing(4.9, AHEAD)).figures.longest_stuck_s == 0.0


def test_a_robot_that_dithers_is_stuck():
    forth_and_back = standing(0.2, AHEAD) + standing(0.2, Command(left_mps=-0.2))
    assert log_of(forth_and_back * 16).figures.longest_stuck_s == pytest.approx(6.4, abs=2 * PERIOD_S)


def test_a_robot_that_waits_or_drives_is_not_stuck():
    twitching = standing(2.0, Command(forward_mps=0.04)) + standing(1.0, AHEAD)
    driving = [(Pose2(0.2 * index * PERIOD_S, 0.0, 0.0), NOWHERE, AHEAD) for index in range(300)]
    turning = standing(9.0, Command(turn_rps=3.0))
    # a keeper that sways as it is told
    swaying = [
        (Pose2(0.0, 0.08 * math.sin(k * PERIOD_S), 0.0), NOWHERE, Command(left_mps=0.08 * math.cos(k * PERIOD_S)))
        for k in range(300)
    ]
    for periods in (standing(9.0, Command()), twitching * 4, driving, turning, swaying):
        assert log_of(periods).figures.longest_stuck_s == 0.0


@pytest.mark.parametrize("fault", [BodyFault(0, 1.0, turn_rad=1.0), SenseFault(0, "black", 0.5, 1.0)])
def test_a_fault_is_over_once_the_belief_stays_right(fault):
    right, wrong = off_by(0.0), off_by(0.3)
    # wrong, right for a moment, wrong again, right for good from 1.8 s on
    beliefs = [right] * 30 + [wrong] * 12 + [right] * 6 + [wrong] * 6 + [right] * 30
    log = log_of([(PLACE, belief, Command()) for belief in beliefs], [fault])
    assert log.fault_figures[0].recovery_s == pytest.approx(0.8)
    assert (log.fault_figures[0].from_s, log.fault_figures[0].until_s) == (fault.from_s, 1.0)
    early = log_of([(PLACE, belief, Command()) for belief in beliefs[:60]], [fault])
    assert early.fault_figures[0].recovery_s is None


def test_nothing_seen_is_nothing_claimed():
    figures = RobotLog(2, -1, 0, 1.2).figures
    assert (figures.frames, figures.median_error_m, figures.right_half_ratio) == (0, None, None)
    assert figures.within_5cm_3deg == figures.lost_ratio == figures.possession == 0.0


def test_a_player_s_camera_is_kept_every_five_seconds():
    log = log_of([])
    state = OnlineState((100.0, 80.0), (-0.2, 0.01), (0.5, 0.6), (0.01, 0.02), 1.01, 0.003, 2.0, 0.02, False, 3, 1)
    for index in range(round(11.0 / PERIOD_S)):
        log.add_calibration(index * PERIOD_S, state)
    kept = log.figures.calibration
    assert [one.t_s for one in kept] == pytest.approx([0.0, 5.0, 10.0])
    assert kept[0] == CalibrationFigures(0.0, (100.0, 80.0), (-0.2, 0.01), (0.5, 0.6), (0.01, 0.02), 1.01, 0.003, 3, 1)


def test_a_player_that_does_not_calibrate_has_no_camera_to_tell_of():
    log = log_of([])
    log.add_calibration(0.0, None)
    assert log.figures.calibration == ()
