"""Where to look, which gap to take, how fast to go: from what is believed of opponents, floor and pose."""

from robocup_vision.planning.gap import Disc, Gap, WidthSensor, gap_between
from robocup_vision.planning.gaps import GatePlan, GatePlanner
from robocup_vision.planning.motion_limits import MotionLimits
from robocup_vision.planning.path_follower import PathFollower
from robocup_vision.planning.speed import PoseNoise, SpeedPlan, SpeedPlanner

__all__ = [
    "Disc",
    "Gap",
    "GatePlan",
    "GatePlanner",
    "MotionLimits",
    "PathFollower",
    "PoseNoise",
    "SpeedPlan",
    "SpeedPlanner",
    "WidthSensor",
    "gap_between",
]
