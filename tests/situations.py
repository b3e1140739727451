"""Plain situations of a player, for tests of its tactics."""

from __future__ import annotations

from typing import Any

from robocup_vision.geometry import Pose2
from sim2d.players.plan import Situation


def situation(pose: Pose2, **changes: Any) -> Situation:
    """Return play about a ball that lies in the middle of the field, in nobody's mouth, but for the changes."""
    usual = {
        "ball": (0.0, 0.0),
        "ball_velocity_mps": (0.0, 0.0),
        "in_mouth": False,
        "held_s": 0.0,
        "obstacles": (),
        "phase": "play",
        "own_turn": False,
        "t_s": 5.0,
    }
    return Situation(pose, **(usual | changes))
