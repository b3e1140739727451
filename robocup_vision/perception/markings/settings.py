"""What the search for markings can be tuned by."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class MarkingSettings:
    """What the search for markings can be tuned by."""

    #: smallest number of squares across the picture for which a line's width in pixels is computed
    cells_across: int = 160
    #: standard deviation of a line point across its line; no measured one is believed to be smaller
    noise_px: float = 0.1
    #: lens, light and paint move whole stretches of line by no less than this, however straight the frame's lines are
    bias_px: float = 0.02
    #: number of neighbouring points that count as one sample: their errors are correlated
    points_per_sample: float = 2.0
    slack_widths: float = 0.15  #: largest bend of a line by paint, carpet and lens, in line widths
    gate_px: float = 1.5  #: largest distance of a line's points, beyond that slack
    direction_rad: float = math.radians(15.0)  #: largest angle in the picture between a line and its pieces
    #: of a segment: its points, and its length in the picture
    min_points: int = 10
    min_px: float = 20.0
    min_cover: float = 0.75  #: share of a segment's length in the picture on which points lie
    min_along: float = 0.5  #: share of a segment's points in pieces that lie along it
    #: smallest ratio of bare carpet in a gap of a line; with less, something stands before it
    bare_share: float = 0.5
    #: smallest log-likelihood ratio of a line against an arc as curved as the field's
    straight_nats: float = 4.0
    min_arc_rad: float = math.radians(70.0)  #: smallest visible part of a circle
    max_arc_px: float = 0.35  #: largest noise of points about a circle: lines that resemble one have more
    #: largest distance of a line's end from its crossing, in line widths, and in pixels
    crossing_reach_widths: float = 2.5
    crossing_reach_px: float = 8.0
    gate_sigmas: float = 3.0  #: gate of errors, in standard deviations
    square_slack_rad: float = math.radians(3.0)  #: largest deviation from a right angle, beyond the lines' errors
    max_std_m: float = 0.5  #: largest standard deviation of a reported place
    min_post_px: float = 3.0  #: width in the picture of the thinnest post that can be distinguished from clutter
    #: largest ratio of a post's width in the picture to the expected one, and its inverse the smallest
    post_width_ratio: float = 1.35
    min_post_share: float = 0.6  #: smallest visible part of a post's height within the picture
    min_solid_ratio: float = 0.75  #: smallest brightness of a white post's dark parts, relative to its bright ones
    min_contrast_ratio: float = 0.75  #: smallest contrast of a post's edges relative to the clearest post's
    min_posts_apart: float = 0.5  #: smallest distance of two posts, in goal widths
    #: of a post's foot in the picture: across it, and down it, where carpet begins in whole rows and is blurred
    post_std_px: tuple[float, float] = (0.3, 0.7)
    #: smallest width or height of a penalty mark in the picture: smaller ones cannot be distinguished from dirt
    min_spot_px: float = 5.0
    #: largest ratio of a penalty mark's size to the expected one, and its inverse the smallest
    spot_size_ratio: float = 1.5
    spot_std_px: float = 0.12  #: of a penalty mark's middle in the picture
    sway_std_rad: float = 0.02  #: of a forward camera's tilt and roll, where the camera does not say: a walking robot's
    mirror_std_rad: float = 0.0  #: of a mirror camera's tilt
    max_range_ratio: float = 1.0  #: largest range at which lines are looked for, in diagonals of the field
