"""Planning with estimates of opponents, floor and pose: where to look, which gap to take, speeds, and shots."""

from robocup_vision.disc import Disc
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.planning.gaps.gap_choice import (
    Gap,
    GapChoice,
    PassageTimes,
    WidthSensor,
    choose_gap,
    gap_between,
)
from robocup_vision.planning.gaps.gate_planner import GatePlan, GatePlanner, GatePlannerSettings
from robocup_vision.planning.gaze.goal_question import Fixation, GoalQuestion
from robocup_vision.planning.gaze.pose_gaze import GOAL_DETECTORS, Gaze, Neck, PoseGaze, PoseGazeSettings
from robocup_vision.planning.gaze.selective_look import SelectedLook, SelectiveLook
from robocup_vision.planning.shots.shot_planner import Cover, ShotPlan, ShotPlanner, cover_goal
from robocup_vision.planning.speed.speed_planner import (
    PathFollower,
    PoseNoise,
    SpeedPlan,
    SpeedPlanner,
)
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
    "GatePlannerSettings",
    "Gaze",
    "GoalQuestion",
    "MotionLimits",
    "Neck",
    "PassageTimes",
    "PathFollower",
    "PoseGaze",
    "PoseGazeSettings",
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
