"""From free floor, velocity and target direction to a safe motion command."""

from robocup_vision.avoidance.recent_free_space import SteadyFreeSpace, carry_free_space
from robocup_vision.avoidance.steering import FreeRanges, Steering, SteeringCommand, SteeringSettings
from robocup_vision.avoidance.wayfinder import Heading, Wayfinder

__all__ = [
    "FreeRanges",
    "Heading",
    "SteadyFreeSpace",
    "Steering",
    "SteeringCommand",
    "SteeringSettings",
    "Wayfinder",
    "carry_free_space",
]
