"""A frame as the search for goals takes it: its paint, carpet and edges, each worked out when it is first asked for."""

from __future__ import annotations

from functools import cached_property, reduce
from typing import NamedTuple

import cv2
import numpy as np

from field_models.field import COLOR_NAMES
from robocup_vision.arrays import UInt8Array
from robocup_vision.kernels.goal.silhouettes import Evidence
from robocup_vision.localization.goal.silhouettes import Edges, Gradients, SilhouetteSearch
from robocup_vision.perception.goal_region import carpet_mask, hue_masks, whiteness

# greatest ratio of colours in white light, by tinted lamps and white balance, and their difference by noise
_WHITE_RATIO = np.float32(1.1)
_NOISE = np.float32(8.0)
# frames are searched for goals of a hue at about this width: posts of the leagues' goals are still 3 px wide there
# from the far end of the field
_WIDTH_PX = 208
_SHADED = 0.5  # paint of a goal, even in its own shade, is no darker than this part of the carpet


class PaintMasks(NamedTuple):
    """Masks (H, W) of the paint of each hue, by its name, and of carpet."""

    paint: dict[str, UInt8Array]
    carpet: UInt8Array


class GoalPicture:
    """One BGR frame for the search for goals: masks are made of it reduced by `factor`.

    `families` are the hues of the field's goals, see `perception.goal_color.hue_families`. Paint in its own shade is no
    darker than the fraction `shaded` of the carpet.
    """

    def __init__(
        self,
        frame: UInt8Array,
        families: dict[str, tuple[float, float]],
        silhouettes: SilhouetteSearch,
    ) -> None:
        self.frame = frame
        self.factor = max(1, round(frame.shape[1] / _WIDTH_PX))  #: by which masks are smaller than the frame
        self._families = families
        self._silhouettes = silhouettes
        self._evidence: dict[str, Evidence] = {}
        self._washable: dict[str, UInt8Array] = {}

    @cached_property
    def small(self) -> UInt8Array:
        """The frame reduced."""
        return self._reduced(self.frame)

    @cached_property
    def masks(self) -> PaintMasks:
        """Of the reduced frame."""
        return self._masks(self.small)

    @cached_property
    def whiteness(self) -> UInt8Array:
        """How bright each pixel of the frame is in all channels."""
        return whiteness(self.frame)

    @cached_property
    def straight(self) -> UInt8Array:
        """The frame as a lens without distortion would show it."""
        return self._silhouettes.picture(self.frame)

    @cached_property
    def straight_masks(self) -> PaintMasks:
        """Of `straight` reduced."""
        return self.masks if self.straight is self.frame else self._masks(self._reduced(self.straight))

    @cached_property
    def gradients(self) -> Gradients:
        """Of `straight`."""
        return self._silhouettes.gradients(self.straight)

    @cached_property
    def edges(self) -> Edges:
        """Of `straight`."""
        return self._silhouettes.edges(self.gradients)

    def evidence(self, color: str) -> Evidence:
        """Weigh what `straight` shows of a goal of a hue, pixel by pixel."""
        if color not in self._evidence:
            paint, carpet = self.straight_masks
            self._evidence[color] = self._silhouettes.evidence(self.edges, paint[color], carpet)
        return self._evidence[color]

    def washable(self, color: str) -> UInt8Array:
        """Mask (H, W) of what may be paint of a hue, washed by lamps or not, in the reduced frame.

        Its colours are brighter than carpet, and lamps add light: where a post is dark, somebody stands before it.
        White light adds to all colours alike: a pixel with more of another colour than of the hue's is no paint.
        """
        if color in self._washable:
            return self._washable[color]
        bgr = COLOR_NAMES[color]
        channels = cv2.split(self.small)
        of_hue = [one for one, level in zip(channels, bgr, strict=True) if 3 * level >= sum(bgr)]
        others = [one for one, level in zip(channels, bgr, strict=True) if 3 * level < sum(bgr)]
        lit, other = reduce(cv2.min, of_hue), reduce(cv2.max, others, np.zeros_like(channels[0]))
        green = self.small[..., 1][self.masks.carpet > 0]
        least = _SHADED * float(np.median(green)) if len(green) else 0.0
        is_washable = (lit >= least) & (_WHITE_RATIO * lit + _NOISE >= other)
        self._washable[color] = np.where(is_washable, np.uint8(255), np.uint8(0))
        return self._washable[color]

    def _reduced(self, image: UInt8Array) -> UInt8Array:
        if self.factor == 1:
            return image
        small = cv2.resize(image, None, fx=1 / self.factor, fy=1 / self.factor, interpolation=cv2.INTER_AREA)
        return np.asarray(small, np.uint8)

    def _masks(self, image: UInt8Array) -> PaintMasks:
        paint = hue_masks(image, self._families) if self._families else {}
        carpet = carpet_mask(image, np.bitwise_or.reduce(list(paint.values())) if paint else None)
        return PaintMasks(paint, carpet)
