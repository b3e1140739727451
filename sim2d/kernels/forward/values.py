"""Common values of the compiled loops of a forward camera's frame: lens, eye, paint, things, outlines."""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt64Array


class ForwardLens(NamedTuple):
    """What the lens makes of an image, cut into tiles; a slope is right or down per ahead, in the camera's frame.

    Parameters
    ----------
    slopes : (R, C, 2, P) float32
        Slope right and slope down of the middles of each tile's pixels, row by row; (0, 0, 2, P) of a lens that does
        not distort, where both change evenly.
    gains : (R, C, P) float32
        Light that each pixel of a tile gets, relative.
    corner_slopes : (R + 1, 2 C + 1, 2) float64
        Right and down, of the corners of all tiles and the middles of their upper and lower sides.
    per_pixel : (R, C, 4) float32
        Of each tile: change of the slope right by u and v, of the slope down by u and v.
    bounds : (R, C, 4) float32
        Of each tile: least and greatest slope right, least and greatest slope down, with the pixels' own size.
    places : (2, P) float32
        Column and row of each pixel in a tile.
    """

    slopes: Float32Array
    gains: Float32Array
    corner_slopes: FloatArray
    per_pixel: Float32Array
    bounds: Float32Array
    places: Float32Array


class ForwardEye(NamedTuple):
    """Where a forward camera is, and where it looks.

    Parameters
    ----------
    x_m, y_m, height_m : float
        Centre of projection, field frame.
    rotation : (3, 3) float64
        From the camera's frame (ahead, left, up) into the field frame, when the middle row is read.
    turn_rad : (3,) float64
        How far the camera turns about its own axes while its rows are read from the first to the last.
    """

    x_m: float
    y_m: float
    height_m: float
    rotation: FloatArray
    turn_rad: FloatArray


class FloorPaint(NamedTuple):
    """What is painted on the floor, field frame, metres.

    Parameters
    ----------
    lines : (N, 5) float64
        Start x, y, unit direction x, y, length.
    arcs : (M, 6) float64
        Centre x, y, radius, direction x, y of the middle, cosine of half the sweep (-2: a full circle).
    half_m : float
        Half the width of a line.
    edges : (K, 4) float64
        Edges of the carpet, counter-clockwise: x0, y0, x1, y1.
    is_convex : bool
        Whether the carpet is.
    colors : (3, 3) float32
        BGR of carpet, line and the ground around the carpet.
    """

    lines: FloatArray
    arcs: FloatArray
    half_m: float
    edges: FloatArray
    is_convex: bool
    colors: Float32Array


class UprightThings(NamedTuple):
    """What stands or lies on the floor.

    Parameters
    ----------
    rows : (T, 10) float64
        See the columns' names in `forward_things`.
    colors : (C, 3) float32
        BGR.
    """

    rows: FloatArray
    colors: Float32Array


class Outlines(NamedTuple):
    """Where in the image things may be seen: bounds of their slopes along four axes.

    Parameters
    ----------
    bounds : (P, 10) float32
        Least and greatest slope right, slope down, along an axis of the plane of slopes and across it; that axis.
    owners : (P, 3) int32
        Kind (see `forward_outlines`), number, and whether it is thinner than two pixels somewhere.
    """

    bounds: Float32Array
    owners: Int32Array


class WallPicture(NamedTuple):
    """What is seen on the round wall behind the field.

    Parameters
    ----------
    cells : (H + 2, 3 W / 2) uint64
        Blue, green and red as `pack_cells` packs them; the row at the floor and the uppermost one are there twice, and
        after a full turn of columns by azimuth from +x the first half comes again, so that no index wraps.
    turn : int
        W, columns of a full turn.
    rows_per_m, radius_m : float
        Its scale and radius.
    """

    cells: UInt64Array
    turn: int
    rows_per_m: float
    radius_m: float
