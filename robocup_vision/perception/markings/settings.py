"""What the search for markings can be tuned by."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MarkingSettings:
    """What the search for markings can be tuned by."""

    cells_across: int = 160  #: how wide a line looks is worked out in so many squares across the picture, or more
    #: standard deviation of a line point across its line; no measured one is believed to be smaller
    noise_px: float = 0.1
    #: lens, light and paint move whole stretches of line by no less than this, however straight the frame's lines are
    bias_px: float = 0.02
    points_per_sample: float = 2.0  #: neighbouring points err alike: so many tell as much as one
    slack_widths: float = 0.15  #: paint, carpet and lens bend a line by so many of its widths
    gate_px: float = 1.5  #: points within so many pixels of a line, and that slack, belong to it
    direction_rad: float = math.radians(15.0)  #: pieces of a line lie along it within this angle in the picture
    #: of a segment: its points, and its length in the picture
    min_points: int = 10
    min_px: float = 20.0
    min_cover: float = 0.75  #: share of a segment's length in the picture on which points lie
    min_along: float = 0.5  #: share of a segment's points in pieces that lie along it
    #: a gap in a line is one where so much of it shows bare carpet; else something stands before it
    bare_share: float = 0.5
    #: a line is told where its points are so much more likely by it than by an arc as curved as the field's
    straight_nats: float = 4.0
    min_arc_rad: float = math.radians(70.0)  #: of a circle so much is seen, or it is none
    max_arc_px: float = 0.35  #: points err by so much about a circle, or it is none: of lines that only lie about so
    #: lines end within so many of their widths and pixels of a crossing
    crossing_reach_widths: float = 2.5
    crossing_reach_px: float = 8.0
    gate_sigmas: float = 3.0  #: errors within so many standard deviations are chance
    square_slack_rad: float = math.radians(3.0)  #: lines at right angles are so within this and their errors
    max_std_m: float = 0.5  #: of a place across its line or along either one: what is known less well is not told
    min_post_px: float = 3.0  #: width in the picture of the thinnest post that is told from clutter
    post_width_ratio: float = 1.35  #: a post looks so many times as wide as it should, or as narrow, at most
    min_post_share: float = 0.6  #: of a post's height in view so much is seen
    min_solid_ratio: float = 0.75  #: the dark parts of a white post are no darker than this part of its bright ones
    min_contrast_ratio: float = 0.75  #: a post's edges have so much of the contrast of the clearest one's
    min_posts_apart: float = 0.5  #: two posts are so many goal widths apart
    #: of a post's foot in the picture: across it, and down it, where carpet begins in whole rows and is blurred
    post_std_px: tuple[float, float] = (0.3, 0.7)
    min_spot_px: float = 5.0  #: a penalty mark is so wide in the picture, or high, or it is not told from dirt
    spot_size_ratio: float = 1.5  #: a penalty mark looks so many times as large as it should, or as small, at most
    spot_std_px: float = 0.12  #: of a penalty mark's middle in the picture
    sway_std_rad: float = 0.02  #: of a forward camera's tilt and roll, where the camera does not say: a walking robot's
    mirror_std_rad: float = 0.0  #: of a mirror camera's tilt
    max_range_ratio: float = 1.0  #: farther away than so many lengths of the field no line is looked for
