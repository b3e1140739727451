"""What a robot's loop withstands: wrong frames, and many hours."""
