"""Balls and obstacles of a view, compared with the boxes of its image.

What is reported is a hit where its place in the picture, a ball's centre or an obstacle's foot, lies in a box of its
kind or 2 pixels around it; each box counts once, for the likeliest. What is reported and hits no box is false.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from field_models.errors import ArgumentError
from field_models.field import Field
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.evaluation.boxes import Box
from robocup_vision.perception.kinds.network import Kind

HIT_PX = 2.0
BALL, OBSTACLE = "ball", "obstacle"
# kinds of boxes that an obstacle may be reported of
OBSTACLE_KINDS = (OBSTACLE, "robot", "person", "human")
SCORED_KINDS = (BALL, *OBSTACLE_KINDS)
# kinds of boxes that show a robot or a person; a box of another kind shows neither, but an obstacle may be either
KIND_OF_BOX: Final[dict[str, Kind]] = {"robot": "robot", "person": "person", "human": "person"}


class Detection(NamedTuple):
    """A box with what was reported of it, or what was reported where there is no box."""

    kind: str  #: of the box; without a box, of the detection: "ball" or "obstacle"
    #: its xmin, ymin, xmax, ymax, pixels; None: what was reported is not there
    box: tuple[float, float, float, float] | None
    place_px: tuple[float, float] | None = None  #: where it was reported; None: the box was missed
    #: reported range less that of the box: where the ray through its centre meets the height of a ball's centre, or the
    #: ray through its lower edge the floor. None of a miss, and where the box is cut or no floor is there.
    range_error_m: float | None = None
    #: `Obstacle.kind` of what was reported in a box of a robot or a person; None: not reported, or not asked for
    reported_kind: str | None = None

    @property
    def is_hit(self) -> bool:
        """Whether something was reported where a box is."""
        return self.box is not None and self.place_px is not None


def reported_kinds(boxes: Iterable[Box]) -> tuple[str, ...]:
    """Return which of "ball" and "obstacle" a dataset's boxes mark; both where there is no box at all."""
    marked = {box.kind for box in boxes}
    kinds = (BALL,) * (BALL in marked) + (OBSTACLE,) * (not marked.isdisjoint(OBSTACLE_KINDS))
    return kinds if marked else (BALL, OBSTACLE)


def match_boxes(
    view: Any, boxes: Sequence[Box], field: Field, kinds: Sequence[str] = (BALL, OBSTACLE)
) -> tuple[Detection, ...]:
    """Hold what a view tells against the boxes of its image.

    Parameters
    ----------
    view : View
        Or another value with `balls`, `obstacles` and `camera`.
    boxes : sequence of Box
        Those of kinds that no view tells are left out.
    kinds : sequence of str
        Which of "ball" and "obstacle" are held against boxes.

    Raises
    ------
    ArgumentError
        If the view has no `balls`, `obstacles` or `camera`.
    """
    for name in ("balls", "obstacles", "camera"):
        if not hasattr(view, name):
            raise ArgumentError(f"the localiser's views have no {name}, which boxes.csv needs")
    camera: OmniCamera | PinholeCamera = view.camera
    found: list[Detection] = []
    balls = [_Report((ball.u_px, ball.v_px), math.hypot(ball.x_m, ball.y_m), None) for ball in view.balls]
    feet = np.array([(one.x_m, one.y_m) for one in view.obstacles], dtype=np.float64).reshape(-1, 2)
    shown = camera.floor_to_pixel(feet) if len(feet) else feet
    # telling kinds takes time
    asks_kinds = any(box.kind in KIND_OF_BOX for box in boxes)
    things = [
        _Report((float(u), float(v)), math.hypot(x, y), one.kind if asks_kinds else None)
        for (u, v), (x, y), one in zip(shown, feet, view.obstacles, strict=True)
    ]
    if BALL in kinds:
        found += _matched(balls, BALL, [box for box in boxes if box.kind == BALL], camera, field.ball_radius_m)
    if OBSTACLE in kinds:
        found += _matched(things, OBSTACLE, [box for box in boxes if box.kind in OBSTACLE_KINDS], camera, None)
    return tuple(found)


class _Report(NamedTuple):
    place_px: tuple[float, float]
    range_m: float
    kind: str | None


