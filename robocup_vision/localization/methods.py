"""The localisation methods with their requirements, and the default ones.

Users need not name a method. Published baselines are imported when they are chosen.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import cast

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.localization.floor import require_bounded
from robocup_vision.localization.forward import GoalLocalizer
from robocup_vision.localization.localizer import Camera, Localizer
from robocup_vision.localization.mirror import MirrorLocalizer
from robocup_vision.localization.model_edges.field_edges import lines_only
from robocup_vision.localization.model_edges.localizer import EdgeLocalizer
from robocup_vision.perception.polar_view import PolarView

MIRROR, PINHOLE = "mirror", "pinhole"
_BASELINES = "robocup_vision.localization.baselines"


@dataclass(frozen=True, slots=True)
class Method:
    """A method that estimates the pose from one frame.

    Parameters
    ----------
    name : str
        Name for users and in dataset.toml.
    camera : {"mirror", "pinhole"}
        The kind of camera.
    needs : str
        Further requirements on field and camera.
    needs_tilt : bool
        Whether a pinhole camera's tilt must be known.
    by_edges : bool
        Whether it uses edges: then the prior's covariance is a factor of its result, and tilt, roll and height of a
        pinhole camera may be given with each frame.
    is_baseline : bool
        Whether it is a published method for comparison.
    needs_map : bool
        Whether it needs a map of landmarks, and is run by `LandmarkVision`, not `Vision`.
    """

    name: str
    camera: str
    needs: str
    needs_tilt: bool = False
    by_edges: bool = False
    is_baseline: bool = False
    needs_map: bool = False

    @property
    def loops(self) -> str:
        """Name under which its compiled loops are listed."""
        return "edges" if self.by_edges else self.name


# the first of each kind of camera whose requirements the camera meets is the default
METHODS = (
    Method("field", MIRROR, "walls or boards, or white lines"),
    Method("floor", MIRROR, "walls or boards that bound the floor"),
    Method("hull", MIRROR, "walls or boards that bound a floor longer than wide", is_baseline=True),
    Method("edges", PINHOLE, "lines, goals, beacons or walls: everything in view", needs_tilt=True, by_edges=True),
    Method("goal", PINHOLE, "goals of posts and a bar"),
    Method("field", PINHOLE, "white lines", needs_tilt=True, by_edges=True),
    Method("floor", PINHOLE, "walls or boards that bound the floor", needs_tilt=True, by_edges=True),
    Method("angles", PINHOLE, "goals of posts and a bar, in colours of a hue", is_baseline=True),
    Method("landmarks", PINHOLE, "a map of landmarks", needs_tilt=True, needs_map=True),
)


def method_names() -> tuple[str, ...]:
    """Return the names of all methods, each once."""
    return tuple(dict.fromkeys(method.name for method in METHODS))


def kind_of(camera: Camera) -> str:
    """Return "mirror" or "pinhole"."""
    return PINHOLE if isinstance(camera, PinholeCamera) else MIRROR


def choose_method(camera: Camera, name: str | None = None) -> Method:
    """Return the named method, or the default one, of a camera.

    Raises
    ------
    ArgumentError
        If no method of that name serves the camera, or its tilt must be known and is not.
    """
    kind = kind_of(camera)
    mine = [method for method in METHODS if method.camera == kind and not method.needs_map]
    if name is None:
        has_tilt = not isinstance(camera, PinholeCamera) or camera.known_orientation
        return next(method for method in mine if has_tilt or not method.needs_tilt)
    for method in mine:
        if method.name == name:
            if method.needs_tilt and isinstance(camera, PinholeCamera) and not camera.known_orientation:
                raise ArgumentError(f"method '{name}' needs a camera whose tilt_rad is known")
            return method
    names = [repr(method.name) for method in mine]
    raise ArgumentError(f"method must be {', '.join(names[:-1])} or {names[-1]} for a {kind} camera, got {name!r}")


def make_mirror_localizer(
    method: Method, field: Field, camera: Camera, view: PolarView, mask: UInt8Array | None
) -> Localizer:
    """Make the localiser of a mirror camera.

    Raises
    ------
    ArgumentError
        If the method does not fit the field.
    """
    if method.is_baseline:
        return _baseline("floor_hull.HullLocalizer")(field, camera, mask)
    assert not isinstance(camera, PinholeCamera)
    return MirrorLocalizer(field, camera, view, mask, use_lines=method.name == "field")


def make_pinhole_localizer(method: Method, field: Field, camera: PinholeCamera) -> Localizer:
    """Make the localiser of a pinhole camera; raises as `make_mirror_localizer` does."""
    if method.is_baseline:
        return _baseline("goal_angles.AnglesLocalizer")(field, camera)
    if method.name == "goal":
        return GoalLocalizer(field, camera)
    return EdgeLocalizer(_with_features(field, method.name), camera)


def _with_features(field: Field, name: str) -> Field:
    """Return the field with only the features of a method of edges."""
    if name == "field":
        if not field.has_lines:
            raise ArgumentError(f"method 'field' needs white lines, and '{field.name}' has none")
        return lines_only(field)
    if name == "floor":
        require_bounded(field)
        goals = tuple(goal for goal in field.goals if goal.kind != "posts")
        return replace(field, lines=field.lines[:0], arcs=field.arcs[:0], beacons=(), goals=goals)
    return field


def _baseline(name: str) -> Callable[..., Localizer]:
    module, _, maker = name.partition(".")
    return cast("Callable[..., Localizer]", getattr(importlib.import_module(f"{_BASELINES}.{module}"), maker))


def calibrated_localizer(localizer: Localizer, method: Method, field: Field, camera: PinholeCamera) -> Localizer:
    """Return the localiser for another calibration of a pinhole camera; it keeps the state of the previous one."""
    if isinstance(localizer, EdgeLocalizer):
        return localizer.with_camera(camera)
    return make_pinhole_localizer(method, field, camera)
