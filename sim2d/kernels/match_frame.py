"""Compiled: a mirror camera's match frame in one call, from what each bearing meets to the last pixel.

A call from Python takes its tuples of arrays apart, which for ten calls takes longer than some of these loops do.
"""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.bearing_profile import meet_boxes, meet_cylinders, meet_walls, stack_spans
from sim2d.kernels.floor_lines import floor_until, mark_arcs, mark_lines
from sim2d.kernels.frame_values import (
    BallSphere,
    Bearings,
    Crossings,
    FloorPaint,
    Lighting,
    PaintMarks,
    PixelRays,
    RoomWall,
    Spans,
    Things,
    Viewpoint,
)
from sim2d.kernels.match_pixels import draw_pixels, paint_marked


class Standing(NamedTuple):
    """What stands on the floor; walls are the first things."""

    #: (W, 4) float64: as `bearing_profile.meet_walls` takes them.
    walls: FloatArray
    #: (B, 4, 2) float64: as `bearing_profile.meet_boxes` takes them.
    boxes: FloatArray
    #: Number of the first box's first face among the things.
    first_face: int
    #: (C, 3) float64: as `bearing_profile.meet_cylinders` takes them.
    cylinders: FloatArray
    #: Number of the first of them among the things.
    first_cylinder: int


class FrameRoom(NamedTuple):
    """Arrays that every frame uses anew."""

    #: Of each bearing what it meets and shows, and the rays that lines meet.
    crossings: Crossings
    spans: Spans
    marks: PaintMarks
    #: (K,) float64: how far each bearing sees the floor.
    until_m: FloatArray


@compiled
def draw_over_carpet(
    standing: Standing,
    things: Things,
    paint: FloorPaint,
    farthest_m: float,
    ball: BallSphere,
    walls: RoomWall,
    light: Lighting,
    eye: Viewpoint,
    bearings: Bearings,
    rays: PixelRays,
    plain: Float32Array,
    room: FrameRoom,
    out: UInt8Array,
) -> None:
    """Draw lines, what stands on the floor and the room behind it over plain carpet.

    Parameters
    ----------
    farthest_m : float
        Floor farther away is not seen.
    plain : (3, 3) float32
        BGR of carpet, line, ball.
    room : FrameRoom
        To work in; `crossings` are of this frame afterwards.
    out : (H * W, 3) uint8
        The frame, as `match_pixels.fill_carpet` fills it.
    """
    crossings, spans, marks, until_m = room.crossings, room.spans, room.marks, room.until_m
    crossings.lengths[:] = 0
    meet_walls(standing.walls, 0, eye, bearings, crossings)
    meet_boxes(standing.boxes, standing.first_face, eye, bearings, crossings)
    meet_cylinders(standing.cylinders, standing.first_cylinder, eye, light.lamp_rad, bearings, crossings)
    stack_spans(crossings, things, bearings, eye, light, walls, ball, spans)
    floor_until(spans, eye.height_m, farthest_m, until_m)
    count = mark_lines(rays, eye, until_m, paint.half_m, paint.lines, marks, 0)
    count = mark_arcs(rays, eye, until_m, paint.half_m, paint.arcs, marks, count)
    paint_marked(rays, light, eye, plain, marks, count, out)
    draw_pixels(rays, eye, spans, ball, plain, light, out)
