"""Colour classes of a frame, by a table over packed colours; and colour files.

The floor's likelihood is learnt (`floor_color`). Every other class is a chromaticity relative to the frame's white,
which is that of the brightest things beside the floor, walls and lines. So one description of "orange" serves warm and
cold light.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import cv2
import msgspec
import numpy as np
import numpy.typing as npt

from field_models.errors import FileError
from field_models.field import COLOR_NAMES, Field
from field_models.toml_file import StrictStruct, load_toml
from robocup_vision.arrays import FloatArray, Int8Array, UInt8Array, UInt16Array, read_only
from robocup_vision.compiling.loops import plain
from robocup_vision.files.text_files import write_lines
from robocup_vision.kernels.floor import colors as kernel
from robocup_vision.kernels.goal.colors import GoalPalette
from robocup_vision.perception.floor_color import (
    LEVELS,
    FloorColor,
    PaintColor,
    brightness_of,
    follow_floor_color,
    learn_floor_color,
    pick_colors,
)

CLASS_NAMES = ("other", "floor", "line", "ball", "goal_positive_x", "goal_negative_x")

# log-likelihood ratios are stored as int8 in these units, clipped so that no sample outvotes its neighbours
LLR_PER_UNIT = 1.0 / 16
LLR_CLIP = 4.0
# white in a narrow view must extend over this ratio of its bearings, unlike a single object
_MIN_WHITE_BEARINGS = 0.25
_MIN_WHITE_SAMPLES = 30
_MAX_OFF_MIXTURES = 0.05  # sine of the angle between a colour and the plane of mixtures of carpet and lines
# samples along a bearing: fewer are of the carpet's colour by chance, and a line is no wider
_CARPET_PATCH, _LINE_ON_CARPET = np.ones((1, 3), np.uint8), np.ones((1, 9), np.uint8)
# bins have equal widths well below this ratio of a table's brightest level, and equal ratios well above. In the dark,
# black differs from floor by a third in R/G and B/G and needs finer bins; lit floor varies by more than a bin.
_EVEN_BELOW = 0.16


@dataclass(frozen=True, eq=False)
class Colors:
    """All colours of a frame: of the floor, white, the ball and the goals.

    Parameters
    ----------
    floor : FloorColor
        Colour of the floor.
    line : PaintColor
        White paint, to which all other colours are relative.
    ball, goal_positive_x, goal_negative_x : PaintColor
        Colours of the ball and the goals.
    """

    floor: FloorColor
    line: PaintColor
    ball: PaintColor
    goal_positive_x: PaintColor
    goal_negative_x: PaintColor

    @cached_property
    def goal_palette(self) -> GoalPalette:
        """Hues and ratios as a plain tuple, for the vote on the goals."""
        paints = (self.goal_positive_x, self.goal_negative_x, self.line)
        hues = [(p.blue_ratio - p.red_ratio) / (p.blue_ratio + 1.0 + p.red_ratio) for p in paints]
        *goals, white = np.log([[p.red_ratio, p.blue_ratio] for p in paints])
        # the light stays the same: only the difference of the paint to white is swapped
        swapped = [white + (goal - white)[::-1] for goal in goals]
        return plain(GoalPalette(read_only(hues), read_only([*goals, *swapped, white])))

    @property
    def goal_hue_difference(self) -> float:
        """Difference of the goals' hues."""
        own, other, _ = self.goal_palette[0].tolist()
        return abs(float(own - other))

    @property
    def goal_log_ratios(self) -> FloatArray:
        """(5, 2) float64: log R/G and B/G of the goals at +x, -x, of both with red and blue swapped, and of white."""
        return self.goal_palette[1]

    @property
    def white_cast(self) -> float:
        """Distance of white from neutral: the greater absolute value of log R/G and log B/G."""
        return max(abs(math.log(self.line.red_ratio)), abs(math.log(self.line.blue_ratio)))

    @cached_property
    def swap_distance(self) -> float:
        """Least distance, in `goal_log_ratios`, of the goals' colours from those with red and blue swapped."""
        goals, swapped = self.goal_log_ratios[:2], self.goal_log_ratios[2:4]
        return float(np.linalg.norm(goals[:, None] - swapped[None], axis=-1).min())


