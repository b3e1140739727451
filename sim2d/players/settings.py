"""All settings of a built-in player; a benchmark varies them by `BuiltInTeam(settings=...)` in its `MatchPlan`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.localization.filter.errors import OdometryNoise
from robocup_vision.memory import MemorySettings
from sim2d.players.ball import BallMemorySettings
from sim2d.players.driving.motion import MotionSettings
from sim2d.players.driving.travel import TravelSettings
from sim2d.players.head import HeadSettings, PoseLookSettings
from sim2d.players.shot import ShotSettings
from sim2d.players.tactics.keeper import KeeperSettings
from sim2d.players.tactics.tactics import TacticsSettings
from sim2d.players.team_talk import TeamTalkSettings


@dataclass(frozen=True, slots=True)
class PlayerSettings:
    """Values of `BuiltInPlayer`."""

    #: Settings of its parts. The keeper does not go out to block, because robots with the ball drive around it.
    tactics: TacticsSettings = TacticsSettings(keeper=KeeperSettings(block_widths=0.0))
    ball: BallMemorySettings = BallMemorySettings()
    motion: MotionSettings = MotionSettings()
    travel: TravelSettings = TravelSettings()
    shot: ShotSettings = ShotSettings()
    head: HeadSettings = HeadSettings()
    look: PoseLookSettings = PoseLookSettings()
    talk: TeamTalkSettings = TeamTalkSettings()
    #: Settings of the pose filter, tracks and map.
    memory: MemorySettings = MemorySettings()
    #: Noise of the odometry with a pinhole camera, instead of the memory's. Legs slip by a tenth and have gain errors
    #: of a twentieth; errors of frames of a nodding or turning body exceed their covariance, which counts as slip.
    #: Wheels slip in similarly short bursts. Robots that do not see their neighbours are pushed, which odometry does
    #: not measure.
    legs_odometry: OdometryNoise = OdometryNoise(slip_ratio=0.14, slip_s=0.1, gain_std=0.05, push_m=0.01, push_rad=0.03)
    wheels_odometry: OdometryNoise = OdometryNoise(slip_s=0.1, gain_std=0.02, push_m=0.01, push_rad=0.01)
    #: Standard deviations of its pose when a match begins with a kick-off.
    start_std_m: float = 0.05
    start_std_rad: float = math.radians(3.0)
    #: Margin of the filtered free floor, see `SteadyFreeSpace`.
    floor_margin_ratio: float = 0.02
    #: Greatest age of a frame by whose free space it drives, because obstacles move; then it stops.
    max_frame_age_s: float = 0.4
    #: Whether it calibrates while playing if its camera file is rough (`PlayerSetup.camera_is_rough`).
    calibrates: bool = True
    #: Least time between looks with a pinhole camera while no pose is expected: a search of the whole field takes as
    #: long as several other looks, and errors of close frames are correlated.
    lost_look_s: float = 0.1
    #: Turning rate while it is not located, to see more of the field.
    lost_rps: float = 1.0
