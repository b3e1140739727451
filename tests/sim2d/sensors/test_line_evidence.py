"""Fitting the verdict by lines alone to counts, and the pictures that they are taken from."""

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.localization.evidence import LineCounts
from sim2d.match.setups import camera_for
from sim2d.rendering.litter import littered, worn
from sim2d.sensors.line_evidence import LineSamples, draw_line_samples, enlarged, fit_line_samples

CAMERA = camera_for(load_field("msl_18x12"))


def drawn(rng, p_points, shown, count, alike=1):
    out = []
    for _ in range(count):
        chance = rng.uniform(0.2, 0.6)
        found = alike * rng.binomial(200 // alike, 1.0 - (1.0 - shown) * (1.0 - chance))
        out.append(LineCounts(1.0 * rng.multinomial(100, p_points), found, 200 - found, chance))
    return out


def samples(rng, alike=1):
    out = LineSamples()
    out.right[0].extend(drawn(rng, [0.8, 0.15, 0.05], 0.97, 300, alike))
    out.right[1].extend(drawn(rng, [0.4, 0.2, 0.4], 0.8, 300, alike))
    out.wrong_place.extend(drawn(rng, [0.2, 0.3, 0.5], 0.3, 300))
    out.clutter.extend(drawn(rng, [0.1, 0.2, 0.7], 0.15, 2) for _ in range(300))
    return out


def test_probabilities_are_those_that_samples_were_drawn_with():
    fitted = fit_line_samples(samples(np.random.default_rng(2)))
    np.testing.assert_allclose(fitted.points.right, [[0.8, 0.15, 0.05], [0.4, 0.2, 0.4]], atol=0.01)
    np.testing.assert_allclose(fitted.found.right, [0.97, 0.8], atol=0.01)
    assert fitted.found.wrong[1] == pytest.approx(0.3, abs=0.01)
    # the better one of two that are drawn alike
    assert 0.15 < fitted.found.wrong[0] < 0.25
    assert 1.0 <= fitted.found.correlation < 1.5


def test_samples_that_come_in_fives_err_alike_in_fives():
    fitted = fit_line_samples(samples(np.random.default_rng(3), 5))
    assert fitted.found.correlation == pytest.approx(5.0, rel=0.25)


def test_without_samples_nothing_is_fitted():
    with pytest.raises(ArgumentError, match="too few pictures"):
        fit_line_samples(LineSamples())


@pytest.mark.parametrize("name", ["ssl_2001"])
def test_fields_with_walls_are_refused(name):
    with pytest.raises(ArgumentError, match="on a carpet that goes on"):
        next(draw_line_samples(load_field(name), CAMERA, 0, 1))


def test_an_enlarged_camera_shows_the_same_floor_in_larger_pixels():
    large = enlarged(CAMERA, 2)
    floor_m = np.array([[1.0, 0.5], [-2.0, 3.0], [0.4, -0.4]])
    pixels = CAMERA.floor_to_pixel(floor_m)
    np.testing.assert_allclose(large.floor_to_pixel(floor_m), 2 * pixels + 0.5)


def test_wear_takes_narrow_lines_away_and_litter_covers_some_of_the_carpet():
    rng = np.random.default_rng(1)
    frame = np.full((240, 320, 3), (50, 130, 45), dtype=np.uint8)
    frame[:, 100:103] = 230
    less = [np.count_nonzero(worn(frame, rng)[..., 0] == 230) for _ in range(20)]
    assert max(less) <= 3 * 240
    assert min(less) < 0.95 * 3 * 240
    assert np.array_equal(np.delete(worn(frame, rng), np.s_[98:105], axis=1), np.delete(frame, np.s_[98:105], axis=1))
    covered = [np.mean(np.any(littered(frame, CAMERA, rng) != frame, axis=-1)) for _ in range(20)]
    assert 0.0 < np.mean(covered) < 0.5
