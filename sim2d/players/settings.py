"""Settings of built-in players; benchmarks vary them with `BuiltInTeam(settings=...)` in a `MatchPlan`."""

from __future__ import annotations

from dataclasses import dataclass

from robocup_vision.memory import MemorySettings
from sim2d.players.driving.motion import MotionSettings
from sim2d.players.tactics.team_field import TacticsSettings


@dataclass(frozen=True, slots=True)
class PlayerSettings:
    """Settings of `BuiltInPlayer`."""

    tactics: TacticsSettings = TacticsSettings()
    motion: MotionSettings = MotionSettings()
    #: Settings of the pose filter, tracks and map.
    memory: MemorySettings = MemorySettings()
    #: Whether it calibrates while playing if its camera file is rough (`PlayerSetup.camera_is_rough`).
    calibrates: bool = True
