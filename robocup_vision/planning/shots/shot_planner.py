"""Kick now, turn first or go nearer first: the gap in a goal's mouth that a ball gets through, priced like a gate.

A robot that holds the ball believes where others stand and how they move, and knows its heading only so well. Each way
on is worth its chance of a goal, less what may be lost on the way: somebody takes the ball sooner or later.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from field_models.errors import ArgumentError
from robocup_vision.arrays import FloatArray
from robocup_vision.disc import Disc
from robocup_vision.geometry import wrap_angle
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.planning.gaps.gap import Point

# places in the mouth that are aimed at; places nearer to it that are thought of: ways, metres, and directions, radians
_AIMS = 25
_WAYS_M = (0.1, 0.2, 0.35, 0.5, 0.7)
_DIRECTIONS_RAD = (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0)


@dataclass(frozen=True, slots=True)
class ShotPlan:
    """What to do with the ball.

    Parameters
    ----------
    action : {"kick", "turn", "go nearer"}
        Kick it the way the robot faces, turn to the heading first, or go to the place first.
    place_m : (float, float)
        Where the ball is to be kicked from.
    heading_rad : float
        Which way.
    chance : float
        Of a goal, if it is kicked there and then.
    chance_now : float
        Of a goal, if it is kicked now.
    reason : str
        Why.
    """

    action: Literal["kick", "turn", "go nearer"]
    place_m: Point
    heading_rad: float
    chance: float
    chance_now: float
    reason: str

    def half_turn(self) -> ShotPlan:
        """Return the same in the frame of the other side."""
        x, y = self.place_m
        return replace(self, place_m=(-x, -y), heading_rad=wrap_angle(self.heading_rad + math.pi))


@dataclass(frozen=True, slots=True)
class ShotPlanner:
    """Plans shots at one goal.

    Parameters
    ----------
    posts_m : ((float, float), (float, float))
        Inner edges of the left and the right post, as seen by who attacks.
    ball_radius_m : float
        Of the ball.
    ball_mps : float
        How fast a kicked ball rolls.
    kick_std_rad : float
        How far the ball leaves the kicker's heading: standard deviation.
    defenders : MotionLimits
        How they can move, towards a ball as soon as it is kicked and they have seen it (`dead_time_s`).
    dribble_mps, turn_rps : float
        How fast the robot can go and turn with the ball.
    lost_s : float
        How long a ball is held, on average, where somebody can reach it.
    slips_s : float
        The same where nobody can: no chance is worth waiting for without end.

    Raises
    ------
    ArgumentError
        A value is out of its range.
    """

    posts_m: tuple[Point, Point]
    ball_radius_m: float
    ball_mps: float
    kick_std_rad: float
    defenders: MotionLimits
    dribble_mps: float
    turn_rps: float
    lost_s: float
    slips_s: float

    def __post_init__(self) -> None:
        for name in ("ball_radius_m", "ball_mps", "kick_std_rad", "dribble_mps", "turn_rps", "lost_s", "slips_s"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} must be positive, got {value!r}")
        if math.dist(*self.posts_m) <= 2 * self.ball_radius_m:
            raise ArgumentError(f"a ball of {self.ball_radius_m} m does not fit between the posts {self.posts_m}")

    def plan(
        self, ball: Point, heading_rad: float, defenders: Sequence[Disc], place_std_m: float, heading_std_rad: float
    ) -> ShotPlan:
        """Choose what to do with a ball that is held.

        Parameters
        ----------
        ball : (float, float)
            Where it is.
        heading_rad : float
            The way the robot faces.
        defenders : sequence of Disc
            Who may stop it, with velocities.
        place_std_m, heading_std_rad : float
            How well the robot knows where it is: standard deviations, each way.
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
        worth = chances * (kept * self._free(ball, places, defenders, place_std_m)[:, None])
        place, aim = np.unravel_index(int(np.argmax(worth)), worth.shape)
        chance = float(chances[place, aim])
        if now >= worth[place, aim]:
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
        """Return the chances of a goal (...) of balls kicked from places (..., 2) at headings (...), after so long.

        A kick passes between the posts with both errors, and each defender, who runs for it as soon as it has seen it,
        if the gap between is wider than what is not known of it. Until the kick they go between the ball and the goal.
        """
        c, s = np.cos(headings_rad), np.sin(headings_rad)
        spread = math.hypot(self.kick_std_rad, heading_std_rad)
        chance = np.full(np.broadcast_shapes(balls_m.shape[:-1], np.shape(headings_rad)), -1.0)
        for post, side in zip(self.posts_m, (1.0, -1.0), strict=True):
            x, y = post[0] - balls_m[..., 0], post[1] - balls_m[..., 1]
            along, aside = c * x + s * y, side * (c * y - s * x)
            std = np.hypot(place_std_m, spread * np.maximum(along, self.ball_radius_m))
            chance = chance + np.where(along > 0.0, _below((aside - self.ball_radius_m) / std), 0.0)
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
            passes = _below((aside - wide) / std) + _below((-aside - wide) / std)
            chance = chance * np.where(along > 0.0, passes, 1.0)
        return np.asarray(chance)

    def _guards(
        self, one: Disc, balls_m: FloatArray, after_s: FloatArray | float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Where, from the ball, a defender is after so long, and its velocity: it heads for the way to the goal."""
        limits, goal = self.defenders, np.mean(self.posts_m, axis=0)
        drifts = np.minimum(after_s, limits.dead_time_s)
        x = one.x_m + drifts * one.vx_mps - balls_m[..., 0]
        y = one.y_m + drifts * one.vy_mps - balls_m[..., 1]
        way_x, way_y = goal[0] - balls_m[..., 0], goal[1] - balls_m[..., 1]
        share = np.clip((x * way_x + y * way_y) / np.maximum(way_x**2 + way_y**2, 1e-12), 0.0, 1.0)
        off_x, off_y = share * way_x - x, share * way_y - y
        runs = np.minimum(self._reach_m(np.asarray(after_s)) / np.maximum(np.hypot(off_x, off_y), 1e-9), 1.0)
        lost_mps = limits.acceleration_mps2 * np.maximum(after_s - limits.dead_time_s, 0.0)
        kept = np.maximum(1.0 - lost_mps / max(math.hypot(one.vx_mps, one.vy_mps), 1e-9), 0.0)
        return x + runs * off_x, y + runs * off_y, kept * one.vx_mps, kept * one.vy_mps

    def _places(self, ball: Point) -> tuple[FloatArray, FloatArray]:
        """Where the ball could be kicked from, here first, and how far that is."""
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
        share = np.linspace(margin, 1.0 - margin, _AIMS)[:, None]
        return np.asarray(left + share * (right - left))

    def _reach_m(self, seconds: FloatArray) -> FloatArray:
        """How far from where its velocity leads it a defender can be by then."""
        runs = np.maximum(seconds - self.defenders.dead_time_s, 0.0)
        return np.asarray(np.minimum(0.5 * self.defenders.acceleration_mps2 * runs**2, self.defenders.speed_mps * runs))

    def _reached(
        self, places: FloatArray, seconds: FloatArray, defenders: Sequence[Disc], place_std_m: float
    ) -> FloatArray:
        """Chance that somebody can be at each place (P, 2) with the ball by then (P, K)."""
        away = np.ones(seconds.shape)
        for one in defenders:
            x = one.x_m + seconds * one.vx_mps - places[:, None, 0]
            y = one.y_m + seconds * one.vy_mps - places[:, None, 1]
            std = math.sqrt(one.variance_m2 + place_std_m**2)
            room = np.hypot(x, y) - self._reach_m(seconds) - one.radius_m - self.ball_radius_m
            away *= _below(room / std)
        return np.asarray(1.0 - away)

    def _free(self, ball: Point, places: FloatArray, defenders: Sequence[Disc], place_std_m: float) -> FloatArray:
        """Chance that nobody stands in the straight way to each place."""
        free = np.ones(len(places))
        way = places - np.array(ball)
        length2 = np.maximum(np.sum(way**2, axis=1), 1e-12)
        for one in defenders:
            off = np.array([one.x_m - ball[0], one.y_m - ball[1]])
            share = np.clip(way @ off / length2, 0.0, 1.0)
            away = np.hypot(*(off - share[:, None] * way).T)
            std = math.sqrt(one.variance_m2 + place_std_m**2)
            # it holds the ball in front of itself: where that touches, so does the robot
            free *= np.where(share > 0.0, _below((away - one.radius_m - self.ball_radius_m) / std), 1.0)
        return free


def _below(x: FloatArray) -> FloatArray:
    """Chance that a standard normal variable lies below each value."""
    from scipy.special import ndtr

    return np.asarray(ndtr(x))
