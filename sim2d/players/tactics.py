"""What to do next: pure decisions from what a player believes, in its team's frame (the opponent's goal at +x)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.field import Field
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.planning.shots.goal_cover import cover_goal
from robocup_vision.planning.shots.shot_planner import ShotPlan
from sim2d.kick_off import kick_off_pose
from sim2d.players.ball_memory import TAKEN_REACHES
from sim2d.robot_link import Phase, Reason, RobotLimits

Point = tuple[float, float]

# a keeper stands so many radii before its goal's line
KEEPER_RADII = 1.3
# it fetches a ball within this many robot radii of its goal's middle, and within so many of the end line
_AREA_RADII, _AREA_DEPTH_RADII = 7.0, 6.0
# directions in the goal's mouth that are tried, and how near to a shot's line an obstacle stops it, in ball radii
_SHOTS, _LINE_RADII = 7, 3.5
# a kick is sure within so many goal widths, and allowed within this angle where the goal is near
_SHOT_WIDTHS = 3.0
_WIDEST_AIM_RAD = 0.35
# a keeper blocks a ball within so many goal widths of its goal, and leaves it so much room; it clears a ball that it
# holds where another one is so near, in radii
_BLOCK_WIDTHS, _BLOCK_ROOM_M, _PRESSED_RADII = 4 / 3, 0.03, 3.0
# seconds the ball is led by where it rolls
_LEAD_S = 0.15
# a shot worth less than this is none; a ball held for longer is kicked in any case
_MIN_CHANCE, _LONGEST_HELD_S = 0.05, 3.0
# part of the way round the ball that is driven towards at a time
_STEP_RAD = 1.2


@dataclass(frozen=True, slots=True)
class Situation:
    """What a player believes, team frame, metres and seconds.

    Parameters
    ----------
    pose : Pose2
        Itself.
    ball : (float, float) or None
        The ball, where it was last seen.
    ball_velocity_mps : (float, float)
        Its velocity then.
    in_mouth : bool
        It holds the ball.
    held_s : float
        For how long.
    obstacles : tuple of (float, float)
        Whatever stands on the floor and is no wall.
    phase : {"kick_off", "play"}
    kick_off : bool
        Own team kicks off.
    t_s : float
        Now.
    shot : ShotPlan or None
        What to do with the ball in the mouth, where that was planned.
    others : tuple of (float, float)
        Who is followed on the field; nobody by players that do not plan.
    """

    pose: Pose2
    ball: Point | None
    ball_velocity_mps: Point
    in_mouth: bool
    held_s: float
    obstacles: tuple[Point, ...]
    phase: Phase
    kick_off: bool
    t_s: float
    shot: ShotPlan | None = None
    others: tuple[Point, ...] = ()


@dataclass(frozen=True, slots=True)
class Plan:
    """Where to go and what to do there, team frame.

    Parameters
    ----------
    intent : str
        In a word or two.
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
        Why so, where that was weighed.
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


