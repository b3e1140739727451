"""Settings of a mirror camera's calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Usable image radius at which one "unit" of a residual is a pixel: that of the 256 x 220 image of Sekimori et al.
#: (2001). A unit grows in proportion to the usable radius, and is at least a pixel.
REFERENCE_RADIUS_PX = 86.0


@dataclass(frozen=True, slots=True)
class CameraModelSettings:
    """Prior and bounds of a camera's parameters, and the form of its curve."""

    #: number of nodes of a table's stretch, evenly spaced over the usable radii: errors of a mirror's polish are smooth
    bends: int = 6
    #: number of rows of a written table: linear interpolation is then accurate to a hundredth of a pixel
    table_rows: int = 64
    #: greatest range of a written table, in viewpoint heights: a pixel or two before the horizon
    farthest_heights: float = 40.0
    #: bounds of a hyperboloid's sqrt(C), in horizon radii: at the upper one it is practically a paraboloid
    root_over_horizon: tuple[float, float] = (0.3, 30.0)
    center_std_ratio: float = 0.05  #: prior standard deviation of the centre, relative to the image's smaller side
    tilt_std_rad: float = math.radians(1.5)  #: that of the tilt about either axis: mounts are level to a degree or two
    curve_std: float = 0.3  #: that of the logarithms of scale and horizon: the difference between robots
    #: factor by which a start's table is extended in radius, because its centre may be wrong
    prolonged: float = 1.1
    shape_std: float = 0.5  #: that of the logarithm of a hyperboloid's sqrt(C)/H
    bend_std: float = 0.02  #: that of a table's stretches
    #: bound of the tilt about either axis, beyond that of intact mounts
    max_tilt_rad: float = math.radians(6.0)
    max_bend: float = 0.08  #: bound of a table's stretches: larger ones need another base curve


@dataclass(frozen=True, slots=True)
class JointFitSettings:
    """Settings of the joint fit of camera and poses."""

    #: bounds of one iteration's step, within which the linearisation holds: centre, tilt, logarithms of the curve,
    #: poses (metres and radians)
    max_center_step_px: float = 4.0
    max_tilt_step_rad: float = 0.02
    max_log_step: float = 0.08
    max_pose_step: float = 0.15
    #: greatest range of a line point, in diagonals of the field; farther points are outside the field
    max_line_diagonals: float = 1.5
    #: number of neighbouring points that count as one measurement, because their errors are correlated
    points_per_measurement: float = 3.0
    min_noise_px: float = 0.15  #: least noise of a point: that of edge detection
    sectors: int = 16  #: sectors of the image, whose points form a group with correlated errors in the covariance
    #: standard deviation of the painted place of a line's ends, in line widths, for lines painted by hand
    paint_std_widths: float = 0.3


@dataclass(frozen=True, slots=True)
class StartSettings:
    """Settings of the search for starts; for "units" see `REFERENCE_RADIUS_PX`."""

    #: tested horizons, as factors of the start's; without a start, of the outer usable radius
    horizons: tuple[float, ...] = (0.78, 0.88, 1.0, 1.13, 1.28)
    unknown_horizons: tuple[float, ...] = (0.75, 0.88, 1.02, 1.2, 1.45, 1.8)
    #: the same if the start's own table is stretched: its kinks determine the image's size
    own_horizons: tuple[float, ...] = (0.93, 1.0, 1.07)
    #: tested scales, as factors of the start's or a guess
    scales: tuple[float, ...] = (0.8, 1.0, 1.25)
    #: number of frames by which starts are compared, and the number of them used first
    frames: int = 6
    first_frames: int = 2
    #: residual scales of the robust loss in the short and in the long fits, in units, decreasing to the points' noise
    short_scales: tuple[float, ...] = (12.0, 6.0, 3.0)
    long_scales: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0)
    short_points: int = 120  #: number of points of a frame in a short fit
    #: number of curves kept after the first frames, and kept for the long fit
    curves_kept: int = 8
    kept: int = 4


@dataclass(frozen=True, slots=True)
class ChoiceSettings:
    """Settings of the choice among families of curves."""

    sectors: int = 12  #: sectors of the image about the camera's centre; every other one is held out
    scales: tuple[float, ...] = (2.0, 1.0)  #: residual scales of the loss before the last one, in units
    scale_px: float = 1.0  #: residual scale of the loss by which families are compared: a few times the points' noise
    #: least gain on held-out points, in standard errors, for a family with more parameters
    min_gain_stds: float = 2.0
    min_tilt_chi2: float = 13.8  #: chi-square of a significant tilt: 2 degrees of freedom, 99.9 %


