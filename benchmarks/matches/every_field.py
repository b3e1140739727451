"""Matches on every built-in league's field, as `robocup-vision match --field F` plays them.

Players per side, camera and robots are those of `sim2d.match.setups`, the disturbances the default ones: with pinhole
cameras late frames, slow shutters, nods and drifting light. Division B is played with forward cameras and, as a row of
its own, with mirror cameras. "near": fraction of the control periods in which a robot's estimate is within the bound of
the truth. "lost": longest time of any robot without such an estimate. "right half": of the poses estimated after 2 s.
"ball": fraction of the control periods of play in which a robot knows the ball within 20 cm of the truth. "stands":
fraction of play in which a field player has moved less than 5 cm in 3 s. "contacts": times a robot came to touch
another one, a robot and minute. "real time": simulated over processor seconds, one thread, all players and pictures.

--full plays 40 matches of 60 s on each field, which takes hours; --only NAME plays those of one row. Each match says on
stderr, as it ends, its seed and how long a robot of it was lost. --keep FILE keeps each match in a file as it ends: a
run that was interrupted goes on from there, as long as no source of library and simulator has changed.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

from benchmarks.harness import Pool, Table, percent, program, verdict
from benchmarks.harness.programs import sources_digest
from benchmarks.scores.match_score import BOUNDS, Played, play
from robocup_vision.files.resume_file import ResumeFile
from sim2d.match.run import MatchPlan

# (matches of each row, seconds each)
QUICK, DEFAULT, FULL = (1, 1.0), (4, 10.0), (40, 60.0)


@dataclass(frozen=True)
class Case:
    """A field, and what is to be reached."""

    name: str
    field: str
    min_near: float
    max_lost_s: float
    camera: str | None = None


CASES = (
    Case("ssl_2001", "ssl_2001", 0.99, 1.0),
    Case("four_legged_2007", "four_legged_2007", 0.97, 0.7),
    Case("ssl_division_b, forward", "ssl_division_b", 0.95, 1.0),
    Case("ssl_division_b, mirror", "ssl_division_b", 0.95, 1.0, "ssl_mirror"),
    Case("msl_18x12", "msl_18x12", 0.95, 1.0),
    Case("spl_2020", "spl_2020", 0.95, 1.0),
)


@dataclass(frozen=True)
class Piece:
    """A match to play."""

    case: Case
    seconds: float
    seed: int


def plan_of(case: Case, seconds: float, seed: int) -> MatchPlan:
    """Return a match of a case."""
    return MatchPlan(case.field, seconds=seconds, seed=seed, camera=case.camera)


@cache
def prepare(case: Case) -> None:
    """Play a moment, which compiles and loads what the matches of a field need: it is not timed."""
    play(plan_of(case, 0.1, 0), BOUNDS[case.field])


def play_piece(piece: Piece) -> Played:
    """Play a match in this process, and say on stderr how it was."""
    # of a quick match, which is over sooner than its robots are made, the time says nothing
    if piece.seconds > 1.0:
        prepare(piece.case)
    played = play(plan_of(piece.case, piece.seconds, piece.seed), BOUNDS[piece.case.field])
    near = percent(played.near / played.periods)
    print(f"{piece.case.name}, seed {piece.seed}: near {near} %, lost {played.lost_s:.2f} s", file=sys.stderr)
    return played


def play_row(pool: Pool, pieces: Sequence[Piece], kept: ResumeFile | None, first: int) -> list[Played]:
    """Play matches, but for those that have been kept, under numbers from `first` on; keep the others as they end."""
    found = {} if kept is None else kept.found
    played = {n: Played(**found[n]) for n in range(first, first + len(pieces)) if n in found}
    missing = [(n, piece) for n, piece in enumerate(pieces, first) if n not in played]
    for (n, _), match in zip(missing, pool.map(play_piece, [piece for _, piece in missing]), strict=True):
        played[n] = match
        if kept is not None:
            kept.add(n, asdict(match))
    return [played[n] for n in sorted(played)]


def print_row(table: Table, case: Case, played: Played) -> None:
    """Print the figures of a case."""
    players = MatchPlan(case.field).setup.players
    near = played.near / played.periods
    right_half = played.right_half / played.settled if played.settled else None
    ok = near >= case.min_near and played.lost_s <= case.max_lost_s and played.stopped == 0
    ok &= right_half is None or right_half == 1.0
    minutes = played.seconds / 60.0
    table.row(
        case.name,
        f"{players} : {players}",
        str(BOUNDS[case.field]),
        percent(near),
        f"{100 * case.min_near:g}",
        played.lost_s,
        f"{case.max_lost_s:g}",
        percent(right_half),
        f"{played.goals / minutes:.1f}",
        f"{played.contacts / (2 * players * minutes):.1f}",
        percent(played.knows_ball / max(played.in_play, 1)),
        f"{100 * played.stands / max(played.could_move, 1):.0f}",
        f"{played.seconds / played.spent_s:.2f}",
        played.stopped,
        verdict(ok),
    )


NAMES = [case.name for case in CASES]
OPTIONS = {
    "--only": {"metavar": "NAME", "choices": NAMES, "help": f"one row: {', '.join(NAMES)}"},
    "--keep": {"metavar": "FILE", "help": "keep matches as they end, and go on with those kept before"},
}


@program(OPTIONS, pooled=True)
def main(arguments: Namespace, pool: Pool) -> None:
    """Measure and print."""
    matches, seconds = QUICK if arguments.quick else FULL if arguments.full else DEFAULT
    cases = [case for case in CASES if arguments.only in (None, case.name)]
    table = Table(
        (
            "field | players | bound | near %: rate | target % | lost s: error 1 | at most s | "
            "right half %: rate | goals a minute | contacts | ball %: rate | stands % | real time | "
            "players that failed: count | verdict"
        ),
        f"{matches} matches of {seconds:g} s on each field",
        name="every field",
        samples=round(matches * seconds * 4),
    )
    with ExitStack() as stack:
        kept = None
        if arguments.keep:
            run = {"matches": matches, "seconds": seconds, "seed": arguments.seed, "sources": sources_digest()}
            run["rows"] = [case.name for case in cases]
            kept = stack.enter_context(ResumeFile(Path(arguments.keep), run, resume=True))
        for row, case in enumerate(cases):
            pieces = [Piece(case, seconds, arguments.seed + index) for index in range(matches)]
            print_row(table, case, Played.together(play_row(pool, pieces, kept, row * matches)))
