"""A run writes what the formats say, loses no image, and does not depend on the number of processes."""

import csv
import json
import math
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace

import cv2
import numpy as np
import pytest

from field_models import ArgumentError, FileError
from robocup_vision import Vision
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.evaluation import report
from robocup_vision.evaluation.dataset import FrameTime, Truth, load_dataset
from robocup_vision.evaluation.result_files import RESULT_COLUMNS
from robocup_vision.evaluation.run import evaluate, make_vision_with_memory
from robocup_vision.geometry import Pose2

pytestmark = pytest.mark.usefixtures("without_plots")


def read_rows(out: Path) -> list[dict[str, str]]:
    with (out / "results.csv").open(newline="") as stream:
        return list(csv.DictReader(stream))


def code(path: Path, kind: int) -> None:
    image = cv2.imread(str(path))
    image[0, 3] = kind
    cv2.imwrite(str(path), image)


def test_the_files_of_a_run(folder: Path, tmp_path: Path, scored) -> None:
    summary = scored(load_dataset(folder))
    assert summary.problem is None
    header = (tmp_path / "out" / "results.csv").read_text().splitlines()[0]
    assert header == (
        "image,status,x_m,y_m,theta_rad,std_x_m,std_y_m,std_theta_rad,candidates,inliers,residual_px,ms,error_m,"
        "error_rad,reason"
    )
    assert header == ",".join(RESULT_COLUMNS)
    rows = read_rows(tmp_path / "out")
    assert [row["image"] for row in rows] == [f"{i}.png" for i in range(5)]
    assert {row["status"] for row in rows} == {"located"}
    assert [float(row["x_m"]) for row in rows] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert [float(row["error_m"]) for row in rows] == pytest.approx([0.01] * 5)
    assert [row["error_rad"] for row in rows] == ["0", "0", "0", "0", ""]
    assert (rows[0]["std_x_m"], rows[0]["candidates"], rows[0]["inliers"], rows[0]["residual_px"]) == (
        "0.01", "2", "0.9", "0.5",
    )  # fmt: skip

    figures = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert list(figures) == [
        "method", "images", "left_out", "with_truth", "located", "within_5cm_3deg", "within_10cm_5deg",
        "median_error_m", "rms_x_m", "rms_y_m", "rms_theta_rad", "nees_mean", "median_ms", "detections",
    ]  # fmt: skip
    assert (figures["images"], figures["located"], figures["within_5cm_3deg"]) == (5, 5, 0.8)
    assert figures["method"] == "field"
    assert figures["nees_mean"] == pytest.approx(1.0)
    assert figures["detections"] is None

    lines = (tmp_path / "out" / "trajectory.tum").read_text().splitlines()
    values = np.array([[float(word) for word in line.split()] for line in lines])
    assert values.shape == (5, 8)
    assert values[:, 0].tolist() == [0, 1, 2, 3, 4]
    assert 2 * math.atan2(values[3, 6], values[3, 7]) == pytest.approx(float(rows[3]["theta_rad"]))
    assert summary.report == tmp_path / "out" / "report.html"
    assert not summary.is_sequence
    page = summary.report.read_text()
    assert page.count("data:image/jpeg;base64,") == 5
    assert "per frame (median), single images, nothing carried on between them" in page


def test_nothing_is_dropped(folder: Path, tmp_path: Path, scored) -> None:
    images = folder / "images"
    code(images / "0.png", 1)
    code(images / "1.png", 2)
    code(images / "2.png", 3)
    (images / "3.png").write_bytes((images / "3.png").read_bytes()[:-20])
    summary = scored(load_dataset(folder))
    rows = read_rows(tmp_path / "out")
    assert [row["status"] for row in rows] == ["not_located"] * 3 + ["unreadable", "located"]
    assert [row["reason"] for row in rows] == [
        "too dark to see",
        "internal error: RuntimeError: a bug, in two lines",
        "internal error: ValueError: the estimate is not finite or has a negative variance",
        "is a truncated or damaged PNG (Truncated File Read)",
        "",
    ]
    assert rows[3]["ms"] == ""
    assert all(rows[0][key] == "" for key in ("x_m", "std_theta_rad", "candidates", "error_m", "error_rad"))
    assert float(rows[0]["ms"]) >= 0
    assert summary.problem == (
        "3 of 5 images failed, the first: 1.png: internal error: RuntimeError: a bug, in two lines"
    )
    figures = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (figures["images"], figures["located"], figures["within_10cm_5deg"]) == (5, 1, 0.0)
    trajectory = (tmp_path / "out" / "trajectory.tum").read_text().split()
    assert trajectory[0] == "4.0"
    page = (tmp_path / "out" / "report.html").read_text()
    assert "too dark to see" in page
    assert page.count("data:image/jpeg;base64,") == 4  # the torn image has no picture


