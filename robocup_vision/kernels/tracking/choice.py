"""Compiled choice among the branches of all track trees, and pruning of the trees by that choice."""

from __future__ import annotations

import math

import numpy as np

from robocup_vision.arrays import BoolArray, FloatArray, Int64Array
from robocup_vision.compiling.loops import compiled, flag
from robocup_vision.kernels.tracking.branches import MISS


@compiled
def choose_together(tree: Int64Array, evidence: FloatArray, history: Int64Array, max_steps: int) -> BoolArray:
    """Choose branches with the greatest sum: at most one of each tree, no two with a common detection.

    Groups of trees without common detections are independent. Within a group a depth-first search with bounds tests all
    choices, the greedy one first.

    tree : (L,) tree of each branch; the branches of a tree are adjacent.
    evidence : (L,) log-likelihood ratio of each branch.
    history : (L, H) detection numbers of each branch, `MISS` without a detection.
    max_steps : greatest number of steps of a search, after which the best choice so far is taken.

    Returns whether each branch is chosen, (L,) bool.
    """
    chosen = np.zeros(tree.shape[0], dtype=np.bool_)
    options, start = _by_evidence(tree, evidence)
    trees = start.shape[0] - 1
    first, numbers = _numbers(history)
    group = _joined(start, options, history, first, numbers)
    is_used = np.zeros(numbers, dtype=np.bool_)
    members = np.empty(trees, dtype=np.int64)
    for root in range(trees):
        count = 0
        for t in range(trees):
            if group[t] == root:
                # sorted by the evidence of each tree's best branch
                at = count
                while at > 0 and evidence[options[start[members[at - 1]]]] < evidence[options[start[t]]]:
                    members[at] = members[at - 1]
                    at -= 1
                members[at] = t
                count += 1
        if count:
            _search(members[:count], start, options, evidence, history, first, is_used, max_steps, chosen)
    return chosen


@compiled
def keep_near(
    tree: Int64Array,
    evidence: FloatArray,
    history: Int64Array,
    chosen: BoolArray,
    max_log_ratio: float,
    max_branches: int,
) -> Int64Array:
    """Return the indices of the branches to keep, tree by tree for trees with a chosen branch, the most likely first.

    A branch is kept if it is likely, agrees with the chosen one on the oldest detection, and differs from those kept
    before, up to `max_branches` of each tree.
    """
    options, start = _by_evidence(tree, evidence)
    kept = np.empty(tree.shape[0], dtype=np.int64)
    count, oldest = 0, history.shape[1] - 1
    for t in range(start.shape[0] - 1):
        best = -1
        for n in range(start[t], start[t + 1]):
            if chosen[options[n]]:
                best = options[n]
        if best < 0:
            continue
        first, others = count, 1
        for n in range(start[t], start[t + 1]):
            index = options[n]
            if index != best:
                if evidence[index] < evidence[best] - max_log_ratio or others >= max_branches:
                    continue
                if history[index, oldest] != history[best, oldest] or _is_equal(history, index, best):
                    continue
                is_new = True
                for k in range(first, count):
                    is_new &= not _is_equal(history, index, kept[k])
                if not is_new:
                    continue
                others += 1
            kept[count] = index
            count += 1
    return kept[:count]


@compiled
def _by_evidence(tree: Int64Array, evidence: FloatArray) -> tuple[Int64Array, Int64Array]:
    """Return the branches (L,) tree by tree, the most likely first, and each tree's start and the end of the last."""
    count = tree.shape[0]
    options, start = np.empty(count, dtype=np.int64), np.empty(count + 1, dtype=np.int64)
    trees = 0
    for k in range(count):
        if k == 0 or tree[k] != tree[k - 1]:
            start[trees] = k
            trees += 1
        at = k
        while at > start[trees - 1] and evidence[options[at - 1]] < evidence[k]:
            options[at] = options[at - 1]
            at -= 1
        options[at] = k
    start[trees] = count
    return options, start[: trees + 1]


