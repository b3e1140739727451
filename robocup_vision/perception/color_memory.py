"""Colours over successive frames, which follow changes of the light without adopting colours of obstacles.

The most certain floor of each frame measures the brightness and colour of the light. If these have changed, the floor's
colour is learnt again from just these samples. If the old colours hardly apply, because the light was switched, colours
are learnt as in a first frame. They are accepted only if floor and white have changed alike, as they do with the light,
but not if a robot fills the view.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from field_models.field import Field
from robocup_vision.arrays import Int8Array, UInt8Array
from robocup_vision.kernels.floor import colors as floor_colors
from robocup_vision.kernels.floor import polar
from robocup_vision.perception.color_table import (
    LLR_PER_UNIT,
    Colors,
    ColorTable,
    build_color_table,
    follow_colors,
    learn_colors,
)
from robocup_vision.perception.floor_color import LEVEL_STEP, LEVELS
from robocup_vision.perception.floor_view import FloorView
from robocup_vision.perception.polar_view import PolarView

_DARKEST = float(LEVELS[0])
# ratio of the nearest floor's mean likelihood ratio to that when learnt, below which something has changed
_DRIFT_RATIO = 0.6
# log-likelihood ratio from which a sample is certainly floor
_SURE_NATS = 1.0
# frames between measurements of light: it changes slowly, or so suddenly that the nearest floor is lost
_LOOK_EVERY = 3
# change of log brightness or of log hue at which colours are learnt again, less than a step of the model
_MAX_LEVEL, _MAX_CAST = 0.3, 0.08
# least ratio of the certain floor to that when learnt: with less the light is not determined; and least ratio that new
# colours must keep
_MIN_SURE_RATIO, _KEPT_SURE_RATIO = 0.15, 0.9
# largest difference of log ratios between one floor under two lights, and the number of frames without a measurement
# after which it may have doubled
_SAME_COLOR, _PATIENCE_FRAMES = 0.35, 15.0
# new colours must increase the certain floor by this factor, or the nearest floor's likelihood by this ratio
_MORE_SURE, _BETTER_RING = 1.1, 0.2
# log brightness by which a search for sunlit floor exceeds the known floor
_LIFT = 0.5
# frames between attempts to learn while the nearest floor stays lost
_RETRY_FRAMES = 8


class _LightOnFloor(NamedTuple):
    """Appearance of the certain floor of a frame."""

    ratio: float  #: ratio of the samples that are certainly floor
    level: float  #: log brightness of its sunlit part, relative to the model
    cast: tuple[float, float]  #: log R/G and B/G, relative to the model at each sample's brightness


class ColorMemory:
    """The colours by which a camera's frames are classified.

    Parameters
    ----------
    fixed : Colors, optional
        Colours that are never changed.
    strongest_cast : float
        Logarithm of the strongest cast of light; a white with a stronger one is some paint.
    """

    def __init__(self, field: Field, fixed: Colors | None = None, strongest_cast: float = math.inf) -> None:
        self._field = field
        self._strongest_cast = strongest_cast
        self._fixed = None if fixed is None else build_color_table(fixed)
        self._table = self._fixed
        self._step_of_sum = np.zeros(1021, dtype=np.uint8)
        self._ratios = np.ones((2, len(LEVELS)))
        self.forget()

    def forget(self) -> None:
        """Forget learnt colours."""
        self._table = self._fixed
        self._learnt_ring = 0.0
        self._learnt_light = _LightOnFloor(0.0, 0.0, (0.0, 0.0))
        self._hidden_frames = self._lost_frames = self._frames = 0

    @property
    def table(self) -> ColorTable | None:
        """Table of the colours in use; None before the first frame."""
        return self._table

    @property
    def colors(self) -> Colors | None:
        """The colours in use; None before the first frame."""
        return None if self._table is None else self._table.colors

    def classify(self, samples: UInt8Array, view: PolarView | FloorView) -> tuple[ColorTable | None, Int8Array]:
        """Classify a frame's samples; learns colours again if the light has changed.

        Parameters
        ----------
        samples : (K, M, 3) uint8
            `view.sample` of the frame.

        Returns
        -------
        table : ColorTable or None
            None if there is none yet and none can be learnt.
        llr : (K, M) int8
            The floor's log-likelihood ratio of each sample in units of `LLR_PER_UNIT`.
        """
        llr = np.empty(samples.shape[:2], dtype=np.int8)
        if self._table is None:
            colors = learn_colors(samples, view.valid, self._field, self._strongest_cast)
            if colors is not None:
                self._adopt(build_color_table(colors), samples, view, llr)
            return self._table, llr
        return self.follow(samples, view, llr, _look_up(samples, view, self._table, llr)), llr

    def follow(self, samples: UInt8Array, view: PolarView | FloorView, llr: Int8Array, ring: float) -> ColorTable:
        """Learn colours again if the light has changed; returns the table that is then in use.

        Parameters
        ----------
        llr : (K, M) int8
            Ratios of the samples by the table in use; filled again if the table changes.
        ring : float
            Mean of the ring around the robot.
        """
        assert self._table is not None
        if self._fixed is not None:
            return self._table
        is_hidden = ring < _DRIFT_RATIO * self._learnt_ring
        self._frames += 1
        if not is_hidden and self._frames % _LOOK_EVERY:
            self._hidden_frames = self._lost_frames = 0
            return self._table
        light = self._light(samples, llr)
        is_readable = light.ratio > 0 and light.ratio >= _MIN_SURE_RATIO * self._learnt_light.ratio
        has_moved = is_readable and self._has_moved(light)
        # not in every frame, because a robot in front of the camera or the dark may last
        hidden, lost = self._hidden_frames, self._lost_frames
        self._hidden_frames = hidden + 1 if is_hidden else 0
        self._lost_frames = lost + 1 if is_hidden and not is_readable else 0
        if has_moved or (is_hidden and is_readable and hidden % _RETRY_FRAMES == 0):
            self._follow(samples, view, llr, light, ring)
        elif is_hidden and not is_readable and lost % _RETRY_FRAMES == 0:
            self._learn_again(samples, view, llr, lost)
        return self._table

    def _has_moved(self, light: _LightOnFloor) -> bool:
        before = self._learnt_light
        return (
            abs(light.level - before.level) > _MAX_LEVEL
            or abs(light.cast[0] - before.cast[0]) > _MAX_CAST
            or abs(light.cast[1] - before.cast[1]) > _MAX_CAST
        )

    def _follow(
        self, samples: UInt8Array, view: PolarView | FloorView, llr: Int8Array, light: _LightOnFloor, ring: float
    ) -> None:
        assert self._table is not None
        best, best_llr, ratio = self._table, llr, light.ratio
        # the nearest floor may be sunlit beyond the brightest known floor, and reached in two steps
        lifts = (0.0,) if self._has_moved(light) else (_LIFT, 0.0)
        for lift in lifts:
            is_floor = best_llr >= _SURE_NATS / LLR_PER_UNIT
            colors = follow_colors(samples, view.valid, is_floor, best.colors, self._field, self._strongest_cast, lift)
            if colors is None:
                break
            table, new_llr = build_color_table(colors), np.empty_like(llr)
            new_ring = _look_up(samples, view, table, new_llr)
            new_ratio = self._light(samples, new_llr).ratio
            is_better = new_ratio > _MORE_SURE * ratio or new_ring > ring + _BETTER_RING * self._learnt_ring
            if not is_better and (best is not self._table or not self._has_moved(light)):
                break
            if new_ratio < _KEPT_SURE_RATIO * ratio:
                break
            best, best_llr, ratio, ring = table, new_llr, new_ratio, new_ring
        if best is not self._table:
            self._adopt(best, samples, view, llr)

    def _learn_again(self, samples: UInt8Array, view: PolarView | FloorView, llr: Int8Array, turn: int) -> None:
        assert self._table is not None
        colors = learn_colors(samples, view.valid, self._field, self._strongest_cast)
        tolerance = _SAME_COLOR * (1 + turn / _PATIENCE_FRAMES)
        if colors is not None and _is_same_floor(colors, self._table.colors, tolerance):
            self._adopt(build_color_table(colors), samples, view, llr)

    def _adopt(self, table: ColorTable, samples: UInt8Array, view: PolarView | FloorView, llr: Int8Array) -> None:
        floor = table.colors.floor
        level = np.log(np.maximum(np.arange(1021) / 4, 0.5) / floor.level)
        step = np.rint((level - LEVELS[0]) / LEVEL_STEP)
        self._step_of_sum = np.clip(step, 0, len(LEVELS) - 1).astype(np.uint8)
        self._ratios = np.array([floor.red_ratio, floor.blue_ratio])
        self._table = table
        # a robot in front of the camera makes both values too small
        self._learnt_ring = max(_look_up(samples, view, table, llr), _DRIFT_RATIO * self._learnt_ring)
        light = self._light(samples, llr)
        self._learnt_light = light._replace(ratio=max(light.ratio, self._learnt_light.ratio / 2))

    def _light(self, samples: UInt8Array, llr: Int8Array) -> _LightOnFloor:
        sure = int(_SURE_NATS / LLR_PER_UNIT)
        ratio, level, red, blue = floor_colors.light_on_floor(samples, llr, sure, self._step_of_sum, self._ratios)
        if not ratio:
            return _LightOnFloor(0.0, 0.0, (0.0, 0.0))
        return _LightOnFloor(ratio, _DARKEST + level * LEVEL_STEP, (red, blue))


def _look_up(samples: UInt8Array, view: PolarView | FloorView, table: ColorTable, llr: Int8Array) -> float:
    return float(polar.classify(samples, table.packing, table.floor_llr, view.valid, llr))


def _is_same_floor(new: Colors, old: Colors, tolerance: float) -> bool:
    """Whether two floors may be one under different light: alike, alike relative to white, or the new one greener."""
    floors = [np.log([c.floor.lit.red_ratio, c.floor.lit.blue_ratio]) for c in (new, old)]
    beside = [f - np.log([c.line.red_ratio, c.line.blue_ratio]) for f, c in zip(floors, (new, old), strict=True)]
    # a floor half-way to grey is no carpet, however long none was seen
    tolerance = min(tolerance, float(np.abs(beside[1]).max()) / 2)
    unlike = min(float(np.abs(floors[0] - floors[1]).max()), float(np.abs(beside[0] - beside[1]).max()))
    return unlike <= tolerance or bool((beside[0] < beside[1]).all() and (floors[0] < floors[1]).all())
