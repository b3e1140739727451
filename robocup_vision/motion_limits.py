"""The robot's motion model for all plans and for steering: speed, acceleration and dead time."""

from __future__ import annotations

import math
import numbers
from dataclasses import dataclass

from field_models.errors import ArgumentError


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """The robot's motion model: eq. 10 of Sekimori et al. (2001), as used in steering.

    Parameters
    ----------
    speed_mps : float
        Largest speed.
    acceleration_mps2 : float
        Largest acceleration.
    dead_time_s : float
        Time from a decision until the robot obeys.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    speed_mps: float
    acceleration_mps2: float
    dead_time_s: float = 0.03

    def __post_init__(self) -> None:
        for name, least in (("speed_mps", 1e-6), ("acceleration_mps2", 1e-6), ("dead_time_s", 0.0)):
            value = getattr(self, name)
            if not isinstance(value, numbers.Real) or isinstance(value, bool):
                raise ArgumentError(f"{name} must be a number, got {type(value).__name__} {value!r}")
            if not (math.isfinite(value) and float(value) >= least):
                raise ArgumentError(f"{name} must be at least {least:g}, got {value!r}")

    def travel_s(self, distance_m: float) -> float:
        """Return the time from rest to rest over a distance, seconds; 0 for a distance of 0.

        It is concave in the distance, so a stop in between never saves time; the bounds of the gate problem need this.
        """
        if distance_m <= 0.0:
            return 0.0
        if distance_m < self.speed_mps**2 / self.acceleration_mps2:
            return self.dead_time_s + 2.0 * math.sqrt(distance_m / self.acceleration_mps2)
        return self.dead_time_s + distance_m / self.speed_mps + self.speed_mps / self.acceleration_mps2

    def stop_m(self, speed_mps: float) -> float:
        """Return the distance from the decision to stop, at a speed, until rest, metres."""
        return speed_mps * self.dead_time_s + 0.5 * speed_mps**2 / self.acceleration_mps2
