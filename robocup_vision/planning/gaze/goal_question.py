"""Chooses where to look to decide between several poses (Miura and Shirai 2004, section 4.2, eqs. 3 and 4).

On a symmetric pitch, a pose and its half turn differ only in the goals' colours. The planner takes the pan after which
the expected entropy is smallest, until the entropy is small or no look from here would reduce it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.belief import Hypothesis
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, turned_covariance, wrap_angle
from robocup_vision.perception.goal_region import is_chromatic
from robocup_vision.planning.gaze.goal_evidence import (
    CORNERS,
    NEGATIVE,
    NOTHING,
    POSITIVE,
    GoalEvidence,
    load_goal_evidence,
)
from robocup_vision.planning.gaze.pose_gaze import PANS, Neck
from robocup_vision.planning.gaze.uncertainty import clear_probability, sigma_points

Answer = Literal["look", "decided", "undecidable"]
# entropy below which the question is decided: at 0.1 nat the less probable of two poses has a probability of 2 %
DECIDED_NAT = 0.1
_MIN_GAIN_NAT = 0.02  # a look with a smaller expected gain is not worth its time
_AS_GOOD_NAT = 0.01  # pans whose expected entropy differs by less count as equal. Then the head moves least.
# a corner within this fraction of the picture's width from its border is cut off in half of the cases
_BORDER_RATIO = 0.01


@dataclass(frozen=True, slots=True)
class Fixation:
    """The answer to a question, or the next look."""

    answer: Answer  #: "decided": the most probable hypothesis is certain enough; "undecidable": no look would decide
    #: pan of the look, from straight ahead, positive to the left; None unless the answer is "look"
    pan_rad: float | None
    entropy_nat: float  #: entropy of the hypotheses now
    expected_nat: float  #: expected entropy after that look; that of now unless the answer is "look"
    reason: str  #: the reason, as text


def entropy_nat(probabilities: FloatArray) -> float:
    """Return the entropy of a distribution, eq. 4."""
    positive = probabilities[probabilities > 0]
    return float(-(positive * np.log(positive)).sum()) + 0.0


def identified_goal(field: Field, measured: PoseEstimate | NotLocated) -> int:
    """Return which goal a frame has identified without a prior: +1, -1, or 0 for none.

    Parameters
    ----------
    measured : PoseEstimate or NotLocated
        The answer of `GoalPoseEstimator.locate(frame)`: the camera's foot and optical axis. It must have been found
        without a prior, from which it might have taken the field half.
    """
    if not isinstance(measured, PoseEstimate) or len(measured.candidates) > 1 or not field.goals:
        return 0
    to_goal = [measured.pose.inverse().transform((goal.line_x_m, 0.0)) for goal in field.goals]
    off = [abs(math.atan2(y, x)) for x, y in to_goal]
    return field.goals[int(np.argmin(off))].side


class GoalQuestion:
    """Decides between several poses by looks at goals; one object per question and place.

    Parameters
    ----------
    field : Field
        The pitch. Where its goals do not differ in hue, every question is undecidable.
    camera : PinholeCamera
        The camera on the head; its pan is ignored, an unknown tilt or roll counts as 0.
    neck : Neck, optional
        Limits of the head's pan; with a limit of pi, the robot turns on the spot.
    evidence : GoalEvidence, optional
        Probabilities that goals are found; by default as learnt for the goal localiser.
    """

    def __init__(
        self,
        field: Field,
        camera: PinholeCamera,
        neck: Neck | None = None,
        evidence: GoalEvidence | None = None,
    ) -> None:
        self._field = field
        self._camera = camera.with_orientation(0.0, camera.tilt_rad or 0.0, camera.roll_rad or 0.0)
        self._evidence = load_goal_evidence() if evidence is None else evidence
        limit = (Neck() if neck is None else neck).limit_rad
        self._pans = np.linspace(-limit, limit, PANS)
        self._half_view_rad = math.atan(camera.size_px[0] / 2 / camera.focal_px[0])
        self._corners = np.array(
            [
                [[goal.line_x_m, y, up] for y in (goal.width_m / 2, -goal.width_m / 2) for up in (0.0, goal.height_m)]
                for goal in field.goals
            ]
        ).reshape(-1, CORNERS, 3)
        # pans of looks that found nothing
        self._missed: list[float] = []

    def forget(self) -> None:
        """Forget the missed goals: for the next question, or another place."""
        self._missed.clear()

    @property
    def can_decide(self) -> bool:
        """Whether the field's goals differ in hue, by which the detector identifies them."""
        colors = {goal.color for goal in self._field.goals}
        return len(colors) > 1 and any(map(is_chromatic, colors))

    def choose(self, hypotheses: Sequence[Hypothesis], pan_rad: float = 0.0, blockers: Sequence[Disc] = ()) -> Fixation:
        """Choose where to look, or answer the question.

        Parameters
        ----------
        hypotheses : sequence of Hypothesis
            Poses the robot may have.
        blockers : sequence of Disc
            Robots that may hide a goal, in the field frame under the first hypothesis. Under the other hypotheses they
            have the same positions relative to the robot.

        Raises
        ------
        ArgumentError
            If there is no hypothesis, a probability is negative, or all are 0.
        """
        probability = _probabilities(hypotheses)
        now = entropy_nat(probability)
        if now <= DECIDED_NAT:
            return Fixation("decided", None, now, now, f"decided: {probability.max():.1%} sure, {now:.2f} nat")
        if not self.can_decide:
            return Fixation("undecidable", None, now, now, "undecidable: the goals of this field look alike")
        joint = probability[:, None] * self._chances(hypotheses, self._pans, blockers)
        outcome = joint.sum(axis=1, keepdims=True)
        after = np.divide(joint, outcome, out=np.ones_like(joint), where=joint > 0)
        expected = -(joint * np.log(after)).sum(axis=(1, 2))
        least = float(expected.min())
        if now - least < _MIN_GAIN_NAT:
            reason = f"undecidable from here: the best look would leave {least:.2f} of {now:.2f} nat"
            return Fixation("undecidable", None, now, now, reason)
        as_good = np.flatnonzero(expected <= least + _AS_GOOD_NAT)
        # at the middle of a run of equal pans, an error of the pose matters least
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
            The same as for `choose`.
        pan_rad : float
            Pan at which the frame was taken.
        goal : int
            The goal that the frame has identified, see `identified_goal`: +1, -1, or 0.
        """
        outcome = {1: POSITIVE, -1: NEGATIVE, 0: NOTHING}.get(goal)
        if outcome is None:
            raise ArgumentError(f"goal must be +1, -1 or 0, got {goal!r}")
        probability = _probabilities(hypotheses)
        if not self.can_decide:
            return probability
        after = probability * self._chances(hypotheses, np.array([pan_rad]), blockers)[0, :, outcome]
        if outcome == NOTHING:
            self._missed.append(pan_rad)
        # an outcome that is impossible under all hypotheses changes nothing
        return np.asarray(after / after.sum()) if after.sum() > 0 else probability

    def _chances(self, hypotheses: Sequence[Hypothesis], pans: FloatArray, blockers: Sequence[Disc]) -> FloatArray:
        """Return P(e | I, w) as (P, N, 3), e in the order of POSITIVE, NEGATIVE, NOTHING."""
        chances = np.empty((len(pans), len(hypotheses), 3))
        for n, hypothesis in enumerate(hypotheses):
            turn = hypothesis.pose.compose(hypotheses[0].pose.inverse())
            beside = blockers if n == 0 else [_turned(blocker, turn) for blocker in blockers]
            chances[:, n] = self._chances_of(hypothesis, pans, beside)
        return chances

    def _chances_of(self, hypothesis: Hypothesis, pans: FloatArray, blockers: Sequence[Disc]) -> FloatArray:
        points = sigma_points(hypothesis.pose, hypothesis.covariance)
        outcome = np.zeros((len(pans), 3))
        eye = (*hypothesis.pose.transform(self._camera.offset_m).tolist(), self._camera.height_m)
        clear = clear_probability(eye, self._corners.reshape(-1, 3), blockers).reshape(-1, CORNERS)
        # a goal that was missed is likely to be missed again: each miss in view lowers its probability
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
            # two goals are never in one picture: only the one with more corners in view counts
            goal = corners.sum(axis=-1).argmax(axis=-1)
            seen, width = corners[each, goal], widths[goal]
            count = seen.sum(axis=-1)
            # a robot that hides one end of a post hides its other end too
            open_probability = np.where(seen, clear[goal], 1.0).min(axis=-1)[:, None]
            found = open_probability * self._evidence.chances(count, width)
            found += (1 - open_probability) * self._evidence.chances(np.maximum(count - 2, 0), width)
            right, wrong = found[:, 0] * again, found[:, 1]
            outcome[:, POSITIVE] += np.where(sides[goal] > 0, right, wrong)
            outcome[:, NEGATIVE] += np.where(sides[goal] > 0, wrong, right)
        outcome /= len(points)
        outcome[:, NOTHING] = 1 - outcome.sum(axis=1)
        return outcome

    def _in_view(self, pose: Pose2, pans: FloatArray) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        """Return whether each pan shows each goal's corners, (P, G, CORNERS), and the goals' widths (G,), pixels."""
        eye = pose.compose(Pose2(*self._camera.offset_m, 0.0))
        flat = eye.inverse().transform(self._corners[..., :2])
        up = self._corners[..., 2] - self._camera.height_m
        c, s = np.cos(pans)[:, None, None], np.sin(pans)[:, None, None]
        x, y = flat[..., 0], flat[..., 1]
        way = np.stack([c * x + s * y, c * y - s * x, np.broadcast_to(up, (len(pans), *up.shape))], axis=-1)
        pixels = self._camera.ray_to_pixel(way)
        width, height = self._camera.size_px
        border = _BORDER_RATIO * width
        with np.errstate(invalid="ignore"):
            inside = (pixels >= border) & (pixels <= np.array([width, height]) - 1 - border)
        bearing = np.arctan2(y, x)
        span = np.array([abs(wrap_angle(float(b[0] - b[2]))) for b in bearing])
        return np.asarray(inside.all(axis=-1)), span * self._camera.focal_px[0]


def _probabilities(hypotheses: Sequence[Hypothesis]) -> FloatArray:
    weight = np.array([hypothesis.probability for hypothesis in hypotheses], dtype=np.float64)
    if not len(weight):
        raise ArgumentError("there must be at least one hypothesis")
    if not (weight >= 0).all() or not 0 < weight.sum() < math.inf:
        raise ArgumentError(f"probabilities must not be negative and not all 0, got {weight.tolist()}")
    return np.asarray(weight / weight.sum())


def _turned(blocker: Disc, turn: Pose2) -> Disc:
    x, y = turn.transform((blocker.x_m, blocker.y_m)).tolist()
    covariance = turned_covariance(blocker.covariance, turn.theta_rad)
    return Disc(x, y, blocker.radius_m, covariance, height_m=blocker.height_m)
