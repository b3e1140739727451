"""Where to look, which gap to take, how fast to go: from what is believed of opponents, floor and pose."""

from robocup_vision.planning.cover import Cover, cover_goal
from robocup_vision.planning.gap import Disc, Gap, WidthSensor, gap_between
from robocup_vision.planning.gaps import GatePlan, GatePlanner
from robocup_vision.planning.gaze import GOAL_DETECTORS, Gaze, Neck, PoseGaze
from robocup_vision.planning.goal_question import GoalQuestion, Look
from robocup_vision.planning.motion_limits import MotionLimits
from robocup_vision.planning.passage import GapChoice, PassageTimes, choose_gap
from robocup_vision.planning.path_follower import PathFollower
from robocup_vision.planning.selective_look import SelectedLook, SelectiveLook
from robocup_vision.planning.shot import Defender, ShotPlan, ShotPlanner
from robocup_vision.planning.sight_lines import Blocker
from robocup_vision.planning.speed import PoseNoise, SpeedPlan, SpeedPlanner
from robocup_vision.planning.undecided import FloorToDecide, UndecidedSpeed, looks_to_decide, safe_speed_mps

__all__ = [
    "GOAL_DETECTORS",
    "Blocker",
    "Cover",
    "Defender",
    "Disc",
    "FloorToDecide",
    "Gap",
    "GapChoice",
    "GatePlan",
    "GatePlanner",
    "Gaze",
    "GoalQuestion",
    "Look",
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
    "UndecidedSpeed",
    "WidthSensor",
    "choose_gap",
    "cover_goal",
    "gap_between",
    "looks_to_decide",
    "safe_speed_mps",
]
