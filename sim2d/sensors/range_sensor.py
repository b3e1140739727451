"""A range sensor that scans in a horizontal plane: it measures things that reach up to the plane."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import read_only
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.range_profile import RangeProfile
from sim2d.rendering.scene import Robot, Scene


@dataclass(frozen=True, slots=True)
class RangeSensor:
    """A scanner at the robot's centre.

    Raises
    ------
    ArgumentError
        If a value is out of its range.
    """

    #: Height of the plane above the floor. A higher ball is met where the plane cuts it.
    height_m: float = 0.08
    #: Number of beams, evenly spaced over a full turn.
    beams: int = 240
    #: Distance beyond which things give no echo.
    reach_m: float = 3.0
    #: Standard deviation of each range.
    noise_std_m: float = 0.01
    #: Fraction of beams without an echo although something is within reach.
    dropout_rate: float = 0.02

    def __post_init__(self) -> None:
        if self.beams < 3:
            raise ArgumentError(f"beams must be at least 3, got {self.beams}")
        if not 0 < self.reach_m < math.inf:
            raise ArgumentError(f"reach_m must be positive, got {self.reach_m}")
        for name in ("height_m", "noise_std_m"):
            if not 0 <= getattr(self, name) < math.inf:
                raise ArgumentError(f"{name} must not be negative, got {getattr(self, name)}")
        if not 0 <= self.dropout_rate < 1:
            raise ArgumentError(f"dropout_rate must be within 0 to 1, got {self.dropout_rate}")

    def scan(self, scene: Scene, pose: Pose2, rng: np.random.Generator) -> RangeProfile:
        """Measure a full turn.

        Parameters
        ----------
        scene : Scene
            All objects, without the robot that carries the sensor.
        pose : Pose2
            Pose of that robot, field frame.
        """
        bearing = read_only((np.arange(self.beams) + 0.5) * (math.tau / self.beams) - math.pi)
        true_m = self._with_cut_ball(scene).free_range_m(pose, bearing, self.height_m)
        noise_m = self.noise_std_m * rng.standard_normal(self.beams)
        lost = rng.random(self.beams) < self.dropout_rate
        hit = (true_m < self.reach_m) & ~lost
        range_m = np.where(hit, np.clip(true_m + noise_m, 0.0, self.reach_m), self.reach_m)
        return RangeProfile(bearing, range_m, hit)

    def _with_cut_ball(self, scene: Scene) -> Scene:
        ball = scene.ball
        if ball is None or not self.height_m < 2 * ball.radius_m:
            return scene
        cut_m = math.sqrt(ball.radius_m**2 - (self.height_m - ball.radius_m) ** 2) if self.height_m > 0 else 0.0
        if not cut_m > 0:
            return scene
        cut = Robot(ball.x_m, ball.y_m, cut_m, 2 * ball.radius_m)
        return dataclasses.replace(scene, robots=(*scene.robots, cut))
