"""Finds a pinhole camera whose tilt nobody knows, by the lines of one frame.

The carpet's lines bound the tilt: a line's width in the picture limits its distance below the horizon, and the horizon
lies above all lines. Between these bounds banks of poses are scored for each tilt. The likeliest poses are aligned with
the lines with tilt and roll as unknowns, then fitted and accepted as in `EdgeFinder`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import UPRIGHT_STD_RAD, Mounting, PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.bands import line_bands
from robocup_vision.kernels.model_edges.carpet import LIT_CARPET, carpet_look, carpet_marks
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.localization.model_edges.finder import Clues, CluesAt, EdgeFinder, FinderSettings, TiltedPose
from robocup_vision.localization.model_edges.follower import EdgeFollower, FollowedCamera
from robocup_vision.localization.model_edges.settings import EdgeSettings

# distance beyond the outer lines from which no line is the field's
_BEYOND_M = 0.3


@dataclass(frozen=True, slots=True)
class TiltSettings:
    """How a camera of unknown tilt is found. Settings were chosen on rendered frames of white goals."""

    #: the carpet's colour is learnt below this fraction of the frame: a camera that looks up sees floor only there
    carpet_top: float = 0.4
    #: stride of the columns and rows that are read for bands, and the widest band, as fractions of the picture's width
    stride_ratio: float = 0.025
    widest_ratio: float = 0.1
    #: least step of a line, as a fraction of the usual one
    step_ratio: float = 0.25
    min_bands: int = 16
    #: least fraction of carpet in a row where it reaches across the frame
    min_carpet_ratio: float = 0.5
    #: fraction of the bands that may not be lines, and greatest ratio of a line's width to the painted one
    strays: float = 0.1
    slack: float = 1.4
    #: step between the banks' tilts, and their range
    step_rad: float = 0.03
    range_rad: tuple[float, float] = (-0.9, 0.35)
    #: numbers of each bank's poses that are scored in full, and aligned with the lines
    scored: int = 400
    aligned: int = 24
    #: standard deviations of tilt and roll about a bank's in aligning, and about the aligned ones in the fit
    bank_std_rad: tuple[float, float] = (0.03, 0.04)
    fit_std_rad: float = 0.015
    #: factor on these deviations, and on those of a proposed place, about the result of a fit
    settling_ratio: float = 0.3
    #: prior of the tilt
    tilt_std_rad: float = 0.5
    #: a neck that nods moves the camera up and down
    height_std_m: float = 0.03


class TiltFinder(EdgeFinder):
    """Proposes poses and tilts by the lines of a frame.

    The camera's own tilt is not used.
    """

    def __init__(self, field: Field, camera: PinholeCamera, settings: TiltSettings = TiltSettings()) -> None:
        self._tilts = settings
        self._nearness = 1.0
        self._file_camera = camera
        level = replace(
            camera,
            offset_m=(0.0, 0.0),
            pan_rad=0.0,
            tilt_rad=0.0,
            roll_rad=0.0,
            roll_std_rad=settings.fit_std_rad,
            height_std_m=max(camera.height_std_m, settings.height_std_m),
        )
        # one frame must decide: all samples count
        edges = EdgeSettings(in_sun_and_shade=True, ample_samples=math.inf, lines_end_m=_BEYOND_M)
        how = FinderSettings(scored=settings.scored, aligned=settings.aligned)
        super().__init__(EdgeFollower(field, level, edges), how)
        self._bands = np.zeros((600, 4))
        focal = math.sqrt(camera.focal_px[0] * camera.focal_px[1])
        roll_std = UPRIGHT_STD_RAD if camera.roll_std_rad is None else camera.roll_std_rad
        self._known_std = np.array(
            [settings.tilt_std_rad, roll_std, level.height_std_m, max(camera.focal_std_px / focal, 1e-6)]
        )

    @property
    def _rest_rad(self) -> tuple[float, float]:
        return 0.0, self._file_camera.roll_rad or 0.0

    @property
    def _rest_std_rad(self) -> tuple[float, float]:
        tilt_std, roll_std = self._known_std[:2].tolist()
        return tilt_std, roll_std

    @property
    def _near_tilt_roll_rad(self) -> tuple[float, float]:
        return self._tilts.bank_std_rad

    def _searches(self, frame: UInt8Array) -> Iterator[tuple[CluesAt, FloatArray]]:
        # each frame stands alone
        self.follower.forget_paint()
        top = self._carpet_top(frame)
        bands = self._line_bands(frame, top)
        clues = Clues(np.ascontiguousarray(bands[:, :3]), np.zeros((0, 3)), self._sightings[:0])
        tilts = np.empty(0)
        if len(bands) >= self._tilts.min_bands:
            lowest, highest = self._tilt_bounds(bands, top)
            count = max(math.ceil((highest - lowest) / self._tilts.step_rad), 1)
            tilts = lowest + (np.arange(count) + 0.5) * (highest - lowest) / count
        yield (lambda _: clues), tilts

    def _carpet_top(self, frame: UInt8Array) -> int:
        """Return the row down to which less than half of each row is carpet: the horizon is not below it."""
        tilts, height = self._tilts, frame.shape[0]
        carpet = np.zeros(LIT_CARPET)
        carpet_look(frame, int(tilts.carpet_top * height), carpet)
        stride = max(round(tilts.stride_ratio * frame.shape[1]) // 2, 1)
        carpet_ratios = carpet_marks(frame, carpet, stride, stride).mean(axis=1)
        bare = np.flatnonzero(carpet_ratios < tilts.min_carpet_ratio)
        return stride * int(bare[-1] + 1) if len(bare) and bare[-1] + 1 < len(carpet_ratios) else 0

    def _line_bands(self, frame: UInt8Array, top: int) -> FloatArray:
        """(N, 4) float64: see `line_bands`; the carpet's colour is that below row `top`."""
        tilts, follower = self._tilts, self.follower
        carpet, width = np.zeros(LIT_CARPET), frame.shape[1]
        carpet_look(frame, top, carpet)
        usual = float(follower.edges.channels[0, 3]) * brightness(carpet)
        step = max(tilts.step_ratio * usual, 5 * float(carpet[3]))
        stride = max(round(tilts.stride_ratio * width), 2)
        count = line_bands(frame, carpet, step, round(tilts.widest_ratio * width), stride, self._bands)
        return self._bands[:count]

    def _tilt_bounds(self, bands: FloatArray, top: int) -> tuple[float, float]:
        """Return the least and greatest tilt at which these bands are lines, on a carpet up to row `top` at least."""
        tilts, camera = self._tilts, self.follower.camera
        (fu, fv), (cu, cv) = camera.focal_px, camera.center_px
        aside = (bands[:, 0] - cu) / fu
        wide = tilts.slack * bands[:, 3] * camera.height_m / self.follower.numbers.line_width_m
        # a line is seen at its narrowest where a row or a column crosses it at a right angle on the floor
        below = np.where(bands[:, 2] > 0, wide * fv / fu, np.sqrt(wide * fv * np.sqrt(1.0 + aside**2)))
        row = float(np.quantile(bands[:, 1] - below, 1.0 - tilts.strays))
        low, high = (math.atan((one - cv) / fv) for one in (min(row, top), top))
        return max(low, tilts.range_rad[0]), min(max(high, low + tilts.step_rad), tilts.range_rad[1])

    def _end(self, answer: FollowedCamera) -> Pose2:
        pose = super()._end(answer)
        return TiltedPose(pose.x_m, pose.y_m, pose.theta_rad, *self.follower.tilt_roll_rad)

    def _settle(self, frame: UInt8Array, pose: Pose2) -> FollowedCamera | NotLocated:
        # the result of a fit is near: a shorter search does not take neighbouring edges for its own
        self._nearness = self._tilts.settling_ratio
        answer = super()._settle(frame, pose)
        self._nearness = 1.0
        if not answer:
            return answer
        # neither is the tilt at which the last fit began evidence
        return replace(answer, likelihood=self.follower.likelihood_under(self._known_std)).without_prior()

    def _fit(self, frame: UInt8Array, pose: Pose2) -> FollowedCamera | NotLocated:
        s, near = self.settings, self._nearness
        if isinstance(pose, TiltedPose):
            std = near * self._tilts.fit_std_rad
            mounting = Mounting(tilt_rad=pose.tilt_rad, roll_rad=pose.roll_rad, tilt_std_rad=std, roll_std_rad=std)
            self.follower.hold(self.follower.camera.held(mounting))
            self.follower.forget()
        covariance = np.diag([near * s.std_m, near * s.std_m, near * s.std_rad]) ** 2
        return self.follower.follow(frame, PoseEstimate(pose, covariance, 1.0, 0.0), modes=1, is_proposal=True)
