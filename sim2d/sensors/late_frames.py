"""Frames that come late, with jitter, and sometimes not at all, as through a real robot's driver and bus."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from sim2d.robot_link import TIME_SLACK_S, Senses


@dataclass(frozen=True, slots=True)
class LatencySettings:
    """Values of `LateFrames`."""

    #: A frame comes so long after it was exposed at least, and at most.
    min_s: float = 0.02
    max_s: float = 0.06
    #: Standard deviation of a frame's lateness about the robot's usual one, which is drawn once.
    jitter_s: float = 0.005
    #: Part of the frames that never come.
    lost_ratio: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 <= self.min_s <= self.max_s <= 1.0:
            raise ArgumentError(f"min_s and max_s must be within 0 to 1 s and in order, got {self.min_s}, {self.max_s}")
        if not 0.0 <= self.lost_ratio <= 1.0:
            raise ArgumentError(f"lost_ratio must be within 0 to 1, got {self.lost_ratio}")


class LateFrames:
    """Delays one robot's frames; everything else that it senses comes at once."""

    def __init__(self, settings: LatencySettings, rng: np.random.Generator) -> None:
        self._settings, self._rng = settings, rng
        self._usual_s = float(rng.uniform(settings.min_s, settings.max_s))
        self._waiting: deque[tuple[float, Senses]] = deque()

    def apply(self, senses: Senses) -> Senses:
        """Return the senses with the newest frame that has come by now; call it once each control period, in order."""
        settings = self._settings
        late_s = self._usual_s + settings.jitter_s * float(self._rng.standard_normal())
        is_lost = float(self._rng.random()) < settings.lost_ratio
        if senses.frame is not None and not is_lost:
            due_s = senses.t_s + max(settings.min_s, min(settings.max_s, late_s))
            self._waiting.append((due_s, senses))
        newest: Senses | None = None
        while self._waiting and self._waiting[0][0] <= senses.t_s + TIME_SLACK_S:
            newest = self._waiting.popleft()[1]
        return senses.with_frame_of(newest)