@dataclass(frozen=True, slots=True)
class FramePointSettings:
    """Selection of frames and points."""

    #: least number of points of either kind in a frame; fewer do not determine its pose
    min_boundary_points: int = 25
    min_line_points: int = 40
    max_line_points: int = 500  #: greatest number of line points; more are thinned out, as neighbours are redundant
    #: the usable image begins at the radius at which floor fills this ratio of its maximum over all radii; the robot's
    #: body is closer
    min_floor_ratio: float = 0.9


@dataclass(frozen=True, slots=True)
class OmniCalibrationSettings:
    """Settings of a mirror camera's calibration; for "units" see `REFERENCE_RADIUS_PX`."""

    #: settings of its steps
    model: CameraModelSettings = CameraModelSettings()
    fit: JointFitSettings = JointFitSettings()
    starts: StartSettings = StartSettings()
    choice: ChoiceSettings = ChoiceSettings()
    points: FramePointSettings = FramePointSettings()
    #: greatest change of the centre, relative to the image's smaller side: the error of a hand-made camera file
    max_center_ratio: float = 0.1
    #: greatest changes of the logarithms of scale and horizon: of a tangent, 35 % in each of a and b; without a start
    #: any curve is possible
    max_log_curve: tuple[float, float] = (0.7, 0.4)
    max_unknown_log_curve: tuple[float, float] = (2.0, 2.0)
    #: inner usable radius of a guessed camera, relative to the image's smaller side: the robot's body is inside
    guessed_inner_ratio: float = 0.09
    guessed_horizon: float = 1.15  #: its horizon, relative to the outer usable radius
    #: floor range at half the radius, in robot radii, one guess each, which determines the expected width of lines.
    #: Mirrors are designed for the robot, independent of the field's size.
    guessed_ranges: tuple[float, ...] = (2.16, 3.6, 6.0, 9.6)
    #: the same for a field with walls, relative to the field's length
    guessed_walled_range: float = 0.09
    farthest_diagonals: float = 1.1  #: greatest useful floor range without a start, in diagonals of the field
    agreement: float = 2.0  #: greatest residual of an inlier, in units
    #: residual scales of the two fits to points measured with the first fit's camera, in units
    refit_scales: tuple[float, ...] = (4.0, 2.0)
    last_scales: tuple[float, ...] = (2.0,)
    #: least inlier ratio of all points, and of one frame's points
    min_inlier_ratio: float = 0.4
    min_frame_inlier_ratio: float = 0.3
    min_kept_ratio: float = 0.5  #: least ratio of the frames with enough points that are kept in the end
    #: least number of visible lines and arcs without walls and without a start: one circle with a line has no scale
    min_features: int = 4
    #: least number of points on a visible line, and their least ratio among all inliers
    min_feature_points: int = 12
    min_feature_ratio: float = 0.02
    #: the same for a single frame without walls: a line determines two numbers, and nine are unknown (centre, tilt, two
    #: of the curve, and the pose). With a start only cameras near it are searched, and other cameras may explain the
    #: lines as well, so more lines are needed.
    min_single_features: int = 5
    min_started_features: int = 8
    #: without walls: greatest height of a robot, in radii, by the middle-size league's rules. It limits the distance
    #: of the mirror's axis from the robot's place by a tilt, and the mirror's height from one image of few lines.
    max_height_radii: float = 3.2
    #: greatest standard deviations of a result: centre, relative to the image's smaller side; curve, relative
    max_center_std_ratio: float = 0.015
    max_curve_std: float = 0.04
    #: without walls: ranges, in robot radii, that must be determined
    range_radii: tuple[float, ...] = (3.0, 6.0, 10.0)
    #: their greatest relative standard deviations: 8 % is three times the first, and twice the second, which holds with
    #: a start that fits and several frames or more lines
    max_range_std: float = 0.0267
    max_started_range_std: float = 0.04
    #: without walls: greatest distance, in robot radii, between the pose located by the result and that of the fit
    max_confirmed_radii: float = 1.0
    max_cost: float = 0.75  #: greatest cost (0 to 1) of an acceptable first fit
    #: greatest cost of another first fit that is refined, relative to the best one's
    max_doubtful_ratio: float = 1.5
    #: greatest cost of a rival camera: factor of the best one's, and an offset
    max_rival_ratio: float = 1.15
    rival_excess: float = 0.02
    #: least difference of a rival's centre (relative to the image's smaller side), or of its curve (relative)
    min_rival_center_ratio: float = 0.03
    min_rival_curve: float = 0.1
    max_correlation: float = 0.9  #: correlation above which two numbers are reported as inseparable
