"""Calibration while a robot plays; see `calibration` for how."""

from robocup_vision.calibration.online.calibration import OnlineCalibration, OnlineState
from robocup_vision.calibration.online.settings import OnlineSettings

__all__ = ["OnlineCalibration", "OnlineSettings", "OnlineState"]
