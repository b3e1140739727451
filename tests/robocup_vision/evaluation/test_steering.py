"""Each frame of a dataset is steered by: steering.csv, and what an interrupted run keeps of it."""

import csv
import math
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from field_models import FileError
from robocup_vision.evaluation.dataset import FrameTime, load_dataset
from robocup_vision.evaluation.result_files import STEERING_COLUMNS
from robocup_vision.evaluation.run import evaluate
from robocup_vision.evaluation.steering import SteerPlan
from robocup_vision.geometry import Pose2
from robocup_vision.motion_limits import MotionLimits
from robocup_vision.perception.free_space import FreeSpace

pytestmark = pytest.mark.usefixtures("without_plots")


def free_space(*ranges_m: float) -> FreeSpace:
    return FreeSpace(np.arange(len(ranges_m)) * (math.tau / len(ranges_m)), np.array(ranges_m))


def test_each_frame_is_steered_by(folder: Path, fake: ModuleType, tmp_path: Path) -> None:
    class Looking(fake.FakeVision):
        def look(self, frame, t_s=None, odometry=None):
            view = super().look(frame, t_s, odometry)
            near_m = 0.2 if len(self.calls) == 3 else 3.0
            view.free_space = free_space(near_m, *[3.0] * 35)
            return view

    dataset, out = load_dataset(folder), tmp_path / "out"
    (folder / "images" / "1.png").write_bytes(b"")
    times = {name: FrameTime(0.1 * index, Pose2(0.02, 0.0, 0.5)) for index, name in enumerate(dataset.image_names)}
    dataset = replace(dataset, times=times)
    plan = SteerPlan(0.09, MotionLimits(0.4, 0.3))
    summary = evaluate(dataset, out, make_vision=Looking, draw_overlay=fake.draw, steering=plan)
    assert summary.steering is not None
    assert (summary.steering.commands, summary.steering.safe) == (4, 4)
    with (out / "steering.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert tuple(rows[0]) == STEERING_COLUMNS
    assert [row["image"] for row in rows] == list(dataset.image_names)
    assert set(rows[1].values()) == {"1.png", ""}
    assert [row["reason"] for row in rows[:4]] == ["towards target", "", "towards target", "around obstacle"]
    # 2 cm ahead in 0.1 s, seen from a robot that has turned since; over the two steps to the frame after the lost one
    assert float(rows[3]["velocity_x_mps"]) == pytest.approx(0.2 * math.cos(0.5))
    assert float(rows[3]["velocity_y_mps"]) == pytest.approx(-0.2 * math.sin(0.5))
    assert float(rows[2]["velocity_x_mps"]) == pytest.approx(0.1 * (math.cos(1.0) + math.cos(0.5)))
    assert rows[0]["velocity_x_mps"] == "0"
    assert all(float(row["ms"]) > 0 for row in rows if row["ms"])


@pytest.mark.slow
def test_commands_of_an_interrupted_run_are_kept(folder: Path, fake: ModuleType, tmp_path: Path, scored) -> None:
    """Only this finds commands that an interrupted run loses, or mixes with those of another robot."""

    class Looking(fake.FakeVision):
        stops = True

        def look(self, frame, t_s=None, odometry=None):
            if self.stops and len(self.calls) == 7:
                raise KeyboardInterrupt
            view = super().look(frame, t_s, odometry)
            view.free_space = free_space(*[3.0] * 36)
            return view

    dataset, plan = load_dataset(folder), SteerPlan(0.09, MotionLimits(0.4, 0.3))
    with pytest.raises(KeyboardInterrupt, match="3 of 5 images"):
        scored(dataset, make_vision=Looking, steering=plan)
    Looking.stops = False
    with pytest.raises(FileError, match="is of another run: steering was"):
        scored(dataset, make_vision=Looking, resume=True)
    for out, resume in (("out", True), ("whole", False)):
        scored(dataset, out, make_vision=Looking, steering=plan, resume=resume)
    tables = []
    for out in ("out", "whole"):
        with (tmp_path / out / "steering.csv").open(newline="") as stream:
            tables.append([{**row, "ms": ""} for row in csv.DictReader(stream)])
    assert tables[0] == tables[1]
    assert len(tables[0]) == 5
