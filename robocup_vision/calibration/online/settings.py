"""Settings of `OnlineCalibration`, with why each is as it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robocup_vision.calibration.least_squares import Noise, Robust
from robocup_vision.calibration.online.parameter_filter import ParameterFilterSettings
from robocup_vision.checks import require_positive


@dataclass(frozen=True, slots=True)
class MirrorCalibrationSettings:
    """Of mirror cameras; pixels are those of an image 220 high."""

    #: standard deviations of what a camera file says: each coordinate of the centre, the tilt about either axis, and
    #: the logarithm of the curve's magnification. A mirror camera's file says none of them.
    center_std_px: float = 1.5
    tilt_std_rad: float = math.radians(0.3)
    curve_std: float = 0.02
    #: how far a body leans either way: what one frame shows of the tilt is no nearer to the mirror's own. Half of what
    #: full braking leans wheels by; a wider one hides knocks, a narrower one takes leans for knocks.
    sway_std_rad: float = 0.005
    max_points: int = 80  #: points of each kind that are used of a frame: neighbours err together
    #: noise of a point alone, and of what all points of one sector and kind have in common: the mirror's polish, the
    #: wall's foot, the paint's edge; gates from what a wrong camera file does to a pose's residuals down to the points'
    #: noise; points that a frame must show: fewer do not fix its pose
    robust: Robust = Robust(Noise(0.3, 0.2), (8.0, 6.0, 4.0, 3.0, 2.0, 2.0), 40, last_gate=4.0)


@dataclass(frozen=True, slots=True)
class PinholeCalibrationSettings:
    """Of pinhole cameras; pixels of the centre and of `reach_px` are those of an image 208 wide, the rest of any."""

    #: standard deviations of what a camera file says: logarithm of the focal length (where the file has no
    #: `focal_std_px`), each coordinate of the centre, tilt and roll at rest, and the height at rest
    focal_std: float = 0.01
    center_std_px: float = 3.0
    tilt_std_rad: float = math.radians(0.5)
    height_std_m: float = 0.005
    #: how far a body nods, rolls and rises about its rest with its steps: what one frame shows of tilt, roll and height
    #: is no nearer to them. A camera file's `roll_std_rad` counts where it is larger.
    sway_std_rad: float = 0.02
    sway_std_m: float = 0.004
    #: time from the first row to the last, as a cheap sensor takes, where the file does not say: while camera and body
    #: turn, what the rows show is apart by as much, and noise that the points of an edge share. Where the file says it
    #: (`RollingShutter`), so much of the turn about the upright is left after frames have been straightened.
    readout_s: float = 0.02
    straightened_to: float = 0.1
    #: how far from its prediction an edge is looked for: as far as a wrong lens leaves it at the picture's border
    reach_px: float = 5.0
    #: noise of a sample alone, and of what all samples of an edge have in common, as the follower has them
    robust: Robust = Robust(Noise(0.15, 0.2), (4.0, 3.0, 2.5), 12)


@dataclass(frozen=True, slots=True)
class OnlineSettings:
    """Settings of `OnlineCalibration`."""

    #: bounds of the centre's change in either coordinate (pixels of a pinhole camera's image 208 wide), and of the
    #: tilt's and roll's: beyond them a mount is broken, not knocked
    max_center_px: float = 12.0
    max_tilt_rad: float = math.radians(2.5)
    #: only a frame in so much time is used: neighbouring frames of a walking body err alike, and each costs a
    #: millisecond or two
    every_s: float = 0.15
    min_inlier_ratio: float = 0.3  #: frames whose pose fits worse are not used
    #: smaller changes of where the camera puts the floor are not worth new tables, nor smaller ones in the estimate's
    #: own standard deviations: they are noise
    min_step_px: float = 0.1
    min_step_sigmas: float = 0.5
    min_step_s: float = 0.3  #: tables are not made more often than that
    #: a robot that has not been located for so long tries other cameras within what is believed of its own, one after
    #: another: a camera file that is far off locates nothing, and teaches nothing
    lost_s: float = 0.5
    tries: tuple[float, ...] = (1.5, -1.5, 2.5, -2.5)  #: these, in standard deviations of one parameter at a time
    min_try_px: float = 1.5  #: smallest motion of the floor's image by a try
    mirror: MirrorCalibrationSettings = MirrorCalibrationSettings()  #: of mirror cameras
    pinhole: PinholeCalibrationSettings = PinholeCalibrationSettings()  #: of pinhole cameras
    filter: ParameterFilterSettings = ParameterFilterSettings()  #: of the estimate over time

    def __post_init__(self) -> None:
        require_positive(self, "max_center_px", "max_tilt_rad", "every_s")
