"""The field and the cameras above it, as vision systems send them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robocup_vision.ssl.protocol.mapping import OpenEnum, Wire, message_value

MM_PER_M = 1000.0


class LineKind(OpenEnum):
    """Which line of a field one is; the league's names, seen from above with +x to the right."""

    UNDEFINED = 0
    CENTER_CIRCLE = 1
    TOP_TOUCH_LINE = 2
    BOTTOM_TOUCH_LINE = 3
    LEFT_GOAL_LINE = 4
    RIGHT_GOAL_LINE = 5
    HALFWAY_LINE = 6
    CENTER_LINE = 7
    LEFT_PENALTY_STRETCH = 8
    RIGHT_PENALTY_STRETCH = 9
    LEFT_FIELD_LEFT_PENALTY_STRETCH = 10
    LEFT_FIELD_RIGHT_PENALTY_STRETCH = 11
    RIGHT_FIELD_LEFT_PENALTY_STRETCH = 12
    RIGHT_FIELD_RIGHT_PENALTY_STRETCH = 13


@message_value("vision.Vector2f")
@dataclass(frozen=True, slots=True)
class FloorPoint:
    """A point of the floor, field frame."""

    x_m: Annotated[float, Wire("x", MM_PER_M)]
    y_m: Annotated[float, Wire("y", MM_PER_M)]
    unknown: bytes = b""


@message_value("vision.SSL_FieldLineSegment")
@dataclass(frozen=True, slots=True)
class FieldLine:
    """A straight line from `start` to `end`, its name and width."""

    name: str
    start: Annotated[FloorPoint, Wire("p1")]
    end: Annotated[FloorPoint, Wire("p2")]
    width_m: Annotated[float, Wire("thickness", MM_PER_M)]
    kind: Annotated[LineKind | None, Wire("type")] = None
    unknown: bytes = b""


@message_value("vision.SSL_FieldCircularArc")
@dataclass(frozen=True, slots=True)
class FieldArc:
    """An arc counter-clockwise from `start_rad` to `end_rad`, its name and width."""

    name: str
    center: FloorPoint
    radius_m: Annotated[float, Wire("radius", MM_PER_M)]
    start_rad: Annotated[float, Wire("a1")]
    end_rad: Annotated[float, Wire("a2")]
    width_m: Annotated[float, Wire("thickness", MM_PER_M)]
    kind: Annotated[LineKind | None, Wire("type")] = None
    unknown: bytes = b""


@message_value("vision.SSL_GeometryFieldSize")
@dataclass(frozen=True, slots=True)
class FieldSize:
    """A field's size and lines; whole millimetres in the message, so that finer ones are rounded.

    `boundary_width_m` is the strip beyond the touch lines, and beyond the goal lines too unless
    `goal_line_boundary_width_m` is given.
    """

    length_m: Annotated[float, Wire("field_length", MM_PER_M)]
    width_m: Annotated[float, Wire("field_width", MM_PER_M)]
    goal_width_m: Annotated[float, Wire("goal_width", MM_PER_M)]
    goal_depth_m: Annotated[float, Wire("goal_depth", MM_PER_M)]
    boundary_width_m: Annotated[float, Wire("boundary_width", MM_PER_M)]
    lines: Annotated[tuple[FieldLine, ...], Wire("field_lines")] = ()
    arcs: Annotated[tuple[FieldArc, ...], Wire("field_arcs")] = ()
    goal_line_boundary_width_m: Annotated[float | None, Wire("boundary_width_goal_line", MM_PER_M)] = None
    penalty_area_depth_m: Annotated[float | None, Wire("penalty_area_depth", MM_PER_M)] = None
    penalty_area_width_m: Annotated[float | None, Wire("penalty_area_width", MM_PER_M)] = None
    center_circle_radius_m: Annotated[float | None, Wire("center_circle_radius", MM_PER_M)] = None
    line_width_m: Annotated[float | None, Wire("line_thickness", MM_PER_M)] = None
    penalty_mark_m: Annotated[float | None, Wire("goal_center_to_penalty_mark", MM_PER_M)] = None
    goal_height_m: Annotated[float | None, Wire("goal_height", MM_PER_M)] = None
    ball_radius_m: Annotated[float | None, Wire("ball_radius", MM_PER_M)] = None
    max_robot_radius_m: Annotated[float | None, Wire("max_robot_radius", MM_PER_M)] = None
    goal_substitution_area_width_m: Annotated[float | None, Wire("goal_substitution_area_width", MM_PER_M)] = None
    unknown: bytes = b""


