"""Whether red and blue are swapped in a camera's frames: what balls and goals say, weighed over the frames.

Red and blue swapped turn an orange ball blue, yellow into cyan, blue into orange; a green carpet and white lines stay
as they are. Goals that are each other's swapped colour cannot tell: there a ball must, before goals turn the pose.
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

# places along a coloured thing at which the way to it is looked at
_PLACES = np.linspace(0.0, 1.0, 9)


@dataclass(frozen=True, slots=True)
class ChannelOrderSettings:
    """How what frames show of the order of their channels is weighed; nats speak for swapped red and blue."""

    #: log-likelihood ratio that other objects of a ball's colour reach: a find with less is no evidence
    clutter_nats: float = 8.5
    #: evidence of one ball in one place, and of the goals in one frame, either way: it may be a thing that only looks
    #: so, and is no more proof however clear and however often it is seen
    max_nats: float = 3.0
    report_nats: float = math.log(1000.0)  #: sum from which swapped channels are reported: 1000 to 1
    #: evidence of the goals of one frame, or of all frames, from which goals do not decide on the half: 3 to 1
    doubt_nats: float = math.log(3.0)
    #: the sum reaches no farther either way, so that no run is decided for ever by its first frames
    max_sum: float = 12.0
    #: all of the first frames are judged, then one in this many, or all while swapped channels are likelier
    first_looks: int = 8
    look_every: int = 16
    #: a ball nearer to where one was seen is the same one: errors of its place, and for each metre of its range
    same_place_m: float = 0.4
    same_place_ratio: float = 0.2
    max_places: int = 32  #: number of places that are remembered, the latest ones
    same_paint: float = 0.9  #: paints whose log R/G and B/G differ by less are taken for each other in bad light
    #: smallest distance of the ray to a ball from a field element of similar colour
    margin_m: float = 0.1


class ChannelOrder:
    """What the frames of one camera have shown of the order of their channels so far.

    Parameters
    ----------
    field : Field
        Names the colours of ball, goals and beacons.
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
        """How much more likely red and blue are swapped than not, by all frames."""
        return self._nats

    @property
    def reason(self) -> str:
        """Why red and blue are taken to be swapped, or in the last frame seem to be; empty where they are not."""
        if self._nats >= self.settings.report_nats:
            return self._reason
        return SWAPPED_BY_GOALS if self._is_doubtful else ""

    @property
    def is_suspected(self) -> bool:
        """Whether swapped red and blue are likelier than not, by so much that no half is taken for sure."""
        return self._nats >= self.settings.doubt_nats

    def judge(
        self,
        find_own: Callable[[], Sequence[Ball]],
        find_swapped: Callable[[], Sequence[Ball]],
        pose: PoseEstimate | NotLocated,
        by_goals: Callable[[], float],
    ) -> None:
        """Weigh a frame, if it is one that is looked at.

        Parameters
        ----------
        find_own : callable
            Returns the balls that the frame shows by their colour.
        find_swapped : callable
            Returns those that it shows if red and blue are swapped; costs as much as a search for balls.
        pose : PoseEstimate or NotLocated
            Of the robot, right or half a turn off.
        by_goals : callable
            Returns what the goals tell, nats.
        """
        self._frames += 1
        settings = self.settings
        is_looked_at = (
            self._frames <= settings.first_looks or self._frames % settings.look_every == 0 or self._nats > 0.0
        )
        self._is_doubtful = False
        # where the order is settled, the goals of every frame need not confirm it
        if not is_looked_at and self._nats <= -settings.report_nats:
            return
        goals = _clip(by_goals(), settings.max_nats)
        self._is_doubtful = goals >= settings.doubt_nats
        if not is_looked_at:
            return
        own = swapped = 0.0
        if pose:
            own = self._ball_nats(find_own(), pose.pose, is_swapped=False)
            # where the ball is clearly seen, another find is no evidence
            if own < settings.max_nats:
                swapped = self._ball_nats(find_swapped(), pose.pose, is_swapped=True)
        nats = goals + swapped - own
        if nats > 0.0:
            self._reason = SWAPPED_BY_GOALS if goals > swapped else SWAPPED_BY_BALL
        self._nats = _clip(self._nats + nats, settings.max_sum)

    def _ball_nats(self, balls: Sequence[Ball], robot: Pose2, *, is_swapped: bool) -> float:
        """Return how clearly one of them is a ball in a place where none was seen yet, nats; 0 where none is.

        What lies beside the field, or is explained by an element of the field, is not a ball.
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
        """Remember where a ball is; return whether none was seen there, or half a turn from there, before."""
        same_m = self.settings.same_place_m + self.settings.same_place_ratio * range_m
        if any(min(math.dist(place, one), math.dist(place, (-one[0], -one[1]))) < same_m for one in seen):
            return False
        seen.append(place)
        return True

    def _is_thing(self, place: tuple[float, float], robot: Pose2, things: FloatArray) -> bool:
        """Whether a thing of the field stands on the way to a ball, or next to it."""
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


def _clip(nats: float, most: float) -> float:
    return min(max(nats, -most), most)


def _log_ratios(name: str) -> FloatArray:
    blue, green, red = COLOR_NAMES[name]
    return np.log([red / green, blue / green])


def _things_like(field: Field, paint: FloatArray, same: float) -> FloatArray:
    """Return the goals and beacons that have about a paint: (N, 5) float64, both ends of the foot, radius, metres."""
    things = []
    for goal in field.goals:
        if np.linalg.norm(_log_ratios(goal.color) - paint) < same:
            things += [[*panel, goal.post_radius_m] for panel in goal.panels.tolist()]
            half = goal.width_m / 2
            things.append([goal.line_x_m, -half, goal.line_x_m, half, goal.post_radius_m])
    for beacon in field.beacons:
        if any(np.linalg.norm(_log_ratios(color) - paint) < same for color in beacon.colors):
            things.append([beacon.x_m, beacon.y_m, beacon.x_m, beacon.y_m, beacon.radius_m])
    # half a turn off they stand where their like does
    turned = [[-x0, -y0, -x1, -y1, radius] for x0, y0, x1, y1, radius in things]
    return np.array(things + turned, dtype=np.float64).reshape(-1, 5)
