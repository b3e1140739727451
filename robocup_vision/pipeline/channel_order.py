"""Detects whether red and blue are swapped in a camera's frames, by balls and goals, with evidence summed over frames.

Swapped channels turn orange into blue, yellow into cyan, and blue into orange; a green carpet and white lines stay. Two
goals whose colours swap into each other give no evidence: only a ball can show it, before goals turn the pose.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from field_models.field import COLOR_NAMES, Field
from robocup_vision.arrays import FloatArray
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.swapped_channels import SWAPPED_BY_GOALS
from robocup_vision.perception.balls.ball import Ball

SWAPPED_BY_BALL = (
    "the ball looks as with red and blue swapped: Vision takes RGB frames with channels='rgb', BGR ones with 'bgr'"
)

# points along a coloured object at which its distance from the ray to a ball is computed
_PLACES = np.linspace(0.0, 1.0, 9)


@dataclass(frozen=True, slots=True)
class ChannelOrderSettings:
    """Weights and thresholds of the evidence, in nats; positive values are evidence of swapped red and blue."""

    #: log-likelihood ratio that other objects of a ball's colour reach: a ball below it is not evidence
    clutter_nats: float = 8.5
    #: bound of the evidence, of either sign, of one ball in one place, and of the goals in one frame. The object may
    #: only look like a ball or goal, however clearly and often it is seen.
    max_nats: float = 3.0
    report_nats: float = math.log(1000.0)  #: sum from which swapped channels are reported: 1000 to 1
    #: evidence of the goals of one frame, or of all frames, from which goals do not decide the half: 3 to 1
    doubt_nats: float = math.log(3.0)
    #: bound of the sum, of either sign, so that the first frames of a run can be outweighed later
    max_sum: float = 12.0
    #: number of first frames that are all judged; then one in `look_every`, or all while swapped channels are likelier
    first_looks: int = 8
    look_every: int = 16
    #: a ball within this distance of an earlier one, plus this fraction of its range, is the same one
    same_place_m: float = 0.4
    same_place_ratio: float = 0.2
    max_places: int = 32  #: number of latest places that are remembered
    same_paint: float = 0.9  #: paints whose log R/G and B/G differ by less may be confused in bad light
    #: smallest distance of the ray to a ball from a field element of similar colour
    margin_m: float = 0.1


class ChannelOrder:
    """The evidence on the channel order of one camera's frames so far.

    Parameters
    ----------
    field : Field
        Gives the colours of ball, goals and beacons.
    """

    def __init__(self, field: Field, settings: ChannelOrderSettings = ChannelOrderSettings()) -> None:
        self.settings = settings
        self._field = field
        self._ball_m = field.ball_radius_m
        ball = _log_ratios(field.ball_color)
        self._own_things = _things_like(field, ball, settings.same_paint)
        self._swapped_things = _things_like(field, ball[::-1], settings.same_paint)
        self.forget()

    def forget(self) -> None:
        """Forget all frames."""
        self._frames = 0
        self._nats = 0.0
        self._reason = ""
        self._is_doubtful = False
        self._places: dict[bool, deque[tuple[float, float]]] = {
            is_swapped: deque(maxlen=self.settings.max_places) for is_swapped in (False, True)
        }

    @property
    def nats(self) -> float:
        """Log-likelihood ratio of swapped red and blue by all frames, nats."""
        return self._nats

    @property
    def reason(self) -> str:
        """Why red and blue are swapped, or seem to be in the last frame; empty if they are not."""
        if self._nats >= self.settings.report_nats:
            return self._reason
        return SWAPPED_BY_GOALS if self._is_doubtful else ""

    @property
    def is_suspected(self) -> bool:
        """Whether swapped red and blue are so probable that colours must not decide the half."""
        return self._nats >= self.settings.doubt_nats

    def judge(
        self,
        find_own: Callable[[], Sequence[Ball]],
        find_swapped: Callable[[], Sequence[Ball]],
        pose: PoseEstimate | NotLocated,
        by_goals: Callable[[], float],
    ) -> None:
        """Add the evidence of a frame, if the frame is due (`look_every`).

        Parameters
        ----------
        find_own : callable
            Returns the balls in the frame by their colour, robot frame.
        find_swapped : callable
            Returns the balls by their colour with red and blue swapped; takes as long as a search for balls.
        pose : PoseEstimate or NotLocated
            The robot's pose, which may be wrong by a half turn.
        by_goals : callable
            Returns the evidence of the goals, nats.
        """
        self._frames += 1
        settings = self.settings
        is_looked_at = (
            self._frames <= settings.first_looks or self._frames % settings.look_every == 0 or self._nats > 0.0
        )
        self._is_doubtful = False
        # once the order is certain, the goals need not confirm it in every frame
        if not is_looked_at and self._nats <= -settings.report_nats:
            return
        goals = _clip(by_goals(), settings.max_nats)
        self._is_doubtful = goals >= settings.doubt_nats
        if not is_looked_at:
            return
        own = swapped = 0.0
        if pose:
            own = self._ball_nats(find_own(), pose.pose, is_swapped=False)
            # if a ball is clearly seen in its own colour, a ball in the swapped colour is not evidence
            if own < settings.max_nats:
                swapped = self._ball_nats(find_swapped(), pose.pose, is_swapped=True)
        nats = goals + swapped - own
        if nats > 0.0:
            self._reason = SWAPPED_BY_GOALS if goals > swapped else SWAPPED_BY_BALL
        self._nats = _clip(self._nats + nats, settings.max_sum)

    def _ball_nats(self, balls: Sequence[Ball], robot: Pose2, *, is_swapped: bool) -> float:
        """Return the greatest evidence, nats, that one of them is a ball at a new place; 0 if there is none.

        A ball beside the field, or near a field element of similar colour, is not counted.
        """
        settings = self.settings
        things = self._swapped_things if is_swapped else self._own_things
        nats = 0.0
        for ball in balls:
            more = min(ball.log_likelihood_ratio - settings.clutter_nats, settings.max_nats)
            x, y = robot.transform(np.array([[ball.x_m, ball.y_m]]))[0].tolist()
            if more <= nats or not self._field.is_on_floor(x, y) or self._is_thing((x, y), robot, things):
                continue
            if self._is_new((x, y), math.hypot(ball.x_m, ball.y_m), self._places[is_swapped]):
                nats = more
        return nats

    def _is_new(self, place: tuple[float, float], range_m: float, seen: deque[tuple[float, float]]) -> bool:
        """Remember a ball's place; return whether no ball was seen there, or a half turn from there, before."""
        same_m = self.settings.same_place_m + self.settings.same_place_ratio * range_m
        if any(min(math.dist(place, one), math.dist(place, (-one[0], -one[1]))) < same_m for one in seen):
            return False
        seen.append(place)
        return True

    def _is_thing(self, place: tuple[float, float], robot: Pose2, things: FloatArray) -> bool:
        """Return whether a field element is near the ray to a ball, or near the ball."""
        if not len(things):
            return False
        here = np.array([robot.x_m, robot.y_m])
        way = np.array(place) - here
        ends = things[:, :4].reshape(-1, 2, 2)
        places = ends[:, :1] + _PLACES[:, None] * (ends[:, 1:] - ends[:, :1]) - here
        along = np.clip(places @ way / max(float(way @ way), 1e-9), 0.0, 1.0)
        away = np.linalg.norm(places - along[..., None] * way, axis=-1)
        spacing = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1) * _PLACES[1] / 2
        reach = things[:, 4] + spacing + 2 * self._ball_m + self.settings.margin_m
        return bool((away <= reach[:, None]).any())


