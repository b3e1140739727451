"""Yako et al.'s method as printed: colour region, axes by regression, three angles, a table of angles over the field.

The published reference to compare the direct fit with; no production module imports it. Its thresholds are automatic
(the paper tuned them to each picture's truth and names their automation as future work): the tightest ones that still
leave a common region, doubled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.geometry import GoalShape, goal_shape
from robocup_vision.perception.goal_color import hue_families, hue_masks

GRID_M = 0.01  # paper, section 3.3 (1)
_LOOSENING = 2.0


@dataclass(frozen=True, slots=True)
class GoalAxes:
    """Images of the three axes as the regression lines give them.

    Parameters
    ----------
    left, right : (float, float)
        Posts: u = at + lean * v.
    bar : (float, float)
        Bar: v = at + lean * u.
    """

    left: tuple[float, float]
    right: tuple[float, float]
    bar: tuple[float, float]

    def pixels(self, height: int) -> FloatArray:
        """(6, 2) float64: two points of the left post (lower first), of the right post, of the bar (left first)."""
        low, high = 0.8 * height, 0.2 * height
        a, b = self.left[0] + self.left[1] * low, self.right[0] + self.right[1] * low
        return np.array(
            [
                [a, low],
                [self.left[0] + self.left[1] * high, high],
                [b, low],
                [self.right[0] + self.right[1] * high, high],
                [a, self.bar[0] + self.bar[1] * a],
                [b, self.bar[0] + self.bar[1] * b],
            ]
        )


@dataclass(frozen=True, slots=True)
class GoalAngles:
    """The paper's position information, radians: between the planes through the camera and the three axes (eqs. 1-6).

    Parameters
    ----------
    gamma, phi_right, phi_left : float
        Between the posts' planes, and between each post's plane and the bar's.
    """

    gamma: float
    phi_right: float
    phi_left: float


def angles_between(right: npt.ArrayLike, left: npt.ArrayLike, bar: npt.ArrayLike) -> FloatArray:
    """gamma, phi_R, phi_L (..., 3), radians, from the planes' normals (..., 3) (Yako et al., eqs. 3, 5, 6).

    The order of the points that span each plane must be kept (both posts upwards, the bar from left to right), else an
    angle turns into its supplement.
    """
    r, l_, b = (np.asarray(n, dtype=np.float64) for n in (right, left, bar))

    def angle(p: FloatArray, q: FloatArray) -> FloatArray:
        return np.asarray(np.arctan2(np.linalg.norm(np.cross(p, q), axis=-1), np.sum(p * q, axis=-1)), np.float64)

    return np.asarray(np.stack([angle(r, l_), angle(r, b), angle(l_, b)], axis=-1), np.float64)


def theoretical_angles(shape: GoalShape, x_m: npt.ArrayLike, y_m: npt.ArrayLike, height_m: float) -> FloatArray:
    """gamma, phi_R, phi_L (..., 3), radians, as a camera at (x_m, y_m, height_m) must see them (paper, section 3.3)."""
    x, y = np.broadcast_arrays(np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64))
    foot_left, top_left, top_right, foot_right = (
        corner - np.stack([x, y, np.full_like(x, height_m)], axis=-1) for corner in shape.corners
    )
    return angles_between(np.cross(foot_right, top_right), np.cross(foot_left, top_left), np.cross(top_left, top_right))


def position_from_angles(shape: GoalShape, angles: GoalAngles) -> tuple[float, float] | None:
    """Camera position (x_m, y_m) in the field by the closed form, without the bar's or the camera's height.

    With beta the direction of a post from the goal's normal, counted to the right: cos(phi) = sin(beta) sin(e) for both
    posts with the bar's elevation e, hence tan(beta_L) = sin(gamma) cos(phi_L) / (cos(phi_R) - cos(gamma) cos(phi_L)).
    Of its two roots the one in front of the goal, |beta| < 90 degrees, is taken; the other reverses the heading.

    Returns
    -------
    (float, float) or None
        None where no point in front of the goal sees these angles.
    """
    cos_left, cos_right = math.cos(angles.phi_left), math.cos(angles.phi_right)
    numerator = math.sin(angles.gamma) * cos_left
    denominator = cos_right - math.cos(angles.gamma) * cos_left
    beta_left = math.atan2(numerator, denominator)
    for root in (beta_left, beta_left - math.copysign(math.pi, beta_left)):
        beta_right = root + angles.gamma
        if abs(root) < math.pi / 2 and abs(beta_right) < math.pi / 2:
            distance = shape.width_m / (math.tan(beta_right) - math.tan(root))
            return shape.line_x_m - distance, distance * math.tan(beta_right) - shape.width_m / 2
    return None


def goal_region(mask: UInt8Array) -> UInt8Array | None:
    """Largest connected region of a mask with its holes filled (section 3.2, 1 and 2), or None if there is none."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    if count < 2:
        return None
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    region = np.asarray(labels == largest, dtype=np.uint8)
    return np.asarray(cv2.morphologyEx(region, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8)) * 255, dtype=np.uint8)


