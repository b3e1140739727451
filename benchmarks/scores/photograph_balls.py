"""Balls in photographs: found where somebody marked them, and nowhere else.

"alone": each frame with a `Vision` that has forgotten all others; "in sequence": one `Vision` for all frames in their
order. A hit is a first ball (`view.ball`) whose centre lies in a marked box and a pixel around it, or within 8 pixels
of a marked centre. "precision": hits by frames in which any ball is reported. Boxes end at the picture's rim, balls do
not: "centre outside" are first balls that lie in a box continued beyond the rim to the width of its height, which the
box itself makes false finds.

Photographs of other things are scaled to each camera's size; what is counted is the looks that report a ball. The
cameras are those of the photographs, and two of the project's own.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from itertools import chain, islice

import numpy as np

from benchmarks.scores.photograph_rows import (
    ONBOARD,
    REAL,
    PhotographRow,
    looks,
    needs,
    photographs,
    photographs_of_other_things,
    table_of,
)
from field_models import Field, load_field
from robocup_vision import Vision, load_camera
from robocup_vision.camera import OmniCamera, PinholeCamera
from robocup_vision.perception.balls.ball import Ball
from robocup_vision.perception.balls.finder import BallFinder
from robocup_vision.perception.balls.projection import BallFrame
from sim2d.rendering.cameras import sekimori_camera

# balls in the six photographs of onboard_ssl, read by eye, pixels; the near one is 110 wide
ONBOARD_BALLS = {"sqr_02_901.png": (360.0, 72.0), "sqr_02_953.png": (323.0, 92.0), "igs_02_240.png": (588.0, 450.0)}
NEAR_BALL, NEAR_PX, HIT_PX = "igs_02_240.png", 25.0, 8.0
# colour and place of each ball in the mirror photographs, read by eye
MIRROR_BALLS = (
    ("omni_msl_noisy", "y_1bakbak_pic0.png", "camera_y_1bakbak_pic0.toml", "yellow", (160.0, 305.0)),
    ("omni_msl_noisy", "y_2_pic0.png", "camera_y_2_pic0.toml", "yellow", (301.0, 149.0)),
    ("omni_msl_noisy", "y_100_pic0.png", "camera_y_100_pic0.toml", "orange", (352.0, 253.0)),
    ("omni_msl_6x4_b", "b_center.png", "camera.toml", "yellow", (291.0, 144.0)),
)
MIRROR_HIT_PX = 10.0
# balls with dark patches: centre and radius, read by eye
PATTERNED_BALLS = {
    "point1.jpg": ((124, 239, 12), (268, 260, 14), (173, 314, 23), (499, 245, 13), (627, 259, 15), (381, 198, 6)),
    "point2.jpg": (
        (206, 383, 15),
        (344, 382, 15),
        (345, 360, 12),
        (345, 342, 9),
        (429, 340, 9),
        (345, 316, 6),
        (126, 320, 6),
        (567, 319, 5),
    ),
    "point3.jpg": (
        (314, 378, 17),
        (430, 361, 14),
        (350, 346, 12),
        (250, 323, 9),
        (325, 321, 8),
        (143, 301, 6),
        (351, 294, 5),
    ),
    "point4.jpg": ((28, 310, 27), (350, 241, 16), (434, 221, 13), (575, 234, 16)),
    "point5.jpg": ((276, 372, 27), (502, 342, 24), (320, 275, 14), (275, 258, 11), (372, 252, 11), (530, 215, 7)),
}
# boxes are good to so much
RIM_PX = 2.0
MIN_ALONE, MIN_SEQUENCE, MIN_PRECISION, MAX_FALSE = 0.90, 0.96, 0.98, 1 / 200


@needs("ball_onboard")
def onboard_sequence(*, alone: bool) -> PhotographRow:
    """Measure the small-size robot's camera with a teal cast."""
    boxes: dict[str, list[list[float]]] = {}
    for row in table_of("ball_onboard", "boxes.csv"):
        if row["class"] == "ball":
            boxes.setdefault(row["image"], []).append([float(row[key]) for key in ("xmin", "ymin", "xmax", "ymax")])
    vision = Vision(
        load_field(REAL / "ball_onboard" / "field.toml"), load_camera(REAL / "ball_onboard" / "camera.toml")
    )
    hits = reported = outside = 0
    for name, frame in photographs("ball_onboard"):
        if alone:
            vision.forget()
        ball = vision.look(frame).ball
        if ball is None:
            continue
        reported += 1
        marked = boxes.get(name, [])
        is_hit = any(_is_in(ball, box) for box in marked)
        hits += is_hit
        outside += not is_hit and any(_is_in(ball, continued(box, frame.shape[1])) for box in marked)
    needed = MIN_ALONE if alone else MIN_SEQUENCE
    ratio, precision = hits / len(boxes), hits / max(reported, 1)
    return PhotographRow(
        f"teal cast, {'alone' if alone else 'in sequence'}",
        f"{hits}/{len(boxes)}, precision {hits}/{reported}; centre outside {outside}",
        f">= {needed:.0%}, {MIN_PRECISION:.0%}",
        ratio >= needed and precision >= MIN_PRECISION,
    )


def _is_in(ball: Ball, box: list[float]) -> bool:
    x0, y0, x1, y1 = box
    return x0 - 1 <= ball.u_px <= x1 + 1 and y0 - 1 <= ball.v_px <= y1 + 1


def continued(box: list[float], width_px: int) -> list[float]:
    """Return a ball's box x0, y0, x1, y1; a side at a picture's left or right rim goes on as far as a round ball."""
    x0, y0, x1, y1 = box
    if x0 <= RIM_PX:
        x0 = min(x0, x1 - (y1 - y0))
    if x1 >= width_px - 1 - RIM_PX:
        x1 = max(x1, x0 + (y1 - y0))
    return [x0, y0, x1, y1]


