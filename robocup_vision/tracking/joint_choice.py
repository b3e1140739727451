"""The most likely branches of all trees together: a detection belongs to one object only."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import Int64Array
from robocup_vision.tracking.branches import MISS, Branches


def choose_together(branches: Branches, max_steps: int) -> Int64Array:
    """Return the indices (B,) of the most likely branches, at most one of each tree, no two with the same detection.

    A tree has none if more likely ones take all its detections. Trees without a common detection are chosen apart. Of
    the others a depth-first search with bounds tries all choices, the greedy one first.

    Parameters
    ----------
    branches : Branches
        Tree by tree.
    max_steps : int
        Steps of the search, after which the best choice so far is taken.
    """
    starts = np.flatnonzero(np.diff(branches.tree, prepend=-1))
    ends = np.append(starts, len(branches))[1:]
    evidence = branches.evidence.tolist()
    bit: dict[int, int] = {}
    masks: list[int] = []
    for row in branches.history.tolist():
        mask = 0
        for number in row:
            if number != MISS:
                mask |= 1 << bit.setdefault(number, len(bit))
        masks.append(mask)
    groups: list[tuple[int, list[list[int]]]] = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        options = sorted(range(start, end), key=lambda i: -evidence[i])
        touched = 0
        for i in options:
            touched |= masks[i]
        # trees with a common detection are chosen together
        apart = []
        joined = [options]
        for mask, trees in groups:
            if mask & touched:
                touched |= mask
                joined += trees
            else:
                apart.append((mask, trees))
        groups = [*apart, (touched, joined)]
    chosen: list[int] = []
    for _, trees in groups:
        chosen += _best_compatible(sorted(trees, key=lambda t: -evidence[t[0]]), masks, evidence, max_steps)
    return np.array(sorted(chosen), dtype=np.int64)


def _best_compatible(trees: list[list[int]], masks: list[int], evidence: list[float], max_steps: int) -> list[int]:
    """Of each tree's branches, likeliest first, one or none: no two with a common bit, and the greatest sum."""
    bound = [0.0]
    for options in reversed(trees):
        bound.append(bound[-1] + max(evidence[options[0]], 0.0))
    bound.reverse()
    best, most, left = [], -math.inf, max_steps

    def choose(depth: int, used: int, gained: float, picked: list[int]) -> None:
        nonlocal best, most, left
        left -= 1
        if gained + bound[depth] <= most or (left < 0 and most > -math.inf):
            return
        if depth == len(trees):
            best, most = picked, gained
            return
        for index in trees[depth]:
            if not masks[index] & used:
                choose(depth + 1, used | masks[index], gained + evidence[index], [*picked, index])
        choose(depth + 1, used, gained, picked)

    choose(0, 0, 0.0, [])
    return best
