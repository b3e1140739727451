"""A row on photographs of middle-size robots by a fisheye: robots and people told apart, each event left out once.

A network learns from three events (500 batches) and tells the kinds of the fourth: at the feet of boxes, at obstacles
that are told, and at places of the floor apart from all boxes. A told kind is right where the box says so; people that
no box marks count as wrong.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from benchmarks.scores.photograph_fisheyes import EVENTS, FIELD, FOLDER
from benchmarks.scores.photograph_rows import PhotographRow, needs, photographs, table_of
from field_models import load_field
from robocup_vision import Vision
from robocup_vision.arrays import UInt8Array
from robocup_vision.evaluation.boxes import Box
from robocup_vision.perception.kinds.network import KINDS, MIN_NATS, KindNetwork

STEPS, MIN_RIGHT = 500, 0.95
# what the team calls its boxes of robots
ROBOT = "obstacle"
SIDES = ("xmin", "ymin", "xmax", "ymax")


@needs(FOLDER)
def kinds_left_out() -> PhotographRow | None:
    """Tell kinds in each event by a network that has not learnt from it."""
    if find_spec("torch") is None:
        return None
    from sim2d.training.kind_crops import OTHER, RIM_PX, joined, photograph_crops
    from sim2d.training.kind_training import train

    field = load_field(FIELD)
    crops = {
        event: photograph_crops(
            np.random.default_rng(1), Vision(field, known.camera, mask=known.own_parts), _pictures(event)
        )
        for event, known in EVENTS.items()
    }
    true = np.zeros((len(KINDS), 3), dtype=int)
    with tempfile.TemporaryDirectory() as folder:
        for event, unseen in crops.items():
            path = Path(folder) / "kind.onnx"
            rest = joined([one for name, one in crops.items() if name != event])
            train(path, rest, seed=1, steps=STEPS, tell=lambda _: None)
            nats = KindNetwork(path.read_bytes()).nats(unseen.images[:, RIM_PX:-RIM_PX, RIM_PX:-RIM_PX])
            told = np.where(nats.max(axis=1) >= MIN_NATS, nats.argmax(axis=1), OTHER)
            for kind in range(len(KINDS)):
                is_told, is_kind = told == kind, unseen.kinds == kind
                true[kind] += np.count_nonzero(is_told & is_kind), np.count_nonzero(is_kind), np.count_nonzero(is_told)
    parts = [f"{kind} {right} of {there}, {told} told" for kind, (right, there, told) in zip(KINDS, true, strict=True)]
    is_met = bool(true[:, 0].sum() >= MIN_RIGHT * true[:, 2].sum())
    return PhotographRow("msl_fisheye, kinds, unseen event", "; ".join(parts), "95 % of told are right", is_met)


def _pictures(event: str) -> Iterator[tuple[UInt8Array, list[Box]]]:
    boxes: dict[str, list[Box]] = {}
    for row in table_of(FOLDER, "boxes.csv"):
        kind = "robot" if row["kind"] == ROBOT else row["kind"]
        boxes.setdefault(row["image"], []).append(Box(kind, *(float(row[side]) for side in SIDES)))
    for name, frame in photographs(FOLDER):
        if name.startswith(event):
            yield frame, boxes.get(name, [])


ROWS = (kinds_left_out,)
