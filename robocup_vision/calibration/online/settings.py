"""Settings of `OnlineCalibration`, with why each is as it is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from field_models.errors import ArgumentError
from robocup_vision.calibration.online.parameter_filter import ParameterFilterSettings


@dataclass(frozen=True, slots=True)
class MirrorCalibrationSettings:
    """Of mirror cameras; pixels are those of an image 220 high.

    Parameters
    ----------
    center_std_px, tilt_std_rad, curve_std : float
        Standard deviations of what a camera file says: each coordinate of the centre, the tilt about either axis, and
        the logarithm of the curve's magnification. A mirror camera's file says none of them.
    sway_std_rad : float
        How far a body leans either way: what one frame shows of the tilt is no nearer to the mirror's own. Half of what
        full braking leans wheels by; a wider one hides knocks, a narrower one takes leans for knocks.
    max_points : int
        Points of each kind that are used of a frame: neighbours err together.
    min_points : int
        Points that a frame must show: fewer do not fix its pose.
    min_agreeing_ratio : float
        Of these, those that the fit must explain: more than other robots hide.
    alone_px, shared_px : float
        Noise of a point alone, and of what all points of one sector and kind have in common: the mirror's polish, the
        wall's foot, the paint's edge.
    sectors : int
        Sectors of the image whose points err together.
    gates_px : tuple of float
        Of the fit's steps: from what a wrong camera file does to a pose's residuals down to the points' noise.
    """

    center_std_px: float = 1.5
    tilt_std_rad: float = math.radians(0.3)
    curve_std: float = 0.02
    sway_std_rad: float = 0.005
    max_points: int = 80
    min_points: int = 40
    min_agreeing_ratio: float = 0.5
    alone_px: float = 0.3
    shared_px: float = 0.2
    sectors: int = 16
    gates_px: tuple[float, ...] = (8.0, 6.0, 4.0, 3.0, 2.0, 2.0)


@dataclass(frozen=True, slots=True)
class PinholeCalibrationSettings:
    """Of pinhole cameras; pixels of the centre and of `reach_px` are those of an image 208 wide, others of any image.

    Parameters
    ----------
    focal_std, center_std_px, tilt_std_rad, height_std_m : float
        Standard deviations of what a camera file says: logarithm of the focal length (where the file has no
        `focal_std_px`), each coordinate of the centre, tilt and roll at rest, and the height at rest.
    sway_std_rad, sway_std_m : float
        How far a body nods, rolls and rises about its rest with its steps: what one frame shows of tilt, roll and
        height is no nearer to them. A camera file's `roll_std_rad` counts where it is larger.
    readout_s, straightened_to : float
        Time from the first row to the last, as a cheap sensor takes, where the file does not say: while camera and body
        turn, what the rows show is apart by as much, and noise that the points of an edge share. Where the file says
        it (`RollingShutter`), so much of the turn about the upright is left after frames have been straightened.
    min_points : int
        Samples that a frame must show.
    min_agreeing_ratio : float
        Of the samples that an edge is found at, those that the fit must explain: more than other robots hide.
    reach_px : float
        How far from its prediction an edge is looked for: as far as a wrong lens leaves it at the picture's border.
    alone_px, shared_px : float
        Noise of a sample alone, and of what all samples of an edge have in common, as the follower has them.
    gates_px, last_gate : tuple of float, float
        Of the fit's steps; the last one in robust standard deviations.
    """

    focal_std: float = 0.01
    center_std_px: float = 3.0
    tilt_std_rad: float = math.radians(0.5)
    height_std_m: float = 0.005
    sway_std_rad: float = 0.02
    sway_std_m: float = 0.004
    readout_s: float = 0.02
    straightened_to: float = 0.1
    min_points: int = 12
    min_agreeing_ratio: float = 0.5
    reach_px: float = 5.0
    alone_px: float = 0.15
    shared_px: float = 0.2
    gates_px: tuple[float, ...] = (4.0, 3.0, 2.5)
    last_gate: float = 3.5


@dataclass(frozen=True, slots=True)
class OnlineSettings:
    """Settings of `OnlineCalibration`.

    Parameters
    ----------
    max_center_px, max_tilt_rad : float
        Bounds of the centre's change in either coordinate (pixels of a pinhole camera's image 208 wide), and of the
        tilt's and roll's: beyond them a mount is broken, not knocked.
    every_s : float
        Only a frame in so much time is used: neighbouring frames of a walking body err alike, and each costs a
        millisecond or two.
    min_inlier_ratio : float
        Frames whose pose fits worse are not used.
    min_step_px, min_step_sigmas : float
        Smaller changes of where the camera puts the floor are not worth new tables, nor smaller ones in the
        estimate's own standard deviations: they are noise.
    min_step_s : float
        Tables are not made more often than that.
    lost_s : float
        A robot that has not been located for so long tries other cameras within what is believed of its own, one after
        another: a camera file that is far off locates nothing, and teaches nothing.
    tries : tuple of float
        These, in standard deviations of one parameter at a time.
    min_try_px : float
        A try that moves the floor's image by less is none.
    mirror : MirrorCalibrationSettings
        Of mirror cameras.
    pinhole : PinholeCalibrationSettings
        Of pinhole cameras.
    filter : ParameterFilterSettings
        Of the estimate over time.
    """

    max_center_px: float = 12.0
    max_tilt_rad: float = math.radians(2.5)
    every_s: float = 0.15
    min_inlier_ratio: float = 0.3
    min_step_px: float = 0.1
    min_step_sigmas: float = 0.5
    min_step_s: float = 0.3
    lost_s: float = 0.5
    tries: tuple[float, ...] = (1.5, -1.5, 2.5, -2.5)
    min_try_px: float = 1.5
    mirror: MirrorCalibrationSettings = MirrorCalibrationSettings()
    pinhole: PinholeCalibrationSettings = PinholeCalibrationSettings()
    filter: ParameterFilterSettings = ParameterFilterSettings()

    def __post_init__(self) -> None:
        for name, value in (
            ("max_center_px", self.max_center_px),
            ("max_tilt_rad", self.max_tilt_rad),
            ("every_s", self.every_s),
        ):
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} must be positive, got {value}")
