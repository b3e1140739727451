"""From free floor, velocity and goal direction to a safe motion command."""
