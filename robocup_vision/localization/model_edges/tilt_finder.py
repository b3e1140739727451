"""Finds a pinhole camera of unknown tilt by the lines of one frame.

The lines bound the tilt: a line's width in the picture limits its distance below the horizon, and the horizon lies
above all lines. Between these bounds a bank of poses is scored at several tilts. The likeliest poses are aligned with
the lines, with tilt and roll as unknowns, then fitted and accepted as in `EdgeFinder`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import UPRIGHT_STD_RAD, Mounting, PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.bands import line_bands
from robocup_vision.kernels.model_edges.carpet import LIT_CARPET, carpet_look, carpet_marks
from robocup_vision.kernels.model_edges.follow import brightness
from robocup_vision.localization.model_edges.finder import (
    PROPOSAL_STD_M,
    PROPOSAL_STD_RAD,
    Clues,
    CluesAt,
    EdgeFinder,
    FinderSettings,
    TiltedPose,
)
from robocup_vision.localization.model_edges.follower import EdgeFollower, FollowedCamera
from robocup_vision.localization.model_edges.settings import EdgeSettings

# distance beyond the outer lines from which no line is the field's
_BEYOND_M = 0.3
# the carpet's colour is learnt below this fraction of the frame's height: a camera that looks up sees floor only there
_CARPET_TOP = 0.4
# stride of the columns and rows that are read for bands, and the widest band, as fractions of the picture's width
_STRIDE_RATIO, _WIDEST_RATIO = 0.025, 0.1
_STEP_RATIO = 0.25  # least step of a line, as a fraction of the usual one
_MIN_BANDS = 16
_MIN_CARPET_RATIO = 0.5  # least fraction of carpet in a row where it reaches across the frame
# fraction of the bands that may not be lines, and greatest ratio of a line's width to the painted one
_STRAYS, _SLACK = 0.1, 1.4
# step between the banks' tilts, and their range
_STEP_RAD, _RANGE_RAD = 0.03, (-0.9, 0.35)
_BANK = FinderSettings(scored=400, aligned=24)  # many banks share the time
# standard deviations of tilt and roll about a bank's in the alignment, and about the aligned ones in the fit
_BANK_STD_RAD = (0.03, 0.04)
_FIT_STD_RAD = 0.015
# factor on the fit's standard deviations, and on those of a proposal, where a fit is repeated from its result
_SETTLING_RATIO = 0.3
_TILT_STD_RAD = 0.5  # prior of the tilt
_HEIGHT_STD_M = 0.03  # a neck that nods moves the camera up and down


class TiltFinder(EdgeFinder):
    """Proposes poses and tilts by the lines of a frame.

    The camera's own tilt is not used.
    """

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self._std_ratio = 1.0
        self._file_camera = camera
        level = replace(
            camera,
            offset_m=(0.0, 0.0),
            pan_rad=0.0,
            tilt_rad=0.0,
            roll_rad=0.0,
            roll_std_rad=_FIT_STD_RAD,
            height_std_m=max(camera.height_std_m, _HEIGHT_STD_M),
        )
        # one frame must decide, so all samples are used
        edges = EdgeSettings(in_sun_and_shade=True, ample_samples=math.inf, lines_end_m=_BEYOND_M)
        super().__init__(EdgeFollower(field, level, edges), _BANK)
        self._bands = np.zeros((600, 4))
        focal = math.sqrt(camera.focal_px[0] * camera.focal_px[1])
        roll_std = UPRIGHT_STD_RAD if camera.roll_std_rad is None else camera.roll_std_rad
        self._known_std = np.array(
            [_TILT_STD_RAD, roll_std, level.height_std_m, max(camera.focal_std_px / focal, 1e-6)]
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
        return _BANK_STD_RAD

    def _searches(self, frame: UInt8Array) -> Iterator[tuple[CluesAt, FloatArray]]:
        # nothing is learnt from earlier frames
        self.follower.forget_paint()
        top = self._carpet_top(frame)
        bands = self._line_bands(frame, top)
        clues = Clues(np.ascontiguousarray(bands[:, :3]), np.zeros((0, 3)), self._sightings[:0])
        tilts = np.empty(0)
        if len(bands) >= _MIN_BANDS:
            lowest, highest = self._tilt_bounds(bands, top)
            count = max(math.ceil((highest - lowest) / _STEP_RAD), 1)
            tilts = lowest + (np.arange(count) + 0.5) * (highest - lowest) / count
        yield (lambda _: clues), tilts

    def _carpet_top(self, frame: UInt8Array) -> int:
        """Return the row down to which less than half of each row is carpet: the horizon is not below it."""
        height = frame.shape[0]
        carpet = np.zeros(LIT_CARPET)
        carpet_look(frame, int(_CARPET_TOP * height), carpet)
        stride = max(round(_STRIDE_RATIO * frame.shape[1]) // 2, 1)
        carpet_ratios = carpet_marks(frame, carpet, stride, stride).mean(axis=1)
        bare = np.flatnonzero(carpet_ratios < _MIN_CARPET_RATIO)
        return stride * int(bare[-1] + 1) if len(bare) and bare[-1] + 1 < len(carpet_ratios) else 0

    def _line_bands(self, frame: UInt8Array, top: int) -> FloatArray:
        """Return bands (N, 4), see `line_bands`; the carpet's colour is learnt below row `top`."""
        follower = self.follower
        carpet, width = np.zeros(LIT_CARPET), frame.shape[1]
        carpet_look(frame, top, carpet)
        usual = float(follower.edges.channels[0, 3]) * brightness(carpet)
        step = max(_STEP_RATIO * usual, 5 * float(carpet[3]))
        stride = max(round(_STRIDE_RATIO * width), 2)
        count = line_bands(frame, carpet, step, round(_WIDEST_RATIO * width), stride, self._bands)
        return self._bands[:count]

    def _tilt_bounds(self, bands: FloatArray, top: int) -> tuple[float, float]:
        """Return the least and greatest tilt at which these bands may be lines on a carpet that reaches row `top`."""
        camera = self.follower.camera
        (fu, fv), (cu, cv) = camera.focal_px, camera.center_px
        aside = (bands[:, 0] - cu) / fu
        wide = _SLACK * bands[:, 3] * camera.height_m / self.follower.numbers.line_width_m
        # a line is seen at its narrowest where a row or a column crosses it at a right angle on the floor
        below = np.where(bands[:, 2] > 0, wide * fv / fu, np.sqrt(wide * fv * np.sqrt(1.0 + aside**2)))
        row = float(np.quantile(bands[:, 1] - below, 1.0 - _STRAYS))
        low, high = (math.atan((one - cv) / fv) for one in (min(row, top), top))
        return max(low, _RANGE_RAD[0]), min(max(high, low + _STEP_RAD), _RANGE_RAD[1])

    def _fitted_pose(self, answer: FollowedCamera) -> Pose2:
        pose = super()._fitted_pose(answer)
        return TiltedPose(pose.x_m, pose.y_m, pose.theta_rad, *self.follower.tilt_roll_rad)

    def _settle(self, frame: UInt8Array, pose: Pose2) -> FollowedCamera | NotLocated:
        # a fit is repeated from its result, so a shorter search suffices, which avoids neighbouring edges
        self._std_ratio = _SETTLING_RATIO
        answer = super()._settle(frame, pose)
        self._std_ratio = 1.0
        if not answer:
            return answer
        # the tilt at which the last fit started is no evidence, either
        return replace(answer, likelihood=self.follower.likelihood_under(self._known_std)).without_prior()

    def _fit(self, frame: UInt8Array, pose: Pose2) -> FollowedCamera | NotLocated:
        near = self._std_ratio
        if isinstance(pose, TiltedPose):
            std = near * _FIT_STD_RAD
            mounting = Mounting(tilt_rad=pose.tilt_rad, roll_rad=pose.roll_rad, tilt_std_rad=std, roll_std_rad=std)
            self.follower.hold(self.follower.camera.held(mounting))
            self.follower.forget()
        covariance = np.diag([near * PROPOSAL_STD_M, near * PROPOSAL_STD_M, near * PROPOSAL_STD_RAD]) ** 2
        return self.follower.follow(frame, PoseEstimate(pose, covariance, 1.0, 0.0), modes=1, is_proposal=True)
