"""Matches of a long run are kept as they end, and an interrupted run goes on with them."""

import pytest

from benchmarks.matches import every_field
from benchmarks.matches.every_field import CASES, Piece, play_row
from benchmarks.scores.match_score import Played
from field_models.errors import FileError
from robocup_vision.files.resume_file import ResumeFile

PIECES = [Piece(CASES[0], 60.0, seed) for seed in range(4)]


class InterruptedPool:
    """Plays so many matches, then fails."""

    def __init__(self, count):
        self.count, self.seeds = count, []

    def map(self, function, pieces):
        """Play one after another."""
        for n, piece in enumerate(pieces):
            if n == self.count:
                raise KeyboardInterrupt
            self.seeds.append(piece.seed)
            yield function(piece)


@pytest.fixture(autouse=True)
def no_matches(monkeypatch):
    """Let a match be its seed."""
    monkeypatch.setattr(every_field, "play_piece", lambda piece: Played(goals=piece.seed, lost_s=0.1 * piece.seed))


def test_an_interrupted_row_goes_on_with_what_was_kept(tmp_path):
    path, run = tmp_path / "kept.jsonl", {"seed": 0}
    with ResumeFile(path, run, resume=True) as kept, pytest.raises(KeyboardInterrupt):
        play_row(InterruptedPool(2), PIECES, kept, 8)
    pool = InterruptedPool(None)
    with ResumeFile(path, run, resume=True) as kept:
        played = play_row(pool, PIECES, kept, 8)
    assert pool.seeds == [2, 3]
    assert [match.goals for match in played] == [0, 1, 2, 3]
    with ResumeFile(path, run, resume=True) as kept:
        assert play_row(InterruptedPool(0), PIECES, kept, 8) == played


def test_matches_of_other_sources_are_not_added_to(tmp_path):
    with ResumeFile(tmp_path / "kept.jsonl", {"sources": "before"}, resume=True):
        pass
    with pytest.raises(FileError, match="sources was 'before', is now 'after'"):
        ResumeFile(tmp_path / "kept.jsonl", {"sources": "after"}, resume=True)


def test_without_a_file_all_are_played():
    pool = InterruptedPool(None)
    assert [match.goals for match in play_row(pool, PIECES, None, 0)] == [0, 1, 2, 3]
    assert pool.seeds == [0, 1, 2, 3]


def test_the_longest_time_lost_is_that_of_any_match():
    together = Played.together([Played(goals=1, lost_s=0.2), Played(goals=2, lost_s=0.7)])
    assert (together.goals, together.lost_s) == (3, 0.7)
