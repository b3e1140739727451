"""Result of a calibration that the images do not determine: falsy, with a reason, like `NotLocated` for a pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class NotCalibrated:
    """The images do not determine the calibration. Falsy."""

    reason: str  #: reason, in words for the user
    notes: tuple[str, ...] = ()  #: unused frames, with reasons

    def __bool__(self) -> Literal[False]:
        return False
