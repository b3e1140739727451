"""Values by the times they are of, for the newest few seconds: what was at a time lies between two of them."""

from __future__ import annotations

import bisect
import math
from typing import Generic, TypeVar

Value = TypeVar("Value")

# values are kept for so long, and two that are farther apart do not tell what was between them
_KEPT_S, _MAX_GAP_S = 5.0, 0.5
_SAME_S = 1e-6
# of what does not change
FOR_GOOD = -math.inf


class Timeline(Generic[Value]):
    """The newest values of one thing."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._values: list[Value] = []

    @property
    def newest(self) -> Value:
        """The last one in time."""
        return self._values[-1]

    def add(self, t_s: float, value: Value) -> None:
        """Take a value in, in any order; at `FOR_GOOD` it stands alone, until one with a time comes."""
        times, values = self._times, self._values
        if times and (FOR_GOOD in (times[-1], t_s) or t_s < times[-1] - _KEPT_S):
            # time went back, or another value for good
            times.clear()
            values.clear()
        at = bisect.bisect_left(times, t_s)
        times.insert(at, t_s)
        values.insert(at, value)
        while times[-1] - times[0] > _KEPT_S:
            del times[0], values[0]

    def around(self, t_s: float) -> tuple[Value, Value, float] | None:
        """Return the values before and after a time, and how far it is from one to the other; None: not known."""
        times, values = self._times, self._values
        if times[:1] == [FOR_GOOD]:
            return values[0], values[0], 0.0
        at = bisect.bisect_left(times, t_s)
        if at < len(times) and times[at] - t_s < _SAME_S:
            return values[at], values[at], 0.0
        if not 0 < at < len(times) or times[at] - times[at - 1] > _MAX_GAP_S:
            return None
        return values[at - 1], values[at], (t_s - times[at - 1]) / (times[at] - times[at - 1])
