"""Set-ups that differ from a given one by one common mistake each.

`NEAR` lists generators of them, each for one kind of mistake, gross ones first.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import cv2
import numpy as np

from field_models.catalog import field_names, load_field
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.floor_range import FloorRange, Hyperboloid, Table, Tangent
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.evaluation.dataset import Truth
from robocup_vision.evaluation.truth_units import MEND, other_readings

# typical errors of a tape measure, a data sheet or another lens that matter to localisers
_RATIOS = (0.85, 0.9, 0.95, 1.05, 1.1, 1.15)


@dataclass(frozen=True, eq=False)
class SetUp:
    """Everything that is needed to interpret pictures."""

    field: Field
    camera: OmniCamera | PinholeCamera
    size_px: tuple[int, int]  #: width and height of the unchanged pictures
    truth: Mapping[str, Truth]  #: known poses, by picture
    seen: Callable[[UInt8Array], UInt8Array] = np.asarray  #: converts a picture to the camera's format

    def near(self, subject: str, words: str, mend: str = "", **changes: Any) -> NearSetUp:
        """Return this with some fields changed, see `NearSetUp`."""
        return NearSetUp(subject, words, replace(self, **changes), mend)


@dataclass(frozen=True, eq=False)
class NearSetUp:
    """The given set-up with one assumed mistake corrected."""

    subject: str  #: subject of the mistake
    words: str  #: description of the change, to follow "with"
    set_up: SetUp  #: the changed set-up
    mend: str  #: how to correct the files; empty if the words say it


def _truth_units(own: SetUp) -> Iterator[NearSetUp]:
    """Try degrees for radians, and smaller units for metres."""
    for reading in other_readings(own.truth, own.field):
        other = {picture: reading.of(one) for picture, one in own.truth.items()}
        yield own.near("truth", f"truth.csv read as {reading.words}", MEND, truth=other)


def _picture(own: SetUp) -> Iterator[NearSetUp]:
    """Rotate, flip and resize pictures, and swap red and blue."""
    size_px, shown_px = own.size_px, own.camera.size_px
    changes: list[tuple[str, Callable[..., Any], str]] = []
    if size_px == shown_px:
        changes += [
            ("the pictures turned by 180 degrees", partial(np.rot90, k=2), "is the camera mounted upside down?"),
            ("the pictures flipped left to right", np.fliplr, "does the driver mirror them?"),
            ("red and blue of the pictures swapped", partial(np.flip, axis=2), "were RGB arrays written as BGR?"),
        ]
    if size_px == shown_px[::-1]:
        changes += [
            (f"the pictures turned by 90 degrees to the {side}", partial(np.rot90, k=times), "")
            for side, times in (("left", 1), ("right", -1))
        ]
    elif size_px[0] * shown_px[1] == size_px[1] * shown_px[0] and size_px != shown_px:
        factor = size_px[0] / shown_px[0]
        words = f"the pictures scaled from {size_px[0]}x{size_px[1]} to {shown_px[0]}x{shown_px[1]}"
        mend = f"all pixels of the camera file (size, centre, focal length or radii) times {factor:g}"
        changes.append((words, partial(cv2.resize, dsize=shown_px, interpolation=cv2.INTER_AREA), mend))
    for words, seen, mend in changes:
        yield own.near("pictures", words, mend, seen=seen)


def _tilt(own: SetUp) -> Iterator[NearSetUp]:
    """Try the other sign, and degrees for radians."""
    camera = own.camera
    if not isinstance(camera, PinholeCamera) or not camera.tilt_rad:
        return
    tilt_rad = camera.tilt_rad
    degrees = math.degrees(tilt_rad)
    for words, other in (
        (f"tilt {-degrees:+.0f} instead of {degrees:+.0f} degrees", -tilt_rad),
        (f"tilt {tilt_rad:+g} degrees instead of {tilt_rad:+g} radians", math.radians(tilt_rad)),
    ):
        yield own.near("tilt", words, f"tilt_rad = {other:.4f}", camera=replace(camera, tilt_rad=other))


def _lens_of_other_size(own: SetUp) -> Iterator[NearSetUp]:
    """Treat focal length and centre as those of pictures of half or double the size."""
    camera = own.camera
    if not isinstance(camera, PinholeCamera):
        return
    for factor, name in ((2.0, "half"), (0.5, "double")):
        focal_px = (factor * camera.focal_px[0], factor * camera.focal_px[1])
        center_px = (factor * (camera.center_px[0] + 0.5) - 0.5, factor * (camera.center_px[1] + 0.5) - 0.5)
        words = f"focal length and centre taken as those of pictures of {name} the size"
        mend = f"focal_px and center_px times {factor:g}"
        yield own.near("lens", words, mend, camera=replace(camera, focal_px=focal_px, center_px=center_px))


def _lens_model(own: SetUp) -> Iterator[NearSetUp]:
    """Treat a pinhole lens as a fisheye, a fisheye as a pinhole lens, and either without its distortion."""
    camera = own.camera
    if not isinstance(camera, PinholeCamera):
        return
    mend = "robocup-vision calibrate forward --start CAMERA"
    if isinstance(camera, FisheyeCamera):
        others = [("a pinhole lens instead of a fisheye", camera.without_lens, 'model = "pinhole"')]
    else:
        values = {one.name: getattr(camera, one.name) for one in fields(PinholeCamera)} | {"distortion": ()}
        others = [("a fisheye instead of a pinhole lens", FisheyeCamera(**values), f'model = "fisheye"; {mend}')]
    if any(camera.distortion):
        straight = replace(camera, distortion=())
        others.append(("distortion = [] in the camera file", straight, f"of which lens model is it? {mend}"))
    for words, other, wanted in others:
        yield own.near("lens", words, wanted, camera=other)


def _mirroring(own: SetUp) -> Iterator[NearSetUp]:
    """Invert the mirroring."""
    camera = own.camera
    if isinstance(camera, OmniCamera):
        other = replace(camera, mirrored=not camera.mirrored)
        wanted = f"mirrored = {str(other.mirrored).lower()}"
        yield own.near("mirrored", f"{wanted} in the camera file", camera=other)


def _goals(own: SetUp) -> Iterator[NearSetUp]:
    """Swap the goals' colours."""
    first, *others = own.field.goals or (None,)
    if first is not None and others and others[0].color != first.color:
        swapped = tuple(
            replace(goal, color=other.color) for goal, other in zip(own.field.goals, own.field.goals[::-1], strict=True)
        )
        field = replace(own.field, goals=swapped)
        yield own.near("field", "the goals' colours swapped in the field file", field=field)


