"""Where a robot turns to that carries its camera fixed and is unsure of where it is: to a crossing of lines."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.field import Field
from robocup_vision.estimates import PoseEstimate
from robocup_vision.planning.gaze.field_landmarks import field_landmarks


@dataclass(frozen=True, slots=True)
class PoseLookSettings:
    """Values of `PoseLook`."""

    #: Standard deviation of the position from which on it looks. On a large field a robot is off by 1.3 times what it
    #: states; at three of these it is no longer located within 15 cm.
    unsure_m: float = 0.035
    #: It looks until the standard deviation is this small.
    sure_m: float = 0.0175
    #: A crossing nearer than this would soon lie below the picture.
    nearest_m: float = 0.5


class PoseLook:
    """Decides where one robot turns its fixed camera."""

    def __init__(self, field: Field, settings: PoseLookSettings = PoseLookSettings()) -> None:
        self._settings = settings
        self._crossings = [(mark.x_m, mark.y_m) for mark in field_landmarks(field) if mark.kind == "crossing"]
        self._looks = False

    def direction_rad(self, robot: PoseEstimate) -> float | None:
        """Return the direction to turn to, field frame; None where the robot is sure of its place, or nothing helps.

        Two lines that cross tell all of a pose, and the nearest ones tell it best.
        """
        settings, (x_m, y_m) = self._settings, (robot.pose.x_m, robot.pose.y_m)
        self._looks = max(robot.std[:2]) > (settings.sure_m if self._looks else settings.unsure_m)
        if not self._looks:
            return None
        ways = [(x - x_m, y - y_m) for x, y in self._crossings]
        ahead = [way for way in ways if math.hypot(*way) > settings.nearest_m]
        if not ahead:
            return None
        x, y = min(ahead, key=lambda way: math.hypot(*way))
        return math.atan2(y, x)
