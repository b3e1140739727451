"""A pose from the few line points a forward camera has in view, where it is roughly known beforehand.

A line or two do not tell a pose from all others, and speckles of the carpet outnumber their points; but a prior says
where lines must show. Only points near those count, and along a lone line the prior's own uncertainty stays.
"""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import wrap_angle
from robocup_vision.localization.line_map import LineMap
from robocup_vision.localization.lines import refine_by_lines
from robocup_vision.perception.line_points import LinePoints

# standard deviations of the prior within which a line is looked for
_GATE = 2.5
_LEAST_POINTS = 30
_LEAST_INLIER_SHARE = 0.5
# 3 degrees of freedom, 99.9 %
_CONSISTENT = 16.3


def locate_nearby(points: LinePoints, line_map: LineMap, prior: PoseEstimate) -> PoseEstimate | NotLocated:
    """Refine a prior by the line points near the lines that it predicts.

    Parameters
    ----------
    points : LinePoints
        As seen in one frame.
    line_map : LineMap
        Of the field.
    prior : PoseEstimate
        What is believed beforehand; its covariance counts.
    """
    distance_m = np.hypot(*points.floor_m.T)
    points = points.take(distance_m < float(np.hypot(*np.ptp(line_map.extent_m, 0))))
    distance_m = np.hypot(*points.floor_m.T)
    std = prior.std
    reach_m = _GATE * np.hypot(max(std[0], std[1]), distance_m * std[2])
    refined = prior
    # the second time only what the first answer leaves near its lines
    for share, start_px in ((1.0, 30.0), (0.3, 8.0)):
        off_m = line_map.nearest(refined.pose.transform(points.floor_m)).distance_m
        near = points.take(off_m <= share * reach_m)
        if len(near) < _LEAST_POINTS:
            return NotLocated(f"only {len(near)} line points near the lines that the prior predicts")
        answer = refine_by_lines(prior.pose, near, line_map, prior.covariance, start_px=start_px)
        if isinstance(answer, NotLocated):
            return answer
        refined = answer
    if refined.inlier_share < _LEAST_INLIER_SHARE:
        return NotLocated(f"only {refined.inlier_share:.0%} of the line points near the prior's lines agree on a pose")
    offset = refined.pose.array - prior.pose.array
    offset[2] = wrap_angle(offset[2])
    if float(offset @ np.linalg.solve(prior.covariance, offset)) > _CONSISTENT:
        away, turn = math.hypot(offset[0], offset[1]), math.degrees(abs(offset[2]))
        return NotLocated(f"the lines lie {away:.2f} m and {turn:.0f} degrees off the prior")
    return refined
