"""How a camera sees a goal of two posts and a bar: silhouette planes, corners and feet.

Everything is written for the goal at +x, whose frame is the field's own; the goal at -x is the same picture after a
half turn about the field's centre. Lines are compared in the ideal image: pixels with the lens distortion taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import FloatArray
from robocup_vision.camera.pinhole import camera_rotation, project_ideal
from robocup_vision.geometry import Pose2

# What a fit can vary, in this order everywhere: camera position, heading of the optical axis, tilt (up), roll, height,
# logarithm of the focal length's true to stated ratio, and how far bright paint bleeds over its own edge in the image.
X, Y, HEADING, TILT, ROLL, HEIGHT, LOG_FOCAL, BLOOM = range(8)
UNKNOWNS = 8

# The silhouette edges, in this order everywhere. Left and right are as a player in the field sees this goal.
LEFT_OUTER, LEFT_INNER, RIGHT_INNER, RIGHT_OUTER, BAR_TOP, BAR_BOTTOM = range(6)
EDGES = 6


@dataclass(frozen=True, slots=True)
class GoalShape:
    """Posts and bar of the goal at +x, all cylinders of one radius, metres."""

    line_x_m: float  #: field x of the posts' axes, positive
    #: between the posts' axes, and of the bar's axis
    width_m: float
    height_m: float
    radius_m: float  #: of posts and bar

    @property
    def post_y_m(self) -> tuple[float, float]:
        """Field y of the left and the right post's axis."""
        return self.width_m / 2, -self.width_m / 2

    @property
    def corners(self) -> FloatArray:
        """(4, 3) float64: left foot, left top, right top, right foot on the axes, metres."""
        x, (left, right) = self.line_x_m, self.post_y_m
        return np.array([[x, left, 0], [x, left, self.height_m], [x, right, self.height_m], [x, right, 0]])


def goal_shape(field: Field) -> GoalShape:
    """Return posts and bar of a field's goals.

    Raises
    ------
    ArgumentError
        If the field has no goals, or goals that are not made of posts and a bar.
    """
    if not field.goals or field.goals[0].kind != "posts":
        kind = field.goals[0].kind if field.goals else "none"
        raise ArgumentError(f"field '{field.name}' has no goals of posts and a bar (its goals: {kind})")
    goal = field.goals[0]
    return GoalShape(abs(goal.line_x_m), goal.width_m, goal.height_m, goal.post_radius_m)


@dataclass(frozen=True, slots=True)
class IdealView:
    """The camera's focal length and centre without distortion: all the fit needs of it."""

    focal_px: tuple[float, float]
    center_px: tuple[float, float]


def project(view: IdealView, unknowns: npt.ArrayLike, points_m: npt.ArrayLike) -> FloatArray:
    """Ideal pixels (..., N, 2) of field points (..., N, 3), metres; NaN behind the camera."""
    p = np.asarray(unknowns, dtype=np.float64)
    rotation = camera_rotation(p[..., HEADING], p[..., TILT], p[..., ROLL])
    eye = np.stack([p[..., X], p[..., Y], p[..., HEIGHT]], axis=-1)
    ray = (np.asarray(points_m, dtype=np.float64) - eye[..., None, :]) @ rotation
    scale = np.exp(p[..., LOG_FOCAL])[..., None]
    return project_ideal((view.focal_px[0] * scale, view.focal_px[1] * scale), view.center_px, ray)


def pose_of(unknowns: npt.ArrayLike) -> Pose2:
    """Pose of the camera on the floor, in the field frame of the goal at +x."""
    p = np.asarray(unknowns, dtype=np.float64)
    return Pose2(float(p[X]), float(p[Y]), float(p[HEADING]))
