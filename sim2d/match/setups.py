"""The set-up of a match on each field: players per side, camera and robots, in one table."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import TypeAlias

from field_models import Field
from field_models.errors import ArgumentError
from robocup_vision.camera import FisheyeCamera, OmniCamera, PinholeCamera, Rig, load_camera, load_camera_or_rig
from sim2d.kick_off import kick_off_pose
from sim2d.rendering.cameras import camera_by_name, sekimori_camera
from sim2d.rendering.goal.scenes import ers7_camera, nao_camera
from sim2d.robot_link import RobotLimits
from sim2d.world.ball_physics import BallSettings
from sim2d.world.robot_spec import BodySettings
from sim2d.world.world import WorldSettings

Camera: TypeAlias = OmniCamera | PinholeCamera

# image size of a camera on a head, small enough to process in a control period
_HEAD_SIZE_PX = (208, 160)
_FISHEYE_SIZE_PX = (200, 152)
# kicks with the body or a leg
_LEG_KICK = BodySettings(kick_again_s=1.0, kick_speed_std=0.1, kick_angle_std_rad=0.07)
_HUMANOID = RobotLimits(
    0.4,
    0.6,
    radius_m=0.15,
    height_m=0.55,
    turn_rps=1.5,
    turn_acceleration_rps2=6.0,
    kick_speed_mps=2.5,
    pan_rps=5.0,
    pan_limit_rad=2.0,
)
# by field: players per side, name of the camera, name of the robots
_BY_FIELD: dict[str, tuple[int, str, str]] = {
    "ssl_2001": (2, "sekimori", "small"),
    "ssl_division_a": (6, "ssl_forward", "small_size"),
    "ssl_division_b": (6, "ssl_forward", "small_size"),
    "four_legged_2005": (4, "ers7", "four_legged"),
    "four_legged_2007": (4, "ers7", "four_legged"),
    "msl_6x4": (2, "msl_mirror", "middle_size"),
    "msl_18x12": (5, "msl_mirror", "middle_size"),
    "spl_2020": (5, "nao", "humanoid"),
    "humanoid_kid_2025": (4, "kid_head", "kid"),
    "humanoid_adult_2025": (3, "adult_head", "adult"),
}


@dataclass(frozen=True, slots=True)
class RobotKind:
    """The kind of all robots of a match.

    Attributes
    ----------
    limits : RobotLimits
        Size, speed, kick and neck.
    has_legs : bool
        The body nods with its steps, and the odometry is that of legs.
    physics : WorldSettings
        Physics of its body, and of its league's ball.
    """

    limits: RobotLimits = RobotLimits()
    has_legs: bool = False
    physics: WorldSettings = WorldSettings()


@dataclass(frozen=True, slots=True, eq=False)
class MatchSetup:
    """The set-up of a match.

    Attributes
    ----------
    players : int
        Number of players per side.
    camera : OmniCamera or PinholeCamera
        The camera of every robot.
    robot : RobotKind
        The kind of all robots.
    rig : Rig or None
        All cameras of a robot if it has several; `camera` is then the first of them.
    """

    players: int
    camera: Camera
    robot: RobotKind
    rig: Rig | None = None


def _tilted(camera: PinholeCamera, tilt_deg: float) -> PinholeCamera:
    return replace(camera, pan_rad=0.0, tilt_rad=math.radians(tilt_deg), roll_rad=0.0)


def _built_in(name: str) -> Camera:
    return load_camera(Path(str(files("field_models"))) / "cameras" / f"{name}.toml")


def _fisheye(focal_ratio: float, tilt_rad: float, roll_std_deg: float) -> FisheyeCamera:
    width, height = _FISHEYE_SIZE_PX
    return FisheyeCamera(
        (width, height),
        (focal_ratio * width, focal_ratio * width),
        ((width - 1) / 2, (height - 1) / 2),
        0.55,
        projection="equidistant",
        pan_rad=0.0,
        tilt_rad=tilt_rad,
        roll_rad=0.0,
        roll_std_rad=math.radians(roll_std_deg),
    )


def _msl_fisheyes() -> Rig:
    """Return four fisheyes of a middle-size robot, ahead, to the left, behind and to the right, in small pictures."""
    ahead = _fisheye(0.3, -0.5, 0.5)
    cameras = tuple(
        replace(ahead, pan_rad=pan_rad, offset_m=(0.15 * math.cos(pan_rad), 0.15 * math.sin(pan_rad)))
        for pan_rad in (0.0, math.pi / 2, math.pi, -math.pi / 2)
    )
    return Rig(cameras, names=("ahead", "left", "behind", "right"))


CAMERAS: dict[str, Callable[[], Camera | Rig]] = {
    "sekimori": sekimori_camera,
    "ers7": lambda: _tilted(ers7_camera(*_HEAD_SIZE_PX), -12.0),
    "nao": lambda: _tilted(nao_camera(*_HEAD_SIZE_PX), -20.0),
    "kid_head": lambda: _tilted(replace(nao_camera(*_HEAD_SIZE_PX), height_m=0.55), -20.0),
    "kid_fisheye": lambda: _fisheye(0.4, math.radians(-25.0), 1.5),
    "adult_head": lambda: _tilted(replace(nao_camera(*_HEAD_SIZE_PX), height_m=1.2), -25.0),
    "ssl_forward": partial(_built_in, "ssl_forward"),
    "ssl_mirror": partial(_built_in, "ssl_mirror"),
    "msl_mirror": partial(_built_in, "msl_mirror"),
    "msl_fisheyes": _msl_fisheyes,
}

ROBOTS: dict[str, RobotKind] = {
    # Sekimori et al. 2001, with its mirror or a head
    "small": RobotKind(),
    # a robot of the small-size league today, whose camera is fixed on board
    "small_size": RobotKind(RobotLimits(1.5, 2.0, kick_speed_mps=4.0, pan_limit_rad=0.0)),
    # a Sony ERS-7, which walks with bent legs: its back is lower than its eye. It kicks with its body
    "four_legged": RobotKind(
        RobotLimits(
            0.5,
            1.0,
            radius_m=0.13,
            height_m=0.15,
            turn_rps=3.0,
            turn_acceleration_rps2=15.0,
            kick_speed_mps=1.5,
            pan_rps=6.0,
        ),
        True,
        WorldSettings(replace(_LEG_KICK, mass_kg=1.7)),
    ),
    # an Aldebaran Nao
    "humanoid": RobotKind(_HUMANOID, True, WorldSettings(replace(_LEG_KICK, mass_kg=5.4))),
    # robots of a child's size, with its league's ball
    "kid": RobotKind(
        replace(_HUMANOID, height_m=0.65, kick_speed_mps=3.0),
        True,
        WorldSettings(replace(_LEG_KICK, mass_kg=7.0), BallSettings(mass_kg=0.2)),
    ),
    # robots of an adult's size, with a football
    "adult": RobotKind(
        replace(
            _HUMANOID,
            speed_mps=0.6,
            radius_m=0.25,
            height_m=1.4,
            turn_rps=1.2,
            turn_acceleration_rps2=4.0,
            kick_speed_mps=4.0,
            pan_rps=4.0,
        ),
        True,
        WorldSettings(replace(_LEG_KICK, mass_kg=30.0), BallSettings(mass_kg=0.43)),
    ),
    # a robot of the middle size league, with a ball of a football's size
    "middle_size": RobotKind(
        RobotLimits(
            2.5, 2.0, radius_m=0.25, height_m=0.6, turn_rps=5.0, turn_acceleration_rps2=15.0, kick_speed_mps=5.0
        ),
        False,
        WorldSettings(BodySettings(mass_kg=30.0), BallSettings(mass_kg=0.43)),
    ),
}


def setup_for(
    field: Field,
    *,
    players: int | None = None,
    camera: str | Camera | Rig | None = None,
    robot: str | RobotKind | None = None,
    limits: RobotLimits | None = None,
) -> MatchSetup:
    """Return the set-up of a match on a field.

    Parameters
    ----------
    field : Field
        The field. A new one has the set-up of `four_legged_2007` if goals have posts, else of `ssl_2001`.
    players : int, optional
        Number of players per side; by default that of the field's league.
    camera : OmniCamera, PinholeCamera, Rig or str, optional
        The camera or rig of every robot: an object, a name of `CAMERAS`, ``sekimori:WIDTHxHEIGHT``, or a file.
    robot : RobotKind or str, optional
        The kind of all robots: an object, or a name of `ROBOTS`.
    limits : RobotLimits, optional
        Limits of every robot, in place of the kind's.

    Raises
    ------
    ArgumentError
        If a name is unknown, or the combination cannot play.
    FileError
        If a camera file is missing or wrong.
    """
    if field.is_half:
        raise ArgumentError(f"a match needs a whole field, and of '{field.name}' there is half")
    usual = _BY_FIELD.get(field.name)
    if usual is None:
        usual = _BY_FIELD["four_legged_2007" if any(g.kind == "posts" for g in field.goals) else "ssl_2001"]
    count = usual[0] if players is None else players
    carried = usual[1] if camera is None else camera
    kind = usual[2] if robot is None else robot
    robots = _robot_named(kind) if isinstance(kind, str) else kind
    cameras = _camera_named(carried) if isinstance(carried, str) else carried
    rig = cameras if isinstance(cameras, Rig) else None
    setup = MatchSetup(
        count,
        cameras.cameras[0] if isinstance(cameras, Rig) else cameras,
        robots if limits is None else replace(robots, limits=limits),
        rig,
    )
    check_setup(field, setup)
    return setup


def camera_for(field: Field) -> Camera:
    """Return the camera that robots carry on a field."""
    return setup_for(field).camera


def check_setup(field: Field, setup: MatchSetup) -> None:
    """Refuse a set-up that cannot play on a field.

    Raises
    ------
    ArgumentError
        If there are no players, or no room for them, or the field has nothing to localise by.
    """
    players, limits = setup.players, setup.robot.limits
    if players < 1:
        raise ArgumentError(f"players must be at least 1, got {players}")
    starts = [kick_off_pose(field, 1, number, players, limits.radius_m) for number in range(players)]
    for number, start in enumerate(starts):
        for other in starts[:number]:
            if start.error_to(other)[0] < 2 * limits.radius_m:
                raise ArgumentError(
                    f"{players} robots of {limits.radius_m:g} m radius have no room side by side on '{field.name}'"
                )
    if not len(field.lines) and not len(field.arcs) and not field.is_bounded:
        raise ArgumentError(f"'{field.name}' has neither lines nor walls: no player can know where it is")


def _camera_named(name: str) -> Camera | Rig:
    if name in CAMERAS:
        return CAMERAS[name]()
    if name.startswith("sekimori:"):
        return camera_by_name(name)
    if not name.endswith(".toml"):
        raise ArgumentError(f"there is no camera '{name}': give a camera or rig file (.toml), or {', '.join(CAMERAS)}")
    return load_camera_or_rig(name)


def _robot_named(name: str) -> RobotKind:
    if name not in ROBOTS:
        raise ArgumentError(f"there are no robots '{name}', only {', '.join(ROBOTS)}")
    return ROBOTS[name]
