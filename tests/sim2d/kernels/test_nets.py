"""Goal nets as the match cameras draw them, against many rays a pixel that meet cords or miss them."""

import math

import numpy as np
import pytest

from robocup_vision.camera.projection import camera_rotation
from sim2d.kernels import nets as kernels
from sim2d.kernels.forward.outlines import NET, outline_nets, overlaps
from sim2d.kernels.forward.values import ForwardEye, Outlines
from sim2d.kernels.frame_values import BallSphere, Crossings, Lighting, Nets, PixelRays, Things, Viewpoint

EYE = (0.1, -0.2, 0.45)
LIT = np.array([1.0, 0.1, -0.05, 0.3], dtype=np.float32)
UPRIGHT = [1.2, -0.5, 0.0, *np.array([0.2, 1.0, 0.0]) / math.hypot(0.2, 1.0), 0, 0, 1, 1.0, 0.8, 0.05, 0.08, 0.006]
ROOF = [1.0, -0.5, 0.8, 1, 0, 0, 0, 1, 0, 0.5, 1.0, 0.05, 0.1, 0.006]
LOW_ROOF = [1.0, -0.5, 0.2, 1, 0, 0, 0, 1, 0, 0.5, 1.0, 0.05, 0.1, 0.006]
COLOR = np.array([230.0, 210.0, 190.0], dtype=np.float32)


def meets_cord(row, rays):
    """Return whether rays (..., 3) meet a cord, and at how many lengths; by points, not by shares."""
    along, up, start = np.array(row[3:6]), np.array(row[6:9]), np.array(row[:3]) - EYE
    normal = np.cross(along, up)
    t = normal @ start / (rays @ normal)
    place = t[..., None] * rays - start
    on_cord, inside = np.zeros(t.shape, dtype=bool), t > 0
    for axis, size, mesh in ((along, row[9], row[11]), (up, row[10], row[12])):
        at = place @ axis
        inside &= (at >= 0) & (at <= size)
        on_cord |= np.abs(at - np.rint(at / mesh) * mesh) <= row[13] / 2
    return on_cord & inside, t


@pytest.mark.parametrize(("mesh", "cord", "wide"), [(0.05, 0.004, 0.003), (0.05, 0.004, 0.03), (0.03, 0.003, 0.4)])
def test_shares_of_cords_are_those_of_many_points(mesh, cord, wide):
    size = 0.6
    places = np.linspace(-0.1, 0.7, 37)
    points = places[:, None] + (np.arange(4001) / 4000 - 0.5) * wide
    inside = (points >= 0) & (points <= size)
    on_cord = np.abs(points - np.rint(points / mesh) * mesh) <= cord / 2
    found = np.array(
        [kernels.cover_axis(*(np.float32(v) for v in (at, wide, size, mesh, cord))) for at in places.tolist()]
    )
    assert found[:, 0] == pytest.approx(inside.mean(axis=1), abs=2e-3)
    assert found[:, 1] == pytest.approx((inside & ~on_cord).mean(axis=1), abs=2e-3)
    turns = np.linspace(-0.4, 3.4, 20).tolist()
    share = cord / mesh
    due = [sum(min(max(turn - k + share / 2, 0.0), share) for k in range(5)) for turn in turns]
    assert [kernels.cords_until(np.float32(turn), np.float32(share)) for turn in turns] == pytest.approx(due, abs=1e-5)


@pytest.mark.parametrize("row", [UPRIGHT, ROOF, LOW_ROOF])
@pytest.mark.parametrize("pixel_rad", [0.002, 0.02])
def test_a_tile_is_covered_as_many_rays_a_pixel_are(row, pixel_rad):
    middle = np.array(row[:3]) + 0.47 * row[9] * np.array(row[3:6]) + 0.55 * row[10] * np.array(row[6:9]) - EYE
    tilt = math.atan2(middle[2], math.hypot(middle[0], middle[1]))
    size, rotation = (16, 16), camera_rotation(math.atan2(middle[1], middle[0]), tilt, 0.05)
    v, u = (index.ravel() for index in np.mgrid[: size[0], : size[1]])
    steps = np.stack([-rotation[:, 1], -rotation[:, 2]]) * pixel_rad

    def rays_at(a, b):
        return rotation[:, 0] + (u - 7.5 + a)[:, None] * steps[0] + (v - 7.5 + b)[:, None] * steps[1]

    rays = np.ascontiguousarray(rays_at(0.0, 0.0).T.astype(np.float32))
    nearest = np.zeros((2, len(u)), dtype=np.float32)
    nearest[:, 40:80] = np.array([[0.3], [1.0]])  # something before the net
    nearest[:, 80:120] = np.array([[90.0], [1.0]])  # something behind it
    nearest[:, 120:160] = np.array([[0.3], [0.25]])  # something before a quarter of the pixel
    colors = np.full((3, len(u)), 60.0, dtype=np.float32)
    here, table = np.array(EYE, dtype=np.float32), Nets(np.array([row]), COLOR)
    kernels.draw_nets(table, 0, (0, size[0] - 1, 0, size[1] - 1), size[1], rays, steps, here, LIT, nearest, colors)
    offsets = (np.arange(40) + 0.5) / 40 - 0.5
    covered = np.mean([meets_cord(row, rays_at(a, b))[0] for a in offsets for b in offsets], axis=0)
    covered[40:80] = 0
    covered[120:160] *= 0.75
    _, t = meets_cord(row, rays_at(0.0, 0.0))
    x, y = (EYE[axis] + t * rays[axis] for axis in (0, 1))
    tone = np.maximum(LIT[0] + LIT[1] * x + LIT[2] * y, LIT[3])
    due = 60 + covered * (tone * COLOR[:, None] - 60)
    assert covered.max() > 0.1
    # a pixel that lies askew to the cords is taken as one that does not
    assert np.abs(colors - due).max() < 0.2 * 170
    assert np.abs(colors - due).mean() < 2.0
    assert (colors - due).mean() == pytest.approx(0.0, abs=0.5)


