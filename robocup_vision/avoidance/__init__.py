"""From free floor, velocity and target direction to a safe motion command."""

from robocup_vision.avoidance.recent_free_space import SteadyFreeSpace, carry_free_space
from robocup_vision.avoidance.steering import FreeRanges, Steering, SteeringCommand, SteeringSettings
from robocup_vision.avoidance.wayfinder import Heading, Wayfinder, WayfinderSettings

__all__ = [
    "FreeRanges",
    "Heading",
    "SteadyFreeSpace",
    "Steering",
    "SteeringCommand",
    "SteeringSettings",
    "Wayfinder",
    "WayfinderSettings",
    "carry_free_space",
]
