"""Compiled search of the gate problem's AND/OR tree (Miura 2004, section 5) by branch and bound: the next viewpoint.

Beliefs are joint masses over the gap's width, not normalised: the probability of a branch is the sum of its masses, so
that costs are sums without division.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

# actions at a node besides the indices of viewpoints
DETOUR = -1
PASS = -2


class GateProblem(NamedTuple):
    """Parameters of a gate problem.

    first_wide : first cell of the width at which the gap is wide enough.
    likelihood : (N, K, W) float64, probability of each of K measurements at each viewpoint, given the width.
    move : (N, N) float64, seconds between viewpoints, which satisfy the triangle inequality.
    look : duration of a look, seconds.
    passing, failing, detour : (N,) float64, seconds to the target: through a gap that is wide enough; by a gap that is
    too narrow, and back, never less than the detour; by the detour.
    confirmed : least probability at which a gap may be passed.
    """

    first_wide: int
    likelihood: FloatArray
    move: FloatArray
    look: float
    passing: FloatArray
    failing: FloatArray
    detour: FloatArray
    confirmed: float


@compiled(error_model="numpy")
def stop_cost(wide: float, narrow: float, passing: float, failing: float, detour: float, confirmed: float) -> float:
    """Return the least cost, weighted by mass, without a further look: the detour, or the gap if it is confirmed."""
    cost = (wide + narrow) * detour
    if wide >= confirmed * (wide + narrow):
        cost = min(cost, wide * passing + narrow * failing)
    return cost


@compiled(error_model="numpy")
def search(
    belief: FloatArray,
    depth: int,
    place: int,
    limit: float,
    problem: GateProblem,
    counted: npt.NDArray[np.int64],
) -> tuple[float, int]:
    """Return the least expected cost, weighted by mass, and the first action; exact if below `limit`.

    belief : (H + 1, W) joint masses of the width's cells, ascending; row `depth` is read, later rows are written.
    depth, place : looks taken so far, of H; present viewpoint.
    limit : cost of an alternative; results not below it need not be exact.
    counted : (1,) incremented by the number of beliefs evaluated: one for each class of measurement at each viewpoint
    tested.

    If the next look revealed the width, the cost would be move + look + the better of gap and detour for a wide gap, or
    the detour for a narrow one. This is a lower bound for each viewpoint. Viewpoints are tested in its order, and a
    test ends as soon as the costs of the classes so far and the bounds of the others exceed the best cost.
    """
    first_wide, likelihood, move, look, passing, failing, detour, confirmed = problem
    width_count = belief.shape[1]
    wide = 0.0
    narrow = 0.0
    for w in range(width_count):
        if w >= first_wide:
            wide += belief[depth, w]
        else:
            narrow += belief[depth, w]
    best = stop_cost(wide, narrow, passing[place], failing[place], detour[place], confirmed)
    action = DETOUR if best == (wide + narrow) * detour[place] else PASS
    if depth + 1 >= belief.shape[0]:
        return best, action
    reach = min(best, limit)
    viewpoints, measurements = likelihood.shape[0], likelihood.shape[1]
    bound = np.empty(viewpoints)
    for x in range(viewpoints):
        if_revealed = wide * min(passing[x], detour[x]) + narrow * detour[x]
        bound[x] = (wide + narrow) * (move[place, x] + look) + if_revealed
    least = np.empty(measurements)
    for _ in range(viewpoints):
        x = int(np.argmin(bound))
        if bound[x] >= reach:
            break
        bound[x] = np.inf
        cost = (wide + narrow) * (move[place, x] + look)
        for k in range(measurements):
            wide_k = 0.0
            narrow_k = 0.0
            for w in range(first_wide):
                narrow_k += belief[depth, w] * likelihood[x, k, w]
            for w in range(first_wide, width_count):
                wide_k += belief[depth, w] * likelihood[x, k, w]
            stop = stop_cost(wide_k, narrow_k, passing[x], failing[x], detour[x], confirmed)
            if depth + 2 >= belief.shape[0]:
                least[k] = stop
            else:
                if_revealed = wide_k * min(passing[x], detour[x]) + narrow_k * detour[x]
                least[k] = min(stop, (wide_k + narrow_k) * look + if_revealed)
            cost += least[k]
        counted[0] += measurements
        if depth + 2 < belief.shape[0]:
            for k in range(measurements):
                if cost >= reach:
                    break
                for w in range(width_count):
                    belief[depth + 1, w] = belief[depth, w] * likelihood[x, k, w]
                exact, _ = search(belief, depth + 1, x, reach - cost + least[k], problem, counted)
                cost += exact - least[k]
        if cost < reach:
            best, action, reach = cost, x, cost
    return best, action