class Tactics:
    """Decides for one player, by its number and what it sees.

    Number 0 keeps the goal where there are others; number 1 fetches the ball, and further ones take it only in their
    own strip of the field, so that no two of a team run for the same ball though they cannot speak.

    Parameters
    ----------
    field : Field
        The pitch.
    limits : RobotLimits
        What the robot can do.
    number, players : int
        As in `PlayerSetup`.

    Attributes
    ----------
    is_keeper : bool
        It keeps the goal.
    """

    def __init__(self, field: Field, limits: RobotLimits, number: int, players: int) -> None:
        self._field, self._limits = field, limits
        self._half_length, self._half_width = field.length_m / 2, field.width_m / 2
        self._ball_radius = field.ball_radius_m
        self._goal_half = field.goals[0].width_m / 2 if field.goals else field.width_m / 6
        self._reach = limits.radius_m + field.ball_radius_m
        self.is_keeper = number == 0 and players > 1
        self._number, self._players = number, players
        # nothing holds robots back where there are no walls
        self._inset = limits.radius_m + 0.015 if field.is_bounded else 0.0

    def decide(self, now: Situation) -> Plan:
        """Choose the next plan."""
        if now.phase == "kick_off":
            return self._kick_off(now)
        if now.in_mouth:
            return self._play_ball(now)
        if self.is_keeper:
            return self._keep(now)
        if now.ball is None:
            return self._search(now)
        if self._belongs_to_keeper(now.ball) and self._players > 1:
            return self._support(now, "leave it to the keeper")
        if self._number >= 2 and not self._in_own_strip(now.ball):
            return self._support(now, "support")
        return self._fetch(now)

    def _kick_off(self, now: Situation) -> Plan:
        place = kick_off_pose(self._field, 1, self._number, self._players, self._limits.radius_m)
        x = place.x_m
        if now.kick_off and self._number == min(1, self._players - 1):
            # the one who kicks off may wait right behind the ball
            x = -2.0 * self._reach
        target = (x, place.y_m)
        return Plan("kick-off", target, _heading(target, (0.0, 0.0)), avoid_ball=True)

    def _play_ball(self, now: Situation) -> Plan:
        """Turn the ball held to the opponent's goal; kick it there, or where nobody stands."""
        pose = now.pose
        ball = self._mouth(pose)
        if now.shot is not None:
            planned = self._planned_shot(now, ball, now.shot)
            if planned is not None:
                return planned
        if self.is_keeper and self._is_pressed(now):
            return self._kick("clear", ball, pose.theta_rad)
        shot, is_open = self._shot(ball, now.obstacles)
        wanted = _heading((pose.x_m, pose.y_m), shot)
        off = abs(wrap_angle(wanted - pose.theta_rad))
        away = math.dist(ball, shot)
        aimed = off < min(_WIDEST_AIM_RAD, max(0.06, 0.5 * self._goal_half / max(away, 1e-6)))
        in_range = away < _SHOT_WIDTHS * 2 * self._goal_half or self.is_keeper
        if aimed and ((is_open and in_range) or now.held_s > _LONGEST_HELD_S):
            return self._kick("shoot", ball, wanted)
        if now.held_s > 4.5:
            # held in vain, in a corner or a scrum: any way out is good
            return self._kick("clear", ball, pose.theta_rad)
        step = min(0.4, max(away - 2 * self._goal_half, 0.15))
        target = (pose.x_m + step * math.cos(wanted), pose.y_m + step * math.sin(wanted))
        return self._dribble(pose, target, wanted)

    def _is_pressed(self, now: Situation) -> bool:
        """Whether another one is so near that the ball is soon lost, and a kick would not go to the own goal."""
        here = (now.pose.x_m, now.pose.y_m)
        near = _PRESSED_RADII * self._limits.radius_m
        return math.cos(now.pose.theta_rad) > 0.3 and any(math.dist(other, here) < near for other in now.others)

    def _kick(self, intent: str, ball: Point, heading_rad: float, why: Reason | None = None) -> Plan:
        return Plan(intent, self._inside(ball), heading_rad, self._limits.kick_speed_mps, True, False, True, True, why)

    def _planned_shot(self, now: Situation, ball: Point, shot: ShotPlan) -> Plan | None:
        """Kick, turn or go nearer, as promises most; None where nothing promises much."""
        if shot.chance < _MIN_CHANCE or now.held_s > _LONGEST_HELD_S:
            return None
        pose = now.pose
        why = Reason("shot", shot.action, shot.reason)
        if shot.action == "kick":
            return self._kick("shoot", ball, pose.theta_rad, why)
        return self._dribble(pose, _beyond(shot.place_m, shot.heading_rad, -self._reach), shot.heading_rad, why)

    def _dribble(self, pose: Pose2, target: Point, wanted_rad: float, why: Reason | None = None) -> Plan:
        """Take the ball to a place; draw back first where turning would wedge it between robot and wall."""
        if abs(wrap_angle(wanted_rad - pose.theta_rad)) <= 0.6 or self._room_ahead(pose) >= 1.5 * self._reach:
            return Plan("dribble", self._inside(target), wanted_rad, 0.0, True, False, False, True, why)
        back = pose.compose(Pose2(-0.3, 0.0, 0.0))
        return Plan("draw back", self._inside((back.x_m, back.y_m)), pose.theta_rad, 0.0, True, False, True, True, why)

    def _fetch(self, now: Situation) -> Plan:
        """Go behind the ball as seen from the opponent's goal, where that is near; else take it from where one is."""
        assert now.ball is not None
        pose = now.pose
        ball = self._on_field(_led(now))
        to_ball = _heading((pose.x_m, pose.y_m), ball)
        to_goal = _heading(ball, (self._half_length, 0.0))
        away = math.dist((pose.x_m, pose.y_m), ball)
        off = wrap_angle(to_ball - to_goal)
        if abs(off) < 0.9 or self._near_wall(ball) or away > 6 * self._reach:
            # through the ball's middle, so that the robot arrives with speed enough to take it
            behind = self._inside(_beyond(ball, to_ball, -0.75 * self._reach))
            heading = _heading((pose.x_m, pose.y_m), ball)
            return Plan("fetch", behind, heading, 0.0, True, False, away < 3 * self._reach)
        # on the near side round it
        side = 1.0 if off > 0 else -1.0
        place = _beyond(ball, to_goal + math.pi + side * max(abs(off) - _STEP_RAD, 0.0), 1.5 * self._reach)
        return Plan("get behind", self._inside(place), to_ball, 0.0, False, True, True)

    def _keep(self, now: Situation) -> Plan:
        """Stand between the ball and the goal; fetch a ball that lies in front of it."""
        line, post = self._keeper_line
        if now.ball is None:
            # look to both sides, so that nothing hides the ball for long
            target = (line, 0.3 * post * math.sin(now.t_s))
            return Plan("keep", target, 0.0)
        ball = self._on_field(_led(now))
        near = _BLOCK_WIDTHS * 2 * self._goal_half
        if self._is_another_s(now, now.ball) and math.dist(ball, (-self._half_length, 0.0)) < near:
            return self._block(now, ball)
        speed = math.hypot(*now.ball_velocity_mps)
        if self._belongs_to_keeper(now.ball) and speed < 0.6:
            return self._fetch(now)
        x, y = now.ball
        v_x, v_y = now.ball_velocity_mps
        if v_x < -0.2 and x > line:
            # where a rolling ball will cross
            y += v_y / -v_x * (x - line)
        else:
            # on the line from the ball to the goal's middle
            y *= (line + self._half_length + 0.3) / max(x + self._half_length + 0.3, 0.3)
        target = (line, max(-post, min(post, y)))
        return Plan("keep", target, _heading((now.pose.x_m, now.pose.y_m), now.ball), dribble=True)

    def _is_another_s(self, now: Situation, ball: Point) -> bool:
        """Whether another one has the ball: is close to it, and nearer than this robot."""
        away = math.dist((now.pose.x_m, now.pose.y_m), ball)
        near = min(away, TAKEN_REACHES * self._reach)
        return any(math.dist(other, ball) < near for other in now.others)

    def _block(self, now: Situation, ball: Point) -> Plan:
        """Stand between a ball that another one has and the goal, so near that nothing of the goal is open."""
        end, half = -self._half_length, self._goal_half
        cover = cover_goal(ball, ((end, half), (end, -half)), self._reach, _BLOCK_ROOM_M)
        (x, y), (line, post) = cover.place_m, self._keeper_line
        if x < line:
            # there is no room so far back: where the way there is crossed, or beside a ball that lies behind
            y += min((line - x) / max(ball[0] - x, 1e-6), 1.0) * (ball[1] - y)
            x = line
        heading = _heading((now.pose.x_m, now.pose.y_m), ball)
        open_deg = math.degrees(cover.open_rad)
        why = Reason("shot", "block", f"another one has the ball, {open_deg:.0f} deg of the goal before it")
        return Plan("block", self._inside((x, max(-post, min(post, y)))), heading, dribble=True, why=why)

    @property
    def _keeper_line(self) -> tuple[float, float]:
        """How far back a keeper stands, and how far to either side."""
        radius = self._limits.radius_m
        return -self._half_length + KEEPER_RADII * radius, self._goal_half - 0.5 * radius

    def _support(self, now: Situation, intent: str) -> Plan:
        x = 0.25 * self._half_length if now.ball is None else min(max(now.ball[0] - 0.3, -0.4 * self._half_length), 0.3)
        y = self._strip_y()
        if intent != "support":
            x, y = -0.3 * self._half_length, 0.3 * self._half_width * math.sin(0.5 * now.t_s)
        target = self._inside((x, y))
        return Plan(intent, target, _heading((now.pose.x_m, now.pose.y_m), now.ball or (self._half_length, 0.0)))

    def _search(self, now: Situation) -> Plan:
        """Go round the field's middle, to look behind whatever hides the ball."""
        corner = int(now.t_s / 3.0) % 4
        x = (0.4, -0.4, -0.4, 0.4)[corner] * self._half_length
        y = (0.4, 0.4, -0.4, -0.4)[corner] * self._half_width
        return Plan("search", (x, y), now.pose.theta_rad + 0.5)

    def _shot(self, ball: Point, obstacles: tuple[Point, ...]) -> tuple[Point, bool]:
        """Choose the place in the goal's mouth nearest to its middle with a free way; else the middle, and False."""
        line = self._half_length
        width = self._goal_half - 1.5 * self._ball_radius
        places = [(line, width * (2 * k / (_SHOTS - 1) - 1)) for k in range(_SHOTS)]
        near = self._limits.radius_m + (_LINE_RADII - 2) * self._ball_radius
        free = [p for p in places if all(_distance_to_way(o, ball, p) > near for o in obstacles)]
        if not free:
            return (line, 0.0), False
        return min(free, key=lambda p: abs(p[1])), True

    def _belongs_to_keeper(self, ball: Point) -> bool:
        radius = self._limits.radius_m
        return ball[0] < -self._half_length + _AREA_DEPTH_RADII * radius and abs(ball[1]) < _AREA_RADII * radius

    def _in_own_strip(self, ball: Point) -> bool:
        strips = self._players - 1
        strip = min(int((ball[1] / self._half_width + 1) / 2 * strips), strips - 1)
        return strip == self._number - 1

    def _strip_y(self) -> float:
        strips = max(self._players - 1, 1)
        return self._half_width * ((2 * self._number - 1) / strips - 1)

    def _mouth(self, pose: Pose2) -> Point:
        mouth = pose.compose(Pose2(self._reach, 0.0, 0.0))
        return mouth.x_m, mouth.y_m

    def _near_wall(self, ball: Point) -> bool:
        room = 2.2 * self._reach
        return self._inset > 0 and (abs(ball[0]) > self._half_length - room or abs(ball[1]) > self._half_width - room)

    def _room_ahead(self, pose: Pose2) -> float:
        """Way from the robot's centre straight ahead to a wall."""
        if not self._inset:
            return math.inf
        c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
        ways = [math.inf]
        if abs(c) > 1e-9:
            ways.append((math.copysign(self._half_length, c) - pose.x_m) / c)
        if abs(s) > 1e-9:
            ways.append((math.copysign(self._half_width, s) - pose.y_m) / s)
        return min(ways)

    def _on_field(self, place: Point) -> Point:
        """Return the nearest place a ball can lie in; in the goals too."""
        x, y = place
        limit_y = self._half_width - self._ball_radius
        return max(-self._half_length - 0.1, min(self._half_length + 0.1, x)), max(-limit_y, min(limit_y, y))

    def _inside(self, place: Point) -> Point:
        """Return the nearest place a robot can stand in."""
        limit_x, limit_y = self._half_length - self._inset, self._half_width - self._inset
        return max(-limit_x, min(limit_x, place[0])), max(-limit_y, min(limit_y, place[1]))


def _led(now: Situation) -> Point:
    assert now.ball is not None
    return now.ball[0] + _LEAD_S * now.ball_velocity_mps[0], now.ball[1] + _LEAD_S * now.ball_velocity_mps[1]


def _heading(start: Point, end: Point) -> float:
    return math.atan2(end[1] - start[1], end[0] - start[0])


def _beyond(place: Point, heading_rad: float, way_m: float) -> Point:
    return place[0] + way_m * math.cos(heading_rad), place[1] + way_m * math.sin(heading_rad)


def _distance_to_way(place: Point, start: Point, end: Point) -> float:
    along_x, along_y = end[0] - start[0], end[1] - start[1]
    length2 = along_x**2 + along_y**2
    share = ((place[0] - start[0]) * along_x + (place[1] - start[1]) * along_y) / max(length2, 1e-12)
    share = max(0.0, min(1.0, share))
    return math.hypot(place[0] - start[0] - share * along_x, place[1] - start[1] - share * along_y)
