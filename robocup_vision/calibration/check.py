"""Checks of a set-up by its own images: sizes, light, camera, field, mirroring, heading, centre, curve and colours.

Each finding states its evidence. If few images are located, or their poses contradict truth or odometry, similar
set-ups are tested, and one that fits is reported. A finding is "unknown" if the images do not decide it: a field looks
the same in a mirror, so that mirroring and heading need odometry or truth.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from field_models.errors import FrameError
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.doctor import Doctor, Picture, make_vision
from robocup_vision.calibration.forward.by_edges import calibrate_by_edges
from robocup_vision.calibration.near_set_ups import NearSetUp
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.omni.calibrate import OmniCalibration, calibrate_omni
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate, SwappedChannels
from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.files.images import read_image
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.swapped_channels import SWAPPED_BY_GOALS
from robocup_vision.progress import progress
from robocup_vision.view import View
from robocup_vision.vision import Vision

# greatest number of images in use, evenly spread; of images tested with learnt colours; and of images for the
# calibration of a pinhole camera
_MAX_IMAGES, _MAX_TRIED, _MAX_CALIBRATED = 24, 8, 12
# ratios of located images above which the field is right, and below which it is wrong; between them the images may just
# show too little
_MIN_LOCATED_RATIO, _MIN_SOME_RATIO = 0.8, 0.3
# least ratio of located images whose poses agree with truth or odometry
_MIN_SOME_AGREEING = 0.5
# least brightness in counts of a reliable colour, and of the 99th percentile of a picture's pixels, above the sensor's
# noise
_MIN_COUNTS = 16.0
# least difference in counts between the 1st and the 99th percentile of a picture's pixels
_MIN_CONTRAST = 8.0
# heights of robots' cameras, and focal lengths of lenses in picture widths: least and greatest
_HEIGHTS_M, _FOCAL_RATIOS = (0.02, 3.0), (0.2, 20.0)
# a picture is compared with the first later one after this distance or angle by odometry, because shorter motions are
# not significant; and the greatest number of frames between them
_MIN_WAY_M, _MIN_WAY_RAD, _MAX_WAY_FRAMES = 0.5, math.radians(15.0), 15
# pictures of another subject: greatest ratio of located ones, and least ratio of those with ground in front of the
# robot that is not green
_MAX_STRAY_RATIO, _MIN_OTHER_RATIO = 0.1, 0.5
# least mean inlier ratio of a correct set-up
_MIN_AGREEMENT = 0.6
# an error is reported if it exceeds this number of standard deviations, and these bounds: of the centre, relative to
# the image's smaller side; of the floor range or the focal length, relative; and of the headings' median
_SIGNIFICANCE, _MAX_CENTER_RATIO, _MAX_RANGE_ERROR, _MAX_HEADING_ERROR_RAD = 3.0, 0.0015, 0.01, math.radians(3.0)
# least intersection over union of the floor by fixed and by learnt colours
_MIN_COLOR_AGREEMENT = 0.8
# least number of headings, or of pictures of a calibration, for a decision
_MIN_SAMPLES = 3
# least evidence of an image, and of all images, about the order of the channels
_MIN_CHANNEL_NATS, _REPORT_CHANNEL_NATS = 1.0, math.log(100.0)
# subjects of `NearSetUp` that a calibration by edges determines more precisely
_BY_EDGES = ("focal length", "height")


def shows_carpet(view: View, frame: UInt8Array) -> bool | None:
    """Whether the ground nearest to the robot is mainly green rather than red or blue; None if it is too dark to tell.

    Parameters
    ----------
    view : View
        View of the frame; without floor samples (a camera of unknown tilt) the lower third of the frame is used.
    """
    polar = view.polar
    if polar is None:
        near = frame[-(frame.shape[0] // 3) :].reshape(-1, 3)
    else:
        columns = slice(0, polar.valid.shape[1] // 3)
        places = polar.pixels[:, columns][polar.valid[:, columns] > 0]
        u, v = np.rint(places).astype(int).T
        near = frame[v, u]
    blue, green, red = np.median(near, axis=0).tolist() if len(near) else (0.0, 0.0, 0.0)
    return None if max(blue, green, red) < _MIN_COUNTS else bool(green > max(blue, red))


State = Literal["ok", "wrong", "unknown"]


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of one check."""

    #: "size", "pictures", "camera", "channels", "field", "mirrored", "heading", "centre", "curve", "lens", "colours",
    #: "truth", "odometry", or the subject of a similar set-up that fits
    subject: str
    state: State  #: the result
    evidence: str  #: a sentence with numbers


