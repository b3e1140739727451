"""Who else moves on the field, and where to."""

from robocup_vision.tracking.detections import Detection, KnownFreeSpace, ReturnDetector
from robocup_vision.tracking.moving_objects import MovingObjects, Track

__all__ = ["Detection", "KnownFreeSpace", "MovingObjects", "ReturnDetector", "Track"]
