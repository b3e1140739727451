"""Candidates of thin lines that are another line's, against plain NumPy and beside a planted crossing."""

import numpy as np
import pytest

from robocup_vision.kernels.model_edges.crossings import ASKED_PX, NEARER, THIN_PX, drop_others
from robocup_vision.kernels.model_edges.tables import EDGE, ON_FLOOR, PEAKS, RIDGE, UNKNOWNS, UPRIGHT, empty_room

GATE_PX, SPACING_PX, COUNT = 2.5, 5.0, 80


def scattered(seed):
    """Return lines that cross each other in a small picture, with candidates on and beside them, and a fit."""
    rng, room = np.random.default_rng(seed), empty_room(COUNT, 1)
    samples, found = room.samples, room.found
    for line in range(8):
        of_line = slice(10 * line, 10 * line + 10)
        angle = rng.uniform(0.0, np.pi)
        along, middle = np.array([np.cos(angle), np.sin(angle)]), rng.uniform(0.0, 20.0, 2)
        samples.uv[of_line] = middle + SPACING_PX * np.arange(-5, 5)[:, None] * along
        samples.normal[of_line] = -along[1], along[0]
        samples.feature[of_line] = line
        samples.kind[of_line] = EDGE if line == 6 else RIDGE
        samples.place[of_line] = UPRIGHT if line == 7 else ON_FLOOR
        samples.width_px[of_line] = rng.uniform(0.2, 1.3)
    room.rows[:] = 0.3 * rng.normal(size=room.rows.shape)
    found.candidates[:] = rng.integers(-1, PEAKS + 1, COUNT)
    found.offset_px[:] = rng.normal(0.0, 1.2, (COUNT, PEAKS))
    found.strength[:] = rng.uniform(10.0, 90.0, (COUNT, PEAKS))
    return room, rng.normal(0.0, 0.5, UNKNOWNS)


def plainly_kept(room, z):
    """Return the candidates that are kept, sample by sample."""
    samples, found, moved = room.samples, room.found, room.rows @ z
    kept = []
    for n in range(COUNT):
        candidates = [(found.offset_px[n, k], found.strength[n, k]) for k in range(max(found.candidates[n], 0))]
        if samples.kind[n] == RIDGE and samples.width_px[n] < THIN_PX:
            others = (samples.feature != samples.feature[n]) & (samples.place == ON_FLOOR)
            for offset, strength in list(candidates):
                away = abs(offset - moved[n])
                d = samples.uv[n] + offset * samples.normal[n] - samples.uv
                across = np.abs((d * samples.normal).sum(axis=1) - moved)
                along = np.abs(d[:, 1] * samples.normal[:, 0] - d[:, 0] * samples.normal[:, 1])
                near = others & (along <= 0.75 * SPACING_PX) & (across < NEARER * away)
                if ASKED_PX < away < GATE_PX and near.any():
                    candidates.remove((offset, strength))
        kept.append(candidates)
    return kept


@pytest.mark.parametrize("seed", range(5))
def test_candidates_are_dropped_as_plain_numpy_drops_them(seed):
    room, z = scattered(seed)
    expected, before = plainly_kept(room, z), np.maximum(room.found.candidates, 0).sum()
    never_asked = room.found.candidates == -1
    dropped = drop_others(room, COUNT, z, GATE_PX, SPACING_PX)
    assert dropped == before - sum(len(kept) for kept in expected) > 0
    np.testing.assert_array_equal(room.found.candidates[never_asked], -1)
    for n, kept in enumerate(expected):
        assert max(room.found.candidates[n], 0) == len(kept)
        for k, (offset, strength) in enumerate(kept):
            assert (room.found.offset_px[n, k], room.found.strength[n, k]) == (offset, strength)


def test_a_faint_line_s_sample_beside_a_crossing_gives_up_the_bright_line():
    room = empty_room(2, 1)
    room.samples.uv[:] = (50.0, 40.0), (50.0, 41.5)
    room.samples.normal[:] = 0.0, 1.0
    room.samples.feature[:] = 0, 2
    room.samples.width_px[:] = 0.2, 0.8
    room.found.candidates[:] = 1
    room.found.offset_px[:, 0] = 1.5, 0.0
    assert drop_others(room, 2, np.zeros(UNKNOWNS), GATE_PX, SPACING_PX) == 1
    np.testing.assert_array_equal(room.found.candidates, [0, 1])


def test_a_line_s_own_candidates_stay_where_no_other_line_is():
    room = empty_room(10, 1)
    room.samples.uv[:, 0] = SPACING_PX * np.arange(10)
    room.samples.normal[:] = 0.0, 1.0
    room.samples.width_px[:] = 0.5
    room.found.candidates[:] = 1
    room.found.offset_px[:, 0] = np.linspace(-2.4, 2.4, 10)
    assert drop_others(room, 10, np.zeros(UNKNOWNS), GATE_PX, SPACING_PX) == 0
