"""What is remembered over frames: the robot's own motion, and a map of the free floor."""
<<<<<<< HEAD
=======

from robocup_vision.mapping.ego_motion import EgoMotion, Motion

__all__ = ["EgoMotion", "Motion"]
>>>>>>> ego
