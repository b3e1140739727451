"""Tells samples of thin lines that found another line: beside a crossing each finds the brighter of the two."""

from __future__ import annotations

from robocup_vision.compiling.loops import compiled
from robocup_vision.kernels.model_edges.tables import ON_FLOOR, RIDGE, UNKNOWNS, FloatArray, Room

# a line thinner than this is easily overlooked beside a brighter one, pixels
THIN_PX = 1.0
# nearer than this to its own line nothing is asked; and of that distance, at most, to another: four standard deviations
# of a sample, and so near that chance takes one line for two seldom
ASKED_PX, NEARER = 0.6, 0.5


@compiled(fastmath=True, error_model="numpy")
def _shifted(room: Room, n: int, z: FloatArray) -> float:
    """Return how far a fit moves a sample along its normal, pixels."""
    way = 0.0
    for j in range(UNKNOWNS):
        way += room.rows[n, j] * z[j]
    return way


@compiled(fastmath=True, error_model="numpy")
def _is_on_another(
    room: Room, count: int, n: int, z: FloatArray, u: float, v: float, within_px: float, spacing_px: float
) -> bool:
    """Whether a pixel lies within a distance of a line, by the fit, that is another than that of sample n."""
    samples = room.samples
    for m in range(count):
        if samples.feature[m] == samples.feature[n] or samples.place[m] != ON_FLOOR:
            continue
        du, dv = u - samples.uv[m, 0], v - samples.uv[m, 1]
        nu, nv = samples.normal[m, 0], samples.normal[m, 1]
        # between a line's samples, half a spacing and a little
        if abs(dv * nu - du * nv) > 0.75 * spacing_px:
            continue
        if abs(du * nu + dv * nv - _shifted(room, m, z)) < within_px:
            return True
    return False


@compiled(fastmath=True, error_model="numpy")
def drop_others(room: Room, count: int, z: FloatArray, gate_px: float, spacing_px: float) -> int:
    """Drop the candidates of thin lines that lie aside of them, and much nearer to another line.

    Parameters
    ----------
    room : Room
        Samples, their derivatives and candidates, `count` of them; loses candidates.
    count : int
        Samples.
    z : (7,) float64
        The fit, about where the samples were predicted.
    gate_px : float
        What is farther from a line than this does not count anyway.
    spacing_px : float
        Between samples.

    Returns
    -------
    int
        How many were dropped.
    """
    samples, found = room.samples, room.found
    dropped = 0
    for n in range(count):
        if found.candidates[n] < 1 or samples.kind[n] != RIDGE or samples.width_px[n] >= THIN_PX:
            continue
        expected, kept = _shifted(room, n, z), 0
        for k in range(found.candidates[n]):
            offset = found.offset_px[n, k]
            away = abs(offset - expected)
            if ASKED_PX < away < gate_px:
                u = samples.uv[n, 0] + samples.normal[n, 0] * offset
                v = samples.uv[n, 1] + samples.normal[n, 1] * offset
                if _is_on_another(room, count, n, z, u, v, NEARER * away, spacing_px):
                    continue
            found.offset_px[n, kept], found.strength[n, kept] = offset, found.strength[n, k]
            kept += 1
        dropped += found.candidates[n] - kept
        found.candidates[n] = kept
    return dropped
