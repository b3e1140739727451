"""Disturbances of a match's robots: sway, late frames, slip, drifting light, a slow shutter, wrong camera files."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from field_models.errors import ArgumentError
from robocup_vision.camera import OmniCamera, Rig
from sim2d.match.setups import Camera, RobotKind
from sim2d.sensors.body_sway import LEGS_SWAY, WHEELS_SWAY, SwaySettings
from sim2d.sensors.faults import LatencySettings
from sim2d.sensors.match_camera import LightDriftSettings, ShutterSettings
from sim2d.sensors.team_channel import ChannelSettings
from sim2d.sensors.true_cameras import CameraErrorSettings, KnockSettings
from sim2d.world.robot_spec import BodySettings


@dataclass(frozen=True, slots=True)
class Slip:
    """Errors of odometry, larger than in `BodySettings`."""

    #: Standard deviation of the odometry's systematic errors of distance and angle, drawn once per robot: at two
    #: standard deviations legs are 10 % off.
    gain_std: float = 0.05
    #: As in `BodySettings`.
    slip_part: float = 0.1
    slip_turn_rad_per_m: float = 0.1

    def of(self, body: BodySettings) -> BodySettings:
        """Return a body with this slip."""
        return replace(
            body, gain_std=self.gain_std, slip_part=self.slip_part, slip_turn_rad_per_m=self.slip_turn_rad_per_m
        )


# default settings of a disturbance that is switched on by its name
_USUAL: dict[str, Any] = {
    "sway": WHEELS_SWAY,
    "latency": LatencySettings(),
    "slip": Slip(),
    "drift": LightDriftSettings(),
    "shutter": ShutterSettings(),
    "camera": CameraErrorSettings(),
    "knock": KnockSettings(),
    "messages": ChannelSettings(),
}
NAMES = tuple(_USUAL)


@dataclass(frozen=True, slots=True)
class Disturbances:
    """Which disturbances a match has and how strong they are; None: it does not have this one."""

    #: Sway of bodies, which carry their cameras along.
    sway: SwaySettings | None = None
    #: Lateness of frames.
    latency: LatencySettings | None = None
    #: Slip of wheels or legs, which odometry does not measure.
    slip: Slip | None = None
    #: Drift of the light.
    drift: LightDriftSettings | None = None
    #: Motion blur and rolling shutter of pinhole cameras.
    shutter: ShutterSettings | None = None
    #: Difference of each robot's true camera from its file, which is all that the player knows.
    camera: CameraErrorSettings | None = None
    #: A knock that moves each camera once during the match.
    knock: KnockSettings | None = None
    #: Late and lost messages of the team's radio.
    messages: ChannelSettings | None = None

    def only(self, names: Iterable[str]) -> Disturbances:
        """Return only the disturbances with some names (`NAMES`); one that is off here gets its default settings.

        Raises
        ------
        ArgumentError
            If there is no disturbance with a name.
        """
        wanted = set(names)
        for name in sorted(wanted - set(NAMES)):
            raise ArgumentError(f"there is no disturbance '{name}': they are {', '.join(NAMES)}")
        return Disturbances(**{name: getattr(self, name) or _USUAL[name] for name in wanted})

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the disturbances that are on."""
        return tuple(name for name in NAMES if getattr(self, name) is not None)


NONE = Disturbances()
MIRRORS_ON_LEGS = Disturbances(LEGS_SWAY, messages=ChannelSettings())
MIRRORS_ON_WHEELS = replace(MIRRORS_ON_LEGS, sway=WHEELS_SWAY)
WHEELS = replace(
    MIRRORS_ON_WHEELS,
    latency=LatencySettings(),
    drift=LightDriftSettings(),
    shutter=ShutterSettings(),
    camera=CameraErrorSettings(),
)
LEGS = replace(WHEELS, sway=LEGS_SWAY, slip=Slip())


def disturbances_for(robot: RobotKind, camera: Camera, rig: Rig | None = None) -> Disturbances:
    """Return those for a robot on legs or wheels; with a mirror camera or a rig only those of bodies and messages."""
    if rig is not None or isinstance(camera, OmniCamera):
        return MIRRORS_ON_LEGS if robot.has_legs else MIRRORS_ON_WHEELS
    return LEGS if robot.has_legs else WHEELS
