"""Compiled: a mirror camera's match frame in one call, from what each bearing meets to the last pixel.

A call from Python takes its tuples of arrays apart, which for ten calls takes longer than some of these loops do.
"""

from __future__ import annotations

from robocup_vision.arrays import UInt8Array
from robocup_vision.compiling.loops import compiled
from sim2d.kernels.bearing_profile import meet_things, stack_spans
from sim2d.kernels.floor_lines import mark_arcs, mark_lines
from sim2d.kernels.frame_values import (
    Crossings,
    FloorPaint,
    Lighting,
    Nets,
    PaintMarks,
    PixelRays,
    Spans,
    UprightThings,
    Viewpoint,
    WallPicture,
)
from sim2d.kernels.match_pixels import draw_pixels, paint_marked, shade_carpet
from sim2d.kernels.nets import lay_nets
from sim2d.kernels.things import BALL, KIND, RADIUS, X0, Y0


@compiled
def draw_over_carpet(
    things: UprightThings,
    paint: FloorPaint,
    nets: Nets,
    farthest_m: float,
    wall: WallPicture,
    light: Lighting,
    eye: Viewpoint,
    rays: PixelRays,
    crossings: Crossings,
    spans: Spans,
    marks: PaintMarks,
    out: UInt8Array,
) -> None:
    """Draw lines, what stands on the floor and the room behind it over plain carpet.

    Parameters
    ----------
    farthest_m : float
        Floor farther away is not seen.
    crossings, spans, marks
        To work in; no ray is marked.
    out : (H * W, 3) uint8
        The frame, as `match_pixels.fill_carpet` fills it.
    """
    crossings.lengths[:] = 0
    meet_things(things, paint.edges, light.lamp_rad, eye, rays.directions, crossings)
    stack_spans(crossings, things, paint.colors, rays.directions, eye, light, wall, spans)
    count = mark_lines(rays, eye, farthest_m, paint.half_m, paint.lines, marks, 0)
    count = mark_arcs(rays, eye, farthest_m, paint.half_m, paint.arcs, marks, count)
    paint_marked(rays, light, eye, paint.colors, marks, count, out)
    for k in range(len(things.rows)):
        if things.rows[k, KIND] == BALL:
            shade_carpet(rays, eye, things.rows[k, X0], things.rows[k, Y0], things.rows[k, RADIUS], out)
    draw_pixels(rays, eye, spans, things, light, out)
    lay_nets(nets, rays, crossings, things, eye, light, out)
