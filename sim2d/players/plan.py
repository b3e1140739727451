"""Inputs of a player's planners and tactics, and the plans of tactics.

`Situation` and `Plan` are in the team's frame (the opponent's goal at +x), `Surroundings` in the field frame.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.belief import MapPicture, Track
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.planning import Disc
from robocup_vision.planning.shots.shot_planner import ShotPlan
from robocup_vision.team.roles import ChosenRole
from sim2d.players.keep_out import KeepOut
from sim2d.robot_link import Phase, Point, Reason, RobotLimits

# two tracks whose centres are closer, in robot radii, belong to one robot, because two would overlap
_APART_RADII = 1.6


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """One player's estimates at one time."""

    #: Present time.
    t_s: float
    #: Pose of the robot.
    robot: PoseEstimate
    #: Its velocity, and the command that it obeys until the next one.
    velocity_mps: Point
    pending_mps: Point
    #: Tracked robots, as of `age_s` ago.
    tracks: tuple[Track, ...]
    #: Time since the last frame.
    age_s: float
    #: Map of the free floor.
    floor: MapPicture | None

    @property
    def here(self) -> Point:
        """Position of the robot."""
        return self.robot.pose.x_m, self.robot.pose.y_m

    def others(self, limits: RobotLimits, ahead_s: float) -> dict[int, Disc]:
        """Return the other robots by number, predicted to when this one gets there.

        Parameters
        ----------
        ahead_s : float
            Greatest time of the prediction.
        """
        robot, discs = self.robot.pose, {}
        taken = [self.here]
        for track in sorted(self.tracks, key=lambda track: -track.probability):
            place = (track.x_m, track.y_m)
            # the less probable of two tracks at one place is dropped
            if any(math.dist(place, other) < _APART_RADII * limits.radius_m for other in taken):
                continue
            taken.append(place)
            away = math.hypot(track.x_m - robot.x_m, track.y_m - robot.y_m)
            t = self.age_s + min(ahead_s, away / limits.speed_mps)
            covariance = track.covariance[:2, :2] + t**2 * track.covariance[2:, 2:]
            discs[track.number] = Disc(*track.place_after(t), limits.radius_m, covariance)
        return discs


@dataclass(frozen=True, slots=True)
class Situation:
    """A player's present estimates, team frame, metres and seconds."""

    #: Pose of the robot.
    pose: Pose2
    #: Last place of the ball.
    ball: Point | None
    #: Its velocity at that time.
    ball_velocity_mps: Point
    #: The robot holds the ball.
    in_mouth: bool
    #: Duration of that.
    held_s: float
    #: Obstacles other than walls.
    obstacles: tuple[Point, ...]
    #: Phase announced by the referee.
    phase: Phase
    #: Own team has the kick-off, free kick, penalty or ball placement.
    own_turn: bool
    #: Present time.
    t_s: float
    #: Planned use of the ball in the mouth.
    shot: ShotPlan | None = None
    #: Tracked robots; empty for players that do not plan.
    others: tuple[Point, ...] = ()
    #: Place for the ball, in phase "ball_placement".
    placement: Point | None = None
    #: The player's role, if its team has messages.
    role: ChosenRole | None = None

    @property
    def place(self) -> Point:
        """Position of the robot."""
        return self.pose.x_m, self.pose.y_m


@dataclass(frozen=True, slots=True)
class Plan:
    """A plan of tactics, team frame."""

    #: One or two words for films and reports.
    intent: str
    #: Place to drive to.
    target: Point
    #: Direction to face.
    heading_rad: float
    #: Speed of a kick now; 0 for none.
    kick_mps: float = 0.0
    #: Whether the dribbler spins.
    dribble: bool = False
    #: Drive around the ball.
    avoid_ball: bool = False
    #: Close to the ball: others may be touched, but not walls.
    close: bool = False
    #: The ball is in the mouth: turn gently.
    holding: bool = False
    #: Reason of the choice, if it was weighed.
    why: Reason | None = None
    #: Speed limit by the rules, if any.
    speed_mps: float | None = None
    #: Areas forbidden by the rules now.
    keep_outs: tuple[KeepOut, ...] = ()
    #: Face the heading also on the way.
    looks: bool = False
    #: The first robot gets the ball: drive straight, at full speed.
    races: bool = False