def learn_colors(
    samples: UInt8Array, valid: UInt8Array, field: Field, strongest_cast: float = math.inf
) -> Colors | None:
    """Learn a frame's colours from its unrolled, slightly blurred samples.

    Parameters
    ----------
    samples : (K, M, 3) uint8
        Bearings, radii inside out, BGR.
    valid : (K, M) uint8
        1 where a sample may be used.
    field : Field
        Names the colours of the ball and the goals under white light.
    strongest_cast : float
        Logarithm of the strongest cast of light. A white with a stronger one is some paint and is replaced by neutral.

    Returns
    -------
    Colors or None
        None if it is too dark, or too little of the ring around the robot is in view.
    """
    floor = learn_floor_color(samples, valid)
    return None if floor is None else _colors_beside(floor, samples, valid, field, strongest_cast)


def follow_colors(
    samples: UInt8Array,
    valid: UInt8Array,
    is_floor: npt.NDArray[np.bool_],
    before: Colors,
    field: Field,
    strongest_cast: float,
    lift: float,
) -> Colors | None:
    """Learn a frame's colours again from samples of known floor; see `follow_floor_color`, `learn_colors`."""
    floor = follow_floor_color(samples, valid, is_floor, before.floor, lift)
    return None if floor is None else _colors_beside(floor, samples, valid, field, strongest_cast)


def _colors_beside(
    floor: FloorColor, samples: UInt8Array, valid: UInt8Array, field: Field, strongest_cast: float
) -> Colors:
    # every other bearing suffices for white
    shown = valid[::2] > 0
    min_bearings = 0.0
    if math.isfinite(strongest_cast):
        # in a narrow view the ball may be most of what is bright
        min_bearings = _MIN_WHITE_BEARINGS
        if field.ball_color not in ("white", "black"):
            shown &= ~_near_paint(samples[::2], field.ball_color)
    white = _learn_white(samples[::2], shown, floor, min_bearings)
    if max(abs(math.log(ratio)) for ratio in (white.red_ratio, white.blue_ratio)) >= strongest_cast:
        white = PaintColor(1.0, 1.0)
    return colors_for(field, floor, white)


def colors_for(field: Field, floor: FloorColor, white: PaintColor) -> Colors:
    """Return a field's colours under light in which white paint has the colour `white`."""

    def under_this_light(name: str) -> PaintColor:
        blue, green, red = COLOR_NAMES[name]
        return PaintColor(red / green * white.red_ratio, blue / green * white.blue_ratio)

    goals = [under_this_light(goal.color) for goal in field.goals] or [white, white]
    if field.is_half:
        # a half field has one goal
        goals = goals[:1] * 2
    return Colors(floor, white, under_this_light(field.ball_color), *goals)


def _near_paint(samples: UInt8Array, name: str) -> npt.NDArray[np.bool_]:
    """(K, M) bool: samples nearer to a named paint than to white, under neutral light, and their neighbours.

    A ball that fills much of a narrow view, its glare and its blurred rim must not be taken for white.
    """
    blue, green, red = COLOR_NAMES[name]
    paint = np.log([red / green, blue / green])
    # the plane half-way between white, at 0, and the paint
    wide = np.log(samples.astype(np.float32) + 1.0)
    along = (wide[..., 2] - wide[..., 1]) * paint[0] + (wide[..., 0] - wide[..., 1]) * paint[1]
    is_paint = (along > 0.5 * float(paint @ paint)).astype(np.uint8)
    return np.asarray(cv2.dilate(is_paint, np.ones((5, 5), np.uint8)) > 0)


def _learn_white(
    samples: UInt8Array, shown: npt.NDArray[np.bool_], floor: FloorColor, min_bearings: float
) -> PaintColor:
    colors, bearing = pick_colors(samples, shown), np.nonzero(shown)[0]
    is_floor = floor.log_likelihood_ratio(*colors) > 0
    is_bright = ~is_floor & (brightness_of(*colors) > floor.level) & (colors.max(axis=0) < 250)
    if np.count_nonzero(is_bright) < _MIN_WHITE_SAMPLES:
        return PaintColor(1.0, 1.0)
    is_line = is_bright & _has_carpet_around(shown, is_floor)
    if np.count_nonzero(is_line) >= _MIN_WHITE_SAMPLES:
        # pixels that a line fills in part are mixed of the carpet's colour and of white, as all white things may be
        is_mixed = is_bright & _are_mixtures(colors, floor.lit, _typical_paint(colors[:, _brightest(colors, is_line)]))
        is_bright = is_mixed if np.count_nonzero(is_mixed) >= _MIN_WHITE_SAMPLES else is_bright
    is_brightest = _brightest(colors, is_bright)
    if min_bearings:
        of_bearings = len(np.unique(bearing[is_brightest]))
        if of_bearings < min_bearings * np.count_nonzero(shown.any(axis=1)):
            return PaintColor(1.0, 1.0)
    # without lines the brightest things may be coloured (a yellow goal, a window), but most are white
    return _typical_paint(colors[:, is_brightest])


