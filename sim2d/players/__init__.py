"""The built-in players, which command a robot using only its camera frames, odometry and team messages."""
