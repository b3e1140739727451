"""Chooses the goal of a hue among those that may be in a picture: by its posts and bar, by the lines around it, by all.

Where lamps wash posts and bar, a streak's border passes for a silhouette, and windows hide edges. Fits to single edges
are then off, and rules about them misled. What the whole picture shows where a camera puts goal and lines tells the
right camera all the same: an edge of any kind along the silhouettes, some paint between them, and a line wherever one
is due.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from robocup_vision.estimates import NotLocated
from robocup_vision.localization.goal.arc import spread_about
from robocup_vision.localization.goal.camera_estimate import CameraEstimate, goal_alone, shown_ratios
from robocup_vision.localization.goal.colored_lines import ColoredGoalLines, ColoredLineSettings
from robocup_vision.localization.goal.fit import max_prior_deviation
from robocup_vision.localization.goal.goal_picture import GoalPicture
from robocup_vision.localization.goal.line_marks import LineFit
from robocup_vision.localization.goal.profile import polish
from robocup_vision.localization.goal.search import Candidate, GoalSearch
from robocup_vision.localization.lines.line_map import LineMap


@dataclass(frozen=True, slots=True)
class ColoredGoalSettings:
    """Settings of `ColoredGoals`.

    Parameters
    ----------
    max_rivals : int
        Goals that lines may choose among.
    min_overruling_ratio : float
        Of the places on lines that are due, those that must be seen before lines overrule an objection to a goal.
    telling_marks : int
        So many places on lines predicted in view, and lines that are not seen speak against a goal.
    telling_ratio : float
        Of the evidence that lines would give were all of them seen where they are due, what leaves no doubt.
    min_alone_score : float
        Score from which a goal counts without lines on a field that has them: motley clutter has up to 0.7, goals that
        no lamp dazzles 0.85 and more.
    clear_score : float
        Score from which one counts though lines that would be in view are not seen.
    max_doubted : int
        Further ones that the whole picture may choose among, the likeliest.
    min_washable : float
        Of each post and the bar, what may be paint of the goal's hue, washed or not: of what is none, less is.
    min_nats : float
        Log-likelihood ratio of the whole picture to clutter from which it tells a goal, whatever single edges say:
        boxes and half goals among lines reach 166, goals that lamps wash 199 and more.
    shared_nats : float
        Neighbouring samples of an edge or line share their errors: differences in evidence count in this unit.
    """

    max_rivals: int = 6
    min_overruling_ratio: float = 0.6
    telling_marks: int = 12
    telling_ratio: float = 0.5
    min_alone_score: float = 0.72
    clear_score: float = 0.85
    max_doubted: int = 6
    min_washable: float = 0.9
    min_nats: float = 180.0
    shared_nats: float = 15.0


class _Joined(NamedTuple):
    """A goal, how likely the lines around it are, and its fit with them."""

    goal: Candidate
    evidence: float
    lines: LineFit

    @property
    def camera(self) -> CameraEstimate:
        return CameraEstimate(self.lines.unknowns, self.lines.covariance, self.goal.sides, self.goal.fit, self.lines)


class ColoredGoals:
    """Places a camera by the goals of a hue that a search has found.

    Parameters
    ----------
    search : GoalSearch
        Field and camera.
    line_map : LineMap or None
        The field's lines, which are fitted too; None: goals alone.
    settings, line_settings : ColoredGoalSettings, ColoredLineSettings, optional
        When a goal counts, and how lines are fitted.
    """

    def __init__(
        self,
        search: GoalSearch,
        line_map: LineMap | None,
        settings: ColoredGoalSettings = ColoredGoalSettings(),
        line_settings: ColoredLineSettings = ColoredLineSettings(),
    ) -> None:
        self._search = search
        self._lines = None if line_map is None else ColoredGoalLines(line_map, search.camera, line_settings)
        self._settings = settings
        self._line_settings = line_settings

    def locate(self, picture: GoalPicture, candidates: list[Candidate]) -> CameraEstimate | NotLocated | None:
        """Make a goal exact by its profiles, and by the lines where they confirm it.

        None: there are only objections, and neither lines nor the whole picture against them.

        Parameters
        ----------
        picture : GoalPicture
            Of the search.
        candidates : list of Candidate
            Goals of a hue, the best first.
        """
        settings = self._settings
        alone: Candidate | None = None
        best: _Joined | None = None
        joined: list[_Joined] = []
        rejected: list[_Joined] = []
        for candidate in candidates[: settings.max_rivals]:
            fine = self._polished(picture, candidate)
            if fine.objection is None:
                alone = alone or fine
            found = self._joined(picture, fine)
            if found is None:
                continue
            joined.append(found)
            if best is not None and found.evidence <= best.evidence:
                continue
            if fine.objection is not None and not self._is_overruled(picture, found):
                rejected.append(found)
                continue
            best = found
            if self._is_plain(best) and (self._is_clear(fine) or self._is_confirmed(picture, best.camera)):
                return best.camera
        answer = self._by_edges(picture, alone, best, rejected)
        told = alone if best is None else best.goal
        is_clear = isinstance(answer, CameraEstimate) and told is not None and self._is_clear(told)
        if self._lines is None or is_clear:
            return answer
        return self._by_picture(picture, self._lines, candidates, joined, answer)

    def _by_edges(
        self,
        picture: GoalPicture,
        alone: Candidate | None,
        best: _Joined | None,
        rejected: list[_Joined],
    ) -> CameraEstimate | NotLocated | None:
        """Choose by single edges, and by the lines that confirm them."""
        settings, lines = self._settings, self._lines
        if best is not None and rejected:
            rival = max(rejected, key=lambda one: one.evidence)
            is_elsewhere = math.dist(rival.lines.unknowns[:2], best.lines.unknowns[:2]) > self._line_settings.same_m
            if is_elsewhere and rival.evidence > best.evidence + self._line_settings.clear_evidence:
                return NotLocated("no certain goal: lines fit far better about another, of which too little is seen")
        if best is not None:
            return best.camera
        if alone is None:
            return None
        if lines is not None and not self._is_clear(alone):
            if alone.fit.score < settings.min_alone_score:
                return NotLocated(
                    "no certain goal: posts and bar agree too badly to count without the lines around them"
                )
            due, seen = lines.seen(picture.frame, alone.model, alone.fit.unknowns)
            if due >= settings.telling_marks and seen < settings.min_overruling_ratio * due:
                return NotLocated("no certain goal: what looks like one would have lines in view that are not there")
        return self._alone(alone)

    def _by_picture(
        self,
        picture: GoalPicture,
        lines: ColoredGoalLines,
        candidates: list[Candidate],
        joined: list[_Joined],
        answer: CameraEstimate | NotLocated | None,
    ) -> CameraEstimate | NotLocated | None:
        """Let the whole picture choose among all goals that lines go with, where single edges leave a doubt."""
        settings = self._settings
        judged = self._judged(picture, lines, joined)
        first = max(judged, key=lambda one: one[0], default=None)
        if first is None or not self._is_plain(first[1]):
            judged += self._judged(picture, lines, self._joined_beyond(picture, candidates))
        cameras = [(nats, found.camera) for nats, found in judged]
        own = -math.inf
        if isinstance(answer, CameraEstimate):
            own = self._nats(picture, lines, answer)
            cameras.append((own, answer))
        if not cameras:
            return answer
        nats, best = max(cameras, key=lambda one: one[0])
        if isinstance(answer, CameraEstimate) and nats < own + 2 * settings.shared_nats:
            nats, best = own, answer
        if nats < settings.min_nats:
            told = "no certain goal: posts, bar and lines together tell too little of one"
            return NotLocated(told) if isinstance(answer, CameraEstimate) else answer
        return doubting(best, cameras, self._line_settings.same_m, settings.shared_nats)

    def _joined_beyond(self, picture: GoalPicture, candidates: list[Candidate]) -> list[_Joined]:
        """Fit lines to the goals beyond the first rivals, and to those whose silhouettes alone are seen."""
        search, rivals = self._search, self._settings.max_rivals
        more = candidates[rivals:]
        if any(candidate.is_plain for candidate in candidates):  # else the search has them already
            more = more + search.by_silhouettes(picture)
        more = sorted(more, key=lambda one: -search.nats(picture, one.sides, one.fit.unknowns))
        tried = [candidate.fit.unknowns for candidate in candidates[:rivals]]
        joined = []
        for candidate in more[: self._settings.max_doubted]:
            p = candidate.fit.unknowns
            if all(math.dist(p[:2], other[:2]) > search.settings.same_m for other in tried):
                tried.append(p)
                found = self._joined(picture, self._polished(picture, candidate))
                joined += [] if found is None else [found]
        return joined

    def _judged(
        self, picture: GoalPicture, lines: ColoredGoalLines, joined: list[_Joined]
    ) -> list[tuple[float, _Joined]]:
        """Weigh by the whole picture those that may be the goal."""
        return [(self._nats(picture, lines, j.camera), j) for j in joined if self._may_be(picture, j)]

    def _is_plain(self, found: _Joined) -> bool:
        """Whether nothing speaks against a goal, and lines go with it."""
        goal, settings = found.goal, self._settings
        return (
            goal.objection is None
            and goal.fit.score >= settings.min_alone_score
            and found.lines.line_ratio >= settings.min_overruling_ratio
        )

    def _is_clear(self, goal: Candidate) -> bool:
        return goal.objection is None and goal.fit.score >= self._settings.clear_score

    def _is_confirmed(self, picture: GoalPicture, camera: CameraEstimate) -> bool:
        """Whether lines tell at least so much of what they can tell that no other camera needs to be tried."""
        assert self._lines is not None
        nats, most = self._lines.nats(picture.frame, self._search.colored_model, camera.unknowns)
        return nats >= self._settings.telling_ratio * most

    def _may_be(self, picture: GoalPicture, found: _Joined) -> bool:
        """Whether a goal and lines put the camera where it can stand, and all of the goal is seen, nobody before it."""
        search, p, limits = self._search, found.lines.unknowns, found.goal.fit.settings
        posts = shown_ratios(picture.frame, search.camera, found.goal, p, limits.reaches_px[-1])[:2]
        return bool(
            np.all(np.abs(p[:2]) <= search.extent_m)
            and posts.min() >= limits.min_edge_ratio
            and search.washable(picture, found.goal.sides, p).min() >= self._settings.min_washable
        )

    def _nats(self, picture: GoalPicture, lines: ColoredGoalLines, camera: CameraEstimate) -> float:
        """Log-likelihood ratio of goal and lines, where a camera has them, to clutter."""
        p = camera.unknowns
        of_goal = self._search.nats(picture, camera.sides, p)
        return of_goal + lines.nats(picture.frame, self._search.colored_model, p)[0]

    def _polished(self, picture: GoalPicture, candidate: Candidate) -> Candidate:
        camera = self._search.camera
        fit = polish(picture.frame, camera, candidate.model, candidate.fit, candidate.appearance)
        return replace(candidate, fit=fit)

    def _joined(self, picture: GoalPicture, goal: Candidate) -> _Joined | None:
        found = None if self._lines is None else self._lines.join(picture.frame, goal.model, goal.fit)
        return None if found is None else _Joined(goal, *found)

    def _alone(self, goal: Candidate) -> CameraEstimate:
        return goal_alone(goal, self._line_settings.certain_m)

    def _is_overruled(self, picture: GoalPicture, found: _Joined) -> bool:
        """Whether lines confirm a goal that seemed none: most of them are seen, and posts and bar stand after all."""
        p, model = found.lines.unknowns, found.goal.model
        limits = model.settings
        return bool(
            found.lines.line_ratio >= self._settings.min_overruling_ratio
            and np.all(np.abs(p[:2]) <= self._search.extent_m)
            and max_prior_deviation(model, p) <= limits.max_deviation
            and shown_ratios(picture.frame, self._search.camera, found.goal, p, limits.reaches_px[-1]).min()
            >= limits.min_other_ratio
        )


def doubting(
    best: CameraEstimate, judged: list[tuple[float, CameraEstimate]], near_m: float, shared_nats: float
) -> CameraEstimate:
    """Let a camera be as uncertain as those nearby differ that the picture hardly tells from it.

    Parameters
    ----------
    best : CameraEstimate
        The camera; among the others.
    judged : list of (float, CameraEstimate)
        Cameras with their evidence, nats.
    near_m : float
        Cameras farther away are other answers.
    shared_nats : float
        Unit of the evidence, see `ColoredGoalSettings`.
    """
    near = [(nats, c) for nats, c in judged if math.dist(c.unknowns[:2], best.unknowns[:2]) <= near_m]
    nats = np.array([one for one, _ in near])
    weight = np.exp((nats - nats.max()) / shared_nats)
    unknowns, covariance = np.array([c.unknowns for _, c in near]), np.array([c.covariance for _, c in near])
    return replace(best, covariance=spread_about(best.unknowns, unknowns, covariance, weight / weight.sum()))
