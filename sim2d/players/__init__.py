"""The built-in players, which command a robot from its camera frames and odometry alone."""
