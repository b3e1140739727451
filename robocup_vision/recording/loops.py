"""The kinds of loops that can be recorded, and how each repeats its calls.

A recording names its loop. "vision" is the loop of `Vision` and `Steering`, recorded by `Recorder`. Other packages
register theirs, such as a simulated player, as entry points of the group ``robocup_vision.loops``: `LoopKind`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib.metadata import entry_points
from typing import Any, NamedTuple, Protocol

from field_models.errors import ArgumentError, RobocupVisionError
from field_models.field import Field
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import Mounting, PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.memory import Memory
from robocup_vision.perception.color_table import Colors
from robocup_vision.recording.calls import DROPPED, FORGET, LOOK, PREDICT, STEER, Call, look_outputs, steer_outputs
from robocup_vision.recording.run import MemoryRun, Run
from robocup_vision.view import View

GROUP = "robocup_vision.loops"


@dataclass(frozen=True, slots=True, eq=False)
class Changes:
    """Settings that a replay changes; None: as in the run."""

    #: as in `Vision`
    field: Field | None = None
    camera: OmniCamera | PinholeCamera | None = None
    colors: Colors | None = None
    method: str | None = None
    memory: bool | None = None  #: True: with a memory of everything; False: without memory

    @property
    def any(self) -> bool:
        """Whether anything is changed."""
        return any(value is not None for value in (self.field, self.camera, self.colors, self.method, self.memory))


class FrameStep(NamedTuple):
    """What a call says of a frame: whether it processes one, its time, and the robot's motion before it."""

    looks: bool
    t_s: float | None = None
    odometry: Pose2 | None = None
    prior: PoseEstimate | Pose2 | None = None
    mounting: Mounting | None = None


def mounting_of(pan_rad: float | None, mounting: Mounting | None = None) -> Mounting | None:
    """Return the camera's mounting by two arguments of `Vision.look`; the pan angle replaces that of the mounting."""
    if pan_rad is None:
        return mounting
    return Mounting(pan_rad=pan_rad) if mounting is None else replace(mounting, pan_rad=pan_rad)


class Loop(Protocol):
    """Repeats the calls of a run."""

    def call(self, call: Call) -> Mapping[str, Any]:
        """Repeat one call; return its outputs, with the same keys as the recorded ones."""
        ...


class LoopKind(Protocol):
    """One kind of loop."""

    @property
    def types(self) -> Mapping[str, str]:
        """Classes of values in its calls, other than the library's own: class name to module."""
        ...

    def make(self, run: Run, changes: Changes) -> Loop:
        """Make the loop of a run in its initial state, with the changes applied."""
        ...

    def frame_step(self, kind: str, inputs: Mapping[str, Any]) -> FrameStep:
        """Return what a call says of a frame."""
        ...


class VisionLoopKind:
    """The loop of `Vision` and `Steering`."""

    types: Mapping[str, str] = {}

    def make(self, run: Run, changes: Changes) -> Loop:
        """Make the loop; see `LoopKind`.

        Raises
        ------
        ArgumentError
            If the recording does not hold the settings of its Vision, or another kind of camera comes without a method.
        """
        if run.vision is None:
            raise ArgumentError("the recording does not say what its Vision was made of")
        new = run.vision
        for name in ("field", "camera", "colors", "method"):
            value = getattr(changes, name)
            if value is not None:
                new = replace(new, **{name: value})
        if changes.camera is not None and changes.method is None and type(changes.camera) is not type(run.camera):
            raise ArgumentError("another kind of camera needs a method, too (--method)")
        if changes.memory is not None:
            new = replace(new, memory=MemoryRun.of(Memory.of_everything(new.field)) if changes.memory else None)
        return _VisionLoop(replace(run, vision=new))

    def frame_step(self, kind: str, inputs: Mapping[str, Any]) -> FrameStep:
        """Return what a call says of a frame; see `LoopKind`."""
        if kind == PREDICT:
            return FrameStep(False, odometry=inputs["odometry"])
        if kind != LOOK:
            return FrameStep(False)
        if inputs.get(DROPPED):
            return FrameStep(False, odometry=inputs["odometry"])
        mounting = mounting_of(inputs["pan_rad"], inputs.get("mounting"))
        return FrameStep(True, inputs["t_s"], inputs["odometry"], inputs["prior"], mounting)


class _VisionLoop:
    def __init__(self, run: Run) -> None:
        assert run.vision is not None
        self._vision = run.vision.make()
        self._steering = None if run.steering is None else run.steering.make()
        self._view: View | None = None

    def call(self, call: Call) -> Mapping[str, Any]:
        if call.kind == LOOK:
            inputs = dict(call.inputs)
            if inputs.pop(DROPPED, False):
                self._view = self._vision.look(None, **inputs)
                return look_outputs(self._view)
            if call.frame is None:
                raise RobocupVisionError(f"call {call.number}, a look, has no image in the recording")
            self._view = self._vision.look(call.frame, **call.inputs)
            return look_outputs(self._view)
        if call.kind == PREDICT:
            if self._vision.memory is not None:
                self._vision.predict(**call.inputs)
            return {}
        if call.kind == FORGET:
            self._vision.forget()
            if self._steering is not None:
                self._steering.forget()
            return {}
        if call.kind == STEER and self._steering is not None:
            inputs = dict(call.inputs)
            if inputs["free_space"] is None and self._view is not None:
                inputs["free_space"] = self._view.free_space
            return steer_outputs(self._steering.steer(**inputs))
        raise RobocupVisionError(f"call {call.number} is of a kind {call.kind!r} that this version does not know")


def loop_kind(name: str) -> LoopKind:
    """Return the kind of loop with a name.

    Raises
    ------
    RobocupVisionError
        If no installed package registers it.
    """
    if name == "vision":
        return VisionLoopKind()
    for point in entry_points(group=GROUP):
        if point.name == name:
            kind: LoopKind = point.load()()
            return kind
    raise RobocupVisionError(f"the recording is of a loop {name!r}, which no installed package brings")
