"""A pose by the floor's outline is doubted where the lines in view do not bear it out."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from robocup_vision import Vision
from robocup_vision.geometry import Pose2
from robocup_vision.kernels.floor.free_floor import FLOOR
from robocup_vision.localization.line_support import LineSupport, LineSupportSettings
from robocup_vision.localization.lines.pose_estimator import LinePoseEstimator
from sim2d.rendering.cameras import sekimori_camera

NEGATIVES = Path(__file__).resolve().parents[4] / "shared" / "real" / "negatives" / "images"


@pytest.fixture(scope="module")
def seen(ssl_field, paper_camera, nominal_samples):
    vision = Vision(ssl_field, paper_camera)
    shown = [(one, vision.look(one.frame)) for one in nominal_samples[:4]]
    return vision, [(one, view) for one, view in shown if view.pose]


def support(field, camera, view, **settings):
    lines = LinePoseEstimator(field, camera)
    return LineSupport(lines.line_map, lines.finder.find, view, LineSupportSettings(**settings))


def test_lines_bear_out_the_right_pose_and_no_other(ssl_field, paper_camera, seen):
    vision, frames = seen
    assert len(frames) >= 3
    for by in ({}, {"min_samples": 10**6}):
        check = support(ssl_field, paper_camera, vision.polar, sure_inlier_ratio=2.0, **by)
        for one, view in frames:
            assert check.supports(view.pose, one.frame, view.marks)
            wrong = replace(view.pose, inlier_ratio=0.5).seen_from(Pose2(0.15, 0.2, 0.5))
            assert not check.supports(wrong, one.frame, view.marks)


def test_an_outline_that_agrees_all_around_needs_no_lines(ssl_field, paper_camera, seen):
    vision, frames = seen
    one, view = frames[0]
    check = support(ssl_field, paper_camera, vision.polar)
    sure = replace(view.pose, inlier_ratio=0.9)
    assert check.supports(sure, np.zeros_like(one.frame), np.zeros_like(view.marks))
    # where robots hide all lines nothing speaks against it, unless hardly any of the outline agrees either
    doubtful, dark = replace(view.pose, inlier_ratio=0.5), np.zeros_like(one.frame)
    assert check.supports(doubtful, dark, np.zeros_like(view.marks))
    assert not check.supports(replace(view.pose, inlier_ratio=0.3), dark, np.zeros_like(view.marks))
    # plain floor where the pose puts lines speaks against it: the centre line passes near the robot
    at_center = replace(doubtful, pose=Pose2(0.0, 0.2, 0.0), candidates=())
    assert check.supports(at_center, dark, np.zeros_like(view.marks))
    assert not check.supports(at_center, dark, np.full_like(view.marks, FLOOR))


@pytest.mark.skipif(not NEGATIVES.is_dir(), reason="the photographs are not installed")
@pytest.mark.slow
@pytest.mark.parametrize("prior", [True, False])
def test_photographs_of_other_things_show_no_field(prior):
    field, camera = load_field("ssl_2001"), sekimori_camera()
    vision, rng = Vision(field, camera), np.random.default_rng(8)
    located = []
    for path in sorted(NEGATIVES.iterdir()):
        frame = cv2.resize(cv2.imread(str(path)), camera.size_px, interpolation=cv2.INTER_AREA)
        vision.forget()
        near = Pose2(*rng.uniform((-1.2, -0.6), (1.2, 0.6)), rng.uniform(-3, 3)) if prior else None
        if vision.look(frame, prior=near).pose:
            located.append(path.name)
    assert located == []
