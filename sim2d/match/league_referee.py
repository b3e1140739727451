"""The small-size league's rules of a match: stops, kick-offs, free kicks, penalties, ball placement, fouls, cards.

This automatic referee knows the truth. Like the league's game controller, it gives commands; `phase` is what a command
means to a player. It holds the rules of division B, apart from those about people.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from field_models import Field
from sim2d.match.pitch_rules import FoulKind, NextPlay, PitchRules, Restart, kick_time_s
from sim2d.robot_link import Phase, Point, RobotLimits
from sim2d.world.ball_physics import CLEAR_HEIGHT_M
from sim2d.world.referee import Ruling
from sim2d.world.state import BallState, Event, RobotState

Command = Literal[
    "halt",
    "stop",
    "normal_start",
    "force_start",
    "prepare_kick_off",
    "prepare_penalty",
    "direct_free",
    "ball_placement",
]
Stage = Literal["first_half", "half_time", "second_half", "post_game"]


_HALF_TIME_S = 5.0
# The duration of the halt at the beginning, the shortest duration of a stop, and the time into a stop at which a person
# places the ball if no team does. All are long enough for every robot to have received the command.
_BEGIN_S = 1.0
_STOP_S = 3.0
_BY_HAND_S = 0.5
# The shortest and the longest time for preparing a kick-off or penalty.
_PREPARE_S = 2.0
_MAX_PREPARE_S = 10.0
# The longest time of a ball placement.
_PLACE_S = 30.0
# A ball is placed if it lies within the first distance of its place and the placing team's robots are farther from it
# than the second distance, or the third where the same team kicks the ball next.
_PLACED_M = 0.15
_CLEARANCE_M = 0.5
_CLEARANCE_OF_KICKER_M = 0.05
# The game is stopped when a ball in play has stayed within this radius for this time.
_STILL_M = 0.05
_STILL_S = 10.0
# A kicked ball is in play once it has moved this far.
_IN_PLAY_M = 0.05
# The highest speed of robots in a stop, and the time they have to slow down or to leave a ball that is being placed.
_STOP_MPS = 1.5
_STOP_GRACE_S = 2.0
# The smallest distance of a robot's hull from the ball in a stop and at the other team's kicks.
_BALL_ROOM_M = 0.5
# A faster kick is a foul.
_BALL_MPS = 6.5
# A ball within this distance of a robot's hull touches it: the ball moves about so far between two calls of `judge`.
_TOUCH_M = 0.012
# The number of fouls that gives a yellow card, and the time for which the team then plays with one robot less.
_FOULS_A_CARD = 3
_CARD_S = 120.0


@dataclass(frozen=True, slots=True)
class Foul:
    """One foul: its time, the side and number of the robot, and its kind."""

    t_s: float
    side: int
    number: int
    kind: FoulKind


def league_referee(field: Field, limits: RobotLimits) -> LeagueReferee:
    """Return a referee by the league's rules; this function is a `sim2d.world.referee.RefereeFactory`."""
    return LeagueReferee(field, limits.radius_m)


