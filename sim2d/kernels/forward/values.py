"""Common values of the compiled loops that draw a forward camera's frame: lens, eye, outlines, view, tile."""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, Int64Array, UInt8Array
from sim2d.kernels.frame_values import FloorPaint, Nets


class ForwardLens(NamedTuple):
    """The slopes of an image's pixels, in tiles; a slope is right or down per ahead, in the camera's frame."""

    #: (R, C, 2, P) float32: slope right and slope down of the middles of each tile's pixels, row by row; (0, 0, 2, P)
    #: for a lens without distortion, where both are linear in the pixel's column and row.
    slopes: Float32Array
    #: (R, C, P) float32: relative light of each pixel of a tile.
    gains: Float32Array
    #: (R + 1, 2 C + 1, 2) float64: slopes right and down of tiles' corners and middles of upper and lower sides
    corner_slopes: FloatArray
    #: (R, C, 4) float32: change of the slope right with u and v, and of the slope down with u and v, in each tile.
    per_pixel: Float32Array
    #: (R, C, 4) float32: least and greatest slope right, least and greatest slope down of each tile's pixel areas
    bounds: Float32Array
    #: (2, P) float32: column and row of each pixel in a tile.
    places: Float32Array


class ForwardEye(NamedTuple):
    """Place and orientation of a forward camera."""

    #: Centre of projection, field frame.
    x_m: float
    y_m: float
    height_m: float
    #: (3, 3) float64: rotation from the camera's frame (ahead, left, up) into the field frame, for the middle row.
    rotation: FloatArray
    #: (3,) float64: rotation of the camera about its own axes from the readout of the first row to that of the last.
    turn_rad: FloatArray


class Outlines(NamedTuple):
    """Where in the image things may be visible: bounds of their slopes along four axes."""

    #: (P, 10) float32: least and greatest slope right, slope down, along an axis of the plane of slopes and across it;
    #: that axis.
    bounds: Float32Array
    #: (P, 3) int32: kind (see `forward.outlines`), number, and whether it is thinner than two pixels somewhere.
    owners: Int32Array


class View(NamedTuple):
    """Everything from which the tiles of a frame are drawn, field axes."""

    paint: FloorPaint
    nets: Nets
    #: (T, 10) float32: `UprightThings.rows` with the origin at the eye's foot.
    things: Float32Array
    #: (C, 3) float32: BGR colours of things.
    colors: Float32Array
    outlines: Outlines
    #: (3,) float32: place of the eye, field frame, metres.
    here: Float32Array
    #: (4,) float32: level of the light at the field's centre, its change per metre along x and y, its least value.
    lit: Float32Array
    #: (2,) float32: unit direction towards the lamp.
    lamp: Float32Array


class Tile(NamedTuple):
    """One tile of N pixels, row by row: what may be visible in it, and what is drawn so far.

    The arrays are allocated once per frame, because allocation for each tile would take longer than drawing it.
    """

    #: Rows and columns of pixels.
    shape: tuple[int, int]
    #: By kind: numbers of the owners that may be visible, and of their outlines; their count.
    seen: Int32Array
    seen_count: Int64Array
    #: (2, N) float32: slopes right and down of the pixels; (4,) float32: as a row of `ForwardLens.per_pixel`.
    slopes: Float32Array
    per_pixel: Float32Array
    #: (3, N) float32: rays through the pixels' middles; (2, 3) float64: their change per pixel along u and along v.
    rays: Float32Array
    steps: FloatArray
    #: (N,) float32: light on the floor; fraction of each pixel that is painted, or that is carpet.
    tone: Float32Array
    covered: Float32Array
    #: (3, N) float32: blue, green, red.
    colors: Float32Array
    #: (2, N) float32: distance, in lengths of the ray, of the thing in each pixel, and its fraction of the pixel.
    nearest: Float32Array
    #: (3, C) float32: rays through the pixels' corners; (C,): id of the first thing they meet, and its distance.
    corner_rays: Float32Array
    ids: Int32Array
    depth: Float32Array
    #: (N,) uint8: 1 if a thin thing may be visible in the pixel.
    fine: UInt8Array
