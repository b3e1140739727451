"""Common values of the compiled loops of a match camera's frame: viewpoint, light, rays, spans."""

from __future__ import annotations

from typing import NamedTuple

from robocup_vision.arrays import Float32Array, FloatArray, Int32Array, UInt32Array


class Viewpoint(NamedTuple):
    """Where a camera's centre of projection is.

    Parameters
    ----------
    x_m, y_m, heading_rad : float
        Field frame.
    height_m : float
        Above the floor.
    """

    x_m: float
    y_m: float
    heading_rad: float
    height_m: float


class Lighting(NamedTuple):
    """Light that changes evenly over the field, and a lamp at the side.

    Parameters
    ----------
    level : float
        At the field's centre.
    per_m_x, per_m_y : float
        Change per metre along x and y.
    min_level : float
        It never falls below this.
    lamp_rad : float
        Direction of the lamp, field frame.
    """

    level: float
    per_m_x: float
    per_m_y: float
    min_level: float
    lamp_rad: float


class Bearings(NamedTuple):
    """The bearings of a frame.

    Parameters
    ----------
    directions : (K, 3) float64
        Bearing (rad), its cosine and sine, in the viewpoint's frame, evenly spaced.
    per_turn : int
        How many bearings would make a full turn.
    """

    directions: FloatArray
    per_turn: int


class Crossings(NamedTuple):
    """What stands along each bearing, nearest first.

    Parameters
    ----------
    lengths : (K,) int32
        Of the lists.
    entries : (K, E, 4) float32
        Distances where a thing begins and ends (m), its number, its shade; see the columns' names in `bearing_profile`.
    """

    lengths: Int32Array
    entries: Float32Array


class Things(NamedTuple):
    """What can stand on the field: one row for each side of a wall, box face, cylinder.

    Parameters
    ----------
    rows : (T, 7) float64
        See the columns' names in `bearing_profile`: height (m), number of colour bands, row of the lowest band's
        colour, of the top's and of the marker's colour (-1: none), squared radius less that of the marker (m^2),
        whether the floor ends there.
    colors : (C, 3) float64
        BGR.
    """

    rows: FloatArray
    colors: FloatArray


class Nets(NamedTuple):
    """Goal nets.

    Parameters
    ----------
    rows : (P, 14) float64
        Rectangles: a corner, unit directions of both edges (field frame), their lengths, the width of a mesh along
        each, and a cord's thickness (m).
    color : (3,) float32
        BGR of the cords.
    """

    rows: FloatArray
    color: Float32Array


class RoomWall(NamedTuple):
    """What is seen behind the field.

    Parameters
    ----------
    picture : (H, W, 3) float32
        The round wall, row 0 at the floor; a bearing shows one colour of it.
    rows_per_m, radius_m : float
        Its scale and radius.
    ground : (3,) float64
        BGR of the ground where the floor has ended.
    """

    picture: Float32Array
    rows_per_m: float
    radius_m: float
    ground: FloatArray


class BallSphere(NamedTuple):
    """The ball.

    Parameters
    ----------
    x_m, y_m : float
        Field frame.
    radius_m : float
        0: there is none.
    shade_reach_m : float
        How far its shade reaches on the floor.
    """

    x_m: float
    y_m: float
    radius_m: float
    shade_reach_m: float


class Spans(NamedTuple):
    """What each bearing shows, from steeply down to above the horizon.

    Parameters
    ----------
    ends : (K, S) float32
        Slope (rise over run) at which each span ends; the last is infinite.
    kinds : (K, S) int32
        What it shows: FLOOR, PAINT or BALL.
    paint : (K, S, 3) float32
        Light of PAINT spans, BGR.
    near_ball : (K,) int32
        Whether the ball's shade may be met.
    """

    ends: Float32Array
    kinds: Int32Array
    paint: Float32Array
    near_ball: Int32Array


class PixelRays(NamedTuple):
    """One ray a pixel, by bearing, then by slope.

    Parameters
    ----------
    rays : (9, P) float32
        See the rows' names in `floor_lines`: floor point in the viewpoint's frame (m), least and greatest slope, gain,
        radial and tangential size of the patch of floor, distances where it begins and ends (m).
    pixels : (P,) uint32
        Flat indices of the pixels.
    first : (K + 1,) int32
        First ray of each bearing, and P.
    directions : (K, 3) float64
        As in `Bearings`, over a full turn from 0.
    spread : (2,) float64
        Half a patch's tangential size and how far its middle may lie beside the bearing are together at most
        `spread[0] + spread[1] * distance`, metres.
    """

    rays: Float32Array
    pixels: UInt32Array
    first: Int32Array
    directions: FloatArray
    spread: FloatArray


class PaintMarks(NamedTuple):
    """Which rays meet paint.

    Parameters
    ----------
    fraction : (P,) float32
        Painted fraction of each ray's patch of floor.
    marked : (P,) int32
        Rays whose fraction is not 0; the loops pass on how many.
    """

    fraction: Float32Array
    marked: Int32Array