def axes_by_regression(region: UInt8Array) -> GoalAxes | None:
    """Middle axes of posts and bar by regression (section 3.2, 3), or None where the region has not that shape.

    Rows with two runs are posts, columns between the posts with one run are the bar.
    """
    rows = np.flatnonzero(region.any(axis=1))
    columns = np.flatnonzero(region.any(axis=0))
    if len(rows) < 8 or len(columns) < 8:
        return None
    middle = (columns[0] + columns[-1]) / 2
    left, right = [], []
    for v in rows:
        run = np.flatnonzero(region[v])
        gaps = np.flatnonzero(np.diff(run) > 1)
        if len(gaps) == 1:
            first, second = run[: gaps[0] + 1], run[gaps[0] + 1 :]
            if first[-1] < middle < second[0]:
                left.append((float(v), float(first.mean())))
                right.append((float(v), float(second.mean())))
    if len(left) < 6:
        return None
    inner = (max(u for _, u in left), min(u for _, u in right))
    margin = 0.12 * (inner[1] - inner[0])
    bar = []
    for u in range(math.ceil(inner[0] + margin), math.floor(inner[1] - margin) + 1):
        run = np.flatnonzero(region[:, u])
        if len(run):
            bar.append((float(u), float(run.mean())))
    if len(bar) < 4:
        return None

    def regress(points: list[tuple[float, float]]) -> tuple[float, float]:
        lean, at = np.polyfit([p[0] for p in points], [p[1] for p in points], 1)
        return float(at), float(lean)

    return GoalAxes(regress(left), regress(right), regress(bar))


class GoalAnglesEstimator:
    """Locates a camera by a goal of a hue, as the paper does; the goal with the larger region is the one in view.

    Parameters
    ----------
    field : Field
        With goals of posts and a bar, in colours of a hue.
    camera : PinholeCamera
        Only its optics and height count.
    closed_form : bool
        Take the position from `position_from_angles` instead of the table's common region.

    Raises
    ------
    ArgumentError
        If the field's goals are not of that kind.
    """

    def __init__(self, field: Field, camera: PinholeCamera, *, closed_form: bool = False) -> None:
        self._families = hue_families(field)
        shape = goal_shape(field)
        if not self._families:
            raise ArgumentError(f"Yako's method finds goals by their hue, but those of '{field.name}' are white")
        self._field, self._closed_form = field, closed_form
        self._mask_estimator = GoalMaskEstimator(shape, camera, np.abs(field.floor_polygon).max(axis=0))

    def locate(self, frame: UInt8Array, prior: Pose2 | None = None) -> PoseEstimate | NotLocated:
        """Locate the camera by one frame (H, W, 3) uint8 BGR; the method takes no prior, which is ignored."""
        smooth = np.asarray(cv2.bilateralFilter(frame, 5, 30, 3), np.uint8)
        masks = hue_masks(smooth, self._families)
        color = max(masks, key=lambda name: int(cv2.countNonZero(masks[name])))
        estimate = self._mask_estimator.locate(masks[color], closed_form=self._closed_form)
        at_positive = any(goal.side > 0 for goal in self._field.goals if goal.color == color)
        return estimate if isinstance(estimate, NotLocated) or at_positive else estimate.half_turn()


