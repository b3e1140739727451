"""What one frame shows: colours, free floor, obstacles, balls and markings."""
