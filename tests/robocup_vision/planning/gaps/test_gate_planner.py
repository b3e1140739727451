"""The gate problem: branch and bound against every plan there is, and what a plan must never be."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from field_models.errors import ArgumentError
from robocup_vision.planning import Disc, Gap, GatePlanner, GatePlannerSettings, MotionLimits, WidthSensor, gap_between

LIMITS = MotionLimits(1.0, 1.2)
SENSOR = WidthSensor(0.01, 0.4)
VIEWS = np.array([[0.8, -0.2], [1.2, 0.3], [1.5, -0.6]])
GOAL, DETOUR = (3.0, 0.0), ((2.0, -1.4), (2.6, -1.0))


def planner(looks=2, **options):
    return GatePlanner(LIMITS, SENSOR, 0.22, GatePlannerSettings(looks=looks, **options))


def gap(width, sigma, across=0.2):
    return Gap((2.0, 0.3), across, width, sigma)


def every_plan_s(tables, looks, confirmed=0.95, look_s=0.2):
    """Plain recursion over the whole tree."""

    def least(joint, place, left):
        narrow, wide = joint[: tables.first_wide].sum(), joint[tables.first_wide :].sum()
        costs = [(narrow + wide) * tables.detour_s[place]]
        if wide >= confirmed * (narrow + wide):
            costs.append(wide * tables.pass_s[place] + narrow * tables.fail_s[place])
        if left:
            for x in range(len(tables.viewpoints_m)):
                seen = sum(least(joint * reading, x, left - 1) for reading in tables.likelihood[x])
                costs.append((narrow + wide) * (tables.move_s[place, x] + look_s) + seen)
        return min(costs)

    return least(tables.prior, 0, looks)


@settings(max_examples=10)
@given(st.floats(0.12, 0.4), st.floats(0.01, 0.15), st.floats(-1.2, 1.2))
def test_branch_and_bound_finds_the_best_of_all_plans(width, sigma, across):
    opening = gap(width, sigma, across)
    tables = planner().tables((0.0, 0.0), opening, GOAL, DETOUR, VIEWS)
    plan = planner().plan((0.0, 0.0), opening, GOAL, DETOUR, VIEWS)
    assert plan.expected_s == pytest.approx(every_plan_s(tables, 2), abs=1e-9)
    assert plan.beliefs < 1 + 5 * 6 + (5 * 6) ** 2


@given(st.floats(0.05, 0.5), st.floats(0.005, 0.2), st.floats(-1.2, 1.2), st.integers(1, 3))
def test_a_plan_is_no_worse_than_the_simple_ones_and_no_better_for_knowing_less_ahead(width, sigma, across, looks):
    opening = gap(width, sigma, across)
    plan = planner(looks).plan((0.0, 0.0), opening, GOAL, DETOUR)
    assert plan.expected_s <= min(plan.detour_s, plan.look_now_s, plan.go_and_look_s) + 1e-9
    assert plan.expected_s >= planner(looks + 1).plan((0.0, 0.0), opening, GOAL, DETOUR).expected_s - 1e-9
    if plan.action == "pass":
        assert plan.probability >= 0.95
    assert (plan.viewpoint_m is not None) == (plan.action == "look")


def test_the_tables_keep_what_the_bounds_rest_on():
    tables = planner().tables((0.0, 0.0), gap(0.25, 0.06), GOAL, DETOUR)
    np.testing.assert_allclose(tables.likelihood.sum(axis=1), 1.0)
    assert tables.prior.sum() == pytest.approx(1.0)
    assert tables.prior[tables.first_wide :].sum() == pytest.approx(gap(0.25, 0.06).wide_enough(0.22), abs=1e-4)
    by_third = (tables.move_s[:, :, None] + tables.move_s[None]).min(axis=1)
    assert (tables.move_s <= by_third + 1e-12).all()
    assert (tables.fail_s >= tables.detour_s).all()
    assert (tables.detour_s <= tables.move_s + tables.detour_s[None] + 1e-12).all()
    assert (tables.pass_s <= tables.move_s + tables.pass_s[None] + 1e-12).all()


def test_what_is_known_needs_no_look():
    wide, narrow = (planner().plan((0.0, 0.0), gap(width, 0.01), GOAL, DETOUR) for width in (0.4, 0.1))
    assert (wide.action, narrow.action) == ("pass", "detour")
    assert "gap 0.40 m, sigma 0.01 m" in wide.reason
    assert "no look is worth its time" in narrow.reason


def test_what_is_not_known_is_looked_at_where_the_detour_is_long():
    plan = planner().plan((0.0, 0.0), gap(0.25, 0.08), GOAL, ((2.0, -3.0),))
    assert plan.action == "look"
    assert plan.expected_s < plan.detour_s
    assert plan.reason.startswith("look from")


def test_failure_is_priced():
    costly = planner(confirmed=0.6, failure_s=30.0).plan((0.0, 0.0), gap(0.25, 0.08), GOAL, ((2.0, -3.0),))
    cheap = planner(confirmed=0.6, failure_s=0.0).plan((0.0, 0.0), gap(0.25, 0.08), GOAL, ((2.0, -3.0),))
    assert costly.expected_s > cheap.expected_s


def test_seen_from_nearer_and_straighter_a_width_is_known_better():
    opening = gap(0.25, 0.1, 0.0)
    near, far, askew = (SENSOR.sigma_m(opening, eye) for eye in ((1.5, 0.3), (0.0, 0.3), (1.0, 2.0)))
    assert near < far < askew
    assert SENSOR.sigma_m(opening, (1.5, 0.3), 2.0) == pytest.approx(near)
    assert WidthSensor(0.01, 0.4, drift_mps=0.1).sigma_m(opening, (1.5, 0.3), 2.0) == pytest.approx(
        math.hypot(near, 0.2)
    )


def test_a_reading_is_weighed_by_its_doubt():
    after = gap(0.2, 0.1).updated(0.3, 0.1)
    assert after.width_m == pytest.approx(0.25)
    assert after.sigma_m == pytest.approx(0.1 / math.sqrt(2))


def test_the_gap_between_two_opponents():
    doubt = np.diag([0.01, 0.0004])
    opening = gap_between(Disc(1.0, -0.3, 0.1, doubt), Disc(1.0, 0.4, 0.2, doubt))
    assert opening.width_m == pytest.approx(0.4)
    assert opening.sigma_m == pytest.approx(math.sqrt(0.0008))
    assert opening.center_m == pytest.approx((1.0, 0.0))
    assert abs(math.cos(opening.across_rad)) == pytest.approx(1.0)


def test_a_drive_by_way_of_a_stop_is_never_shorter():
    for a in np.linspace(0.0, 3.0, 13):
        for b in np.linspace(0.0, 3.0, 13):
            assert LIMITS.travel_s(a + b) <= LIMITS.travel_s(a) + LIMITS.travel_s(b) + 1e-12
    assert LIMITS.travel_s(1.0 / 1.2) == pytest.approx(0.03 + 2 / 1.2)
    assert LIMITS.stop_m(0.6) == pytest.approx(0.6 * 0.03 + 0.36 / 2.4)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: gap(math.nan, 0.1), "width_m must be finite"),
        (lambda: gap(0.2, 0.0), "sigma_m must be positive"),
        (lambda: gap_between(Disc(0, 0, 1, np.eye(2)), Disc(0, 0, 1, np.eye(2))), "a gap needs two places"),
        (lambda: GatePlanner(LIMITS, SENSOR, 0.0), "needed_m must be positive"),
        (lambda: planner().plan((0, math.nan), gap(0.2, 0.1), GOAL, DETOUR), "must be finite"),
        (lambda: planner().plan((0, 0), gap(0.2, 0.1), GOAL, ()), "detour_m must have at least one point"),
        (lambda: planner().plan((0, 0), gap(0.2, 0.1), GOAL, DETOUR, np.zeros(3)), r"viewpoints_m must be \(N, 2\)"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
