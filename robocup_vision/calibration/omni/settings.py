"""Limits within which a mirror camera's calibration is an answer."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class OmniCalibrationSettings:
    """Limits within which a mirror camera's calibration is an answer."""

    min_inlier_ratio: float = 0.4  #: least inlier ratio of all points
    #: greatest standard deviations of a result: centre, relative to the image's smaller side; curve, relative
    max_center_std_ratio: float = 0.015
    max_curve_std: float = 0.04
    #: least number of visible lines and arcs without walls and without a start: one circle with a line has no scale
    min_features: int = 4
    #: the same for a single frame without walls: a line determines two numbers, and nine are unknown (centre, tilt, two
    #: of the curve, and the pose). With a start only cameras near it are searched, and other cameras may explain the
    #: lines as well, so more lines are needed.
    min_single_features: int = 5
    min_started_features: int = 8
    #: without walls: greatest height of a robot, in radii, by the middle-size league's rules. It limits the distance
    #: of the mirror's axis from the robot's place by a tilt, and the mirror's height from one image of few lines.
    max_height_radii: float = 3.2
    #: without walls: greatest relative standard deviations of the floor's range: 8 % is three times the first, and
    #: twice the second, which holds with a start that fits and several frames or more lines
    max_range_std: float = 0.0267
    max_started_range_std: float = 0.04
    #: without walls: greatest distance, in robot radii, between the pose located by the result and that of the fit
    max_confirmed_radii: float = 1.0
