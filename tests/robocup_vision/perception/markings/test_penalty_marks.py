"""Penalty marks in pictures with known truth: crosses and dots, without a pose and with, and what is none."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.field import Mark
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.markings.finder import MarkingFinder

AHEAD = PinholeCamera(
    (480, 360), (380.0, 380.0), (239.5, 179.5), 0.5, pan_rad=0.0, tilt_rad=-0.4, roll_rad=0.0, height_std_m=0.003
)
PLACES = ((1.9, 0.2, 0.0), (2.5, -1.2, 1.1), (4.2, 0.3, -2.9))
KNOWN = np.diag([2e-4, 2e-4, 2e-4, 0.0]) ** 2


def marked(kind):
    """Return a field with marks of a kind, and the same for a painter that knows lines and arcs only."""
    field = replace(load_field("spl_2020"), marks=(Mark(3.2, 0.0, kind, 0.1), Mark(-3.2, 0.0, kind, 0.1)))
    return field, replace(field, lines=field.painted_lines, arcs=field.painted_arcs)


@pytest.mark.parametrize("kind", ["cross", pytest.param("dot", marks=pytest.mark.slow)])
def test_a_penalty_mark_is_found_and_its_error_is_told(paint_field, kind):
    """The dot alone finds a search that needs strokes."""
    field, painted = marked(kind)
    finder, rng, squared = MarkingFinder(field), np.random.default_rng(2), []
    for x, y, heading in PLACES:
        pose = Pose2(x, y, heading)
        frame = paint_field(AHEAD, painted, pose, noise=3.0, rng=rng)
        alone = finder.find(frame, AHEAD, held_covariance=KNOWN)
        (mark,) = alone.penalty_marks
        assert mark.feature_m is None
        error = pose.inverse().transform((3.2, 0.0)) - (mark.x_m, mark.y_m)
        assert np.hypot(*error) < 0.005
        squared.append(error @ np.linalg.solve(mark.covariance, error) / 2)
        estimate = PoseEstimate(pose, np.diag([1e-4, 1e-4, 1e-4]), 1.0, 0.0)
        (named,) = finder.find(frame, AHEAD, estimate, KNOWN).penalty_marks
        assert named.feature_m == (field.marks[0].x_m, 0.0)
        assert (named.x_m, named.y_m) == (mark.x_m, mark.y_m)
    assert np.mean(squared) < 4.0


@pytest.mark.parametrize("what", ["nothing", "a ball", "a robot's foot", "a large dot"])
def test_what_is_no_penalty_mark_is_not_told(paint_field, what):
    """Neither bare carpet, nor what stands up or is dark, nor a spot of another size."""
    field, _ = marked("dot")
    pose = Pose2(1.4, 0.2, 0.0)
    frame = paint_field(AHEAD, field, pose, noise=3.0, rng=np.random.default_rng(6))
    u, v = AHEAD.floor_to_pixel(pose.inverse().transform((3.2, 0.0))).tolist()
    px_per_m = AHEAD.focal_px[0] / np.hypot(1.8, AHEAD.height_m)
    radius = round(0.05 * px_per_m)
    at = round(u), round(v)
    if what == "a ball":
        cv2.circle(frame, (at[0], at[1] - radius), radius, (230, 230, 230), -1, cv2.LINE_AA)
    elif what == "a robot's foot":
        cv2.ellipse(frame, at, (radius, radius // 3), 0.0, 0.0, 360.0, (20, 20, 20), -1, cv2.LINE_AA)
    elif what == "a large dot":
        cv2.ellipse(frame, at, (3 * radius, radius), 0.0, 0.0, 360.0, (230, 230, 230), -1, cv2.LINE_AA)
    assert MarkingFinder(field).find(frame, AHEAD, NotLocated("alone")).penalty_marks == ()


def test_a_field_without_marks_has_none(paint_field):
    field, painted = marked("cross")
    frame = paint_field(AHEAD, painted, Pose2(1.9, 0.2, 0.0), noise=3.0, rng=np.random.default_rng(8))
    assert MarkingFinder(replace(field, marks=())).find(frame, AHEAD).penalty_marks == ()
