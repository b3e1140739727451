"""What the search for markings can be tuned by."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MarkingSettings:
    """What the search for markings can be tuned by.

    Parameters
    ----------
    cells_across : int
        How wide a line looks is worked out in so many squares across the picture, or more.
    noise_px : float
        Standard deviation of a line point across its line; no measured one is believed to be smaller.
    bias_px : float
        Lens, light and paint move whole stretches of line by no less than this, however straight the frame's lines are.
    min_two_sided : float
        Share of a segment's points that have carpet on both sides.
    points_per_sample : float
        Neighbouring points err alike: so many tell as much as one.
    slack_widths : float
        Paint, carpet and lens bend a line by so many of its widths.
    gate_px : float
        Points within so many pixels of a line, and that slack, belong to it.
    direction_rad : float
        Pieces of a line lie along it within this angle in the picture.
    min_points, min_px : int, float
        Of a segment: its points, and its length in the picture.
    min_cover : float
        Share of a segment's length in the picture on which points lie.
    min_along : float
        Share of a segment's points in pieces that lie along it.
    bare_share : float
        A gap in a line is one where so much of it shows bare carpet; else something stands before it.
    straight_nats : float
        A line is told where its points are so much more likely by it than by an arc as curved as the field's.
    min_arc_rad : float
        Of a circle so much is seen, or it is none.
    max_arc_px : float
        Points err by so much about a circle, or it is none: of lines that only lie about so.
    crossing_reach_widths, crossing_reach_px : float
        Lines end within so many of their widths and pixels of a crossing.
    gate_sigmas : float
        Errors within so many standard deviations are chance.
    square_slack_rad : float
        Lines at right angles are so within this and their errors.
    max_std_m : float
        Of a place across its line or along either one: what is known less well is not told.
    min_post_px : float
        Width in the picture of the thinnest post that is told from clutter.
    post_width_ratio : float
        A post looks so many times as wide as it should, or as narrow, at most.
    min_post_share : float
        Of a post's height in view so much is seen.
    min_solid_ratio : float
        The dark parts of a white post are no darker than this part of its bright ones.
    min_contrast_ratio : float
        A post's edges have so much of the contrast of the clearest one's.
    min_posts_apart : float
        Two posts are so many goal widths apart.
    post_std_px : (float, float)
        Of a post's foot in the picture: across it, and down it, where carpet begins in whole rows and is blurred.
    min_spot_px : float
        A penalty mark is so wide in the picture, or high, or it is not told from dirt.
    spot_size_ratio : float
        A penalty mark looks so many times as large as it should, or as small, at most.
    spot_std_px : float
        Of a penalty mark's middle in the picture.
    sway_std_rad : float
        Of a forward camera's tilt and roll, where the camera does not say: a walking robot's.
    mirror_std_rad : float
        Of a mirror camera's tilt.
    max_range_ratio : float
        Farther away than so many lengths of the field no line is looked for.
    """

    cells_across: int = 160
    noise_px: float = 0.1
    bias_px: float = 0.02
    min_two_sided: float = 0.5
    points_per_sample: float = 2.0
    slack_widths: float = 0.15
    gate_px: float = 1.5
    direction_rad: float = math.radians(15.0)
    min_points: int = 10
    min_px: float = 20.0
    min_cover: float = 0.75
    min_along: float = 0.5
    bare_share: float = 0.5
    straight_nats: float = 4.0
    min_arc_rad: float = math.radians(70.0)
    max_arc_px: float = 0.35
    crossing_reach_widths: float = 2.5
    crossing_reach_px: float = 8.0
    gate_sigmas: float = 3.0
    square_slack_rad: float = math.radians(3.0)
    max_std_m: float = 0.5
    min_post_px: float = 3.0
    post_width_ratio: float = 1.35
    min_post_share: float = 0.6
    min_solid_ratio: float = 0.75
    min_contrast_ratio: float = 0.75
    min_posts_apart: float = 0.5
    post_std_px: tuple[float, float] = (0.3, 0.7)
    min_spot_px: float = 5.0
    spot_size_ratio: float = 1.5
    spot_std_px: float = 0.12
    sway_std_rad: float = 0.02
    mirror_std_rad: float = 0.0
    max_range_ratio: float = 1.0
