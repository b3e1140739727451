"""Calibration of a mirror camera from unlabelled frames of the field: centre, tilt and curve, and a pose of each frame.

1. Points: the floor's edge and the white lines of each frame are detected with the start camera, or a guess.
2. Starts: curves of several horizons and scales, each with poses from the localisers and a short fit. The best few are
   fitted until convergence, with weights that narrow down to the points' accuracy (`starts`).
3. The points are detected again with the new camera, the poses are searched on the whole field, and the fit is repeated
   (`fit`).
4. Cross-validation chooses the family of curves, and whether the tilt is fitted (`choice`).
5. Without walls, the pose in each frame located with the result must agree with the fit's.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from field_models.errors import ArgumentError, FrameError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.omni.choice import (
    AGREEMENT,
    MORE,
    CalibratedFrame,
    Chooser,
    OmniCalibration,
    Trust,
    confirmed,
    standard_deviations,
    undetermined,
)
from robocup_vision.calibration.omni.fit import FieldShape, Fit, JointFit, Points, spread_px
from robocup_vision.calibration.omni.model import CENTER, HORIZON, SCALE, CameraModel, Curve, hyperboloid_of
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.calibration.omni.starts import Observer, Search, Sighting, points_of
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.floor_range import Table, Tangent
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.progress import progress

__all__ = ["CalibratedFrame", "NotCalibrated", "OmniCalibration", "calibrate_omni", "guessed_cameras"]

# greatest change of the centre, relative to the image's smaller side: the error of a hand-made camera file
_MAX_CENTER_RATIO = 0.1
# greatest changes of the logarithms of scale and horizon: of a tangent, 35 % in each of a and b; without a start any
# curve is possible
_MAX_LOG_CURVE, _MAX_UNKNOWN_LOG_CURVE = (0.7, 0.4), (2.0, 2.0)
# what a start provides even if its curve is not used
_OF_MOUNT = ("center_px", "usable_radius_px", "mirrored", "heading_rad", "offset_m")
# inner usable radius of a guessed camera, relative to the image's smaller side: the robot's body is inside; and its
# horizon, relative to the outer usable radius
_GUESSED_INNER_RATIO, _GUESSED_HORIZON = 0.09, 1.15
# floor range at half the radius, in robot radii, one guess each, which determines the expected width of lines: mirrors
# are designed for the robot, independent of the field's size; and for a field with walls, relative to its length
_GUESSED_RANGES, _GUESSED_WALLED_RANGE = (2.16, 3.6, 6.0, 9.6), 0.09
# greatest useful floor range without a start, in diagonals of the field
_FARTHEST_DIAGONALS = 1.1
# residual scales of the two fits to points measured with the first fit's camera, in units of `Search.unit_px`
_REFIT_SCALES = ((4.0, 2.0), (2.0,))
# least inlier ratio of one frame's points
_MIN_FRAME_INLIER_RATIO = 0.3
# least ratio of the frames with enough points that are kept in the end
_MIN_KEPT_RATIO = 0.5
# greatest cost (0 to 1) of an acceptable first fit
_MAX_COST = 0.75
# greatest cost of another first fit that is refined, and of a rival camera: factor of the best one's, and an offset
_MAX_DOUBTFUL_RATIO, _MAX_RIVAL_RATIO, _RIVAL_EXCESS = 1.5, 1.15, 0.02
# least difference of a rival's centre (relative to the image's smaller side), or of its curve (relative)
_MIN_RIVAL_CENTER_RATIO, _MIN_RIVAL_CURVE = 0.03, 0.1


def guessed_cameras(field: Field, size_px: tuple[int, int]) -> list[OmniCamera]:
    """Return guesses of a mirror camera for a field, from the images' size alone.

    The centre is the images' middle. The cameras differ in the floor range at half the radius. On a field with walls
    there is one camera, because the search determines the range.
    """
    width, height = size_px
    side = min(width, height)
    outer = side / 2 - 1.0
    horizon = _GUESSED_HORIZON * outer
    cameras = []
    ranges_m = [radii * field.robot_radius_m for radii in _GUESSED_RANGES]
    for range_m in [_GUESSED_WALLED_RANGE * field.length_m] if field.is_bounded else ranges_m:
        scale = (1 - (outer / 2 / horizon) ** 2) ** -1 * outer / 2 / range_m
        curve = hyperboloid_of(scale, horizon, 4.0 * horizon)
        center = (width - 1) / 2, (height - 1) / 2
        cameras.append(OmniCamera(size_px, center, (_GUESSED_INNER_RATIO * side, outer), curve))
    return cameras


def calibrate_omni(
    field: Field,
    frames: Sequence[UInt8Array],
    start: OmniCamera | None = None,
    mask: UInt8Array | None = None,
    *,
    names: Sequence[str] | None = None,
    max_frames: int = 24,
    settings: OmniCalibrationSettings = OmniCalibrationSettings(),
    trials: StartTrials | None = None,
) -> OmniCalibration | NotCalibrated:
    """Calibrate a mirror camera from frames of a field, taken at any place and heading.

    Heading, offset and mirroring of the camera are taken from the start, because images of a field do not show them.

    Parameters
    ----------
    frames : sequence of (H, W, 3) uint8
        BGR, all of one size. They are read one at a time, and several times, so the sequence may read them from a disk.
        Frames that raise a `FrameError` are left out.
    start : OmniCamera, optional
        Start of the fit. Without it the centre starts in the image's middle, with curves of several kinds. If a field
        has no walls, and no camera near the start fits, several curves are tested about its centre.
    mask : (H, W) uint8, optional
        Non-zero pixels are ignored.
    names : sequence of str, optional
        Names of the frames; "frame 0" and so on by default.
    max_frames : int
        Greatest number of frames in use; they are evenly spread.
    trials : StartTrials, optional
        Evaluates the starts, with workers or after an interruption.

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
    if not field.is_bounded and not field.has_lines:
        raise ArgumentError(f"field '{field.name}' has neither walls nor lines to calibrate by")
    chosen = sorted({int(i) for i in np.linspace(0, len(frames) - 1, min(max_frames, len(frames))).round()})
    labels = names or [f"frame {index}" for index in range(len(frames))]
    calibration = _Calibration(
        FieldShape(field), frames, labels, chosen, mask, settings, trials or StartTrials(), start
    )
    answer = calibration.run()
    if isinstance(answer, OmniCalibration) or start is None or field.is_bounded:
        return answer
    # few lines are compatible with several cameras, and the one near a wrong start need not be the best
    other = dataclasses.replace(calibration, start=None, mount=start, notes={}).run()
    if not isinstance(other, OmniCalibration):
        return answer
    return dataclasses.replace(other, notes=(f"found without the start's curve: by it, {answer.reason}", *other.notes))


