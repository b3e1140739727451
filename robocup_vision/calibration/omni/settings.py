"""Settings of a mirror camera's calibration, together, so that a benchmark can vary them."""

from __future__ import annotations

import math
from dataclasses import dataclass

#: Usable image radius of the picture in which one "unit" of a residual is a pixel: the 256 x 220 image of Sekimori et
#: al. (2001). In a larger picture a unit is as many pixels as its usable radius is larger; it is never below a pixel.
REFERENCE_RADIUS_PX = 86.0


@dataclass(frozen=True, slots=True)
class CameraModelSettings:
    """How far a camera may differ from its start, and how a curve is written."""

    #: nodes at which a table's curve is bent, evenly over the usable radii: a mirror's polish errs smoothly
    bends: int = 6
    #: rows of a written table: linear between them, the curve errs by less than a hundredth of a pixel
    table_rows: int = 64
    #: range at which a written table ends, in viewpoint heights: a pixel or two before the horizon
    farthest_heights: float = 40.0
    #: bounds of a hyperboloid's sqrt(C), in horizon radii: beyond the upper one it looks like a paraboloid
    root_over_horizon: tuple[float, float] = (0.3, 30.0)
    center_std_ratio: float = 0.05  #: standard deviation of the centre under the prior, of the image's smaller side
    tilt_std_rad: float = math.radians(1.5)  #: that of the tilt about either axis: a mount is level to a degree or two
    curve_std: float = 0.3  #: that of the logarithms of scale and horizon: a curve from another robot is off by a third
    #: factor by which a start's own table is extended in radius: its centre may be off
    prolonged: float = 1.1
    shape_std: float = 0.5  #: that of the logarithm of a hyperboloid's sqrt(C)/H
    bend_std: float = 0.02  #: that of a table's stretches
    #: bound of the tilt about either axis: beyond it the mount is bent, not tilted
    max_tilt_rad: float = math.radians(6.0)
    max_bend: float = 0.08  #: bound of a table's stretches: beyond it another curve should be the base


@dataclass(frozen=True, slots=True)
class JointFitSettings:
    """Settings of the joint fit of camera and poses."""

    #: bounds of one iteration's step: centre, tilt, logarithms of the curve, poses (metres and radians). The fit is
    #: linearised, and farther away it is not valid.
    max_center_step_px: float = 4.0
    max_tilt_step_rad: float = 0.02
    max_log_step: float = 0.08
    max_pose_step: float = 0.15
    #: largest range of a line point, in diagonals of the field: beyond it lies something else
    max_line_diagonals: float = 1.5
    #: number of neighbours along an edge that count as one measurement: their errors are correlated
    points_per_measurement: float = 3.0
    min_noise_px: float = 0.15  #: noise of a point, at least: the edge finder's own
    sectors: int = 16  #: sectors of the image whose points are taken to err together in the covariance
    #: standard deviation of where the ends of a line are painted, in line widths: a laboratory's lines are painted by
    #: hand
    paint_std_widths: float = 0.3


@dataclass(frozen=True, slots=True)
class StartSettings:
    """Settings of the search for starts; for "units" see `REFERENCE_RADIUS_PX`."""

    #: horizons that are tried, as factors of the start's; without a start, of the outer usable radius
    horizons: tuple[float, ...] = (0.78, 0.88, 1.0, 1.13, 1.28)
    unknown_horizons: tuple[float, ...] = (0.75, 0.88, 1.02, 1.2, 1.45, 1.8)
    #: the same where the start's own table is stretched: its kinks say how large the image is
    own_horizons: tuple[float, ...] = (0.93, 1.0, 1.07)
    #: scales that are tried: factors of the start's, or of a guess
    scales: tuple[float, ...] = (0.8, 1.0, 1.25)
    #: frames that starts are compared by, and how many of them are used first
    frames: int = 6
    first_frames: int = 2
    #: residual scales of the robust loss in the short fits and in the long ones, units: from far off down to the
    #: points' accuracy
    short_scales: tuple[float, ...] = (12.0, 6.0, 3.0)
    long_scales: tuple[float, ...] = (8.0, 4.0, 2.0, 1.0)
    short_points: int = 120  #: points of a frame that are enough for a short fit
    #: curves that go on from the first frames to all of them, and from there to the long fit
    curves_kept: int = 8
    kept: int = 4


@dataclass(frozen=True, slots=True)
class ChoiceSettings:
    """Settings of the choice among families of curves."""

    sectors: int = 12  #: sectors of the image about the camera's centre; points are held out by every other one
    scales: tuple[float, ...] = (2.0, 1.0)  #: residual scales of the loss before the last one, units
    scale_px: float = 1.0  #: residual scale of the loss by which families are compared: a few times the points' noise
    #: standard errors by which a family with more freedom must explain the held-out points better
    min_gain_stds: float = 2.0
    min_tilt_chi2: float = 13.8  #: chi-square of a tilt from which it is no chance: 2 degrees of freedom, 99.9 %


