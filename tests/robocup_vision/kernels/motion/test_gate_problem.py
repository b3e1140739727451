"""The gate problem's search: exact below its limit (test_gaps.py holds it against every plan there is)."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.motion import gate_problem as kernel
from robocup_vision.planning import Gap, GatePlanner, MotionLimits, WidthSensor

PLANNER = GatePlanner(MotionLimits(1.0, 1.2), WidthSensor(0.01, 0.4), 0.22)


def solve(width, sigma, limit, looks=2):
    t = PLANNER.tables((0.0, 0.0), Gap((2.0, 0.3), 0.2, width, sigma), (3.0, 0.0), ((2.0, -2.0),))
    belief, counted = np.empty((looks + 1, len(t.prior))), np.ones(1, dtype=np.int64)
    belief[0] = t.prior
    problem = kernel.GateProblem(t.first_wide, t.likelihood, t.move_s, 0.2, t.pass_s, t.fail_s, t.detour_s, 0.95)
    return *kernel.search(belief, 0, 0, limit, problem, counted), int(counted[0])


@settings(deadline=None, max_examples=40)
@given(st.floats(0.1, 0.4), st.floats(0.01, 0.15), st.floats(-1.0, 1.0))
def test_below_its_limit_the_search_is_exact_and_above_it_is_not_below(width, sigma, off):
    cost, action, beliefs = solve(width, sigma, math.inf)
    limited, limited_action, fewer = solve(width, sigma, cost + off)
    assert fewer <= beliefs
    if off > 1e-9:
        assert (limited, limited_action) == (cost, action)
    else:
        assert limited >= cost - 1e-12


def test_stopping_takes_the_gap_only_if_it_is_confirmed():
    assert kernel.stop_cost(0.96, 0.04, 2.0, 9.0, 5.0, 0.95) == pytest.approx(0.96 * 2 + 0.04 * 9)
    assert kernel.stop_cost(0.94, 0.06, 2.0, 9.0, 5.0, 0.95) == 5.0
    assert kernel.stop_cost(0.96, 0.04, 6.0, 9.0, 5.0, 0.95) == 5.0
