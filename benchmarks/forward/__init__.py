"""Forward cameras on walking robots: followed from frame to frame, and found."""