def check_dataset(dataset: Dataset) -> list[Finding]:
    """Find errors in a dataset's files from some of its images.

    Parameters
    ----------
    dataset : Dataset
        A folder of images, or a video, of which the first images are used.

    Returns
    -------
    list of Finding
        In the order in which errors should be corrected. Checks whose result depends on a found error are omitted.
    """
    images = list(_some_images(dataset))
    findings = [_check_size(dataset, images)]
    good = [(name, frame) for name, frame in images if not isinstance(frame, FrameError)]
    if findings[0].state == "wrong" or not good:
        return [*findings, *_other_size(dataset, images)]
    hiding = [*_check_lens(dataset.camera), *_check_light([frame for _, frame in good])]
    if hiding:
        return [*findings, *hiding]
    findings += _check_height(dataset.camera)
    return [*findings, *_Check(dataset, [name for name, _ in good], [frame for _, frame in good]).run()]


def _some_images(dataset: Dataset) -> Iterator[tuple[str, UInt8Array | FrameError]]:
    count = len(dataset.image_names)
    if dataset.is_video:
        yield from zip(dataset.image_names[:_MAX_IMAGES], dataset.read_frames(), strict=False)
        return
    chosen = sorted({int(i) for i in np.linspace(0, count - 1, min(count, _MAX_IMAGES)).round()})
    for index in progress(chosen, len(chosen), "reading"):
        try:
            yield dataset.image_names[index], dataset.read_frame(index)
        except FrameError as error:
            yield dataset.image_names[index], error


def _check_size(dataset: Dataset, images: list[tuple[str, UInt8Array | FrameError]]) -> Finding:
    width, height = dataset.camera.size_px
    bad = [(name, error) for name, error in images if isinstance(error, FrameError)]
    if not bad:
        return Finding("size", "ok", f"{len(images)} images read, all {width}x{height} as the camera file says")
    evidence = f"{len(bad)} of {len(images)} images cannot be used; {bad[0][1]}"
    return Finding("size", "wrong", evidence)


def _other_size(dataset: Dataset, images: list[tuple[str, UInt8Array | FrameError]]) -> list[Finding]:
    """Test pictures of another size than the camera's, without scaling."""
    if dataset.is_video:
        return []
    pictures = []
    for name, _ in images:
        # unreadable files are reported with the sizes
        with suppress(FrameError):
            pictures.append(Picture(name, read_image(dataset.path / name)))
    if not pictures or len({picture.frame.shape for picture in pictures}) > 1:
        return []
    doctor = Doctor(dataset, pictures)
    found = doctor.find()
    return [] if found is None else [_near_set_up_finding(doctor, found, len(pictures))]


def _near_set_up_finding(doctor: Doctor, found: tuple[NearSetUp, int], count: int) -> Finding:
    near, fitting = found
    mend = f": {near.mend}" if near.mend else ""
    evidence = (
        f"with {near.words} {fitting} of {count} pictures {doctor.measure} "
        f"({doctor.fitting()} of {count} as it is){mend}"
    )
    return Finding(near.subject, "wrong", evidence)


