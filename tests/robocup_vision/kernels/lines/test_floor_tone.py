"""The compiled learning of the floor's tone against plain NumPy."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.lines.floor_tone import ToneRules, learn_tone

RULES = ToneRules(50, 0.25, 4.0, 0.04, 0.35, 1.9, 2.0)
seeds = st.integers(0, 2**32 - 1)


def tone_twin(frame, near, rules):
    pixels = frame.reshape(-1, 3)[near]
    vivid = (pixels[:, 1] >= 3 * np.exp(2.0)) & (2 * pixels[:, ::2].max(axis=1).astype(int) < pixels[:, 1])
    good = (pixels.max(axis=1) < 250) & ((pixels.min(axis=1) >= 3) | vivid)
    blue, greens, red = pixels[good].astype(np.float64).T
    if len(greens) < rules.min_samples:
        return None
    log_ratio = np.maximum(np.log(np.maximum(np.stack([red, blue]), 1) / greens), -2.0)
    edges = np.linspace(-2.0, 2.0, 51)
    histogram = np.histogram2d(log_ratio[0], log_ratio[1], [edges, edges])[0]
    around = cv2.boxFilter(histogram, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    tones = edges[np.argwhere(around >= rules.common_tone_ratio * around.max())] + 0.04
    mode, spread = tones[np.argmin(tones.max(axis=1))], np.full(2, 0.08)
    for _ in range(3):
        members = (np.abs(log_ratio - mode[:, None]) < rules.tone_stds * spread[:, None]).all(axis=0)
        if np.count_nonzero(members) < rules.min_samples:
            return None
        chosen = log_ratio[:, members]
        mode = np.median(chosen, axis=1)
        green = float(np.median(greens[members]))
        spread = np.maximum(1.48 * np.median(np.abs(chosen - mode[:, None]), axis=1), rules.min_tone_spread)
        off = np.stack([red, blue])[:, members] - np.exp(mode)[:, None] * greens[members]
        off = np.abs(off - np.median(off, axis=1)[:, None])
        by_counts = np.maximum(spread, 1.48 * np.median(off, axis=1) / (np.exp(mode) * green))
        spread = np.where(mode - rules.tone_stds * spread > -2.0, spread, by_counts)
    reach = rules.tone_stds * spread
    most = np.minimum(mode + reach, np.maximum(0.5 * mode, mode + 2.0 * spread))
    low, high = np.where(mode - reach > -2.0, np.exp(mode - reach), 0.0), np.exp(most)
    return [low[0], high[0], low[1], high[1], rules.dark_ratio * green, rules.bright_ratio * green, rules.slack]


def drawn(rng):
    """Return a picture of carpet, of a greyer floor and of noise, and the places that are looked at."""
    shares = rng.dirichlet((2.0, 1.0, 0.3))
    dark = rng.uniform(0, 0.5, 2)
    carpet, hall = rng.uniform(20, 200, 3) * (dark[0], 1.0, dark[1]), np.full(3, rng.uniform(40, 200))
    kind = rng.choice(3, (40, 50), p=shares)
    light = rng.uniform(0.6, 1.2, (40, 50, 1))
    colors = np.where(kind[..., None] == 0, carpet, hall) * light + rng.normal(0, 3, (40, 50, 3))
    colors[kind == 2] = rng.uniform(0, 255, (np.count_nonzero(kind == 2), 3))
    return np.clip(colors, 0, 255).astype(np.uint8), np.flatnonzero(rng.random(2000) < 0.7)


@settings(deadline=None, max_examples=60)
@given(seeds)
def test_a_tone_is_learnt_as_numpy_does(seed):
    frame, near = drawn(np.random.default_rng(seed))
    tone = np.empty(7, dtype=np.float32)
    is_learnt, expected = learn_tone(frame, near, RULES, tone), tone_twin(frame, near, RULES)
    assert is_learnt == (expected is not None)
    if expected is not None:
        np.testing.assert_allclose(tone, expected, rtol=1e-5)


def test_of_two_common_tones_the_greener_is_the_carpet():
    frame = np.full((40, 50, 3), 120, dtype=np.uint8)
    frame[:, :20] = (50, 110, 55)
    tone = np.empty(7, dtype=np.float32)
    assert learn_tone(frame, np.arange(2000), RULES, tone)
    assert tone[0] < 0.5 < tone[1] < 1.0
    assert tone[4] == pytest.approx(0.35 * 110)


def test_a_vivid_green_is_a_tone_though_red_and_blue_are_black():
    frame = np.full((40, 50, 3), 40, dtype=np.uint8)
    frame[:, :20] = (2, 110, 0)
    frame[:, 18:20] = (9, 110, 12)
    tone = np.empty(7, dtype=np.float32)
    assert learn_tone(frame, np.arange(2000), RULES, tone)
    assert tone[0] == tone[2] == 0.0
    assert max(tone[1], tone[3]) < 0.3
    assert tone[4] == pytest.approx(0.35 * 110)


@pytest.mark.parametrize("color", [(255, 255, 255), (0, 0, 0), (2, 20, 0), (1, 60, 45)])
def test_pictures_burnt_out_or_with_a_black_channel_tell_no_tone_but_of_a_vivid_green(color):
    frame = np.full((40, 50, 3), color, dtype=np.uint8)
    assert not learn_tone(frame, np.arange(2000), RULES, np.empty(7, dtype=np.float32))


def test_too_few_pixels_tell_no_tone():
    frame = np.full((40, 50, 3), (50, 110, 55), dtype=np.uint8)
    assert not learn_tone(frame, np.arange(49), RULES, np.empty(7, dtype=np.float32))
