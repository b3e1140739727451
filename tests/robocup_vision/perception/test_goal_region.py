"""Strips, carpet and goal paint in small drawn pictures."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from field_models import COLOR_NAMES, load_field
from robocup_vision.perception.goal_region import (
    carpet_mask,
    enlarged,
    hue_families,
    hue_masks,
    hue_of,
    is_chromatic,
    mask_runs,
    strips,
    white_gains,
    white_runs,
    whiteness,
)

FIELD = load_field("four_legged_2007")


def drawn(color, left=60, width=8, top=30, foot=90, behind=(70, 70, 70)):
    """Draw a post on green carpet that begins at row 70."""
    frame = np.full((120, 160, 3), behind, np.uint8)
    frame[70:] = COLOR_NAMES["green"]
    frame[top:foot, left : left + width] = COLOR_NAMES[color]
    noise = np.random.default_rng(0).normal(0, 2, frame.shape)
    return np.clip(frame + noise, 0, 255).astype(np.uint8)


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
    found = strips(white_runs(whiteness(frame), 4), 4, carpet_mask(frame), certain=False)
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
    assert hue_families(load_field("spl_2020")) == {}
    assert is_chromatic("orange")
    assert not is_chromatic("white")


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
    assert strips(white_runs(whiteness(frame), 4), 4, carpet_mask(frame), certain=False) == []
    assert all(not mask.any() for mask in hue_masks(frame, hue_families(FIELD)).values())


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
