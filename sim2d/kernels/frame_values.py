"""Common values of the compiled loops that draw a match camera's frame: viewpoint, light, rays, bearings."""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt32Array, UInt64Array


class Viewpoint(NamedTuple):
    """A camera's centre of projection and heading."""

    #: Place and heading in the field frame.
    x_m: float
    y_m: float
    heading_rad: float
    #: Height above the floor.
    height_m: float


class Lighting(NamedTuple):
    """Light with a constant gradient over the field, and a lamp at the side."""

    #: Light at the field's centre.
    level: float
    #: Change per metre along x and y.
    per_m_x: float
    per_m_y: float
    #: Lower bound of the light.
    min_level: float
    #: Direction of the lamp, field frame.
    lamp_rad: float


class FloorPaint(NamedTuple):
    """Lines and carpet of the floor, field frame, metres."""

    #: (N, 5) float64: start x, y, unit direction x, y, length.
    lines: FloatArray
    #: (M, 6) float64: centre x, y, radius, direction x, y of the middle, cosine of half the sweep (-2: a full circle).
    arcs: FloatArray
    #: Half the width of a line.
    half_m: float
    #: (K, 4) float64: edges of the carpet, counter-clockwise: x0, y0, x1, y1.
    edges: FloatArray
    #: Whether the carpet is convex.
    is_convex: bool
    #: (3, 3) float32: BGR of carpet, line and the ground around the carpet.
    colors: Float32Array


class UprightThings(NamedTuple):
    """Things that stand or lie on the floor."""

    #: (T, 10) float64: one thing per row; see the columns' names in `things`.
    rows: FloatArray
    #: (C, 3) float32: BGR.
    colors: Float32Array


class Nets(NamedTuple):
    """Goal nets."""

    #: (P, 14) float64: rectangles: a corner, unit directions of both edges (field frame), their lengths, the width of a
    #: mesh along each, and a cord's thickness (m).
    rows: FloatArray
    #: (3,) float32: BGR of the cords.
    color: Float32Array


class WallPicture(NamedTuple):
    """The picture on the round wall behind the field."""

    #: (H + 2, 3 W / 2) uint64: blue, green and red as `pack_cells` packs them. Columns follow the azimuth from +x. The
    #: first half is repeated after a full turn, as are the row at the floor and the uppermost one: no index wraps.
    cells: UInt64Array
    #: W: number of columns of a full turn.
    turn: int
    #: Rows per metre of height, and the wall's radius.
    rows_per_m: float
    radius_m: float


class PixelRays(NamedTuple):
    """One ray per pixel, sorted by bearing, then by slope."""

    #: (9, P) float32: see the rows' names in `floor_lines`: floor point in the viewpoint's frame (m), least and
    #: greatest slope, gain, radial and tangential size of the patch of floor, distances where it begins and ends (m).
    rays: Float32Array
    #: (P,) uint32: flat indices of the pixels.
    pixels: UInt32Array
    #: (K + 1,) int32: index of the first ray of each bearing, and P.
    first: Int32Array
    #: (K, 3) float64: each bearing (rad), its cosine and sine, viewpoint's frame, evenly over a full turn from 0.
    directions: FloatArray
    #: (2,) float64: half a patch's tangential size and how far its middle may lie beside the bearing are together at
    #: most `spread[0] + spread[1] * distance`, metres.
    spread: FloatArray


class MirrorView(NamedTuple):
    """Everything from which a mirror camera's frame is drawn."""

    things: UprightThings
    paint: FloorPaint
    nets: Nets
    wall: WallPicture
    light: Lighting
    pixels: PixelRays
    #: Distance beyond which the floor is not visible.
    farthest_m: float
    eye: Viewpoint


class Bearings(NamedTuple):
    """Profiles of K bearings, and which of P rays meet paint; allocated once, filled for each frame."""

    #: (K,) int32: number of things along each bearing.
    lengths: Int32Array
    #: (K, E, 5) float32: these things, nearest first: distances where one begins and ends (m), its number, its first
    #: colour there and its shade, or the slopes between which a ball is visible; see the columns' names in
    #: `bearing_profile`.
    entries: Float32Array
    #: (K, S) float32: slope (rise over run) at which each span of the bearing ends, from steeply down to above the
    #: horizon; the last is infinite.
    ends: Float32Array
    #: (K, S) int32: kind of each span; see the kinds' names in `bearing_profile`.
    kinds: Int32Array
    #: (K, S, 3) float32: light of PAINT spans, BGR; for a ball's span the light of the pixel drawn last.
    paint: Float32Array
    #: (P,) float32: painted fraction of each ray's patch of floor; all 0 between frames.
    fraction: Float32Array
    #: (P,) int32: rays whose fraction is not 0, as many as the loops return.
    marked: Int32Array
