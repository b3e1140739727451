from .avoidance.steering import Steering, SteeringCommand
from .avoidance.wayfinder import Wayfinder
from .belief import Belief
from .camera.files import load_camera
from .estimates import NotLocated, PoseEstimate
from .geometry import Pose2
from .memory import Memory
from .overlay import draw
from .perception.color_table import load_colors
from .vision import View, Vision

__all__ = [
    "Belief",
    "Memory",
    "NotLocated",
    "Pose2",
    "PoseEstimate",
    "Steering",
    "SteeringCommand",
    "View",
    "Vision",
    "Wayfinder",
    "draw",
    "load_camera",
    "load_colors",
]