def _matched(
    reported: Iterable[_Report],
    kind: str,
    boxes: list[Box],
    camera: OmniCamera | PinholeCamera,
    height_m: float | None,
) -> list[Detection]:
    found: list[Detection] = []
    for place, range_m, reported_kind in reported:
        near = [box for box in boxes if box.holds(*place, HIT_PX)]
        if not near:
            found.append(Detection(kind, None, place))
            continue
        box = min(near, key=lambda one: math.dist(place, ((one.xmin + one.xmax) / 2, (one.ymin + one.ymax) / 2)))
        boxes.remove(box)
        true_m = None if box.is_cut(camera.size_px) else _range_m(box, camera, height_m)
        error_m = None if true_m is None else range_m - true_m
        found.append(Detection(box.kind, box[1:], place, error_m, reported_kind if box.kind in KIND_OF_BOX else None))
    return found + [Detection(box.kind, box[1:]) for box in boxes]


def _range_m(box: Box, camera: OmniCamera | PinholeCamera, height_m: float | None) -> float | None:
    """Range, robot frame, of a ball's centre at this height, or of the feet of what stands on the floor."""
    if isinstance(camera, PinholeCamera) and not camera.known_orientation:
        return None
    u, v = (box.xmin + box.xmax) / 2, (box.ymin + box.ymax) / 2
    if height_m is None:
        if isinstance(camera, OmniCamera):
            # feet are what is nearest to the mirror's axis
            u, v = (
                float(np.clip(c, low, high)) for c, low, high in zip(camera.center_px, box[1:3], box[3:], strict=True)
            )
        else:
            v = box.ymax
    eye_m = camera.height_m
    floor = camera.pixel_to_floor(np.array((u, v)))
    if eye_m is None or not np.isfinite(floor).all():
        return None
    foot = np.array(camera.offset_m)
    return float(np.hypot(*(foot + (floor - foot) * (1.0 - (height_m or 0.0) / eye_m))))


@dataclass(frozen=True, slots=True)
class KindFigures:
    """How well things of one kind are found; None where nothing was there to compute a figure from."""

    #: how many boxes there are, and how many of them were found
    boxes: int
    found: int
    #: number of detections of this kind; None of a kind that is detected as an obstacle, such as a robot
    reported: int | None
    #: found of all boxes, and hits of all that was reported, 0 to 1
    recall: float | None
    precision: float | None
    median_range_error_m: float | None  #: median of how far the range is off, over the hits whose true range is known
    #: number of the robots or people found whose `Obstacle.kind` was reported, and was right; None of other kinds
    kind_reported: int | None = None
    kind_right: int | None = None


def detection_figures(
    detections: Iterable[Detection], kinds: Sequence[str] = (BALL, OBSTACLE)
) -> dict[str, KindFigures]:
    """Compute the figures of these kinds, and of each kind of box; "obstacle" holds all that is no ball."""
    every = list(detections)
    shown = dict.fromkeys((*kinds, *sorted({one.kind for one in every})))
    return {kind: _figures(kind, every) for kind in shown}


def _figures(kind: str, every: list[Detection]) -> KindFigures:
    boxes = [one for one in every if one.box is not None and one.kind == kind]
    hits = [one for one in boxes if one.is_hit]
    errors = [abs(one.range_error_m) for one in hits if one.range_error_m is not None]
    reported = true = None
    if kind in (BALL, OBSTACLE):
        of_kind = [one for one in every if one.place_px is not None and (one.kind == BALL) == (kind == BALL)]
        reported, true = len(of_kind), sum(one.is_hit for one in of_kind)
    return KindFigures(
        boxes=len(boxes),
        found=len(hits),
        reported=reported,
        recall=len(hits) / len(boxes) if boxes else None,
        precision=true / reported if reported and true is not None else None,
        median_range_error_m=float(np.median(errors)) if errors else None,
        kind_reported=sum(one.reported_kind is not None for one in hits) if kind in KIND_OF_BOX else None,
        kind_right=sum(one.reported_kind == KIND_OF_BOX[kind] for one in hits) if kind in KIND_OF_BOX else None,
    )
