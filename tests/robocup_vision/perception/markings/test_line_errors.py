"""What is said of the errors of lines, circles and crossings, against pictures of which the truth is known."""

from __future__ import annotations

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.perception.line_points import LinePoints
from robocup_vision.perception.markings.correlated_errors import FloorErrors, common_covariance, common_error_px
from robocup_vision.perception.markings.field_features import FieldFeatures
from robocup_vision.perception.markings.finder import MarkingFinder
from robocup_vision.perception.markings.straight import middle_shifts_m, stretch_of

CAMERA = PinholeCamera(
    (640, 480), (460.0, 460.0), (319.5, 239.5), 0.5, pan_rad=0.0, tilt_rad=-0.45, roll_rad=0.0, height_std_m=0.004
)
KNOWN = np.diag([0.0005, 0.0005, 0.0005, 0.0]) ** 2


def test_the_middle_of_a_near_wide_line_is_found_by_its_edges():
    middle = np.stack([np.full(9, 0.9), np.linspace(-0.4, 0.4, 9)], axis=1)
    normals = np.tile([1.0, 0.0], (9, 1))
    edges = [CAMERA.floor_to_pixel(middle + sign * 0.05 * normals) for sign in (1, -1)]
    midway = CAMERA.pixel_to_floor(np.mean(edges, axis=0))
    off = (midway - middle)[:, 0]
    assert (np.abs(off) > 0.5e-3).all()
    again = (midway - middle_shifts_m(CAMERA, midway, normals, 0.1) - middle)[:, 0]
    assert (np.abs(again) < 0.1 * np.abs(off)).all()


@pytest.mark.parametrize("common_px", [0.0, 0.3])
def test_the_common_error_of_neighbouring_points_shows_in_how_lines_bend(common_px):
    rng = np.random.default_rng(3)
    u, errors = np.arange(40.0, 600.0), []
    for row in (200.0, 280.0, 360.0):
        v = row + 0.15 * rng.standard_normal(len(u)) + common_px * np.repeat(rng.standard_normal(24), 24)[: len(u)]
        errors.append(np.stack([u, v], axis=1))
    points = LinePoints.from_pixels(CAMERA, np.concatenate(errors), np.ones(3 * len(u)), None)
    lines = [stretch_of(points, np.arange(k * len(u), (k + 1) * len(u)), 0.0) for k in range(3)]
    estimated_px = common_error_px(points, lines)
    if common_px:
        assert 0.5 * common_px < estimated_px < 1.5 * common_px
    else:
        assert estimated_px < 0.06


def test_errors_alike_move_a_mean_and_errors_of_squares_average_out():
    pixels = np.stack([np.arange(0.0, 2400.0), np.full(2400, 50.0)], axis=1)
    mean = np.full((1, 2400), 1 / 2400)
    assert common_covariance(mean, pixels, 0.2)[0, 0] == pytest.approx(0.2**2 * (1 + 1 / 100))


def test_errors_of_tilt_and_height_that_cancel_move_the_floor_less():
    at = np.array([[320.0, 300.0]])
    both = np.diag([0.01, 1e-6, 0.01, 0.0]) ** 2
    alike = both.copy()
    # up with the head and up with the body
    alike[0, 2] = alike[2, 0] = -0.95 * 0.01 * 0.01
    opposite = both.copy()
    opposite[0, 2] = opposite[2, 0] = 0.95 * 0.01 * 0.01

    def spread(covariance):
        shifts = FloorErrors.of(CAMERA, covariance).shifts_m(at)[0]
        return float(np.trace(shifts @ shifts.T))

    apart = spread(both)
    assert min(spread(alike), spread(opposite)) < 0.5 * apart < apart < max(spread(alike), spread(opposite))


def test_a_pan_that_is_known_so_well_moves_all_sideways():
    panned = CAMERA.held_as(PinholeCamera((640, 480), (460.0, 460.0), (319.5, 239.5), 0.5, pan_std_rad=0.02))
    panned = panned.with_orientation(0.0, -0.45, 0.0)
    estimated_px = np.diag([1e-9, 1e-9, 1e-9, 0.0]) ** 2
    ahead, left = FloorErrors.of(panned, estimated_px).shifts_m(np.array([319.5, 239.5]))
    away = float(CAMERA.pixel_to_floor(np.array([319.5, 239.5]))[0])
    assert np.linalg.norm(left) == pytest.approx(0.02 * away, rel=1e-3)
    assert np.linalg.norm(ahead) < 1e-3


@pytest.mark.slow
def test_of_a_camera_known_well_the_errors_told_are_those_made(paint_field):
    """Only this finds errors of lines or crossings that are not as large as is told of them."""
    field, rng = load_field("humanoid_kid_2025"), np.random.default_rng(5)
    finder, features = MarkingFinder(field), FieldFeatures(load_field("humanoid_kid_2025"))
    lines, spots = [], []
    for x, y, heading in ((2.0, 1.0, 0.4), (3.2, -1.5, -0.5), (-0.8, 0.5, 0.2), (1.5, 2.2, 0.9), (0.9, -0.7, 2.6)):
        pose = Pose2(x, y, heading)
        tilt, roll, height = 0.0005 * rng.standard_normal(3)
        held = CAMERA.as_fitted(CAMERA.tilt_rad + tilt, roll, CAMERA.height_m + height, CAMERA.focal_px)
        frame = paint_field(held, field, pose, noise=3.0, rng=rng)
        found = finder.find(frame, CAMERA, NotLocated("alone"), KNOWN)
        for one in found.segments:
            squared = []
            for ends in field.lines.reshape(-1, 2, 2):
                start, end = pose.inverse().transform(ends)
                way = (end - start) / np.hypot(*(end - start))
                turn = math.remainder(math.atan2(-way[0], way[1]) - one.angle_rad, math.pi)
                normal = np.array([math.cos(one.angle_rad + turn), math.sin(one.angle_rad + turn)])
                error = np.array([turn, normal @ start - one.distance_m])
                squared.append(error @ np.linalg.solve(one.covariance, error))
            lines.append(min(squared) / 2)
        for one in found.crossings:
            error = pose.inverse().transform(features.crossings_m) - (one.x_m, one.y_m)
            spots.append(np.einsum("ni,ij,nj->n", error, np.linalg.inv(one.covariance), error).min() / 2)
    assert len(lines) >= 15
    assert len(spots) >= 5
    assert 0.3 < np.mean(lines) < 3.0
    assert 0.2 < np.mean(spots) < 4.0