@message_value("vision.SSL_GeometryCameraCalibration")
@dataclass(frozen=True, slots=True)
class CameraCalibration:
    """One overhead camera."""

    camera_id: int  #: as in its detections
    #: an undistorted radius is ``r (1 + distortion r^2)`` of the distorted one, both over the focal length
    focal_length_px: Annotated[float, Wire("focal_length")]
    principal_x_px: Annotated[float, Wire("principal_point_x")]
    principal_y_px: Annotated[float, Wire("principal_point_y")]
    distortion: float
    #: quaternion that turns the field frame into the camera's. Some simulators send four equal numbers.
    q_x: Annotated[float, Wire("q0")]
    q_y: Annotated[float, Wire("q1")]
    q_z: Annotated[float, Wire("q2")]
    q_w: Annotated[float, Wire("q3")]
    #: the field's centre in the camera's frame
    t_x_m: Annotated[float, Wire("tx", MM_PER_M)]
    t_y_m: Annotated[float, Wire("ty", MM_PER_M)]
    t_z_m: Annotated[float, Wire("tz", MM_PER_M)]
    #: the camera in the field frame, as its sender worked it out
    camera_x_m: Annotated[float | None, Wire("derived_camera_world_tx", MM_PER_M)] = None
    camera_y_m: Annotated[float | None, Wire("derived_camera_world_ty", MM_PER_M)] = None
    camera_z_m: Annotated[float | None, Wire("derived_camera_world_tz", MM_PER_M)] = None
    #: of its image
    width_px: Annotated[int | None, Wire("pixel_image_width")] = None
    height_px: Annotated[int | None, Wire("pixel_image_height")] = None
    unknown: bytes = b""  #: fields that the tables do not have


@message_value("vision.SSL_BallModelStraightTwoPhase")
@dataclass(frozen=True, slots=True)
class RollingBall:
    """How a kicked ball slows down: sliding, then rolling from `switch_ratio` of its first speed on."""

    slide_mps2: Annotated[float, Wire("acc_slide")]
    roll_mps2: Annotated[float, Wire("acc_roll")]
    switch_ratio: Annotated[float, Wire("k_switch")]
    unknown: bytes = b""


@message_value("vision.SSL_BallModelChipFixedLoss")
@dataclass(frozen=True, slots=True)
class BouncingBall:
    """Fractions of its velocity that a chipped ball keeps at a bounce: along the floor at the first, later, and up."""

    first_floor_ratio: Annotated[float, Wire("damping_xy_first_hop")]
    later_floor_ratio: Annotated[float, Wire("damping_xy_other_hops")]
    up_ratio: Annotated[float, Wire("damping_z")]
    unknown: bytes = b""


@message_value("vision.SSL_GeometryModels")
@dataclass(frozen=True, slots=True)
class BallModels:
    """How the ball moves there."""

    rolling: Annotated[RollingBall | None, Wire("straight_two_phase")] = None
    bouncing: Annotated[BouncingBall | None, Wire("chip_fixed_loss")] = None
    unknown: bytes = b""


@message_value("vision.SSL_GeometryData")
@dataclass(frozen=True, slots=True)
class Geometry:
    """Field, cameras and ball models."""

    field: FieldSize
    cameras: Annotated[tuple[CameraCalibration, ...], Wire("calib")] = ()
    models: BallModels | None = None
    unknown: bytes = b""
