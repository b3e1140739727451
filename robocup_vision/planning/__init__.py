"""Where to look, which gap to take, how fast to go: from what is believed of opponents, floor and pose."""

from robocup_vision.disc import Disc
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.planning.gaps.gap import Gap, WidthSensor, gap_between
from robocup_vision.planning.gaps.gap_choice import GapChoice, PassageTimes, choose_gap
from robocup_vision.planning.gaps.gate_planner import GatePlan, GatePlanner
from robocup_vision.planning.gaze.goal_question import Fixation, GoalQuestion
from robocup_vision.planning.gaze.pose_gaze import GOAL_DETECTORS, Gaze, Neck, PoseGaze
from robocup_vision.planning.gaze.selective_look import SelectedLook, SelectiveLook
from robocup_vision.planning.shots.goal_cover import Cover, cover_goal
from robocup_vision.planning.shots.shot_planner import ShotPlan, ShotPlanner
from robocup_vision.planning.speed.path_follower import PathFollower
from robocup_vision.planning.speed.speed_planner import PoseNoise, SpeedPlan, SpeedPlanner
from robocup_vision.planning.speed.undecided_floor import (
    UndecidedFloor,
    UndecidedSpeed,
    looks_to_decide,
    safe_speed_mps,
)

__all__ = [
    "GOAL_DETECTORS",
    "Cover",
    "Disc",
    "Fixation",
    "Gap",
    "GapChoice",
    "GatePlan",
    "GatePlanner",
    "Gaze",
    "GoalQuestion",
    "MotionLimits",
    "Neck",
    "PassageTimes",
    "PathFollower",
    "PoseGaze",
    "PoseNoise",
    "SelectedLook",
    "SelectiveLook",
    "ShotPlan",
    "ShotPlanner",
    "SpeedPlan",
    "SpeedPlanner",
    "UndecidedFloor",
    "UndecidedSpeed",
    "WidthSensor",
    "choose_gap",
    "cover_goal",
    "gap_between",
    "looks_to_decide",
    "safe_speed_mps",
]