def _check_light(frames: list[UInt8Array]) -> list[Finding]:
    """Return findings about dark or uniform pictures."""
    count = len(frames)
    levels = [np.percentile(frame[::4, ::4].max(axis=2), (1, 99)).tolist() for frame in frames]
    dark = sum(high < _MIN_COUNTS for _, high in levels)
    even = sum(high - low < _MIN_CONTRAST and high >= _MIN_COUNTS for low, high in levels)
    if max(dark, even) <= (1 - _MIN_LOCATED_RATIO) * count:
        return []
    if dark >= even:
        return [Finding("pictures", "wrong", f"{dark} of {count} are black or nearly so: is the lens covered?")]
    return [Finding("pictures", "wrong", f"{even} of {count} have the same brightness all over, and show nothing")]


def _check_height(camera: OmniCamera | PinholeCamera) -> list[Finding]:
    """Return findings about a height outside those of robots."""
    (least_m, most_m), height_m = _HEIGHTS_M, camera.height_m
    if height_m is None or least_m <= height_m <= most_m:
        return []
    key = "height_m" if isinstance(camera, PinholeCamera) else "viewpoint_height_m"
    evidence = f"it is {height_m:g} m above the floor by the camera file: {key} is in metres"
    return [Finding("camera", "wrong", evidence)]


def _check_lens(camera: OmniCamera | PinholeCamera) -> list[Finding]:
    """Return findings about a focal length outside those of lenses."""
    if not isinstance(camera, PinholeCamera):
        return []
    (least, most), ratio = _FOCAL_RATIOS, camera.focal_px[0] / camera.size_px[0]
    if least <= ratio <= most:
        return []
    evidence = (
        f"no robot has this lens: with a focal length of {camera.focal_px[0]:g} pixels pictures "
        f"{camera.size_px[0]} pixels wide show {2 * math.degrees(math.atan(0.5 / ratio)):.3g} degrees"
    )
    return [Finding("camera", "wrong", evidence)]


