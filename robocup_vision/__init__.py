"""From one camera frame to a pose, free floor, the ball and a motion command.

>>> from field_models import load_field
>>> from robocup_vision import Steering, Vision, load_camera, load_colors
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robocup_vision.avoidance.steering import Steering, SteeringCommand
    from robocup_vision.avoidance.wayfinder import Wayfinder
    from robocup_vision.belief import Belief
    from robocup_vision.camera.files import load_camera
    from robocup_vision.estimates import NotLocated, PoseEstimate
    from robocup_vision.geometry import Pose2
    from robocup_vision.memory import Memory
    from robocup_vision.overlay import draw
    from robocup_vision.perception.color_table import load_colors
    from robocup_vision.vision import View, Vision

# loaded when first asked for, so that the command's --help answers at once
_HOMES = {
    "Belief": "belief",
    "Memory": "memory",
    "NotLocated": "estimates",
    "Pose2": "geometry",
    "PoseEstimate": "estimates",
    "Steering": "avoidance.steering",
    "SteeringCommand": "avoidance.steering",
    "View": "vision",
    "Vision": "vision",
    "Wayfinder": "avoidance.wayfinder",
    "draw": "overlay",
    "load_camera": "camera.files",
    "load_colors": "perception.color_table",
}

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


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'robocup_vision' has no attribute {name!r}")
    return getattr(importlib.import_module(f"robocup_vision.{_HOMES[name]}"), name)
