"""The verdict by line points alone: predicted lines found against chance, and points off the lines."""

import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import OmniCamera, Tangent
from robocup_vision.geometry import Pose2
from robocup_vision.localization.evidence import LineCounts, default_evidence
from robocup_vision.localization.lines.evidence import LinesAloneEvidence
from robocup_vision.localization.lines.line_map import LineMap
from robocup_vision.perception.line_points import LinePoints

FIELD = load_field("msl_6x4")
CAMERA = OmniCamera((640, 480), (321.0, 238.0), (40.0, 220.0), Tangent(2.1456, 0.0057291))
LIKELIHOODS = default_evidence().lines_alone
TRUTH = Pose2(0.4, -0.3, 1.0)


def counted(on=80.0, near=10.0, elsewhere=10.0, found=155, missed=5, chance=0.3):
    return LIKELIHOODS.log_odds(LineCounts(np.array([on, near, elsewhere]), found, missed, chance))


def test_what_is_found_speaks_for_a_pose_and_what_is_missed_against_it():
    assert counted() > math.log(2)
    assert counted(found=80, missed=80) < counted(found=140, missed=20) < counted()
    assert counted(found=80, missed=80) < 0
    assert counted(elsewhere=200.0) < counted()


def test_where_line_points_lie_all_over_finding_them_says_nothing():
    by_chance = [counted(0.0, 0.0, 0.0, 150, 10, chance) for chance in (0.1, 0.5, 0.9)]
    assert by_chance[0] > by_chance[1] > by_chance[2]
    assert by_chance[2] < math.log(2)


@pytest.fixture(scope="module")
def evidence():
    return LinesAloneEvidence(CAMERA, LineMap(FIELD), LIKELIHOODS, 3.0)


def picture(spacing_m, bare):
    pixels = CAMERA.floor_to_pixel(TRUTH.inverse().transform(FIELD.line_points(spacing_m)))
    return LinePoints.from_pixels(CAMERA, pixels[np.isfinite(pixels).all(axis=1)], bare_floor=np.full((480, 640), bare))


def test_chance_is_what_lines_anywhere_find(evidence):
    every = evidence.see(picture(0.02, True))
    half = evidence.see(picture(0.5, True))
    assert 0.0 < half.chance < every.chance < 0.5
    counts = evidence.counts(TRUTH, every)
    assert counts.missed == 0
    assert counts.found > 100
    assert counts.chance == every.chance


def test_hidden_lines_are_neither_found_nor_missed(evidence):
    seen = evidence.see(picture(0.5, False))
    counts = evidence.counts(TRUTH, seen)
    assert counts.missed == 0
    shown = evidence.counts(TRUTH, evidence.see(picture(0.5, True)))
    assert shown.found == counts.found
    assert shown.missed > 100


def test_without_bare_floor_the_points_alone_decide(evidence):
    bare = picture(0.02, True)
    points = LinePoints(bare.pixels, bare.floor_m, bare.floor_per_px, bare.weight)
    counts = evidence.counts(TRUTH, evidence.see(points))
    assert counts.found == counts.missed == 0
    assert LIKELIHOODS.log_odds(counts) > math.log(2)