class _Check:
    """Checks of images of the right size."""

    def __init__(self, dataset: Dataset, names: list[str], frames: list[UInt8Array]) -> None:
        self.dataset, self.names, self.frames = dataset, names, frames
        vision = make_vision(dataset, dataset.field, dataset.camera)
        self.channel_nats: list[float] = []
        self.views: list[View] = []
        for view in _look(vision, frames, "looking"):
            self.views.append(view)
            self.channel_nats.append(vision.swapped_channels_nats)

    def run(self) -> list[Finding]:
        channels = self._check_channels()
        if channels is not None and channels.state == "wrong":
            return [channels]
        findings = [] if channels is None else [channels]
        pictures = [self._picture(*one) for one in zip(self.names, self.frames, strict=True)]
        doctor = Doctor(self.dataset, pictures, dict(zip(self.names, self.views, strict=True)))
        if doctor.fitting() < _MIN_LOCATED_RATIO * len(self.views):
            found = doctor.find()
            if found is not None:
                camera = found[0].set_up.camera
                by_edges = self._check_by_edges(camera) if found[0].subject in _BY_EDGES else []
                return [*findings, _near_set_up_finding(doctor, found, len(self.views)), *by_edges]
        other = self._other_pictures()
        if other is not None:
            return [*findings, other]
        field, agreement = self._check_field(), self._check_agreement(doctor)
        findings.append(field)
        if isinstance(self.dataset.camera, OmniCamera):
            if field.state != "wrong":
                findings += [self._check_mirroring(agreement), *self._check_heading(self.dataset.camera)]
            findings += self._check_camera(self.dataset.camera, field.state == "ok")
        elif field.state != "wrong":
            findings += self._check_by_edges(self.dataset.camera)
        if self.dataset.colors is not None:
            findings.append(self._check_colors())
        if agreement is not None and all(finding.state != "wrong" for finding in findings):
            findings.append(agreement)
        return findings

    def _check_agreement(self, doctor: Doctor) -> Finding | None:
        """Compare poses with truth or odometry; None without these, or without a pose."""
        placed, fitting = sum(bool(view.pose) for view in self.views), doctor.fitting()
        if not doctor.compares or not placed:
            return None
        evidence = f"{fitting} of {placed} located pictures {doctor.measure}"
        if fitting >= _MIN_SOME_AGREEING * placed:
            return Finding(doctor.compares, "ok", evidence)
        return Finding(doctor.compares, "wrong", f"{evidence}, and none of the slips tried explains that")

    def _check_mirroring(self, agreement: Finding | None) -> Finding:
        """Whether the camera file's mirroring is right, by the comparison of poses with truth or odometry."""
        if agreement is None:
            missing = "a field looks the same in a mirror: truth.csv, or frames.csv with odometry, is needed"
            return Finding("mirrored", "unknown", missing)
        return replace(agreement, subject="mirrored", state="ok" if agreement.state == "ok" else "unknown")

    def _picture(self, name: str, frame: UInt8Array) -> Picture:
        """Return a picture with a later one after a significant motion by odometry, unless its true pose is known."""
        dataset = self.dataset
        if dataset.times is None or dataset.is_video or name in dataset.truth:
            return Picture(name, frame)
        moved, way_m, way_rad = Pose2(0.0, 0.0, 0.0), 0.0, 0.0
        first = dataset.image_names.index(name) + 1
        for number in range(first, min(first + _MAX_WAY_FRAMES, len(dataset.image_names))):
            step = dataset.times[dataset.image_names[number]].odometry
            if step is None:
                break
            moved = moved.compose(step)
            way_m, way_rad = way_m + math.hypot(step.x_m, step.y_m), way_rad + step.theta_rad
            if way_m >= _MIN_WAY_M or abs(way_rad) >= _MIN_WAY_RAD:
                try:
                    return Picture(name, frame, dataset.read_frame(number), moved)
                except FrameError:
                    break
        return Picture(name, frame)

    def _check_channels(self) -> Finding | None:
        """Whether red and blue are swapped, by goals and ball; None if the field has none of a suitable colour."""
        count = len(self.views)
        nats = np.array(self.channel_nats)
        for_swapped, for_own = (int((sign * nats >= _MIN_CHANNEL_NATS).sum()) for sign in (1, -1))
        if for_swapped:
            by_goals = any(
                isinstance(view.pose, SwappedChannels) and view.pose.reason == SWAPPED_BY_GOALS for view in self.views
            )
            what = "goals look" if by_goals else "ball looks"
            evidence = f"in {for_swapped} of {count} images the {what} as with red and blue swapped"
            if for_own:
                evidence += f", in {for_own} as they are"
            is_wrong = float(nats.sum()) >= _REPORT_CHANNEL_NATS and for_swapped > 2 * for_own
            advice = "the images were written with red and blue swapped (RGB arrays by OpenCV's imwrite?)?"
            return Finding("channels", "wrong" if is_wrong else "unknown", f"{evidence}: {advice}")
        if for_own:
            return Finding("channels", "ok", f"in {for_own} of {count} images goals or ball have their own colours")
        field = self.dataset.field
        if field.ball_color in ("white", "black") and not field.halves_differ:
            return None
        return Finding("channels", "unknown", "no ball, and no goal that could tell, is seen in its own colour")

    def _other_pictures(self) -> Finding | None:
        """Report pictures of another subject; None if poses or the ground's colour indicate a field."""
        count = len(self.views)
        placed = sum(bool(view.pose) for view in self.views)
        if placed > _MAX_STRAY_RATIO * count:
            return None
        others = sum(shows_carpet(view, frame) is False for view, frame in zip(self.views, self.frames, strict=True))
        if others < _MIN_OTHER_RATIO * count:
            return None
        evidence = (
            f"these pictures do not show this field: {placed} of {count} images can be located on "
            f"'{self.dataset.field.name}', and in {others} of {count} the ground before the robot is no green carpet"
        )
        return Finding("field", "wrong", evidence)

    def _check_field(self) -> Finding:
        name = self.dataset.field.name
        placed = sum(bool(view.pose) for view in self.views)
        min_placed = _MIN_LOCATED_RATIO * len(self.views)
        evidence = f"{placed} of {len(self.views)} images can be located on '{name}'"
        if placed >= min_placed and _agreement(self.views) >= _MIN_AGREEMENT:
            return Finding("field", "ok", f"{evidence}, {_agreement(self.views):.0%} of their points agree")
        if placed >= min_placed:
            return Finding("field", "ok", evidence)
        reasons = Counter(view.pose.reason for view in self.views if isinstance(view.pose, NotLocated))
        evidence += f"; most often: {reasons.most_common(1)[0][0]}"
        if placed >= _MIN_SOME_RATIO * len(self.views):
            return Finding("field", "unknown", evidence)
        return Finding("field", "wrong", f"{evidence}; nor with any slip in field, camera or pictures that was tried")

    def _check_heading(self, camera: OmniCamera) -> list[Finding]:
        # double angles are equal for both halves of a symmetric field
        off = np.array([2 * (pose.theta_rad - truth_rad) for pose, truth_rad in self._headings()])
        if len(off) < _MIN_SAMPLES:
            return []
        middle = math.atan2(float(np.median(np.sin(off))), float(np.median(np.cos(off))))
        spread = float(np.median([abs(wrap_angle(value - middle)) for value in off])) / 2
        middle /= 2
        degrees = math.degrees(middle)
        if abs(middle) > _MAX_HEADING_ERROR_RAD and abs(middle) > 2 * spread:
            advice = f"heading_rad = {camera.heading_rad + middle:.3f} in the camera file (or half a turn from it)?"
            return [Finding("heading", "wrong", f"all headings differ from the truth by {degrees:+.1f} deg: {advice}")]
        return [Finding("heading", "ok", f"headings differ from the truth by {degrees:+.1f} deg (median)")]

    def _headings(self) -> Iterator[tuple[Pose2, float]]:
        """Yield estimated poses with the known true headings."""
        for name, view in zip(self.names, self.views, strict=True):
            truth = self.dataset.truth.get(name)
            found = view.pose if self.dataset.pose_of == "robot" else view.camera_pose
            if found and truth is not None and truth.theta_rad is not None:
                yield found.pose, truth.theta_rad

    def _check_camera(self, camera: OmniCamera, can_place: bool) -> list[Finding]:
        result = calibrate_omni(self.dataset.field, self.frames, camera, self.dataset.mask, names=self.names)
        if not isinstance(result, OmniCalibration):
            state: State = "unknown" if can_place else "wrong"
            return [Finding("centre", state, f"no camera near this one fits the images: {result.reason}")]
        (u, v), (u_new, v_new) = camera.center_px, result.camera.center_px
        off = np.array([u_new - u, v_new - v])
        std = np.array([result.std["center_u_px"], result.std["center_v_px"]])
        least = np.maximum(_SIGNIFICANCE * std, _MAX_CENTER_RATIO * min(camera.size_px))
        words = f"({off[0]:+.2f}, {off[1]:+.2f}) +- ({std[0]:.2f}, {std[1]:.2f}) px"
        mend = "robocup-vision calibrate omni --start CAMERA corrects it"
        if np.any(np.abs(off) > least):
            centre = Finding("centre", "wrong", f"by the images it is off by {words}: {mend}")
        else:
            centre = Finding("centre", "ok", f"by the images it is right within {words}")
        return [centre, self._check_curve(camera, result.camera, mend)]

    def _check_curve(self, camera: OmniCamera, better: OmniCamera, mend: str) -> Finding:
        radius = np.linspace(*camera.usable_radius_px, 40)[:30]
        given = camera.floor_range.inverse_range_per_m(radius)
        fitted = better.floor_range.inverse_range_per_m(radius)
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = given / fitted - 1
        known = np.isfinite(ratio) & (given > 0) & (fitted > 0)
        if not known.any():
            return Finding("curve", "wrong", f"it has no floor where the images show some: {mend}")
        worst = float(ratio[known][np.argmax(np.abs(ratio[known]))])
        evidence = f"floor ranges differ from those of the images by up to {100 * abs(worst):.1f} %"
        if float(np.median(np.abs(ratio[known]))) > _MAX_RANGE_ERROR:
            return Finding("curve", "wrong", f"{evidence}: {mend}")
        return Finding("curve", "ok", evidence)

    def _check_by_edges(self, start: OmniCamera | PinholeCamera) -> list[Finding]:
        """Calibrate a pinhole camera of known tilt from a start, and compare the result with the camera file."""
        camera = self.dataset.camera
        if not isinstance(start, PinholeCamera) or not isinstance(camera, PinholeCamera) or camera.tilt_rad is None:
            return []
        some = dict(list(enumerate(self.frames))[:: -(-len(self.frames) // _MAX_CALIBRATED)])
        fit = calibrate_by_edges(self.dataset.field, some, [start], {}, StartTrials())
        if isinstance(fit, NotCalibrated) or len(fit.unknowns) < _MIN_SAMPLES:
            return []
        tilt_std, _, height_std, focal_std, *_ = np.sqrt(np.diag(fit.covariance)).tolist()
        focal_px, height_m, tilt_rad = fit.camera.focal_px[0], fit.camera.height_m, fit.camera.tilt_rad or 0.0
        evidence = (
            f"by {len(fit.unknowns)} images the focal length is {focal_px:.1f} +- {focal_std * focal_px:.1f} px, "
            f"the height {height_m:.3f} +- {height_std:.3f} m, the tilt {math.degrees(tilt_rad):+.1f} +- "
            f"{math.degrees(tilt_std):.1f} degrees"
        )
        off = [
            name
            for name, difference, std, least in (
                ("focal_px", math.log(focal_px / camera.focal_px[0]), focal_std, _MAX_RANGE_ERROR),
                ("height_m", height_m - camera.height_m, math.hypot(height_std, camera.height_std_m), 0.0),
                ("tilt_rad", tilt_rad - camera.tilt_rad, tilt_std, 0.0),
            )
            if abs(difference) > max(_SIGNIFICANCE * std, least)
        ]
        if not off:
            return [Finding("lens", "ok", f"{evidence}, as the camera file says")]
        mend = "robocup-vision calibrate forward --start CAMERA corrects it"
        return [Finding("lens", "wrong", f"{evidence}; not so {', '.join(off)} of the camera file: {mend}")]

    def _check_colors(self) -> Finding:
        chosen = slice(None, None, -(-len(self.frames) // _MAX_TRIED))
        vision = make_vision(self.dataset, self.dataset.field, self.dataset.camera, learnt=True)
        learnt = _look(vision, self.frames[chosen], "colours")
        agreements = []
        for fixed, own in zip(self.views[chosen], learnt, strict=True):
            if fixed.marks.shape != own.marks.shape or not own.marks.any():
                continue
            a, b = fixed.marks > 0, own.marks > 0
            agreements.append(float((a & b).sum() / max((a | b).sum(), 1)))
        if not agreements:
            return Finding("colours", "unknown", "colours learnt from the images show no floor in them")
        alike = float(np.median(agreements))
        evidence = f"colour file and images agree on {100 * alike:.0f} % of the floor (median image)"
        if alike < _MIN_COLOR_AGREEMENT:
            return Finding("colours", "wrong", f"{evidence}: leave it out, or make a new one")
        return Finding("colours", "ok", evidence)


def _look(vision: Vision, frames: list[UInt8Array], label: str) -> Iterator[View]:
    for frame in progress(frames, len(frames), label):
        vision.forget()
        yield vision.look(frame)


def _agreement(views: list[View]) -> float:
    """Return the mean inlier ratio of the views' poses, 0 without a pose."""
    return float(np.mean([view.pose.inlier_ratio if isinstance(view.pose, PoseEstimate) else 0.0 for view in views]))
