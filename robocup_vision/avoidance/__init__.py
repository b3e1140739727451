"""From free floor, velocity and goal direction to a safe motion command."""

from robocup_vision.avoidance.steering import FreeRanges, Steering, SteeringCommand

__all__ = ["FreeRanges", "Steering", "SteeringCommand"]
