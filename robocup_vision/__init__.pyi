from .avoidance.steering import Steering, SteeringCommand
from .avoidance.steering_settings import SteeringSettings
from .avoidance.wayfinder import Wayfinder
from .belief import Belief
from .camera.files import load_camera
from .estimates import NotLocated, PoseEstimate
from .geometry import Pose2
from .memory import Memory
from .motion_limits import MotionLimits
from .overlay import draw
from .perception.color_table import load_colors
from .vision import View, Vision

__all__ = [
    "Belief",
    "Memory",
    "MotionLimits",
    "NotLocated",
    "Pose2",
    "PoseEstimate",
    "Steering",
    "SteeringCommand",
    "SteeringSettings",
    "View",
    "Vision",
    "Wayfinder",
    "draw",
    "load_camera",
    "load_colors",
]
