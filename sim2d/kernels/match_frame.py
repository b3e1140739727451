"""Compiled: a mirror camera's match frame in one call, from what each bearing meets to the last pixel.

A call from Python takes its tuples of arrays apart, which for ten calls takes longer than some of these loops do.
"""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.bearing_profile import meet_things, stack_spans
from sim2d.kernels.floor_lines import floor_until, mark_arcs, mark_lines
from sim2d.kernels.frame_values import (
    BallSphere,
    Crossings,
    FloorPaint,
    Lighting,
    PaintMarks,
    PixelRays,
    RoomWall,
    Spans,
    UprightThings,
    Viewpoint,
)
from sim2d.kernels.match_pixels import draw_pixels, paint_marked


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
    things: UprightThings,
    paint: FloorPaint,
    farthest_m: float,
    ball: BallSphere,
    walls: RoomWall,
    light: Lighting,
    eye: Viewpoint,
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
    meet_things(things, paint.edges, light.lamp_rad, eye, rays.directions, crossings)
    stack_spans(crossings, things, rays.directions, eye, light, walls, ball, spans)
    floor_until(spans, eye.height_m, farthest_m, until_m)
    count = mark_lines(rays, eye, until_m, paint.half_m, paint.lines, marks, 0)
    count = mark_arcs(rays, eye, until_m, paint.half_m, paint.arcs, marks, count)
    paint_marked(rays, light, eye, plain, marks, count, out)
    draw_pixels(rays, eye, spans, ball, plain, light, out)
