"""How often frames come, and when that has changed: a camera that gives half as many in the dark does not say so."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

# window of the measurement, seconds
_WINDOW_S = 2.0
# a camera's rate varies with the light by less than this factor; a lost half of the frames is more
_CHANGED = 1.5


@dataclass(frozen=True, slots=True)
class RateChange:
    """Frames a second before and now."""

    before_hz: float
    now_hz: float


class FrameRate:
    """Measures the rate of one source by the times of its frames."""

    def __init__(self) -> None:
        self._times: deque[float] = deque()
        self._usual: float | None = None

    @property
    def rate_hz(self) -> float | None:
        """Frames a second over the last two seconds; None before there are three frames."""
        if len(self._times) < 3 or self._times[-1] <= self._times[0]:
            return None
        return round((len(self._times) - 1) / (self._times[-1] - self._times[0]), 2)

    def add(self, t_s: float) -> RateChange | None:
        """Take a frame's time; return how the rate has changed, once for each change that has lasted two seconds."""
        if self._times and t_s <= self._times[-1]:
            self.forget()
        self._times.append(t_s)
        while t_s - self._times[0] > _WINDOW_S:
            self._times.popleft()
        rate = self.rate_hz
        if rate is None or t_s - self._times[0] < 0.9 * _WINDOW_S:
            return None
        usual, self._usual = self._usual, self._usual or rate
        if usual is None or 1 / _CHANGED < rate / usual < _CHANGED:
            return None
        # told once the window holds the new rate alone: else the change would be told in two halves
        half = [t for t in self._times if t > t_s - _WINDOW_S / 2]
        if len(half) < 2 or not 0.8 < (len(half) - 1) / (half[-1] - half[0]) / rate < 1.25:
            return None
        self._usual = rate
        return RateChange(usual, rate)

    def forget(self) -> None:
        """Begin anew: the source has gone to another time."""
        self._times.clear()
        self._usual = None
