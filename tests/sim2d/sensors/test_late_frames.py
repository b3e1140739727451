"""Frames come late within bounds, in order, and some never."""

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from sim2d.rendering.scene import Light
from sim2d.robot_link import CONTROL_PERIOD_S, Senses
from sim2d.sensors.faults import LateFrames, LatencySettings
from sim2d.sensors.match_camera import LightDrift, LightDriftSettings

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


@pytest.mark.parametrize("wrong", [{"min_s": 0.1}, {"max_s": 2.0}, {"lost_ratio": 1.5}])
def test_latency_that_cannot_be_is_refused(wrong):
    with pytest.raises(ArgumentError, match="must be within"):
        LatencySettings(**wrong)


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
