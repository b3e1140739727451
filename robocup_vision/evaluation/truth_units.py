"""Detects truth in other units than metres and radians: interpretations suggested by its numbers, and the best one."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from field_models.field import Field
from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.evaluation.scoring import FAIR_M, FAIR_RAD, Row, pose_error

MEND = "write metres and radians"


class TruthReading(NamedTuple):
    """An interpretation of true poses in other units."""

    words: str  #: text of the units, to follow "read as"
    #: metres and radians per unit
    length: float
    angle: float

    def of(self, truth: Truth) -> Truth:
        """Return a true pose, converted by this interpretation."""
        theta = None if truth.theta_rad is None else self.angle * truth.theta_rad
        return Truth(self.length * truth.x_m, self.length * truth.y_m, theta)


def other_readings(truth: Mapping[str, Truth], field: Field) -> Iterator[TruthReading]:
    """Yield interpretations in other units if places are far off the field, or headings exceed a turn."""
    known = truth.values()
    in_degrees = any(abs(one.theta_rad) > math.tau for one in known if one.theta_rad is not None)
    far_m = max((max(abs(one.x_m), abs(one.y_m)) for one in known), default=0.0)
    units = [("millimetres", 1e-3), ("centimetres", 1e-2)] if far_m > field.length_m else []
    for name, length in [*units, ("", 1.0)]:
        words = [*([f"lengths in {name}"] if name else []), *(["headings in degrees"] if in_degrees else [])]
        if words:
            yield TruthReading(" and ".join(words), length, math.radians(1.0) if in_degrees else 1.0)


def truth_units_note(rows: Sequence[Row], field: Field, *, symmetric: bool) -> str:
    """Return a note on the truth's apparent units; empty if no other ones fit more of the located images."""
    truth = {row.image: row.truth for row in rows if row.truth is not None}
    located = [(row.estimate, truth[row.image]) for row in rows if row.estimate is not None and row.image in truth]

    def fitting(reading: TruthReading) -> int:
        return sum(_agrees(estimate, reading.of(one), symmetric=symmetric) for estimate, one in located)

    as_it_is = fitting(TruthReading("", 1.0, 1.0))
    best, count = None, as_it_is
    for reading in other_readings(truth, field):
        if (fits := fitting(reading)) > count:
            best, count = reading, fits
    if best is None:
        return ""
    return (
        f"with the truth read as {best.words} {count} of {len(located)} located images agree with it"
        f" ({as_it_is} as it is): {MEND}"
    )


def _agrees(estimate: PoseEstimate, truth: Truth, *, symmetric: bool) -> bool:
    error = pose_error(estimate, truth, symmetric=symmetric)
    return error.position_m <= FAIR_M and (error.theta_rad is None or abs(error.theta_rad) <= FAIR_RAD)