def test_a_mirrors_pixels_are_covered_but_where_something_stands_before_the_net():
    bearings, many = 360, 120
    eye = Viewpoint(*EYE[:2], 0.3, EYE[2])
    angles = np.arange(bearings) * math.tau / bearings
    directions = np.stack([angles, np.cos(angles), np.sin(angles)], axis=1)
    edges = np.linspace(-1.0, 0.8, many + 1)
    low, high = np.tile(edges[:-1], bearings), np.tile(edges[1:], bearings)
    away = np.minimum(EYE[2] / np.maximum(-(low + high) / 2, 1e-3), 5.0)
    of_pixel = np.repeat(directions, many, axis=0)
    rays = np.zeros((9, bearings * many), dtype=np.float32)
    rays[:4] = away * of_pixel[:, 1], away * of_pixel[:, 2], low, high
    rays[4] = 1.0
    rays[6] = away * math.tau / bearings
    first = (np.arange(bearings + 1) * many).astype(np.int32)
    pixels = PixelRays(rays, np.arange(rays.shape[1]).astype(np.uint32), first, directions, np.zeros(2))
    crossings = Crossings(np.zeros(bearings, dtype=np.int32), np.zeros((bearings, 2, 4), dtype=np.float32))
    hidden = range(bearings - 20, bearings - 12)
    for bearing in hidden:
        crossings.lengths[bearing], crossings.entries[bearing, 0] = 1, (0.5, 0.6, 0, 1.0)
    things = Things(np.array([[0.3, 1, 0, -1, -1, 0, 0]]), np.zeros((1, 3)))
    ball = BallSphere(EYE[0] + 0.5, EYE[1] + 0.1, 0.1, 0.3)
    light = Lighting(1.0, 0.0, 0.0, 0.05, 0.9)
    out = np.full((rays.shape[1], 3), 60, dtype=np.uint8)
    rows = np.array([UPRIGHT, LOW_ROOF])
    kernels.lay_nets(Nets(rows, COLOR), pixels, crossings, things, eye, ball, light, out)

    samples = (np.arange(12) + 0.5) / 12 - 0.5
    share = np.zeros(rays.shape[1])
    left = np.ones((len(share), 144))
    for k, (a, b) in enumerate((a, b) for a in samples for b in samples):
        bearing = eye.heading_rad + of_pixel[:, 0] + a * math.tau / bearings
        slope = (low + high) / 2 + b * (high - low)
        ray = np.stack([np.cos(bearing), np.sin(bearing), slope], axis=1)
        for row in rows.tolist():
            met, t = meets_cord(row, ray)
            beyond = np.zeros(len(met), dtype=bool)
            for thing in hidden:
                part = slice(first[thing], first[thing + 1])
                beyond[part] = (slope[part] < (0.3 - EYE[2]) / 0.6) & (t[part] > 0.5)
            toward = ray[:, 0] * 0.5 + ray[:, 1] * 0.1
            section = np.sqrt(np.maximum(0.01 - (ray[:, 1] * 0.5 - ray[:, 0] * 0.1) ** 2, 0))
            by_ball = (section > 0) & (toward > 0) & (t > toward)
            beyond |= by_ball & (slope < (0.1 + section - EYE[2]) / np.maximum(toward, 1e-6))
            left[:, k] *= ~(met & ~beyond)
    share = 1 - left.mean(axis=1)
    due = 60 + share[:, None] * (COLOR - 60)
    assert (share > 0.05).sum() > 1000
    assert np.abs(out - due).mean() < 0.5
    assert (np.abs(out - due).max(axis=1) > 25).mean() < 0.004
    before = slice(first[hidden[3]], first[hidden[3]] + 48)
    assert (out[before] == 60).all()
    assert (out[first[5] : first[6]] > 60).any()


def test_outlines_of_nets_hold_their_corners():
    rotation = np.ascontiguousarray(camera_rotation(0.1, -0.1, 0.02))
    eye = ForwardEye(*EYE, rotation, np.zeros(3))
    behind = [-2.0, *UPRIGHT[1:]]
    to = Outlines(np.zeros((6, 10), dtype=np.float32), np.full((6, 3), -1, dtype=np.int32))
    count = outline_nets(Nets(np.array([UPRIGHT, behind, ROOF]), COLOR), eye, 1, to)
    assert count == 3
    assert to.owners[1:3, :2].tolist() == [[NET, 0], [NET, 2]]
    for bounds, row in ((to.bounds[1], UPRIGHT), (to.bounds[2], ROOF)):
        for a in (0.0, 0.5, 1.0):
            for b in (0.0, 1.0):
                point = np.array(row[:3]) + a * row[9] * np.array(row[3:6]) + b * row[10] * np.array(row[6:9]) - EYE
                ahead, left, up = rotation.T @ point
                right, down = -left / ahead, -up / ahead
                assert overlaps(bounds, right - 1e-4, right + 1e-4, down - 1e-4, down + 1e-4)
