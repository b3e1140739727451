"""Pose from the convex hull of the whole floor mask: Sekimori et al. 2001, section 4, as printed.

A published reference for comparison with `localization.floor`. Corrected errata: the two headings of eq. 23 are -psi'
and pi - psi', and eqs. 20-21 turn by psi'. Where the paper is open, this file chooses: the erosions and dilations of
Step 1, the use of points at the end of the view, the rejection of fits, and the covariance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import BoolArray, FloatArray, UInt8Array
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.estimates import NotLocated, PoseEstimate, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.localization.field_half import GoalSide
from robocup_vision.localization.floor import require_bounded
from robocup_vision.localization.localizer import FrameByFrame, FrameEvidence, Localization
from robocup_vision.localization.outline_model import paper_pixel_px
from robocup_vision.perception.color_table import ColorTable


@dataclass(frozen=True, slots=True)
class HullSettings:
    """Settings of `HullFitter`; "units" are 1/86 of the usable image radius, a pixel of the paper's image."""

    #: least ratio of a piece of floor to all floor; smaller ones are green objects outside the field
    min_piece_ratio: float = 0.05
    min_points: int = 8  #: least number of the hull's corners on walls
    #: greatest number of iterations of the paper's steps 6 and 7, and change of the pose at which they end
    iterations: int = 30
    converged: float = 1e-9
    inlier: float = 1.5  #: greatest residual of an inlier, units
    #: least inlier ratio and greatest standard deviation of an accepted fit
    min_inlier_ratio: float = 0.3
    max_std_m: float = 0.10
    #: least ratio of the standard deviations along and across the floor's principal axis
    min_elongation: float = 1.05
    margin_px: int = 2  #: least distance of a point of the floor's edge from the end of the view
    max_range_ratio: float = 1.2  #: greatest range of floor, in lengths of the field


