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
    """What a player estimates now, team frame, metres and seconds.

    Parameters
    ----------
    pose : Pose2
        The robot.
    ball : (float, float) or None
        The ball, where it was last seen.
    ball_velocity_mps : (float, float)
        Its velocity then.
    in_mouth : bool
        The robot holds the ball.
    held_s : float
        For how long.
    obstacles : tuple of (float, float)
        Whatever stands on the floor and is no wall.
    phase : Phase
        What the referee announced.
    own_turn : bool
        Own team has the kick-off, free kick, penalty or ball placement.
    t_s : float
        Now.
    shot : ShotPlan or None
        What to do with the ball in the mouth, where that was planned.
    others : tuple of (float, float)
        Robots that are tracked; empty for players that do not plan.
    placement : (float, float) or None
        Where the ball shall be placed, in phase "ball_placement".
    role : ChosenRole or None
        What the player's part in the team is, where its robots speak to each other.
    """

    pose: Pose2
    ball: Point | None
    ball_velocity_mps: Point
    in_mouth: bool
    held_s: float
    obstacles: tuple[Point, ...]
    phase: Phase
    own_turn: bool
    t_s: float
    shot: ShotPlan | None = None
    others: tuple[Point, ...] = ()
    placement: Point | None = None
    role: ChosenRole | None = None

    @property
    def place(self) -> Point:
        """Position of the robot."""
        return self.pose.x_m, self.pose.y_m


@dataclass(frozen=True, slots=True)
class Plan:
    """Where to go and what to do there, team frame.

    Parameters
    ----------
    intent : str
        A word or two for films and reports.
    target : (float, float)
        Place to drive to.
    heading_rad : float
        Direction to face.
    kick_mps : float
        Speed to kick with now; 0: do not.
    dribble : bool
        Whether the dribbler spins.
    avoid_ball : bool
        Go round the ball.
    close : bool
        Close to the ball: others may be touched, walls not.
    holding : bool
        With the ball in the mouth: turn gently.
    why : Reason or None
        Reason of the choice, where it was weighed.
    speed_mps : float or None
        The rules allow no more now; None: any speed.
    keep_outs : tuple of KeepOut
        Where the rules forbid the robot to be now.
    looks : bool
        Face the heading on the way, too.
    races : bool
        To a ball that whoever is first has: straight, and at full speed.
    """

    intent: str
    target: Point
    heading_rad: float
    kick_mps: float = 0.0
    dribble: bool = False
    avoid_ball: bool = False
    close: bool = False
    holding: bool = False
    why: Reason | None = None
    speed_mps: float | None = None
    keep_outs: tuple[KeepOut, ...] = ()
    looks: bool = False
    races: bool = False
