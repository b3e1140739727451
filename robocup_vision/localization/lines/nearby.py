"""A pose from the few line points a forward camera has in view, where it is roughly known beforehand.

A line or two do not tell a pose from all others, and speckles of the carpet outnumber their points; but a prior says
where lines must show. Only points near those count, and along a lone line the prior's own uncertainty stays.

A camera low over the floor sees far lines just below the horizon, where half a degree of tilt is half a metre. A robot
that brakes nods by as much, and no mounting is measured better: tilt and roll are unknowns of every frame, too.
"""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.camera.projection import camera_rotation
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.localization.lines.fit import LineRows, LineRowsFit, fit_line_rows, pixel_residuals, stretches
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.localization.lines.search import INLIER_PX
from robocup_vision.perception.line_points import LinePoints

# of tilt and roll about what the camera file says, where it gives no `roll_std_rad`: robots nod and lean by half a
# degree
SWAY_STD_RAD = 0.01
# standard deviations of the prior within which a line is looked for; points this much nearer must agree
_GATE, _NARROWER = 2.5, 0.3
# starts, in standard deviations of heading and of tilt: a line is easily taken for its neighbour
_STARTS = (0.0, -1.5, 1.5)
_START_PX = 30.0
# an answer that is worse by so much, in chi-square, is out of the question
_RIVAL = 9.0
_GATE_NOISE_PX = 1.0
# what a whole stretch of line may be off: by what the file does not know of the lens, and by where it was painted
_LENS_PX, _PAINTED_TO_M = 0.5, 0.01
_MIN_POINTS, _MAX_POINTS = 30, 200
_MIN_INLIER_SHARE = 0.5
# 5 degrees of freedom, 99.9 %
_CONSISTENT = 20.5
_STEP_PX, _STEP_RAD = 0.5, 1e-5
# a point that a tilt puts above the horizon is so far off any line
_NOWHERE_PX = 1e6


