from .avoidance.steering import Steering, SteeringCommand, SteeringSettings
from .avoidance.wayfinder import Wayfinder
from .belief import Belief
from .camera.files import load_camera
from .camera.pinhole import Mounting
from .camera.rig import Rig, load_rig
from .errors import ArgumentError, FileError, FrameError, PacketError, RobocupVisionError
from .estimates import NotLocated, PoseEstimate, SwappedChannels
from .fields import Field, field_names, load_field
from .geometry import Pose2
from .memory import Memory
from .motion_limits import MotionLimits
from .overlay import draw
from .perception.color_table import load_colors
from .vision import View, Vision

__version__: str

__all__ = [
    "ArgumentError",
    "Belief",
    "Field",
    "FileError",
    "FrameError",
    "Memory",
    "MotionLimits",
    "Mounting",
    "NotLocated",
    "PacketError",
    "Pose2",
    "PoseEstimate",
    "Rig",
    "RobocupVisionError",
    "Steering",
    "SteeringCommand",
    "SteeringSettings",
    "SwappedChannels",
    "View",
    "Vision",
    "Wayfinder",
    "draw",
    "field_names",
    "load_camera",
    "load_colors",
    "load_field",
    "load_rig",
]
