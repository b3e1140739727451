"""Yako et al.'s method as printed: colour region, axes by regression, three angles, a table of angles over the field.

A published reference for comparison with the direct fit. Where the paper is open, this file chooses: bounds of hue and
brightness as in `perception.goal_region`; the bilateral filter smooths the picture, because it would not change a
region of two values; the rows and columns of a regression; and the thresholds of the common region, which the paper
tuned to each picture's truth: twice the tightest ones with a common region. The paper has no tilt, roll and covariance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError, RobocupVisionError
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate, pose_of
from robocup_vision.geometry import Pose2
from robocup_vision.localization.goal.geometry import GoalShape, goal_shape
from robocup_vision.localization.localizer import FrameByFrame, FrameEvidence, Localization
from robocup_vision.perception.goal_region import hue_families, hue_masks

GRID_M = 0.01  # paper, section 3.3 (1)
_LOOSENING = 2.0
_MIN_SIZE_PX = 8
# least number of rows of a post, and of columns of the bar, in a regression
_MIN_ROWS, _MIN_COLUMNS = 6, 4
# greatest relative change of a run's width from the median; others are cut or merge with another member
_MAX_WIDTH_CHANGE = 0.15
# width of the joints, relative to the goal's width in the picture
_JOINT_WIDTH = 0.12


@dataclass(frozen=True, slots=True)
class GoalAxes:
    """Images of the three axes as the regression lines give them."""

    #: posts: u = at + lean * v
    left: tuple[float, float]
    right: tuple[float, float]
    bar: tuple[float, float]  #: bar: v = at + lean * u

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
    """The paper's angles between the planes through the camera and the three axes, radians (eqs. 1-6)."""

    #: angles between the posts' planes, and between each post's plane and the bar's
    gamma: float
    phi_right: float
    phi_left: float


def angles_between(right: npt.ArrayLike, left: npt.ArrayLike, bar: npt.ArrayLike) -> FloatArray:
    """Return gamma, phi_R, phi_L (..., 3), radians, from the planes' normals (..., 3) (Yako et al., eqs. 3, 5, 6).

    The points that span each plane must be in order (both posts upwards, the bar from left to right), or an angle
    becomes its supplement.
    """
    r, l_, b = (np.asarray(n, dtype=np.float64) for n in (right, left, bar))

    def angle(p: FloatArray, q: FloatArray) -> FloatArray:
        return np.asarray(np.arctan2(np.linalg.norm(np.cross(p, q), axis=-1), np.sum(p * q, axis=-1)), np.float64)

    return np.asarray(np.stack([angle(r, l_), angle(r, b), angle(l_, b)], axis=-1), np.float64)


def theoretical_angles(shape: GoalShape, x_m: npt.ArrayLike, y_m: npt.ArrayLike, height_m: float) -> FloatArray:
    """Return gamma, phi_R, phi_L (..., 3), radians, for a camera at (x_m, y_m, height_m) (paper, section 3.3)."""
    x, y = np.broadcast_arrays(np.asarray(x_m, dtype=np.float64), np.asarray(y_m, dtype=np.float64))
    foot_left, top_left, top_right, foot_right = (
        corner - np.stack([x, y, np.full_like(x, height_m)], axis=-1) for corner in shape.corners
    )
    return angles_between(np.cross(foot_right, top_right), np.cross(foot_left, top_left), np.cross(top_left, top_right))


