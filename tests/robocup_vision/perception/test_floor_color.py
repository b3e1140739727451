"""The floor's colour from the ring around the robot: under casts, darkness, shadow and noise, and if there is none."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robocup_vision.perception.floor_color import LEVELS, learn_floor_color

GREEN, WHITE, ORANGE, BLUE = (50.0, 130.0, 45.0), (230.0, 230.0, 230.0), (30.0, 110.0, 235.0), (190.0, 80.0, 35.0)
ALL = np.ones((160, 83), dtype=np.uint8)


def scene(rng, gain=1.0, cast=(1.0, 1.0, 1.0), noise=2.0, shadow=None):
    """Green up to column 50, white beyond; an orange and a blue patch; a shadow over half of the bearings."""
    samples = np.empty((160, 83, 3))
    samples[:] = GREEN
    samples[:, 50:] = WHITE
    samples[20:40, 30:50], samples[60:75, 20:50] = ORANGE, BLUE
    if shadow is not None:
        samples[80:] *= shadow
    samples = samples * gain * cast + rng.normal(0, noise * 3, samples.shape)
    return cv2.blur(np.clip(np.rint(samples), 0, 255).astype(np.uint8), (3, 3))


def is_floor(color, floor):
    blue, green, red = (np.array(c, dtype=float) for c in color)
    return float(floor.log_likelihood_ratio(blue, green, red)) > 0


def seen(color, gain, cast):
    return np.array(color) * gain * cast


@given(
    st.floats(0.3, 1.0),
    st.sampled_from([(1.0, 1.0, 1.0), (0.8, 0.95, 1.25), (1.25, 0.95, 0.8)]),
    st.floats(0, 4),
    st.integers(0, 2**32 - 1),
)
def test_floor_is_distinguished_from_the_rest_under_any_light(gain, cast, noise, seed):
    floor = learn_floor_color(scene(np.random.default_rng(seed), gain, cast, noise), ALL)
    assert is_floor(seen(GREEN, gain, cast), floor)
    assert is_floor(seen(GREEN, gain * 0.8, cast), floor)
    for other in (WHITE, ORANGE, BLUE):
        assert not is_floor(seen(other, gain, cast), floor)
    # what they look like next to green once nearly no light is left is anybody's guess
    assert floor.level == pytest.approx(gain * 88.75, rel=0.25)
    assert floor.lit.red_ratio == pytest.approx(45 / 130 * cast[2] / cast[1], rel=0.15)
    assert floor.lit.blue_ratio == pytest.approx(50 / 130 * cast[0] / cast[1], rel=0.15)


def test_a_hard_bluish_shadow_is_floor_too():
    shadow = (0.56, 0.50, 0.46)
    floor = learn_floor_color(scene(np.random.default_rng(1), shadow=shadow), ALL)
    assert is_floor(GREEN, floor)
    assert is_floor(np.array(GREEN) * shadow, floor)
    assert not is_floor(np.array(WHITE) * shadow, floor)


def test_a_purer_floor_is_floor_and_nothing_is_that_lies_elsewhere():
    rng = np.random.default_rng(3)
    haze = 0.25
    # where it is learnt, light strays over the carpet
    near = (1 - haze) * np.array(GREEN) + haze * 110.0
    samples = cv2.blur(np.clip(np.rint(near + rng.normal(0, 6, (160, 83, 3))), 0, 255).astype(np.uint8), (3, 3))
    floor = learn_floor_color(samples, ALL)
    for part in (0.0, 0.1, 0.2):
        assert is_floor((1 - part) * np.array(GREEN) + part * 110.0, floor)
    for other in (WHITE, ORANGE, BLUE, (40.0, 130.0, 130.0), (130.0, 130.0, 40.0)):
        assert not is_floor(np.array(other), floor)


def test_a_floor_without_any_red_is_floor_where_light_glances_off_it():
    rng = np.random.default_rng(4)
    glare = np.linspace(0.0, 0.35, 83)[None, :, None]
    samples = (1 - glare) * (70.0, 100.0, 12.0) + glare * 255.0 + rng.normal(0, 6, (160, 83, 3))
    floor = learn_floor_color(cv2.blur(np.clip(np.rint(samples), 0, 255).astype(np.uint8), (3, 3)), ALL)
    for part in (0.0, 0.1, 0.2, 0.3):
        assert is_floor((1 - part) * np.array((70.0, 100.0, 12.0)) + part * 255.0, floor)
    assert not is_floor(np.array(WHITE), floor)


def test_noise_is_measured():
    rng = np.random.default_rng(2)
    for sigma in (1.0, 3.0, 6.0):
        samples = np.clip(np.array(GREEN) + rng.normal(0, sigma, (160, 83, 3)), 0, 255).round().astype(np.uint8)
        assert learn_floor_color(samples, ALL).noise == pytest.approx(sigma, rel=0.2)


def test_nothing_is_learnt_in_the_dark_or_with_the_ring_hidden():
    assert learn_floor_color(np.zeros((160, 83, 3), dtype=np.uint8), ALL) is None
    assert learn_floor_color(np.full((160, 83, 3), 3, dtype=np.uint8), ALL) is None
    assert learn_floor_color(scene(np.random.default_rng(0)), np.zeros_like(ALL)) is None


def test_behind_a_mask_the_ring_begins_where_the_mask_ends():
    samples, shown = scene(np.random.default_rng(3)), ALL.copy()
    samples[:100, :15], samples[100:, :25] = (20, 20, 20), (20, 20, 20)
    shown[:100, :16] = shown[100:, :26] = 0
    floor = learn_floor_color(samples, shown)
    assert is_floor(GREEN, floor)
    assert not is_floor((20, 20, 20), floor)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["noise", "two", "channel", "gradient"]))
def test_whatever_it_sees_it_learns_finite_numbers_or_none(seed, kind):
    rng = np.random.default_rng(seed)
    samples = rng.integers(0, 256, (160, 83, 3), dtype=np.uint8)
    if kind == "two":
        samples = rng.choice(rng.integers(0, 256, (2, 3), dtype=np.uint8), (160, 83))
    elif kind == "channel":
        samples[..., rng.permutation(3)[: rng.integers(1, 3)]] = 0
    elif kind == "gradient":
        samples = np.linspace(0, 255, 83)[None, :, None].repeat(160, 0).repeat(3, 2).astype(np.uint8)
    valid = (rng.random((160, 83)) < rng.random()).astype(np.uint8)
    with np.errstate(all="raise"):
        floor = learn_floor_color(samples, valid)
    if floor is None:
        return
    numbers = np.concatenate([[floor.level, floor.noise], floor.red_ratio, floor.blue_ratio, floor.spread])
    assert np.isfinite(numbers).all()
    assert (numbers >= 0).all()
    assert floor.red_ratio.shape == floor.blue_ratio.shape == LEVELS.shape
    colors = rng.integers(0, 256, (3, 500)).astype(float)
    assert np.isfinite(floor.log_likelihood_ratio(*colors)).all()