@needs(*ONBOARD)
def before_boards() -> PhotographRow:
    """Measure a small-size robot's camera before black boards."""
    marked = dict(ONBOARD_BALLS)
    for row in table_of("onboard_ssl_more", "balls.csv"):
        marked[row["image"]] = (float(row["u_px"]), float(row["v_px"]))
    where = REAL / "onboard_ssl_more"
    vision = Vision(load_field(where / "field.toml"), load_camera(where / "camera.toml"))
    hits = false = 0
    for look in looks(vision, chain.from_iterable(map(photographs, ONBOARD))):
        reach, place = NEAR_PX if look.name == NEAR_BALL else HIT_PX, marked.get(look.name, (math.inf, math.inf))
        near = [math.dist((ball.u_px, ball.v_px), place) <= reach for ball in look.view.balls]
        hits += bool(near and near[0])
        false += near.count(False)
    return PhotographRow(
        "before black boards",
        f"{hits}/{len(marked)}, {false} false",
        ">= 90 %, 0",
        hits >= 0.9 * len(marked) and not false,
    )


@needs("goal_spl")
def patterned() -> PhotographRow:
    """Look for balls with dark patches by the head camera of a Nao, whose tilt is not known."""
    vision = Vision(load_field("spl_2020"), load_camera(REAL / "goal_spl" / "camera.toml"))
    nearest = hits = false = 0
    for look in looks(vision, photographs("goal_spl")):
        marked = np.array(PATTERNED_BALLS[look.name], dtype=np.float64)
        found = set()
        for ball in look.view.balls:
            off = np.hypot(marked[:, 0] - ball.u_px, marked[:, 1] - ball.v_px) - 0.6 * marked[:, 2] - 2.0
            if off.min() > 0:
                false += 1
            else:
                found.add(int(np.argmin(off)))
        hits += len(found)
        # two lie equally near in one of the pictures
        nearest += any(marked[n, 2] == marked[:, 2].max() for n in found)
    pictures, balls = len(PATTERNED_BALLS), sum(map(len, PATTERNED_BALLS.values()))
    return PhotographRow(
        "patterned balls",
        f"nearest in {nearest} of {pictures}, {hits} of {balls}, {false} false",
        "5 of 5, <= 1 false in 9",
        nearest == pictures and 9 * false <= pictures,
    )


@needs("negatives", "goal_spl")
def patterned_in_other_things(step: int = 1) -> PhotographRow:
    """Count the patterned balls seen in photographs of other things, or in every `step`-th of them."""
    field, camera = load_field("spl_2020"), load_camera(REAL / "goal_spl" / "camera.toml")
    assert isinstance(camera, PinholeCamera)
    finder = BallFinder(field, camera)
    false = [
        bool(finder.find(BallFrame(frame, held)))
        for frame in islice(photographs_of_other_things(camera.size_px), 0, None, step)
        for held in (camera, camera.with_orientation(0.0, -0.2, 0.0))
    ]
    return _false_row("patterned, other things", false)


@needs(*(folder for folder, *_ in MIRROR_BALLS))
def noisy_mirrors() -> PhotographRow:
    """Measure yellow and orange middle-size balls in mirrors."""
    hits = 0
    for folder, image, camera, color, (u, v) in MIRROR_BALLS:
        field = replace(load_field("msl_6x4"), ball_color=color)
        vision = Vision(field, load_camera(REAL / folder / camera))
        ball = vision.look(dict(photographs(folder))[image]).ball
        hits += ball is not None and np.hypot(ball.u_px - u, ball.v_px - v) <= MIRROR_HIT_PX
    return PhotographRow(
        "middle-size, noisy mirrors", f"{hits}/{len(MIRROR_BALLS)}", ">= 7/8", hits >= 7 / 8 * len(MIRROR_BALLS)
    )


@needs("negatives", "onboard_ssl_more")
def other_things(step: int = 1) -> PhotographRow:
    """Count the balls seen in every `step`-th photograph of other things, by mirror and pinhole cameras."""
    false = []
    for field, camera in _cameras():
        others = (("", frame) for frame in islice(photographs_of_other_things(camera.size_px), 0, None, step))
        false += [bool(look.view.balls) for look in looks(Vision(field, camera), others)]
    return _false_row("other things", false)


def _false_row(name: str, false: list[bool]) -> PhotographRow:
    found = sum(false)
    return PhotographRow(name, f"{found}/{len(false)} show a ball", "<= 1/200", found <= MAX_FALSE * len(false))


def _cameras() -> list[tuple[Field, OmniCamera | PinholeCamera]]:
    mirror = load_camera(REAL / "omni_msl_6x4_b" / "camera.toml")
    middle_size = load_field("msl_6x4")
    found = [
        (load_field("ssl_2001"), sekimori_camera()),
        (middle_size, mirror),
        (replace(middle_size, ball_color="yellow"), mirror),
    ]
    forward = (REAL / folder for folder in ("onboard_ssl_more", "ball_onboard"))
    return found + [(load_field(folder / "field.toml"), load_camera(folder / "camera.toml")) for folder in forward]


_MARKED = (
    lambda: onboard_sequence(alone=True),
    lambda: onboard_sequence(alone=False),
    before_boards,
    patterned,
    noisy_mirrors,
)
ROWS = (*_MARKED, other_things, patterned_in_other_things)
QUICK_ROWS = (*_MARKED, partial(other_things, 10), partial(patterned_in_other_things, 10))
