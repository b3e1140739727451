"""Who else moves on the field, and where to."""

from robocup_vision.belief import Track
from robocup_vision.tracking.detections import Detection, KnownFreeSpace, ReturnDetector
from robocup_vision.tracking.moving_objects import MovingObjects

__all__ = ["Detection", "KnownFreeSpace", "MovingObjects", "ReturnDetector", "Track"]
