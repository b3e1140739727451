"""All values of a built-in player: a benchmark varies them by `BuiltInTeam(settings=...)` in its `MatchPlan`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.memory import MemorySettings
from sim2d.players.ball_memory import BallMemorySettings
from sim2d.players.driving.motion import MotionSettings
from sim2d.players.driving.travel import TravelSettings
from sim2d.players.head import HeadSettings
from sim2d.players.shot import ShotSettings
from sim2d.players.tactics.tactics import TacticsSettings
from sim2d.players.team_talk import TeamTalkSettings


@dataclass(frozen=True, slots=True)
class PlayerSettings:
    """Values of `BuiltInPlayer`.

    Attributes
    ----------
    tactics, ball, motion, travel, shot, head, talk
        Of its parts.
    memory : MemorySettings
        Of its estimates over time: pose filter, tracks and map.
    start_std_m, start_std_rad : float
        How exactly it stands at its place when a match begins with a kick-off.
    floor_margin_ratio : float
        Margin of the filtered free floor, as `SteadyFreeSpace` takes it.
    max_frame_age_s : float
        It drives by a frame's free space for so long, then stops until the next: obstacles move on.
    calibrates : bool
        Where its camera file is rough (`PlayerSetup.camera_is_rough`) it calibrates while it plays.
    lost_look_s : float
        With a pinhole camera it looks no more often than this while no pose is expected: a search of the whole field
        takes as long as several other looks, and frames close together err alike.
    lost_rps : float
        It turns so fast while it is not located, to see more of the field.
    """

    tactics: TacticsSettings = TacticsSettings()
    ball: BallMemorySettings = BallMemorySettings()
    motion: MotionSettings = MotionSettings()
    travel: TravelSettings = TravelSettings()
    shot: ShotSettings = ShotSettings()
    head: HeadSettings = HeadSettings()
    talk: TeamTalkSettings = TeamTalkSettings()
    memory: MemorySettings = MemorySettings()
    start_std_m: float = 0.05
    start_std_rad: float = math.radians(3.0)
    floor_margin_ratio: float = 0.02
    max_frame_age_s: float = 0.4
    calibrates: bool = True
    lost_look_s: float = 0.1
    lost_rps: float = 1.0