@pytest.mark.slow
def test_a_localiser_may_know_no_symmetry(folder: Path, tmp_path: Path, scored) -> None:
    """Only this finds a half turn that is forgiven on a field that has none."""
    text = (folder / "truth.csv").read_text().replace("0.png,-0.01,-0.08,0.0", f"0.png,0.01,0.08,{math.pi}")
    (folder / "truth.csv").write_text(text)
    turned = scored(load_dataset(folder), "a")
    assert turned.rows[0].error is not None
    assert turned.rows[0].error.within(0.05, 0.05)
    assert float(read_rows(tmp_path / "a")[0]["y_m"]) == pytest.approx(-0.08)  # the first candidate, never turned
    (folder / "dataset.toml").write_text((folder / "dataset.toml").read_text().replace('"point"', '"none"'))
    strict = scored(load_dataset(folder), "b")
    assert strict.rows[0].error is not None
    assert strict.rows[0].error.position_m == pytest.approx(0.16, abs=0.01)


def test_each_image_stands_alone(folder: Path, fake: ModuleType, scored) -> None:
    made = []
    scored(load_dataset(folder), make_vision=lambda d: made.append(fake.FakeVision(d)) or made[0])
    assert made[0].calls == [("forget",), ("look", None, None)] * 5


def test_a_sequence_hands_on_time_and_odometry(folder: Path, fake: ModuleType, tmp_path: Path, scored) -> None:
    with (folder / "dataset.toml").open("a") as stream:
        stream.write('frames = "frames.csv"\n')
    rows = ["0.png,10,,,", "1.png,11,0.1,0,1", "2.png,12,0.2,0,0", "3.png,13.5,0.3,0,0", "4.png,14,0.4,0,0"]
    (folder / "frames.csv").write_text("\n".join(["image,t_s,dx_m,dy_m,dtheta_rad", *rows]) + "\n")
    (folder / "images" / "1.png").write_bytes(b"")
    code(folder / "images" / "3.png", 2)
    made = []
    summary = scored(load_dataset(folder), "out", 2, make_vision=lambda d: made.append(fake.FakeVision(d)) or made[0])
    assert summary.notes == ("a sequence runs in order in one process: --jobs and --dask are ignored",)
    assert made[0].calls == [
        ("look", 10.0, None),
        ("look", 12.0, Pose2(0.1, 0, 1).compose(Pose2(0.2, 0, 0))),  # over the frame that could not be read
        ("look", 13.5, Pose2(0.3, 0, 0)),
        ("forget",),  # after a bug
        ("look", 14.0, Pose2(0.4, 0, 0)),
    ]
    lines = (tmp_path / "out" / "trajectory.tum").read_text().splitlines()
    assert [float(line.split()[0]) for line in lines] == [10.0, 12.0, 14.0]


def without_times(out: Path) -> list[dict[str, str]]:
    return [{**row, "ms": ""} for row in read_rows(out)]


