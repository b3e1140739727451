"""Records a source's frames and what is seen in them, without a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from field_models.errors import ArgumentError, FrameError
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.live.sources.source import Source, SourceFrame
from robocup_vision.recording.call_writer import RecorderSettings
from robocup_vision.recording.recorder import Recorder
from robocup_vision.view import View

# a source without a frame for this time is checked for problems
_PATIENCE_S = 0.5


@dataclass(frozen=True, slots=True)
class RecordedSummary:
    """Numbers of frames recorded, located, and not usable, and the problem of the first one that was not usable."""

    frames: int
    located: int
    unusable: int
    first_problem: str


def record_source(
    source: Source,
    path: str | Path,
    settings: RecorderSettings = RecorderSettings(),
    seconds: float | None = None,
    *,
    show: Callable[[SourceFrame, View], None] | None = None,
    say: Callable[[str], None] = print,
) -> RecordedSummary:
    """Process a source's frames and record them, until they end, the time is up, or the program is interrupted.

    Parameters
    ----------
    source : Source
        Source of one robot's frames, with a camera file.
    seconds : float, optional
        Duration, by the frames' times; default: until they end.
    show : callable, optional
        Called with each frame and its view.
    say : callable
        Called with a line when a live source stops giving frames, or gives them again.

    Raises
    ------
    ArgumentError
        If the time is not positive, or the source is not one robot's with a camera file.
    FileError
        If the recording cannot be written.
    """
    if seconds is not None and not seconds > 0:
        raise ArgumentError(f"--seconds must be positive, got {seconds:g}")
    [setup, *others] = source.setups
    vision = None if others else source.make_vision(setup)
    if vision is None:
        raise ArgumentError(
            f"{source.name}: record needs the frames of one robot and its camera file (--camera); a simulated match is"
            " recorded by `robocup-vision match --record`"
        )
    count = located = 0
    problems: list[str] = []
    begin_s: float | None = None
    moved: Pose2 | None = None
    with Recorder(path, vision, settings=settings) as recorder, suppress(KeyboardInterrupt):
        for now in _frames(source, say):
            if isinstance(now, FrameError):
                problems.append(str(now))
                continue
            begin_s = now.t_s if begin_s is None else begin_s
            if seconds is not None and now.t_s - begin_s >= seconds:
                break
            if now.odometry is not None:
                # the motion before a frame that could not be used is kept
                moved = now.odometry if moved is None else moved.compose(now.odometry)
            if now.alone:
                recorder.forget()
            try:
                view = recorder.look(now.frame, now.t_s, moved, now.prior, mounting=now.mounting)
            except FrameError as error:
                problems.append(str(error))
                continue
            moved = None
            count += 1
            located += isinstance(view.pose, PoseEstimate)
            if now.truth is not None:
                recorder.add_truth(now.truth, now.t_s)
            if show is not None:
                show(now, view)
    return RecordedSummary(count, located, len(problems), problems[0] if problems else "")


def _frames(source: Source, say: Callable[[str], None]) -> Iterator[SourceFrame | FrameError]:
    """Yield frames or the errors of damaged ones until they end; report when frames stop, and when they resume."""
    said = ""
    while True:
        try:
            frames = source.read(_PATIENCE_S)
        except FrameError as error:
            yield error
            continue
        if frames is None:
            return
        if source.problem != said:
            said = source.problem
            say(f"{source.name}: {said}" if said else f"{source.name}: gives frames again")
        yield from frames
