"""Median time of a goal frame over the field, by stages, as a ratio to cv2.cvtColor(BGR2HSV) on one thread.

Times are those of the thread, so that other work on the machine does not count. Frames are rendered at every fourth of
the paper's 66 places (--quick: every 24th), and at four places (--quick: two) of a field with white goals.
Judged is the whole locate() of each condition.
"""

from __future__ import annotations

import itertools
from argparse import Namespace
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.harness import Table, program, verdict
from benchmarks.harness.timing import median_s, unit_s
from field_models import load_field
from robocup_vision.arrays import UInt8Array
from robocup_vision.camera import PinholeCamera
from robocup_vision.localization.forward import GoalLocalizer
from robocup_vision.localization.goal.fit import refine
from robocup_vision.localization.goal.search import Candidate, GoalSearch
from robocup_vision.localization.localizer import frame_alone
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, paper_places, sample_goal

FIELD = load_field("four_legged_2007")
MAX_RATIO = {"clean_416x320": 20.0, "heavy_glare_416x320": 50.0, "mild_glare_208x160": 80.0, "white_640x480": 60.0}


def warm_median_s(call: Callable[[], object], repeats: int) -> float:
    """Return the median time of a call that was made once before."""
    call()
    return median_s(call, repeats)


def masks(search: GoalSearch, frame: UInt8Array) -> object:
    """Mark the paint of both goals."""
    return search.picture(frame).masks


def pairs(search: GoalSearch, frame: UInt8Array) -> object:
    """Find the first two pairs of posts."""
    return list(itertools.islice(search.proposals(search.picture(frame)), 2))


def candidates(search: GoalSearch, frame: UInt8Array) -> tuple[list[Candidate], str]:
    """Find goals."""
    return search.candidates(search.picture(frame))


def locate(localizer: GoalLocalizer, camera: PinholeCamera, frame: UInt8Array) -> object:
    """Locate the camera."""
    return localizer.locate(frame_alone(frame, camera))


@program()
def main(arguments: Namespace) -> None:
    """Measure and print."""
    repeats, step = (2, 24) if arguments.quick else (9, 4)
    for name, max_ratio in MAX_RATIO.items():
        field = load_field("spl_2020") if name.startswith("white") else FIELD
        condition = GOAL_CONDITIONS[name]
        places = None if name.startswith("white") else paper_places(FIELD)
        indices = list(range(2, 66, step)) if places else list(range(2 if arguments.quick else 4))
        samples = list(sample_goal(field, condition, arguments.seed, 66, places=places, indices=indices, supersample=3))
        localizer, search = GoalLocalizer(field, condition.camera), GoalSearch(field, condition.camera)
        columns = "stage                 | ms | x cvtColor: time ratio | target | verdict"
        table = Table(columns, name, name=name)
        frames = [s.frame for s in samples]
        unit = float(np.median([unit_s(f, 5 * repeats) for f in frames]))
        stages: list[tuple[str, Callable[[UInt8Array], object]]] = []
        if search.families:
            stages.append(("masks of both hues", partial(masks, search)))
        stages.append(("masks, posts, pairs", partial(pairs, search)))
        stages.append(("goal search", partial(candidates, search)))
        stages.append(("whole locate()", partial(locate, localizer, condition.camera)))
        for stage, call in stages:
            typical = float(np.median([warm_median_s(partial(call, f), repeats) for f in frames]))
            judged = stage == "whole locate()"
            ok = typical / unit <= max_ratio
            target, says = (max_ratio, verdict(ok)) if judged else (None, None)
            table.row(stage, 1e3 * typical, typical / unit, target, says)
        found = candidates(search, frames[0])[0]
        if found:
            c = found[0]
            appearance = next(iter(search.proposals(search.picture(frames[0])))).appearance
            refining = partial(refine, frames[0], condition.camera, c.model, c.fit.unknowns, appearance)
            once = warm_median_s(refining, 5 * repeats)
            table.row("one refinement", 1e3 * once, once / unit, None, None)
