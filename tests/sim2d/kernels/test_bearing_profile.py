"""The stacks of spans against plain ray casting: at any slope, a bearing's span shows what the ray meets first."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim2d.kernels import bearing_profile as kernels
from sim2d.kernels.frame_values import (
    BallSphere,
    Bearings,
    Crossings,
    Lighting,
    RoomWall,
    Spans,
    Things,
    Viewpoint,
)

PER_TURN = 720
ANGLES = np.arange(PER_TURN) * math.tau / PER_TURN
DIRECTIONS = np.stack([ANGLES, np.cos(ANGLES), np.sin(ANGLES)], axis=1)
HEIGHT_M, LAMP = 0.2, 0.9
LIGHT = Lighting(1.0, 0.0, 0.0, 0.05, LAMP)
FLOOR, GROUND, ROOM, BALL = -1, -2, -3, -4
HALL_M = 3.0
EDGES = [(1.5, -1.0, 1.5, 1.0), (1.5, 1.0, -1.5, 1.0), (-1.5, 1.0, -1.5, -1.0), (-1.5, -1.0, 1.5, -1.0)]
WALL_M, BOX_M, ROBOT_M, POST_M = 0.1, 0.13, 0.14, 0.5


def corners(x, y, yaw):
    c, s = math.cos(yaw), math.sin(yaw)
    half = [(0.07, -0.05), (0.07, 0.05), (-0.07, 0.05), (-0.07, -0.05)]
    return [(x + c * a - s * b, y + s * a + c * b) for a, b in half]


def stacks(eye, boxes, rounds, ball, directions=DIRECTIONS):
    """Run the kernels; colours are the numbers of things in the blue channel: wall 0-7, boxes 8, ..."""
    many = len(directions)
    crossings = Crossings(np.zeros(many, dtype=np.int32), np.zeros((many, 12, 4), dtype=np.float32))
    things, colors = [], []

    def add(height, bands, top, gap=0.0, marker=False, is_edge=False):
        first = len(colors)
        number = len(things) + 100
        colors.extend([number, 10 + band, 1] for band in range(bands))
        if top:
            colors.append([number, 1, 1])
        if marker:
            colors.append([number, 2, 1])
        things.append(
            [height, bands, first, first + bands if top else -1, first + bands + 1 if marker else -1, gap, is_edge]
        )

    for _ in range(2 * len(EDGES)):
        add(WALL_M, 1, False, is_edge=True)
    for _ in range(4 * len(boxes)):
        add(BOX_M, 1, True)
    add(POST_M, 3, True)
    for _, _, radius in rounds[1:]:
        add(ROBOT_M, 1, True, radius**2 * (1 - 0.3**2), marker=True)
    viewpoint, bearings = Viewpoint(*eye.tolist(), HEIGHT_M), Bearings(directions, PER_TURN)
    kernels.meet_walls(np.array(EDGES), 0, viewpoint, bearings, crossings)
    faces = np.array([corners(*box) for box in boxes]).reshape(-1, 4, 2)
    kernels.meet_boxes(faces, 8, viewpoint, bearings, crossings)
    kernels.meet_cylinders(np.array(rounds), 8 + 4 * len(boxes), viewpoint, LAMP, bearings, crossings)
    spans = Spans(
        np.zeros((many, 24), dtype=np.float32),
        np.zeros((many, 24), dtype=np.int32),
        np.zeros((many, 24, 3), dtype=np.float32),
        np.zeros(many, dtype=np.int32),
    )
    room = RoomWall(np.tile(np.float32([ROOM, 0, 1]), (10, 36, 1)), 2.0, HALL_M, np.array([GROUND, 0.0, 1.0]))
    rows = Things(np.array(things, dtype=float), np.array(colors, dtype=float))
    kernels.stack_spans(crossings, rows, bearings, viewpoint, LIGHT, room, BallSphere(*ball), spans)
    return spans.ends, spans.kinds, spans.paint


def meets(eye, bearing, slope, boxes, rounds, ball):
    """Cast one ray in plain Python: what it meets first, as (number or code, band, top or marker)."""
    dx, dy = math.cos(eye[2] + bearing), math.sin(eye[2] + bearing)

    def crossing(ax, ay, bx, by):
        cross_a, cross_b = (ax - eye[0]) * dy - (ay - eye[1]) * dx, (bx - eye[0]) * dy - (by - eye[1]) * dx
        if cross_a * cross_b > 0 or cross_a == cross_b:
            return math.inf
        part = cross_a / (cross_a - cross_b)
        along = (ax + part * (bx - ax) - eye[0]) * dx + (ay + part * (by - ay) - eye[1]) * dy
        return along if along > 0 else math.inf

    floor_m = HEIGHT_M / -slope if slope < 0 else math.inf
    walls = [crossing(*edge) for edge in EDGES]
    inside = floor_m < min(walls)
    hits = [(floor_m, FLOOR if inside else GROUND, 0)]
    toward = -(dx * eye[0] + dy * eye[1])
    hits.append((toward + math.sqrt(toward**2 + HALL_M**2 - eye[0] ** 2 - eye[1] ** 2), ROOM, 0))
    for k, distance in enumerate(walls):
        if distance < math.inf and 0 <= HEIGHT_M + slope * distance <= WALL_M:
            hits.append((distance, 100 + 2 * k, 10))  # counter-clockwise edges, seen from within: from their left
    for k, box in enumerate(boxes):
        points = corners(*box)
        distances = [crossing(*points[f - 1], *points[f]) for f in range(4)]
        near, far = min(distances), max(d for d in [*distances, -1.0] if d < math.inf)
        up = HEIGHT_M + slope * near if near < math.inf else math.inf
        if up <= BOX_M:
            hits.append((near, 108 + 4 * k + distances.index(near), 10))
        elif near < math.inf and HEIGHT_M + slope * far <= BOX_M:
            hits.append(((BOX_M - HEIGHT_M) / slope, 108 + 4 * k + distances.index(near), 1))
    for k, (x, y, radius) in enumerate(rounds):
        along, aside = (x - eye[0]) * dx + (y - eye[1]) * dy, (x - eye[0]) * dy - (y - eye[1]) * dx
        if abs(aside) >= radius or along < 0:
            continue
        chord = math.sqrt(radius**2 - aside**2)
        height = POST_M if k == 0 else ROBOT_M
        up = HEIGHT_M + slope * (along - chord)
        if up <= height:
            hits.append(
                (along - chord, 108 + 4 * len(boxes) + k, 10 + (min(int(3 * max(up, 0) / height), 2) if k == 0 else 0))
            )
        elif HEIGHT_M + slope * (along + chord) <= height:
            distance = (height - HEIGHT_M) / slope
            on_marker = math.hypot(distance - along, aside) < 0.3 * radius
            hits.append((distance, 108 + 4 * len(boxes) + k, 2 if on_marker else 1))
    x, y, radius, _ = ball
    rx, ry, rz = x - eye[0], y - eye[1], radius - HEIGHT_M
    along = rx * dx + ry * dy + rz * slope
    root2 = along**2 - (1 + slope**2) * (rx**2 + ry**2 + rz**2 - radius**2)
    if root2 > 0 and along > 0:
        hits.append(((along - math.sqrt(root2)) / (1 + slope**2), BALL, 0))
    return min(hits)[1:]


def draw_things(rng):
    """Draw an eye and things that stand apart from each other and from it."""
    taken = []

    def place(radius):
        while True:
            x, y = rng.uniform((-1.3, -0.8), (1.3, 0.8)).tolist()
            if all(math.hypot(x - a, y - b) > radius + r + 0.05 for a, b, r in taken):
                taken.append((x, y, radius))
                return x, y

    eye = np.array([*place(0.1), rng.uniform(-3.1, 3.1)])
    ball = (*place(0.02), 0.02, 0.06)
    rounds = [(*place(0.05), 0.05), *((*place(0.09), 0.09) for _ in range(rng.integers(4)))]
    boxes = [(*place(0.1), rng.uniform(0, 1.5)) for _ in range(rng.integers(4))]
    return eye, boxes, rounds, ball


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6))
def test_spans_are_what_rays_meet(seed):
    eye, boxes, rounds, ball = draw_things(np.random.default_rng(seed))
    ends, kinds, paint = stacks(eye, boxes, rounds, ball)
    for k in range(0, PER_TURN, 80):
        used = int(np.argmax(np.isinf(ends[k]))) + 1
        for slope in np.linspace(-2.0, 0.1, 43):
            if np.abs(ends[k, :used] - slope).min() < 1e-3:
                continue
            n = int(np.searchsorted(ends[k, :used], slope, side="right"))
            number, code, shade = paint[k, n].tolist()
            shown = {kernels.FLOOR: (FLOOR, 0), kernels.BALL: (BALL, 0)}.get(int(kinds[k, n]))
            if shown is None:
                shown = round(number / shade), round(code / shade)
            assert shown == meets(eye, ANGLES[k], slope, boxes, rounds, ball)


def test_a_camera_that_sees_part_of_a_turn_gets_the_same_spans():
    eye, boxes, rounds, ball = draw_things(np.random.default_rng(3))
    whole = stacks(eye, boxes, rounds, ball)
    part = stacks(eye, boxes, rounds, ball, DIRECTIONS[600:])
    for a, b in zip(whole[:2], part[:2], strict=True):
        np.testing.assert_allclose(a[600:], b, rtol=2e-3)


def test_a_full_list_keeps_what_is_nearest():
    crossings = Crossings(np.zeros(1, dtype=np.int32), np.zeros((1, 4, 4), dtype=np.float32))
    distances = [0.9, 0.3, 0.7, 0.5, 1.1, 0.2, 0.8]
    walls = np.array([[d, -0.5, d, 0.5] for d in distances])
    eye = Viewpoint(0.0, 0.0, 0.0, HEIGHT_M)
    kernels.meet_walls(walls, 0, eye, Bearings(DIRECTIONS[:1], PER_TURN), crossings)
    assert crossings.lengths[0] == 4
    assert crossings.entries[0, :, kernels.NEAR] == pytest.approx(sorted(distances)[:4])
    assert crossings.entries[0, :, kernels.THING].tolist() == [10.0, 2.0, 6.0, 4.0]
