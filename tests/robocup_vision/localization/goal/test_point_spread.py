"""Point spreads against plain integration, and the places of drawn edges under them."""

import math

import numpy as np
import pytest

from robocup_vision.localization.goal.point_spread import (
    HALVED,
    PER_PX,
    SPREADS,
    TYPICAL,
    PointSpread,
    nearest_best,
    step_response,
)


@pytest.mark.parametrize("spread", [*SPREADS, *(PointSpread(0.125, 0.2, kind) for kind in HALVED)])
def test_a_step_rises_from_dark_to_light_by_its_own_density(spread):
    for light, density in np.moveaxis(step_response(spread), 2, 1):
        assert light[0] == pytest.approx(0.0, abs=1e-3)
        assert light[-1] == pytest.approx(1.0, abs=1e-3)
        assert np.all(np.diff(light) > -1e-12)
        slope = (light[2:] - light[:-2]) * PER_PX / 2
        np.testing.assert_allclose(density[1:-1], slope, atol=0.03)


@pytest.mark.parametrize("spread", SPREADS)
def test_light_is_that_of_a_square_pixel_mixed_and_blurred(spread):
    fine = 200
    at = np.arange(-6 * fine, 6 * fine) / fine
    step = np.array([0.5 * math.erfc(-t / (spread.lens_px * math.sqrt(2))) for t in at])
    pixel = np.convolve(step, np.ones(fine) / fine, "same")
    mixed = (1 - 2 * spread.mixed) * pixel + spread.mixed * (np.roll(pixel, fine) + np.roll(pixel, -fine))
    for offset in (-1.3, -0.4, 0.0, 0.2, 0.9):
        got = step_response(spread)[0, round((4 + offset) * PER_PX), 0]
        assert got == pytest.approx(np.interp(round(offset * PER_PX) / PER_PX, at, mixed), abs=5e-3)


@pytest.mark.parametrize("kind", HALVED)
def test_colour_at_half_the_resolution_is_that_of_two_pixels_each(kind):
    # a row of pixels with a step at 10.3, averaged in pairs and spread again
    whole, halved = (step_response(PointSpread(0.0, 0.2, k)) for k in ("", kind))
    where, pixels = 10.3, np.arange(24)

    def light(response, pixel):
        entry = np.clip((pixel - where) * PER_PX + 4 * PER_PX, 0, response.shape[1] - 1)
        return np.interp(entry, np.arange(response.shape[1]), response[pixel % 2, :, 0])

    values = np.array([light(whole, pixel) for pixel in pixels]).reshape(-1, 2).mean(axis=1)
    beside = np.where(pixels % 2 == 0, pixels // 2 - 1, pixels // 2 + 1).clip(0, len(values) - 1)
    near = 0.75 if kind == "linear" else 1.0
    expected = near * values[pixels // 2] + (1 - near) * values[beside]
    got = np.array([light(halved, pixel) for pixel in pixels])
    np.testing.assert_allclose(got[4:-4], expected[4:-4], atol=5e-3)


@pytest.mark.parametrize("truth", SPREADS)
def test_the_search_finds_a_spread_that_shows_a_step_alike(truth):
    shown = step_response(truth)[0, :, 0]

    def cost(spread):
        return float(np.sum((step_response(spread)[0, :, 0] - shown) ** 2))

    found = step_response(nearest_best(cost, TYPICAL))[0, :, 0]
    np.testing.assert_allclose(found, shown, atol=0.03)


def test_the_search_stays_where_all_cost_alike():
    assert nearest_best(lambda spread: 1.0, TYPICAL) == TYPICAL