class GoalMaskEstimator:
    """Locates a camera from a mask of goal paint by the paper's angles.

    Parameters
    ----------
    shape : GoalShape
        The goal at +x.
    camera : PinholeCamera
        Only its optics and height count.
    extent_m : (2,) float64
        Half length and half width of the floor on which candidates are looked for.
    """

    def __init__(self, shape: GoalShape, camera: PinholeCamera, extent_m: FloatArray) -> None:
        self.shape = shape
        self.camera = camera
        x = np.arange(-extent_m[0], shape.line_x_m - 0.05, GRID_M)
        y = np.arange(-extent_m[1], extent_m[1] + GRID_M / 2, GRID_M)
        self._x, self._y = np.meshgrid(x, y)
        self._table = theoretical_angles(shape, self._x, self._y, camera.height_m).astype(np.float32)

    def angles(self, axes: GoalAxes) -> tuple[GoalAngles, FloatArray, FloatArray]:
        """Compute the three angles of measured axes, and the planes' normals R and L in the camera frame."""
        ray = self.camera.pixel_to_camera_ray(axes.pixels(self.camera.size_px[1]))
        left, right, bar = (np.cross(ray[k], ray[k + 1]) for k in (0, 2, 4))
        gamma, phi_right, phi_left = (float(a) for a in angles_between(right, left, bar))
        return GoalAngles(gamma, phi_right, phi_left), right, left

    def locate(self, mask: UInt8Array, *, closed_form: bool = False) -> PoseEstimate | NotLocated:
        """Locate the camera from a mask of goal paint of the camera's size.

        Parameters
        ----------
        mask : (H, W) uint8
            Non-zero on paint.
        closed_form : bool
            Take the position from `position_from_angles` instead of the table's common region.
        """
        region = goal_region(mask)
        axes = None if region is None else axes_by_regression(region)
        if axes is None:
            return NotLocated("the goal's region has not the shape of two posts and a bar")
        angles, right, left = self.angles(axes)
        if closed_form:
            position = position_from_angles(self.shape, angles)
            if position is None:
                return NotLocated("no point in front of the goal sees these angles")
            x, y = position
            spread = np.diag([0.1**2, 0.1**2])
        else:
            seen = np.array([angles.gamma, angles.phi_right, angles.phi_left], dtype=np.float32)
            worst = np.abs(self._table - seen).max(axis=-1)
            inside = worst <= max(_LOOSENING * float(worst.min()), 1e-4)
            x, y = float(self._x[inside].mean()), float(self._y[inside].mean())
            spread = np.cov(np.stack([self._x[inside], self._y[inside]])) if inside.sum() > 2 else np.zeros((2, 2))
            spread = spread + np.eye(2) * GRID_M**2
        heading = self._heading(x, y, right, left)
        distance = math.hypot(self.shape.line_x_m - x, y)
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = spread
        covariance[2, 2] = float(np.trace(spread)) / max(distance, 0.1) ** 2
        return PoseEstimate(Pose2(x, y, heading), covariance, 1.0, 0.0)

    def _heading(self, x: float, y: float, right: FloatArray, left: FloatArray) -> float:
        """Heading of the optical axis: both posts' planes meet in the vertical, from which bearings are counted."""
        up = np.cross(left, right)
        up = up / np.linalg.norm(up)
        up = up if up[2] > 0 else -up
        axis = np.array([1.0, 0.0, 0.0]) - up[0] * up
        headings = []
        for normal, post_y in ((left, self.shape.post_y_m[0]), (right, self.shape.post_y_m[1])):
            towards = np.cross(up, normal)
            towards = towards if towards[0] > 0 else -towards
            seen = math.atan2(float(np.cross(axis, towards) @ up), float(axis @ towards))
            headings.append(math.atan2(post_y - y, self.shape.line_x_m - x) - seen)
        return math.atan2(sum(math.sin(h) for h in headings), sum(math.cos(h) for h in headings))
