"""Estimates over several frames: the robot's own motion, and a map of the free floor."""

from robocup_vision.mapping.ego_motion import EgoMotion, EgoMotionSettings, Motion
from robocup_vision.mapping.occupancy import FreeSpaceMap, FreeSpaceMapSettings
from robocup_vision.mapping.range_profile import RangeProfile, floor_profile
from robocup_vision.mapping.view_motion import ViewMotion, ViewMotionSettings

__all__ = [
    "EgoMotion",
    "EgoMotionSettings",
    "FreeSpaceMap",
    "FreeSpaceMapSettings",
    "Motion",
    "RangeProfile",
    "ViewMotion",
    "ViewMotionSettings",
    "floor_profile",
]
