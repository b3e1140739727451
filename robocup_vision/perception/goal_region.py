"""Search for posts in a frame: upright strips with two parallel edges that rise from green carpet.

Goals of a hue are found in a mask of that hue family, relative to the image's own white: a pixel belongs to the nearest
of the rule-book hues that occur on this pitch. White goals are bright between a rising and a falling edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from field_models import COLOR_NAMES
from field_models.field import Field
from robocup_vision.arrays import FloatArray, UInt8Array, plain_frame
from robocup_vision.kernels.goal.paint.runs import find_mask_runs, link_runs
from robocup_vision.kernels.goal.paint.shine import fill_shine
from robocup_vision.kernels.goal.paint.strips import Runs, StripLimits, fit_strip, straight_line, summarize_chains
from robocup_vision.kernels.goal.paint.white import (
    GRADIENT_SIZES,
    GRADIENTS_PER_LEVEL,
    RUNS_PER_RISE,
    WhiteRuns,
    band_gradients,
    find_white_runs,
    greenness,
    least_channel,
    median_size,
)

# a third of full paint's saturation; with less, glare looks white
_MIN_SATURATION = 0.30
# level below which hue is noise
_MIN_VALUE = 25
# level, in all channels, of paint that a lamp overexposes to white
_MIN_SHINE = 170
# strongest colour cast that is corrected by the image's bright end; a stronger one is paint
_MAX_CAST = 1.3
# lean of a post in the image, columns for each row: 15 degrees of roll and perspective
_MAX_LEAN = 0.27
# thinner strips are noise; posts are at least 3 px wide at the scale of the search
_MIN_WIDTH_PX = 2.5
# largest gap within a post, in its widths: in clutter, and in paint of the right hue, which glare interrupts
_MAX_GAP_WIDTHS, _MAX_PAINT_GAP_WIDTHS = 2.0, 7.0
# least height of a strip, in its widths: in clutter, and in paint of the right hue
_MIN_ASPECT, _MIN_PAINT_ASPECT = 1.3, 1.0


def is_chromatic(color: str) -> bool:
    """Whether a named colour has a hue."""
    bgr = COLOR_NAMES[color]
    return max(bgr) - min(bgr) > 0.3 * max(bgr)


def hue_of(color: str) -> float:
    """Return the hue of a named colour in OpenCV's half degrees, 0 to 180."""
    return float(cv2.cvtColor(np.array([[COLOR_NAMES[color]]], np.uint8), cv2.COLOR_BGR2HSV)[0, 0, 0])


def hue_families(field: Field) -> dict[str, tuple[float, float]]:
    """Return the hue interval (half degrees, may pass 0 or 180) of each goal colour of a field that has a hue."""
    names = {"green", "orange", field.ball_color, *(goal.color for goal in field.goals)}
    names |= {color for beacon in field.beacons for color in beacon.colors}
    hues = {name: hue_of(name) for name in names if is_chromatic(name)}
    families = {}
    for color in dict.fromkeys(goal.color for goal in field.goals if is_chromatic(goal.color)):
        others = [(hues[name] - hues[color] + 90.0) % 180.0 - 90.0 for name in hues if name != color]
        above = min((d for d in others if d > 0), default=60.0)
        below = max((d for d in others if d < 0), default=-60.0)
        # a family extends by at most 40 degrees of hue in either direction
        families[color] = (hues[color] + max(below / 2, -20.0), hues[color] + min(above / 2, 20.0))
    return families


