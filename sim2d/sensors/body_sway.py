"""How a robot's body sways and carries its camera along: the gait of legs, the braking of wheels, the shake of a kick.

A body turns about its foot point; what its camera then sees is the renderer's affair.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits
from sim2d.world.state import RobotState

# what chance adds is correlated over this time
_CHANCE_TIME_S = 0.2
# part of the largest speed or turning rate from which on steps are full
_FULL_STEP_RATIO = 0.3
# the pitch follows the acceleration within this time
_PITCH_TIME_S = 0.05
# frequency of the shake after a kick, and the time in which it falls to a third
_KICK_HZ = 8.0
_KICK_TIME_S = 0.1


class Sway(NamedTuple):
    """How a body stands now, from upright."""

    #: Nose up is positive.
    pitch_rad: float = 0.0
    #: Right side down is positive.
    roll_rad: float = 0.0
    #: Above its usual height.
    height_m: float = 0.0


UPRIGHT = Sway()


@dataclass(frozen=True, slots=True)
class SwaySettings:
    """Values of `BodySway`."""

    #: Amplitude of the gait's nod, roll and rise at full step; 0 on wheels.
    nod_rad: float = 0.0
    roll_rad: float = 0.0
    height_m: float = 0.0
    #: Standard deviation of what chance adds to each, as a part of the amplitude: carpets are uneven.
    chance_ratio: float = 0.7
    #: Steps a second; the body nods with each, and rolls with each pair.
    pace_hz: float = 1.7
    #: Pitch by acceleration ahead: wheels' suspension and soft carpet; 0 on legs.
    pitch_rad_per_mps2: float = 0.0
    #: Amplitude of the shake after a kick.
    kick_rad: float = math.radians(1.0)


# the walking sequences of `benchmarks.worlds.walks` nod and roll as much
LEGS_SWAY = SwaySettings(nod_rad=math.radians(1.2), roll_rad=math.radians(1.2), height_m=0.004)
WHEELS_SWAY = SwaySettings(pitch_rad_per_mps2=math.radians(0.5))


class BodySway:
    """Follows the sway of one robot."""

    def __init__(self, settings: SwaySettings, limits: RobotLimits, rng: np.random.Generator) -> None:
        self._settings, self._limits, self._rng = settings, limits, rng
        self._phase_rad = float(rng.uniform(0.0, math.tau))
        self._chance = (0.0, 0.0, 0.0)
        self._step = 0.0
        self._ahead_mps = 0.0
        self._pitch_rad = 0.0
        self._kicked_s = math.inf

    def update(self, robot: RobotState, kicked: bool) -> Sway:
        """Return the sway after one control period more, in which the robot kicked or did not."""
        settings, period_s = self._settings, CONTROL_PERIOD_S
        limits, (vx, vy) = self._limits, robot.velocity_mps
        effort = max(math.hypot(vx, vy) / limits.speed_mps, abs(robot.turn_rps) / limits.turn_rps)
        wanted = min(effort / _FULL_STEP_RATIO, 1.0)
        kept = math.exp(-period_s / _CHANCE_TIME_S)
        self._step = kept * self._step + (1 - kept) * wanted
        self._phase_rad += math.pi * settings.pace_hz * period_s
        drawn = self._rng.standard_normal(3).tolist()
        fresh = math.sqrt(1 - kept * kept)
        a, b, c = (kept * old + fresh * new for old, new in zip(self._chance, drawn, strict=True))
        self._chance = (a, b, c)
        # the body rolls once in two steps and nods in each; it is highest between two steps
        nod = math.sin(2 * self._phase_rad) + settings.chance_ratio * a
        roll = math.sin(self._phase_rad) + settings.chance_ratio * b
        rise = math.cos(2 * self._phase_rad) + settings.chance_ratio * c

        heading = robot.pose.theta_rad
        ahead_mps = math.cos(heading) * vx + math.sin(heading) * vy
        acceleration = (ahead_mps - self._ahead_mps) / period_s
        self._ahead_mps = ahead_mps
        # a collision or a robot that is carried elsewhere is no braking
        most = 2 * limits.acceleration_mps2
        follows = 1 - math.exp(-period_s / _PITCH_TIME_S)
        lean_rad = settings.pitch_rad_per_mps2 * max(-most, min(most, acceleration))
        self._pitch_rad += follows * (lean_rad - self._pitch_rad)

        self._kicked_s = 0.0 if kicked else self._kicked_s + period_s
        shake = 0.0
        if self._kicked_s < 5 * _KICK_TIME_S:
            swing = math.cos(math.tau * _KICK_HZ * self._kicked_s)
            shake = settings.kick_rad * math.exp(-self._kicked_s / _KICK_TIME_S) * swing
        return Sway(
            settings.nod_rad * self._step * nod + self._pitch_rad + shake,
            settings.roll_rad * self._step * roll + 0.5 * shake,
            settings.height_m * self._step * rise,
        )
