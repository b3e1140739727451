"""The field in a team's frame (the opponent's goal at +x): possible places of robots and balls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from field_models.field import Field
from robocup_vision.geometry import Pose2
from sim2d.robot_link import Point, RobotLimits

# distance of a keeper from its goal's line in robot radii, clear of the posts but near enough to cover the mouth
KEEPER_LINE_RADII = 1.3
# least distance between robot and wall at a target; steering would stop the robot before a closer one
_WALL_CLEARANCE_M = 0.015


@dataclass(frozen=True, slots=True)
class TacticsSettings:
    """What differs between the tactics of teams; lengths in reaches are robot radius plus ball radius."""

    #: The keeper fetches balls within these robot radii of its goal's middle to either side, and of the end line.
    keeper_area_radii: float = 7.0
    keeper_depth_radii: float = 6.0
    #: Distance, in goal widths, within which the keeper goes out to block a ball that another robot has. A robot with
    #: the ball drives around a keeper that comes out, where it has room to.
    block_widths: float = 0.0
    #: Greatest angle from the line between ball and opponent's goal at which a robot drives straight to the ball.
    straight_rad: float = 0.9
    #: Distance in reaches from which it also drives straight, because the ball moves on before it arrives.
    straight_reaches: float = 6.0
    #: Radius in reaches of the way round the ball.
    round_reaches: float = 1.5
    #: Least x of a supporter as a fraction of half the length (negative: own half), greatest x in metres.
    support_limits: tuple[float, float] = (-0.4, 0.3)
    #: Whether players from number 2 on fetch a ball in their own strip, without agreement; else only number 1 fetches.
    fetches_in_strip: bool = True


class TeamField:
    """Lengths and places for all roles.

    Attributes
    ----------
    half_length_m, half_width_m, goal_half_m : float
        Half the field's length and width, and half a goal's width (a sixth of the field's without goals).
    mouth_half_m : float
        Half of the opening between the posts.
    reach_m : float
        Distance from a robot's centre to the centre of a ball in contact.
    """

    def __init__(self, field: Field, limits: RobotLimits) -> None:
        self.half_length_m, self.half_width_m = field.length_m / 2, field.width_m / 2
        self.goal_half_m = field.goals[0].width_m / 2 if field.goals else field.width_m / 6
        self.mouth_half_m = self.goal_half_m - (field.goals[0].post_radius_m if field.goals else 0.0)
        self.ball_radius_m, self.robot_radius_m = field.ball_radius_m, limits.radius_m
        self.reach_m = limits.radius_m + field.ball_radius_m
        # without walls robots may cross the lines
        self._inset_m = limits.radius_m + _WALL_CLEARANCE_M if field.is_bounded else 0.0
        # boards may be some way beyond the lines
        beyond = np.abs(field.floor_polygon).max(axis=0) if field.boundary == "boards" else np.zeros(2)
        self._wall_x_m = max(self.half_length_m, float(beyond[0]))
        self._wall_y_m = max(self.half_width_m, float(beyond[1]))

    def inside(self, place: Point) -> Point:
        """Return the nearest place at which a robot can be."""
        limit_x, limit_y = self._wall_x_m - self._inset_m, self._wall_y_m - self._inset_m
        return max(-limit_x, min(limit_x, place[0])), max(-limit_y, min(limit_y, place[1]))

    def nearest_ball_place(self, place: Point) -> Point:
        """Return the nearest place at which a ball can be; the goals extend 0.1 m behind their lines."""
        x, y = place
        limit_y = self.half_width_m - self.ball_radius_m
        return max(-self.half_length_m - 0.1, min(self.half_length_m + 0.1, x)), max(-limit_y, min(limit_y, y))

    def is_near_wall(self, place: Point, room_m: float) -> bool:
        """Whether a wall is nearer than this; false on a field without walls."""
        x, y = abs(place[0]), abs(place[1])
        return self._inset_m > 0 and (x > self._wall_x_m - room_m or y > self._wall_y_m - room_m)

    def away_from_wall(self, place: Point, room_m: float) -> float | None:
        """Return the direction straight away from a wall nearer than this; None without one."""
        if not self.is_near_wall(place, room_m):
            return None
        x, y = place
        off_x = -math.copysign(1.0, x) if abs(x) > self._wall_x_m - room_m else 0.0
        off_y = -math.copysign(1.0, y) if abs(y) > self._wall_y_m - room_m else 0.0
        return math.atan2(off_y, off_x)

    def room_ahead_m(self, pose: Pose2) -> float:
        """Return the distance from the robot's centre straight ahead to a wall; infinite without walls."""
        if not self._inset_m:
            return math.inf
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        ways = [math.inf]
        if abs(c) > 1e-9:
            ways.append((math.copysign(self._wall_x_m, c) - pose.x_m) / c)
        if abs(s) > 1e-9:
            ways.append((math.copysign(self._wall_y_m, s) - pose.y_m) / s)
        return min(ways)

    def mouth(self, pose: Pose2) -> Point:
        """Return the place of a ball in the robot's mouth."""
        mouth = pose.compose(Pose2(self.reach_m, 0.0, 0.0))
        return mouth.x_m, mouth.y_m


def direction_rad(start: Point, end: Point) -> float:
    """Return the direction from one place to another."""
    return math.atan2(end[1] - start[1], end[0] - start[0])


def offset(place: Point, heading_rad: float, way_m: float) -> Point:
    """Return the place at a distance in a direction."""
    return place[0] + way_m * math.cos(heading_rad), place[1] + way_m * math.sin(heading_rad)
