"""A pose from the few line points a forward camera has in view, where it is roughly known beforehand.

A line or two do not determine a pose, and speckles of the carpet outnumber their points; but a prior predicts where
lines must show. Only points near those count, and along a lone line the prior's own uncertainty stays.

A camera low over the floor sees far lines just below the horizon, where half a degree of tilt is half a metre. A robot
that brakes nods by as much, and no mounting is measured better: tilt and roll are unknowns of every frame, too.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2, wrap_angle
from robocup_vision.kernels.lines.pose_fit import AROUND_PX, PointRows, SeenPoints
from robocup_vision.localization.lines.chance import nats_beyond_chance
from robocup_vision.localization.lines.fit import LineFitSettings, LineRowsFit, fit_line_points, measure, stretches
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LinePoints

# the pixel itself, and those beside it
_AROUND_PX = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]]) * AROUND_PX


@dataclass(frozen=True, slots=True)
class NearbySettings:
    """Settings of the refinement of a prior by line points.

    Parameters
    ----------
    sway_std_rad : float
        Of tilt and roll about those of the camera file, where it gives no `roll_std_rad`: robots nod and lean by half
        a degree.
    gate_stds, narrow_ratio : float, float
        Standard deviations of the prior within which a line is searched for; points nearer than this fraction of it
        must agree.
    gate_noise_px : float
        Noise of a point, added to that.
    starts_stds : tuple of float
        Starts in heading and in tilt, standard deviations: a line is easily taken for its neighbour.
    start_px : float
        Scale of the loss at the start.
    max_worse : float
        An answer worse by this much, in chi-square, is no rival.
    lens_px, paint_error_m : float, float
        What a whole stretch of line may be off: by the lens, beside what the file states, and by where it was painted.
    min_points, max_points : int
        Points near the predicted lines that are needed, and used.
    min_inlier_ratio : float
        Of the points near the predicted lines, those that must agree: on photographs of other things one in eight
        priors finds more than half, one in ninety more than this; on frames of a field 0.84 and more agree.
    min_nats_beyond_chance : float
        Of all line points on the carpet, wherever they lie, the log-likelihood ratio a point that the pose must have
        against points thrown anywhere: at most 0.07 for 39 poses of 2,400 priors on photographs of other things, at
        least 1.0 on photographs of a field.
    max_deviation : float
        Chi-square of the result's deviation from the prior: 5 degrees of freedom, 99.9 %.
    fit : LineFitSettings
        Of the fit itself.
    """

    sway_std_rad: float = 0.01
    gate_stds: float = 2.5
    narrow_ratio: float = 0.3
    gate_noise_px: float = 1.0
    starts_stds: tuple[float, ...] = (0.0, -1.5, 1.5)
    start_px: float = 30.0
    max_worse: float = 9.0
    lens_px: float = 0.5
    paint_error_m: float = 0.01
    min_points: int = 30
    max_points: int = 200
    min_inlier_ratio: float = 0.75
    min_nats_beyond_chance: float = 0.25
    max_deviation: float = 20.5
    fit: LineFitSettings = LineFitSettings()


def locate_nearby(
    points: LinePoints,
    line_map: LineMap,
    prior: PoseEstimate,
    camera: PinholeCamera,
    settings: NearbySettings = NearbySettings(),
) -> tuple[PoseEstimate | NotLocated, PinholeCamera]:
    """Refine a prior by the line points near the lines that it predicts.

    Parameters
    ----------
    points : LinePoints
        As seen in one frame.
    line_map : LineMap
        Of the field.
    prior : PoseEstimate
        Its covariance counts.
    camera : PinholeCamera
        What took the frame. Its tilt and roll are refined with the pose, from the file's values, with the standard
        deviation `roll_std_rad` or else that of `settings`.
    settings : NearbySettings, optional
        Of the refinement.

    Returns
    -------
    PoseEstimate or NotLocated
        The pose, its covariance including the uncertainty of tilt and roll.
    PinholeCamera
        The camera with the tilt and roll of this frame; unchanged where not located.
    """
    sway = settings.sway_std_rad if camera.roll_std_rad is None else max(camera.roll_std_rad, 1e-6)
    covariance = np.zeros((5, 5))
    covariance[:3, :3], covariance[3, 3], covariance[4, 4] = prior.covariance, sway**2, sway**2
    information = np.asarray(np.linalg.inv(covariance), dtype=np.float64)
    expected = np.append(prior.pose.array, [0.0, 0.0])
    rows = measure(expected, _as_swaying(camera, points, line_map), len(points))
    reach_px = settings.gate_stds * np.sqrt(np.einsum("ni,ij,nj->n", rows.jacobian, covariance, rows.jacobian))
    is_near = rows.residual <= np.hypot(reach_px, settings.gate_noise_px)
    near, reach_px = points.take(is_near), reach_px[is_near]
    if len(near) < settings.min_points:
        return NotLocated(f"only {len(near)} line points near the lines that the prior predicts"), camera
    # they are in the picture's order, so that every so many of them cover all stretches of line alike
    some = np.arange(0, len(near), -(-len(near) // settings.max_points))
    near, reach_px = near.take(some), reach_px[some]
    seen = _as_swaying(camera, near, line_map)
    shared_px = _shared_px(measure(expected, seen, len(near)), near, settings)
    found: list[tuple[float, LineRowsFit]] = []
    for turn, nod in itertools.product(settings.starts_stds, settings.starts_stds):
        start = expected + np.array([0.0, 0.0, turn * prior.std[2], nod * sway, 0.0])
        fit = fit_line_points(
            seen,
            start,
            near.weight,
            information,
            settings.start_px,
            expected=expected,
            shared_px=shared_px,
            settings=settings.fit,
        )
        if not isinstance(fit, NotLocated):
            off = fit.unknowns - expected
            found.append((fit.loss(near.weight, settings.fit.inlier_px) + float(off @ information @ off), fit))
    found.sort(key=lambda one: one[0])
    answers = [(loss - found[0][0], fit, fit.estimate(near.floor_m, near.weight)) for loss, fit in found]
    rivals = [(loss, fit, estimate) for loss, fit, estimate in answers if loss < settings.max_worse and estimate]
    if not rivals or rivals[0][0] > 0:
        return NotLocated("the lines in view do not fix the pose"), camera
    _, best, _ = rivals[0]
    unknowns = best.unknowns
    closer = best.rows.residual <= np.hypot(settings.narrow_ratio * reach_px, settings.gate_noise_px)
    agree = best.rows.residual <= settings.fit.inlier_px
    ratio = float(near.weight[agree].sum() / near.weight[agree | closer].sum())
    if ratio < settings.min_inlier_ratio:
        return NotLocated(f"only {ratio:.0%} of the line points near the prior's lines agree on a pose"), camera
    offset = unknowns - expected
    offset[2] = wrap_angle(offset[2])
    if float(offset @ information @ offset) > settings.max_deviation:
        away, turn = math.hypot(offset[0], offset[1]), math.degrees(abs(offset[2]))
        return NotLocated(f"the lines lie {away:.2f} m and {turn:.0f} degrees off the prior"), camera
    tilt, roll = (camera.tilt_rad or 0.0) + float(unknowns[3]), (camera.roll_rad or 0.0) + float(unknowns[4])
    pose, oriented = Pose2(*unknowns[:3].tolist()), camera.with_orientation(camera.pan_rad, tilt, roll)
    nats = nats_beyond_chance(points.pixels, pose, oriented, line_map, settings.fit.inlier_px)
    if nats < settings.min_nats_beyond_chance:
        return NotLocated(
            f"chance explains the {len(points)} line points in view nearly as well as any pose near the prior"
        ), camera
    estimate = PoseEstimate(
        pose,
        _spread([(loss, fit.unknowns[:3], estimate.covariance) for loss, fit, estimate in rivals]),
        ratio,
        float(np.sqrt(np.mean(best.rows.residual[agree] ** 2))),
    )
    return estimate, oriented


def _spread(rivals: list[tuple[float, FloatArray, FloatArray]]) -> FloatArray:
    """Covariance (3, 3) about the first of several poses, weighted by their losses, in chi-square."""
    weight = np.exp([-loss / 2 for loss, _, _ in rivals])
    total = np.zeros((3, 3))
    for probability, (_, pose, covariance) in zip(weight / weight.sum(), rivals, strict=True):
        off = pose - rivals[0][1]
        off[2] = wrap_angle(float(off[2]))
        total += probability * (covariance + np.outer(off, off))
    return total


def _shared_px(rows: PointRows, points: LinePoints, settings: NearbySettings) -> FloatArray:
    """Return the error (N,) of whole stretches of line for `fit_line_points`: by the lens, and by the paint."""
    member = stretches(rows.nearest, points.floor_m, settings.fit)
    px_per_m = np.hypot(rows.jacobian[:, 0], rows.jacobian[:, 1])
    return np.asarray(
        np.hypot(settings.lens_px, settings.paint_error_m * px_per_m) * np.sqrt(np.bincount(member)[member])
    )


def _as_swaying(camera: PinholeCamera, points: LinePoints, line_map: LineMap) -> SeenPoints:
    """Return line points of a camera whose tilt and roll differ a little from its file's, as the fit takes them."""
    mount = (camera.pan_rad or 0.0, camera.tilt_rad or 0.0, camera.roll_rad or 0.0, camera.height_m, *camera.offset_m)
    rays = np.ascontiguousarray(camera.pixel_to_camera_ray(points.pixels[:, None] + _AROUND_PX))
    return SeenPoints(
        np.empty((0, 2)), np.empty((0, 2, 2)), rays, np.array(mount, dtype=np.float64), line_map.lines, line_map.arcs
    )
