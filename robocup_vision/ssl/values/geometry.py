"""Messages with the field and the cameras above it, as vision systems send them."""

from __future__ import annotations

from typing import Annotated

from robocup_vision.ssl.protocol.mapping import Message, OpenEnum, Wire, message_value

MM_PER_M = 1000.0


class LineKind(OpenEnum):
    """Kind of a field line, by the league's names, as seen from above with +x to the right."""

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
class FloorPoint(Message):
    """A point on the floor, field frame."""

    x_m: Annotated[float, Wire(1, "x", MM_PER_M)]
    y_m: Annotated[float, Wire(2, "y", MM_PER_M)]


@message_value("vision.SSL_FieldLineSegment")
class FieldLine(Message):
    """A straight line from `start` to `end` with name and width."""

    name: Annotated[str, Wire(1)]
    start: Annotated[FloorPoint, Wire(2, "p1")]
    end: Annotated[FloorPoint, Wire(3, "p2")]
    width_m: Annotated[float, Wire(4, "thickness", MM_PER_M)]
    kind: Annotated[LineKind | None, Wire(5, "type")] = None


@message_value("vision.SSL_FieldCircularArc")
class FieldArc(Message):
    """An arc, counter-clockwise from `start_rad` to `end_rad`, with name and width."""

    name: Annotated[str, Wire(1)]
    center: Annotated[FloorPoint, Wire(2)]
    radius_m: Annotated[float, Wire(3, "radius", MM_PER_M)]
    start_rad: Annotated[float, Wire(4, "a1")]
    end_rad: Annotated[float, Wire(5, "a2")]
    width_m: Annotated[float, Wire(6, "thickness", MM_PER_M)]
    kind: Annotated[LineKind | None, Wire(7, "type")] = None


@message_value("vision.SSL_GeometryFieldSize")
class FieldSize(Message):
    """A field's size and lines; most lengths are rounded to whole millimetres in the message.

    `boundary_width_m` is the strip beyond the touch lines, and beyond the goal lines too unless
    `goal_line_boundary_width_m` is given.
    """

    length_m: Annotated[float, Wire(1, "field_length", MM_PER_M, kind="int32")]
    width_m: Annotated[float, Wire(2, "field_width", MM_PER_M, kind="int32")]
    goal_width_m: Annotated[float, Wire(3, "goal_width", MM_PER_M, kind="int32")]
    goal_depth_m: Annotated[float, Wire(4, "goal_depth", MM_PER_M, kind="int32")]
    boundary_width_m: Annotated[float, Wire(5, "boundary_width", MM_PER_M, kind="int32")]
    lines: Annotated[tuple[FieldLine, ...], Wire(6, "field_lines")] = ()
    arcs: Annotated[tuple[FieldArc, ...], Wire(7, "field_arcs")] = ()
    goal_line_boundary_width_m: Annotated[
        float | None, Wire(16, "boundary_width_goal_line", MM_PER_M, kind="int32")
    ] = None
    penalty_area_depth_m: Annotated[float | None, Wire(8, "penalty_area_depth", MM_PER_M, kind="int32")] = None
    penalty_area_width_m: Annotated[float | None, Wire(9, "penalty_area_width", MM_PER_M, kind="int32")] = None
    center_circle_radius_m: Annotated[float | None, Wire(10, "center_circle_radius", MM_PER_M, kind="int32")] = None
    line_width_m: Annotated[float | None, Wire(11, "line_thickness", MM_PER_M, kind="int32")] = None
    penalty_mark_m: Annotated[float | None, Wire(12, "goal_center_to_penalty_mark", MM_PER_M, kind="int32")] = None
    goal_height_m: Annotated[float | None, Wire(13, "goal_height", MM_PER_M, kind="int32")] = None
    ball_radius_m: Annotated[float | None, Wire(14, "ball_radius", MM_PER_M)] = None
    max_robot_radius_m: Annotated[float | None, Wire(15, "max_robot_radius", MM_PER_M)] = None
    goal_substitution_area_width_m: Annotated[
        float | None, Wire(17, "goal_substitution_area_width", MM_PER_M, kind="int32")
    ] = None


@message_value("vision.SSL_GeometryCameraCalibration")
class CameraCalibration(Message):
    """One overhead camera."""

    camera_id: Annotated[int, Wire(1)]  #: as in its detections
    #: a distorted radius r belongs to the undistorted radius ``r (1 + distortion r^2)``, both over the focal length
    focal_length_px: Annotated[float, Wire(2, "focal_length")]
    principal_x_px: Annotated[float, Wire(3, "principal_point_x")]
    principal_y_px: Annotated[float, Wire(4, "principal_point_y")]
    distortion: Annotated[float, Wire(5)]
    #: quaternion of the rotation from the field frame into the camera's; some simulators send four equal numbers
    q_x: Annotated[float, Wire(6, "q0")]
    q_y: Annotated[float, Wire(7, "q1")]
    q_z: Annotated[float, Wire(8, "q2")]
    q_w: Annotated[float, Wire(9, "q3")]
    #: the field's centre in the camera's frame
    t_x_m: Annotated[float, Wire(10, "tx", MM_PER_M)]
    t_y_m: Annotated[float, Wire(11, "ty", MM_PER_M)]
    t_z_m: Annotated[float, Wire(12, "tz", MM_PER_M)]
    #: the camera in the field frame, as its sender computed it
    camera_x_m: Annotated[float | None, Wire(13, "derived_camera_world_tx", MM_PER_M)] = None
    camera_y_m: Annotated[float | None, Wire(14, "derived_camera_world_ty", MM_PER_M)] = None
    camera_z_m: Annotated[float | None, Wire(15, "derived_camera_world_tz", MM_PER_M)] = None
    #: size of its image
    width_px: Annotated[int | None, Wire(16, "pixel_image_width")] = None
    height_px: Annotated[int | None, Wire(17, "pixel_image_height")] = None


@message_value("vision.SSL_BallModelStraightTwoPhase")
class RollingBall(Message):
    """How a kicked ball slows down: it slides, and rolls from when `switch_ratio` of its initial speed is left."""

    slide_mps2: Annotated[float, Wire(1, "acc_slide", kind="double")]
    roll_mps2: Annotated[float, Wire(2, "acc_roll", kind="double")]
    switch_ratio: Annotated[float, Wire(3, "k_switch", kind="double")]


@message_value("vision.SSL_BallModelChipFixedLoss")
class BouncingBall(Message):
    """Fractions of its velocity that a chipped ball keeps at a bounce: along the floor (first, later), and upwards."""

    first_floor_ratio: Annotated[float, Wire(1, "damping_xy_first_hop", kind="double")]
    later_floor_ratio: Annotated[float, Wire(2, "damping_xy_other_hops", kind="double")]
    up_ratio: Annotated[float, Wire(3, "damping_z", kind="double")]


@message_value("vision.SSL_GeometryModels")
class BallModels(Message):
    """Models of the ball's motion on this field."""

    rolling: Annotated[RollingBall | None, Wire(1, "straight_two_phase")] = None
    bouncing: Annotated[BouncingBall | None, Wire(2, "chip_fixed_loss")] = None


@message_value("vision.SSL_GeometryData")
class Geometry(Message):
    """Field, cameras and ball models."""

    field: Annotated[FieldSize, Wire(1)]
    cameras: Annotated[tuple[CameraCalibration, ...], Wire(2, "calib")] = ()
    models: Annotated[BallModels | None, Wire(3)] = None
