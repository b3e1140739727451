"""Simulates the sway of a robot's body, which moves its camera: gait of legs, braking of wheels, shake of a kick.

A body rotates about its foot point; the effect on the camera's frames is left to the renderer.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim2d.robot_link import CONTROL_PERIOD_S, RobotLimits
from sim2d.world.state import RobotState

# correlation time of the random part
_CHANCE_TIME_S = 0.2
# fraction of the largest speed or turning rate from which steps have their full size
_FULL_STEP_RATIO = 0.3
# time constant with which the pitch follows the acceleration
_PITCH_TIME_S = 0.05
# frequency of the shake after a kick, and the time in which it falls to a third
_KICK_HZ = 8.0
_KICK_TIME_S = 0.1


class Sway(NamedTuple):
    """Present deviation of a body from upright."""

    #: Pitch; nose up is positive.
    pitch_rad: float = 0.0
    #: Roll; right side down is positive.
    roll_rad: float = 0.0
    #: Rise above its usual height.
    height_m: float = 0.0


UPRIGHT = Sway()


@dataclass(frozen=True, slots=True)
class SwaySettings:
    """Settings of `BodySway`."""

    #: Amplitudes of the gait's nod, roll and rise at full step; 0 on wheels.
    nod_rad: float = 0.0
    roll_rad: float = 0.0
    height_m: float = 0.0
    #: Standard deviation of the random part of each, relative to the amplitude: carpets are uneven.
    chance_ratio: float = 0.7
    #: Steps per second; the body nods with each, and rolls with each pair.
    pace_hz: float = 1.7
    #: Pitch per forward acceleration: wheels' suspension and soft carpet; 0 on legs.
    pitch_rad_per_mps2: float = 0.0
    #: Amplitude of the shake after a kick.
    kick_rad: float = math.radians(1.0)


# the same amplitudes as in the walking sequences of `benchmarks.worlds.walks`
LEGS_SWAY = SwaySettings(nod_rad=math.radians(1.2), roll_rad=math.radians(1.2), height_m=0.004)
WHEELS_SWAY = SwaySettings(pitch_rad_per_mps2=math.radians(0.5))


class BodySway:
    """Simulates the sway of one robot."""

    def __init__(self, settings: SwaySettings, limits: RobotLimits, rng: np.random.Generator) -> None:
        self._settings, self._limits, self._rng = settings, limits, rng
        self._phase_rad = float(rng.uniform(0.0, math.tau))
        self._chance = (0.0, 0.0, 0.0)
        self._step = 0.0
        self._ahead_mps = 0.0
        self._pitch_rad = 0.0
        self._kicked_s = math.inf

    def update(self, robot: RobotState, kicked: bool) -> Sway:
        """Return the sway after another control period; `kicked`: whether the robot kicked in it."""
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
        # the acceleration is limited, because collisions and being carried are not braking
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
