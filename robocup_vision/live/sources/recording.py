"""Frames from a recording, processed again with the run's settings, and shown with the commands and the truth."""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from field_models import load_field
from field_models.errors import FileError
from robocup_vision.camera import load_camera
from robocup_vision.live.handover.moment import RobotPlan, RobotSetup
from robocup_vision.live.sources.source import Source, SourceFrame, SourceOptions, memory_for
from robocup_vision.memory import Memory
from robocup_vision.perception.color_table import load_colors
from robocup_vision.recording.recording import RecordedFrame, Recording
from robocup_vision.vision import Vision

# a command belongs to a frame if it was given within this time after it
_BESIDE_S = 0.2

T = TypeVar("T")


class RecordingSource(Source):
    """A recording; times count from its beginning. The options take precedence over the recorded settings.

    Raises FileError if it is not a recording that can be read, or has no frames.
    """

    waits = True

    def __init__(self, path: str | Path, options: SourceOptions) -> None:
        self.name = str(path)
        self._options = options
        self._recording = Recording(path)
        span = self._recording.span_s
        if span is None:
            raise FileError(path, "holds no frame")
        self._begin_s = span[0]
        self.duration_s = span[1] - span[0]
        run = self._recording.run
        field = run.field if options.field is None else load_field(options.field)
        camera = run.camera if options.camera is None else load_camera(options.camera)
        self.setups = (RobotSetup(Path(path).stem, field, camera, field.robot_radius_m),)
        self._truth = self._recording.truth()
        self._commands = self._recording.commands()
        self._frames: Iterator[RecordedFrame] = self._recording.frames()

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """Return the vision for the frames: as in the run, except for the options."""
        run, options = self._recording.run, self._options
        camera = setup.camera
        assert camera is not None
        colors = run.colors if options.colors is None else load_colors(options.colors)
        method = options.method
        if run.vision is not None and type(camera) is type(run.camera):
            method = method or run.vision.method
            if not options.memory:
                return replace(run.vision, field=setup.field, camera=camera, colors=colors, method=method).make()
        memory = memory_for(setup, camera, has_odometry=True) if options.memory else Memory(setup.field)
        return Vision(setup.field, camera, colors, method=method, memory=memory)

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """Return the next frame; raises as `Source.read`."""
        recorded = next(self._frames, None)
        if recorded is None:
            return None
        t_s = recorded.t_s
        return (
            SourceFrame(
                self.setups[0].name,
                recorded.frame,
                t_s - self._begin_s,
                recorded.odometry,
                recorded.mounting,
                prior=recorded.prior,
                plan=RobotPlan(_at(self._commands, t_s + _BESIDE_S, t_s)),
                truth=_at(self._truth, t_s + 1e-6, t_s - 1e-6),
            ),
        )

    def seek(self, t_s: float) -> None:
        """Go to the first frame at or after a time."""
        self._frames = self._recording.frames(from_s=self._begin_s + t_s)

    def close(self) -> None:
        """Close the file."""
        self._frames = iter(())


def _at(values: list[tuple[float, T]], latest_s: float, earliest_s: float) -> T | None:
    """Return the first value between two times."""
    index = bisect.bisect_left(values, earliest_s, key=lambda item: item[0])
    return values[index][1] if index < len(values) and values[index][0] <= latest_s else None
