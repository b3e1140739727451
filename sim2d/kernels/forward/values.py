"""Common values of the compiled loops of a forward camera's frame: lens, eye, outlines."""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array


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
