"""Who else moves on the field, and where to."""

from robocup_vision.tracking.moving_objects import Detection, MovingObjects, Track

__all__ = ["Detection", "MovingObjects", "Track"]
