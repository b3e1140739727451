"""Tracks other robots: detections inside known free space, and moving objects over time."""

from robocup_vision.belief import Track
from robocup_vision.tracking.branches import MovingObjectsSettings
from robocup_vision.tracking.detections import Detection, KnownFreeSpace, ReturnDetector
from robocup_vision.tracking.moving_objects import MovingObjects

__all__ = ["Detection", "KnownFreeSpace", "MovingObjects", "MovingObjectsSettings", "ReturnDetector", "Track"]
