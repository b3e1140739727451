"""Messages with the detections in one camera's frame."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

from robocup_vision.ssl.protocol.mapping import Message, OpenEnum, Wire, message_value
from robocup_vision.ssl.values.geometry import MM_PER_M, Geometry


class Source(OpenEnum):
    """Kind of program that sends vision packets."""

    UNKNOWN = 0
    OTHER = 1
    SSL_VISION = 2
    VISION_PROCESSOR = 3
    GRSIM = 4
    ERFORCE_SIM = 5


@message_value("vision.SSL_DetectionBall")
class DetectionBall(Message):
    """A ball detected by one camera."""

    confidence: Annotated[float, Wire(1)]  #: from 0 to 1
    #: place, field frame; for a flying ball the point where its ray meets the floor, unless `z_m` is set
    x_m: Annotated[float, Wire(3, "x", MM_PER_M)]
    y_m: Annotated[float, Wire(4, "y", MM_PER_M)]
    #: where in the camera's image
    pixel_x: Annotated[float, Wire(6)] = 0.0
    pixel_y: Annotated[float, Wire(7)] = 0.0
    area_px: Annotated[int | None, Wire(2, "area")] = None  #: number of pixels
    z_m: Annotated[float | None, Wire(5, "z", MM_PER_M)] = None  #: height, if the sender gives it


@message_value("vision.SSL_DetectionRobot")
class DetectionRobot(Message):
    """A robot detected by one camera."""

    confidence: Annotated[float, Wire(1)]  #: from 0 to 1
    robot_id: Annotated[int | None, Wire(2)]  #: the pattern's number; None if only the team's colour was seen
    #: place of its centre, field frame
    x_m: Annotated[float, Wire(3, "x", MM_PER_M)]
    y_m: Annotated[float, Wire(4, "y", MM_PER_M)]
    #: heading, counter-clockwise from +x of the field frame
    orientation_rad: Annotated[float | None, Wire(5, "orientation")] = None
    #: where in the camera's image
    pixel_x: Annotated[float, Wire(6)] = 0.0
    pixel_y: Annotated[float, Wire(7)] = 0.0
    height_m: Annotated[float | None, Wire(8, "height", MM_PER_M)] = None  #: height of its pattern above the floor


@message_value("vision.SSL_DetectionFrame")
class DetectionFrame(Message):
    """All detections in one frame of one camera."""

    frame_number: Annotated[int, Wire(1)]
    #: times of exposure and of sending, seconds since 1970 by the sender's clock
    t_capture_s: Annotated[float, Wire(2, "t_capture", kind="double")]
    t_sent_s: Annotated[float, Wire(3, "t_sent", kind="double")]
    camera_id: Annotated[int, Wire(4)]
    balls: Annotated[tuple[DetectionBall, ...], Wire(5)] = ()
    yellow: Annotated[tuple[DetectionRobot, ...], Wire(6, "robots_yellow")] = ()
    blue: Annotated[tuple[DetectionRobot, ...], Wire(7, "robots_blue")] = ()
    #: time of exposure by the camera's own clock
    t_capture_camera_s: Annotated[float | None, Wire(8, "t_capture_camera", kind="double")] = None


@message_value("vision.SSL_WrapperPacket")
class VisionPacket(Message):
    """One datagram of a vision system: a frame's detections, the geometry, or both."""

    detection: Annotated[DetectionFrame | None, Wire(1)] = None
    geometry: Annotated[Geometry | None, Wire(2)] = None
    source: Annotated[Source | None, Wire(3)] = None


def finite_frame(frame: DetectionFrame) -> tuple[DetectionFrame, tuple[str, ...]]:
    """Return a frame without the things whose values are not finite, and a text on each of those.

    If all values are finite, the frame itself is returned.
    """
    if all(_is_finite(thing) for things in (frame.balls, frame.yellow, frame.blue) for thing in things):
        return frame, ()
    left_out = tuple(
        f"camera {frame.camera_id}: {_description(thing)} is left out"
        for things in (frame.balls, frame.yellow, frame.blue)
        for thing in things
        if not _is_finite(thing)
    )
    kept = replace(
        frame,
        balls=tuple(filter(_is_finite, frame.balls)),
        yellow=tuple(filter(_is_finite, frame.yellow)),
        blue=tuple(filter(_is_finite, frame.blue)),
    )
    return kept, left_out


def _is_finite(thing: DetectionBall | DetectionRobot) -> bool:
    # a sum is finite if all of its parts are
    if isinstance(thing, DetectionBall):
        return math.isfinite(thing.x_m + thing.y_m + (thing.z_m or 0.0) + thing.confidence)
    return math.isfinite(thing.x_m + thing.y_m + (thing.orientation_rad or 0.0) + thing.confidence)


def _description(thing: DetectionBall | DetectionRobot) -> str:
    if isinstance(thing, DetectionBall):
        return f"a ball at x {thing.x_m}, y {thing.y_m}, z {thing.z_m}, confidence {thing.confidence}"
    angle = thing.orientation_rad
    return f"robot {thing.robot_id} at x {thing.x_m}, y {thing.y_m}, angle {angle}, confidence {thing.confidence}"
