"""What tactics decide from and what they decide: values in the team's frame (the opponent's goal at +x)."""

from __future__ import annotations

from dataclasses import dataclass

from robocup_vision.geometry import Pose2
from robocup_vision.planning.shots.shot_planner import ShotPlan
from robocup_vision.team.roles import ChosenRole
from sim2d.players.keep_out import KeepOut
from sim2d.robot_link import Phase, Reason

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Situation:
    """What a player estimates now, team frame, metres and seconds."""

    #: The robot.
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
