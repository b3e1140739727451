"""Probability that a goal in view is found, and as which of the two: P(e | I, w) of Miura and Shirai 2004, section 4.2.

It is learnt from the goal localiser on rendered pictures (`robocup-vision learn-goal-evidence`), and kept in a file.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
import numpy.typing as npt

from field_models.errors import FileError
from field_models.toml_file import StrictStruct, load_toml
from robocup_vision.arrays import FloatArray, read_only

PACKAGED = Path(__file__).with_name("goal_evidence.toml")
# outcomes of a look: the goal is identified as itself, as the other one, or not found
POSITIVE, NEGATIVE, NOTHING = range(3)
CORNERS = 4

# added to the counts of the outcomes, so that none has probability 0
_PSEUDO_COUNTS = np.array([0.5, 0.5, 1.0])


_Count = Annotated[int, msgspec.Meta(ge=0)]


class _Seen(StrictStruct):
    corners: int
    counts: list[tuple[_Count, _Count, _Count]]


class _EvidenceFile(StrictStruct):
    format: Literal[1]
    command: str
    width_px: list[float]
    again_found: _Count
    again_missed: _Count
    seen: list[_Seen] = msgspec.field(default_factory=list)


@dataclass(frozen=True, slots=True, eq=False)
class GoalEvidence:
    """Probabilities of the outcomes of looks at goals."""

    #: ascending bounds between the classes of a goal's apparent width, pixels between its posts
    width_px: tuple[float, ...]
    #: (CORNERS + 1, K, 3) float64: by the number of its corners in view (feet and tops of the posts) and its width:
    #: probabilities that it is identified as itself, as the other goal, or not found, which add up to 1
    found: FloatArray
    again: float  #: probability that a goal is found after a miss, divided by that of the first look

    def chances(self, corners: npt.ArrayLike, width_px: npt.ArrayLike) -> FloatArray:
        """Return (..., 3) the probabilities of the outcomes for numbers of corners (...) and widths (...), pixels."""
        classes = np.searchsorted(self.width_px, width_px, side="right")
        return np.asarray(self.found[np.asarray(corners, dtype=np.intp), classes])

    @classmethod
    def from_counts(
        cls, width_px: tuple[float, ...], counts: FloatArray, again_found: int, again_missed: int
    ) -> GoalEvidence:
        """Compute probabilities from counts (CORNERS + 1, K, 3) of first looks, and of second looks after a miss."""
        smooth = np.asarray(counts, dtype=np.float64) + _PSEUDO_COUNTS
        found = smooth / smooth.sum(axis=-1, keepdims=True)
        whole = np.asarray(counts, dtype=np.float64)[CORNERS].sum(axis=0)
        first = (whole[0] + 1) / (whole.sum() + 2)
        again = min((again_found + 1) / (again_found + again_missed + 2) / first, 1.0)
        return cls(width_px, read_only(found), float(again))


def load_goal_evidence(path: str | Path = PACKAGED) -> GoalEvidence:
    """Read the learnt probabilities.

    Parameters
    ----------
    path : str or Path, optional
        A file of `robocup-vision learn-goal-evidence`; default: the one in the package.

    Raises
    ------
    FileError
        If the file is missing or not valid.
    """
    described = load_toml(path, _EvidenceFile)
    bounds = described.width_px
    if not bounds or any(high <= low for low, high in itertools.pairwise(bounds)) or bounds[0] <= 0:
        raise FileError(path, "must be positive and ascending", key="width_px", value=bounds)
    counts = np.zeros((CORNERS + 1, len(bounds) + 1, 3))
    if sorted(row.corners for row in described.seen) != list(range(CORNERS + 1)):
        got = [row.corners for row in described.seen]
        raise FileError(path, f"must be 0 to {CORNERS}, each once", key="seen.corners", value=got)
    for row in described.seen:
        if len(row.counts) != len(bounds) + 1:
            problem = f"must have {len(bounds) + 1} rows, one more than width_px"
            raise FileError(path, problem, key=f"seen[{row.corners}].counts", value=row.counts)
        counts[row.corners] = row.counts
    return GoalEvidence.from_counts(tuple(bounds), counts, described.again_found, described.again_missed)
