"""Recordings of the robots of a match, with the inputs and outputs of each player and the truth; and their replay.

A replay makes the same player again and passes it the recorded senses; its commands are the same, bit for bit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.messages.topics import Outgoing
from robocup_vision.recording.call_writer import CallWriter, RecorderSettings
from robocup_vision.recording.calls import Call, view_digest
from robocup_vision.recording.loops import Changes, FrameStep, Loop, mounting_of
from robocup_vision.recording.run import Run
from robocup_vision.view import View
from sim2d.match.match import Match, Seat
from sim2d.players.catalog import PLAYERS, player_factory
from sim2d.robot_link import Command, PlayerStatus, Senses
from sim2d.world.state import Moment, RobotMoment

LOOP_NAME = "sim2d.player"
_ACT = "act"
_TYPES = {"RobotLimits": "sim2d.robot_link", "PlayerSetup": "sim2d.robot_link"}
_INPUTS = tuple(field.name for field in dataclasses.fields(Senses) if field.name != "frame")


class MatchRecorders:
    """Writes a recording for each robot; needs the extra `ros`.

    Parameters
    ----------
    folder : Path
        Folder of the files robot_0.mcap and so on.
    players : (str, str)
        Names of the players of both sides, the one that attacks +x first.

    Raises
    ------
    FileError
        If a file cannot be written.
    RobocupVisionError
        If the extra is not installed.
    """

    def __init__(self, folder: Path, match: Match, players: tuple[str, str]) -> None:
        self._writers: list[_RobotRecorder] = []
        arena = match.arena
        if arena.rig is not None:
            raise ArgumentError("a recording holds the frames of one camera, and these robots carry several")
        for robot in arena.state.robots:
            name = players[0] if robot.side > 0 else players[1]
            caveat = "" if name in PLAYERS else f"the player {name!r} is not one of {', '.join(PLAYERS)}"
            setup = {"player": name, "setup": arena.setup(robot.index)}
            run = Run(LOOP_NAME, arena.field, arena.camera, None, caveat, setup=setup)
            self._writers.append(_RobotRecorder(folder / f"robot_{robot.index}.mcap", run))

    @property
    def paths(self) -> tuple[Path, ...]:
        """Paths of the files."""
        return tuple(writer.path for writer in self._writers)

    def add(self, moment: Moment) -> None:
        """Record one control period of every robot."""
        for index, (writer, robot) in enumerate(zip(self._writers, moment.robots, strict=True)):
            writer.add(robot, moment, index)

    def close(self) -> None:
        """Write the remaining calls, and close the files."""
        for writer in self._writers:
            writer.close()


class _RobotRecorder:
    def __init__(self, path: Path, run: Run) -> None:
        self._calls = CallWriter(path, run, RecorderSettings(), _TYPES)
        self.path = path
        self.close = self._calls.close
        self._view: View | None = None

    def add(self, robot: RobotMoment, moment: Moment, index: int) -> None:
        senses, status, command, topics = robot.senses, robot.status, robot.command, self._calls.topics
        inputs = {name: getattr(senses, name) for name in _INPUTS}
        # a player without a new frame has no new view
        view = None if status.view is self._view else status.view
        self._view = status.view
        frame_s = senses.t_s if senses.frame_t_s is None else senses.frame_t_s
        truth, ball = moment.state.robots[index].pose, moment.state.ball

        def messages() -> Iterator[Outgoing]:
            yield from topics.of_odometry(senses.odometry, senses.t_s)
            if senses.frame is not None:
                yield from topics.of_frame(senses.frame, frame_s)
            if view is not None:
                yield from topics.of_look(view, frame_s)
            yield from topics.of_command((command.forward_mps, command.left_mps, command.turn_rps), senses.t_s)
            yield from topics.of_truth(truth, moment.state.t_s, None if ball is None else (ball.x_m, ball.y_m))

        size = 0 if senses.frame is None else senses.frame.nbytes
        outputs = partial(_outputs, command, status, view)
        self._calls.add_call(_ACT, senses.t_s, inputs, outputs, messages, size)


def _outputs(command: Command, status: PlayerStatus, view: View | None) -> dict[str, Any]:
    """Return a player's outputs, with the digest of its view if that is new."""
    return {
        "pose": None if view is None else view.pose,
        "ball": None if view is None else view.ball,
        "belief": status.pose,
        "velocity_mps": (command.forward_mps, command.left_mps),
        "turn_rps": command.turn_rps,
        "kick_mps": command.kick_mps,
        "dribble": command.dribble,
        "pan_rad": command.pan_rad,
        "ball_in_field": status.ball_in_field,
        "intent": status.intent,
        "digest": None if view is None else view_digest(view),
    }


class PlayerLoopKind:
    """The loop of a simulated player: an entry point of the group ``robocup_vision.loops``."""

    types: Mapping[str, str] = _TYPES

    def make(self, run: Run, changes: Changes) -> Loop:
        """Make the player again, with another field or camera if asked; see `LoopKind`.

        Raises
        ------
        ArgumentError
            If method, colours or memory are to be changed: a player has its own.
        RobocupVisionError
            If the player is not built in.
        """
        if changes.method is not None or changes.colors is not None or changes.memory is not None:
            raise ArgumentError(
                "a simulated player has its own method, colours and memory: only field and camera change"
            )
        if run.caveat:
            raise RobocupVisionError(f"this recording cannot be replayed: {run.caveat}")
        setup: Any = run.setup["setup"]
        setup = dataclasses.replace(setup, field=changes.field or setup.field, camera=changes.camera or setup.camera)
        return _PlayerLoop(Seat(player_factory(str(run.setup["player"])), setup))

    def frame_step(self, kind: str, inputs: Mapping[str, Any]) -> FrameStep:
        """Return what a call says of a frame; see `LoopKind`."""
        looks = inputs["frame_t_s"] is not None
        mounting = mounting_of(inputs["frame_pan_rad"])
        return FrameStep(looks, inputs["frame_t_s"], inputs["odometry"], None, mounting)


class _PlayerLoop:
    def __init__(self, seat: Seat) -> None:
        self._seat = seat
        self._view: View | None = None

    def call(self, call: Call) -> Mapping[str, Any]:
        robot = self._seat.act(Senses(frame=call.frame, **call.inputs))
        view = None if robot.status.view is self._view else robot.status.view
        self._view = robot.status.view
        return _outputs(robot.command, robot.status, view)
