"""Settings of the follower, with why each is as it is."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from robocup_vision.kernels.model_edges.tables import FollowSettings
from robocup_vision.localization.model_edges.weights import packaged_edge_weights

DESIGN_WIDTH_PX = 208.0


@dataclass(frozen=True, slots=True)
class EdgeSettings:
    """Settings of the follower. Lengths are pixels of a picture 208 wide, unless a line says otherwise."""

    #: distance between samples in pictures 208 and 640 pixels wide: neighbours add little, and take time
    spacing_px: float = 5.0
    wide_spacing_px: float = 12.0
    #: samples of the fit: more do not average out the common error of an edge, but the noise of a blurred one
    ample_samples: float = 70.0
    #: samples by which the mode is chosen are this many times as far apart: their searches are longer
    coarser: float = 2.0
    #: search for an edge, in standard deviations of the prior
    reach_sigmas: float = 3.0
    #: least ratio of a step to the expected one: carpets and paints differ, shadows halve the light
    min_ratio: float = 0.4
    #: white paint's step from the carpet, as a ratio to the nominal one, is learnt from lines wide enough for blur to
    #: leave their middle: least width and points
    min_paint_px: float = 3.0
    min_paint_points: int = 8
    #: noise of one sample, and of the offset that is common to all samples of an edge (lens, paint, tape measure), in
    #: pixels of any picture
    sigma_px: float = 0.15
    shared_px: float = 0.2
    #: fraction of the samples found that lie on another thing, which stands before their edge or crosses it
    stray_ratio: float = 0.3
    #: gate of the last steps, in robust standard deviations of the residuals, and the number of these steps
    sharp_gates: float = 3.5
    sharp_steps: int = 2
    #: gate of an inlier, pixels of any picture
    gate_px: float = 2.5
    #: range of the second search for candidates, around a fit, pixels of any picture
    again_px: float = 5.0
    #: rows and columns between those that are read for line points
    point_stride_px: float = 8.0
    #: things that look like lines this far beyond the field's outer lines are none
    lines_end_m: float = math.inf
    #: first search of a mode, as a fraction of its distance from the prior in pixels: the accuracy of derivatives at
    #: the prior
    bent_ratio: float = 0.4
    #: hypotheses of which the mode is chosen
    hypotheses: int = 50
    #: least number of inliers, and of samples found on edges that the field's other half lacks for a frame to show the
    #: half: two may agree by chance
    min_inliers: int = 3
    #: time constant of a frame's odds in those after it
    odds_memory_s: float = 0.5
    #: a frame with lower log-odds does not support the pose
    min_supporting_log_odds: float = 0.1
    #: greatest speeds of a robot and its head: a prior farther from the last answer does not continue it
    max_speed_mps: float = 4.0
    max_turn_radps: float = 10.0
    #: tilt, roll and height are forgotten with this time constant: a step takes about half a second
    sway_memory_s: float = 0.12
    #: greatest width of a line, in widths by the field file: two tapes side by side, or blur, make a line this wide
    max_line_widths: float = 3.5
    #: whether the carpet may have two tones: in the sun, bleached by glare, and in the shade
    in_sun_and_shade: bool = False
    #: a frame that confirms nothing may be blurred: it is examined again reduced by these factors, to this width at
    #: least
    copy_factors: tuple[int, ...] = (2, 3)
    min_copy_px: int = 200
    #: least time between searches by the bank that found nothing: frames closer together show the same
    search_again_s: float = 0.1
    #: a camera located within this time is probably near its prior: odometry with an error of a tenth is off by 20 cm
    #: at 1 m/s
    near_s: float = 2.0
    #: of the prior where only a pose is given
    prior_std_m: float = 0.15
    prior_std_rad: float = 0.1

    def reductions(self, width_px: int) -> list[int]:
        """Return the factors by which a frame of this width is reduced where it is examined again."""
        return [k for k in self.copy_factors if width_px >= k * self.min_copy_px]

    def for_unconfirmed_frames(self) -> EdgeSettings:
        """Return the settings for a frame in which no pose was confirmed: all its samples count."""
        return replace(self, ample_samples=math.inf)

    def for_width(self, width_px: int, line_width_m: float) -> FollowSettings:
        """Return the numbers for a picture of this width."""
        weights = packaged_edge_weights()
        scale = width_px / DESIGN_WIDTH_PX
        grown = max(1.0, 1.0 + 0.33 * (scale - 1.0) / (640 / 208 - 1.0))
        spacing = self.spacing_px + (self.wide_spacing_px - self.spacing_px) * (scale - 1.0) / (640 / 208 - 1.0)
        spacing_px = max(spacing, 2.5)
        return FollowSettings(
            spacing_px=spacing_px,
            coarse_spacing_px=self.coarser * spacing_px,
            ample_samples=self.ample_samples,
            reach_sigmas=self.reach_sigmas,
            min_ratio=self.min_ratio,
            sigma_px=self.sigma_px,
            shared_px=self.shared_px,
            stray_ratio=self.stray_ratio,
            sharp_gates=self.sharp_gates,
            sharp_steps=self.sharp_steps,
            gate_px=self.gate_px,
            again_px=self.again_px,
            line_width_m=line_width_m,
            point_stride=max(4, round(self.point_stride_px * scale)),
            weights=weights.near_prior,
            sure_log_odds=weights.sure_log_odds,
            coarse_gates_px=np.array([6.0, 4.0]) * grown,
            fine_gates_px=np.array([4.0, 3.0, 2.5]) * grown,
            max_line_widths=self.max_line_widths,
            bent_ratio=self.bent_ratio,
        )
