"""Movement in a hall: people who walk to and fro, and changing light."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.geometry import Pose2
from sim2d.rendering.hall.hall import Hall, HallLight
from sim2d.rendering.hall.solids import Panel, prism, swung
from sim2d.rendering.hall.textures import clothes

# length of two steps, and amplitude of a leg's swing
_STEP_M, _SWING_RAD = 1.3, 0.4
# least distance of people from the robot
_ROOM_M = 0.9
# relative amplitude and period of the daylight; time for which a lamp stays on or off, each with its own phase
_CLOUDS, _CLOUD_S, _FLICKER_S = 0.3, 31.0, 17.0


@dataclass(frozen=True, slots=True)
class Passer:
    """A person who walks to and fro between two places, with a pause at each."""

    #: Ends of the way.
    start_m: tuple[float, float]
    end_m: tuple[float, float]
    #: Walking speed.
    speed_mps: float
    #: Duration of a pause.
    wait_s: float
    #: Time of the start.
    late_s: float
    #: Height.
    height_m: float
    #: Textures.
    jacket: int
    trousers: int
    face: int
    nape: int

    def __post_init__(self) -> None:
        if not (self.speed_mps > 0 and self.height_m > 0 and self.wait_s >= 0):
            raise ArgumentError(f"a person needs a positive speed and height, got {self.speed_mps}, {self.height_m}")

    def panels(self, t_s: float, robot: Pose2) -> list[Panel]:
        """Return the person at a time, moved aside if the robot is near."""
        away = np.subtract(self.end_m, self.start_m)
        length_m = float(np.hypot(*away))
        there_s = length_m / self.speed_mps
        phase_s = (t_s - self.late_s) % (2 * (there_s + self.wait_s))
        forth = phase_s < there_s + self.wait_s
        walked = min((phase_s if forth else phase_s - there_s - self.wait_s) / there_s, 1.0)
        part = walked if forth else 1 - walked
        heading = math.atan2(*away[::-1].tolist()) + (0.0 if forth else math.pi)
        x, y = np.array(self.start_m) + part * away
        apart_m = max(math.hypot(x - robot.x_m, y - robot.y_m), 1e-6)
        if apart_m < _ROOM_M:
            x = robot.x_m + (x - robot.x_m) * _ROOM_M / apart_m
            y = robot.y_m + (y - robot.y_m) * _ROOM_M / apart_m
        swing_rad = 0.0 if walked == 1.0 else _SWING_RAD * math.sin(math.tau * walked * length_m / _STEP_M)
        return self._body(Pose2(float(x), float(y), heading), swing_rad)

    def _body(self, place: Pose2, swing_rad: float) -> list[Panel]:
        high = self.height_m
        hip, shoulder, chin = 0.48 * high, 0.82 * high, 0.86 * high
        panels = []
        for side in (-1.0, 1.0):
            leg, arm = place.compose(Pose2(0.0, side * 0.1, 0.0)), place.compose(Pose2(0.0, side * 0.25, 0.0))
            limbs = (
                (leg, hip, prism(leg, (0.085, 0.075), (0.0, hip + 0.02), (self.trousers,) * 6), side),
                (arm, shoulder, prism(arm, (0.05, 0.05), (0.45 * high, shoulder - 0.02), (self.jacket,) * 6), -side),
            )
            for at, joint_m, limb, turn in limbs:
                panels += swung(limb, (at.x_m, at.y_m, joint_m), place.theta_rad, turn * swing_rad)
        panels += prism(place, (0.13, 0.21), (hip, shoulder), (self.jacket,) * 8)
        panels += prism(place, (0.06, 0.06), (shoulder, chin), (self.face,) * 6)
        head = (self.face, self.face, self.nape, self.nape, self.nape, self.nape, self.nape, self.face)
        return panels + prism(place, (0.105, 0.085), (chin, high), head)


@dataclass(frozen=True, slots=True)
class Bustle:
    """People and light during one visit to a hall."""

    #: The people.
    people: tuple[Passer, ...]
    #: Light with all lamps on and the mean daylight.
    light: HallLight

    def panels(self, t_s: float, robot: Pose2) -> list[Panel]:
        """Return all people at a time."""
        return [panel for person in self.people for panel in person.panels(t_s, robot)]

    def light_at(self, t_s: float) -> HallLight:
        """Return the light at a time."""
        day = 1 + _CLOUDS * math.sin(math.tau * t_s / _CLOUD_S)
        count = max(len(self.light.lamps), 1)
        lamps = tuple(
            (x, y, z, strength if (t_s / _FLICKER_S + 2 * k / count) % 2 < 1.2 else 0.1 * strength)
            for k, (x, y, z, strength) in enumerate(self.light.lamps)
        )
        return replace(self.light, ambient=self.light.ambient * day, lamps=lamps)


def populated(
    hall: Hall,
    ways_m: Sequence[tuple[tuple[float, float], tuple[float, float]]],
    light: HallLight,
    rng: np.random.Generator,
) -> tuple[Hall, Bustle]:
    """Add a person for each way; return the hall with the textures of their clothes added, and the movement in it."""
    textures = list(hall.textures)
    people = []
    for start, end in ways_m:
        first = len(textures)
        textures += clothes(rng)
        skins = (first, first + 1, first + 2, first + 3)
        speed, wait, late, high = rng.uniform(0.6, 1.3), rng.uniform(0, 6), rng.uniform(0, 60), rng.uniform(1.55, 1.9)
        people.append(Passer(start, end, float(speed), float(wait), float(late), float(high), *skins))
    return Hall(hall.panels, tuple(textures)), Bustle(tuple(people), light)
