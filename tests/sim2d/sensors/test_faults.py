"""Faults of senses and bodies, and frames that come late."""

import math
from dataclasses import replace

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from sim2d.match.match import Match
from sim2d.rendering.scene import Light
from sim2d.robot_link import CONTROL_PERIOD_S, Senses
from sim2d.sensors.faults import BodyFault, FaultySenses, LateFrames, LatencySettings, SenseFault
from sim2d.sensors.match_camera import LightDrift, LightDriftSettings

PERIOD_S = 1 / 30
STEP = Pose2(0.02, -0.01, 0.1)


def senses(index):
    frame = np.full((2, 2, 3), index % 255 + 1, dtype=np.uint8)
    return Senses(index * PERIOD_S, frame, index * PERIOD_S, STEP, False, "play", False, 0.01 * index)


def spoil(*faults, count=60):
    faulty = FaultySenses(faults, np.random.default_rng(3))
    return [faulty.apply(senses(index)) for index in range(count)]


def brightness(sensed):
    return [None if one.frame is None else int(one.frame[0, 0, 0]) for one in sensed]


def test_faults_spoil_the_frames_of_all_cameras():
    def with_rig(index):
        one = senses(index)
        return replace(one, rig_frames=(one.frame, None, one.frame + 1))

    def spoilt(kind):
        faulty = FaultySenses([SenseFault(0, kind, 0.5, amount=1.0)], np.random.default_rng(3))
        return [faulty.apply(with_rig(index)) for index in range(30)]

    black, frozen, dropped = spoilt("black")[-1], spoilt("frozen")[-1], spoilt("dropped")[-1]
    assert not black.rig_frames[0].any()
    assert black.rig_frames[1] is None
    assert not black.rig_frames[2].any()
    # the last that came before half a second
    assert int(frozen.rig_frames[2][0, 0, 0]) == int(frozen.frame[0, 0, 0]) + 1 < 20
    assert dropped.rig_frames is None


def test_frames_are_dropped_by_their_ratio_and_only_then():
    sensed = spoil(SenseFault(0, "dropped", 1.0, 11.0, 0.3), count=360)
    dropped = np.array([one.frame is None for one in sensed])
    assert not dropped[:30].any()
    assert not dropped[330:].any()
    assert dropped[30:330].mean() == pytest.approx(0.3, abs=0.08)
    assert all((one.frame is None) == (one.frame_t_s is None) for one in sensed)


def test_frames_come_late_with_the_time_they_were_taken():
    sensed = spoil(SenseFault(0, "delayed", 0.5, 1.0, 0.1))
    # at its beginning nothing new comes for as long as the delay, at its end all that waits but the newest is lost
    assert brightness(sensed)[:15] == list(range(1, 16))
    assert brightness(sensed)[15:18] == [None] * 3
    assert brightness(sensed)[18:30] == list(range(16, 28))
    assert brightness(sensed)[30:] == list(range(31, 61))
    for one in sensed[18:30]:
        assert one.t_s - one.frame_t_s == pytest.approx(0.1)


def test_a_frozen_camera_shows_its_last_good_frame_as_if_new():
    sensed = spoil(SenseFault(0, "frozen", 0.5, 1.0))
    assert brightness(sensed) == [*range(1, 16), *[15] * 15, *range(31, 61)]
    assert [one.frame_t_s for one in sensed] == [one.t_s for one in sensed]


def test_a_camera_frozen_from_the_start_shows_nothing():
    sensed = spoil(SenseFault(0, "frozen", 0.0, 0.1), count=4)
    assert brightness(sensed) == [None, None, None, 4]
    assert sensed[0].frame_t_s is None


def test_the_heads_pan_goes_with_the_frame():
    late = spoil(SenseFault(0, "delayed", 0.5, 1.0, 0.1))
    assert late[20].frame_pan_rad == pytest.approx(0.17)
    assert late[16].frame_pan_rad is None
    # of a frame that only seems new the joint is read anew
    assert spoil(SenseFault(0, "frozen", 0.5, 1.0))[20].frame_pan_rad == pytest.approx(0.2)
    both = spoil(SenseFault(0, "frozen", 0.5, 1.0), SenseFault(0, "delayed", 0.5, 1.0, 0.1))
    assert both[20].frame_pan_rad == pytest.approx(0.2)
    assert spoil(SenseFault(0, "dropped", amount=1.0))[3].frame_pan_rad is None


def test_black_frames_are_black():
    sensed = spoil(SenseFault(0, "black", 0.5, 1.0))
    assert brightness(sensed) == [*range(1, 16), *[0] * 15, *range(31, 61)]
    assert sensed[20].frame.shape == (2, 2, 3)


def test_odometry_errs_by_its_ratio():
    sensed = spoil(SenseFault(0, "odometry", 0.5, 1.0, -0.2))
    assert sensed[14].odometry == sensed[30].odometry == STEP
    assert sensed[20].odometry.array == pytest.approx(0.8 * STEP.array)