def position_from_angles(shape: GoalShape, angles: GoalAngles) -> tuple[float, float] | None:
    """Return the camera's position (x_m, y_m) by the closed form, without the height of bar or camera.

    With beta the direction of a post from the goal's normal, counted to the right: cos(phi) = sin(beta) sin(e) for both
    posts with the bar's elevation e, hence tan(beta_L) = sin(gamma) cos(phi_L) / (cos(phi_R) - cos(gamma) cos(phi_L)).
    Of its two roots the one in front of the goal, |beta| < 90 degrees, is taken; the other reverses the heading.

    Returns
    -------
    (float, float) or None
        None if no point in front of the goal has these angles.
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
    """Return the largest connected region of a mask, with holes filled (section 3.2, 1 and 2); None if it is empty."""
    from skimage.measure import label, regionprops

    largest = max(regionprops(label(mask > 0)), key=lambda region: region.area, default=None)
    if largest is None:
        return None
    region = np.zeros(mask.shape, dtype=np.uint8)
    region[largest.slice] = largest.image_filled
    return region


def axes_by_regression(region: UInt8Array) -> GoalAxes | None:
    """Fit the middle axes of posts and bar by regression (section 3.2, 3); None if the region has another shape.

    Rows with two runs are posts, and columns between the posts with one run are the bar. Rows and columns with wider
    runs are not used, because a slanted bar merges with a post in some rows, and a post with the bar.
    """
    rows, columns = np.flatnonzero(region.any(axis=1)), np.flatnonzero(region.any(axis=0))
    if len(rows) < _MIN_SIZE_PX or len(columns) < _MIN_SIZE_PX:
        return None
    middle = (columns[0] + columns[-1]) / 2
    crossings = [(v, run) for v in rows if len(run := _runs(region[v])) == 2 and run[0, 1] < middle < run[1, 0]]
    posts = [_regular([(v, *run[side]) for v, run in crossings]) for side in (0, 1)]
    if min(len(post) for post in posts) < _MIN_ROWS:
        return None
    first, last = posts[0][:, 1].max(), posts[1][:, 1].min()
    joint = _JOINT_WIDTH * (last - first)
    between = range(math.ceil(first + joint), math.floor(last - joint) + 1)
    bar = _regular([(u, *run[0]) for u in between if len(run := _runs(region[:, u])) == 1])
    if len(bar) < _MIN_COLUMNS:
        return None
    return GoalAxes(_regress(posts[0]), _regress(posts[1]), _regress(bar))


def _runs(line: UInt8Array) -> npt.NDArray[np.int64]:
    """Find the first and last pixel (N, 2) of each run of a row or column of a region."""
    ends = np.flatnonzero(np.diff(line > 0, prepend=False, append=False)).reshape(-1, 2)
    return np.asarray(ends - (0, 1), dtype=np.int64)


def _regular(runs: list[tuple[int, int, int]]) -> FloatArray:
    """Return place and middle (M, 2) of the runs (place, first and last pixel) whose width is near the median."""
    place, first, last = np.array(runs, dtype=np.float64).reshape(-1, 3).T
    width = last - first + 1
    usual = float(np.median(width)) if len(width) else 0.0
    kept = np.abs(width - usual) <= max(_MAX_WIDTH_CHANGE * usual, 0.5)
    return np.column_stack([place[kept], (first + last)[kept] / 2])


def _regress(points: FloatArray) -> tuple[float, float]:
    lean, at = np.polyfit(points[:, 0], points[:, 1], 1)
    return float(at), float(lean)


@dataclass(frozen=True, slots=True)
class GoalSighting:
    """A camera pose by a goal's angles."""

    estimate: PoseEstimate  #: foot of the camera on the floor and heading of its optical axis
    #: tilt and roll of the camera by the common direction of the posts
    tilt_rad: float
    roll_rad: float


