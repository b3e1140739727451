"""Records a run while it runs: frames and messages for viewers, and exact calls for the replay.

The robot's loop only hands over references and a copy of the frame; a thread makes and writes the messages.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray, Frame, UInt8Array
from robocup_vision.avoidance.steering import FreeRanges, Steering, SteeringCommand
from robocup_vision.camera.pinhole import Mounting
from robocup_vision.closing import Closing
from robocup_vision.disc import Disc
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.messages.topics import Outgoing
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.pipeline.frames import to_bgr
from robocup_vision.recording.call_writer import CallWriter, RecorderSettings
from robocup_vision.recording.calls import DROPPED, FORGET, LOOK, PREDICT, STEER, look_outputs, steer_outputs
from robocup_vision.recording.run import Run
from robocup_vision.view import View
from robocup_vision.vision import Vision


class Recorder(Closing):
    """Records the arguments and results of the calls of a `Vision` and a `Steering`.

    Call `look`, `predict`, `steer` and `forget` of this object instead of theirs; or call theirs, and hand over
    arguments and results (`add_look`). If the recording starts before the first frame, or after `forget`,
    `robocup-vision replay` repeats the run bit for bit.

    Parameters
    ----------
    path : str or Path
        The file, ``.mcap``; an existing one is replaced.
    steering : Steering, optional
        The object that steers.

    Raises
    ------
    FileError
        If the file cannot be written.
    RobocupVisionError
        If the extra `ros` is not installed.

    Examples
    --------
    >>> with Recorder("run.mcap", vision, steering) as recorder:  # doctest: +SKIP
    ...     view = recorder.look(frame, t_s=t_s, odometry=odometry)
    ...     command = recorder.steer(view.free_space, velocity_mps, target_bearing_rad)
    """

    def __init__(
        self,
        path: str | Path,
        vision: Vision,
        steering: Steering | None = None,
        settings: RecorderSettings = RecorderSettings(),
    ) -> None:
        self._vision, self._steering = vision, steering
        self._calls = CallWriter(path, Run.of(vision, steering), settings)
        self.path = self._calls.path
        self._view: View | None = None
        self._t_s: float | None = None

    @property
    def dropped(self) -> int:
        """Number of calls and messages dropped, with `when_full` "drop"."""
        return self._calls.dropped

    def look(
        self,
        frame: Frame | None,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
        pan_rad: float | None = None,
        mounting: Mounting | None = None,
    ) -> View:
        """Call `Vision.look`, and record the call."""
        with self._calls.in_call():
            view = self._vision.look(frame, t_s, odometry, prior, pan_rad, mounting)
            self.add_look(view, frame, t_s, odometry, prior, pan_rad, mounting)
        return view

    def add_look(
        self,
        view: View,
        frame: Frame | None,
        t_s: float | None = None,
        odometry: Pose2 | None = None,
        prior: PoseEstimate | Pose2 | None = None,
        pan_rad: float | None = None,
        mounting: Mounting | None = None,
    ) -> None:
        """Record a look that has been made: the view, and the arguments of `Vision.look`."""
        self._view = view
        at_s = self._at(t_s)
        inputs: dict[str, Any] = {"t_s": t_s, "odometry": odometry, "prior": prior, "pan_rad": pan_rad}
        if mounting is not None:
            inputs["mounting"] = mounting
        # recordings hold BGR, whichever order the camera uses
        kept = None if frame is None else own_frame(to_bgr(cast("UInt8Array", frame), self._vision.channels))
        if kept is None:
            inputs[DROPPED] = True
        topics = self._calls.topics
        # the writer finds markings later, when the caller may have overwritten the frame
        shown = view if kept is None else view.of_frame(kept)

        def messages() -> Iterator[Outgoing]:
            if odometry is not None:
                yield from topics.of_odometry(odometry, at_s)
            if kept is not None:
                yield from topics.of_frame(kept, at_s)
            yield from topics.of_look(shown, at_s)

        size_bytes = 0 if kept is None else kept.nbytes
        self._calls.add_call(LOOK, at_s, inputs, lambda: look_outputs(view), messages, size_bytes)

    def predict(self, odometry: Pose2, t_s: float) -> None:
        """Call `Vision.predict`, and record the call."""
        self._vision.predict(odometry, t_s)
        self._t_s = t_s
        topics = self._calls.topics
        inputs = {"odometry": odometry, "t_s": t_s}
        self._calls.add_call(PREDICT, t_s, inputs, dict, lambda: topics.of_odometry(odometry, t_s))

    def steer(
        self,
        free_space: FreeRanges,
        velocity_mps: Sequence[float] | FloatArray,
        target_bearing_rad: float,
        target_distance_m: float | None = None,
        pending_mps: Sequence[float] | FloatArray | None = None,
        moving: Sequence[Disc] = (),
        speed_mps: float | None = None,
    ) -> SteeringCommand:
        """Call `Steering.steer`, and record the call.

        Raises
        ------
        ArgumentError
            If the recorder was made without a `Steering`.
        """
        if self._steering is None:
            raise ArgumentError("steer needs a Steering: Recorder(path, vision, steering)")
        moving = tuple(moving)
        with self._calls.in_call():
            command = self._steering.steer(
                free_space, velocity_mps, target_bearing_rad, target_distance_m, pending_mps, moving, speed_mps
            )
        # the view's own free space is not recorded, so that a replay with other settings steers by its own view
        of_view = self._view is not None and free_space is self._view.free_space
        inputs = {
            "free_space": None
            if of_view
            else FreeSpace(np.array(free_space.bearing_rad), np.array(free_space.range_m)),
            "velocity_mps": tuple(float(v) for v in velocity_mps),
            "target_bearing_rad": float(target_bearing_rad),
            "target_distance_m": target_distance_m,
            "pending_mps": None if pending_mps is None else tuple(float(v) for v in pending_mps),
            "moving": moving,
            "speed_mps": speed_mps,
        }
        at_s = self._calls.clock_s if self._t_s is None else self._t_s
        topics = self._calls.topics
        self._calls.add_call(
            STEER, at_s, inputs, lambda: steer_outputs(command), lambda: topics.of_command(command, at_s)
        )
        return command

    def forget(self) -> None:
        """Call `forget` of `Vision` and `Steering`, and record the call."""
        self._vision.forget()
        if self._steering is not None:
            self._steering.forget()
        self.add_forget()

    def add_forget(self) -> None:
        """Record that `Vision` and `Steering` have been made to forget."""
        at_s = self._calls.clock_s if self._t_s is None else self._t_s
        self._calls.add_call(FORGET, at_s, {}, dict, list)

    def add_truth(self, robot: Pose2, t_s: float, ball_m: tuple[float, float] | None = None) -> None:
        """Record the true pose of the robot, and of the ball, on topics that replays do not read."""
        topics = self._calls.topics
        self._calls.add_messages(lambda: topics.of_truth(robot, t_s, ball_m))

    def close(self) -> None:
        """Write the waiting calls, and close the file; raises as `CallWriter.close`."""
        self._calls.close()

    def _at(self, t_s: float | None) -> float:
        if t_s is None:
            return self._calls.clock_s
        self._t_s = t_s
        return t_s


def own_frame(frame: UInt8Array) -> UInt8Array:
    """Return a frame, or a copy of it if the caller may still write to it."""
    if frame.base is None and not frame.flags.writeable:
        return frame
    return np.array(frame)
