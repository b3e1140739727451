"""What one frame shows: colours, free floor, ball."""
