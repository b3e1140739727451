"""Upright pictures for training the kind classifier: robots, people and other places in photographs."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array, UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.evaluation.boxes import Box
from robocup_vision.evaluation.dataset import Dataset
from robocup_vision.evaluation.detections import KIND_OF_BOX, OBSTACLE_KINDS
from robocup_vision.perception.free_space import FreeSpace
from robocup_vision.perception.kinds.network import KINDS, SEEN_PX, upright_pictures
from robocup_vision.perception.networks import Shrunk
from robocup_vision.view import View
from robocup_vision.vision import Vision

OTHER = len(KINDS)
# margin around the network's input on each side, for shifts and scaling
RIM_PX = 8
_FARTHEST_M = 8.0
# boxes are drawn a little larger than the thing in them
_BOX_RIM_PX = 2.0
# a place is apart from a foot if it is at least this far aside, or its range differs at least by this ratio
_ASIDE_M, _RANGE_RATIO = 0.5, 1.25
# number of places of each photograph at the ends of the free floor, and on it
_ENDS, _FLOORS = 16, 12


class KindCrops(NamedTuple):
    """Upright pictures, and the kind of thing in each."""

    #: (N, 64, 52, 3) uint8: BGR.
    images: UInt8Array
    #: (N,) int64: index of `KINDS`, or `OTHER`.
    kinds: Int64Array


def joined(parts: Sequence[KindCrops]) -> KindCrops:
    """Concatenate crops."""
    return KindCrops(np.concatenate([one.images for one in parts]), np.concatenate([one.kinds for one in parts]))


def dataset_crops(rng: np.random.Generator, dataset: Dataset) -> KindCrops:
    """Cut the things marked in boxes.csv, and other places, out of a dataset's photographs."""
    pictures = ((dataset.read_frame(index), dataset.boxes_of(index)) for index in range(len(dataset.image_names)))
    return photograph_crops(rng, Vision(dataset.field, dataset.camera, mask=dataset.mask), pictures)


def photograph_crops(
    rng: np.random.Generator, vision: Vision, pictures: Iterable[tuple[UInt8Array, Sequence[Box]]]
) -> KindCrops:
    """As `dataset_crops`, for pictures of one forward camera of known tilt, each with its boxes."""
    width, height = (side + 2 * RIM_PX for side in SEEN_PX)
    parts = [KindCrops(np.empty((0, height, width, 3), dtype=np.uint8), np.empty(0, dtype=np.int64))]
    for frame, marked in pictures:
        vision.forget()
        view = vision.look(frame)
        if view.polar is None:
            continue
        camera = view.polar.camera
        assert isinstance(camera, PinholeCamera)
        places, kinds = _places(rng, camera, view, marked)
        keep = np.hypot(*places.T) < _FARTHEST_M
        images = upright_pictures(Shrunk(frame), camera, places[keep], RIM_PX)
        parts.append(KindCrops(images, kinds[keep]))
    return joined(parts)


def _places(
    rng: np.random.Generator, camera: PinholeCamera, view: View, marked: Sequence[Box]
) -> tuple[FloatArray, Int64Array]:
    """Return places (N, 2) in one picture, robot frame, metres, and the kinds (N,) of the things there."""
    things = [box for box in marked if box.kind in OBSTACLE_KINDS]
    # the feet of things at the lower border are not visible
    boxes = [box for box in marked if box.ymax < camera.size_px[1] - 1]
    feet = _feet_m(camera, boxes)
    kinds = np.array([_index(box.kind) for box in boxes], dtype=np.int64)
    is_thing = np.array([box.kind in OBSTACLE_KINDS for box in boxes], dtype=bool)
    found = np.array([(one.x_m, one.y_m) for one in view.obstacles]).reshape(-1, 2)
    ends = _free_places(rng, view.free_space)
    near_kinds = [_kind_of(camera, place, boxes) for place in found]
    others = np.concatenate([feet[~is_thing], found[[kind is None for kind in near_kinds]].reshape(-1, 2), ends])
    others = others[apart(others, feet[is_thing]) & _is_outside(camera, others, things)]
    sure = is_thing & (kinds != OTHER)
    hit = [kind is not None and kind != OTHER for kind in near_kinds]
    places = np.concatenate([feet[sure], found[hit].reshape(-1, 2), others])
    which = [*kinds[sure], *(kind for kind in near_kinds if kind is not None and kind != OTHER)]
    return places, np.array([*which, *[OTHER] * len(others)], dtype=np.int64)


def _free_places(rng: np.random.Generator, free: FreeSpace) -> FloatArray:
    """Draw random places (N, 2) near the ends of the free floor, and on it; robot frame, metres."""
    known = np.flatnonzero(np.isfinite(free.range_m) & (free.range_m > 0.3))
    chosen = rng.choice(known, _ENDS + _FLOORS) if len(known) else known
    range_m = free.range_m[chosen]
    range_m[_ENDS:] *= rng.uniform(0.3, 1.0, len(range_m[_ENDS:]))
    range_m[:_ENDS] *= np.exp(rng.normal(0.0, 0.05, len(range_m[:_ENDS])))
    bearing = free.bearing_rad[chosen]
    return np.asarray(range_m[:, None] * np.stack([np.cos(bearing), np.sin(bearing)], axis=1))


def _feet_m(camera: PinholeCamera, boxes: Sequence[Box]) -> FloatArray:
    """Return the floor points (N, 2) at the middles of boxes' lower edges, robot frame; far away if there are none."""
    pixels = np.array([((box.xmin + box.xmax) / 2, box.ymax - _BOX_RIM_PX) for box in boxes]).reshape(-1, 2)
    feet = camera.pixel_to_floor(pixels)
    return np.where(np.isfinite(feet), feet, 1e6)


def _kind_of(camera: PinholeCamera, place_m: FloatArray, boxes: Sequence[Box]) -> int | None:
    """Return the kind of the boxes that a place on the floor lies in; None: no box; `OTHER`: different kinds."""
    pixel = camera.floor_to_pixel(place_m)
    kinds = {box.kind for box in boxes if box.holds(float(pixel[0]), float(pixel[1]), _BOX_RIM_PX)}
    if not kinds:
        return None
    kind = kinds.pop()
    return OTHER if kinds else _index(kind)


def _index(kind: str) -> int:
    return KINDS.index(KIND_OF_BOX[kind]) if kind in KIND_OF_BOX else OTHER


def _is_outside(camera: PinholeCamera, places_m: FloatArray, boxes: Sequence[Box]) -> BoolArray:
    """Return (N,) which places on the floor are outside of all boxes."""
    pixels = camera.floor_to_pixel(places_m)
    outside = [not any(box.holds(u, v, _BOX_RIM_PX) for box in boxes) for u, v in pixels.tolist()]
    return np.array(outside, dtype=np.bool_)


def apart(places_m: FloatArray, feet_m: FloatArray) -> BoolArray:
    """Return (N,) which places (N, 2) on the floor are apart from all feet (M, 2), as seen from the origin."""
    (bearing, range_m), (its_bearing, its_range_m) = (
        (np.arctan2(at[:, 1], at[:, 0]), np.hypot(at[:, 0], at[:, 1])) for at in (places_m, feet_m)
    )
    turn = np.abs((bearing[:, None] - its_bearing[None] + math.pi) % math.tau - math.pi)
    beside = turn * its_range_m[None] < _ASIDE_M
    ratio = np.abs(np.log(np.maximum(range_m[:, None], 1e-6) / its_range_m[None]))
    near: npt.NDArray[np.bool_] = beside & (ratio < math.log(_RANGE_RATIO))
    return np.logical_not(near.any(axis=1))
