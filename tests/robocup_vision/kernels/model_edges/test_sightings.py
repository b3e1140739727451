"""Beacons and posts in a picture, and the poses that they propose."""

import math

import numpy as np
import pytest

from field_models import COLOR_NAMES, load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.lens_table import lens_table
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.model_edges.find import BINS, upright_bins
from robocup_vision.kernels.model_edges.sightings import NOD_RAD, SIGHT, Horizon, poses_around, sightings
from robocup_vision.localization.model_edges.bank import prepare_bank, prepare_uprights

FIELD = load_field("four_legged_2007")
HALF_M = (FIELD.length_m / 2 + 0.2, FIELD.width_m / 2 + 0.2)
CAMERA = PinholeCamera(
    (208, 160), (192.0, 192.0), (103.5, 79.5), 0.185, pan_rad=0.0, tilt_rad=-0.17, roll_rad=0.0, roll_std_rad=0.02
)
BANK = prepare_bank(FIELD, CAMERA, 0.8, 0.5)
UPRIGHTS = prepare_uprights(FIELD, BANK)
HORIZON = Horizon(79.5 - 192.0 * math.tan(0.17), 0.185, NOD_RAD * 192.0)


def drawn(pose, nod_px=0):
    """Picture of the beacons and posts of the field as upright rectangles, and its paints by bearing."""
    image = np.full((160, 208, 3), (50, 110, 45), dtype=np.uint8)
    image[: int(HORIZON.row) + nod_px] = 120
    things = [(b.x_m, b.y_m, b.radius_m, b.height_m, b.colors) for b in FIELD.beacons]
    for goal in FIELD.goals:
        for side in (-1, 1):
            top_m = goal.height_m + goal.post_radius_m
            things.append((goal.line_x_m, side * goal.width_m / 2, goal.post_radius_m, top_m, (goal.color,)))
    for x, y, radius, height_m, colors in things:
        ahead, left = pose.inverse().transform(np.array([[x, y]]))[0]
        if ahead < 0.2:
            continue
        u, half = 103.5 - 192.0 * left / ahead, 192.0 * radius / math.hypot(ahead, left)
        columns = slice(max(round(u - half), 0), max(round(u + half), 0))
        rows = [
            max(round(HORIZON.row + nod_px + 192.0 * (0.185 - z) / ahead), 0)
            for z in np.linspace(0.0, height_m, len(colors) + 1)
        ]
        for foot, head, name in zip(rows[:-1], rows[1:], colors, strict=True):
            image[head:foot, columns] = COLOR_NAMES[name]
    seen = np.zeros((len(BANK.paints), BINS + 1))
    upright_bins(image, lens_table(CAMERA), HORIZON.row, BANK.paints, BANK.half_view_rad, seen)
    return image, seen


def found(image, seen):
    out = np.zeros((12, SIGHT))
    count = sightings(image, lens_table(CAMERA), HORIZON, seen, BANK.half_view_rad, UPRIGHTS, out)
    return out[:count]


POSES = [
    Pose2(0.2, 0.6, 0.85),
    Pose2(-0.9, 1.2, 2.1),
    Pose2(1.0, 0.1, 0.0),
    Pose2(-2.0, -0.3, 3.1),
    Pose2(2.2, -0.2, -0.5),
]


@pytest.mark.parametrize("nod_px", [-5, 0, 5])
def test_a_beacon_is_seen_where_and_as_large_as_it_is(nod_px):
    pose, beacon = POSES[0], FIELD.beacons[0]
    image, seen = drawn(pose, nod_px)
    [row] = [row for row in found(image, seen) if row[7] > 4.0]
    ahead, left = pose.inverse().transform(np.array([[beacon.x_m, beacon.y_m]]))[0]
    assert tuple(row[:4]) == (beacon.x_m, beacon.y_m) * 2
    assert row[4] == pytest.approx(math.atan2(left, ahead), abs=2.0 / 192.0)
    assert row[6] == pytest.approx(192.0 * 2 / 3 * beacon.height_m / ahead, abs=1.5)


def around(sights, room=1000):
    poses = np.empty((room, 3))
    return poses[: poses_around(sights, 192.0, HALF_M, 0.2, poses)]


def plain_around(sights):
    proposed = [np.empty((0, 3))]
    for row in sights:
        away_m = row[5] * 192.0 / (row[6] * math.cos(row[4]))
        angle = np.linspace(0.0, math.tau, max(8, math.ceil(math.tau * away_m / 0.2)), endpoint=False)
        for x, y in dict.fromkeys([(row[0], row[1]), (row[2], row[3])]):
            there = np.column_stack([x + away_m * np.cos(angle), y + away_m * np.sin(angle), angle + math.pi - row[4]])
            proposed.append(there[(np.abs(there[:, :2]) < HALF_M).all(axis=1)])
    return np.concatenate(proposed)


@pytest.mark.parametrize("pose", POSES)
def test_what_is_seen_proposes_a_pose_near_the_true_one(pose):
    image, seen = drawn(pose)
    proposed = around(found(image, seen))
    np.testing.assert_allclose(proposed, plain_around(found(image, seen)), atol=1e-9)
    np.testing.assert_array_equal(around(found(image, seen), 5), proposed[:5])
    away = np.hypot(proposed[:, 0] - pose.x_m, proposed[:, 1] - pose.y_m)
    turn = np.abs([math.remainder(theta - pose.theta_rad, math.tau) for theta in proposed[:, 2]])
    assert ((away < 0.25) & (turn < math.radians(8.0))).any()
    assert (np.abs(proposed[:, :2]) <= HALF_M).all()


def test_nothing_is_proposed_where_nothing_is_seen():
    assert len(around(np.zeros((0, SIGHT)))) == 0
    white = load_field("spl_2020")
    assert len(prepare_uprights(white, prepare_bank(white, CAMERA, 2.0, 1.0)).paint) == 0
