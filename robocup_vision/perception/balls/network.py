"""Classifier of balls: two small convolutional networks, run by OpenCV, on pictures in which balls have a fixed size.

The camera determines the size of a ball at every place of the picture. The picture is divided into strips of similar
size, scaled so that a ball's radius is about `STRIP_RADIUS_PX`, and into tiles, because a fisheye bends strips. The
first network answers for every `STRIDE_PX`-th pixel of a tile whether a ball may be there. The second classifies crops
at the most likely places, in which a ball's radius is `CROP_RADIUS_PX`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from typing import NamedTuple

import cv2
import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array, UInt8Array
from robocup_vision.perception.balls.ball import lie_apart
from robocup_vision.perception.balls.sizes import BallSizes, ball_sizes_px
from robocup_vision.perception.networks import Shrunk, read_network

# first network: approximate radius of a ball, distance of its answers, and position of the first one
STRIP_RADIUS_PX, STRIDE_PX, FIRST_PX = 4.0, 4, 7
# second network: radius of a ball, and side of its crops
CROP_RADIUS_PX, CROP_PX = 6.0, 32
# ratio of ball sizes between strips, within the range for which the networks are trained
SIZE_STEP = 1.65
# smallest and largest ball size, in steps from STRIP_RADIUS_PX
_FIRST_SIZE, _LAST_SIZE = -1, 5
# grid of computed radii; far balls lie in a strip of about ten rows
_GRID_PX = 16, 4
# greatest error of a size in a strip, in steps; neighbouring strips overlap a little
_SIZE_SLACK = 0.55
# greatest width of a tile, in answers: wider tiles show more outside the curved strip, narrower ones more border
_TILE_ANSWERS = 12
# search radius around a ball's last place, in its radii
_MOVES_RADII = 5.0
# least answer of the first network for the second to be used, greatest number of such places, and their least distance
# in radii
FIRST_NATS, MAX_PLACES, _APART_RADII = 1.0, 10, 0.8


class BallSpot(NamedTuple):
    """A sighting of a ball by a network."""

    #: centre of the ball in the frame
    u_px: float
    v_px: float
    radius_px: float  #: radius of a ball on the floor there
    nats: float  #: log-likelihood ratio


class _Part(NamedTuple):
    """A part of the frame: its upper left corner, its scaled width and height, and a ball's radius."""

    left: float
    top: float
    size: tuple[int, int]
    radius_px: float


@dataclass(frozen=True, eq=False)
class BallStrips:
    """The parts of a camera's frames to search, with their scales, for one attitude of the camera."""

    parts: tuple[_Part, ...]  #: tiles of the frame, those with far balls first
    answers: Int64Array  #: (N, 3) int64: part, row and column of the network's answers on the floor
    places_px: FloatArray  #: (N, 3) float64: pixel u, v of each in the frame, and the radius of a ball there
    scales: FloatArray  #: (N,) float64: frame pixels for each pixel of its part

    @property
    def _ends(self) -> FloatArray:
        """(P,) float64: fraction of the work after each part."""
        work = np.cumsum([width * height for width, height in (part.size for part in self.parts)], dtype=np.float64)
        return np.asarray(work / work[-1], dtype=np.float64)

    def some(self, begin: float, end: float, balls: Sequence[BallSpot]) -> BallStrips | None:
        """Return a fraction of the work, and the parts to which balls may have moved; None if there are none.

        Parameters
        ----------
        begin, end : float
            Selects the parts that end within these fractions of the work; beyond 1 it continues with the first.
        """
        chosen = ((self._ends > begin) & (self._ends <= end)) | (self._ends <= end - 1.0)
        for ball in balls:
            chosen[self.answers[is_near(self.places_px, ball), 0]] = True
        if not chosen.any():
            return None
        kept, number = chosen[self.answers[:, 0]], np.cumsum(chosen) - 1
        answers = self.answers[kept]
        answers[:, 0] = number[answers[:, 0]]
        parts = tuple(part for part, is_chosen in zip(self.parts, chosen, strict=True) if is_chosen)
        return BallStrips(parts, answers, self.places_px[kept], self.scales[kept])


