"""How near to the truth a match's pose estimates are asked to be, by field."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.geometry import Pose2


@dataclass(frozen=True)
class Bound:
    """Greatest error of a pose that still counts as near the truth."""

    away_m: float
    turned_rad: float

    def holds(self, pose: Pose2 | None, truth: Pose2) -> bool:
        """Tell whether a pose is near the truth; none is not."""
        if pose is None:
            return False
        away_m, turned_rad = pose.error_to(truth)
        return away_m < self.away_m and turned_rad < self.turned_rad

    def __str__(self) -> str:
        return f"{100 * self.away_m:g} cm, {math.degrees(self.turned_rad):g} deg"


BOUNDS = {
    "ssl_2001": Bound(0.03, math.radians(3.0)),
    "four_legged_2007": Bound(0.10, math.radians(5.0)),
    "ssl_division_b": Bound(0.15, math.radians(5.0)),
    "msl_18x12": Bound(0.15, math.radians(5.0)),
    "spl_2020": Bound(0.15, math.radians(5.0)),
}
