"""Chooses where a head looks to decide the floor on the player's way: it asks `SelectiveLook` about the map."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.belief import MapPicture
from robocup_vision.geometry import Pose2
from robocup_vision.mapping.occupancy import FREE, NO_GO
from robocup_vision.planning import SelectiveLook, SelectiveLookSettings
from sim2d.robot_link import RobotLimits

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class FloorLookSettings:
    """Values of `FloorLook`."""

    #: Of the choice of a place.
    look: SelectiveLookSettings = SelectiveLookSettings()
    #: A frame taken so near to the wanted pan counts as a look.
    arrived_rad: float = 0.15


class FloorLook:
    """Chooses looks at undecided floor for one player.

    Parameters
    ----------
    half_view_rad : float
        Half of the camera's horizontal field of view.
    """

    def __init__(self, limits: RobotLimits, half_view_rad: float, settings: FloorLookSettings) -> None:
        self._limits, self._half_view_rad, self._settings = limits, half_view_rad, settings
        self._planner: SelectiveLook | None = None
        # pan, place and position of the look that was chosen last
        self._wanted: tuple[float, Point, Point] | None = None

    def choose(self, floor: MapPicture, robot: Pose2, target: Point) -> tuple[float, str] | None:
        """Return the pan of a look and its reason; None if no look decides more of the way.

        Parameters
        ----------
        target : (float, float)
            Where it drives to, field frame; one off the map counts as on its rim.
        """
        self._wanted = None
        here = (robot.x_m, robot.y_m)
        side_m = floor.cell_m * len(floor.state)
        corner = np.array(floor.corner_m)
        inside = np.clip(target, corner + 0.5 * floor.cell_m, corner + side_m - 0.5 * floor.cell_m)
        if not ((corner <= here) & (corner + side_m > here)).all():
            return None
        if self._planner is None:
            radius_m = self._limits.radius_m
            self._planner = SelectiveLook(floor.cell_m, radius_m, self._half_view_rad, self._settings.look)
        free, no_go = floor.state == FREE, floor.state == NO_GO
        # the robot stands there, and its camera does not show the floor under it
        x, y = (corner[k] + floor.cell_m * (np.arange(len(floor.state)) + 0.5) for k in (0, 1))
        free |= np.hypot(x[:, None] - here[0], y - here[1]) < 2.0 * self._limits.radius_m
        chosen = self._planner.choose(free, no_go & ~free, floor.corner_m, here, (float(inside[0]), float(inside[1])))
        if chosen.at_m is None:
            return None
        at = robot.inverse().transform(chosen.at_m)
        pan_rad = math.atan2(at[1], at[0])
        self._wanted = (pan_rad, chosen.at_m, here)
        return pan_rad, chosen.reason

    def observe(self, pan_rad: float) -> None:
        """Take in that a frame was taken at this pan."""
        if self._planner is None or self._wanted is None:
            return
        wanted_rad, at_m, from_m = self._wanted
        if abs(pan_rad - wanted_rad) < self._settings.arrived_rad:
            self._planner.observe(at_m, from_m)
            self._wanted = None