class BallPlaces:
    """Radii of balls on the floor all over a camera's frames, for one attitude of the camera.

    Parameters
    ----------
    mask : (H, W) uint8 or None
        Non-zero pixels are never used.
    """

    def __init__(self, sizes: BallSizes, mask: UInt8Array | None) -> None:
        self._size_px, self._mask = sizes.camera.size_px, mask
        self._u, self._v = (
            np.arange(0, side + step, step, dtype=np.float64)
            for side, step in zip(self._size_px, _GRID_PX, strict=True)
        )
        pixels = np.stack(np.meshgrid(self._u, self._v), axis=-1)
        along, across = ball_sizes_px(sizes.camera, sizes.height_m, sizes.radius_m, pixels)
        self._radii = np.sqrt(along * across).astype(np.float32)

    @cached_property
    def strips(self) -> BallStrips | None:
        """Strips of the whole frame; None if it shows no floor on which a ball is large enough."""
        wanted = []
        for size in range(_FIRST_SIZE, _LAST_SIZE + 1):
            radius = STRIP_RADIUS_PX * SIZE_STEP**size
            seen = np.abs(np.log(np.maximum(self._radii, 1e-9) / radius)) <= _SIZE_SLACK * math.log(SIZE_STEP)
            if seen.any():
                at_v, at_u = np.nonzero(seen)
                box = self._u[at_u.min()], self._v[at_v.min()], self._u[at_u.max()], self._v[at_v.max()]
                wanted.append(self._part(box, radius))
        return self._strips(wanted)

    def _part(self, box: tuple[float, float, float, float], radius: float) -> _Part:
        """Return the part whose answers cover a box of the frame; it may extend beyond the frame."""
        scale = radius / STRIP_RADIUS_PX
        sides = ((box[0], box[2], self._size_px[0]), (box[1], box[3], self._size_px[1]))
        ends = [(max(low, 0.0), min(high, side - 1.0)) for low, high, side in sides]
        counts = [math.ceil((high - low) / (scale * STRIDE_PX)) for low, high in ends]
        width, height = (STRIDE_PX * count + 2 * FIRST_PX + 1 for count in counts)
        return _Part(ends[0][0] - FIRST_PX * scale, ends[1][0] - FIRST_PX * scale, (width, height), radius)

    def _strips(self, parts: list[_Part]) -> BallStrips | None:
        """Find the network's answers on the floor, and divide the parts into tiles around these."""
        tiles: list[_Part] = []
        answers: list[FloatArray] = []
        for part in parts:
            every = self._answers(part)
            across = every[:, 1] // _TILE_ANSWERS
            for tile in np.unique(across):
                here = every[across == tile]
                first, last = here[:, :2].min(axis=0), here[:, :2].max(axis=0)
                here[:, :2] -= first
                height, width = (int(STRIDE_PX * count) + 2 * FIRST_PX + 1 for count in last - first)
                down, aside = (first * STRIDE_PX * part.radius_px / STRIP_RADIUS_PX).tolist()
                answers.append(np.column_stack([np.full(len(here), len(tiles)), here]))
                tiles.append(_Part(part.left + aside, part.top + down, (width, height), part.radius_px))
        if not tiles:
            return None
        rows = np.concatenate(answers)
        return BallStrips(tuple(tiles), rows[:, :3].astype(np.int64), rows[:, 3:6], rows[:, 6])

    def _answers(self, part: _Part) -> FloatArray:
        """Return for each answer row and column, u and v in the frame, a ball's radius there, and the scale."""
        width, height = self._size_px
        scale = part.radius_px / STRIP_RADIUS_PX
        down = np.arange(FIRST_PX, part.size[1] - FIRST_PX, STRIDE_PX)
        aside = np.arange(FIRST_PX, part.size[0] - FIRST_PX, STRIDE_PX)
        at_u, at_v = np.meshgrid(part.left + aside * scale, part.top + down * scale)
        keep = (at_u >= -0.5) & (at_u <= width - 0.5) & (at_v >= -0.5) & (at_v <= height - 0.5)
        at_grid = (at_u / _GRID_PX[0]).astype(np.float32), (at_v / _GRID_PX[1]).astype(np.float32)
        there = cv2.remap(self._radii, *at_grid, cv2.INTER_LINEAR).astype(np.float64)
        keep &= np.abs(np.log(np.maximum(there, 1e-9) / part.radius_px)) <= _SIZE_SLACK * math.log(SIZE_STEP)
        if self._mask is not None:
            rows, columns = (np.clip(x.round().astype(int), 0, side - 1) for x, side in ((at_v, height), (at_u, width)))
            keep &= self._mask[rows, columns] == 0
        row, column = np.meshgrid(np.arange(len(down)), np.arange(len(aside)), indexing="ij")
        columns = (row, column, at_u, at_v, there, np.full(row.shape, scale))
        answers: FloatArray = np.stack(columns, axis=-1)[keep].astype(np.float64)
        return answers