def _clip(nats: float, bound: float) -> float:
    return min(max(nats, -bound), bound)


def _log_ratios(name: str) -> FloatArray:
    blue, green, red = COLOR_NAMES[name]
    return np.log([red / green, blue / green])


def _things_like(field: Field, paint: FloatArray, same: float) -> FloatArray:
    """Return the goals and beacons of a colour similar to `paint`, with their half turns.

    (N, 5) float64: both ends of the foot, and the radius, field frame, metres.
    """
    things = []
    for goal in field.goals:
        if np.linalg.norm(_log_ratios(goal.color) - paint) < same:
            things += [[*panel, goal.post_radius_m] for panel in goal.panels.tolist()]
            half = goal.width_m / 2
            things.append([goal.line_x_m, -half, goal.line_x_m, half, goal.post_radius_m])
    for beacon in field.beacons:
        if any(np.linalg.norm(_log_ratios(color) - paint) < same for color in beacon.colors):
            things.append([beacon.x_m, beacon.y_m, beacon.x_m, beacon.y_m, beacon.radius_m])
    # the pose may be wrong by a half turn
    turned = [[-x0, -y0, -x1, -y1, radius] for x0, y0, x1, y1, radius in things]
    return np.array(things + turned, dtype=np.float64).reshape(-1, 5)
