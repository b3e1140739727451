"""The starts of a calibration: tried by any workers, each once, even where the calibration was interrupted.

Only the starts are kept: they take the time, and what comes after them follows from them.
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
        "CameraModelSettings": f"{_FITS}.settings",
        "OmniCamera": "robocup_vision.camera.omni",
        **dict.fromkeys(("Hyperboloid", "Tangent", "Table"), "robocup_vision.camera.floor_range"),
    }
)


class StartTrials:
    """Tries the starts of one calibration.

    Parameters
    ----------
    workers : Workers, optional
        Who tries them; this process unless given.
    kept : ResumeFile, optional
        Where results are kept, and those of an interrupted calibration are found.

    Attributes
    ----------
    done : int
        How many are finished, those found among them.
    """

    def __init__(self, workers: Workers | None = None, kept: ResumeFile | None = None) -> None:
        self._workers = this_process() if workers is None else workers
        self._kept = kept
        self._begun = 0
        self.done = 0 if kept is None else len(kept.found)

    def results(self, start: Start[P, R], pieces: Sequence[P], label: str) -> list[R]:
        """Return the result of each piece, in order.

        Calls must come in the same order with the same pieces whenever a calibration is repeated: results are found
        again by their number.
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
