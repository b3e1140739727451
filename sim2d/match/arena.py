"""Connects the world with players or learners: it makes each robot's senses and executes its commands.

A player receives `Senses` and nothing else.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.camera import PinholeCamera, Rig
from sim2d.match.disturbances import Disturbances, disturbances_for
from sim2d.match.setups import Camera, RobotKind, setup_for
from sim2d.rendering.sensor import Sensor
from sim2d.robot_link import CONTROL_PERIOD_S, Command, PlayerSetup, RobotLimits, Senses
from sim2d.sensors.body_sway import UPRIGHT, BodySway
from sim2d.sensors.faults import BodyFault, Fault, FaultySenses, LateFrames, SenseFault
from sim2d.sensors.match_camera import MATCH_SENSOR, LightDrift, MatchCamera
from sim2d.sensors.team_channel import UNDISTURBED, TeamChannel
from sim2d.sensors.true_cameras import TrueCamera, with_stated_errors
from sim2d.world.referee import RefereeFactory
from sim2d.world.state import WorldState
from sim2d.world.world import World, WorldSettings

# number of the random stream of each source of randomness
_WORLD, _SENSOR, _FAULTS, _PLAYERS, _SWAY, _LATENCY, _LIGHT, _CAMERA, _CHANNEL = range(9)


class Arena:
    """A field with robots, with the interface of their players.

    Parameters
    ----------
    field : Field
        The pitch.
    players : int or None
        Robots per side; None: as in the field's league (`sim2d.match.setups`).
    seed : int
        The same seed gives the same senses for the same commands, bit for bit.
    camera : OmniCamera, PinholeCamera or Rig, optional
        The camera of every robot; by default that of the field's league.
    robot : RobotKind, optional
        The kind of all robots; by default that of the field's league.
    limits : RobotLimits, optional
        Limits of every robot, in place of the kind's.
    faults : sequence of Fault
        Faults of senses and bodies.
    physics : WorldSettings, optional
        Physics of bodies and ball; by default the robots'.
    sensor : Sensor
        Lens and sensor of every camera.
    referee : RefereeFactory, optional
        Makes the referee; by default that of `sim2d.world.referee`, with simple rules.
    disturbances : Disturbances, optional
        Disturbances of bodies, frames, odometry and light; by default those of robots and camera (`disturbances_for`).

    Raises
    ------
    ArgumentError
        If robots, camera and field do not fit (`check_setup`), the seed is negative, or a fault's robot does not exist.
    """

    def __init__(
        self,
        field: Field,
        players: int | None,
        seed: int,
        *,
        camera: Camera | Rig | None = None,
        robot: RobotKind | None = None,
        limits: RobotLimits | None = None,
        faults: Sequence[Fault] = (),
        physics: WorldSettings | None = None,
        sensor: Sensor = MATCH_SENSOR,
        referee: RefereeFactory | None = None,
        disturbances: Disturbances | None = None,
    ) -> None:
        if seed < 0:
            raise ArgumentError(f"seed must not be negative, got {seed}")
        setup = setup_for(field, players=players, camera=camera, robot=robot, limits=limits)
        self.field = field
        self.players = players = setup.players
        self.rig = setup.rig
        self.camera, self.limits, self._has_legs = setup.camera, setup.robot.limits, setup.robot.has_legs
        self.faults = tuple(faults)
        usual = disturbances_for(setup.robot, self.camera, self.rig)
        self.disturbances = usual if disturbances is None else disturbances
        if self.rig is not None and not {"shutter", "camera", "knock"}.isdisjoint(self.disturbances.names):
            raise ArgumentError("shutter, camera and knock are of robots with one camera: these have several")
        physics = setup.robot.physics if physics is None else physics
        if self.disturbances.slip is not None:
            physics = dataclasses.replace(physics, body=self.disturbances.slip.of(physics.body))
        judge = None if referee is None else referee(field, self.limits)
        self.world = World(field, players, self.limits, np.random.default_rng([seed, _WORLD]), physics, judge)
        robots = range(2 * players)
        for fault in faults:
            if fault.robot not in robots:
                raise ArgumentError(f"a fault must name a robot from 0 to {2 * players - 1}, got {fault.robot}")
        camera_rng = np.random.default_rng([seed, _SENSOR])
        shutter = self.disturbances.shutter
        self._cameras = [
            MatchCamera(field, camera, self.limits, camera_rng, sensor=sensor, shutter=shutter)
            for camera in ((self.camera,) if self.rig is None else self.rig.cameras)
        ]
        self._faulty = [
            FaultySenses(
                [f for f in faults if isinstance(f, SenseFault) and f.robot == index],
                np.random.default_rng([seed, _FAULTS, index]),
            )
            for index in robots
        ]
        self._sways, self._late = self._disturb(seed)
        settings = UNDISTURBED if self.disturbances.messages is None else self.disturbances.messages
        self._channels = [
            TeamChannel(settings, [np.random.default_rng([seed, _CHANNEL, side * players + k]) for k in range(players)])
            for side in range(2)
        ]
        self._body_faults = sorted((f for f in faults if isinstance(f, BodyFault)), key=lambda f: (f.at_s, f.robot))
        self._player_seeds = np.random.default_rng([seed, _PLAYERS]).integers(2**31, size=len(robots)).tolist()

    def _disturb(self, seed: int) -> tuple[list[BodySway], list[LateFrames]]:
        """Return sways and late frames, empty if the disturbance is off; set up drifting light and true cameras."""
        on, robots = self.disturbances, range(2 * self.players)
        sways, late = [], []
        if on.sway is not None:
            sways = [BodySway(on.sway, self.limits, np.random.default_rng([seed, _SWAY, k])) for k in robots]
        if on.latency is not None:
            late = [LateFrames(on.latency, np.random.default_rng([seed, _LATENCY, k])) for k in robots]
        self._drift: LightDrift | None = None
        if on.drift is not None:
            self._drift = LightDrift(on.drift, self._cameras[0].light, np.random.default_rng([seed, _LIGHT]))
        self._true_cameras = [TrueCamera(on.camera, on.knock, self.camera, [seed, _CAMERA, k]) for k in robots]
        for k, true in enumerate(self._true_cameras):
            if on.camera is not None:
                self._cameras[0].set_camera(k, true.camera)
        return sways, late

    @property
    def state(self) -> WorldState:
        """The truth now."""
        return self.world.state

    def true_camera(self, index: int) -> Camera:
        """Return the camera by which a robot's frames are drawn now; players do not know it."""
        return self._true_cameras[index].camera

    def knock_s(self, index: int) -> float:
        """Return when a robot's camera is knocked; infinite: never. Players do not know it."""
        return self._true_cameras[index].knock_s

    def setup(self, index: int) -> PlayerSetup:
        """Return a robot's setup: its player's data before the match."""
        robot, on = self.world.state.robots[index], self.disturbances
        camera = self.camera
        if isinstance(camera, PinholeCamera) and on.shutter is not None:
            camera = dataclasses.replace(camera, readout_s=on.shutter.readout_s)
        if isinstance(camera, PinholeCamera) and on.camera is not None:
            camera = with_stated_errors(camera, on.camera)
        return PlayerSetup(
            self.field,
            camera,
            self.limits,
            robot.side,
            robot.number,
            self.players,
            self._player_seeds[index],
            camera_is_rough=on.camera is not None or on.knock is not None,
            has_legs=self._has_legs,
            rig=self.rig,
        )

    def senses(self) -> tuple[Senses, ...]:
        """Return the senses of each robot now; call it once each control period.

        The frames are read-only and not referenced elsewhere.
        """
        self._apply_body_faults()
        state = self.world.state
        sensed = []
        if self._drift is not None:
            light = self._drift.at(state.t_s)
            for camera in self._cameras:
                camera.set_light(light)
        for index, true in enumerate(self._true_cameras):
            if true.is_knocked_by(state.t_s):
                self._cameras[0].set_camera(index, true.camera)
        kickers = {index for event in state.events if event.kind == "kick" for index in event.robots}
        for robot in state.robots:
            sway = UPRIGHT
            if self._sways:
                sway = self._sways[robot.index].update(robot, robot.index in kickers)
            frames = tuple(camera.render(state, robot.index, sway) for camera in self._cameras)
            senses = Senses(
                state.t_s,
                frames[0],
                state.t_s,
                self.world.odometry(robot.index),
                self.world.ball_in_mouth(robot.index),
                state.phase,
                state.kick_off_side == robot.side,
                robot.pan_rad if self.rig is None and isinstance(self.camera, PinholeCamera) else None,
                state.placement_m,
                self._channels[robot.index // self.players].received(robot.index % self.players, state.t_s),
                None if self.rig is None else frames,
            )
            if self._late:
                senses = self._late[robot.index].apply(senses)
            sensed.append(self._faulty[robot.index].apply(senses))
        return tuple(sensed)

    def step(self, commands: Mapping[int, Command]) -> WorldState:
        """Execute the robots' commands for one control period and send their messages; return the truth afterwards."""
        for index, command in commands.items():
            if command.message is not None:
                side, number = divmod(index, self.players)
                self._channels[side].send(number, command.message, self.world.t_s)
        self.world.step(commands)
        return self.world.state

    def _apply_body_faults(self) -> None:
        while self._body_faults and self._body_faults[0].at_s <= self.world.t_s + CONTROL_PERIOD_S / 2:
            fault = self._body_faults.pop(0)
            if fault.carry_to is not None:
                self.world.place(fault.robot, fault.carry_to)
            if any(fault.push_m) or fault.turn_rad:
                self.world.push(fault.robot, *fault.push_m, fault.turn_rad)
