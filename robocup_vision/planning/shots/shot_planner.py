"""Plans a shot (kick now, turn first, or go nearer first), and finds where a robot covers its own goal.

The robot has the ball. The positions and velocities of the others and its own heading are estimates with covariances.
The value of an action is the probability of a goal, times the probability that the robot still has the ball then.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.checks import as_positive, require_positive
from robocup_vision.disc import Disc
from robocup_vision.geometry import wrap_angle
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.normal import normal_below
from robocup_vision.planning.gaps.gap_choice import Point


@dataclass(frozen=True, slots=True)
class Cover:
    """A place from which a robot covers a goal."""

    place_m: Point  #: place of the robot's centre
    open_rad: float  #: angle of the goal's mouth at the ball


def cover_goal(ball: Point, posts_m: tuple[Point, Point], reach_m: float, room_m: float) -> Cover:
    """Choose the place farthest from the ball at which a robot covers the whole goal.

    The place is on the bisector of the angle between the lines from the ball to the posts; both lines are tangent to
    the circle of radius `reach_m` around it. Where `room_m` makes that impossible, the middle of the goal is covered.

    Parameters
    ----------
    posts_m : ((float, float), (float, float))
        Inner edges of the goal's posts.
    reach_m : float
        Sum of the radii of ball and robot.
    room_m : float
        Smallest distance between ball and robot.

    Raises
    ------
    ArgumentError
        If `reach_m` is not positive or `room_m` is negative.
    """
    as_positive("reach_m", reach_m)
    if not (math.isfinite(room_m) and room_m >= 0.0):
        raise ArgumentError(f"room_m must not be negative, got {room_m!r}")
    first, second = (math.atan2(post[1] - ball[1], post[0] - ball[0]) for post in posts_m)
    open_rad = wrap_angle(second - first)
    half, middle = abs(open_rad) / 2, first + open_rad / 2
    away_m = max(reach_m / max(math.sin(half), 1e-9), reach_m + room_m)
    return Cover((ball[0] + away_m * math.cos(middle), ball[1] + away_m * math.sin(middle)), 2 * half)


# number of points of the goal's mouth that are aimed at: less than a ball apart on a goal of the small-size league
_AIMS = 25
# distances of the places to which the ball may be taken first. Nearer ones are closer together: the farther the
# place, the less certain is what happens until then.
_WAYS_M = (0.1, 0.2, 0.35, 0.5, 0.7)
# directions of these places, from that of the goal: farther aside, the goal gets no wider
_DIRECTIONS_RAD = (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)


@dataclass(frozen=True, slots=True)
class ShotPlan:
    """A decision about the ball."""

    #: kick it the way the robot faces, turn to the heading first, or go to the place first
    action: Literal["kick", "turn", "go nearer"]
    place_m: Point  #: where the ball is to be kicked from
    heading_rad: float  #: direction of the kick
    chance: float  #: probability of a goal by that kick
    chance_now: float  #: probability of a goal by a kick now
    reason: str  #: the reason

    def half_turn(self) -> ShotPlan:
        """Return the plan after a half turn of the field frame."""
        x, y = self.place_m
        return replace(self, place_m=(-x, -y), heading_rad=wrap_angle(self.heading_rad + math.pi))


@dataclass(frozen=True, slots=True)
class ShotPlanner:
    """Plans shots at one goal.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    posts_m: tuple[Point, Point]  #: inner edges of the left and the right post, from the attackers' side
    ball_radius_m: float  #: radius of the ball
    ball_mps: float  #: speed of a kicked ball
    kick_std_rad: float  #: standard deviation of the ball's direction about the kicker's heading
    defenders: MotionLimits  #: their motion towards a kicked ball, after they have reacted (`dead_time_s`)
    #: speed and turning rate of the robot with the ball
    dribble_mps: float
    turn_rps: float
    lost_s: float  #: mean time until the robot loses the ball where another robot can reach it
    slips_s: float  #: the same if no other can: it makes endless waiting for a better chance unattractive

    def __post_init__(self) -> None:
        require_positive(
            self, "ball_radius_m", "ball_mps", "kick_std_rad", "dribble_mps", "turn_rps", "lost_s", "slips_s"
        )
        if math.dist(*self.posts_m) <= 2 * self.ball_radius_m:
            raise ArgumentError(f"a ball of {self.ball_radius_m} m does not fit between the posts {self.posts_m}")

    def plan(
        self, ball: Point, heading_rad: float, defenders: Sequence[Disc], place_std_m: float, heading_std_rad: float
    ) -> ShotPlan:
        """Choose what to do with the ball that the robot has.

        Parameters
        ----------
        heading_rad : float
            The robot's heading.
        defenders : sequence of Disc
            Robots that may stop the ball, with velocities.
        place_std_m, heading_std_rad : float
            Standard deviations of the position along each axis, and of the heading.
        """
        places, ways = self._places(ball)
        aims = self._aims()
        towards = aims[None] - places[:, None]
        headings = np.arctan2(towards[..., 1], towards[..., 0])
        now = float(self.chances(np.array(ball), np.array(heading_rad), defenders, place_std_m, heading_std_rad))
        turns = np.abs(np.remainder(headings - heading_rad + math.pi, math.tau) - math.pi)
        seconds = np.maximum(turns / self.turn_rps, ways[:, None] / self.dribble_mps)
        chances = self.chances(places[:, None], headings, defenders, place_std_m, heading_std_rad, seconds)
        reached = self._reached(places, seconds, defenders, place_std_m)
        kept = np.exp(-seconds * (reached / self.lost_s + 1.0 / self.slips_s))
        expected = chances * (kept * self._free(ball, places, defenders, place_std_m)[:, None])
        place, aim = np.unravel_index(int(np.argmax(expected)), expected.shape)
        chance = float(chances[place, aim])
        if now >= expected[place, aim]:
            return ShotPlan("kick", ball, heading_rad, now, now, f"goal in {now:.0%}, nothing better is near")
        x, y = places[place].tolist()
        heading = float(headings[place, aim])
        if place == 0:
            return ShotPlan("turn", ball, heading, chance, now, f"goal in {chance:.0%} after a turn, {now:.0%} now")
        text = f"goal in {chance:.0%} from {ways[place]:.2f} m on, {now:.0%} now"
        return ShotPlan("go nearer", (x, y), heading, chance, now, text)

    def chances(
        self,
        balls_m: FloatArray,
        headings_rad: FloatArray,
        defenders: Sequence[Disc],
        place_std_m: float,
        heading_std_rad: float,
        after_s: FloatArray | float = 0.0,
    ) -> FloatArray:
        """Return the probabilities of a goal (...) by kicks from places (..., 2) at headings (...) after `after_s`.

        A kick, with the errors of position and heading, must pass between the posts, and pass each defender. Until the
        kick a defender moves between the ball and the goal. After the kick it moves to the ball once it has reacted.
        """
        c, s = np.cos(headings_rad), np.sin(headings_rad)
        spread = math.hypot(self.kick_std_rad, heading_std_rad)
        chance = np.full(np.broadcast_shapes(balls_m.shape[:-1], np.shape(headings_rad)), -1.0)
        for post, side in zip(self.posts_m, (1.0, -1.0), strict=True):
            x, y = post[0] - balls_m[..., 0], post[1] - balls_m[..., 1]
            along, aside = c * x + s * y, side * (c * y - s * x)
            std = np.hypot(place_std_m, spread * np.maximum(along, self.ball_radius_m))
            chance = chance + np.where(along > 0.0, normal_below((aside - self.ball_radius_m) / std), 0.0)
        chance = np.maximum(chance, 0.0)
        for one in defenders:
            x, y, v_x, v_y = self._guards(one, balls_m, after_s)
            seconds = np.maximum(c * x + s * y, 0.0) / self.ball_mps
            x, y = x + seconds * v_x, y + seconds * v_y
            along, aside = c * x + s * y, c * y - s * x
            reach = self._reach_m(seconds)
            (xx, xy), (_, yy) = one.covariance
            across = s**2 * xx - 2 * s * c * xy + c**2 * yy
            std = np.sqrt(across + place_std_m**2 + (spread * along) ** 2)
            wide = reach + one.radius_m + self.ball_radius_m
            passes = normal_below((aside - wide) / std) + normal_below((-aside - wide) / std)
            chance = chance * np.where(along > 0.0, passes, 1.0)
        return np.asarray(chance)

    def _guards(
        self, one: Disc, balls_m: FloatArray, after_s: FloatArray | float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return a defender's position relative to the ball, x and y, and its velocity after `after_s`.

        It has driven towards the line from the ball to the goal.
        """
        limits, goal = self.defenders, np.mean(self.posts_m, axis=0)
        drifts = np.minimum(after_s, limits.dead_time_s)
        x = one.x_m + drifts * one.vx_mps - balls_m[..., 0]
        y = one.y_m + drifts * one.vy_mps - balls_m[..., 1]
        way_x, way_y = goal[0] - balls_m[..., 0], goal[1] - balls_m[..., 1]
        fraction = np.clip((x * way_x + y * way_y) / np.maximum(way_x**2 + way_y**2, 1e-12), 0.0, 1.0)
        off_x, off_y = fraction * way_x - x, fraction * way_y - y
        runs = np.minimum(self._reach_m(np.asarray(after_s)) / np.maximum(np.hypot(off_x, off_y), 1e-9), 1.0)
        lost_mps = limits.acceleration_mps2 * np.maximum(after_s - limits.dead_time_s, 0.0)
        speed_ratio = np.maximum(1.0 - lost_mps / max(math.hypot(one.vx_mps, one.vy_mps), 1e-9), 0.0)
        return x + runs * off_x, y + runs * off_y, speed_ratio * one.vx_mps, speed_ratio * one.vy_mps

    def _places(self, ball: Point) -> tuple[FloatArray, FloatArray]:
        """Return the places (P, 2) for a kick, first the ball's present one, and their distances from it (P,)."""
        goal = np.mean(self.posts_m, axis=0)
        ahead = math.atan2(goal[1] - ball[1], goal[0] - ball[0])
        room = math.dist(ball, goal.tolist()) - 2 * self.ball_radius_m
        places, ways = [ball], [0.0]
        for way in _WAYS_M:
            if way >= room:
                break
            for direction in _DIRECTIONS_RAD:
                a = ahead + direction
                places.append((ball[0] + way * math.cos(a), ball[1] + way * math.sin(a)))
                ways.append(way)
        return np.array(places), np.array(ways)

    def _aims(self) -> FloatArray:
        left, right = np.array(self.posts_m)
        margin = self.ball_radius_m / math.dist(*self.posts_m)
        fraction = np.linspace(margin, 1.0 - margin, _AIMS)[:, None]
        return np.asarray(left + fraction * (right - left))

    def _reach_m(self, seconds: FloatArray) -> FloatArray:
        """Return how far a defender can have deviated, after `seconds`, from motion with its present velocity."""
        runs = np.maximum(seconds - self.defenders.dead_time_s, 0.0)
        return np.asarray(np.minimum(0.5 * self.defenders.acceleration_mps2 * runs**2, self.defenders.speed_mps * runs))

    def _reached(
        self, places: FloatArray, seconds: FloatArray, defenders: Sequence[Disc], place_std_m: float
    ) -> FloatArray:
        """Return the probability (P, K) that a defender can reach each place (P, 2) within each time (P, K)."""
        away = np.ones(seconds.shape)
        for one in defenders:
            x = one.x_m + seconds * one.vx_mps - places[:, None, 0]
            y = one.y_m + seconds * one.vy_mps - places[:, None, 1]
            std = math.sqrt(one.variance_m2 + place_std_m**2)
            room = np.hypot(x, y) - self._reach_m(seconds) - one.radius_m - self.ball_radius_m
            away *= normal_below(room / std)
        return np.asarray(1.0 - away)

    def _free(self, ball: Point, places: FloatArray, defenders: Sequence[Disc], place_std_m: float) -> FloatArray:
        """Return the probability that the straight way to each place is free of defenders."""
        free = np.ones(len(places))
        way = places - np.array(ball)
        length2 = np.maximum(np.sum(way**2, axis=1), 1e-12)
        for one in defenders:
            off = np.array([one.x_m - ball[0], one.y_m - ball[1]])
            fraction = np.clip(way @ off / length2, 0.0, 1.0)
            away = np.hypot(*(off - fraction[:, None] * way).T)
            std = math.sqrt(one.variance_m2 + place_std_m**2)
            # the robot pushes the ball in front of it, so only the ball's radius counts
            free *= np.where(fraction > 0.0, normal_below((away - one.radius_m - self.ball_radius_m) / std), 1.0)
        return free
