"""Moments as bytes, from the robot's process to the page's.

What seldom changes (the samples' places, the camera, colours, the map) is sent once, and again when it is another
object: the places alone are half a megabyte.
"""

from __future__ import annotations

import pickle
from dataclasses import fields, replace
from typing import Any

import numpy as np

from robocup_vision.arrays import UInt8Array
from robocup_vision.camera.mounting import MOUNTING_NAMES, Mounting
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.live.handover.moment import Moment
from robocup_vision.perception.markings.finder import MarkingSource
from robocup_vision.view import View

# parts of a view, and then of a moment, that are sent when they are another object than the time before
_SELDOM = ("polar", "grid", "camera", "colors", "settings", "map_state", "marking_finder")
_VIEW_FIELDS = tuple(field.name for field in fields(View))
_NO_FRAME = np.empty((0, 0, 3), dtype=np.uint8)


class MomentWriter:
    """Turns the moments of one robot into bytes."""

    def __init__(self) -> None:
        # kept, so that a new object never has the identity of an old one
        self._sent: dict[str, object] = dict.fromkeys(_SELDOM)

    def write(self, moment: Moment) -> tuple[bytes, dict[str, object]]:
        """Return a moment without its frame, and what counts as sent once these bytes are on their way."""
        view = moment.view
        now: dict[str, object] = {"colors": moment.colors, "settings": moment.settings}
        told = None
        if view is not None:
            told = {name: getattr(view, name) for name in _VIEW_FIELDS}
            now |= {name: told.pop(name) for name in ("polar", "grid", "camera")}
            told["timings_s"] = dict(view.timings_s)
            # its frame comes apart from it, and its camera is the view's, held as the frame says
            source = told.pop("marking_source")
            now["marking_finder"] = None if source is None else source.finder
            told["held"] = None if source is None else (_mounting(source.camera), source.held_covariance)
            belief = view.belief
            if belief is not None and belief.free_map is not None:
                now["map_state"] = belief.free_map.state
                told["belief"] = replace(belief, free_map=replace(belief.free_map, state=_NO_FRAME))
        changed = {name: value for name, value in now.items() if value is not self._sent[name]}
        rest = (moment.robot, moment.t_s, moment.problem, moment.plan, moment.truth, moment.rate_hz, moment.world)
        return pickle.dumps((changed, told, rest), pickle.HIGHEST_PROTOCOL), changed

    def sent(self, changed: dict[str, object]) -> None:
        """Remember what the other side has now."""
        self._sent.update(changed)


class MomentReader:
    """Turns bytes of a `MomentWriter` into moments."""

    def __init__(self) -> None:
        self._known: dict[str, Any] = dict.fromkeys(_SELDOM)

    def read(self, data: bytes, frame: UInt8Array) -> Moment:
        """Return the moment; its frame comes apart from it."""
        changed, told, (robot, t_s, problem, plan, truth, rate_hz, world) = pickle.loads(data)
        self._known.update(changed)
        known, view = self._known, None
        if told is not None:
            belief = told["belief"]
            if belief is not None and belief.free_map is not None:
                told["belief"] = replace(belief, free_map=replace(belief.free_map, state=known["map_state"]))
            finder, camera, held, source = known["marking_finder"], known["camera"], told.pop("held"), None
            if held is not None:
                mounting, covariance = held
                as_held = camera if mounting is None else camera.held(mounting)
                source = MarkingSource.of(finder, frame, as_held, covariance)
            view = View(**told, polar=known["polar"], grid=known["grid"], camera=camera, marking_source=source)
        return Moment(robot, frame, t_s, view, problem, known["colors"], plan, truth, rate_hz, known["settings"], world)


def _mounting(camera: OmniCamera | PinholeCamera) -> Mounting | None:
    if isinstance(camera, OmniCamera):
        return None
    return Mounting(**{name: getattr(camera, name) for name in MOUNTING_NAMES})
