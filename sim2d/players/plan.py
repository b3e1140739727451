"""What a player's planners and tactics decide from, and what tactics decide.

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


@dataclass(frozen=True, slots=True, eq=False)
class Surroundings:
    """One player's estimates at one time."""

    #: Now.
    t_s: float
    #: Pose of the robot.
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


@dataclass(frozen=True, slots=True)
class Situation:
    """What a player estimates now, team frame, metres and seconds."""

    #: Pose of the robot.
    pose: Pose2
    #: The ball, where it was last seen.
    ball: Point | None
    #: Its velocity then.
    ball_velocity_mps: Point
    #: The robot holds the ball.
    in_mouth: bool
    #: For how long.
    held_s: float
    #: Whatever stands on the floor and is no wall.
    obstacles: tuple[Point, ...]
    #: What the referee announced.
    phase: Phase
    #: Own team has the kick-off, free kick, penalty or ball placement.
    own_turn: bool
    #: Now.
    t_s: float
    #: What to do with the ball in the mouth, where that was planned.
    shot: ShotPlan | None = None
    #: Robots that are tracked; empty for players that do not plan.
    others: tuple[Point, ...] = ()
    #: Where the ball shall be placed, in phase "ball_placement".
    placement: Point | None = None
    #: What the player's part in the team is, where its robots speak to each other.
    role: ChosenRole | None = None

    @property
    def place(self) -> Point:
        """Position of the robot."""
        return self.pose.x_m, self.pose.y_m


@dataclass(frozen=True, slots=True)
class Plan:
    """Where to go and what to do there, team frame."""

    #: A word or two for films and reports.
    intent: str
    #: Place to drive to.
    target: Point
    #: Direction to face.
    heading_rad: float
    #: Speed to kick with now; 0: do not.
    kick_mps: float = 0.0
    #: Whether the dribbler spins.
    dribble: bool = False
    #: Go round the ball.
    avoid_ball: bool = False
    #: Close to the ball: others may be touched, walls not.
    close: bool = False
    #: With the ball in the mouth: turn gently.
    holding: bool = False
    #: Reason of the choice, where it was weighed.
    why: Reason | None = None
    #: The rules allow no more now; None: any speed.
    speed_mps: float | None = None
    #: Where the rules forbid the robot to be now.
    keep_outs: tuple[KeepOut, ...] = ()
    #: Face the heading on the way, too.
    looks: bool = False
    #: To a ball that whoever is first has: straight, and at full speed.
    races: bool = False