def locate_nearby(
    points: LinePoints, line_map: LineMap, prior: PoseEstimate, camera: PinholeCamera
) -> tuple[PoseEstimate | NotLocated, PinholeCamera]:
    """Refine a prior by the line points near the lines that it predicts.

    Parameters
    ----------
    points : LinePoints
        As seen in one frame.
    line_map : LineMap
        Of the field.
    prior : PoseEstimate
        What is believed beforehand; its covariance counts.
    camera : PinholeCamera
        What took the frame. Its tilt and roll are refined with the pose, from where the file says they are, known to
        `roll_std_rad` or else `SWAY_STD_RAD`.

    Returns
    -------
    PoseEstimate or NotLocated
        The pose, its covariance including what tilt and roll leave open.
    PinholeCamera
        The camera as it is held in this frame; as it was, where not located.
    """
    sway = SWAY_STD_RAD if camera.roll_std_rad is None else max(camera.roll_std_rad, 1e-6)
    covariance = np.zeros((5, 5))
    covariance[:3, :3], covariance[3, 3], covariance[4, 4] = prior.covariance, sway**2, sway**2
    information = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    expected = np.append(prior.pose.array, [0.0, 0.0])
    rows = _SwayingView(camera, points, line_map).rows(expected)
    reach_px = _GATE * np.sqrt(np.einsum("ni,ij,nj->n", rows.jacobian, covariance, rows.jacobian))
    is_near = rows.residual <= np.hypot(reach_px, _GATE_NOISE_PX)
    near, reach_px = points.take(is_near), reach_px[is_near]
    if len(near) < _MIN_POINTS:
        return NotLocated(f"only {len(near)} line points near the lines that the prior predicts"), camera
    # they are in the picture's order, so that every so many of them cover all stretches of line alike
    some = np.arange(0, len(near), -(-len(near) // _MAX_POINTS))
    near, reach_px = near.take(some), reach_px[some]
    view = _SwayingView(camera, near, line_map)
    shared_px = _shared_px(view.rows(expected), near)
    found: list[tuple[float, LineRowsFit]] = []
    for turn, nod in itertools.product(_STARTS, _STARTS):
        start = expected + np.array([0.0, 0.0, turn * prior.std[2], nod * sway, 0.0])
        fit = fit_line_rows(
            view.rows, start, near.weight, information, _START_PX, expected=expected, shared_px=shared_px
        )
        if not isinstance(fit, NotLocated):
            off = fit.unknowns - expected
            found.append((fit.loss(near.weight, INLIER_PX) + float(off @ information @ off), fit))
    found.sort(key=lambda one: one[0])
    answers = [(loss - found[0][0], fit, fit.estimate(near.floor_m, near.weight)) for loss, fit in found]
    rivals = [(loss, fit, estimate) for loss, fit, estimate in answers if loss < _RIVAL and estimate]
    if not rivals or rivals[0][0] > 0:
        return NotLocated("the lines in view do not fix the pose"), camera
    _, best, _ = rivals[0]
    unknowns = best.unknowns
    closer = best.rows.residual <= np.hypot(_NARROWER * reach_px, _GATE_NOISE_PX)
    agree = best.rows.residual <= INLIER_PX
    share = float(near.weight[agree].sum() / near.weight[agree | closer].sum())
    if share < _MIN_INLIER_SHARE:
        return NotLocated(f"only {share:.0%} of the line points near the prior's lines agree on a pose"), camera
    offset = unknowns - expected
    offset[2] = wrap_angle(offset[2])
    if float(offset @ information @ offset) > _CONSISTENT:
        away, turn = math.hypot(offset[0], offset[1]), math.degrees(abs(offset[2]))
        return NotLocated(f"the lines lie {away:.2f} m and {turn:.0f} degrees off the prior"), camera
    tilt, roll = (camera.tilt_rad or 0.0) + float(unknowns[3]), (camera.roll_rad or 0.0) + float(unknowns[4])
    estimate = PoseEstimate(
        Pose2(*unknowns[:3].tolist()),
        _spread([(loss, fit.unknowns[:3], estimate.covariance) for loss, fit, estimate in rivals]),
        share,
        float(np.sqrt(np.mean(best.rows.residual[agree] ** 2))),
    )
    return estimate, camera.with_orientation(camera.pan_rad, tilt, roll)


def _spread(rivals: list[tuple[float, FloatArray, FloatArray]]) -> FloatArray:
    """Covariance (3, 3) about the first of several poses, each as likely as its loss (in chi-square) lets it be."""
    weight = np.exp([-loss / 2 for loss, _, _ in rivals])
    total = np.zeros((3, 3))
    for share, (_, pose, covariance) in zip(weight / weight.sum(), rivals, strict=True):
        off = pose - rivals[0][1]
        off[2] = wrap_angle(float(off[2]))
        total += share * (covariance + np.outer(off, off))
    return total


def _shared_px(rows: LineRows, points: LinePoints) -> FloatArray:
    """Tell what whole stretches of line may be off, (N,), as `fit_line_rows` takes it: by the lens, and as painted."""
    member = stretches(rows.index, points.floor_m)
    px_per_m = np.hypot(rows.jacobian[:, 0], rows.jacobian[:, 1])
    return np.asarray(np.hypot(_LENS_PX, _PAINTED_TO_M * px_per_m) * np.sqrt(np.bincount(member)[member]))


class _SwayingView:
    """Line points seen by a camera whose tilt and roll are not quite what its file says."""

    def __init__(self, camera: PinholeCamera, points: LinePoints, line_map: LineMap) -> None:
        self._camera = camera
        self._line_map = line_map
        around = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]) * _STEP_PX
        self._rays = camera.pixel_to_camera_ray(points.pixels[:, None] + around)

    def rows(self, unknowns: FloatArray) -> LineRows:
        """Measure the points from a pose with tilt and roll off by so much: unknowns (5,), derivatives (N, 5)."""
        tilt, roll = float(unknowns[3]), float(unknowns[4])
        around = self._floor_m(self._rays, tilt, roll)
        floor = around[:, 0]
        per_px = np.stack([around[:, 1] - around[:, 2], around[:, 3] - around[:, 4]], axis=-1) / (2 * _STEP_PX)
        by_tilt = (self._floor_m(self._rays[:, 0], tilt + _STEP_RAD, roll) - floor) / _STEP_RAD
        by_roll = (self._floor_m(self._rays[:, 0], tilt, roll + _STEP_RAD) - floor) / _STEP_RAD
        told = np.isfinite(around).all(axis=(1, 2)) & np.isfinite(by_tilt + by_roll).all(axis=1)
        shown: npt.NDArray[np.bool_] = np.asarray(told)
        of_pose = pixel_residuals(
            unknowns, np.where(shown[:, None], floor, 0.0), np.where(shown[:, None, None], per_px, 1.0), self._line_map
        )
        c, s = math.cos(unknowns[2]), math.sin(unknowns[2])
        across = of_pose.jacobian[:, :2] @ np.array([[c, -s], [s, c]])
        by_sway = np.stack([(across * by_tilt).sum(axis=1), (across * by_roll).sum(axis=1)], axis=1)
        jacobian = np.where(shown[:, None], np.hstack([of_pose.jacobian, by_sway]), 0.0)
        return LineRows(np.where(shown, of_pose.residual, _NOWHERE_PX), jacobian, of_pose.normal_px, of_pose.index)

    def _floor_m(self, rays: FloatArray, tilt_off_rad: float, roll_off_rad: float) -> FloatArray:
        """Floor points (..., 2), robot frame, of camera rays (..., 3); NaN from the horizon on."""
        camera = self._camera
        turned = (
            rays
            @ camera_rotation(
                camera.pan_rad or 0.0, (camera.tilt_rad or 0.0) + tilt_off_rad, (camera.roll_rad or 0.0) + roll_off_rad
            ).T
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = np.where(turned[..., 2] < -1e-3, -camera.height_m / turned[..., 2], np.nan)
        return np.asarray(camera.offset_m + turned[..., :2] * reach[..., None])
