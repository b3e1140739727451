"""Calibration of cameras while a robot plays; the module `calibration` explains the method."""

from robocup_vision.calibration.online.calibration import OnlineCalibration, OnlineState
from robocup_vision.calibration.online.settings import OnlineSettings

__all__ = ["OnlineCalibration", "OnlineSettings", "OnlineState"]
