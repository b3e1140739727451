"""Settings refuse what is no number, negative or beyond a bound, by an error that names it."""

from __future__ import annotations

import math
from dataclasses import fields, replace
from typing import Any

import pytest

from field_models.errors import ArgumentError
from robocup_vision.avoidance.steering import SteeringSettings
from robocup_vision.live.handover.page_settings import FeedSettings
from robocup_vision.localization.filter.errors import FrameErrors, OdometryNoise
from robocup_vision.localization.filter.settings import PoseFilterSettings
from robocup_vision.mapping.ego_motion import EgoMotionSettings
from robocup_vision.mapping.occupancy import FreeSpaceMapSettings
from robocup_vision.mapping.view_motion import ViewMotionSettings
from robocup_vision.memory import MemorySettings
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.planning.gaps.gap_choice import WidthSensor
from robocup_vision.planning.gaps.gate_planner import GatePlannerSettings
from robocup_vision.planning.gaze.pose_gaze import Neck, PoseGazeSettings
from robocup_vision.recording.call_writer import RecorderSettings
from robocup_vision.tracking import MovingObjectsSettings
from sim2d.rendering.random_scenes import Condition
from sim2d.rendering.sensor import Sensor
from sim2d.sensors.faults import LatencySettings
from sim2d.sensors.range_sensor import RangeSensor
from sim2d.sensors.team_channel import ChannelSettings

CHECKED = (
    SteeringSettings(), FeedSettings(), FrameErrors(), OdometryNoise(), PoseFilterSettings(), EgoMotionSettings(),
    FreeSpaceMapSettings(), ViewMotionSettings(), MemorySettings(), MotionLimits(0.4, 0.3), WidthSensor(),
    GatePlannerSettings(), Neck(), PoseGazeSettings(), RecorderSettings(), MovingObjectsSettings(),
    Sensor(), RangeSensor(), ChannelSettings(),
)  # fmt: skip
MAY_BE_NEGATIVE = {"first_log_odds", "confirmed_log_odds", "deleted_log_odds"}

BEYOND = (
    (SteeringSettings, {"directions": 3}),
    (FeedSettings, {"jpeg_quality": 101}),
    (FrameErrors, {"bias_ratio": 1.0}),
    (FrameErrors, {"bias_distance_m": 0.0}),
    (FrameErrors, {"bias_turn_rad": 0.0}),
    (FrameErrors, {"outlier_rate": 0.0}),
    (FrameErrors, {"half_error_rate": 0.5}),
    (OdometryNoise, {"slip_ratio": math.inf}),
    (PoseFilterSettings, {"gate": 0.0}),
    (PoseFilterSettings, {"min_probability": 1.0}),
    (PoseFilterSettings, {"max_half_odds": 0.5}),
    (EgoMotionSettings, {"spacing_s": math.inf}),
    (FreeSpaceMapSettings, {"cells": 2}),
    (FreeSpaceMapSettings, {"cell_m": 0.0}),
    (FreeSpaceMapSettings, {"free_below": 0.6}),
    (FreeSpaceMapSettings, {"clip": 0.2}),
    (ViewMotionSettings, {"edge_std_px": 0.0}),
    (GatePlannerSettings, {"confirmed": 1.0}),
    (PoseGazeSettings, {"criterion": "best"}),
    (PoseGazeSettings, {"horizon_s": 0.01}),
    (RecorderSettings, {"image_format": "gif"}),
    (RecorderSettings, {"compression": "gzip"}),
    (RecorderSettings, {"when_full": "block"}),
    (MovingObjectsSettings, {"detection_probability": 1.0}),
    (Sensor, {"bloom": 1.1}),
    (Sensor, {"vignette": 1.5}),
    (Sensor, {"cast_bgr": (1.0, -1.0, 1.0)}),
    (Sensor, {"jpeg_quality": 0}),
    (Condition, {"obstacles": (3, 1)}),
    (Condition, {"ball_rate": 1.1}),
    (Condition, {"texture": -0.1}),
    (LatencySettings, {"min_s": 0.1}),
    (LatencySettings, {"max_s": 2.0}),
    (LatencySettings, {"lost_ratio": 1.5}),
    (RangeSensor, {"beams": 2}),
    (RangeSensor, {"dropout_rate": 1.0}),
    (ChannelSettings, {"loss_ratio": 1.1}),
    (ChannelSettings, {"min_delay_s": 0.2}),
    (ChannelSettings, {"max_delay_s": 11.0}),
)


@pytest.mark.parametrize("settings", CHECKED, ids=lambda settings: type(settings).__name__)
def test_no_number_is_negative_or_none(settings: Any) -> None:
    for name in {field.name for field in fields(settings)} - MAY_BE_NEGATIVE:
        usual = getattr(settings, name)
        wrong = {float: (-1.0, math.nan), int: (-1,)}.get(type(usual), ())
        for value in wrong:
            with pytest.raises(ArgumentError, match=name):
                replace(settings, **{name: value})


@pytest.mark.parametrize(("kind", "wrong"), BEYOND, ids=lambda value: getattr(value, "__name__", None))
def test_what_is_beyond_a_bound_is_named(kind: type, wrong: dict[str, Any]) -> None:
    with pytest.raises(ArgumentError, match=next(iter(wrong))):
        kind(**wrong)


def test_the_log_odds_of_tracks_are_in_order() -> None:
    with pytest.raises(ArgumentError, match="log-odds must be deleted <= first < confirmed"):
        MovingObjectsSettings(confirmed_log_odds=-3.0)
