"""Steering by the frames of a dataset: the command that a robot would have got, how safe it is, and its time.

A recording holds the arguments of each call of `steer`, and the same calls are made again. Without one, each call asks
for the same direction, at the velocity that the odometry gives.
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

    #: of `Steering`
    robot_radius_m: float
    limits: MotionLimits
    settings: SteeringSettings = SteeringSettings()
    target_bearing_rad: float = 0.0  #: where the robot is to go, in its own frame, where nothing is recorded
    #: arguments of `Steering.steer` after the frame taken at a time (s), but for the free space. After other frames
    #: there is no command. None: nothing is recorded.
    recorded: Mapping[float, Mapping[str, Any]] | None = field(default=None, repr=False)


class FrameSteering:
    """Computes the command after each frame, one after another.

    Parameters
    ----------
    in_sequence : bool
        Whether frames follow one another in time; otherwise each is steered by as if it were the first.
    """

    def __init__(self, plan: SteerPlan, *, in_sequence: bool) -> None:
        self._plan, self._in_sequence = plan, in_sequence
        self._steering = Steering(plan.robot_radius_m, plan.limits, plan.settings)
        self._before_s: float | None = None

    def steer(self, view: Any, t_s: float | None, odometry: Pose2 | None) -> SteerResult | None:
        """Steer by the free space of a view; None where a recording has no command after its frame."""
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
    """Return the mean velocity since the frame before, in the robot's frame now; 0 where it is unknown."""
    if odometry is None or before_s is None or t_s is None or not t_s > before_s:
        return 0.0, 0.0
    moved = np.array([odometry.x_m, odometry.y_m]) / (t_s - before_s)
    cos_t, sin_t = np.cos(odometry.theta_rad), np.sin(odometry.theta_rad)
    return float(cos_t * moved[0] + sin_t * moved[1]), float(cos_t * moved[1] - sin_t * moved[0])


@dataclass(frozen=True, slots=True)
class SteerFigures:
    """The figures over all commands."""

    commands: int  #: number of commands
    safe: int  #: number of those that are safe
    median_ms: float | None  #: median time of a command; None of none


def steer_figures(results: Sequence[SteerResult]) -> SteerFigures:
    """Compute the figures over some commands."""
    median_ms = 1e3 * float(np.median([one.time_s for one in results])) if results else None
    return SteerFigures(len(results), sum(one.safe for one in results), median_ms)
