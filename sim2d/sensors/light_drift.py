"""Light that drifts during a match: clouds before the hall's windows, lamps that warm up."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from sim2d.rendering.scene import Light


@dataclass(frozen=True, slots=True)
class LightDriftSettings:
    """Values of `LightDrift`."""

    #: Greatest change of the brightness on the field, as a part of it.
    level_ratio: float = 0.1
    #: From one brightest moment to the next.
    level_period_s: float = 40.0
    #: In this time the direction in which it grows lighter over the field turns once.
    turn_period_s: float = 240.0


class LightDrift:
    """Changes a match's light with time; `light` is what it would be without the drift."""

    def __init__(self, settings: LightDriftSettings, light: Light, rng: np.random.Generator) -> None:
        self._settings, self._light = settings, light
        self._phase_rad = float(rng.uniform(0.0, math.tau))

    def at(self, t_s: float) -> Light:
        """Return the light at a time."""
        settings = self._settings
        swing = math.sin(self._phase_rad + math.tau * t_s / settings.level_period_s)
        return replace(
            self._light,
            level=self._light.level * (1 + settings.level_ratio * swing),
            gradient_direction_rad=self._light.gradient_direction_rad + math.tau * t_s / settings.turn_period_s,
        )
