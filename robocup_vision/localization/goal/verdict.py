"""The verdict on goals that may be in a picture: one log-likelihood ratio chooses the camera and accepts it.

Three kinds of evidence are compared with clutter: edges of any kind and paint along the silhouette, lines at their
predicted places, and the accuracy of the edges' fit. Lamps that wash posts, windows that hide edges and worn lines each
reduce one of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from robocup_vision.estimates import NotLocated
from robocup_vision.localization.goal.arc import open_arc, spread_about
from robocup_vision.localization.goal.camera_estimate import CameraEstimate, without_lines
from robocup_vision.localization.goal.goal_lines import CERTAIN_M, SAME_M, GoalLines
from robocup_vision.localization.goal.goal_picture import GoalPicture
from robocup_vision.localization.goal.profile import polish
from robocup_vision.localization.goal.search import Candidate, GoalSearch
from robocup_vision.localization.line_map import LineMap

_MAX_CANDIDATES = 6  # candidates that are fitted together with lines, the likeliest first
# log-likelihood ratio from which a goal is accepted. Rendered half goals and boxes reach 230, whole goals in heavy
# glare 289 and more.
_MIN_NATS = 260.0
_MIN_LINE_NATS = -30.0  # least log-likelihood ratio of lines: paint wears off, and others stand on it
# fraction of the greatest evidence of all predicted lines from which a clear goal ends the search
_CONFIRMING_RATIO = 0.75
# least fraction of each post and the bar that is the goal's paint, washed white or not: others hide the rest
_MIN_WASHABLE = 0.9
# unit of differences between cameras: errors of neighbouring samples of an edge or line are correlated
_CORRELATION_NATS = 15.0


class GoalVerdict:
    """Places a camera by the goals that a search has found, and by the field's lines unless `line_map` is None."""

    def __init__(
        self,
        search: GoalSearch,
        line_map: LineMap | None,
    ) -> None:
        self._search = search
        self._lines = None if line_map is None else GoalLines(line_map, search.camera)

    def locate(self, picture: GoalPicture, candidates: list[Candidate]) -> CameraEstimate | NotLocated:
        """Return the likeliest camera that sees one of the candidates, the best of which comes first."""
        judged: list[tuple[float, CameraEstimate]] = []
        for candidate in candidates[:_MAX_CANDIDATES]:
            is_confirmed = False
            for camera in self._cameras(picture, candidate):
                nats, confirmed = self._nats(picture, candidate, camera)
                judged.append((nats, camera))
                is_confirmed |= nats >= _MIN_NATS and confirmed
            if candidate.is_clear and is_confirmed:
                break
        if not judged:
            return NotLocated("no whole goal: no camera on the pitch would see what looks like one, unhidden")
        nats = max(nats for nats, _ in judged)
        if nats < _MIN_NATS:
            ratio = f"log-likelihood ratio {nats:.0f} of the {_MIN_NATS:.0f} that are needed"
            return NotLocated(f"no certain goal: what looks like one reaches a {ratio}")
        # of cameras that the picture hardly separates the most certain one: lines fix it better than the silhouette
        alike = [one for other, one in judged if other >= nats - _CORRELATION_NATS]
        best = min(alike, key=lambda one: float(np.trace(one.covariance[:2, :2])))
        return with_spread(best, judged, SAME_M, _CORRELATION_NATS)

    def _cameras(self, picture: GoalPicture, candidate: Candidate) -> Iterator[CameraEstimate]:
        """Yield the cameras that a goal gives by itself and with lines, where they can stand and see all of it."""
        search, model = self._search, candidate.model
        # posts and a bar that are not visible in full are hidden by somebody
        if search.washable(picture, candidate.sides, candidate.fit.unknowns).min() < _MIN_WASHABLE:
            return
        found = polish(picture.frame, search.camera, model, candidate.fit, candidate.appearance)
        goal = replace(candidate, fit=found)
        arc = open_arc(model, found, CERTAIN_M)
        cameras = [without_lines(goal, arc)]
        if self._lines is not None:
            cameras += self._lines.join(picture.frame, goal, arc)
        yield from (one for one in cameras if search.is_possible(one.unknowns))

    def _nats(self, picture: GoalPicture, candidate: Candidate, camera: CameraEstimate) -> tuple[float, bool]:
        """Log-likelihood ratio of goal and lines, where a camera has them, to clutter; whether lines confirm it."""
        nats = self._search.nats(picture, candidate, camera.unknowns)
        if self._lines is None:
            return nats, True
        of_lines, most = self._lines.nats(picture.frame, candidate.model, camera.unknowns)
        return nats + max(of_lines, _MIN_LINE_NATS), of_lines >= _CONFIRMING_RATIO * most


def with_spread(
    best: CameraEstimate, judged: list[tuple[float, CameraEstimate]], near_m: float, correlation_nats: float
) -> CameraEstimate:
    """Widen the best camera's covariance by the spread of cameras within `near_m` of nearly equal likelihood."""
    near = [(nats, c) for nats, c in judged if math.dist(c.unknowns[:2], best.unknowns[:2]) <= near_m]
    nats = np.array([one for one, _ in near])
    weight = np.exp((nats - nats.max()) / correlation_nats)
    unknowns, covariance = np.array([c.unknowns for _, c in near]), np.array([c.covariance for _, c in near])
    return replace(best, covariance=spread_about(best.unknowns, unknowns, covariance, weight / weight.sum()))
