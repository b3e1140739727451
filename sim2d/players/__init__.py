"""The built-in players: from camera frames and odometry alone to commands."""
