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
    max_points: int = 80
    min_points: int = 40
    min_agreeing_ratio: float = 0.5
    alone_px: float = 0.3
    shared_px: float = 0.2
    sectors: int = 16
    gates_px: tuple[float, ...] = (8.0, 6.0, 4.0, 3.0, 2.0, 2.0)


@dataclass(frozen=True, slots=True)
class OnlineSettings:
    """Settings of `OnlineCalibration`.

    Parameters
    ----------
    max_center_px, max_tilt_rad : float
        Bounds of the centre's change in either coordinate, and of the tilt's (and roll's) about either axis: beyond
        them a mount is broken, not knocked.
    every_s : float
        Only a frame in so much time is used: neighbouring frames of a walking body err alike, and each costs a
        millisecond or two.
    same_place_m, same_heading_rad : float
        A frame from so near to one that has been used tells whether the camera has moved, and nothing else: it shows
        the same edges with the same errors.
    places : int
        So many places are remembered. Older ones count as new: light and what stands around have changed.
    min_inlier_ratio : float
        Frames whose pose fits worse are not used.
    min_step_px : float
        Smaller changes of where the camera puts the floor are not worth new tables.
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
    filter : ParameterFilterSettings
        Of the estimate over time.
    """

    max_center_px: float = 8.0
    max_tilt_rad: float = math.radians(2.5)
    every_s: float = 0.15
    same_place_m: float = 0.1
    same_heading_rad: float = math.radians(15.0)
    places: int = 60
    min_inlier_ratio: float = 0.3
    min_step_px: float = 0.1
    min_step_s: float = 0.3
    lost_s: float = 0.5
    tries: tuple[float, ...] = (1.5, -1.5, 2.5, -2.5)
    min_try_px: float = 1.5
    mirror: MirrorCalibrationSettings = MirrorCalibrationSettings()
    filter: ParameterFilterSettings = ParameterFilterSettings()

    def __post_init__(self) -> None:
        for name, value in (
            ("max_center_px", self.max_center_px),
            ("max_tilt_rad", self.max_tilt_rad),
            ("every_s", self.every_s),
        ):
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} must be positive, got {value}")
        if self.places < 1:
            raise ArgumentError(f"places must be at least 1, got {self.places}")
