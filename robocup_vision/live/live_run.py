"""Runs `robocup-vision live`: loops over sources, and the controls that a page may use."""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from field_models.errors import ArgumentError, RobocupVisionError
from robocup_vision.live.calibrating import Calibrator
from robocup_vision.live.handover.controls import Controls
from robocup_vision.live.handover.moment import Display, Moment, RobotSetup
from robocup_vision.live.sources.opening import open_source, recordings_in
from robocup_vision.live.sources.source import PlacingSource, Source, SourceFrame, SourceOptions
from robocup_vision.live.sources.source_loop import SourceLoop

if TYPE_CHECKING:
    from robocup_vision.recording.recorder import Recorder


class LiveRun(Controls):
    """Runs one or several sources at the same time.

    Parameters
    ----------
    make_display : callable
        Returns the display, which shows the moments and passes the pages' requests to these controls.
    sources : sequence of Source
        The sources that are shown first; closed at the end.
    out : Path
        Folder for recordings and calibrations.
    folder : Path, optional
        A page may open the recordings in this folder, and no other files.
    quiet : bool
        Print nothing on standard error; messages appear only on the pages.
    also_watch : callable, optional
        Called with each frame and its moment, in the loops' threads.

    Raises
    ------
    RobocupVisionError
        If two robots have the same name, or the `Vision` of a source's robot cannot be made.
    """

    def __init__(
        self,
        make_display: Callable[[Controls], Display],
        sources: Sequence[Source],
        options: SourceOptions,
        out: Path,
        *,
        folder: Path | None = None,
        quiet: bool = False,
        also_watch: Callable[[SourceFrame, Moment], None] | None = None,
    ) -> None:
        self._also_watch = also_watch
        self._options, self._out = options, out
        self._folder, self._quiet = folder, quiet
        self._display = make_display(self)
        self._lock = threading.RLock()
        self._loops: list[SourceLoop] = []
        self._recorders: dict[str, Recorder] = {}
        self._record_path: Path | None = None
        self._paused = False
        self._calibrator: Calibrator | None = None
        self._use(sources)
        names = [] if folder is None else list(recordings_in(folder))
        self._display.set_status(recordings=names, opened="")

    @property
    def loops(self) -> tuple[SourceLoop, ...]:
        """The loops that run now."""
        return tuple(self._loops)

    def _use(self, sources: Sequence[Source]) -> None:
        names = [setup.name for source in sources for setup in source.setups]
        for name in names:
            if names.count(name) > 1:
                raise ArgumentError(f"{name}: is named twice")
        self._loops = []
        self._calibrator = None
        offers = {"save"} | ({"open"} if self._folder is not None else set())
        if sources and all(source.waits for source in sources):
            offers.add("pause")
            if all(source.duration_s is not None for source in sources):
                offers.add("seek")
        if len(sources) == 1 and sources[0].setups[0].camera is None:
            offers = offers - {"save"} | {"calibrate"}
            self._calibrator = Calibrator(self._display, sources[0].setups[0], self._out, self.say, self._use_camera)
        if len(sources) == 1 and isinstance(sources[0], PlacingSource):
            offers = offers | {"place"}
        for source in sources:
            self._loops.append(SourceLoop(source, self._display, self._watch, self.say, self._tell))
        if all(loop.vision(setup.name) is not None for loop in self._loops for setup in loop.source.setups):
            offers.add("record")
        self.offers = frozenset(offers)
        self._display.set_robots(tuple(setup for source in sources for setup in source.setups))
        durations = [source.duration_s for source in sources if source.duration_s is not None]
        self._paused = False
        self._display.set_status(
            source=", ".join(source.name for source in sources),
            duration_s=max(durations) if "seek" in offers else 0.0,
            calibration=None if self._calibrator is None else self._calibrator.status,
        )
        self._tell()

    def _use_camera(self, setup: RobotSetup) -> None:
        """Use a camera that has just been calibrated from now on."""
        with self._lock:
            loop = self._loops[0]
            vision = loop.source.make_vision(setup)
            if vision is not None:
                loop.use_setup(setup, vision)
                self.offers |= {"save", "record"}
                self._display.set_robots((setup,))

    def start(self, *, seek_s: float | None = None) -> None:
        """Start reading the sources; with a time, seek to it and pause there."""
        for loop in self._loops:
            loop.start(seek_s=seek_s)
        self._paused = seek_s is not None
        self._tell()

    def say(self, line: str) -> None:
        """Show a line on the pages and on standard error."""
        self._display.say(line)
        if not self._quiet:
            print(f"robocup-vision live: {line}", file=sys.stderr, flush=True)

    def pause(self, on: bool) -> None:
        """Pause, or continue."""
        self._paused = on
        for loop in self._loops:
            loop.pause(on)
        self._tell()

    def step(self) -> None:
        """Show one more frame of each source while paused."""
        for loop in self._loops:
            loop.step()

    def seek(self, t_s: float) -> None:
        """Seek to a time, and pause there."""
        self._paused = True
        for loop in self._loops:
            loop.seek(t_s)
        self._tell()

    def place(self, thing: str, x_m: float, y_m: float, theta_rad: float | None) -> None:
        """Move a robot or the ball of a simulation."""
        self._loops[0].place(thing, x_m, y_m, theta_rad)

    def open(self, recording: str, t_s: float) -> None:
        """Open another recording of the folder, and pause at a time.

        Raises RobocupVisionError if there is no such recording, or it cannot be read.
        """
        assert self._folder is not None
        # the name is compared with the existing files and never used as a path, since it comes from a page
        known = {name: self._folder / name for name in recordings_in(self._folder)}
        if recording not in known:
            raise ArgumentError(f"there is no recording {recording!r} in this folder")
        with self._lock:
            source = open_source(str(known[recording]), self._options)
            self._end_loops()
            self._use([source])
            self._display.set_status(opened=recording)
            self.start(seek_s=t_s)

    def record(self, on: bool) -> None:
        """Start or stop recording all robots.

        Raises RobocupVisionError if files cannot be written, or an extra is missing.
        """
        with self._lock:
            if on and self._record_path is None:
                self._begin_recording(self._free_path())
            elif not on:
                self._end_recording()

    def record_to(self, path: Path) -> None:
        """Start recording to a file; raises as `record`."""
        with self._lock:
            self._begin_recording(path)

    def collect(self, on: bool) -> None:
        """Start or stop collecting frames for a calibration."""
        assert self._calibrator is not None
        self._calibrator.collect(on)

    def calibrate(self, kind: str) -> None:
        """Calibrate by the collected frames, and then use the new camera."""
        assert self._calibrator is not None
        self._calibrator.calibrate(kind)

    def close(self) -> None:
        """End all loops, and close recordings."""
        with self._lock:
            self._end_recording()
            self._end_loops()
            if self._calibrator is not None:
                self._calibrator.close()
        self._display.close()

    def _end_loops(self) -> None:
        for loop in self._loops:
            loop.close()
        self._loops = []

    def _tell(self) -> None:
        problem = next((f"{loop.source.name}: {loop.problem}" for loop in self._loops if loop.problem), "")
        ended = bool(self._loops) and all(loop.ended for loop in self._loops)
        recording = "" if self._record_path is None else str(self._record_path)
        self._display.set_status(problem=problem, ended=ended, paused=self._paused, recording=recording)

    def _watch(self, frame: SourceFrame, moment: Moment) -> None:
        """Record a frame, and offer it to the calibration; called in the loops' threads."""
        if self._calibrator is not None:
            self._calibrator.add(frame.frame)
        if self._also_watch is not None:
            self._also_watch(frame, moment)
        recorder = self._recorders.get(frame.robot)
        if recorder is None or moment.view is None or frame.view is not None:
            return
        try:
            if frame.alone:
                recorder.add_forget()
            recorder.add_look(moment.view, frame.frame, frame.t_s, frame.odometry, frame.prior, mounting=frame.mounting)
            if frame.truth is not None:
                recorder.add_truth(frame.truth, frame.t_s)
        except RobocupVisionError as error:
            del self._recorders[frame.robot]
            self.say(f"{frame.robot}: recording ends: {error}")

    def _free_path(self) -> Path:
        self._out.mkdir(parents=True, exist_ok=True)
        number = 0
        while (path := self._out / f"recording_{number:03d}.mcap").exists() or list(
            self._out.glob(f"recording_{number:03d}_*.mcap")
        ):
            number += 1
        return path

    def _begin_recording(self, path: Path) -> None:
        from robocup_vision.recording.recorder import Recorder

        robots = [(loop, setup) for loop in self._loops for setup in loop.source.setups]
        made: dict[str, Recorder] = {}
        for number, (loop, setup) in enumerate(robots):
            vision = loop.vision(setup.name)
            if vision is None:
                raise ArgumentError("a simulated match is recorded by `robocup-vision match --record`")
            own = path if len(robots) == 1 else path.with_name(f"{path.stem}_{number}{path.suffix}")
            made[setup.name] = Recorder(own, vision)
        self._recorders, self._record_path = made, path
        self.say(f"recording to {path}")
        self._tell()

    def _end_recording(self) -> None:
        if self._record_path is None:
            return
        recorders, self._recorders = self._recorders, {}
        path, self._record_path = self._record_path, None
        for recorder in recorders.values():
            try:
                recorder.close()
            except RobocupVisionError as error:
                self.say(str(error))
        self.say(f"recorded {path}")
        self._tell()