def white_gains(image: UInt8Array) -> npt.NDArray[np.float64]:
    """Return factors (3,) for B, G, R that make the image's bright end white."""
    coarse = image[::4, ::4].reshape(-1, 3)
    bright = np.array([np.partition(coarse[:, c], -len(coarse) // 20)[-len(coarse) // 20] for c in range(3)], float)
    gains = bright.max() / np.maximum(bright, 1.0)
    return np.asarray(np.minimum(gains, _MAX_CAST), np.float64)


def hue_masks(image: UInt8Array, families: dict[str, tuple[float, float]]) -> dict[str, UInt8Array]:
    """Return masks (H, W) uint8, 255 on paint, one for each hue family."""
    balanced, hsv = _balanced(image)
    masks = {}
    for color, (low, high) in families.items():
        least = np.array([max(low, 0.0), 255 * _MIN_SATURATION, _MIN_VALUE])
        most = np.array([min(high, 179.0), 255, 255])
        mask = cv2.inRange(hsv, least, most)
        for wrapped_low, wrapped_high in ((low + 180.0, 179.0), (0.0, high - 180.0)):
            if wrapped_low <= wrapped_high and (wrapped_low > 90.0 if low < 0 else high > 179.0):
                least[0], most[0] = wrapped_low, wrapped_high
                mask = cv2.bitwise_or(mask, cv2.inRange(hsv, least, most))
        masks[color] = np.asarray(mask, np.uint8)
        _fill(masks[color], balanced)
    return masks


def _balanced(image: UInt8Array) -> tuple[UInt8Array, UInt8Array]:
    """Return the white-balanced image, and its hue, saturation and value."""
    gains = white_gains(image)
    balanced = image if np.all(gains < 1.02) else np.asarray(cv2.LUT(image, _gain_table(gains)), np.uint8)
    return balanced, np.asarray(cv2.cvtColor(balanced, cv2.COLOR_BGR2HSV), np.uint8)


def _fill(mask: UInt8Array, balanced: UInt8Array) -> None:
    """Add overexposed pixels that paint surrounds, along rows (posts), then along columns (the bar)."""
    u, v, width, height = cv2.boundingRect(mask)
    box = np.s_[v : v + height, u : u + width]
    for upright in (False, True):
        fill_shine(mask[box], balanced[box], _MIN_SHINE, mask.shape[1] // 8, upright)


def _gain_table(gains: npt.NDArray[np.float64]) -> UInt8Array:
    ramp = np.arange(256)[:, None] * gains
    return np.minimum(np.rint(ramp), 255).astype(np.uint8).reshape(1, 256, 3)


@dataclass(frozen=True, slots=True)
class Strip:
    """An upright strip in the image, pixels; its edges are lines u = at + lean * v."""

    #: `at` and `lean` of both edges
    left: tuple[float, float]
    right: tuple[float, float]
    #: rows between which it was found
    top: float
    bottom: float
    foot: float  #: row where carpet begins below it; NaN if it does not stand on carpet
    strength: float  #: number of rows, multiplied by the mean contrast if that is known

    def edges_at(self, v: float) -> tuple[float, float]:
        """Return the left and right edge (u, pixels) in a row."""
        return self.left[0] + self.left[1] * v, self.right[0] + self.right[1] * v

    @property
    def height(self) -> float:
        """Height in rows."""
        return self.bottom - self.top

    def axis_at(self, v: float) -> float:
        """Return the middle (u, pixels) in a row."""
        left, right = self.edges_at(v)
        return (left + right) / 2

    def width_at(self, v: float) -> float:
        """Return the width in a row, pixels."""
        left, right = self.edges_at(v)
        return right - left


def carpet_mask(image: UInt8Array, excluded: UInt8Array | None = None) -> UInt8Array:
    """Return a mask (H, W) uint8, 255 on green carpet in sun and shadow: Otsu's threshold on 2G - R - B.

    Parameters
    ----------
    excluded : (H, W) uint8, optional
        Pixels that are certainly something else, such as cyan paint, which is greenish.
    """
    image = plain_frame(image)
    green = np.empty(image.shape[:2], np.uint8)
    greenness(image, green)
    if excluded is not None:
        green[excluded > 0] = 0
    smooth = cv2.blur(green, (3, 3))
    return np.asarray(cv2.threshold(smooth, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)[1])


def whiteness(image: UInt8Array) -> UInt8Array:
    """Return the least channel (H, W) of a picture (H, W, 3), in which white paint is bright and green carpet dark."""
    image = plain_frame(image)
    least = np.empty(image.shape[:2], np.uint8)
    least_channel(image, least)
    return least


def white_runs(white: UInt8Array, row_step: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Find white stretches between a rising and a falling edge, in bands of rows.

    Parameters
    ----------
    row_step : int
        Number of rows in a band.

    Returns
    -------
    row, left, right, contrast : (N,) float64
        Sorted by row; edges at sub-pixel columns; contrast is the weaker edge's gradient in noise units.
    """
    width = white.shape[1]
    gradient = np.empty((white.shape[0] // row_step, width), np.int16)
    sizes = np.empty(GRADIENT_SIZES, np.int64)
    band_gradients(white, row_step, gradient, sizes)
    noise = 1.4826 * median_size(sizes) / GRADIENTS_PER_LEVEL + 0.25
    # edges of one direction are never adjacent
    room = RUNS_PER_RISE * len(gradient) * (width // 2)
    runs = np.empty((4, room))
    count = find_white_runs(gradient, row_step, noise, (_MIN_WIDTH_PX, float(width // 8)), WhiteRuns(*runs))
    row, left, right, contrast = runs[:, :count]
    return row, left, right, contrast


def mask_runs(mask: UInt8Array, row_step: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return stretches of a mask in every `row_step`-th row, in the format of `white_runs` (contrast is 1)."""
    room = (mask.shape[0] // row_step + 1) * (mask.shape[1] // 2 + 1)
    row, left, right = np.empty(room), np.empty(room), np.empty(room)
    count = find_mask_runs(mask, row_step, mask.shape[1] // 5, row, left, right)
    return row[:count], left[:count], right[:count], np.ones(count)


def strips(
    runs: tuple[FloatArray, FloatArray, FloatArray, FloatArray], row_step: int, carpet: UInt8Array, *, certain: bool
) -> list[Strip]:
    """Link runs into upright strips, join the pieces of one post and find where each stands on the carpet.

    Parameters
    ----------
    row_step : int
        Number of rows in a band of runs.
    certain : bool
        Whether the runs are paint of the right hue; then strips may be shorter and gaps longer.
    """
    row, left, right, contrast = (np.ascontiguousarray(part) for part in runs)
    chain = np.empty(len(row), np.int64)
    chains = link_runs(row, left, right, _MAX_LEAN, 4.0 * row_step, chain)
    order = np.argsort(chain, kind="stable")
    bounds = np.searchsorted(chain[order], np.arange(chains + 1))
    summary = np.empty((chains, 6))
    summarize_chains(row, left, right, order, bounds, summary)
    tall = summary[:, 4] - summary[:, 3] + row_step >= 0.75 * summary[:, 5]
    # the longest first, for `_join`
    kept = sorted(np.flatnonzero(tall & (np.diff(bounds) >= 3)), key=lambda k: bounds[k] - bounds[k + 1])
    pieces = [order[bounds[k] : bounds[k + 1]] for k in kept]
    max_gap = _MAX_PAINT_GAP_WIDTHS if certain else _MAX_GAP_WIDTHS
    min_aspect = _MIN_PAINT_ASPECT if certain else _MIN_ASPECT
    limits = StripLimits(min_aspect, _MAX_LEAN, 0.8 * _MIN_WIDTH_PX)
    found = [
        strip
        for members in _join(pieces, summary[kept], row, (left + right) / 2, max_gap)
        if (strip := _strip(members, (row, left, right, contrast), carpet, limits))
    ]
    return sorted(found, key=lambda s: -s.strength)


def _join(
    pieces: list[npt.NDArray[np.int64]],
    summary: FloatArray,
    row: FloatArray,
    middle: FloatArray,
    max_gap: float,
) -> list[npt.NDArray[np.int64]]:
    """Join pieces that continue each other's axis at the same width, because glare and occlusion interrupt posts."""
    center, height, width, top, bottom = summary[:, :5].T
    free = np.ones(len(pieces), bool)
    joined: list[npt.NDArray[np.int64]] = []
    for i, members in enumerate(pieces):
        if not free[i]:
            continue
        free[i] = False
        own = float(width[i])
        while len(members) >= 4:
            lean, at = straight_line(row[members], middle[members], np.ones(len(members), np.bool_))
            gap = np.maximum(top - row[members[-1]], row[members[0]] - bottom)
            fits = free & (gap > 0) & (gap <= max_gap * own) & (np.abs(center - at - lean * height) < 0.3 * own)
            fits &= (width > 0.7 * own) & (width < 1.4 * own)
            if not fits.any():
                break
            nearest = int(np.argmin(np.where(fits, gap, np.inf)))
            free[nearest] = False
            members = np.sort(np.concatenate([members, pieces[nearest]]))
        joined.append(members)
    return joined


def _strip(
    members: npt.NDArray[np.int64],
    runs: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    carpet: UInt8Array,
    limits: StripLimits,
) -> Strip | None:
    found = np.empty(8)
    if not fit_strip(Runs(*runs), members, carpet, limits, found):
        return None
    left_at, left_lean, right_at, right_lean, top, bottom, foot, strength = found.tolist()
    return Strip((left_at, left_lean), (right_at, right_lean), top, bottom, foot, strength)


def enlarged(strip: Strip, factor: int) -> Strip:
    """Return the same strip in an image enlarged by `factor`; pixel centres are integers."""
    shift = (factor - 1) / 2

    def edge(line: tuple[float, float]) -> tuple[float, float]:
        at, lean = line
        return factor * at + shift - lean * shift, lean

    return Strip(
        edge(strip.left),
        edge(strip.right),
        strip.top * factor + shift,
        strip.bottom * factor + shift,
        strip.foot * factor + shift,
        strip.strength,
    )