def _has_carpet_around(shown: npt.NDArray[np.bool_], is_floor: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which samples shown (N,) have carpet nearby on both sides, as those of lines; goals and walls have it on one."""
    carpet = np.zeros(shown.shape, np.uint8)
    carpet[shown] = is_floor
    carpet = np.asarray(cv2.morphologyEx(carpet, cv2.MORPH_OPEN, _CARPET_PATCH), np.uint8)
    return np.asarray(cv2.morphologyEx(carpet, cv2.MORPH_CLOSE, _LINE_ON_CARPET)[shown] > 0)


def _are_mixtures(colors: FloatArray, one: PaintColor, other: PaintColor) -> npt.NDArray[np.bool_]:
    """Which colours (3, N) lie in the plane of two others, nearly; none where these are too much alike for a plane."""
    first, second = (np.array([paint.blue_ratio, 1.0, paint.red_ratio]) for paint in (one, other))
    plane = np.cross(first / np.linalg.norm(first), second / np.linalg.norm(second))
    sine = float(np.linalg.norm(plane))
    if sine < 2 * _MAX_OFF_MIXTURES:
        return np.zeros(colors.shape[1], bool)
    return np.asarray(np.abs(plane @ colors) <= _MAX_OFF_MIXTURES * sine * np.linalg.norm(colors, axis=0))


def _brightest(colors: FloatArray, wanted: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Which of the wanted colours (3, N) are the brightest two fifths of these."""
    level = brightness_of(*colors)
    return np.asarray(wanted & (level >= np.percentile(level[wanted], 60)))


def _typical_paint(colors: FloatArray) -> PaintColor:
    blue, green, red = np.maximum(colors, 1.0)
    return PaintColor(float(np.median(red / green)), float(np.median(blue / green)))


@dataclass(frozen=True, eq=False)
class ColorTable:
    """A table over packed colours of 5 + 6 + 5 bits, scaled to the floor's brightness.

    Dark levels have narrower bins than bright ones, because a ratio of dark channels changes much with a count.
    """

    colors: Colors  #: the tabulated colours
    packing: UInt16Array  #: (3, 256) uint16: contribution of each channel's value (B, G, R) to the index
    #: (65536,) int8: log-likelihood ratio of floor to any colour, in units of `LLR_PER_UNIT` nats
    floor_llr: Int8Array

    @cached_property
    def classes(self) -> UInt8Array:
        """(65536,) uint8: class of each packed colour, an index into `CLASS_NAMES`."""
        channels = np.meshgrid(*_bin_colors(self.packing), indexing="ij")
        blue, green, red = (np.maximum(channel.ravel(), 0.5) for channel in channels)
        level = brightness_of(blue, green, red)
        ratio = np.stack([np.log(red / green), np.log(blue / green)], axis=-1)
        paints = (self.colors.line, self.colors.ball, self.colors.goal_positive_x, self.colors.goal_negative_x)
        centers = np.log([[max(p.red_ratio, 1e-3), max(p.blue_ratio, 1e-3)] for p in paints])
        distance = np.linalg.norm(ratio[:, None, :] - centers[None], axis=-1)
        nearest = np.argmin(distance, axis=1)
        # colours half-way between white and the nearest saturated paint have no certain class
        sure = distance[np.arange(len(nearest)), nearest] < 0.5
        bright_enough = level > np.where(nearest == 0, 1.1, 0.35) * self.colors.floor.level
        classes = np.where(sure & bright_enough, nearest + 2, 0)
        classes = np.where(self.floor_llr > 0, 1, classes).astype(np.uint8)
        classes.flags.writeable = False
        return classes

    def pack(self, samples: UInt8Array) -> UInt16Array:
        """Packed colours (...,) uint16 of colours (..., 3) uint8 BGR."""
        blue, green, red = (self.packing[i][samples[..., i]] for i in range(3))
        return np.asarray(blue + green + red)

    def segment(self, frame: UInt8Array) -> UInt8Array:
        """Return the class (H, W) uint8 of each pixel of a frame (H, W, 3), an index into `CLASS_NAMES`."""
        return np.asarray(self.classes[self.pack(frame)])


def build_color_table(colors: Colors) -> ColorTable:
    """Tabulate a frame's colours."""
    floor = colors.floor
    # colours of more than three times the floor's brightness are not floor and share a bin
    green = floor.level * 4 / (2 + floor.red_ratio.max() + floor.blue_ratio.max())
    top = min(255.0, max(16.0, 3.2 * green))
    fine = _EVEN_BELOW * (top + 1)
    along = np.log1p(np.arange(256) / fine) / math.log1p(1 / _EVEN_BELOW)
    bins = {bits: np.minimum(along * (1 << bits), (1 << bits) - 1).astype(np.uint16) for bits in (5, 6)}
    packing = np.stack([bins[5] << 11, bins[6] << 5, bins[5]]).astype(np.uint16)
    llr = np.empty(1 << 16, dtype=np.int8)
    blue, green, red = _bin_colors(packing)
    of_floor, of_white = floor.densities(colors.line)
    kernel.tabulate(blue, green, red, of_floor, of_white, LLR_CLIP, LLR_PER_UNIT, llr)
    return ColorTable(colors, packing, llr)


def _bin_colors(packing: UInt16Array) -> list[FloatArray]:
    # a bin stands for the mean of its values, and the last bin for its first value
    channels = []
    for row, bits, shift in zip(packing, (5, 6, 5), (11, 5, 0), strict=True):
        bins = (row >> shift).astype(int)
        count = np.bincount(bins, minlength=1 << bits)
        center = np.bincount(bins, np.arange(256.0), minlength=1 << bits) / np.maximum(count, 1)
        empty = count == 0
        center[empty] = np.interp(np.flatnonzero(empty), np.flatnonzero(~empty), center[~empty])
        channels.append(center)
    return channels


Ratio = Annotated[float, msgspec.Meta(gt=0)]
Level = Annotated[float, msgspec.Meta(gt=0, le=255)]
Noise = Annotated[float, msgspec.Meta(ge=0, le=255)]


class _FloorFile(StrictStruct):
    level: Level
    noise: Noise
    red_ratio: tuple[Ratio, ...]
    blue_ratio: tuple[Ratio, ...]
    spread: tuple[Ratio, Ratio]


class _PaintFile(StrictStruct):
    red_ratio: Ratio
    blue_ratio: Ratio


class _ColorsFile(StrictStruct):
    format: Literal[1]
    floor: _FloorFile
    line: _PaintFile
    ball: _PaintFile
    goal_positive_x: _PaintFile
    goal_negative_x: _PaintFile


def load_colors(path: str | Path) -> Colors:
    """Load a colour file.

    Its tables: ``[floor]`` with ``level`` (brightness (R + 2G + B)/4 of the lit floor, counts), ``noise`` (standard
    deviation of a channel, counts), ``red_ratio`` and ``blue_ratio`` (R/G and B/G at 13 log-brightness steps of 0.25
    from -1.75 to 1.25 about ``level``) and ``spread`` (their relative standard deviations); ``[line]``, ``[ball]``,
    ``[goal_positive_x]``, ``[goal_negative_x]`` with ``red_ratio`` and ``blue_ratio``.

    Raises
    ------
    FileError
        If the file is missing, or a key is missing, unknown, of the wrong type, length or out of its range.
    """
    f = load_toml(path, _ColorsFile)
    for key, values in (("red_ratio", f.floor.red_ratio), ("blue_ratio", f.floor.blue_ratio)):
        if len(values) != len(LEVELS):
            raise FileError(path, f"must have {len(LEVELS)} entries", key=f"floor.{key}", value=len(values))
    floor = FloorColor(
        f.floor.level,
        f.floor.noise,
        read_only(f.floor.red_ratio),
        read_only(f.floor.blue_ratio),
        read_only(f.floor.spread),
    )
    paints = [PaintColor(p.red_ratio, p.blue_ratio) for p in (f.line, f.ball, f.goal_positive_x, f.goal_negative_x)]
    return Colors(floor, *paints)


def save_colors(colors: Colors, path: str | Path) -> None:
    """Write a colour file that `load_colors` reads back to the same colours.

    Raises
    ------
    FileError
        If the file cannot be written.
    """
    floor = colors.floor
    lines = ["format = 1", "", "[floor]", f"level = {floor.level}", f"noise = {floor.noise}"]
    lines += [f"{key} = {getattr(floor, key).tolist()}" for key in ("red_ratio", "blue_ratio", "spread")]
    for name in CLASS_NAMES[2:]:
        paint: PaintColor = getattr(colors, name)
        lines += ["", f"[{name}]", f"red_ratio = {paint.red_ratio}", f"blue_ratio = {paint.blue_ratio}"]
    write_lines(path, lines)
