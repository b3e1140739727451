"""Fitting the verdict on poses to counts, and the command that writes it down."""

import numpy as np
import pytest

from field_models.errors import ArgumentError
from sim2d.sensors.pose_evidence import Sample, Samples, fit_samples


def drawn(rng, p_outline, p_lines, count):
    return [Sample(rng.multinomial(160, p_outline) * 1.0, rng.multinomial(60, p_lines) * 1.0) for _ in range(count)]


def samples(rng):
    out = Samples()
    for row in out.right:
        row += drawn(rng, [0.5, 0.2, 0.05, 0.2, 0.02, 0.03], [0.8, 0.1, 0.1], 200)
    out.wrong_place += drawn(rng, [0.1, 0.1, 0.2, 0.4, 0.15, 0.05], [0.1, 0.3, 0.6], 200)
    out.clutter += [drawn(rng, [0.05, 0.05, 0.1, 0.2, 0.1, 0.5], [0.05, 0.05, 0.9], 3) for _ in range(200)]
    return out


def test_probabilities_and_correlation_are_those_that_samples_were_drawn_with():
    fitted = fit_samples(samples(np.random.default_rng(2)), 0.7)
    np.testing.assert_allclose(fitted.outline.right[0], [0.5, 0.2, 0.05, 0.2, 0.02, 0.03], atol=0.01)
    np.testing.assert_allclose(fitted.lines.wrong[1], [0.1, 0.3, 0.6], atol=0.02)
    # samples that are independent err alone
    assert 1.0 <= fitted.outline.correlation < 1.5
    assert fitted.sure_log_odds == pytest.approx(0.7)


def test_samples_that_come_in_fives_err_alike_in_fives():
    rng = np.random.default_rng(3)
    out = samples(rng)
    for row in out.right:
        row[:] = [
            Sample(5.0 * rng.multinomial(32, [0.5, 0.2, 0.05, 0.2, 0.02, 0.03]), one.lines)
            for one in row
            for _ in range(3)
        ]
    assert fit_samples(out, 0.7).outline.correlation == pytest.approx(5.0, rel=0.25)


def test_without_samples_nothing_is_fitted():
    with pytest.raises(ArgumentError, match="too few pictures"):
        fit_samples(Samples(), 0.7)
