"""Common values of the compiled loops of a forward camera's frame: lens, eye, outlines, view, tile."""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, Int64Array, UInt8Array
from sim2d.kernels.frame_values import FloorPaint, Nets


class ForwardLens(NamedTuple):
    """What the lens makes of an image, cut into tiles; a slope is right or down per ahead, in the camera's frame."""

    #: (R, C, 2, P) float32: slope right and slope down of the middles of each tile's pixels, row by row; (0, 0, 2, P)
    #: of a lens that does not distort, where both change evenly.
    slopes: Float32Array
    #: (R, C, P) float32: light that each pixel of a tile gets, relative.
    gains: Float32Array
    #: (R + 1, 2 C + 1, 2) float64: right and down, of the corners of all tiles and the middles of their upper and lower
    #: sides.
    corner_slopes: FloatArray
    #: (R, C, 4) float32: of each tile: change of the slope right by u and v, of the slope down by u and v.
    per_pixel: Float32Array
    #: (R, C, 4) float32: of each tile: least and greatest slope right, least and greatest slope down, with the pixels'
    #: own size.
    bounds: Float32Array
    #: (2, P) float32: column and row of each pixel in a tile.
    places: Float32Array


class ForwardEye(NamedTuple):
    """Where a forward camera is, and where it looks."""

    #: Centre of projection, field frame.
    x_m: float
    y_m: float
    height_m: float
    #: (3, 3) float64: from the camera's frame (ahead, left, up) into the field frame, when the middle row is read.
    rotation: FloatArray
    #: (3,) float64: how far the camera turns about its own axes while its rows are read from the first to the last.
    turn_rad: FloatArray


class Outlines(NamedTuple):
    """Where in the image things may be seen: bounds of their slopes along four axes."""

    #: (P, 10) float32: least and greatest slope right, slope down, along an axis of the plane of slopes and across it;
    #: that axis.
    bounds: Float32Array
    #: (P, 3) int32: kind (see `forward.outlines`), number, and whether it is thinner than two pixels somewhere.
    owners: Int32Array


class View(NamedTuple):
    """What all tiles of a frame are drawn from, field axes."""

    paint: FloorPaint
    nets: Nets
    #: (T, 10) float32: `UprightThings.rows` with the eye's foot as the origin.
    things: Float32Array
    #: (C, 3) float32: BGR of things.
    colors: Float32Array
    outlines: Outlines
    #: (3,) float32: the eye, field frame, metres.
    here: Float32Array
    #: (4,) float32: level of the light at the field's centre, its change per metre along x and y, its least value.
    lit: Float32Array
    #: (2,) float32: unit direction towards the lamp.
    lamp: Float32Array


class Tile(NamedTuple):
    """One tile of N pixels, row by row: what may be seen in it, and what is drawn so far.

    Arrays are made once a frame: for each tile that takes longer than the tile's own pixels.
    """

    #: Rows and columns of pixels.
    shape: tuple[int, int]
    #: Numbers of the owners that may be seen, by kind, and of their outlines; how many they are.
    seen: Int32Array
    seen_count: Int64Array
    #: (2, N) float32: slopes right and down of the pixels; (4,) float32: as a row of `ForwardLens.per_pixel`.
    slopes: Float32Array
    per_pixel: Float32Array
    #: (3, N) float32: rays through the pixels' middles; (2, 3) float64: their change by a pixel along u and along v.
    rays: Float32Array
    steps: FloatArray
    #: (N,) float32: light on the floor; share of each pixel that is painted, or carpet.
    tone: Float32Array
    covered: Float32Array
    #: (3, N) float32: blue, green, red.
    colors: Float32Array
    #: (2, N) float32: what stands in each pixel: its distance in lengths of the ray, and its share of the pixel.
    nearest: Float32Array
    #: (3, C) float32: rays through the pixels' corners; (C,): what they meet first, and how far away.
    corner_rays: Float32Array
    ids: Int32Array
    depth: Float32Array
    #: (N,) uint8: 1 where a thin thing may be seen.
    fine: UInt8Array
