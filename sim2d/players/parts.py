"""Interfaces and makers of the parts of a built-in player, each of which may be replaced.

A part is made by a function or class from the player's setup and settings. Makers that are defined at module level can
be pickled and sent to other processes, as tournaments do.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.belief import Track
from robocup_vision.calibration.online import OnlineCalibration
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.filter.errors import OdometryNoise
from robocup_vision.memory import Memory
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.color_table import Colors
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.team.message import BallSighting
from robocup_vision.team.roles import RoleChooser
from robocup_vision.view import View
from robocup_vision.vision import CameraRefiner, Vision
from sim2d.players.ball import BallKnowledge, KnownBall, NoddingCamera
from sim2d.players.driving.motion import Motion
from sim2d.players.driving.travel import Travel
from sim2d.players.plan import Plan, Situation
from sim2d.players.settings import PlayerSettings
from sim2d.players.tactics.tactics import Tactics
from sim2d.players.team_talk import ChoosesRole, TeamTalk
from sim2d.robot_link import Command, PlayerSetup, Point

# Noise of the odometry of robots with a pinhole camera, in place of the memory's default. Legs slip by a tenth and have
# gain errors of a twentieth. Frames of a nodding or turning body have larger errors than their covariance, modelled
# as more slip. Wheels slip in similarly short bursts. Robots may be pushed, which odometry does not measure.
LEGS_ODOMETRY = OdometryNoise(slip_ratio=0.14, slip_s=0.1, gain_std=0.05, push_m=0.01, push_rad=0.03)
WHEELS_ODOMETRY = OdometryNoise(slip_s=0.1, gain_std=0.02, push_m=0.01, push_rad=0.01)


class LocalizerPart(Protocol):
    """Turns frames into views, and keeps pose filter, tracks and map in its memory, as `Vision` does."""

    @property
    def memory(self) -> Memory | None:
        """Estimates over time; `look` updates them."""

    @property
    def colors(self) -> Colors | None:
        """Colours in use."""

    @property
    def online(self) -> CameraRefiner | None:
        """Online calibration of its camera; a player's status shows the state of an `OnlineCalibration`."""

    def look(
        self, frame: UInt8Array | Sequence[UInt8Array | None], t_s: float, *, pan_rad: float | None = None
    ) -> View:
        """Return the view of a frame."""


class BallPart(Protocol):
    """Estimates the ball, like `BallKnowledge`, which explains the arguments."""

    @property
    def sighting(self) -> BallSighting | None:
        """The player's own last sighting of the ball, for messages."""

    def place(self, t_s: float) -> Point | None:
        """Return the place of the ball, field frame."""

    def see(self, robot: PoseEstimate, ball: Ball, t_s: float, tracks: tuple[Track, ...], age_s: float) -> None:
        """Update with a ball in a frame."""

    def hold(self, robot: PoseEstimate, t_s: float) -> None:
        """Update with a ball in the robot's mouth."""

    def forget(self, t_s: float) -> None:
        """Forget all sightings before a time."""

    def locate(
        self, robot: Pose2 | None, free_space: FreeSpace | None, t_s: float, tracks: tuple[Track, ...], age_s: float
    ) -> KnownBall:
        """Return the present place of the ball."""


class TacticsPart(Protocol):
    """Chooses plans, like `Tactics`."""

    @property
    def is_keeper(self) -> bool:
        """Whether the player keeps the goal."""

    def decide(self, now: Situation) -> Plan:
        """Choose the next plan."""


class DrivingPart(Protocol):
    """Drives the robot by its plans, like `Motion`."""

    @property
    def now_mps(self) -> tuple[float, float]:
        """Velocity, robot frame."""

    @property
    def pending_mps(self) -> tuple[float, float]:
        """The last commanded velocity, robot frame."""

    def update(self, odometry: Pose2, t_s: float) -> None:
        """Update with the odometry since the last call."""

    def drive(
        self,
        plan: Plan,
        pose: Pose2,
        free_space: FreeSpace,
        t_s: float,
        moving: Sequence[Disc] = (),
        travel: Travel | None = None,
    ) -> Command:
        """Return the next command."""


def make_localizer(setup: PlayerSetup, settings: PlayerSettings, remembers: bool) -> LocalizerPart:
    """Return `Vision` with a memory, which includes tracks and map if the player remembers."""
    memory_settings = settings.memory
    if isinstance(setup.camera, PinholeCamera):
        noise = LEGS_ODOMETRY if setup.has_legs else WHEELS_ODOMETRY
        memory_settings = replace(memory_settings, odometry=noise)
    make_memory = Memory.of_everything if remembers else Memory
    memory = make_memory(setup.field, settings=memory_settings)
    if setup.rig is not None:
        return Vision(setup.field, setup.rig, memory=memory)
    calibrates = setup.camera_is_rough and settings.calibrates
    online = OnlineCalibration(setup.field, setup.camera) if calibrates else None
    return Vision(setup.field, setup.camera, memory=memory, online=online)


def make_ball(setup: PlayerSetup, settings: PlayerSettings, hides: bool, talk: TeamTalk | None) -> BallPart:
    """Return the estimator of the ball; `hides` and `talk` as in `BallKnowledge`."""
    reach_m = setup.limits.radius_m + setup.field.ball_radius_m
    nods: NoddingCamera | None = None
    if isinstance(setup.camera, PinholeCamera):
        x_m, y_m = np.abs(setup.field.floor_polygon).max(axis=0).tolist()
        nods = NoddingCamera((x_m, y_m), _blind_m(setup.camera))
    return BallKnowledge(reach_m, hides=hides, talk=talk, nods=nods)


def _blind_m(camera: PinholeCamera) -> float:
    """Return the range of the nearest floor that the camera sees straight ahead; 0 if its tilt is not known."""
    if camera.tilt_rad is None:
        return 0.0
    below = -camera.tilt_rad + math.atan((camera.size_px[1] - camera.center_px[1]) / camera.focal_px[1])
    return camera.height_m / math.tan(below) if 0.0 < below < math.pi / 2 else 0.0


def make_role(setup: PlayerSetup, settings: PlayerSettings, is_keeper: bool) -> ChoosesRole:
    """Return the chooser of roles, for players that send messages."""
    return RoleChooser(setup.number, is_keeper, setup.limits.speed_mps)


def make_tactics(setup: PlayerSetup, settings: PlayerSettings) -> TacticsPart:
    """Return the built-in tactics."""
    return Tactics(setup.field, setup.limits, setup.number, setup.players, settings.tactics)


def make_driving(setup: PlayerSetup, settings: PlayerSettings) -> DrivingPart:
    """Return the built-in driving."""
    rng = np.random.default_rng(setup.seed)
    return Motion(setup.limits, rng, settings.motion, sees_ahead_only=setup.sees_ahead_only)


@dataclass(frozen=True, slots=True)
class PlayerParts:
    """Makers of the parts of a player.

    Parameters
    ----------
    localizer, ball, role, tactics, driving : callable
        Each returns its part; see the functions above for the arguments.
    """

    localizer: Callable[[PlayerSetup, PlayerSettings, bool], LocalizerPart] = make_localizer
    ball: Callable[[PlayerSetup, PlayerSettings, bool, TeamTalk | None], BallPart] = make_ball
    role: Callable[[PlayerSetup, PlayerSettings, bool], ChoosesRole] = make_role
    tactics: Callable[[PlayerSetup, PlayerSettings], TacticsPart] = make_tactics
    driving: Callable[[PlayerSetup, PlayerSettings], DrivingPart] = make_driving
