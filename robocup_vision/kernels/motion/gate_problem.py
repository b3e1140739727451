"""Compiled search of the gate problem's AND/OR tree (Miura 2004, section 5) by branch and bound: the next viewpoint.

Beliefs are joint masses over the gap's width, not normalised: a branch's probability is the sum of its masses, so costs
are sums and no division is needed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from robocup_vision.arrays import FloatArray
from robocup_vision.compiling.loops import compiled

# actions at a node, besides the viewpoints' numbers
DETOUR = -1
PASS = -2


class GateProblem(NamedTuple):
    """A gate problem in numbers.

    first_wide : from this cell of the width on, the gap is wide enough.
    likelihood : (N, K, W) float64, probability of each of K measurements at each viewpoint, by the width.
    move : (N, N) float64, seconds between viewpoints, never more than by way of a third.
    look : seconds of a look.
    passing, failing, detour : (N,) float64, seconds to the target: through a gap that is wide enough; by a gap that
    turns out too narrow, and back round it, never less than the detour; by the detour.
    confirmed : probability from which a gap may be passed.
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
    """Least cost, weighted by mass, without a further look: the detour, or the gap if it is confirmed."""
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
    """Return the least expected cost from here, weighted by mass, and what to do first; exact if below `limit`.

    Parameters
    ----------
    belief : (H + 1, W) float64, row `depth` read, later rows written
        Joint masses of the width's cells, ascending.
    depth, place : int
        Looks taken so far, of H; the viewpoint the robot is at.
    limit : float
        A cost that can be had otherwise: results not below it need not be exact.
    problem : GateProblem
        The problem.
    counted : (1,) int64, written
        Grows by the number of beliefs evaluated: one for each class of measurement at each viewpoint tried.

    With the width known after the next look, the cost would be m = move + look + the better of gap and detour if it is
    wide, the detour if not. No branch costs less. So viewpoints are tried in the order of that bound, and one is given
    up as soon as the costs of its classes so far and the bounds of the others exceed the best.
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
    viewpoints, readings = likelihood.shape[0], likelihood.shape[1]
    bound = np.empty(viewpoints)
    for x in range(viewpoints):
        known = wide * min(passing[x], detour[x]) + narrow * detour[x]
        bound[x] = (wide + narrow) * (move[place, x] + look) + known
    least = np.empty(readings)
    for _ in range(viewpoints):
        x = int(np.argmin(bound))
        if bound[x] >= reach:
            break
        bound[x] = np.inf
        cost = (wide + narrow) * (move[place, x] + look)
        for k in range(readings):
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
                known = wide_k * min(passing[x], detour[x]) + narrow_k * detour[x]
                least[k] = min(stop, (wide_k + narrow_k) * look + known)
            cost += least[k]
        counted[0] += readings
        if depth + 2 < belief.shape[0]:
            for k in range(readings):
                if cost >= reach:
                    break
                for w in range(width_count):
                    belief[depth + 1, w] = belief[depth, w] * likelihood[x, k, w]
                exact, _ = search(belief, depth + 1, x, reach - cost + least[k], problem, counted)
                cost += exact - least[k]
        if cost < reach:
            best, action, reach = cost, x, cost
    return best, action
