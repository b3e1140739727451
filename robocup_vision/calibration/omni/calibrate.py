"""A mirror camera calibrated by unlabelled frames of the field: centre, tilt, curve, and each frame's pose with them.

1. Points: the floor's edge and the white lines of each frame, taken through the start, or through a guess.
2. Starts: curves of several horizons and scales, poses by the localisers, a short fit from each; the best few go on to
   the end, with weights that narrow from far off down to the points' own accuracy (`starts`).
3. The points are taken again through the camera found, the poses looked for anew over the whole field, and all is
   fitted once more (`fit`).
4. The family of curves, and whether the tilt may move, are chosen by points held back (`choice`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError, FrameError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.omni.choice import Chooser
from robocup_vision.calibration.omni.fit import FieldShape, Fit, JointFit, Points, spread_px
from robocup_vision.calibration.omni.model import CENTER, HORIZON, SCALE, CameraModel, hyperboloid_of
from robocup_vision.calibration.omni.result import CalibratedFrame, OmniCalibration, standard_deviations, trade_offs
from robocup_vision.calibration.omni.sightings import (
    MIN_BOUNDARY_POINTS,
    MIN_LINE_POINTS,
    Observer,
    Sighting,
    points_of,
)
from robocup_vision.calibration.omni.starts import Search
from robocup_vision.camera.floor_range import Tangent
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.progress import progress

__all__ = ["CalibratedFrame", "NotCalibrated", "OmniCalibration", "calibrate_omni", "guessed_cameras"]


# how far the centre may lie from the start's, of the image's smaller side
_CENTER_REACH = 0.1
# how far the logarithms of the curve's scale and horizon may lie from the start's: a tangent's a and b 35 % each;
# without a start the curve may be anything
_CURVE_REACH, _UNKNOWN_CURVE_REACH = (0.7, 0.4), (2.0, 2.0)
# a guessed camera sees from here to the image's edge, of its smaller side; its horizon, of that outer radius, lies
# outside all that is looked at; and half-way out it sees this share of the field's length
_GUESSED_INNER = 0.09
_GUESSED_HORIZON = 1.15
_GUESSED_HALF_WAY = (0.09, 0.15, 0.25, 0.4)
# the farthest floor worth looking at, in diagonals of the field, where no start says it
_FARTHEST = 1.1
# a point agrees within this many units of the search
_AGREES = 2.0
# widths of the weights when the points were taken again, in the same units
_AGAIN_SCALES, _LAST_SCALES = (4.0, 2.0), (2.0,)
_MIN_AGREEING = 0.4
_MIN_AGREEING_IN_FRAME = 0.3
# least share of the images with enough points that must end up in agreement
_MIN_KEPT = 0.5
# without walls and without a start so many different lines must be seen: a circle and a line across it have no size
_MIN_FEATURES = 4
# so many points, and of all that agree this share, make a line seen
_FEATURE_POINTS, _FEATURE_SHARE = 12, 0.02
# greatest standard deviations that still count as determined: centre, of the smaller side; curve, of itself
_CENTER_STD, _CURVE_STD = 0.015, 0.04
# a first fit this poor (0 to 1) explains next to nothing
_MAX_COST = 0.75
# other first fits up to this many times as poor are seen through, too
_DOUBTFUL_COST = 1.5
# another camera that explains the points about as well: costs alike, centre (of the smaller side) or curve not
_RIVAL_COST, _RIVAL_EXCESS, _RIVAL_CENTER, _RIVAL_CURVE = 1.15, 0.02, 0.03, 0.1
_MORE = "give more frames, from other places and headings"


def guessed_cameras(field: Field, size_px: tuple[int, int]) -> list[OmniCamera]:
    """Mirror cameras of which nothing is known but the size of their images, and that they were made for a field.

    The centre is the images' middle. What half of the radius shows is farther from one camera to the next: where walls
    bound the floor that is left to the search and there is but one, without them it says how wide lines look.
    """
    width, height = size_px
    side = min(width, height)
    outer = side / 2 - 1.0
    horizon = _GUESSED_HORIZON * outer
    cameras = []
    for share in _GUESSED_HALF_WAY[:1] if field.is_bounded else _GUESSED_HALF_WAY:
        scale = (1 - (outer / 2 / horizon) ** 2) ** -1 * outer / 2 / (share * field.length_m)
        curve = hyperboloid_of(scale, horizon, 4.0 * horizon)
        center = (width - 1) / 2, (height - 1) / 2
        cameras.append(OmniCamera(size_px, center, (_GUESSED_INNER * side, outer), curve))
    return cameras


def calibrate_omni(
    field: Field,
    frames: Sequence[UInt8Array],
    start: OmniCamera | None = None,
    mask: UInt8Array | None = None,
    *,
    names: Sequence[str] | None = None,
    max_frames: int = 24,
) -> OmniCalibration | NotCalibrated:
    """Calibrate a mirror camera by frames of a field, taken anywhere on it, at any heading.

    Heading, offset and mirroring of the camera on the robot are taken over from the start: no picture of a field tells
    them.

    Parameters
    ----------
    field : Field
        The pitch.
    frames : sequence of (H, W, 3) uint8
        BGR, all of one size; looked at one at a time, several times each: they may lie on a disk. One that raises a
        `FrameError` is left out.
    start : OmniCamera, optional
        Where to start. Without it the centre starts in the image's middle, with curves of every kind.
    mask : (H, W) uint8, optional
        Non-zero pixels are never looked at.
    names : sequence of str, optional
        What the frames are called; "frame 0" and so on unless given.
    max_frames : int
        At most so many, evenly spread, are used.

    Raises
    ------
    ArgumentError
        If there is no frame, or the field has neither walls nor lines.
    FrameError
        If no frame can be read.
    """
    if not len(frames):
        raise ArgumentError("at least one frame is needed")
    if max_frames < 1:
        raise ArgumentError(f"max_frames must be at least 1, got {max_frames}")
    if not field.is_bounded and not len(field.lines) + len(field.arcs):
        raise ArgumentError(f"field '{field.name}' has neither walls nor lines to calibrate by")
    chosen = sorted({int(i) for i in np.linspace(0, len(frames) - 1, min(max_frames, len(frames))).round()})
    known_as = names or [f"frame {index}" for index in range(len(frames))]
    return _Calibration(field, frames, known_as, chosen, start, mask).run()


class _Calibration:
    """One calibration, step by step."""

    def __init__(
        self,
        field: Field,
        frames: Sequence[UInt8Array],
        names: Sequence[str],
        chosen: list[int],
        start: OmniCamera | None,
        mask: UInt8Array | None,
    ) -> None:
        self.field, self.frames, self.names, self.chosen = field, frames, names, chosen
        self.start, self.mask = start, mask
        self.shape, self.line_map = FieldShape(field), LineMap(field)
        self.notes: dict[int, str] = {}

    def run(self) -> OmniCalibration | NotCalibrated:
        attempts = []
        for first in [self.start] if self.start is not None else guessed_cameras(self.field, self._size_px()):
            observer = Observer(self.field, first, self.mask, locate=False)
            seen = self._look(observer, "points")
            if not seen:
                continue
            if self.start is None:
                usable = observer.inner_radius_px, first.usable_radius_px[1]
                first = dataclasses.replace(first, usable_radius_px=usable)
            search = self._search(first)
            attempts.append((search.best(seen, observer.polar), seen, search))
        if not attempts:
            return self._refuse("no frame shows enough of " + self._wanted)
        attempts = [attempt for attempt in attempts if attempt[0]]
        if not attempts:
            return self._refuse("from no start could the robot be placed on the field")
        fits, sightings, search = min(attempts, key=lambda attempt: attempt[0][0].cost)
        if fits[0].cost > _MAX_COST:
            return self._refuse(f"from no start do the points seen come to lie on what field '{self.field.name}' has")
        explained = [self._again(fit, search) for fit in _unlike(fits, _DOUBTFUL_COST)]
        answers = sorted((e for e in explained if e is not None), key=lambda e: (-len(e.sightings), e.fit.cost))
        if not answers:
            return self._refuse("through the best camera found, no frame shows enough of " + self._wanted)
        kept = len(answers[0].sightings)
        if kept < _MIN_KEPT * len(sightings):
            self.notes = answers[0].notes
            return self._refuse(
                f"only {kept} of {len(sightings)} images fit one camera on field '{self.field.name}': "
                "are field and camera file those of the images?"
            )
        rivals = _unlike([answer.fit for answer in answers], _RIVAL_COST)
        if len(rivals) > 1:
            center_px, curve = _apart(*rivals[:2])
            return self._refuse(
                f"two cameras explain the images about equally well: their centres lie {center_px:.1f} px, "
                f"their curves {100 * curve:.0f} % apart; {_MORE}"
            )
        return self._finish(answers[0])

    @property
    def _wanted(self) -> str:
        return "the floor's edge or of white lines" if self.field.is_bounded else "white lines"

    def _size_px(self) -> tuple[int, int]:
        problem = None
        for index in self.chosen:
            try:
                height, width = self.frames[index].shape[:2]
            except FrameError as error:
                problem = problem or error
                continue
            return width, height
        raise problem or FrameError("no frame can be read")

    def _refuse(self, reason: str) -> NotCalibrated:
        return NotCalibrated(reason, tuple(self.notes.values()))

    def _look(self, observer: Observer, label: str) -> list[Sighting]:
        sightings = []
        problem: FrameError | None = None
        self.notes.clear()
        for index in progress(self.chosen, len(self.chosen), label):
            try:
                sighting = observer.look(index, self.frames[index])
            except FrameError as error:
                problem = error
                self._leave_out(index, str(error))
                continue
            if len(sighting.boundary_px) < MIN_BOUNDARY_POINTS and len(sighting.line_px) < MIN_LINE_POINTS:
                self._leave_out(index, f"too little of {self._wanted} in view")
                continue
            sightings.append(sighting)
        if problem is not None and not sightings and len(self.notes) == len(self.chosen):
            raise problem
        return sightings

    def _leave_out(self, index: int, reason: str) -> None:
        self.notes[index] = f"left out {self.names[index]}: {reason.removeprefix(self.names[index] + ': ')}"

    def _search(self, first: OmniCamera) -> Search:
        model = CameraModel(first, "tangent" if isinstance(first.floor_range, Tangent) else "hyperboloid")
        vector = model.vector(first)
        reach = _UNKNOWN_CURVE_REACH if self.start is None else _CURVE_REACH
        bounds = model.bounds(vector, _CENTER_REACH * min(first.size_px), *reach)
        return Search(self.field, self.shape, self.line_map, model, vector, bounds, self.start is None)

    def _again(self, fit: Fit, search: Search) -> _Explained | None:
        """Take the points again through a fit's camera, place every frame anew, and fit once more."""
        camera = fit.camera
        inner, outer = camera.usable_radius_px
        if self.start is None:
            # what is farther away than the field is long need not be looked at
            farthest_m = _FARTHEST * float(np.hypot(*np.ptp(self.field.floor_polygon, axis=0)))
            outer = min(outer, float(camera.floor_range.radius_px(1.0 / farthest_m)))
        seen_from = dataclasses.replace(camera, usable_radius_px=(inner, outer))
        frame = dataclasses.replace(search.model.frame, usable_radius_px=(inner, outer))
        search = dataclasses.replace(search, model=CameraModel(frame, search.model.curve))
        observer = Observer(self.field, seen_from, self.mask, locate=True)
        sightings = []
        for sighting in self._look(observer, "poses"):
            if sighting.pose is None:
                self._leave_out(sighting.index, "the robot could not be placed on the field")
            else:
                sightings.append(sighting)
        for scales in (_AGAIN_SCALES, _LAST_SCALES):
            if not sightings:
                return None
            joint = JointFit(self.shape, points_of(sightings))
            poses = np.array([s.pose.array for s in sightings if s.pose is not None])
            widths = (*(scale * search.unit_px for scale in scales), 1.0)
            fit = joint.solve(search.model, fit.vector, poses, widths, search.start, search.bounds)
            sightings = self._agreeing(sightings, fit, joint.points, search.unit_px)
        if not sightings:
            return None
        kept = np.array([sighting.pose.array for sighting in sightings if sighting.pose is not None])
        return _Explained(dataclasses.replace(fit, poses=kept), sightings, search, dict(self.notes))

    def _agreeing(self, sightings: list[Sighting], fit: Fit, points: Points, unit_px: float) -> list[Sighting]:
        """Sightings, with the poses of a fit, most of whose points agree with it."""
        kept = []
        for place, sighting in enumerate(sightings):
            share = float((np.abs(fit.residual_px[points.frame == place]) < _AGREES * unit_px).mean())
            if share < _MIN_AGREEING_IN_FRAME:
                self._leave_out(sighting.index, f"only {share:.0%} of its points agree with the others'")
            else:
                kept.append(dataclasses.replace(sighting, pose=Pose2(*fit.poses[place].tolist())))
        return kept

    def _finish(self, explained: _Explained) -> OmniCalibration | NotCalibrated:
        fit, sightings, search = explained.fit, explained.sightings, explained.search
        self.notes = explained.notes
        points = points_of(sightings)
        side = min(fit.camera.size_px)
        reach = _UNKNOWN_CURVE_REACH if self.start is None else _CURVE_REACH
        chooser = Chooser(self.shape, points, fit, (_CENTER_REACH * side, *reach), search.unit_px)
        choices = chooser.choose("tangent" if search.model.curve == "tangent" else "hyperboloid")
        fit = chooser.final(choices[0], max(1.0, 2 * spread_px(fit.residual_px)))
        covariance = JointFit(self.shape, points).covariance(fit)
        problem = self._problem(fit, covariance, points, search)
        if problem:
            return self._refuse(problem)
        frames = []
        for place, sighting in enumerate(sightings):
            residual, is_line = fit.residual_px[points.frame == place], points.is_line[points.frame == place]
            pose = Pose2(*fit.poses[place].tolist())
            frames.append(
                CalibratedFrame(
                    sighting.index,
                    self.names[sighting.index],
                    pose,
                    sighting.boundary_px,
                    sighting.line_px,
                    residual[~is_line],
                    residual[is_line],
                )
            )
        return OmniCalibration(
            fit.model.written(fit.vector),
            tuple(frames),
            standard_deviations(fit, covariance),
            choices,
            (*trade_offs(fit, covariance, choices[0].tilted, self.start is None), *self.notes.values()),
        )

    def _problem(self, fit: Fit, covariance: FloatArray, points: Points, search: Search) -> str:
        """Say why a fit cannot be trusted; empty if it can."""
        agrees = np.abs(fit.residual_px) < _AGREES * search.unit_px
        share = float(points.weight[agrees].sum() / points.weight.sum())
        if share < _MIN_AGREEING:
            return f"only {share:.0%} of the points seen lie on the walls and lines of field '{self.field.name}'"
        if self.start is None and not self.field.is_bounded and self._features(fit, points, agrees) < _MIN_FEATURES:
            return "the few lines in view look alike at any size; give more frames, from other places, or a start"
        side = min(fit.camera.size_px)
        std = np.sqrt(np.diag(covariance))
        if std[CENTER].max() > _CENTER_STD * side:
            return f"the images do not tell the centre: its standard deviation is {std[CENTER].max():.1f} px; {_MORE}"
        if std[SCALE : HORIZON + 1].max() > _CURVE_STD:
            worst = 100 * std[SCALE : HORIZON + 1].max()
            return f"the images do not tell the mirror's curve: its standard deviation is {worst:.0f} %; {_MORE}"
        low, high = fit.model.bounds(fit.model.vector(search.model.frame), _CENTER_REACH * side, *_CURVE_REACH)
        off = np.minimum(fit.vector - low, high - fit.vector)
        if off[CENTER].min() < 1e-6:
            reach = f"{_CENTER_REACH * side:.0f} px from where it started"
            return f"the centre ran to the limit, {reach}: are camera file and field those of the images?"
        if self.start is not None and off[SCALE : HORIZON + 1].min() < 1e-6:
            return "the curve ran to the limit of what the start allows; try without a start"
        return ""

    def _features(self, fit: Fit, points: Points, agrees: npt.NDArray[np.bool_]) -> int:
        """How many of the field's lines and arcs have points enough to be there."""
        floor_m = fit.camera.pixel_to_floor(points.pixels[agrees])
        frame = points.frame[agrees]
        count = np.zeros(len(self.field.lines) + len(self.field.arcs), dtype=np.int64)
        for place, pose in enumerate(fit.poses):
            on_field = Pose2(*pose.tolist()).transform(floor_m[frame == place])
            on_field = on_field[np.isfinite(on_field).all(axis=1)]
            count += np.bincount(self.line_map.nearest(on_field).index, minlength=len(count))
        return int(np.count_nonzero(count >= max(_FEATURE_POINTS, _FEATURE_SHARE * count.sum())))


@dataclass(frozen=True, eq=False)
class _Explained:
    """Frames as one camera explains them, taken anew through it: the fit, what agrees with it, and who was left out."""

    fit: Fit
    sightings: list[Sighting]
    search: Search
    notes: dict[int, str]


def _unlike(fits: Sequence[Fit], cost_ratio: float) -> list[Fit]:
    """Of fits, the best first, that best one and those about as good whose cameras are unlike all before."""
    kept = [fits[0]]
    for fit in fits[1:]:
        if fit.cost > cost_ratio * fits[0].cost + _RIVAL_EXCESS:
            continue
        side = min(fit.camera.size_px)
        apart = [_apart(fit, other) for other in kept]
        if all(center_px > _RIVAL_CENTER * side or curve > _RIVAL_CURVE for center_px, curve in apart):
            kept.append(fit)
    return kept


def _apart(fit: Fit, other: Fit) -> tuple[float, float]:
    """How far two cameras' centres lie apart, pixels, and their curves' main numbers, relative."""
    difference = np.abs(fit.vector - other.vector)
    return float(np.hypot(*difference[CENTER])), float(difference[SCALE : HORIZON + 1].max())
