"""Whether pictures determine a mirror camera, and which frames a playing robot would locate where the fit puts them.

Lines among clutter can be fitted by a wrong camera, with the robot in a wrong place. `confirmed` therefore asks a
localiser, which demands more of a frame than the fit does: lines that should be in plain sight, and next to no line
points on bare carpet. `Trust` refuses a fit where another camera would explain the pictures as well.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.calibration.omni.fit import Fit, Points
from robocup_vision.calibration.omni.model import CENTER, HORIZON, SCALE, CameraModel
from robocup_vision.calibration.omni.result import range_std
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.calibration.omni.sightings import Observer, Sighting
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.lines.line_map import LineMap


def confirmed(
    field: Field,
    frames: Sequence[UInt8Array],
    fit: Fit,
    sightings: Sequence[Sighting],
    mask: UInt8Array | None = None,
    settings: OmniCalibrationSettings = OmniCalibrationSettings(),
) -> tuple[list[Sighting], dict[int, str]]:
    """Look at the frames of a fit by its camera.

    Parameters
    ----------
    frames : sequence of (H, W, 3) uint8
        All frames, of which the sightings' indices speak.
    fit : Fit
        Camera, and the pose of each sighting.
    mask : (H, W) uint8, optional
        Pixels where it is not zero are not used.
    settings : OmniCalibrationSettings, optional
        Its `max_confirmed_radii` and `points` are used.

    Returns
    -------
    list of Sighting
        Those in whose frames the robot finds itself where the fit puts it, with the fit's poses.
    dict of int to str
        Why each other frame, by its index, was not confirmed.
    """
    observer = Observer(field, fit.model.written(fit.vector), mask, locate=True, settings=settings.points)
    max_m = settings.max_confirmed_radii * field.robot_radius_m
    kept, notes = [], {}
    for sighting, array in zip(sightings, fit.poses, strict=True):
        pose = Pose2(*array.tolist())
        seen = observer.look(sighting.index, frames[sighting.index]).pose
        if seen is None:
            notes[sighting.index] = "by the camera found, the robot does not find itself in it"
        elif seen.error_to(pose, symmetric=not field.halves_differ)[0] > max_m:
            notes[sighting.index] = "by the camera found, the robot is somewhere else"
        else:
            kept.append(dataclasses.replace(sighting, pose=pose))
    return kept, notes


MORE = "give more frames, from other places and headings"


@dataclass(frozen=True, eq=False)
class Trust:
    """Says why a fit cannot be trusted."""

    field: Field
    line_map: LineMap
    started: bool  #: whether there was a start
    unit_px: float  #: pixels of one unit of the weights' widths
    settings: OmniCalibrationSettings = OmniCalibrationSettings()  #: its limits are used

    def problem(self, fit: Fit, covariance: FloatArray, points: Points, model: CameraModel) -> str:
        """Return why a fit cannot be trusted; empty if it can.

        Parameters
        ----------
        model : CameraModel
            The family that the search began with; its `frame` is the start.
        """
        settings = self.settings
        agrees = np.abs(fit.residual_px) < settings.agreement * self.unit_px
        ratio = float(points.weight[agrees].sum() / points.weight.sum())
        if ratio < settings.min_inlier_ratio:
            return f"only {ratio:.0%} of the points found lie on the walls and lines of field '{self.field.name}'"
        is_free = not self.started and not self.field.is_bounded
        if is_free and self._features(fit, points, agrees) < settings.min_features:
            return "the few lines in view look alike at any size; give more frames, from other places, or a start"
        problem = "" if self.field.is_bounded else self._unsure_of_lines(fit, covariance, points, agrees)
        if problem:
            return problem
        side = min(fit.camera.size_px)
        std = np.sqrt(np.diag(covariance))
        if std[CENTER].max() > settings.max_center_std_ratio * side:
            return (
                f"the images do not determine the centre: its standard deviation is {std[CENTER].max():.1f} px; {MORE}"
            )
        if std[SCALE : HORIZON + 1].max() > settings.max_curve_std:
            worst = 100 * std[SCALE : HORIZON + 1].max()
            return f"the images do not determine the mirror's curve: its standard deviation is {worst:.0f} %; {MORE}"
        center_px = settings.max_center_ratio * side
        low, high = fit.model.bounds(fit.model.vector(model.frame), center_px, *settings.max_log_curve)
        off = np.minimum(fit.vector - low, high - fit.vector)
        if off[CENTER].min() < 1e-6:
            limit = f"{center_px:.0f} px from the start's"
            return f"the centre reached its limit, {limit}: are camera file and field those of the images?"
        if self.started and off[SCALE : HORIZON + 1].min() < 1e-6:
            return "the curve reached the limit that the start sets" + "; try without a start" * self.field.is_bounded
        return ""

    def range_note(self, fit: Fit, covariance: FloatArray, as_good: Sequence[OmniCamera] = ()) -> str:
        """Return how well the floor's range is known, near and far; by cameras that explain the images as well, too."""
        known = self._known(self._range_std(fit, covariance))
        if not as_good:
            return f"its standard deviation is {known}"
        together = self._known(self._range_std(fit, covariance, as_good))
        return f"its standard deviation is {known} by this curve; {together} with others that explain as much"

    def _known(self, std: FloatArray) -> str:
        near_to_far = zip(std, self._range_m, strict=True)
        return ", ".join(f"{100 * one:.1f} % at {at:.2g} m" for one, at in near_to_far if one >= 0)

    @property
    def _range_m(self) -> FloatArray:
        return np.array(self.settings.range_radii) * self.field.robot_radius_m

    def _range_std(self, fit: Fit, covariance: FloatArray, as_good: Sequence[OmniCamera] = ()) -> FloatArray:
        return range_std(fit, covariance, fit.camera.floor_range.radius_px(1.0 / self._range_m), as_good)

    def _unsure_of_lines(self, fit: Fit, covariance: FloatArray, points: Points, agrees: npt.NDArray[np.bool_]) -> str:
        """Return why lines alone do not determine a camera; empty if they do."""
        settings = self.settings
        features = self._features(fit, points, agrees)
        single, unknown = len(fit.poses) == 1, not self.started
        if single and features < (settings.min_single_features if unknown else settings.min_started_features):
            return f"one image of so few lines does not determine a camera: lines lie where they were painted; {MORE}"
        few = single and features <= settings.min_started_features
        height_m, highest_m = fit.camera.height_m or 0.0, settings.max_height_radii * self.field.robot_radius_m
        if few and unknown and height_m > highest_m:
            # a field of like shape and other size is explained by a higher mirror
            return (
                f"the curve is that of a mirror {height_m:.2f} m high, more than robots are: is field "
                f"'{self.field.name}' that of the image? {MORE}, or a start"
            )
        off_m = float(np.hypot(*fit.camera.tilt_rad)) * height_m
        if off_m > settings.model.max_tilt_rad * highest_m:
            return (
                f"the tilt found puts the mirror's axis {100 * off_m:.0f} cm beside the robot's place: give a start "
                f"with viewpoint_height_m, or {MORE.removeprefix('give ')}"
            )
        limit = settings.max_range_std if few or unknown else settings.max_started_range_std
        if np.nanmax(self._range_std(fit, covariance)) > limit:
            return f"the images do not determine the floor's range: {self.range_note(fit, covariance)}; {MORE}"
        return ""

    def _features(self, fit: Fit, points: Points, agrees: npt.NDArray[np.bool_]) -> int:
        """Count the field's lines and arcs that have enough points on them."""
        floor_m = fit.camera.pixel_to_floor(points.pixels[agrees])
        frame = points.frame[agrees]
        count = np.zeros(len(self.field.lines) + len(self.field.arcs), dtype=np.int64)
        for place, pose in enumerate(fit.poses):
            on_field = Pose2(*pose.tolist()).transform(floor_m[frame == place])
            on_field = on_field[np.isfinite(on_field).all(axis=1)]
            count += np.bincount(self.line_map.nearest(on_field).index, minlength=len(count))
        least = max(self.settings.min_feature_points, self.settings.min_feature_ratio * count.sum())
        return int(np.count_nonzero(count >= least))