@dataclass(eq=False)
class _Calibration:
    """One calibration."""

    shape: FieldShape
    frames: Sequence[UInt8Array]
    names: Sequence[str]
    chosen: list[int]
    mask: UInt8Array | None
    settings: OmniCalibrationSettings
    trials: StartTrials
    start: OmniCamera | None
    mount: OmniCamera | None = None  #: provides all but the curve without a start
    notes: dict[int, str] = dataclasses.field(default_factory=dict)  #: why frames are left out, by index

    @property
    def field(self) -> Field:
        return self.shape.field

    def run(self) -> OmniCalibration | NotCalibrated:
        attempts = []
        for first in [self.start] if self.start is not None else self._guesses():
            observer = Observer(self.field, first, self.mask, locate=False)
            seen = self._look(observer, "points")
            if not seen:
                continue
            if self.start is None:
                usable = observer.inner_radius_px, first.usable_radius_px[1]
                first = dataclasses.replace(first, usable_radius_px=usable)
            search = self._search(first)
            attempts.append((search.best(seen, observer.polar, self.trials), seen, search))
        if not attempts:
            return self._refuse("no frame shows enough of " + self._wanted)
        attempts = [attempt for attempt in attempts if attempt[0]]
        if not attempts:
            return self._refuse("no start gives a pose of the robot on the field")
        fits, sightings, search = min(attempts, key=lambda attempt: attempt[0][0].cost)
        if fits[0].cost > _MAX_COST:
            return self._refuse(
                f"no start brings the points found onto the walls and lines of field '{self.field.name}'"
            )
        candidates = _distinct(fits, _MAX_DOUBTFUL_RATIO)
        answers = self._answers(candidates, search)
        if not answers:
            return self._refuse("by the best camera found, no frame shows enough of " + self._wanted)
        kept = len(answers[0].sightings)
        if kept < _MIN_KEPT_RATIO * len(sightings):
            self.notes = answers[0].notes
            return self._refuse(
                f"only {kept} of {len(sightings)} images fit one camera on field '{self.field.name}': "
                "are field and camera file those of the images?"
            )
        rivals = _distinct([answer.fit for answer in answers], _MAX_RIVAL_RATIO)
        if len(rivals) > 1:
            center_px, curve = _difference(*rivals[:2])
            return self._refuse(
                f"two cameras explain the images about equally well: their centres lie {center_px:.1f} px, "
                f"their curves {100 * curve:.0f} % apart; {MORE}"
            )
        return self._finish(answers[0])

    @property
    def _wanted(self) -> str:
        return "the floor's edge or of white lines" if self.field.is_bounded else "white lines"

    def _guesses(self) -> list[OmniCamera]:
        guesses, mount = guessed_cameras(self.field, self._size_px()), self.mount
        if mount is None:
            return guesses
        own = {name: getattr(mount, name) for name in _OF_MOUNT}
        return [dataclasses.replace(guess, **own) for guess in guesses]

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
            if sighting.is_enough:
                sightings.append(sighting)
            else:
                self._leave_out(index, f"too little of {self._wanted} in view")
        if problem is not None and not sightings and len(self.notes) == len(self.chosen):
            raise problem
        return sightings

    def _leave_out(self, index: int, reason: str) -> None:
        self.notes[index] = f"left out {self.names[index]}: {reason.removeprefix(self.names[index] + ': ')}"

    def _search(self, first: OmniCamera) -> Search:
        of_kind: dict[type, Curve] = {Tangent: "tangent", Table: "own"}
        model = CameraModel(first, of_kind.get(type(first.floor_range), "hyperboloid"))
        vector = model.vector(first)
        return Search(self.shape, model, vector, model.bounds(vector, *self._max_change(first)), self.start is None)

    def _max_change(self, camera: OmniCamera) -> tuple[float, float, float]:
        """Return the greatest changes from the start, see `CameraModel.bounds`."""
        log_curve = _MAX_UNKNOWN_LOG_CURVE if self.start is None else _MAX_LOG_CURVE
        return (_MAX_CENTER_RATIO * min(camera.size_px), *log_curve)

    def _answers(self, fits: Sequence[Fit], search: Search) -> list[_Explained]:
        """Return the fits repeated with points from their own cameras, best first."""
        explained = [self._refitted(fit, search) for fit in fits]
        found = [e for e in explained if e is not None]
        most = max((len(e.sightings) for e in found), default=1)
        return sorted((e.of_frames(most) for e in found), key=lambda e: e.fit.cost)

    def _refitted(self, fit: Fit, search: Search) -> _Explained | None:
        """Measure the points again with a fit's camera, locate every frame again, and repeat the fit."""
        camera = fit.camera
        inner, outer = camera.usable_radius_px
        if self.start is None:
            # floor beyond this is outside the field
            farthest_m = _FARTHEST_DIAGONALS * float(np.hypot(*np.ptp(self.field.floor_polygon, axis=0)))
            outer = min(outer, float(camera.floor_range.radius_px(1.0 / farthest_m)))
        cut = dataclasses.replace(camera, usable_radius_px=(inner, outer))
        frame = dataclasses.replace(search.model.frame, usable_radius_px=(inner, outer))
        search = dataclasses.replace(search, model=dataclasses.replace(search.model, frame=frame))
        observer = Observer(self.field, cut, self.mask, locate=True)
        sightings = self._with_poses(self._look(observer, "poses"), search, cut)
        for scales in _REFIT_SCALES:
            if not sightings:
                return None
            joint = JointFit(self.shape, points_of(sightings), painted=True)
            poses = np.array([s.pose.array for s in sightings if s.pose is not None])
            widths = (*(scale * search.unit_px for scale in scales), 1.0)
            fit = joint.solve(search.model, fit.vector, poses, widths, search.start, search.bounds)
            sightings = self._agreeing(sightings, fit, joint.points, search.unit_px)
        if not sightings:
            return None
        kept = np.array([sighting.pose.array for sighting in sightings if sighting.pose is not None])
        return _Explained(dataclasses.replace(fit, poses=kept), sightings, search, dict(self.notes))

    def _with_poses(self, sightings: list[Sighting], search: Search, camera: OmniCamera) -> list[Sighting]:
        """Return the sightings with a pose, from the localiser or else by a search with lines alone.

        An inaccurate camera seldom gives a pose by the localiser. Wrong poses from lines are rejected later, because
        the frame's points then disagree with the fit.
        """
        located, by_lines = [], None if self.field.is_bounded else search.by_lines(camera)
        for sighting in sightings:
            pose = sighting.pose
            if pose is None and by_lines is not None:
                pose = by_lines.likeliest_by_points(sighting.line_px)
            if pose is None:
                self._leave_out(sighting.index, "the robot could not be placed on the field")
            else:
                located.append(dataclasses.replace(sighting, pose=pose))
        return located

    def _agreeing(self, sightings: list[Sighting], fit: Fit, points: Points, unit_px: float) -> list[Sighting]:
        """Return the sightings whose points agree with a fit, with its poses."""
        kept = []
        for place, sighting in enumerate(sightings):
            agrees = np.abs(fit.residual_px[points.frame == place]) < AGREEMENT * unit_px
            ratio = float(agrees.mean())
            if ratio < _MIN_FRAME_INLIER_RATIO:
                self._leave_out(sighting.index, f"only {ratio:.0%} of its points agree with the others'")
            else:
                kept.append(dataclasses.replace(sighting, pose=Pose2(*fit.poses[place].tolist())))
        return kept

    def _finish(self, explained: _Explained) -> OmniCalibration | NotCalibrated:
        fit, sightings, search = explained.fit, explained.sightings, explained.search
        self.notes = explained.notes
        points = points_of(sightings)
        max_change = self._max_change(fit.camera)
        chooser = Chooser(self.shape, points, fit, max_change, search.unit_px)
        choices = chooser.choose()
        width_px = max(1.0, 2 * spread_px(fit.residual_px))
        fit = chooser.final(choices[0], width_px)
        covariance = JointFit(self.shape, points, painted=True).covariance(fit)
        trust = Trust(self.shape, self.start is not None, search.unit_px, max_change, self.settings)
        problem = trust.problem(fit, covariance, points)
        if problem:
            return self._refuse(problem)
        if not self.field.is_bounded:
            kept, refused = confirmed(self.field, self.frames, fit, sightings, self.mask, self.settings)
            for index, reason in refused.items():
                self._leave_out(index, reason)
            if len(kept) < max(_MIN_KEPT_RATIO * len(sightings), 1):
                return self._refuse(f"by the camera found, the robot does not find itself in its images; {MORE}")
            if len(kept) < len(sightings):
                poses = np.array([sighting.pose.array for sighting in kept if sighting.pose is not None])
                rest = dataclasses.replace(explained.fit, poses=poses)
                return self._finish(dataclasses.replace(explained, fit=rest, sightings=kept))
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
        is_assumed = self.start is None and self.mount is None
        notes = undetermined(covariance, choices[0].tilted, is_assumed)
        if not self.field.is_bounded:
            equally_good = [chooser.final(choice, width_px).camera for choice in chooser.equally_good(choices[0])]
            notes.append(f"the floor's range: {trust.range_note(fit, covariance, equally_good)}")
        return OmniCalibration(
            fit.model.written(fit.vector),
            tuple(frames),
            standard_deviations(covariance),
            choices,
            (*notes, *self.notes.values()),
        )


