"""Numbers of the follower with their reasons. Lengths are pixels of a picture 208 wide unless stated otherwise."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.kernels.model_edges.tables import FollowSettings
from robocup_vision.localization.model_edges.weights import packaged_edge_weights

DESIGN_WIDTH_PX = 208.0
# distance between samples in pictures 208 and 640 pixels wide: closer samples add little, and take time
_SPACING_PX, _WIDE_SPACING_PX, _WIDE_PX = 5.0, 12.0, 640
# samples by which the mode is chosen are this many times as far apart, because their searches take longer
_COARSER = 2.0
_REACH_SIGMAS = 3.0  # range of the search for an edge, in standard deviations of the prior
# least ratio of a step to the expected one: carpets and paints differ, shadows halve the light
MIN_RATIO = 0.4
# noise of one sample, and of the offset that is common to all samples of an edge (lens, paint, tape measure), in
# pixels of any picture
_SIGMA_PX, _SHARED_PX = 0.15, 0.2
# fraction of the samples found that lie on another object, which stands before their edge or crosses it
_STRAY_RATIO = 0.3
# gate of the last steps, in robust standard deviations of the residuals, and the number of these steps
_SHARP_GATES, _SHARP_STEPS = 3.5, 2
_GATE_PX = 2.5  # gate of an inlier, pixels of any picture
_AGAIN_PX = 5.0  # range of the second search for candidates, around a fit, pixels of any picture
_POINT_STRIDE_PX = 8.0  # distance of the rows and columns that are read for line points
# range of the first search of a mode, as a fraction of its distance from the prior in pixels: the relative error of
# derivatives at the prior
_BENT_RATIO = 0.4
# greatest width of a line, in widths by the field file: two tapes side by side, or blur, make a line this wide
_MAX_LINE_WIDTHS = 3.5


@dataclass(frozen=True, slots=True)
class EdgeSettings:
    """What differs between followers."""

    #: number of samples for the fit: more reduce the noise of blurred edges, but not the common error of an edge
    ample_samples: float = 70.0
    #: distance beyond the field's outer lines from which what looks like a line is none of the field's
    lines_end_m: float = math.inf
    #: whether the carpet may have two tones: in the sun, bleached by glare, and in the shade
    in_sun_and_shade: bool = False

    def for_unconfirmed_frames(self) -> EdgeSettings:
        """Return the settings for a frame in which no pose was confirmed: all its samples are used."""
        return replace(self, ample_samples=math.inf)

    def for_width(self, width_px: int, line_width_m: float) -> FollowSettings:
        """Return the numbers for a picture of this width."""
        weights = packaged_edge_weights()
        scale = width_px / DESIGN_WIDTH_PX
        wide = _WIDE_PX / DESIGN_WIDTH_PX - 1.0
        grown = max(1.0, 1.0 + 0.33 * (scale - 1.0) / wide)
        spacing_px = max(_SPACING_PX + (_WIDE_SPACING_PX - _SPACING_PX) * (scale - 1.0) / wide, 2.5)
        return FollowSettings(
            spacing_px=spacing_px,
            coarse_spacing_px=_COARSER * spacing_px,
            ample_samples=self.ample_samples,
            reach_sigmas=_REACH_SIGMAS,
            min_ratio=MIN_RATIO,
            sigma_px=_SIGMA_PX,
            shared_px=_SHARED_PX,
            stray_ratio=_STRAY_RATIO,
            sharp_gates=_SHARP_GATES,
            sharp_steps=_SHARP_STEPS,
            gate_px=_GATE_PX,
            again_px=_AGAIN_PX,
            line_width_m=line_width_m,
            point_stride=max(4, round(_POINT_STRIDE_PX * scale)),
            weights=weights.near_prior,
            sure_log_odds=weights.sure_log_odds,
            coarse_gates_px=np.array([6.0, 4.0]) * grown,
            fine_gates_px=np.array([4.0, 3.0, 2.5]) * grown,
            max_line_widths=_MAX_LINE_WIDTHS,
            bent_ratio=_BENT_RATIO,
        )