@dataclass(frozen=True, slots=True)
class FramePointSettings:
    """Which frames and points are used."""

    #: smallest number of points of either kind that a frame must show: fewer do not determine its pose
    min_boundary_points: int = 25
    min_line_points: int = 40
    max_line_points: int = 500  #: more line points than this are thinned out: they are neighbours of one another
    #: the usable image begins at the radius where floor fills this part of the most that it fills at any radius:
    #: nearer, the robot's body is in the way
    min_floor_ratio: float = 0.9


@dataclass(frozen=True, slots=True)
class OmniCalibrationSettings:
    """Settings of a mirror camera's calibration; for "units" see `REFERENCE_RADIUS_PX`."""

    #: settings of its parts
    model: CameraModelSettings = CameraModelSettings()
    fit: JointFitSettings = JointFitSettings()
    starts: StartSettings = StartSettings()
    choice: ChoiceSettings = ChoiceSettings()
    points: FramePointSettings = FramePointSettings()
    #: how far the centre may lie from the start's, of the image's smaller side: a hand-made camera file's error
    max_center_ratio: float = 0.1
    #: how far the logarithms of scale and horizon may lie from the start's: a tangent's a and b 35 % each; without a
    #: start the curve may be anything
    max_log_curve: tuple[float, float] = (0.7, 0.4)
    max_unknown_log_curve: tuple[float, float] = (2.0, 2.0)
    #: a guessed camera sees from here, of the image's smaller side: the robot's body is nearer
    guessed_inner_ratio: float = 0.09
    guessed_horizon: float = 1.15  #: its horizon, of the outer usable radius: outside all that is looked at
    #: floor range half-way out, in radii of the robot, one guess each: it says how wide lines look. Mirrors suit the
    #: robot, whatever the field's size.
    guessed_ranges: tuple[float, ...] = (2.16, 3.6, 6.0, 9.6)
    #: the same where walls bound the floor, of the field's length
    guessed_walled_range: float = 0.09
    farthest_diagonals: float = 1.1  #: farthest floor worth looking at, in diagonals of the field, without a start
    agreement: float = 2.0  #: largest residual of a point that agrees, units
    #: residual scales of the two fits to points that were found again by the first fit's camera, units
    refit_scales: tuple[float, ...] = (4.0, 2.0)
    last_scales: tuple[float, ...] = (2.0,)
    #: of all points, and of one frame's points, those that must agree
    min_inlier_ratio: float = 0.4
    min_frame_inlier_ratio: float = 0.3
    min_kept_ratio: float = 0.5  #: of the frames with enough points, those that must agree in the end
    #: lines and arcs that must be seen without walls and without a start: a circle and a line across it have no size
    min_features: int = 4
    #: smallest number of points on a line that counts as seen, and their smallest ratio among all that agree
    min_feature_points: int = 12
    min_feature_ratio: float = 0.02
    #: those of a single frame without walls: a line determines two numbers, and nine are unknown: centre, tilt, two of
    #: the curve, and the pose. With a start only cameras near it are searched, and another one may explain few lines as
    #: well: more lines must agree.
    min_single_features: int = 5
    min_started_features: int = 8
    #: without walls: a robot's height by the middle-size league's rules, in radii. No tilt may put the mirror's axis
    #: farther beside the robot's place than the largest tilt does at that height, and one image of few lines shows no
    #: higher mirror.
    max_height_radii: float = 3.2
    #: largest standard deviations of a result: centre, of the image's smaller side; curve, relative
    max_center_std_ratio: float = 0.015
    max_curve_std: float = 0.04
    #: without walls: ranges, in radii of the robot, that must be known
    range_radii: tuple[float, ...] = (3.0, 6.0, 10.0)
    #: their largest relative standard deviations: three are 8 percent. With a start that fits, and several frames or
    #: more lines than those, two.
    max_range_std: float = 0.0267
    max_started_range_std: float = 0.04
    #: without walls: a look by the camera found must put the robot this near to where the fit does, in its radii
    max_confirmed_radii: float = 1.0
    max_cost: float = 0.75  #: a first fit with a higher cost (0 to 1) explains next to nothing
    #: largest cost of another first fit that is followed to the end, relative to the best one's
    max_doubtful_ratio: float = 1.5
    #: largest cost of a rival camera: factor of the best one's, and an offset
    max_rival_ratio: float = 1.15
    rival_excess: float = 0.02
    #: a rival's centre lies this far away (of the image's smaller side), or its curve (relative)
    min_rival_center_ratio: float = 0.03
    min_rival_curve: float = 0.1
    max_correlation: float = 0.9  #: two numbers that correlate more than this are reported as inseparable
