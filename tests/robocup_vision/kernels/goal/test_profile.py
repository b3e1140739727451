"""The compiled model of blurred, shaded posts against plain integration, and its fit against drawn ones."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.goal.profile import (
    CHANNELS,
    OWN,
    SHARED,
    DueGoal,
    ProfilePicture,
    ProfilePixels,
    ProfileSpread,
    ProfileUnknowns,
    gather_profiles,
    normal_cdf,
    pixel_model,
)
from robocup_vision.kernels.goal.profile_fit import ProfilePriors, fit_profiles
from robocup_vision.localization.goal.profile import expected_profile

PIECES = 6
SEGMENTS = 3 * PIECES + 2


@settings(deadline=None)
@given(st.floats(-8, 8))
def test_normal_cdf_agrees_with_the_error_function(z):
    fraction, density = normal_cdf(z)
    assert fraction == pytest.approx(0.5 * math.erfc(-z / math.sqrt(2)), abs=4e-7)
    assert density == pytest.approx(math.exp(-z * z / 2) / math.sqrt(2 * math.pi), abs=2e-6)


def some_unknowns(rng):
    shared = np.zeros(SHARED)
    shared[:CHANNELS] = rng.uniform(0.5, 1.4, CHANNELS)
    shared[CHANNELS:] = rng.uniform(-0.2, 0.2, SHARED - CHANNELS)
    for base in (2, 8, 14):
        shared[[base + 2, base + 4]] = rng.uniform(60, 140, 2)
    own = np.concatenate([rng.uniform(-0.3, 0.3, 2), rng.uniform(-20, 90, 4)])
    return shared, own


def integrated(inside_a, inside_b, tau, channel, member, shared, own):
    """One pixel by plain integration over the paint and its surroundings."""
    blur, base = shared[channel], 2 + 6 * member
    bright, along = shared[base + 2 + 2 * channel], shared[base + 3 + 2 * channel]
    a, b = inside_a + own[0], inside_b + own[1]
    half, x = (a + b) / 2, (a - b) / 2
    at = np.linspace(x - 9 * blur, x + 9 * blur, 40001)
    s = at / half
    light = bright * (1 + along * tau) * (1 + shared[base] * s + shared[base + 1] * s * s)
    light = np.where(s < -1, own[2 + 2 * channel], np.where(s > 1, own[3 + 2 * channel], light))
    weight = np.exp(-0.5 * ((at - x) / blur) ** 2)
    return float((light * weight).sum() / weight.sum())


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_the_model_is_the_blurred_paint(seed):
    rng = np.random.default_rng(seed)
    shared, own = some_unknowns(rng)
    width, channel, member = rng.uniform(2.0, 20.0), int(rng.integers(2)), int(rng.integers(3))
    inside = rng.uniform(-3, width + 3)
    place = np.array([inside, width - inside, 0.0, rng.uniform(-1, 1)])
    got = pixel_model(place, False, channel, member, ProfileUnknowns(shared, own[None]), 0, np.empty(9))
    assert got == pytest.approx(integrated(place[0], place[1], place[3], channel, member, shared, own), abs=0.05)


def shaded_alike(shared, place, own, edge, move):
    """Shared unknowns whose light of the first member in channel 1 stays in place when one edge moves outwards."""
    half = (place[0] + own[0] + place[1] + own[1]) / 2
    wider, middle = 1 + move / 2 / half, (-move if edge == 0 else move) / 2 / half
    moved, (across, curve) = shared.copy(), shared[2:4]
    level = 1 + across * middle + curve * middle**2
    moved[2], moved[3] = (across + 2 * curve * middle) * wider / level, curve * wider**2 / level
    moved[6] *= level
    return moved


@settings(deadline=None, max_examples=30)
@given(st.integers(0, 2**32 - 1), st.booleans())
def test_slopes_of_own_unknowns_and_brightness_are_differences(seed, is_foot):
    rng = np.random.default_rng(seed)
    shared, own = some_unknowns(rng)
    place = np.array([rng.uniform(-2, 6), rng.uniform(-2, 6), rng.uniform(-2, 2), rng.uniform(-1, 1)])
    if place[0] + place[1] < 2.0:
        place[1] = 4.0 - place[0]
    slopes = np.empty(9)

    def model(s, o):
        return pixel_model(place, is_foot, 1, 0, ProfileUnknowns(s, o[None]), 0, np.empty(9))

    pixel_model(place, is_foot, 1, 0, ProfileUnknowns(shared, own[None]), 0, slopes)
    for k, i in enumerate((0, 1, 4, 5)):
        step = np.zeros(OWN)
        step[i] = 1e-5
        before, after = shared, shared
        if i < 2 and not is_foot:  # moves of an edge leave the shading across where it is
            before, after = (shaded_alike(shared, place, own, i, move) for move in (-1e-5, 1e-5))
        slope = (model(after, own + step) - model(before, own - step)) / 2e-5
        assert slopes[k] == pytest.approx(slope, abs=1e-2)
    for k, i in ((1, 2), (2, 3), (3, 6), (4, 7)):
        step = np.zeros(SHARED)
        step[i] = 1e-5
        slope = (model(shared + step, own) - model(shared - step, own)) / 2e-5
        assert slopes[4 + k] == pytest.approx(slope, abs=1e-2)


def drawn(rng, noise, left=20.3, width=7.0, slope=0.02, shine=False):
    """Two shaded posts and no bar in both channels, foot at row 60.4 and 61.4."""
    v, u = np.mgrid[:80, :100].astype(float)
    image = np.empty((80, 100, 2), np.float32)
    blur = (1.1, 0.7)
    for c, (paint, ground) in enumerate(((110.0, 10.0), (80.0, 120.0))):
        light = np.full(u.shape, ground)
        for post, foot in ((0, 60.4), (1, 61.4)):
            a = left + 45 * post + slope * v
            sa, sb = (np.vectorize(lambda x: 0.5 * math.erfc(-x / math.sqrt(2)))(k / blur[c]) for k in
                      (u - a, a + width - u))  # fmt: skip
            down = np.vectorize(lambda x: 0.5 * math.erfc(-x / math.sqrt(2)))((foot - v) / blur[c])
            s = np.clip((u - a) / width * 2 - 1, -1, 1)
            fraction = (sa + sb - 1) * down
            light += fraction * (paint * (1 - 0.2 * s) - ground)
        image[..., c] = light + noise * rng.standard_normal(u.shape)
    lit = np.zeros((80, 100), np.uint8)
    if shine:
        image[30:40, 22:25] = (0, 255)
        lit[30:40, 22:25] = 1
    return image, lit


def fitted(image, lit, left=20.0, width=7.2, slope=0.02):
    edges = np.array([[left + 45 * p + width * e, slope] for p in (0, 1) for e in (0, 1)] + [[-50, 0], [-40, 0]])
    spans = np.array([[10.0, 56.0], [10.0, 56.0], [5.0, 5.0]])
    arcs = np.array([[60.0, 0, 0], [61.0, 0, 0]])
    values, places = np.empty((9000, 2)), np.empty((9000, 4))
    owner, lane, middle = np.empty(9000, np.int64), np.empty(9000, np.int64), np.empty(SEGMENTS)
    picture, due = ProfilePicture(image, np.eye(2), lit), DueGoal(edges, spans, arcs)
    room = ProfilePixels(values, places, owner, lane, middle)
    n = gather_profiles(picture, due, ProfileSpread(PIECES, 3.0, 5), room)
    expected, weight = expected_profile()
    shared, own, variance = expected.copy(), np.zeros((SEGMENTS, OWN)), np.empty((SEGMENTS, 2))
    pixels = ProfilePixels(values[:n], places[:n], owner[:n], lane[:n], middle)
    priors = ProfilePriors(expected, weight, 1.0)
    assert fit_profiles(pixels, PIECES, priors, 6, ProfileUnknowns(shared, own), variance)
    return shared, own, variance, middle


@pytest.mark.parametrize("shine", [False, True])
def test_edges_of_shaded_posts_come_back(shine):
    shared, own, variance, middle = fitted(*drawn(np.random.default_rng(2), 1.5, shine=shine))
    assert shared[:2] == pytest.approx([1.1, 0.7], abs=0.12)
    assert shared[2] == pytest.approx(-0.2, abs=0.05)
    for post in (0, 1):
        there = slice(post * PIECES, (post + 1) * PIECES)
        assert np.isfinite(middle[there]).all()
        # predicted 0.3 px too far left, and 0.2 px too wide
        assert np.median(own[there, 0]) == pytest.approx(-0.3, abs=0.05)
        assert np.median(own[there, 1]) == pytest.approx(0.1, abs=0.05)
        assert own[3 * PIECES + post, 0] == pytest.approx(0.4, abs=0.1)
    assert np.sqrt(variance[: 2 * PIECES]).max() < 0.2
    assert np.isinf(variance[2 * PIECES : 3 * PIECES]).all()  # no bar


def test_variance_grows_with_the_noise():
    quiet, loud = (fitted(*drawn(np.random.default_rng(3), noise))[2][: 2 * PIECES] for noise in (1.0, 4.0))
    assert 2.0 < np.sqrt(np.median(loud / quiet)) < 8.0
