"""How errors are distributed, in standard deviations that a planner reckons with: normally, or with heavier tails."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.stats import t as student

from robocup_vision.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class ErrorLaw:
    """Student's t distribution: the fewer degrees of freedom, the heavier its tails.

    Parameters
    ----------
    degrees : float
        Of freedom; infinite: normal.
    scale : float
        Its unit, in the planner's standard deviations.
    """

    degrees: float = math.inf
    scale: float = 1.0

    @classmethod
    def fitted(cls, errors: FloatArray) -> ErrorLaw:
        """Fit to errors (N,) in stated standard deviations, by maximum likelihood about zero."""
        degrees, _, scale = student.fit(errors, floc=0.0)
        return cls(float(degrees), float(scale))

    def draw(self, rng: np.random.Generator, count: int) -> FloatArray:
        """Draw so many errors, in the planner's standard deviations."""
        if math.isinf(self.degrees):
            return np.asarray(self.scale * rng.standard_normal(count))
        return np.asarray(self.scale * rng.standard_t(self.degrees, count))


@dataclass(frozen=True, slots=True)
class Errors:
    """What a world's errors are.

    Parameters
    ----------
    pose, obstacle : ErrorLaw
        Of the robot's own pose, and of the places of others.
    missed : float
        How often an opponent is missed in a look, of what the planner reckons with.
    """

    pose: ErrorLaw = ErrorLaw()
    obstacle: ErrorLaw = ErrorLaw()
    missed: float = 1.0


# the planner's own
MATCHED = Errors()
