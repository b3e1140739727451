"""What a player estimates of itself and of what is around it: the planners' input. Field frame, metres, seconds."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.belief import MapPicture, Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.planning import Disc
from sim2d.robot_link import RobotLimits

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """One player's estimates at one time."""

    #: Now.
    t_s: float
    #: The robot.
    robot: PoseEstimate
    #: Its velocity, and the command that it obeys until the next one.
    velocity_mps: Point
    pending_mps: Point
    #: Robots that are tracked, as of `age_s` ago.
    tracks: tuple[Track, ...]
    #: Since the last frame.
    age_s: float
    #: Which floor is free.
    floor: MapPicture | None

    @property
    def here(self) -> Point:
        """Position of the robot."""
        return self.robot.pose.x_m, self.robot.pose.y_m

    def others(self, limits: RobotLimits, ahead_s: float, apart_radii: float) -> dict[int, Disc]:
        """Return the other robots by number, where they will be when this one gets there.

        Parameters
        ----------
        ahead_s : float
            They are predicted at most so far ahead.
        apart_radii : float
            Two tracks whose centres are nearer than this, in robot radii, are of one robot.
        """
        robot, discs = self.robot.pose, {}
        taken = [self.here]
        for track in sorted(self.tracks, key=lambda track: -track.probability):
            place = (track.x_m, track.y_m)
            # the less probable of two tracks in one place is left out
            if any(math.dist(place, other) < apart_radii * limits.radius_m for other in taken):
                continue
            taken.append(place)
            away = math.hypot(track.x_m - robot.x_m, track.y_m - robot.y_m)
            t = self.age_s + min(ahead_s, away / limits.speed_mps)
            covariance = track.covariance[:2, :2] + t**2 * track.covariance[2:, 2:]
            discs[track.number] = Disc(*track.place_after(t), limits.radius_m, covariance)
        return discs