@compiled
def _numbers(history: Int64Array) -> tuple[int, int]:
    """Return the smallest number of a detection, and the size of the range of numbers."""
    first, last = np.iinfo(np.int64).max, -1
    for k in range(history.shape[0]):
        for frame in range(history.shape[1]):
            if history[k, frame] != MISS:
                first = min(first, history[k, frame])
                last = max(last, history[k, frame])
    return first, max(last - first + 1, 0)


@compiled
def _joined(start: Int64Array, options: Int64Array, history: Int64Array, first: int, numbers: int) -> Int64Array:
    """Return for each tree the first tree of its group, which shares detections directly or through others."""
    trees = start.shape[0] - 1
    group = np.arange(trees)
    owner = np.full(numbers, -1)
    for t in range(trees):
        for n in range(start[t], start[t + 1]):
            for frame in range(history.shape[1]):
                number = history[options[n], frame]
                if number == MISS:
                    continue
                if owner[number - first] < 0:
                    owner[number - first] = t
                a, b = group[owner[number - first]], group[t]
                if a != b:
                    for other in range(trees):
                        if group[other] == max(a, b):
                            group[other] = min(a, b)
    return group


@compiled
def _search(
    members: Int64Array,
    start: Int64Array,
    options: Int64Array,
    evidence: FloatArray,
    history: Int64Array,
    first: int,
    is_used: BoolArray,
    max_steps: int,
    chosen: BoolArray,
) -> None:
    """Mark the best choice among trees with common detections; the tree of the best branch comes first."""
    count = members.shape[0]
    # upper bound of what the trees from each depth on can add
    bound, gained = np.zeros(count + 1), np.zeros(count + 1)
    for depth in range(count - 1, -1, -1):
        bound[depth] = bound[depth + 1] + max(evidence[options[start[members[depth]]]], 0.0)
    # next option to test of each tree, and the branch taken now; -1 is none
    following, taken, best = np.zeros(count, dtype=np.int64), np.full(count, -1), np.full(count, -1)
    most, left, depth, is_new = -math.inf, max_steps, 0, True
    while depth >= 0:
        if is_new:
            is_new = False
            left -= 1
            if gained[depth] + bound[depth] <= most or (left < 0 and most > -math.inf):
                depth -= 1
                continue
            if depth == count:
                most = gained[depth]
                for k in range(count):
                    best[k] = taken[k]
                depth -= 1
                continue
            following[depth] = start[members[depth]]
        if taken[depth] >= 0:
            _mark(history, taken[depth], first, is_used, flag(False))
            taken[depth] = -1
        end = start[members[depth] + 1]
        while following[depth] < end and _is_taken(history, options[following[depth]], first, is_used):
            following[depth] += 1
        if following[depth] > end:
            depth -= 1
            continue
        gained[depth + 1] = gained[depth]
        if following[depth] < end:
            taken[depth] = options[following[depth]]
            gained[depth + 1] += evidence[taken[depth]]
            _mark(history, taken[depth], first, is_used, flag(True))
        following[depth] += 1
        depth, is_new = depth + 1, True
    for k in range(count):
        if best[k] >= 0:
            chosen[best[k]] = True


@compiled
def _mark(history: Int64Array, index: int, first: int, is_used: BoolArray, used: bool) -> None:
    """Mark a branch's detections as used or unused."""
    for frame in range(history.shape[1]):
        if history[index, frame] != MISS:
            is_used[history[index, frame] - first] = used


@compiled
def _is_taken(history: Int64Array, index: int, first: int, is_used: BoolArray) -> bool:
    """Whether one of a branch's detections is used."""
    for frame in range(history.shape[1]):
        if history[index, frame] != MISS and is_used[history[index, frame] - first]:
            return True
    return False


@compiled
def _is_equal(history: Int64Array, one: int, other: int) -> bool:
    """Whether two branches have the same latest detections."""
    for frame in range(history.shape[1]):
        if history[one, frame] != history[other, frame]:
            return False
    return True