@dataclass(frozen=True, eq=False)
class _Explained:
    """A fit to points from its own camera, with the agreeing frames, and notes on the others."""

    fit: Fit
    sightings: list[Sighting]
    search: Search
    notes: dict[int, str]

    def of_frames(self, count: int) -> _Explained:
        """Return this with the mean cost over `count` frames, of which missing ones have cost 1."""
        ratio = len(self.sightings) / count
        fit = dataclasses.replace(self.fit, cost=ratio * self.fit.cost + 1.0 - ratio)
        return dataclasses.replace(self, fit=fit)


def _distinct(fits: Sequence[Fit], max_ratio: float) -> list[Fit]:
    """Return the best of fits in order of cost, and those of similar cost whose cameras differ from all before."""
    kept = [fits[0]]
    for fit in fits[1:]:
        if fit.cost > max_ratio * fits[0].cost + _RIVAL_EXCESS:
            continue
        min_px = _MIN_RIVAL_CENTER_RATIO * min(fit.camera.size_px)
        differences = [_difference(fit, other) for other in kept]
        if all(center_px > min_px or curve > _MIN_RIVAL_CURVE for center_px, curve in differences):
            kept.append(fit)
    return kept


def _difference(fit: Fit, other: Fit) -> tuple[float, float]:
    """Distance of two cameras' centres in pixels, and relative difference of their curves' main parameters."""
    difference = np.abs(fit.vector - other.vector)
    return float(np.hypot(*difference[CENTER])), float(difference[SCALE : HORIZON + 1].max())