@pytest.mark.slow
def test_the_results_do_not_depend_on_jobs(folder: Path, tmp_path: Path, scored) -> None:
    """Only this finds a report or trajectory whose order depends on who finished first."""
    for index in range(5, 30):
        (folder / "images" / f"{index}.png").write_bytes((folder / "images" / f"{index % 5}.png").read_bytes())
        code(folder / "images" / f"{index}.png", index % 3)
    (folder / "images" / "7.png").write_bytes(b"")
    dataset = load_dataset(folder)
    for jobs in (1, 2):
        scored(dataset, str(jobs), jobs)
    assert without_times(tmp_path / "1") == without_times(tmp_path / "2")
    assert (tmp_path / "1" / "trajectory.tum").read_text() == (tmp_path / "2" / "trajectory.tum").read_text()
    pictures = [
        [part.split('"')[0] for part in (tmp_path / jobs / "report.html").read_text().split("data:image/jpeg")[1:]]
        for jobs in ("1", "2")
    ]
    assert pictures[0] == pictures[1]
    assert 8 < len(pictures[0]) <= 24


def test_a_video_is_a_sequence_in_real_seconds(folder: Path, fake: ModuleType, tmp_path: Path, scored) -> None:
    path = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 56))
    for level in range(100, 130, 3):
        image = np.full((56, 64, 3), level, dtype=np.uint8)
        image[:16, 48:] = 0
        writer.write(image)
    writer.release()
    dataset = load_dataset(path, field="ssl_2001", camera=folder / "camera.toml")
    made = []
    summary = scored(dataset, "out", 2, make_vision=lambda d: made.append(fake.FakeVision(d)) or made[0])
    assert summary.notes == ("a sequence runs in order in one process: --jobs and --dask are ignored",)
    assert summary.is_sequence
    assert "per frame (median), in a sequence" in (tmp_path / "out" / "report.html").read_text()
    times_s = [call[1] for call in made[0].calls if call[0] == "look"]
    assert times_s == pytest.approx([0.1 * index for index in range(10)])
    assert ("forget",) not in made[0].calls
    lines = (tmp_path / "out" / "trajectory.tum").read_text().splitlines()
    assert [float(line.split()[0]) for line in lines] == times_s
    rows = without_times(tmp_path / "out")
    assert [row["image"] for row in rows] == [f"frame_{i:06d}" for i in range(10)]
    assert len({row["x_m"] for row in rows}) > 5


def test_a_picture_that_cannot_be_drawn_costs_no_figure(folder: Path, fake: ModuleType, tmp_path: Path) -> None:
    summary = evaluate(
        load_dataset(folder), tmp_path / "out", make_vision=fake.FakeVision, draw_overlay=fake.draw_badly
    )
    assert summary.figures.located == 5
    assert summary.notes == (
        "overlays show the bare image where drawing fails: internal error: RuntimeError: no paint",
    )