def _fields(own: SetUp) -> Iterator[NearSetUp]:
    """Try the other built-in fields."""
    for name in field_names():
        if name != own.field.name:
            yield own.near("field", f"field '{name}' instead of '{own.field.name}'", field=load_field(name))


def _sizes(own: SetUp) -> Iterator[NearSetUp]:
    """Try wrong focal lengths and heights, or ranges of a mirror."""
    camera = own.camera
    if isinstance(camera, OmniCamera):
        for ratio in _RATIOS:
            other = replace(camera, floor_range=_longer(camera.floor_range, ratio))
            words = f"floor ranges {ratio:g} times those of the camera file"
            yield own.near("range", words, "robocup-vision calibrate omni --start CAMERA", camera=other)
        return
    focal_px, height_m = camera.focal_px, camera.height_m
    mend = "robocup-vision calibrate forward --start CAMERA"
    for ratio in _RATIOS:
        longer = replace(camera, focal_px=(ratio * focal_px[0], ratio * focal_px[1]))
        words = f"a focal length of {longer.focal_px[0]:.0f} instead of {focal_px[0]:.0f} pixels"
        yield own.near("focal length", words, mend, camera=longer)
        higher = replace(camera, height_m=ratio * height_m)
        words = f"a height of {higher.height_m:.3f} instead of {height_m:.3f} m"
        yield own.near("height", words, mend, camera=higher)


def _longer(curve: FloorRange, ratio: float) -> FloorRange:
    """Return a curve with its ranges multiplied by a ratio."""
    if isinstance(curve, Hyperboloid):
        return replace(curve, A_px_per_m=curve.A_px_per_m / ratio, B_per_m=curve.B_per_m / ratio)
    if isinstance(curve, Tangent):
        return replace(curve, a_m=ratio * curve.a_m)
    assert isinstance(curve, Table)
    return Table(curve.table_radius_px, ratio * curve.table_range_m)


NEAR: tuple[Callable[[SetUp], Iterator[NearSetUp]], ...] = (
    _truth_units,
    _goals,
    _picture,
    _tilt,
    _lens_of_other_size,
    _lens_model,
    _mirroring,
    _sizes,
    _fields,
)
