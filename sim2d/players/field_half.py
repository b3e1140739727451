"""Asks which half of the field a player is in: where its head is to look for a goal that decides."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from field_models.field import Field
from robocup_vision.belief import Hypothesis
from robocup_vision.camera import PinholeCamera
from robocup_vision.disc import Disc
from robocup_vision.planning import Fixation, GoalQuestion, GoalQuestionSettings, Neck
from robocup_vision.planning.gaze.goal_question import identified_goal
from robocup_vision.view import View


@dataclass(frozen=True, slots=True)
class FieldHalfSettings:
    """Values of `FieldHalf`."""

    #: Of the question.
    question: GoalQuestionSettings = GoalQuestionSettings()
    #: A robot that has moved so far asks anew: goals that it missed may be found from there.
    elsewhere_m: float = 0.3


class FieldHalf:
    """Asks for the half of the field while the pose filter has two mirrored modes. The filter weighs the answers."""

    def __init__(self, field: Field, camera: PinholeCamera, neck: Neck, settings: FieldHalfSettings) -> None:
        self._field, self._settings = field, settings
        self._question = GoalQuestion(field, camera, neck, settings=settings.question)
        # position at the first look of the question; None: no question is open
        self._asked_m: tuple[float, float] | None = None

    def choose(self, hypotheses: Sequence[Hypothesis], pan_rad: float, blockers: Sequence[Disc]) -> Fixation | None:
        """Return where to look; None if the half is known, or no look from here decides.

        Parameters
        ----------
        hypotheses : sequence of Hypothesis
            Of the pose filter, most probable first.
        blockers : sequence of Disc
            Robots that may hide a goal, field frame of the first hypothesis.
        """
        halves = mirrored(hypotheses)
        if not halves:
            return None
        here = (halves[0].pose.x_m, halves[0].pose.y_m)
        if self._asked_m is not None:
            turned = (-here[0], -here[1])
            if min(math.dist(self._asked_m, here), math.dist(self._asked_m, turned)) > self._settings.elsewhere_m:
                self.forget()
        fixation = self._question.choose(halves, pan_rad, blockers)
        if fixation.answer == "decided":
            self.forget()
        if fixation.answer != "look":
            return None
        self._asked_m = self._asked_m or here
        return fixation

    def observe(self, hypotheses: Sequence[Hypothesis], pan_rad: float, view: View) -> None:
        """Take in the view of a frame that was taken at this pan while a question is open."""
        halves = mirrored(hypotheses)
        if self._asked_m is None or not halves:
            return
        measured = view.pose if view.measurement is None else view.measurement
        camera = measured.seen_from(view.camera.camera_in_robot) if measured else measured
        self._question.observe(halves, pan_rad, identified_goal(self._field, camera))

    def forget(self) -> None:
        """End the question: the next one begins without missed goals."""
        self._question.forget()
        self._asked_m = None


def mirrored(hypotheses: Sequence[Hypothesis]) -> tuple[Hypothesis, ...]:
    """Return the most probable hypothesis and its half turn; empty if it has none."""
    for other in hypotheses[1:]:
        if sum(other.pose.half_turn().error_to(hypotheses[0].pose)) < 1e-6:
            return hypotheses[0], other
    return ()
