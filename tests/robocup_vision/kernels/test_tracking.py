"""Branches of tracks: which are chosen together."""

from __future__ import annotations

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.kernels.tracking.choice import keep_near
from robocup_vision.tracking.branches import MAX_STEPS, MISS, Branches


def branches(trees, evidence, newest):
    count = len(trees)
    history = np.full((count, 5), MISS, dtype=np.int64)
    history[:, 0] = newest
    zeros = np.zeros(count)
    return Branches(
        np.array(trees, dtype=np.int64), np.zeros((count, 4)), np.tile(np.eye(4), (count, 1, 1)),
        np.array(evidence, dtype=float), zeros, zeros, np.zeros(count, dtype=np.int64), history,
    )  # fmt: skip


def plain_best(those):
    """Sum of evidence of the best choice, by trying them all."""
    options = [[None, *np.flatnonzero(those.tree == tree)] for tree in np.unique(those.tree)]
    best = 0.0
    for picked in itertools.product(*options):
        taken = [i for i in picked if i is not None]
        seen = [n for i in taken for n in those.history[i] if n != MISS]
        if len(seen) == len(set(seen)):
            best = max(best, float(those.evidence[taken].sum()))
    return best


@settings(max_examples=100)
@given(st.integers(0, 2**32 - 1))
def test_no_choice_is_better(seed):
    rng = np.random.default_rng(seed)
    trees = np.sort(rng.integers(0, 4, 9))
    those = branches(trees, rng.normal(2, 3, 9), rng.integers(-1, 4, 9))
    those.history[:, 1] = np.where(rng.random(9) < 0.5, MISS, rng.integers(4, 9, 9))
    chosen = those.choose_together(MAX_STEPS)
    seen = those.history[chosen]
    seen = seen[seen != MISS].tolist()
    assert len(seen) == len(set(seen))
    assert len(set(those.tree[chosen])) == len(chosen)
    assert abs(those.evidence[chosen].sum() - plain_best(those)) < 1e-9


def test_too_few_steps_leave_the_greedy_choice():
    # the second tree's better branch is taken from it by the first tree's; with more steps the first one gives way
    those = branches([0, 0, 1], [3.0, 2.9, 2.0], [1, 2, 1])
    assert those.choose_together(1).tolist() == [0]
    assert those.choose_together(MAX_STEPS).tolist() == [1, 2]


def test_of_nothing_nothing_is_chosen():
    assert branches([], [], []).choose_together(MAX_STEPS).tolist() == []


def test_trees_apart_do_not_multiply():
    # thirty trees of two branches each would be 3^30 choices
    trees = np.repeat(np.arange(30), 2)
    chosen = branches(trees, np.tile([1.0, 2.0], 30), np.arange(60)).choose_together(MAX_STEPS)
    assert chosen.tolist() == list(range(1, 60, 2))


def test_each_tree_keeps_its_likely_branches_that_agree_with_the_chosen_one():
    those = branches([0] * 5 + [1], [5.0, 4.0, 4.0, -9.0, 3.0, 1.0], [1, 2, 2, 3, 4, 5])
    those.history[4, -1] = 7  # another past
    kept = those.pruned(np.array([0]))
    assert kept.history[:, 0].tolist() == [1, 2]
    assert keep_near(those.tree, those.evidence, those.history, np.arange(6) == 0, 7.0, 1).tolist() == [0]
