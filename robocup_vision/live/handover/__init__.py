"""What the robot's process and the page's share: moments, their encoding, and the requests of a page."""