def test_without_the_report_packages_the_other_files_are_written(
    folder: Path, fake: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(report, "find_spec", lambda name: None)
    out = tmp_path / "out"
    out.mkdir()
    (out / "report.html").write_text("of an earlier run")
    summary = evaluate(load_dataset(folder), out, make_vision=fake.FakeVision, draw_overlay=fake.draw)
    assert summary.report is None
    assert summary.notes == (
        "no report.html: matplotlib and jinja2 not installed (pip install 'robocup-vision[report]')",
    )
    assert sorted(path.name for path in out.iterdir()) == ["results.csv", "summary.json", "trajectory.tum"]


def test_arguments_that_cannot_be_meant(folder: Path, tmp_path: Path) -> None:
    dataset = load_dataset(folder)
    for changes, problem in (
        ({"dataset": "folder"}, r"dataset must be load_dataset\(path\), got str"),
        ({"out": None}, "out must be the path of a folder, got NoneType"),
        ({"workers": 3}, r"workers must be find_workers\(jobs\), got int"),
        ({"steering": True}, r"steering must be SteerPlan\(robot_radius_m, limits\), got bool"),
    ):
        with pytest.raises(ArgumentError, match=problem):
            evaluate(**{"dataset": dataset, "out": tmp_path / "out", **changes})
    with pytest.raises(ArgumentError, match="the path of a dataset must be a str or Path, got int 3"):
        load_dataset(3)


def test_files_of_others_are_refused_unless_forced(folder: Path, fake: ModuleType, tmp_path: Path) -> None:
    dataset = load_dataset(folder)
    precious = tmp_path / "precious.txt"
    precious.write_text("mine")
    with pytest.raises(FileError, match=r"holds files of others \(plug_in and 2 more\)"):
        evaluate(dataset, tmp_path, make_vision=fake.FakeVision)
    assert not (tmp_path / "results.csv").exists()
    evaluate(dataset, tmp_path, make_vision=fake.FakeVision, draw_overlay=fake.draw, force=True)
    assert (tmp_path / "results.csv").exists()
    assert precious.read_text() == "mine"


def test_a_datasets_poses_may_be_those_of_the_camera(folder: Path, tmp_path: Path, fake: ModuleType, scored) -> None:
    robots = scored(load_dataset(folder), "robot", make_vision=fake.MountedVision)
    with (folder / "dataset.toml").open("a") as stream:
        stream.write('pose_of = "camera"\n')
    dataset = load_dataset(folder)
    cameras = scored(dataset, "camera", make_vision=fake.MountedVision)
    mounted = Pose2(0.3, 0.0, 0.5)
    for robot, camera in zip(robots.rows, cameras.rows, strict=True):
        expected = robot.estimate.pose.compose(mounted)
        np.testing.assert_allclose(camera.estimate.pose.array, expected.array, atol=1e-12)
        # the truth in the file is one and the same, and now counts as the camera's
        assert camera.error.x_m == pytest.approx(expected.x_m - camera.truth.x_m)
    assert read_rows(tmp_path / "camera")[0]["x_m"] != read_rows(tmp_path / "robot")[0]["x_m"]


def test_a_localiser_without_camera_poses_cannot_be_scored_by_them(folder: Path, scored) -> None:
    with (folder / "dataset.toml").open("a") as stream:
        stream.write('pose_of = "camera"\n')
    summary = scored(load_dataset(folder))
    assert {row.reason for row in summary.rows} == {
        'the localiser gives no camera_pose, which pose_of = "camera" in dataset.toml needs'
    }
    assert summary.problem is not None


@pytest.mark.slow
def test_an_interrupted_run_keeps_what_is_done_and_is_gone_on_with(
    folder: Path, fake: ModuleType, tmp_path: Path, scored
) -> None:
    """Only this finds figures that differ once a run was interrupted."""

    class Interrupted(fake.FakeVision):
        def look(self, frame, t_s=None, odometry=None):
            if sum(call[0] == "look" for call in self.calls) == 3:
                raise KeyboardInterrupt
            return super().look(frame, t_s, odometry)

    dataset, out = load_dataset(folder), tmp_path / "out"
    code(folder / "images" / "1.png", 1)
    with pytest.raises(KeyboardInterrupt, match=r"3 of 5 images are done and kept in .*results\.csv; --resume goes on"):
        evaluate(dataset, out, make_vision=Interrupted, draw_overlay=fake.draw)
    assert [row["image"] for row in read_rows(out)] == ["0.png", "1.png", "2.png"]
    assert sorted(path.name for path in out.iterdir()) == ["results.csv", "unfinished.jsonl"]

    made = []
    evaluate(
        dataset,
        out,
        make_vision=lambda d: made.append(fake.FakeVision(d)) or made[0],
        draw_overlay=fake.draw,
        resume=True,
    )
    assert sum(call[0] == "look" for call in made[0].calls) == 2
    scored(dataset, "whole")
    assert without_times(out) == without_times(tmp_path / "whole")
    for name in ("summary.json", "trajectory.tum"):
        texts = [(where / name).read_text().split('"median_ms"')[0] for where in (out, tmp_path / "whole")]
        assert texts[0] == texts[1]
    pages = [(where / "report.html").read_text().count("data:image/jpeg") for where in (out, tmp_path / "whole")]
    assert pages == [5, 5]
    assert not (out / "unfinished.jsonl").exists()


def test_a_sequence_is_looked_at_from_its_beginning_again(folder: Path, scored) -> None:
    with (folder / "dataset.toml").open("a") as stream:
        stream.write('frames = "frames.csv"\n')
    rows = [f"{index}.png,{index}" for index in range(5)]
    (folder / "frames.csv").write_text("\n".join(["image,t_s", *rows]) + "\n")
    summary = scored(load_dataset(folder), resume=True)
    assert summary.notes == ("a sequence cannot be gone on with in its middle: --resume is ignored",)
    assert summary.figures.located == 5


@pytest.mark.slow
def test_the_estimate_over_time_is_scored(folder: Path, fake: ModuleType, tmp_path: Path, scored) -> None:
    """Only this finds a memory's run that is scored by its single looks."""

    class Remembering(fake.FakeVision):
        def look(self, frame, t_s=None, odometry=None):
            view = super().look(frame, t_s, odometry)
            pose = Pose2(0.5, 0.0, 0.0)
            belief = PoseEstimate(pose, np.eye(3) * 1e-4, 1.0, 0.0)
            view.belief = SimpleNamespace(pose=belief if t_s > 0 else NotLocated("not yet"))
            return view

    dataset = load_dataset(folder)
    with pytest.raises(ArgumentError, match=r"--memory needs a sequence: a video, or a dataset with frames\.csv"):
        evaluate(dataset, tmp_path / "out", make_vision=Remembering, scores_belief=True)
    times = {name: FrameTime(float(index), None) for index, name in enumerate(dataset.image_names)}
    dataset = replace(dataset, times=times)
    scored(dataset, make_vision=Remembering, scores_belief=True)
    rows = read_rows(tmp_path / "out")
    assert [row["reason"] for row in rows] == ["not yet", "", "", "", ""]
    assert [row["x_m"] for row in rows] == ["", "0.5", "0.5", "0.5", "0.5"]
    with pytest.raises(ArgumentError, match="--memory estimates the robot's pose, the dataset holds the camera's"):
        evaluate(replace(dataset, pose_of="camera"), tmp_path / "out", make_vision=Remembering, scores_belief=True)


def test_without_odometry_a_memory_goes_by_the_views(folder: Path) -> None:
    dataset = load_dataset(folder)
    for odometry, by_views in ((None, True), (Pose2(0.1, 0.0, 0.0), False)):
        times = {name: FrameTime(float(index), odometry) for index, name in enumerate(dataset.image_names)}
        vision = make_vision_with_memory(replace(dataset, times=times))
        assert isinstance(vision, Vision)
        assert vision.memory is not None
        assert (vision.memory.ego_motion is not None) == by_views


def test_a_memory_may_know_the_half_in_which_the_robot_begins(folder: Path) -> None:
    times = {f"{index}.png": FrameTime(float(index), None) for index in range(5)}
    vision = make_vision_with_memory(replace(load_dataset(folder), times=times), half="own")
    assert vision.memory is not None
    assert vision.memory.poses.half == "own"


@pytest.mark.parametrize(
    ("length", "angle", "words"),
    [
        (1e3, math.degrees(1.0), "lengths in millimetres and headings in degrees 5 of 5"),
        (1e2, 1.0, "lengths in centimetres 5 of 5"),
        (1.0, math.degrees(1.0), "headings in degrees 5 of 5"),
        (1.0, 1.0, ""),
    ],
)
def test_truth_in_other_units_is_told(folder: Path, length: float, angle: float, words: str, scored) -> None:
    dataset = load_dataset(folder)
    # the last one has no heading, and fits before its length is in other units
    truth = {
        name: Truth(length * one.x_m, length * one.y_m, None if one.theta_rad is None else angle * one.theta_rad)
        for name, one in dataset.truth.items()
    }
    summary = scored(replace(dataset, truth=truth))
    said = [note for note in summary.notes if "truth read as" in note]
    assert len(said) == (1 if words else 0)
    assert all(words in note and note.endswith("write metres and radians") for note in said)


def test_truth_beyond_a_turn_that_is_in_radians_is_left_alone(folder: Path, scored) -> None:
    dataset = load_dataset(folder)
    turns = {
        name: Truth(one.x_m, one.y_m, None if one.theta_rad is None else one.theta_rad + 6 * math.pi)
        for name, one in dataset.truth.items()
    }
    summary = scored(replace(dataset, truth=turns))
    assert summary.figures.within_10cm_5deg == 0.8
    assert not any("truth" in note for note in summary.notes)
