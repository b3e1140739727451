"""What a report shows of cameras placed by a goal; and a dataset of such a camera from its folder to the report."""

import csv
import dataclasses
import math

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import PinholeCamera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.evaluation.dataset import Truth, load_dataset
from robocup_vision.evaluation.plots import draw_goal_plots, error_ratio
from robocup_vision.evaluation.run import evaluate
from robocup_vision.evaluation.scoring import Row, pose_error
from robocup_vision.geometry import Pose2
from sim2d.rendering.dataset import write_dataset
from sim2d.rendering.goal.scenes import GOAL_CONDITIONS, paper_places, sample_goal


def row(truth, x_m, y_m, theta_rad=0.0):
    estimate = PoseEstimate(Pose2(x_m, y_m, theta_rad), np.eye(3) * 1e-4, 0.9, 0.5)
    return Row("a.png", estimate, truth, pose_error(estimate, truth, symmetric=False), 0.004)


@pytest.mark.parametrize(("theta_rad", "goal_x_m"), [(0.1, 2.7), (math.pi - 0.1, -2.7), (None, 2.7)])
def test_errors_are_ratios_of_the_distance_to_the_goal_in_view(theta_rad, goal_x_m):
    field = load_field("four_legged_2007")
    truth = Truth(0.7, 1.0, theta_rad)
    distance = math.hypot(goal_x_m - 0.7, 1.0)
    assert error_ratio(field, row(truth, 0.7, 1.3)) == pytest.approx(0.3 / distance)


def test_without_an_error_there_is_no_ratio_and_no_plot():
    field = load_field("four_legged_2007")
    lost = Row("b.png", truth=Truth(0.0, 0.0, 0.0), reason="no goal")
    assert error_ratio(field, lost) is None
    assert draw_goal_plots(field, [lost]) == []
    bare = dataclasses.replace(field, goals=())
    assert error_ratio(bare, row(Truth(0.0, 0.0, 0.0), 0.1, 0.0)) is None
    plots = draw_goal_plots(field, [lost, row(Truth(1.0, 0.5, 0.0), 1.02, 0.5)])
    assert [source[:22] for source, _ in plots] == ["data:image/png;base64,"] * 2


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    field, condition = load_field("four_legged_2007"), GOAL_CONDITIONS["clean_208x160"]
    out = tmp_path_factory.mktemp("goal") / "set"
    samples = sample_goal(field, condition, 0, 4, places=paper_places(field)[16:])
    write_dataset(out, "four_legged_2007", condition.camera, samples)
    return out


@pytest.mark.slow
def test_a_pinhole_dataset_is_evaluated_by_the_goal(folder, tmp_path):
    """Only this finds plots over the goal's distance that a dataset of goals does not get."""
    dataset = load_dataset(folder)
    assert isinstance(dataset.camera, PinholeCamera)
    assert dataset.method == "goal"
    summary = evaluate(dataset, tmp_path)
    assert summary.problem is None
    assert summary.figures.located >= 3
    assert summary.figures.median_error_m < 0.2
    with (tmp_path / "results.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == 4
    page = summary.report.read_text()
    assert page.count("data:image/png") == 5
    assert not any(note.startswith("overlays") for note in summary.notes)
