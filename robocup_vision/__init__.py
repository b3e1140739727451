"""From one camera frame to a pose, free floor, the ball and a motion command."""
