"""Result of a calibration that the images do not determine: falsy, with the reason, as `NotLocated` is for a pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class NotCalibrated:
    """The images do not determine the calibration. Falsy."""

    reason: str  #: why, in words a user understands
    notes: tuple[str, ...] = ()  #: frames that were of no use, and why

    def __bool__(self) -> Literal[False]:
        return False
