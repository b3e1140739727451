"""Where to look to tell which of several poses is the true one (Miura and Shirai 2004, section 4.2, eqs. 3 and 4).

On a symmetric pitch a pose and its half turn look alike but for the goals' colours. Of all pans the one is taken after
which the least entropy is to be expected, until little is left, or until no look from here would tell more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.perception.goal_color import is_chromatic
from robocup_vision.planning.gaze.goal_evidence import (
    CORNERS,
    NEGATIVE,
    NOTHING,
    POSITIVE,
    GoalEvidence,
    load_goal_evidence,
)
from robocup_vision.planning.gaze.pose_gaze import Neck
from robocup_vision.planning.gaze.sight_lines import clear_probability
from robocup_vision.planning.gaze.sigma_points import sigma_points

Answer = Literal["look", "decided", "undecidable"]

ENOUGH_NAT = 0.1
# a look that is expected to tell less is not worth it
_MIN_GAIN_NAT = 0.02
# pans whose expected entropy differs by less are equally good: then the head moves least
_AS_GOOD_NAT = 0.01
# a corner nearer to the picture's border is cut as often as not
_BORDER_SHARE = 0.01


class Hypothesis(Protocol):
    """A pose the robot may have; `PoseFilter.hypotheses` gives such."""

    @property
    def pose(self) -> Pose2:
        """Of the robot."""
        ...

    @property
    def covariance(self) -> FloatArray:
        """(3, 3) float64 of (x_m, y_m, theta_rad)."""
        ...

    @property
    def probability(self) -> float:
        """Of this one."""
        ...


@dataclass(frozen=True, slots=True)
class Fixation:
    """What to do about a question.

    Parameters
    ----------
    answer : {"look", "decided", "undecidable"}
        Look there; the likeliest hypothesis is sure enough; or no look would tell.
    pan_rad : float or None
        Where to look, from straight ahead, positive to the left; None unless the answer is "look".
    entropy_nat : float
        Of the hypotheses now.
    expected_nat : float
        After that look, on average; as now unless the answer is "look".
    reason : str
        Why, in words.
    """

    answer: Answer
    pan_rad: float | None
    entropy_nat: float
    expected_nat: float
    reason: str


def entropy_nat(probabilities: FloatArray) -> float:
    """Entropy of a distribution, eq. 4."""
    positive = probabilities[probabilities > 0]
    return float(-(positive * np.log(positive)).sum()) + 0.0


def identified_goal(field: Field, seen: PoseEstimate | NotLocated) -> int:
    """Which goal a frame without a prior has told of: +1, -1, or 0 for none.

    Parameters
    ----------
    field : Field
        The pitch.
    seen : PoseEstimate or NotLocated
        Result of `GoalPoseEstimator.locate(frame)` without a prior: the camera's foot and optical axis. With a prior
        the result may repeat the prior.
    """
    if not isinstance(seen, PoseEstimate) or len(seen.candidates) > 1 or not field.goals:
        return 0
    to_goal = [seen.pose.inverse().transform((goal.line_x_m, 0.0)) for goal in field.goals]
    off = [abs(math.atan2(y, x)) for x, y in to_goal]
    return field.goals[int(np.argmin(off))].side


class GoalQuestion:
    """Asks which of several poses is the true one by looking at goals; one object a question and place.

    Parameters
    ----------
    field : Field
        The pitch. Where its goals do not differ in hue, every question is undecidable.
    camera : PinholeCamera
        On the head; its pan counts for nothing, an unknown tilt or roll as 0.
    neck : Neck, optional
        How far the head pans, or, with a limit of pi, the robot on the spot.
    evidence : GoalEvidence, optional
        How often goals are found; without it as learnt for the goal localiser.
    pans : int
        How many are compared.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        neck: Neck | None = None,
        evidence: GoalEvidence | None = None,
        *,
        pans: int = 37,
    ) -> None:
        if pans < 3:
            raise ArgumentError(f"pans must be at least 3, got {pans}")
        self._field = field
        self._camera = camera.with_orientation(0.0, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        self._evidence = load_goal_evidence() if evidence is None else evidence
        limit = (Neck() if neck is None else neck).limit_rad
        self._pans = np.linspace(-limit, limit, pans)
        self._half_view_rad = math.atan(camera.size_px[0] / 2 / camera.focal_px[0])
        self._corners = np.array(
            [
                [[goal.line_x_m, y, up] for y in (goal.width_m / 2, -goal.width_m / 2) for up in (0.0, goal.height_m)]
                for goal in field.goals
            ]
        ).reshape(-1, CORNERS, 3)
        # pans of looks that found nothing
        self._missed: list[float] = []

    @property
    def can_tell(self) -> bool:
        """Whether the field's goals differ in what the detector tells them by."""
        colors = {goal.color for goal in self._field.goals}
        return len(colors) > 1 and any(map(is_chromatic, colors))

    def choose(self, hypotheses: Sequence[Hypothesis], pan_rad: float = 0.0, blockers: Sequence[Disc] = ()) -> Fixation:
        """Choose where to look, or say that nothing is left to ask.

        Parameters
        ----------
        hypotheses : sequence of Hypothesis
            Poses the robot may have.
        pan_rad : float
            Where the head is.
        blockers : sequence of Disc
            Robots that may hide a goal, field frame of the first hypothesis: what stands beside the robot turns with
            the pose that is taken for the true one.

        Raises
        ------
        ArgumentError
            There is no hypothesis, or probabilities are negative or do not add up to a positive number.
        """
        share = _shares(hypotheses)
        now = entropy_nat(share)
        if now <= ENOUGH_NAT:
            return Fixation("decided", None, now, now, f"decided: {share.max():.1%} sure, {now:.2f} nat")
        if not self.can_tell:
            return Fixation("undecidable", None, now, now, "undecidable: nothing that is seen tells the halves apart")
        joint = share[:, None] * self._chances(hypotheses, self._pans, blockers)
        told = joint.sum(axis=1, keepdims=True)
        after = np.divide(joint, told, out=np.ones_like(joint), where=joint > 0)
        expected = -(joint * np.log(after)).sum(axis=(1, 2))
        least = float(expected.min())
        if now - least < _MIN_GAIN_NAT:
            reason = f"undecidable from here: the best look would leave {least:.2f} of {now:.2f} nat"
            return Fixation("undecidable", None, now, now, reason)
        as_good = np.flatnonzero(expected <= least + _AS_GOOD_NAT)
        # from the middle of what is equally good, a pose that is a little off still shows the goal
        runs = np.split(as_good, np.flatnonzero(np.diff(as_good) > 1) + 1)
        middles = [int(run[len(run) // 2]) for run in runs]
        best = min(middles, key=lambda k: abs(self._pans[k] - pan_rad))
        reason = f"look {math.degrees(self._pans[best]):+.0f} deg: {expected[best]:.2f} of {now:.2f} nat to be left"
        return Fixation("look", float(self._pans[best]), now, float(expected[best]), reason)

    def observe(
        self, hypotheses: Sequence[Hypothesis], pan_rad: float, goal: int, blockers: Sequence[Disc] = ()
    ) -> FloatArray:
        """Return the probabilities (N,) after a look, eq. 3.

        Parameters
        ----------
        hypotheses : sequence of Hypothesis
            As `choose` took them.
        pan_rad : float
            Where the frame was taken.
        goal : int
            The goal it told of, see `identified_goal`: +1, -1, or 0.
        blockers : sequence of Disc
            As `choose` took them.
        """
        outcome = {1: POSITIVE, -1: NEGATIVE, 0: NOTHING}.get(goal)
        if outcome is None:
            raise ArgumentError(f"goal must be +1, -1 or 0, got {goal!r}")
        share = _shares(hypotheses)
        if not self.can_tell:
            return share
        after = share * self._chances(hypotheses, np.array([pan_rad]), blockers)[0, :, outcome]
        if outcome == NOTHING:
            self._missed.append(pan_rad)
        # what none of them allows speaks for none
        return np.asarray(after / after.sum()) if after.sum() > 0 else share

    def _chances(self, hypotheses: Sequence[Hypothesis], pans: FloatArray, blockers: Sequence[Disc]) -> FloatArray:
        """P(e | I, w) as (P, N, 3), e in the order of POSITIVE, NEGATIVE, NOTHING."""
        chances = np.empty((len(pans), len(hypotheses), 3))
        for n, hypothesis in enumerate(hypotheses):
            turn = hypothesis.pose.compose(hypotheses[0].pose.inverse())
            beside = blockers if n == 0 else [_turned(blocker, turn) for blocker in blockers]
            chances[:, n] = self._chances_of(hypothesis, pans, beside)
        return chances

    def _chances_of(self, hypothesis: Hypothesis, pans: FloatArray, blockers: Sequence[Disc]) -> FloatArray:
        points = sigma_points(hypothesis.pose, hypothesis.covariance)
        told = np.zeros((len(pans), 3))
        eye = (*hypothesis.pose.transform(self._camera.offset_m).tolist(), self._camera.height_m)
        clear = clear_probability(eye, self._corners.reshape(-1, 3), blockers).reshape(-1, CORNERS)
        # a goal that was missed is likely to be missed again
        again = np.array(
            [
                self._evidence.again ** sum(abs(wrap_angle(pan - m)) < self._half_view_rad for m in self._missed)
                for pan in pans.tolist()
            ]
        )
        sides = np.array([goal.side for goal in self._field.goals])
        each = np.arange(len(pans))
        for x, y, theta in points:
            corners, widths = self._in_view(Pose2(x, y, theta), pans)
            # two goals are never in one picture: the one with more corners counts
            goal = corners.sum(axis=-1).argmax(axis=-1)
            seen, width = corners[each, goal], widths[goal]
            count = seen.sum(axis=-1)
            # whoever hides one end of a post stands before its other end too
            open_share = np.where(seen, clear[goal], 1.0).min(axis=-1)[:, None]
            found = open_share * self._evidence.chances(count, width)
            found += (1 - open_share) * self._evidence.chances(np.maximum(count - 2, 0), width)
            right, wrong = found[:, 0] * again, found[:, 1]
            told[:, POSITIVE] += np.where(sides[goal] > 0, right, wrong)
            told[:, NEGATIVE] += np.where(sides[goal] > 0, wrong, right)
        told /= len(points)
        told[:, NOTHING] = 1 - told.sum(axis=1)
        return told

    def _in_view(self, pose: Pose2, pans: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        """Which corners (P, G, CORNERS) of each goal a pan shows, and how wide each goal looks (G,), pixels."""
        eye = pose.compose(Pose2(*self._camera.offset_m, 0.0))
        flat = eye.inverse().transform(self._corners[..., :2])
        up = self._corners[..., 2] - self._camera.height_m
        c, s = np.cos(pans)[:, None, None], np.sin(pans)[:, None, None]
        x, y = flat[..., 0], flat[..., 1]
        way = np.stack([c * x + s * y, c * y - s * x, np.broadcast_to(up, (len(pans), *up.shape))], axis=-1)
        pixels = self._camera.ray_to_pixel(way)
        width, height = self._camera.size_px
        border = _BORDER_SHARE * width
        with np.errstate(invalid="ignore"):
            inside = (pixels >= border) & (pixels <= np.array([width, height]) - 1 - border)
        bearing = np.arctan2(y, x)
        span = np.array([abs(wrap_angle(float(b[0] - b[2]))) for b in bearing])
        return np.asarray(inside.all(axis=-1)), span * self._camera.focal_px[0]


def _shares(hypotheses: Sequence[Hypothesis]) -> FloatArray:
    share = np.array([hypothesis.probability for hypothesis in hypotheses], dtype=np.float64)
    if not len(share):
        raise ArgumentError("there must be at least one hypothesis")
    if not (share >= 0).all() or not 0 < share.sum() < math.inf:
        raise ArgumentError(f"probabilities must not be negative and not all 0, got {share.tolist()}")
    return np.asarray(share / share.sum())


def _turned(blocker: Disc, turn: Pose2) -> Disc:
    x, y = turn.transform((blocker.x_m, blocker.y_m)).tolist()
    c, s = math.cos(turn.theta_rad), math.sin(turn.theta_rad)
    rotation = np.array([[c, -s], [s, c]])
    return Disc(x, y, blocker.radius_m, rotation @ blocker.covariance @ rotation.T, height_m=blocker.height_m)
