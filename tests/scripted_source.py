"""A source of the live page and of `record` that gives what a test says."""

from __future__ import annotations

import time
from collections.abc import Iterable

from robocup_vision.live.handover.moment import RobotSetup
from robocup_vision.live.sources.source import Source, SourceFrame
from robocup_vision.vision import Vision


class ScriptedSource(Source):
    """Gives one thing after the other, and ends: frames, errors to raise, problems to report, seconds of silence."""

    def __init__(
        self, vision: Vision, script: Iterable[object], names: tuple[str, ...] = ("scripted",), waits: bool = False
    ) -> None:
        self.name, self.waits = names[0], waits
        self.setups = tuple(RobotSetup(name, vision.field, vision.camera, 0.09) for name in names)
        self.is_closed = False
        self._vision, self._script = vision, list(script)

    def make_vision(self, setup: RobotSetup) -> Vision | None:
        """As `Source`."""
        return self._vision

    def read(self, timeout_s: float) -> tuple[SourceFrame, ...] | None:
        """As `Source`."""
        if not self._script:
            return None
        now = self._script.pop(0)
        if isinstance(now, BaseException):
            raise now
        self.problem = now if isinstance(now, str) else ""
        if isinstance(now, float):
            time.sleep(now)
        return (now,) if isinstance(now, SourceFrame) else ()

    def close(self) -> None:
        """As `Source`."""
        self.is_closed = True
