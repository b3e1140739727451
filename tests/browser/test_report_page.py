"""Reports in a real browser: they fit their window, in light and dark; that of `evaluate` shows one reason alone."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.comparison import Evaluation, ImageOutcome, compare, render_comparison
from robocup_vision.evaluation.dataset import Truth, load_dataset
from robocup_vision.evaluation.report import render_report
from robocup_vision.evaluation.scoring import Row, figures, pose_error
from robocup_vision.geometry import Pose2

IMAGES = Path(__file__).parents[2] / "images" / "omni_ssl_2001"

# they start a browser, which takes seconds
pytestmark = [pytest.mark.slow, pytest.mark.browser]


@pytest.fixture
def report(tmp_path):
    """Write a report on images with long names and long reasons; return its path."""
    truth = Truth(0.5, 0.2, 0.1)
    estimate = PoseEstimate(Pose2(0.51, 0.2, 0.1), np.eye(3) * 1e-4, 0.9, 0.5)
    found = [
        Row(f"{number:04d}.png", estimate, truth, pose_error(estimate, truth, symmetric=True), 0.004)
        for number in range(3)
    ]
    far = "the pose that fits best is 12.3 standard deviations from the one that odometry and the last frame lead to"
    lost = [
        Row("a_folder_of_the_cup/second_half_of_the_final/camera_front_left_000123.png", truth=truth, reason=far),
        Row("0004.png", truth=truth, time_s=0.002, reason="too dark: brightness 1.5"),
        Row("0005.png", truth=truth, time_s=0.002, reason="too dark: brightness 2.5"),
    ]
    rows = [*found, *lost]
    jpeg = cv2.imencode(".jpg", np.full((220, 512, 3), 120, np.uint8))[1].tobytes()
    spread = dict.fromkeys(range(3), jpeg)
    worst = [(index, jpeg) for index in range(3, 6)]
    path = tmp_path / "report.html"
    path.write_text(
        render_report(load_dataset(IMAGES), rows, figures(rows), ["two files are no images"], spread, worst),
        encoding="utf-8",
    )
    return path


def fits_its_window(node, page, tmp_path):
    """Check a page in windows of three widths; return what the browser tells of it."""
    done = node("report_page.mjs", page, tmp_path)
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout.splitlines()[-1])
    assert told["errors"] == told["console"] == []
    assert set(told["widths"]) == {"390", "1280", "1920"}
    for width, seen in told["widths"].items():
        assert seen["boxes"] > 100
        assert seen["overlaps"] == [], width
        assert seen["beyond"] == [], width
        assert seen["document_px"] <= int(width)
    return told


def test_a_report_fits_its_window_and_filters_by_reason(node, report, tmp_path):
    """Only this finds a report that a browser draws overlapping, and a filter that hides the wrong images."""
    told = fits_its_window(node, report, tmp_path)
    (ink, paper), (dark_ink, dark_paper) = told["light"], told["dark"]
    assert ink + 300 < paper
    assert dark_paper + 300 < dark_ink

    assert len(told["all"]) == 6
    assert told["by_reason"].pop("") == told["all"]
    assert told["by_reason"].pop("too dark: brightness …") == ["0004.png", "0005.png"]
    assert [len(images) for images in told["by_reason"].values()] == [1]


def test_a_comparison_fits_its_window(node, tmp_path):
    """Only this finds a comparison whose long names and reasons overlap."""
    names = (
        "out/the_last_evening_of_the_cup/with_the_old_colour_file",
        "out/the_last_evening_of_the_cup/with_the_new_one",
    )
    keys = (
        "located",
        "within_5cm_3deg",
        "within_10cm_5deg",
        "median_error_m",
        "rms_theta_rad",
        "nees_mean",
        "median_ms",
    )
    summary = {"method": "edges", "images": 12, **dict.fromkeys(keys, 0.5)}
    far = "the pose that fits best is 12.3 standard deviations from the one that odometry and the last frame lead to"
    outcomes = [
        ImageOutcome("located", 0.01, 2.0, ""),
        ImageOutcome("wrong", 3.0, 2.0, ""),
        ImageOutcome("refused", None, 2.0, far),
    ]
    images = [f"second_half_of_the_final/camera_front_left_{number:06}.png" for number in range(9)]
    first, second = (
        Evaluation(name, summary, {image: outcomes[of(number)] for number, image in enumerate(images)})
        for name, of in zip(names, (lambda number: number % 3, lambda number: number // 3), strict=True)
    )
    for image in images:
        path = tmp_path / image
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(cv2.imencode(".png", np.full((220, 256, 3), 120, np.uint8))[1].tobytes())
    path = tmp_path / "comparison.html"
    path.write_text(render_comparison(compare(first, second), tmp_path), encoding="utf-8")
    fits_its_window(node, path, tmp_path)
