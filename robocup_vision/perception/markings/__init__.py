"""What one frame shows of a field's markings, robot frame: line segments, crossings, circles and goal posts."""
