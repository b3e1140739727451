"""What the robot's process and the page's share: moments, their bytes, and what a page may ask for."""
