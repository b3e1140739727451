"""Compares the balls and obstacles of a view with the boxes of its image.

A detection is a hit if its place in the picture (a ball's centre or an obstacle's foot) lies in a box of its kind or at
most 2 pixels outside. Each box is hit at most once, by the first such detection. Detections that hit no box are false.
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
# kinds of boxes that an obstacle may hit
OBSTACLE_KINDS = (OBSTACLE, "robot", "person", "human")
SCORED_KINDS = (BALL, *OBSTACLE_KINDS)
# kinds of boxes that show a robot or a person; "obstacle" is not among them because it may be either
KIND_OF_BOX: Final[dict[str, Kind]] = {"robot": "robot", "person": "person", "human": "person"}


class Detection(NamedTuple):
    """A box with the detection that hit it, a missed box, or a false detection."""

    kind: str  #: kind of the box; without a box, the detection's kind: "ball" or "obstacle"
    #: xmin, ymin, xmax and ymax of the box, pixels; None: a false detection
    box: tuple[float, float, float, float] | None
    place_px: tuple[float, float] | None = None  #: place of the detection in the image; None: the box was missed
    #: reported range minus that of the box: where the ray through its centre meets the height of a ball's centre, or
    #: the ray through its lower edge meets the floor. None for a miss, a false detection, a box that is cut by the
    #: image's border, and a ray that does not meet the floor.
    range_error_m: float | None = None
    #: reported `Obstacle.kind` in the box of a robot or a person; None: not reported, or not asked for
    reported_kind: str | None = None

    @property
    def is_hit(self) -> bool:
        """Whether a detection lies in a box."""
        return self.box is not None and self.place_px is not None


def reported_kinds(boxes: Iterable[Box]) -> tuple[str, ...]:
    """Return which of "ball" and "obstacle" a dataset's boxes mark; both if there are no boxes."""
    marked = {box.kind for box in boxes}
    kinds = (BALL,) * (BALL in marked) + (OBSTACLE,) * (not marked.isdisjoint(OBSTACLE_KINDS))
    return kinds if marked else (BALL, OBSTACLE)


def match_boxes(
    view: Any, boxes: Sequence[Box], field: Field, kinds: Sequence[str] = (BALL, OBSTACLE)
) -> tuple[Detection, ...]:
    """Compare the balls and obstacles of a view with the boxes of its image.

    Parameters
    ----------
    view : View
        Or another value with `balls`, `obstacles` and `camera`.
    boxes : sequence of Box
        Boxes of other kinds than `SCORED_KINDS` are ignored.
    kinds : sequence of str
        Which of "ball" and "obstacle" are compared.

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
    # computing `Obstacle.kind` takes time
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
    """Return the distance from the robot to a ball's centre at this height, or to the foot of a thing on the floor."""
    if isinstance(camera, PinholeCamera) and not camera.known_orientation:
        return None
    u, v = (box.xmin + box.xmax) / 2, (box.ymin + box.ymax) / 2
    if height_m is None:
        if isinstance(camera, OmniCamera):
            # the foot is the point of the box nearest to the mirror's axis
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
    """How well things of one kind are found; None if there was nothing to compute a figure from."""

    #: number of boxes, and of those that were hit
    boxes: int
    found: int
    #: number of detections of this kind; None for kinds that are reported as obstacles, such as "robot"
    reported: int | None
    #: fraction of the boxes that were hit, and of the detections that are hits, 0 to 1
    recall: float | None
    precision: float | None
    median_range_error_m: float | None  #: median absolute range error over the hits whose true range is known
    #: number of hits whose `Obstacle.kind` was reported, and of those where it was right; only for robots and people
    kind_reported: int | None = None
    kind_right: int | None = None


def detection_figures(
    detections: Iterable[Detection], kinds: Sequence[str] = (BALL, OBSTACLE)
) -> dict[str, KindFigures]:
    """Compute the figures of these kinds, and of each kind of box; detections of "obstacle" are all but balls."""
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
