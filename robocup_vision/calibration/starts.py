"""Trials of a calibration's starts: distributed over workers, and resumed after an interruption.

Only the results of the starts are stored: they take most of the time, and later steps follow from them.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import closing
from typing import TypeVar

from robocup_vision.files.resume_file import ResumeFile
from robocup_vision.files.value_codec import ValueCodec
from robocup_vision.progress import progress
from robocup_vision.workers import Workers, run_pieces, this_process
from robocup_vision.workers.pieces import Start

P = TypeVar("P")
R = TypeVar("R")


_FITS = "robocup_vision.calibration.omni"
FIT_CODEC = ValueCodec(
    {
        "Fit": f"{_FITS}.fit",
        "CameraModel": f"{_FITS}.model",
        "OmniCamera": "robocup_vision.camera.omni",
        **dict.fromkeys(("Hyperboloid", "Tangent", "Table"), "robocup_vision.camera.floor_range"),
    }
)


class StartTrials:
    """Evaluates the starts of one calibration.

    Parameters
    ----------
    workers : Workers, optional
        Workers for the trials; this process by default.
    kept : ResumeFile, optional
        File for results, with those of an interrupted calibration.

    Attributes
    ----------
    done : int
        Number of finished starts, including stored ones.
    """

    def __init__(self, workers: Workers | None = None, kept: ResumeFile | None = None) -> None:
        self._workers = this_process() if workers is None else workers
        self._kept = kept
        self._begun = 0
        self.done = 0 if kept is None else len(kept.found)

    def results(self, start: Start[P, R], pieces: Sequence[P], label: str) -> list[R]:
        """Return the result of each piece, in order.

        Results are identified by their number, so a repeated calibration must make the same calls in the same order.
        """
        first, self._begun = self._begun, self._begun + len(pieces)
        found = {} if self._kept is None else self._kept.found
        results: dict[int, R] = {place: found[first + place] for place in range(len(pieces)) if first + place in found}
        missing = [place for place in range(len(pieces)) if place not in results]
        trying = run_pieces(start, [pieces[place] for place in missing], self._workers)
        with closing(trying):
            for number, result in progress(trying, len(missing), label):
                results[missing[number]] = result
                if self._kept is not None:
                    self._kept.add(first + missing[number], result)
                self.done += 1
        return [results[place] for place in range(len(pieces))]
