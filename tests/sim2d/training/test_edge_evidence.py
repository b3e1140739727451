"""Fitting the weights of a forward camera's verdict, and the command that writes them down."""

import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.cli import main
from robocup_vision.localization.model_edges.weights import WEIGHTS, load_edge_weights
from sim2d.training.edge_evidence import Choice, fit_choices

TRUE = np.array([-1.0, -2.0, -0.3, 0.6, -4.0, -1.5, -3.0, -2.0, 0.3, -0.8])
SCALE = 1.5


def drawn(rng, near, number):
    """Return a choice between so many poses, of which one is right as often as `TRUE` has it."""
    terms = rng.normal(0.0, 1.0, (number, len(TRUE)))
    terms[:, 0], terms[:, 1] = near, not near
    if not near:
        terms[:, 2] = 0.0
    weights = TRUE if near else TRUE * [1.0, 1.0, *([SCALE] * 8)]
    p = np.exp(np.append(terms @ weights, 0.0))
    right = rng.choice(number + 1, p=p / p.sum())
    return Choice(terms, np.arange(number) == right)


def test_weights_are_those_that_choices_were_drawn_with():
    rng = np.random.default_rng(4)
    choices = [drawn(rng, near=True, number=1) for _ in range(6000)]
    choices += [drawn(rng, near=False, number=3) for _ in range(3000)]
    right = np.mean([choice.is_right.any() for choice in choices[:6000]])
    # as dear as they are rare: the choices near priors count alike
    fitted = fit_choices(choices, (1.0 - right) / right)
    np.testing.assert_allclose(fitted.near_prior, np.delete(TRUE, 1), atol=0.35)
    np.testing.assert_allclose(fitted.anywhere, TRUE[1], atol=0.35)
    np.testing.assert_allclose(fitted.within_picture, SCALE, rtol=0.15)
    # dearer wrong poses lower the odds of all
    assert fit_choices(choices, 5.0).near_prior[0] < fitted.near_prior[0] - 0.5


def test_choices_of_one_kind_are_too_few():
    rng = np.random.default_rng(5)
    with pytest.raises(ArgumentError, match="too few pictures"):
        fit_choices([drawn(rng, near=True, number=1) for _ in range(50)], 1.0)


@pytest.mark.slow
def test_the_command_writes_a_file_that_is_read_back(tmp_path, capsys):
    """Only this finds a command whose file the library refuses, or whose pictures hold no pose."""
    out = tmp_path / "weights.toml"
    assert main(["fit-edge-evidence", "--count", "1", "--seed", "3", str(out)]) == 0
    assert "evidence of 20 pictures" in capsys.readouterr().out
    assert "fit-edge-evidence --count 1 --seed 3 --cost 5.0" in out.read_text(encoding="utf-8")
    weights = load_edge_weights(out)
    assert len(weights.near_prior) == 1 + len(WEIGHTS)
    assert np.isfinite(weights.near_prior).all()
