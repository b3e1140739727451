"""Realism of the simulated vision and radio: none, or as teams expect of a realistic simulator."""

from __future__ import annotations

import dataclasses
import math
import re
from dataclasses import dataclass

from field_models.errors import ArgumentError
from robocup_vision.ssl.log import NS_PER_S
from robocup_vision.ssl.values.simulation import ErForceRealism

MAX_CAMERAS = 16
# fields of the message that correspond to ours: their name, ours, their units per unit of ours, largest value of ours
_FIELDS = (
    ("ball_std_m", "ball_std_m", 1.0, 1.0),
    ("robot_std_m", "robot_std_m", 1.0, 1.0),
    ("robot_std_rad", "robot_std_rad", 1.0, math.pi),
    ("ball_area_std_px", "ball_area_std_px", 1.0, 1e4),
    ("ball_visibility_threshold", "min_visible_ratio", 1.0, 1.0),
    ("camera_overlap_m", "camera_overlap_m", 1.0, 10.0),
    ("camera_position_error_m", "camera_position_std_m", 1.0, 1.0),
    ("robot_command_loss", "command_loss", 1.0, 1.0),
    ("robot_response_loss", "response_loss", 1.0, 1.0),
    ("missing_ball_detections", "missing_ball_ratio", 1.0, 1.0),
    ("vision_delay_ns", "vision_delay_s", NS_PER_S, 1.0),
    ("vision_processing_ns", "processing_s", NS_PER_S, 1.0),
)
UNSUPPORTED = ("dribbler_ball_detections", "simulate_dribbling")


@dataclass(frozen=True, slots=True)
class Realism:
    """Errors of vision and radio; by default there are none."""

    #: Standard deviations of a detection, per axis.
    ball_std_m: float = 0.0
    robot_std_m: float = 0.0
    robot_std_rad: float = 0.0
    #: Standard deviation of the ball's area.
    ball_area_std_px: float = 0.0
    #: Fraction of the ball's detections that are missing.
    missing_ball_ratio: float = 0.0
    #: Whether robots hide the ball from cameras.
    hides_ball: bool = False
    #: Smallest visible fraction of the ball's area with which it is found.
    min_visible_ratio: float = 0.4
    #: Whether a flying ball is reported where its ray meets the floor, without a height; else at its true place.
    floor_rays: bool = False
    #: Whether the ball is found in each camera's image, at the middle of the pixels that robots leave visible.
    finds_ball_in_images: bool = False
    #: Standard deviations of each camera's true mounting about its calibration, per axis.
    camera_position_std_m: float = 0.0
    camera_rotation_std_rad: float = 0.0
    #: Number of cameras along x and along y.
    camera_columns: int = 1
    camera_rows: int = 1
    #: Width of the strip that two neighbouring cameras both see.
    camera_overlap_m: float = 0.0
    #: Time from exposure to reception.
    vision_delay_s: float = 0.0
    #: Part of it from exposure to `t_sent`.
    processing_s: float = 0.0
    #: Fractions of the robots' commands and responses that are lost.
    command_loss: float = 0.0
    response_loss: float = 0.0


_RC2021 = Realism(
    ball_std_m=0.0010,
    robot_std_m=0.0013,
    robot_std_rad=0.01,
    ball_area_std_px=6.0,
    missing_ball_ratio=0.05,
    hides_ball=True,
    floor_rays=True,
    camera_columns=2,
    camera_rows=2,
    camera_overlap_m=1.0,
    vision_delay_s=0.035,
    processing_s=0.010,
    command_loss=0.03,
    response_loss=0.10,
)
REALISMS = {
    "none": Realism(),
    "rc2021": _RC2021,
    # the ball is found in images; noise as in the league, calibrated to about a centimetre at the field's border
    "cameras": dataclasses.replace(
        _RC2021,
        ball_std_m=0.0005,
        ball_area_std_px=0.0,
        missing_ball_ratio=0.0,
        min_visible_ratio=0.25,
        finds_ball_in_images=True,
        camera_position_std_m=0.01,
        camera_rotation_std_rad=0.001,
        command_loss=0.0,
        response_loss=0.0,
    ),
}


def realism_named(name: str, cameras: str | None = None) -> Realism:
    """Return the realism with a name; raises `ArgumentError` if it is unknown, or `cameras` is not valid.

    Parameters
    ----------
    cameras : str, optional
        Number of cameras along x and along y, e.g. ``4x2``; default: as in the realism.
    """
    if name not in REALISMS:
        raise ArgumentError(f"there is no realism {name!r}, only {', '.join(REALISMS)}")
    realism = REALISMS[name]
    if cameras is None:
        return realism
    match = re.fullmatch(r"([1-9]\d?)x([1-9]\d?)", cameras)
    columns, rows = map(int, match.groups()) if match else (0, 0)
    if not 1 <= columns * rows <= MAX_CAMERAS:
        raise ArgumentError(f"cameras are given as 4x2, at most {MAX_CAMERAS} of them, got {cameras!r}")
    return dataclasses.replace(realism, camera_columns=columns, camera_rows=rows)


def changed_realism(realism: Realism, message: ErForceRealism) -> Realism:
    """Return a realism with the changes of a message; raises `ArgumentError` for numbers out of range."""
    changes: dict[str, float | bool] = {}
    for theirs, ours, per_unit, largest in _FIELDS:
        value = getattr(message, theirs)
        if value is None:
            continue
        if not 0 <= value / per_unit <= largest:
            raise ArgumentError(f"{theirs} must be from 0 to {largest * per_unit:g}, got {value}")
        changes[ours] = value / per_unit
    if message.enable_invisible_ball is not None:
        changes["hides_ball"] = message.enable_invisible_ball
    return dataclasses.replace(realism, **changes)  # type: ignore[arg-type]