class LeagueReferee:
    """Judges one match between side +1, which attacks the goal at +x, and side -1.

    Parameters
    ----------
    half_s : float
        Length of a half; infinite: the match has only one.

    Attributes
    ----------
    command, command_side, command_counter, command_s : str, int, int, float
        The last command, the side whose turn it is (0: neither), the number of commands so far, and the command's time.
    stage, stage_end_s : str, float
        The part of the match, and when it ends.
    placement_m : (float, float) or None
        Where the ball is to be placed, field frame.
    fouls : list of Foul
        All fouls so far.
    cards : dict of int to list of float
        Times at which yellow cards end, by side.
    placement_failures : dict of int to int
        Number of failures to place the ball, by side.
    """

    def __init__(
        self,
        field: Field,
        robot_radius_m: float,
        half_s: float = 300.0,
    ) -> None:
        self._field, self._radius_m, self._half_s = field, robot_radius_m, half_s
        # the longest time for taking a kick
        self._kick_s = kick_time_s(field)
        self.keepers = {1: 0, -1: 0}
        self._rules = PitchRules(field, robot_radius_m)
        self.score = {1: 0, -1: 0}
        self.command: Command = "halt"
        self.command_side, self.command_counter, self.command_s = 0, 1, 0.0
        self.stage: Stage = "first_half"
        self.stage_end_s = half_s
        self.placement_m: Point | None = None
        self.fouls: list[Foul] = []
        self.cards: dict[int, list[float]] = {1: [], -1: []}
        self.placement_failures = {1: 0, -1: 0}
        self._is_moved_by_hand = True
        self._next = NextPlay("kick_off", 1, (0.0, 0.0))
        self._kick_from: Point | None = None
        self._kind: Restart = "kick_off"
        # each a robot's side and number: it touches the ball now; it touched it last; it took the kick and may not
        # touch the ball again before another robot does
        self._touching: tuple[int, int] | None = None
        self._last: tuple[int, int] | None = None
        self._kicker: tuple[int, int] | None = None
        self._kicker_left = False
        self._still = (math.inf, math.inf, 0.0)
        self._noted: set[tuple[int, int, FoulKind]] = set()
        self._near_since_s: dict[tuple[int, int], float] = {}

    @property
    def kick_off_side(self) -> int:
        """The side whose turn it is."""
        return self.command_side

    @property
    def phase(self) -> Phase:
        """What the last command means until the ball is in play."""
        if self.command == "prepare_kick_off":
            return "kick_off"
        if self.command == "direct_free" or (self.command == "normal_start" and self._kind == "kick_off"):
            return "free_kick" if self._kick_from is not None else "play"
        if self.command == "normal_start" or self.command == "prepare_penalty":
            return "penalty" if self.command == "normal_start" else "prepare_penalty"
        if self.command == "halt" or self.command == "stop" or self.command == "ball_placement":
            return self.command
        return "play"

    @property
    def next_play(self) -> NextPlay | None:
        """The restart that follows this stop or placement; None under other commands."""
        return self._next if self.command in ("stop", "ball_placement") else None

    def action_left_s(self, t_s: float) -> float | None:
        """Return the time left for the kick, the placement or the preparation; None if there is no time limit."""
        if self.command == "ball_placement":
            allowed_s = _PLACE_S
        elif self.command in ("prepare_kick_off", "prepare_penalty"):
            allowed_s = _MAX_PREPARE_S
        elif self.phase in ("free_kick", "penalty"):
            allowed_s = self._kick_s
        else:
            return None
        return allowed_s - (t_s - self.command_s)

    def robots_allowed(self, side: int, players: int) -> int:
        """Return how many of its robots a side may have on the field."""
        return max(players - len(self.cards[side]), 0)

    def halt(self, t_s: float, ball: BallState) -> None:
        """Halt the game, as a person may at any time; it goes on by a forced start at the ball's place."""
        self._stop(t_s, NextPlay("force_start", 0, self._rules.legal_place((ball.x_m, ball.y_m))))
        self._give("halt", 0, t_s)

    def follow(
        self,
        command: Command,
        side: int,
        t_s: float,
        ball: BallState,
        coming: NextPlay | None = None,
        kind: Restart = "force_start",
        *,
        is_in_play: bool = False,
    ) -> None:
        """Take over the command of another referee, so that `judge` applies the rules that hold under it.

        Parameters
        ----------
        ball : BallState
            The ball now, from whose place a kick is taken.
        coming : NextPlay, optional
            The restart after a stop or placement.
        kind : str
            The kind of a kick: a kick-off, a free kick or a penalty.
        is_in_play : bool
            Whether the ball has been kicked since.
        """
        self._next = coming or NextPlay("force_start", 0, (ball.x_m, ball.y_m))
        self.placement_m = self._next.place_m if command == "ball_placement" else None
        self._kind, self._is_moved_by_hand = kind, False
        kicked = command in ("normal_start", "direct_free") and not is_in_play
        self._kick_from = (ball.x_m, ball.y_m) if kicked else None
        if not is_in_play:
            self._touching = self._last = self._kicker = None
        self._still = (math.inf, math.inf, t_s)
        self._give(command, side, t_s)

    @property
    def last_touch(self) -> tuple[int, int] | None:
        """Side and number of the robot that touched the ball last since the restart; None: none has."""
        return self._last

    def judge(self, t_s: float, robots: Sequence[RobotState], ball: BallState) -> list[Ruling]:
        """Return the rulings at time `t_s`: what happened, and where the ball is put."""
        self.cards = {side: [end for end in ends if end > t_s] for side, ends in self.cards.items()}
        waited = t_s - self.command_s
        if self.stage != "post_game" and t_s >= self.stage_end_s and self.command == "stop":
            return self._end_stage(t_s)
        self._note_touch(robots, ball)
        if self.command == "halt":
            over = _BEGIN_S if self.stage == "first_half" else _HALF_TIME_S
            if self.stage != "post_game" and waited >= over:
                self.stage = "second_half" if self.stage == "half_time" else self.stage
                self._give("stop", 0, t_s)
            return []
        if self.command == "stop":
            self._watch_room(t_s, robots, ball, (1, -1))
            if self._is_moved_by_hand and waited >= _BY_HAND_S:
                self._is_moved_by_hand = False
                return [Ruling(None, self._next.place_m)]
            return self._after_stop(t_s, ball) if waited >= _STOP_S else []
        if self.command == "ball_placement":
            self._watch_room(t_s, robots, ball, (-self.command_side,))
            return self._while_placing(t_s, robots, ball)
        if self.command in ("prepare_kick_off", "prepare_penalty"):
            ready = waited >= _PREPARE_S and (
                self.command == "prepare_penalty" or self._rules.is_ready_for_kick_off(self.command_side, robots)
            )
            if ready or waited >= _MAX_PREPARE_S:
                self._kick_from = (ball.x_m, ball.y_m)
                self._touching = self._last = self._kicker = None
                self._give("normal_start", self.command_side, t_s)
                return [Ruling(Event(t_s, "whistle"))]
            return []
        return self._in_play(t_s, robots, ball)

    def _in_play(self, t_s: float, robots: Sequence[RobotState], ball: BallState) -> list[Ruling]:
        scored = self._rules.goal_of(ball)
        if scored:
            self.score[scored] += 1
            self._stop(t_s, NextPlay("kick_off", -scored, (0.0, 0.0)))
            # robots cannot get a ball out of a goal
            self._is_moved_by_hand = True
            return [Ruling(Event(t_s, "goal", side=scored))]
        if self._rules.is_out(ball):
            self._stop(t_s, self._rules.after_out(self._last[0] if self._last else 1, ball))
            return [Ruling(Event(t_s, "ball_out"))]
        if self._kick_from is not None:
            moved = math.dist(self._kick_from, (ball.x_m, ball.y_m))
            if moved <= _IN_PLAY_M:
                self._watch_room(t_s, robots, ball, (-self.command_side,))
                if t_s - self.command_s > self._kick_s:
                    self._stop(t_s, NextPlay("force_start", 0, (ball.x_m, ball.y_m)))
                return []
            self._kick_from, self._kicker, self._kicker_left = None, self._last, False
            self._still = (ball.x_m, ball.y_m, t_s)
        if t_s >= self.stage_end_s:
            self._stop(t_s, self._next)
            return []
        is_penalty = self._kind == "penalty" and self.command == "normal_start"
        if is_penalty and t_s - self.command_s > self._kick_s:
            self._stop(t_s, NextPlay("free_kick", -self.command_side, self._rules.legal_place((ball.x_m, ball.y_m))))
            return []
        if math.hypot(ball.x_m - self._still[0], ball.y_m - self._still[1]) > _STILL_M:
            self._still = (ball.x_m, ball.y_m, t_s)
        elif t_s - self._still[2] > _STILL_S:
            self._stop(t_s, NextPlay("force_start", 0, self._rules.legal_place((ball.x_m, ball.y_m))))
            return [Ruling(Event(t_s, "drop"))]
        self._watch_touches(t_s, ball)
        return []

    def _after_stop(self, t_s: float, ball: BallState) -> list[Ruling]:
        kind, side, place = self._next
        if math.dist(place, (ball.x_m, ball.y_m)) > _PLACED_M or abs(ball.vx_mps) + abs(ball.vy_mps) > 0.1:
            if kind == "force_start":
                # a robot has moved it since it was put there
                self._stop(t_s, self._next)
                return []
            self.placement_m = place
            self._give("ball_placement", side, t_s)
            return []
        return self._restart(t_s)

    def _while_placing(self, t_s: float, robots: Sequence[RobotState], ball: BallState) -> list[Ruling]:
        place = self._next.place_m
        lies = math.dist(place, (ball.x_m, ball.y_m)) < _PLACED_M and math.hypot(ball.vx_mps, ball.vy_mps) < 0.05
        room_m = _CLEARANCE_OF_KICKER_M if self._next.kind == "free_kick" else _CLEARANCE_M
        left = all(
            math.dist((robot.pose.x_m, robot.pose.y_m), (ball.x_m, ball.y_m)) - self._radius_m > room_m
            for robot in robots
            if robot.side == self.command_side
        )
        if lies and left:
            return self._restart(t_s)
        if t_s - self.command_s > _PLACE_S:
            self.placement_failures[self.command_side] += 1
            self._is_moved_by_hand = True
            self._stop(t_s, self._next)
        return []

    def _restart(self, t_s: float) -> list[Ruling]:
        kind, side, place = self._next
        self._kind, self.placement_m, self._is_moved_by_hand = kind, None, False
        self._touching = self._last = self._kicker = None
        if kind == "force_start":
            self._kick_from = None
            self._still = (math.inf, math.inf, t_s)
            self._give("force_start", 0, t_s)
        elif kind == "free_kick":
            self._kick_from = place
            self._give("direct_free", side, t_s)
        else:
            self._give("prepare_kick_off" if kind == "kick_off" else "prepare_penalty", side, t_s)
        return [Ruling(Event(t_s, "whistle"))] if kind in ("force_start", "free_kick") else []

    def _stop(self, t_s: float, restart: NextPlay) -> None:
        self._next, self._kick_from, self.placement_m = restart, None, None
        # before a forced start no team places the ball: a person does, early in the stop
        self._is_moved_by_hand |= restart.kind == "force_start"
        self._noted.clear()
        self._near_since_s.clear()
        self._give("stop", 0, t_s)

    def _give(self, command: Command, side: int, t_s: float) -> None:
        self.command, self.command_side, self.command_s = command, side, t_s
        self.command_counter += 1

    def _end_stage(self, t_s: float) -> list[Ruling]:
        if self.stage == "first_half":
            self.stage = "half_time"
            self.stage_end_s = t_s + _HALF_TIME_S + self._half_s
            self._next = NextPlay("kick_off", -1, (0.0, 0.0))
            self._is_moved_by_hand = True
        else:
            self.stage = "post_game"
        self._give("halt", 0, t_s)
        return []

    def _note_touch(self, robots: Sequence[RobotState], ball: BallState) -> None:
        reach = self._radius_m + self._field.ball_radius_m + _TOUCH_M
        near = [(math.dist((r.pose.x_m, r.pose.y_m), (ball.x_m, ball.y_m)), r.side, r.number) for r in robots]
        away, side, number = min(near, default=(math.inf, 0, 0))
        if away >= reach or ball.z_m > CLEAR_HEIGHT_M:
            self._touching, self._kicker_left = None, True
            return
        self._touching = self._last = side, number
        if self._kicker is not None and self._kicker != self._last:
            # another robot has touched the ball: the kicker may touch it again
            self._kicker = None

    def _watch_touches(self, t_s: float, ball: BallState) -> None:
        """Stop the game if the last touch of the ball is a foul."""
        if self._last is not None and math.hypot(ball.vx_mps, ball.vy_mps) > _BALL_MPS:
            self._foul(t_s, *self._last, "fast_ball", ball)
            return
        if self._touching is None:
            return
        side, number = self._touching
        area, inside_m = self._rules.area, -self._field.ball_radius_m
        if self._kicker == self._touching and self._kicker_left:
            self._foul(t_s, side, number, "double_touch", ball)
        elif area is None:
            return
        elif area.holds(-side, ball.x_m, ball.y_m, inside_m) and number != self.keepers[side]:
            self._foul(t_s, side, number, "own_area", ball)
        elif area.holds(side, ball.x_m, ball.y_m, inside_m):
            self._foul(t_s, side, number, "their_area", ball)

    def _watch_room(self, t_s: float, robots: Sequence[RobotState], ball: BallState, sides: tuple[int, ...]) -> None:
        """Count fouls of robots that are too near to the ball or, in a stop, too fast."""
        if t_s - self.command_s < _STOP_GRACE_S:
            return
        for robot in robots:
            if robot.side not in sides:
                continue
            away = math.dist((robot.pose.x_m, robot.pose.y_m), (ball.x_m, ball.y_m)) - self._radius_m
            key = robot.side, robot.number
            if away >= _BALL_ROOM_M:
                self._near_since_s.pop(key, None)
            elif self.command != "ball_placement" or self._is_in_the_way(key, t_s):
                self._note(t_s, *key, "near_ball")
            if self.command == "stop" and math.hypot(*robot.velocity_mps) > _STOP_MPS:
                self._note(t_s, robot.side, robot.number, "fast_in_stop")

    def _is_in_the_way(self, key: tuple[int, int], t_s: float) -> bool:
        """Whether a robot has stayed near a ball that is being placed for longer than the grace period."""
        return t_s - self._near_since_s.setdefault(key, t_s) > _STOP_GRACE_S

    def _foul(self, t_s: float, side: int, number: int, kind: FoulKind, ball: BallState) -> None:
        self._stop(t_s, self._rules.after_foul(side, kind, ball))
        self._note(t_s, side, number, kind)
        self._touching = self._last = self._kicker = None

    def _note(self, t_s: float, side: int, number: int, kind: FoulKind) -> None:
        """Count a foul, each kind once per robot and stop."""
        if (side, number, kind) in self._noted:
            return
        self._noted.add((side, number, kind))
        self.fouls.append(Foul(t_s, side, number, kind))
        if self.foul_count(side) % _FOULS_A_CARD == 0:
            self.cards[side].append(t_s + _CARD_S)

    def card_count(self, side: int) -> int:
        """Return how many yellow cards a side has got."""
        return self.foul_count(side) // _FOULS_A_CARD

    def foul_count(self, side: int) -> int:
        """Return how many fouls a side has committed."""
        return sum(foul.side == side for foul in self.fouls)
