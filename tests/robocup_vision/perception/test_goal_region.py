"""Strips, carpet and goal paint in small drawn pictures."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models import COLOR_NAMES, load_field
from robocup_vision.perception.goal_color import (
    halves,
    hue_families,
    hue_masks,
    hue_modes,
    hue_of,
    is_chromatic,
    paint_channels,
    parting,
    white_gains,
)
from robocup_vision.perception.goal_region import (
    bright_runs,
    carpet_mask,
    enlarged,
    mask_runs,
    posts_under,
    strips,
    white_runs,
)

FIELD = load_field("four_legged_2007")


def drawn(color, left=60, width=8, top=30, foot=90, behind=(70, 70, 70)):
    """Draw a post on green carpet that begins at row 70."""
    frame = np.full((120, 160, 3), behind, np.uint8)
    frame[70:] = COLOR_NAMES["green"]
    frame[top:foot, left : left + width] = COLOR_NAMES[color]
    noise = np.random.default_rng(0).normal(0, 2, frame.shape)
    return np.clip(frame + noise, 0, 255).astype(np.uint8)


@settings(deadline=None, max_examples=20)
@given(st.integers(20, 120), st.integers(5, 14), st.sampled_from(["cyan", "yellow"]))
def test_colored_post_is_one_strip_on_its_foot(left, width, color):
    frame = drawn(color, left, width)
    masks = hue_masks(frame, hue_families(FIELD))
    found = strips(mask_runs(masks[color], 2), 2, carpet_mask(frame, masks[color]), certain=True)
    assert len(found) == 1
    assert found[0].edges_at(60) == pytest.approx((left - 0.5, left + width - 0.5), abs=0.6)
    assert found[0].foot == pytest.approx(89.5, abs=1.1)


def test_white_post_before_clutter_stands_on_the_carpet():
    frame = drawn("white")
    frame[10:60, 100:104] = 220  # hangs in the air
    found = strips(white_runs(frame, 4), 4, carpet_mask(frame), certain=False)
    standing = [s for s in found if np.isfinite(s.foot)]
    assert len(standing) == 1
    assert standing[0].edges_at(60) == pytest.approx((59.5, 67.5), abs=0.6)
    assert standing[0].foot == pytest.approx(89.5, abs=2.1)


def test_glare_cuts_no_post_apart():
    frame = drawn("cyan", width=10)
    frame[45:60, 61:69] = 255  # enclosed by paint
    frame[62:68, 55:75] = 70  # and something in front of it
    masks = hue_masks(frame, hue_families(FIELD))
    assert masks["cyan"][50, 65] == 255
    found = strips(mask_runs(masks["cyan"], 2), 2, carpet_mask(frame, masks["cyan"]), certain=True)
    assert len(found) == 1
    assert found[0].top < 36
    assert found[0].bottom > 84


def test_families_part_the_pitch_s_colours():
    families = hue_families(FIELD)
    assert list(families) == ["cyan", "yellow"]
    for color, (low, high) in families.items():
        assert low < hue_of(color) < high
        for other in ("green", "orange", "pink"):
            assert not low <= hue_of(other) <= high
        lower, upper = halves((low, high))
        assert lower[0] == low < upper[0] < lower[1] < upper[1] == high
    assert hue_families(load_field("spl_2020")) == {}
    assert is_chromatic("orange")
    assert not is_chromatic("white")


def test_two_hues_that_touch_are_distinguished():
    frame = np.full((60, 80, 3), 215, np.uint8)
    frame[20:40, 10:30], frame[20:40, 30:60] = (215, 185, 35), (215, 130, 60)
    whole = hue_masks(frame, hue_families(FIELD))["cyan"]
    assert whole[30, 20]
    assert whole[30, 45]
    low, high = hue_modes(frame, whole)[0]
    assert low < hue_of("cyan") < high
    assert hue_modes(frame[:, :30], whole[:, :30]) == []


def test_a_colour_cast_is_taken_out():
    frame = drawn("cyan", behind=(200, 200, 200))
    warm = np.clip(frame * np.array([0.8, 0.95, 1.0]), 0, 255).astype(np.uint8)
    gains = white_gains(warm)
    assert gains[0] > gains[2]
    assert gains.max() <= 1.3
    mask = hue_masks(warm, hue_families(FIELD))["cyan"]
    assert mask[40:80, 62:66].mean() > 250


def test_enlarging_keeps_pixel_centres():
    frame = drawn("cyan")
    masks = hue_masks(frame, hue_families(FIELD))
    small = strips(mask_runs(masks["cyan"], 2), 2, carpet_mask(frame, masks["cyan"]), certain=True)[0]
    large = enlarged(small, 2)
    assert large.axis_at(large.foot) == pytest.approx(2 * small.axis_at(small.foot) + 0.5)
    assert enlarged(small, 1) is small or enlarged(small, 1) == small


def test_nothing_comes_of_nothing():
    frame = np.zeros((120, 160, 3), np.uint8)
    assert strips(white_runs(frame, 4), 4, carpet_mask(frame), certain=False) == []
    assert all(not mask.any() for mask in hue_masks(frame, hue_families(FIELD)).values())


@pytest.mark.parametrize("color", ["cyan", "yellow"])
def test_paint_is_bright_in_its_channels_and_washed_paint_in_one(color):
    frame = drawn(color)
    frame[50:60, 60:68] = 255
    hue, light = paint_channels(frame, color)
    assert hue[40, 64] > 100 > hue[100, 100]
    assert hue[55, 64] == 0
    assert light[55, 64] == 255
    assert light[40, 64] > 150 > light[100, 100]


def test_a_post_before_a_panel_of_its_own_hue_has_edges_still():
    frame = drawn("cyan")
    frame[20:70, 68:150] = (140, 120, 30)
    hue, _ = paint_channels(frame, "cyan")
    found = strips(bright_runs(hue, 2), 2, carpet_mask(frame), certain=True)
    assert any(s.edges_at(50) == pytest.approx((59.5, 67.5), abs=1.0) for s in found)


def test_posts_are_supposed_where_a_bar_ends():
    frame = drawn("cyan", left=40, width=8)
    frame[30:90, 112:120] = COLOR_NAMES["cyan"]
    frame[30:38, 40:120] = COLOR_NAMES["cyan"]
    mask = hue_masks(frame, hue_families(FIELD))["cyan"]
    lying = strips(mask_runs(np.ascontiguousarray(mask.T), 2), 2, np.zeros((160, 120), np.uint8), certain=True)
    bar = max(lying, key=lambda s: s.height)
    posts = posts_under(bar, carpet_mask(frame, mask))
    assert posts is not None
    assert [p.axis_at(60) for p in posts] == pytest.approx([43.5, 115.5], abs=3.0)
    assert [p.foot for p in posts] == pytest.approx([89.5, 89.5], abs=2.0)
    assert posts_under(bar, np.zeros_like(mask)) is None


@pytest.mark.parametrize("turned", [False, True])
def test_a_speck_beyond_a_bright_wall_encloses_nothing_with_the_bar(turned):
    frame = np.full((160, 160, 3), 190, np.uint8)
    bar = np.s_[80:86, 40:90]
    frame[bar] = COLOR_NAMES["cyan"]
    frame[74, 130] = COLOR_NAMES["cyan"]
    if turned:
        frame = np.ascontiguousarray(frame.transpose(1, 0, 2))
    mask = hue_masks(frame, hue_families(FIELD))["cyan"]
    mask = mask.T if turned else mask
    assert mask[bar].all()
    mask[bar] = 0
    assert np.argwhere(mask).tolist() == [[74, 130]]


@given(st.floats(0.3, 1.0), st.floats(0.3, 1.0))
def test_parting_shows_paint_and_neither_grey_nor_the_other_hue_however_lit(light, shade):
    frame = np.zeros((10, 30, 3))
    cyan, blue, grey = (np.array(c, float) for c in ((150, 130, 25), (170, 115, 20), (120, 120, 120)))
    frame[:, :10], frame[:, 10:20], frame[:, 20:] = light * cyan, shade * blue, shade * grey
    frame = np.rint(frame).astype(np.uint8)
    paint, other = np.zeros((2, 10, 30), np.uint8)
    paint[:, :10], other[:, 10:20] = 255, 255
    along = frame @ parting(frame, paint, other)
    assert along[0, 0] > 3.0
    assert np.abs(along[:, 10:]).max() < 1.0


def test_parting_needs_two_hues():
    frame = np.full((10, 10, 3), (150, 130, 25), np.uint8)
    paint, other = np.zeros((2, 10, 10), np.uint8)
    paint[:5] = 255
    assert parting(frame, paint, other) is None
    other[5:] = 255
    assert parting(frame, paint, other) is None