def crop_around(shrunk: Shrunk, u_px: float, v_px: float, radius_px: float, side: int = CROP_PX) -> UInt8Array:
    """Return a square of a frame around a ball, scaled to the radius `CROP_RADIUS_PX`."""
    scale = radius_px / CROP_RADIUS_PX
    reach = scale * (side - 1) / 2
    return shrunk.part(u_px - reach, v_px - reach, scale, (side, side))


class BallNetwork:
    """The networks and their scratch memory; not shared between threads.

    Parameters
    ----------
    first, second : bytes, optional
        ONNX files; the package's own by default.
    """

    def __init__(self, first: bytes | None = None, second: bytes | None = None) -> None:
        folder = files("robocup_vision.perception.balls")
        stored = (first or (folder / "places.onnx").read_bytes(), second or (folder / "ball.onnx").read_bytes())
        self._first, self._second = (read_network(content) for content in stored)

    def look(self, frame: UInt8Array, strips: BallStrips, min_nats: float) -> list[BallSpot]:
        """Return the balls, the most likely first, without those that overlap a more likely one."""
        shrunk = Shrunk(frame)
        likely = []
        for place in self.places(shrunk, strips)[:MAX_PLACES]:
            self._second.setInput(cv2.dnn.blobFromImage(crop_around(shrunk, *place[:3])))
            nats, off_u, off_v = (float(x) for x in self._second.forward().reshape(-1)[:3])
            if nats >= min_nats:
                scale = place.radius_px / CROP_RADIUS_PX
                likely.append(BallSpot(place.u_px + scale * off_u, place.v_px + scale * off_v, place.radius_px, nats))
        return _apart(sorted(likely, key=lambda one: -one.nats), 1.3)

    def places(self, shrunk: Shrunk, strips: BallStrips, min_nats: float = FIRST_NATS) -> list[BallSpot]:
        """Return the places where a ball may be by the first network, the most likely first."""
        found = []
        for part in strips.parts:
            # one at a time, so that the layers' results stay in the processor's cache
            shown = shrunk.part(part.left, part.top, part.radius_px / STRIP_RADIUS_PX, part.size)
            self._first.setInput(cv2.dnn.blobFromImage(shown))
            found.append(self._first.forward()[0].transpose(1, 2, 0))
        numbers, rows, columns = strips.answers.T
        answer = np.empty((len(rows), 3), dtype=np.float32)
        # answers are sorted by part
        begins = np.searchsorted(numbers, np.arange(len(found) + 1))
        for answers, begin, end in zip(found, begins[:-1], begins[1:], strict=True):
            answer[begin:end] = answers[rows[begin:end], columns[begin:end]]
        nats = answer[:, 0]
        likely = np.flatnonzero(nats >= min_nats)
        likely = likely[np.argsort(-nats[likely])][: 8 * MAX_PLACES]
        off = answer[likely, 1:] * strips.scales[likely, None]
        places = strips.places_px[likely]
        sightings = [
            BallSpot(float(u + du), float(v + dv), float(radius), float(nat))
            for (u, v, radius), (du, dv), nat in zip(places, off, nats[likely], strict=True)
        ]
        return _apart(sightings, _APART_RADII)


def _apart(sightings: list[BallSpot], radii: float) -> list[BallSpot]:
    """Return the sightings, the most likely first, without those too near to a more likely one."""
    return [sightings[n] for n in lie_apart([one[:3] for one in sightings], radii)]


def is_near(places: FloatArray, ball: BallSpot) -> BoolArray:
    """Whether a ball may have moved to places (..., 3 or more), u, v and radius, within a frame."""
    off = places[..., :2] - (ball.u_px, ball.v_px)
    near = np.hypot(off[..., 0], off[..., 1]) <= _MOVES_RADII * ball.radius_px
    near &= np.abs(np.log(places[..., 2] / ball.radius_px)) <= _SIZE_SLACK * math.log(SIZE_STEP)
    return np.asarray(near, dtype=np.bool_)