@pytest.mark.parametrize(
    ("make", "problem"),
    [
        (lambda: SenseFault(0, "blurred"), "one of dropped, delayed, frozen, black, odometry, got 'blurred'"),
        (lambda: SenseFault(0, "black", 2.0, 1.0), "must not end before it begins, got 2.0 to 1.0 s"),
        (lambda: SenseFault(0, "black", -1.0), "must not end before it begins, got -1.0 to inf s"),
        (lambda: SenseFault(0, "dropped", amount=1.3), "amount of 'dropped' must be within 0 to 1, got 1.3"),
        (lambda: SenseFault(0, "delayed", amount=math.nan), "amount of 'delayed' must be within 0 to 10, got nan"),
        (lambda: BodyFault(0, -1.0), "time must not be negative, got -1.0 s"),
    ],
)  # fmt: skip
def test_impossible_faults_are_refused(make, problem):
    with pytest.raises(ArgumentError, match=problem):
        make()


def test_body_faults_say_what_they_are():
    assert BodyFault(0, 1.0, push_m=(0.1, 0.0)).kind == "pushed"
    assert BodyFault(0, 1.0, turn_rad=0.5).kind == "turned"
    carried = BodyFault(0, 1.0, carry_to=Pose2(0.0, 0.0, 0.0))
    assert (carried.kind, carried.from_s, carried.until_s) == ("carried", 1.0, 1.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "fault",
    [
        SenseFault(0, "dropped", 1.0, 3.0, 0.3),
        SenseFault(0, "delayed", 1.0, 3.0, 0.1),
        SenseFault(0, "odometry", 1.0, 3.0, 0.2),
        BodyFault(0, 1.5, push_m=(0.1, 0.15)),
        BodyFault(0, 1.5, turn_rad=math.radians(60.0)),
        BodyFault(0, 1.5, carry_to=Pose2(-0.6, -0.5, 2.0)),
    ],
    ids=lambda fault: fault.kind,
)
def test_the_built_in_player_recovers_within_a_second(fault):
    """Only this finds a fault, or a hand, after which a player does not know its place within a second."""
    match = Match(load_field("ssl_2001"), 1, 11, faults=[fault])
    for _ in match.play(fault.until_s + 2.0):
        pass
    figures = match.figures
    assert figures.faults[0].kind == fault.kind
    assert figures.faults[0].recovery_s is not None
    assert figures.faults[0].recovery_s <= 1.0
    assert figures.robots[0].stopped_reason == ""
    if fault.kind in ("dropped", "delayed", "odometry"):
        assert figures.robots[0].lost_ratio == 0.0


FRAME = np.zeros((2, 2, 3), dtype=np.uint8)


def arrivals(settings, seed, count=400):
    """Return each period's time, and when its frame was exposed (None: no frame)."""
    late = LateFrames(settings, np.random.default_rng(seed))
    sensed = []
    for k in range(count):
        t_s = k * CONTROL_PERIOD_S
        sensed.append(late.apply(Senses(t_s, FRAME, t_s, Pose2(0, 0, 0), False, "play", False, 0.01 * k)))
    return sensed


@pytest.mark.parametrize("seed", range(4))
def test_frames_are_late_within_bounds_and_in_order(seed):
    settings = LatencySettings()
    came = [one for one in arrivals(settings, seed) if one.frame is not None]
    late = np.array([one.t_s - one.frame_t_s for one in came])
    assert (late >= settings.min_s).all()
    # a frame is handed on at the first control period after it came
    assert (late <= settings.max_s + CONTROL_PERIOD_S).all()
    assert (np.diff([one.frame_t_s for one in came]) > 0).all()
    for one in came:  # the pan is that of the exposure
        assert one.frame_pan_rad == pytest.approx(0.01 * one.frame_t_s / CONTROL_PERIOD_S)


def test_some_frames_never_come():
    steady = LatencySettings(0.03, 0.03, 0.0, lost_ratio=0.1)
    came = sum(one.frame is not None for one in arrivals(steady, 3, 1000))
    assert came == pytest.approx(900, abs=40)
    assert sum(one.frame is not None for one in arrivals(LatencySettings(0.03, 0.03, 0.0, 0.0), 3, 100)) == 99


def test_light_drifts_about_its_level_and_turns():
    settings = LightDriftSettings()
    drift = LightDrift(settings, Light(level=0.9, gradient=0.2), np.random.default_rng(0))
    lights = [drift.at(t) for t in np.arange(0.0, settings.level_period_s, 0.5)]
    levels = np.array([light.level for light in lights])
    assert levels.mean() == pytest.approx(0.9, abs=1e-3)
    assert levels.max() == pytest.approx(0.99, abs=1e-3)
    assert levels.min() == pytest.approx(0.81, abs=1e-3)
    assert lights[-1].gradient_direction_rad > lights[0].gradient_direction_rad
    assert all(light.gradient == 0.2 for light in lights)