class HullFitter:
    """Fits the convex hull of a frame's floor to a field's walls.

    Parameters
    ----------
    field : Field
        Its floor must be bounded by walls or boards, and longer than wide.
    mask : (H, W) uint8, optional
        Non-zero pixels are not used.

    Raises
    ------
    ArgumentError
        If nothing bounds the floor, it has no principal axis, or the mask's size is not the camera's.
    """

    def __init__(
        self,
        field: Field,
        camera: OmniCamera,
        mask: UInt8Array | None = None,
        settings: HullSettings = HullSettings(),
    ) -> None:
        require_bounded(field, "hull")
        width, height = camera.size_px
        if mask is not None and mask.shape != (height, width):
            raise ArgumentError(f"mask must be ({height}, {width}), got {mask.shape}")
        hull = cv2.convexHull(field.floor_polygon.astype(np.float32)).reshape(-1, 2)
        model = polygon_moments(hull.astype(np.float64))
        assert model is not None  # a field has an area
        if model.elongation < settings.min_elongation:
            raise ArgumentError(f"method 'hull' needs a floor that is longer than wide, '{field.name}' is square")
        self.field, self.camera, self.mask, self.settings = field, camera, mask, settings
        self._model, self._walls, self._view = model, self._find_walls(), self._find_view()

    def _find_walls(self) -> tuple[FloatArray, BoolArray]:
        """Return the walls (W, 4), and a mask of the side walls of goals (W,)."""
        walls = self.field.walls
        sides = [panel for goal in self.field.goals if goal.kind != "posts" for panel in goal.panels[[0, 2]]]
        is_side = np.zeros(len(walls), dtype=bool)
        for panel in sides:
            for way in (panel, panel[[2, 3, 0, 1]]):
                is_side |= np.abs(walls - way).max(axis=1) < 1e-6
        return walls, is_side

    def _find_view(self) -> tuple[UInt8Array, UInt8Array]:
        """Return masks (H, W) of the pixels where floor may be, and of those well inside that region."""
        width, height = self.camera.size_px
        v, u = np.mgrid[:height, :width]
        radius = np.hypot(u - self.camera.center_px[0], v - self.camera.center_px[1])
        inner, outer = self.camera.usable_radius_px
        floor_m = self.camera.pixel_to_floor(np.stack([u, v], axis=-1))
        farthest = self.settings.max_range_ratio * float(np.ptp(self.field.floor_polygon, axis=0).max())
        usable = (radius >= inner) & (radius <= outer)
        if self.mask is not None:
            usable &= self.mask == 0
        near = np.hypot(floor_m[..., 0], floor_m[..., 1]) <= farthest
        # floor at the horizon has an edge, but not at the end of the view
        inside = cv2.erode(
            usable.astype(np.uint8), _disc(self.settings.margin_px), borderType=cv2.BORDER_CONSTANT, borderValue=0
        )
        return (usable & near).astype(np.uint8), np.asarray(inside, dtype=np.uint8)

    def floor_mask(self, frame: UInt8Array, colors: ColorTable) -> UInt8Array:
        """Step 1: return the floor (H, W) uint8, 1 or 0, of a frame (H, W, 3), without specks and painted lines."""
        usable = self._view[0]
        disc = _disc(round(paper_pixel_px(self.camera)))
        floor = (colors.floor_llr[colors.pack(frame)] > 0).astype(np.uint8) & usable
        for operation in (cv2.MORPH_CLOSE, cv2.MORPH_OPEN):
            floor = np.asarray(cv2.morphologyEx(floor, operation, disc), dtype=np.uint8)
        # the outermost pixel of floor is counted as wall by its colour
        floor = np.asarray(cv2.dilate(floor, _disc(1)), dtype=np.uint8)
        return _without_specks(floor & usable, self.settings.min_piece_ratio)

    def locate_floor(self, floor: UInt8Array) -> PoseEstimate | NotLocated:
        """Locate the robot by a floor mask (H, W) uint8, non-zero on floor (Steps 2 to 7)."""
        corners_px = _image_hull(floor)
        points_m = self.camera.pixel_to_floor(corners_px)
        known = np.isfinite(points_m).all(axis=1)
        corners_px, points_m = corners_px[known], points_m[known]
        moments = polygon_moments(points_m)
        if moments is None:
            return NotLocated("the floor in view encloses no area")
        columns, rows = np.rint(corners_px).astype(int).T
        fit = self._fit(points_m, self._weights(corners_px), self._view[1][rows, columns] > 0, moments)
        return fit if isinstance(fit, NotLocated) else self._judge(fit)

    def _weights(self, pixels: FloatArray) -> FloatArray:
        """Return the weights w = 1 / (df/dR)^2, (px/m)^2, by differences on the camera's curve."""
        delta = pixels - self.camera.center_px
        outward = delta / np.linalg.norm(delta, axis=1, keepdims=True)
        step = 0.01
        change = self.camera.pixel_to_floor(pixels + step * outward) - self.camera.pixel_to_floor(
            pixels - step * outward
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            weight = (2 * step) ** 2 / (change**2).sum(axis=1)
        return np.where(np.isfinite(weight), weight, 0.0)

    def _assign(self, places_m: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Assign a wall to each place (M, 2): normals (M, 2), offsets (M,), and whether it counts (M,)."""
        walls, is_side = self._walls
        start, along = walls[:, :2], walls[:, 2:] - walls[:, :2]
        offset = places_m[:, None] - start
        part = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
        nearest = np.argmin(((offset - part[..., None] * along) ** 2).sum(axis=2), axis=1)
        normal = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1, keepdims=True)
        return normal[nearest], (normal * start).sum(axis=1)[nearest], ~is_side[nearest]

    def _fit(self, points_m: FloatArray, weight: FloatArray, is_edge: BoolArray, moments: Moments) -> _Fit | NotLocated:
        # the field's centroid and axis relative to the robot's, eqs. 16-17; the field's frame is the paper's
        pose = self._model.frame.compose(moments.frame.inverse())
        for _ in range(self.settings.iterations):
            places = pose.transform(points_m)
            normal, offset, counts = self._assign(places)
            counts &= is_edge & (weight > 0)
            if np.count_nonzero(counts) < self.settings.min_points:
                return NotLocated(f"only {np.count_nonzero(counts)} corners of the floor's hull lie on walls")
            n, p, scale = normal[counts], places[counts], np.sqrt(weight[counts])
            # eq. 18 with sin zeta = zeta, cos zeta = 1: n.p + zeta (n_x y - n_y x) + n.(a, b) - d
            jacobian = np.column_stack([n, n[:, 0] * p[:, 1] - n[:, 1] * p[:, 0]]) * scale[:, None]
            residual = ((n * p).sum(axis=1) - offset[counts]) * scale
            information = jacobian.T @ jacobian
            if np.linalg.cond(information) > 1e9:
                return NotLocated("the floor's hull lies on walls of one direction only")
            a, b, zeta = (-np.linalg.solve(information, jacobian.T @ residual)).tolist()
            # eqs. 20-22, as the pose of the robot instead of that of the floor
            pose = Pose2(a, b, -zeta).compose(pose)
            if abs(a) + abs(b) + abs(zeta) < self.settings.converged:
                break
        residual += jacobian @ (a, b, zeta)
        return _Fit(pose, residual, information)

    def _judge(self, fit: _Fit) -> PoseEstimate | NotLocated:
        pose = fit.pose
        is_inlier = np.abs(fit.residual_px) < self.settings.inlier * paper_pixel_px(self.camera)
        ratio = float(np.mean(is_inlier))
        if ratio < self.settings.min_inlier_ratio:
            return NotLocated(f"only {ratio:.0%} of the floor's hull agrees with the field's walls")
        if not self.field.is_on_floor(pose.x_m, pose.y_m):
            return NotLocated(f"the best fit puts the robot outside the field, at ({pose.x_m:.2f}, {pose.y_m:.2f}) m")
        # (a, b, zeta) moves the robot like a rotation about the field's centre
        motion = np.array([[1.0, 0.0, pose.y_m], [0.0, 1.0, -pose.x_m], [0.0, 0.0, -1.0]])
        variance = _variance(fit.residual_px)
        covariance = variance * (motion @ np.linalg.inv(fit.information) @ motion.T)
        if math.sqrt(float(np.linalg.eigvalsh(covariance[:2, :2])[-1])) > self.settings.max_std_m:
            return NotLocated("the part of the floor's hull in view does not fix the pose in every direction")
        rms = float(np.sqrt(np.mean(fit.residual_px[is_inlier] ** 2)))
        return PoseEstimate(pose, covariance, ratio, rms, (pose, pose.half_turn()))


class HullLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "hull" of a mirror camera: the published fit of the whole floor mask."""

    def __init__(self, field: Field, camera: OmniCamera, mask: UInt8Array | None) -> None:
        self._hull = HullFitter(field, camera, mask)
        self._half = GoalSide(field, camera, mask)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`."""
        assert evidence.table is not None
        pose = self._hull.locate_floor(self._hull.floor_mask(evidence.frame, evidence.table))
        if isinstance(pose, PoseEstimate):
            pose = self._half.choose(evidence.frame, pose, evidence.table.colors, pose_of(prior))
        return Localization(pose, evidence.camera)


@dataclass(frozen=True, slots=True)
class Moments:
    """Centroid and principal axis as a frame, and the ratio of the standard deviations along and across the axis."""

    frame: Pose2
    elongation: float


@dataclass(frozen=True, slots=True)
class _Fit:
    pose: Pose2
    residual_px: FloatArray
    information: FloatArray


def _disc(radius_px: int) -> UInt8Array:
    size = 2 * radius_px + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), dtype=np.uint8)


def _without_specks(floor: UInt8Array, min_ratio: float) -> UInt8Array:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(floor, connectivity=8)
    area = stats[:, cv2.CC_STAT_AREA].astype(np.float64)
    keep = area >= min_ratio * area[1:].sum()
    keep[0] = False
    return np.asarray(keep[labels], dtype=np.uint8)


def _image_hull(floor: UInt8Array) -> FloatArray:
    """Return the corners (M, 2) of the convex hull of each row's first and last floor pixel (Steps 2 and 3)."""
    present = floor > 0
    rows = np.flatnonzero(present.any(axis=1))
    if len(rows) < 2:
        return np.empty((0, 2))
    first = present[rows].argmax(axis=1)
    last = present.shape[1] - 1 - present[rows, ::-1].argmax(axis=1)
    ends = np.concatenate([np.stack([first, rows], axis=1), np.stack([last, rows], axis=1)])
    return np.asarray(cv2.convexHull(ends.astype(np.int32)).reshape(-1, 2), dtype=np.float64)


def polygon_moments(corners: FloatArray) -> Moments | None:
    """Return the moments of a closed polygon (M, 2); None if it has no area."""
    if len(corners) < 3:
        return None
    middle = corners.mean(axis=0)
    x, y = (corners - middle).T
    x2, y2 = np.roll(x, -1), np.roll(y, -1)
    cross = x * y2 - x2 * y
    area = cross.sum() / 2
    if abs(area) < 1e-9:
        return None
    cx, cy = ((x + x2) * cross).sum() / (6 * area), ((y + y2) * cross).sum() / (6 * area)
    xx = ((x * x + x * x2 + x2 * x2) * cross).sum() / (12 * area) - cx * cx
    yy = ((y * y + y * y2 + y2 * y2) * cross).sum() / (12 * area) - cy * cy
    xy = ((x * y2 + 2 * x * y + 2 * x2 * y2 + x2 * y) * cross).sum() / (24 * area) - cx * cy
    axis = 0.5 * math.atan2(2 * xy, xx - yy)
    spread = math.hypot(xx - yy, 2 * xy)
    across = max(xx + yy - spread, 1e-12)
    frame = Pose2(float(middle[0] + cx), float(middle[1] + cy), axis)
    return Moments(frame, math.sqrt((xx + yy + spread) / across))


def _variance(residual_px: FloatArray) -> float:
    """Return the variance of a hull corner, px^2, for use as if corners were independent.

    Errors of neighbours are correlated (a box hides a stretch, light fades along a wall), so the number of corners is
    reduced to that of independent ones.
    """
    mean_square = float(np.sum(residual_px**2)) / max(len(residual_px) - 3, 1)
    power = float(np.mean(residual_px**2))
    correlation = float(np.mean(residual_px * np.roll(residual_px, 1))) / power if power > 0 else 0.0
    correlation = min(max(correlation, 0.0), 0.8)
    return mean_square * (1 + correlation) / (1 - correlation)
