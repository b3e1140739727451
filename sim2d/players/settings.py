"""All values of a built-in player: a benchmark varies them by `BuiltInTeam(settings=...)` in its `MatchPlan`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.avoidance.recent_free_space import RecentFreeSpaceSettings
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

    #: Settings of its parts. Its keeper does not go out to block: others with the ball drive round it.
    tactics: TacticsSettings = TacticsSettings(keeper=KeeperSettings(block_widths=0.0))
    ball: BallMemorySettings = BallMemorySettings()
    motion: MotionSettings = MotionSettings()
    travel: TravelSettings = TravelSettings()
    shot: ShotSettings = ShotSettings()
    head: HeadSettings = HeadSettings()
    look: PoseLookSettings = PoseLookSettings()
    talk: TeamTalkSettings = TeamTalkSettings()
    #: Settings of its estimates over time: pose filter, tracks and map.
    memory: MemorySettings = MemorySettings()
    #: Noise of the odometry with a pinhole camera, in place of the memory's. Legs slip by a tenth and are a twentieth
    #: off for good; frames of a body that nods or turns err by more than they state, which counts as slip. Wheels slip
    #: in bursts as short. A robot that does not see who is beside it is pushed, which its odometry does not tell.
    legs_odometry: OdometryNoise = OdometryNoise(slip_ratio=0.14, slip_s=0.1, gain_std=0.05, push_m=0.01, push_rad=0.03)
    wheels_odometry: OdometryNoise = OdometryNoise(slip_s=0.1, gain_std=0.02, push_m=0.01, push_rad=0.01)
    #: Standard deviations of its place when a match begins with a kick-off.
    start_std_m: float = 0.05
    start_std_rad: float = math.radians(3.0)
    #: Margin of the filtered free floor, as `SteadyFreeSpace` takes it.
    floor_margin_ratio: float = 0.02
    #: Settings of the floor that is remembered where the camera does not see all around.
    recent_floor: RecentFreeSpaceSettings = RecentFreeSpaceSettings()
    #: It drives by a frame's free space for so long, then stops until the next: obstacles move on.
    max_frame_age_s: float = 0.4
    #: Where its camera file is rough (`PlayerSetup.camera_is_rough`) it calibrates while it plays.
    calibrates: bool = True
    #: With a pinhole camera it looks no more often than this while no pose is expected: a search of the whole field
    #: takes as long as several other looks, and frames close together err alike.
    lost_look_s: float = 0.1
    #: It turns so fast while it is not located, to see more of the field.
    lost_rps: float = 1.0
