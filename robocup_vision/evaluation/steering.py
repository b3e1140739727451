"""Steering by the frames of a dataset: the commands that a robot would have got, their safety and computing time.

A recording contains the arguments of each call of `steer`, and the same calls are repeated. Without a recording each
call has the same target direction, and the velocity measured by odometry.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from robocup_vision.avoidance.steering import Steering, SteeringSettings
from robocup_vision.evaluation.scoring import SteerResult
from robocup_vision.geometry import Pose2
from robocup_vision.motion_limits import MotionLimits


@dataclass(frozen=True, slots=True)
class SteerPlan:
    """How commands are computed from a dataset's frames; can be sent to another process."""

    #: as in `Steering`
    robot_radius_m: float
    limits: MotionLimits
    settings: SteeringSettings = SteeringSettings()
    target_bearing_rad: float = 0.0  #: direction to the target, robot frame, if nothing is recorded
    #: arguments of `Steering.steer`, without the free space, after the frame of each time (s). After other frames there
    #: is no command. None: nothing is recorded.
    recorded: Mapping[float, Mapping[str, Any]] | None = field(default=None, repr=False)


class FrameSteering:
    """Computes the command after each frame, one after another.

    Parameters
    ----------
    in_sequence : bool
        Whether frames follow one another in time; otherwise each is treated as the first.
    """

    def __init__(self, plan: SteerPlan, *, in_sequence: bool) -> None:
        self._plan, self._in_sequence = plan, in_sequence
        self._steering = Steering(plan.robot_radius_m, plan.limits, plan.settings)
        self._before_s: float | None = None

    def steer(self, view: Any, t_s: float | None, odometry: Pose2 | None) -> SteerResult | None:
        """Steer by the free space of a view; None if a recording has no command after its frame."""
        arguments = self._arguments(t_s, odometry)
        self._before_s = t_s
        if arguments is None:
            return None
        if not self._in_sequence:
            self._steering.forget()
        started_s = time.perf_counter()
        command = self._steering.steer(view.free_space, **arguments)
        took_s = time.perf_counter() - started_s
        velocity = arguments["velocity_mps"]
        return SteerResult(
            float(arguments["target_bearing_rad"]),
            (float(velocity[0]), float(velocity[1])),
            (float(command.velocity_mps[0]), float(command.velocity_mps[1])),
            bool(command.safe),
            command.reason,
            took_s,
        )

    def _arguments(self, t_s: float | None, odometry: Pose2 | None) -> Mapping[str, Any] | None:
        if self._plan.recorded is not None:
            return None if t_s is None else self._plan.recorded.get(t_s)
        velocity = _velocity_mps(odometry, self._before_s, t_s)
        return {"velocity_mps": velocity, "target_bearing_rad": self._plan.target_bearing_rad}


def _velocity_mps(odometry: Pose2 | None, before_s: float | None, t_s: float | None) -> tuple[float, float]:
    """Return the mean velocity since the previous frame, in the present robot frame; 0 if it is unknown."""
    if odometry is None or before_s is None or t_s is None or not t_s > before_s:
        return 0.0, 0.0
    moved = np.array([odometry.x_m, odometry.y_m]) / (t_s - before_s)
    cos_t, sin_t = np.cos(odometry.theta_rad), np.sin(odometry.theta_rad)
    return float(cos_t * moved[0] + sin_t * moved[1]), float(cos_t * moved[1] - sin_t * moved[0])


@dataclass(frozen=True, slots=True)
class SteerFigures:
    """The figures over all commands."""

    commands: int  #: number of commands
    safe: int  #: number of safe ones
    median_ms: float | None  #: median computing time of a command; None if there are none


def steer_figures(results: Sequence[SteerResult]) -> SteerFigures:
    """Compute the figures over some commands."""
    median_ms = 1e3 * float(np.median([one.time_s for one in results])) if results else None
    return SteerFigures(len(results), sum(one.safe for one in results), median_ms)