class GoalAnglesEstimator:
    """Locates a camera by a goal of a hue, as in the paper.

    The paper knows the goal's colour. Here, of goals of several hues, the one with the largest region that has the
    shape of two posts and a bar is used.

    Parameters
    ----------
    field : Field
        Must have goals of posts and a bar, in colours of a hue.
    camera : PinholeCamera
        Only its optics and height are used.
    closed_form : bool
        Take the position from `position_from_angles` instead of the table's common region.

    Raises
    ------
    ArgumentError
        If the field's goals are not of that kind.
    RobocupVisionError
        If scikit-image, which labels regions, is not installed.
    """

    def __init__(self, field: Field, camera: PinholeCamera, *, closed_form: bool = False) -> None:
        try:
            import skimage.measure  # noqa: F401
        except ImportError as error:
            raise RobocupVisionError(
                f"method 'angles' needs scikit-image: pip install 'robocup-vision[baselines]' ({error})"
            ) from None
        self._shape = goal_shape(field)
        self._families = hue_families(field)
        if not self._families:
            raise ArgumentError(f"method 'angles' finds goals by their hue, but those of '{field.name}' are white")
        self._field, self._camera, self._closed_form = field, camera, closed_form
        half_length_m, half_width_m = np.abs(field.floor_polygon).max(axis=0)
        x = np.arange(-half_length_m, self._shape.line_x_m - 0.05, GRID_M)
        y = np.arange(-half_width_m, half_width_m + GRID_M / 2, GRID_M)
        self._x, self._y = np.meshgrid(x, y)
        self._table = theoretical_angles(self._shape, self._x, self._y, camera.height_m).astype(np.float32)

    def locate(self, frame: UInt8Array) -> PoseEstimate | NotLocated:
        """Locate the camera by one frame (H, W, 3) uint8 BGR; the method takes no prior."""
        found = self.sight(frame)
        return found if isinstance(found, NotLocated) else found.estimate

    def sight(self, frame: UInt8Array) -> GoalSighting | NotLocated:
        """Locate the camera as `locate` does, with its tilt and roll."""
        masks = hue_masks(np.asarray(cv2.bilateralFilter(frame, 5, 30, 3), np.uint8), self._families)
        regions = [(color, region) for color, mask in masks.items() if (region := goal_region(mask)) is not None]
        for color, region in sorted(regions, key=lambda item: -np.count_nonzero(item[1])):
            axes = axes_by_regression(region)
            if axes is not None:
                return self._place(axes, [goal.side for goal in self._field.goals if goal.color == color])
        return NotLocated("no region of a goal's hue has the shape of two posts and a bar")

    def _place(self, axes: GoalAxes, sides: list[int]) -> GoalSighting | NotLocated:
        """Return the camera's pose in front of a goal of the field; candidates for both goals if they are alike."""
        ray = self._camera.pixel_to_camera_ray(axes.pixels(self._camera.size_px[1]))
        left, right, bar = (np.cross(ray[k], ray[k + 1]) for k in (0, 2, 4))
        angles = GoalAngles(*angles_between(right, left, bar).tolist())
        located = self._by_closed_form(angles) if self._closed_form else self._by_table(angles)
        if isinstance(located, NotLocated):
            return located
        x, y, spread = located
        up = np.cross(left, right)
        up = up / np.copysign(np.linalg.norm(up), up[2])
        distance = math.hypot(self._shape.line_x_m - x, y)
        covariance = np.zeros((3, 3))
        covariance[:2, :2] = spread
        covariance[2, 2] = float(np.trace(spread)) / max(distance, 0.1) ** 2
        pose = Pose2(x, y, self._heading(x, y, right, left, up))
        candidates = (pose, pose.half_turn()) if len(sides) > 1 else (pose,)
        estimate = PoseEstimate(pose, covariance, 1.0, 0.0, candidates)
        if sides == [-1]:
            estimate = estimate.half_turn()
        # `up` is the last row of the rotation from the camera to the robot
        return GoalSighting(estimate, math.asin(min(max(up[0], -1.0), 1.0)), math.atan2(up[1], up[2]))

    def _by_closed_form(self, angles: GoalAngles) -> tuple[float, float, FloatArray] | NotLocated:
        position = position_from_angles(self._shape, angles)
        if position is None:
            return NotLocated("no point in front of the goal sees these angles")
        return *position, np.diag([0.1**2, 0.1**2])

    def _by_table(self, angles: GoalAngles) -> tuple[float, float, FloatArray]:
        """Return centre and covariance of the common region (section 3.3, 2 and 3; eqs. 7-9)."""
        seen = np.array([angles.gamma, angles.phi_right, angles.phi_left], dtype=np.float32)
        worst = np.abs(self._table - seen).max(axis=-1)
        inside = worst <= max(_LOOSENING * float(worst.min()), 1e-4)
        x, y = self._x[inside], self._y[inside]
        spread = np.cov(np.stack([x, y])) if len(x) > 2 else np.zeros((2, 2))
        return float(x.mean()), float(y.mean()), spread + np.eye(2) * GRID_M**2

    def _heading(self, x: float, y: float, right: FloatArray, left: FloatArray, up: FloatArray) -> float:
        """Return the heading of the optical axis, with bearings about the vertical in which the posts' planes meet."""
        axis = np.array([1.0, 0.0, 0.0]) - up[0] * up
        headings = []
        for normal, post_y in ((left, self._shape.post_y_m[0]), (right, self._shape.post_y_m[1])):
            towards = np.cross(up, normal)
            towards = towards if towards[0] > 0 else -towards
            seen = math.atan2(float(np.cross(axis, towards) @ up), float(axis @ towards))
            headings.append(math.atan2(post_y - y, self._shape.line_x_m - x) - seen)
        return math.atan2(sum(math.sin(h) for h in headings), sum(math.cos(h) for h in headings))


class AnglesLocalizer(FrameByFrame):
    """Satisfies `Localizer`; method "angles" of a pinhole camera. The tilt may be unknown."""

    def __init__(self, field: Field, camera: PinholeCamera) -> None:
        self._angles = GoalAnglesEstimator(field, camera)

    def locate(self, evidence: FrameEvidence, prior: PoseEstimate | Pose2 | None = None) -> Localization:
        """See `Localizer.locate`; of two candidates, the one nearer to the prior comes first."""
        camera = evidence.camera
        assert isinstance(camera, PinholeCamera)
        found = self._angles.sight(evidence.frame)
        if isinstance(found, NotLocated):
            return Localization(found, camera)
        oriented = camera.with_orientation(camera.pan_rad or 0.0, found.tilt_rad, found.roll_rad)
        estimate, near = found.estimate.seen_from(oriented.camera_in_robot.inverse()), pose_of(prior)
        if near is not None and len(estimate.candidates) > 1:
            estimate = min((estimate, estimate.half_turn()), key=lambda one: sum(one.pose.error_to(near)))
        return Localization(estimate, oriented)
