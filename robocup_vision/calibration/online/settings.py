"""Settings of `OnlineCalibration`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.calibration.least_squares import Noise, Robust
from robocup_vision.calibration.online.parameter_filter import ParameterFilterSettings
from robocup_vision.checks import require_positive


@dataclass(frozen=True, slots=True)
class MirrorCalibrationSettings:
    """Settings for mirror cameras; pixels refer to an image 220 high."""

    #: standard deviations of a camera file's values, which it does not state: each coordinate of the centre, the tilt
    #: about either axis, and the logarithm of the curve's magnification
    center_std_px: float = 1.5
    tilt_std_rad: float = math.radians(0.3)
    curve_std: float = 0.02
    #: standard deviation of a body's lean, which limits the information of one frame about the tilt: half of the lean
    #: of robots on wheels in full braking. A greater value hides knocks, a smaller one takes leans for knocks.
    sway_std_rad: float = 0.005
    max_points: int = 80  #: greatest number of points of each kind in a frame; errors of neighbours are correlated
    #: noise of a single point, and common noise of the points of one sector and kind (the mirror's polish, the wall's
    #: foot, the paint's edge); gates, decreasing from the residuals of a wrong camera file to the points' noise; and
    #: least number of points to determine a pose
    robust: Robust = Robust(Noise(0.3, 0.2), (8.0, 6.0, 4.0, 3.0, 2.0, 2.0), 40, last_gate=4.0)


@dataclass(frozen=True, slots=True)
class PinholeCalibrationSettings:
    """Settings for pinhole cameras; pixels of the centre and of `reach_px` refer to an image 208 wide."""

    #: standard deviations of a camera file's values: logarithm of the focal length (without `focal_std_px` in the
    #: file), each coordinate of the centre, tilt and roll at rest, and the height at rest
    focal_std: float = 0.01
    center_std_px: float = 3.0
    tilt_std_rad: float = math.radians(0.5)
    height_std_m: float = 0.005
    #: standard deviation of a walking body's height, which limits the information of one frame
    sway_std_m: float = 0.004
    #: readout time of a picture if the file does not state it, that of a cheap sensor: a rotation during the readout
    #: shifts rows, which is noise common to the points of an edge. If the file states it (`RollingShutter`), the second
    #: value is the ratio of the rotation about the vertical that remains after straightening.
    readout_s: float = 0.02
    straightened_to: float = 0.1
    #: range of the search for an edge about its prediction: the error of a wrong lens at the picture's border
    reach_px: float = 5.0
    #: noise of a single sample, and common noise of the samples of an edge, as in the edge follower
    robust: Robust = Robust(Noise(0.15, 0.2), (4.0, 3.0, 2.5), 12)


@dataclass(frozen=True, slots=True)
class OnlineSettings:
    """Settings of `OnlineCalibration`."""

    #: bounds of the change of either coordinate of the centre (in pixels of an image 208 wide for a pinhole camera),
    #: and of tilt and roll; a greater change means a broken mount
    max_center_px: float = 12.0
    max_tilt_rad: float = math.radians(2.5)
    #: least time between used frames: errors of successive frames of a walking body are correlated, and each costs a
    #: millisecond or two
    every_s: float = 0.15
    min_inlier_ratio: float = 0.3  #: least inlier ratio of the pose of a used frame
    #: least change of the image of the floor for which new tables are made, and least change in the estimate's standard
    #: deviations, above its noise
    min_step_px: float = 0.1
    min_step_sigmas: float = 0.5
    min_step_s: float = 0.3  #: least time between new tables
    #: time without a pose after which other cameras within the uncertainty are tried in turn, because a very wrong
    #: camera file locates nothing, and provides no evidence
    lost_s: float = 0.5
    #: their deviations, in standard deviations of one parameter at a time
    tries: tuple[float, ...] = (1.5, -1.5, 2.5, -2.5)
    min_try_px: float = 1.5  #: least motion of the floor's image by a trial
    mirror: MirrorCalibrationSettings = MirrorCalibrationSettings()  #: settings for mirror cameras
    pinhole: PinholeCalibrationSettings = PinholeCalibrationSettings()  #: settings for pinhole cameras
    filter: ParameterFilterSettings = ParameterFilterSettings()  #: settings of the filter over time

    def __post_init__(self) -> None:
        require_positive(self, "max_center_px", "max_tilt_rad", "every_s")
