"""From free floor, velocity and goal direction to a safe motion command."""

from robocup_vision.avoidance.moving_obstacles import MovingObstacle
from robocup_vision.avoidance.steady_free_space import SteadyFreeSpace, carry_free_space
from robocup_vision.avoidance.steering import FreeRanges, Steering, SteeringCommand

__all__ = ["FreeRanges", "MovingObstacle", "SteadyFreeSpace", "Steering", "SteeringCommand", "carry_free_space"]
