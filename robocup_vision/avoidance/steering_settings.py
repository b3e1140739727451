"""Settings of steering: how finely it looks, what it keeps clear of, and how it goes round things."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.errors import ArgumentError


@dataclass(frozen=True, slots=True)
class SteeringSettings:
    """How `Steering` chooses commands.

    Parameters
    ----------
    time_threshold_s : float, optional
        The paper's T_th, one for all directions. None derives it per direction: a command is safe when it can be
        carried out to its end and the robot can then still stop. The end is reached after ``|dv_j|`` / alpha, the
        stopping distance v^2 / (2 alpha) takes v / (2 alpha) at speed v, and the next decision comes a period and again
        a dead time later: T_j >= 2 dead_time + period + ``|dv_j|`` / alpha + v / (2 alpha). Then the command given now
        stays safe until it is reached, and braking is safe after that, so that a standing world is never touched. (The
        paper's 2.75 s is the time 2 v / alpha of a full reversal plus the dead time.)
    directions : int
        Number J of directions that are tried. 48: 7.5 degrees, as in the paper.
    period_s : float
        Time between two commands.
    step_m : float
        Largest distance by which the robot moves between two samples of a trajectory close to an obstacle.
    use_velocity : bool
        False: the paper's comparison, which takes the present velocity to be the commanded one (v_a = v_b).
    keep_side : bool
        Remember the detour: by how much, and to which side, obstacles have turned the robot from the target's bearing.
        Two equally good ways round then do not make it waver between them, and pockets do not hold it. `forget` drops
        the memory. False where a `Wayfinder`, which remembers more than one view, gives the direction.
    stop_ratio : float
        The slowest of the speeds tried is one from which the robot stops within this ratio of its radius: any gap that
        it fits through can then be entered.
    away_rad : float
        A larger detour leads away from the target: the robot then goes no faster than it can turn in its own length.
    other_side_rad : float
        The side of a detour changes only where the other side is nearer by more than this, so that it does not waver.
    max_detour_rad : float
        A larger detour to one side counts as one to the other side: else the walls of a field lead round and round.
    obstacle_sigmas, max_margin_m : float
        Standard deviations that are kept clear of a moving obstacle, and how far at most: beyond that there would be no
        way round it.
    return_margin_m : float
        A range that ends so near to a moving obstacle's rim is one of its returns.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    time_threshold_s: float | None = None
    directions: int = 48
    period_s: float = 1 / 30
    step_m: float = 0.004
    use_velocity: bool = True
    keep_side: bool = True
    stop_ratio: float = 0.25
    away_rad: float = math.pi / 3.0
    other_side_rad: float = 0.25 * math.pi
    max_detour_rad: float = 1.25 * math.pi
    obstacle_sigmas: float = 1.0
    max_margin_m: float = 0.05
    return_margin_m: float = 0.05

    def __post_init__(self) -> None:
        for name, least in (
            ("period_s", 0.0),
            ("step_m", 1e-4),
            ("stop_ratio", 1e-3),
            ("away_rad", 0.0),
            ("other_side_rad", 0.0),
            ("max_detour_rad", math.pi),
            ("obstacle_sigmas", 0.0),
            ("max_margin_m", 0.0),
            ("return_margin_m", 0.0),
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= least):
                raise ArgumentError(f"{name} must be at least {least:g}, got {value!r}")
        threshold = self.time_threshold_s
        if threshold is not None and not (math.isfinite(threshold) and threshold >= 0.0):
            raise ArgumentError(f"time_threshold_s must be at least 0, got {threshold!r}")
        if self.directions < 4:
            raise ArgumentError(f"directions must be at least 4, got {self.directions!r}")
