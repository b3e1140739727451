"""Balls and obstacles against boxes: hits, misses, false finds and ranges, by views whose truth is known."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from field_models import ArgumentError, FileError, load_field
from robocup_vision.camera import PinholeCamera, save_camera
from robocup_vision.estimates import NotLocated
from robocup_vision.evaluation.boxes import Box, load_boxes
from robocup_vision.evaluation.dataset import Dataset, load_dataset
from robocup_vision.evaluation.detections import detection_figures, match_boxes, reported_kinds
from robocup_vision.evaluation.run import Summary, evaluate
from robocup_vision.landmarks.landmark_map import LandmarkMap, save_map

pytestmark = pytest.mark.usefixtures("without_plots")

FIELD = load_field("ssl_division_b")
CAMERA = PinholeCamera((320, 240), (300.0, 300.0), (160.0, 120.0), 0.3, tilt_rad=-0.3, pan_rad=0.0, roll_rad=0.0)


def ball_at(x_m, y_m, off_px=(0.0, 0.0)):
    u, v = CAMERA.point_to_pixel((x_m, y_m, FIELD.ball_radius_m)) + off_px
    return SimpleNamespace(x_m=x_m, y_m=y_m, u_px=float(u), v_px=float(v))


def box_around(u, v, half, kind="ball"):
    return Box(kind, u - half, v - half, u + half, v + half)


def view(balls=(), obstacles=()):
    return SimpleNamespace(balls=balls, obstacles=obstacles, camera=CAMERA)


def test_a_ball_in_its_box_is_a_hit_with_no_range_error():
    ball = ball_at(0.8, 0.1)
    (found,) = match_boxes(view([ball]), [box_around(ball.u_px, ball.v_px, 8.0)], FIELD)
    assert found.is_hit
    assert found.range_error_m == pytest.approx(0.0, abs=1e-9)


def test_two_pixels_beside_a_box_are_a_hit_and_three_are_not():
    ball = ball_at(0.8, 0.0)
    for off, hits in ((1.9, [True]), (3.0, [False, False])):
        box = Box("ball", ball.u_px + off, ball.v_px - 5, ball.u_px + 20, ball.v_px + 5)
        assert [one.is_hit for one in match_boxes(view([ball]), [box], FIELD)] == hits


def test_kinds_count_in_boxes_of_robots_and_people():
    places = [(1.0, -0.2), (1.0, 0.0), (1.0, 0.2), (1.4, 0.0)]
    kinds = ["robot", "person", None, "person"]
    things = [SimpleNamespace(x_m=x, y_m=y, kind=kind) for (x, y), kind in zip(places, kinds, strict=True)]
    boxes = [
        box_around(*CAMERA.floor_to_pixel(np.array(at)).tolist(), 4.0, kind)
        for at, kind in zip(places, ["robot", "robot", "robot", "human"], strict=True)
    ]
    figures = detection_figures(match_boxes(view(obstacles=things), boxes, FIELD), ["obstacle"])
    assert (figures["robot"].kind_reported, figures["robot"].kind_right) == (2, 1)
    assert (figures["human"].kind_reported, figures["human"].kind_right) == (1, 1)
    assert figures["obstacle"].kind_reported is None


def test_kinds_are_asked_only_where_boxes_tell_them():
    thing = SimpleNamespace(x_m=1.0, y_m=0.0)
    box = box_around(*CAMERA.floor_to_pixel(np.array((1.0, 0.0))).tolist(), 4.0, "obstacle")
    (found,) = match_boxes(view(obstacles=[thing]), [box], FIELD)
    assert found.is_hit
    assert found.reported_kind is None


def test_a_box_counts_once():
    ball = ball_at(0.8, 0.0)
    found = match_boxes(view([ball, ball]), [box_around(ball.u_px, ball.v_px, 8.0)], FIELD)
    figures = detection_figures(found)["ball"]
    assert (figures.boxes, figures.found, figures.reported) == (1, 1, 2)
    assert (figures.recall, figures.precision) == (1.0, 0.5)


def test_a_robot_is_found_by_its_foot_and_its_range_is_that_of_its_lower_edge():
    u, v = CAMERA.floor_to_pixel((1.0, 0.0))
    boxes = [Box("robot", u - 20, v - 60, u + 20, float(CAMERA.floor_to_pixel((0.9, 0.0))[1]))]
    thing = SimpleNamespace(x_m=1.0, y_m=0.0, kind=None)
    (found,) = match_boxes(view(obstacles=[thing]), boxes, FIELD)
    assert found.is_hit
    assert found.kind == "robot"
    assert found.range_error_m == pytest.approx(0.1, abs=1e-6)
    figures = detection_figures([found])
    assert (figures["robot"].recall, figures["robot"].precision) == (1.0, None)
    assert figures["obstacle"].precision == 1.0


def test_a_box_that_the_picture_cuts_has_no_range():
    ball = ball_at(0.8, 0.0)
    box = Box("ball", ball.u_px - 8, ball.v_px - 8, 320.0, ball.v_px + 8)
    (found,) = match_boxes(view([ball]), [box], FIELD)
    assert found.is_hit
    assert found.range_error_m is None


def test_kinds_that_no_view_tells_are_left_out():
    assert match_boxes(view(), [Box("goal_post", 1, 1, 9, 9)], FIELD) == ()


def test_what_a_file_does_not_mark_is_not_scored():
    ball, robot = Box("ball", 1, 1, 9, 9), Box("robot", 1, 1, 9, 9)
    assert reported_kinds([ball]) == ("ball",)
    assert reported_kinds([robot]) == ("obstacle",)
    assert reported_kinds([]) == reported_kinds([ball, robot]) == ("ball", "obstacle")
    thing = SimpleNamespace(x_m=1.0, y_m=0.0)
    assert match_boxes(view(obstacles=[thing]), [], FIELD, reported_kinds([ball])) == ()
    assert len(match_boxes(view(obstacles=[thing]), [], FIELD, reported_kinds([]))) == 1
    assert set(detection_figures([], reported_kinds([ball]))) == {"ball"}


def test_a_localiser_without_balls_is_told():
    with pytest.raises(ArgumentError, match=r"no balls, which boxes\.csv needs"):
        match_boxes(SimpleNamespace(pose=None), [], FIELD)


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("0.png,ball,10,10,400,30", r"line 2: a box must lie in the picture of 64x56, got \[10.0, 10.0, 400.0, 30.0\]"),
        ("0.png,ball,-5,10,20,30", "line 2: a box must lie in the picture of 64x56"),
        ("0.png,ball,20,10,10,30", "line 2: a box must have xmin below xmax and ymin below ymax"),
        ("0.png,,10,10,20,30", "line 2: kind must not be empty"),
        ("9.png,ball,10,10,20,30", "line 2: names an image that is not there, got '9.png'"),
        ("0.png,ball,10,nan,20,30", "line 2: ymin must be a finite number"),
    ],
)
def test_wrong_boxes(tmp_path, line, told):
    (tmp_path / "boxes.csv").write_text(f"image,kind,xmin,ymin,xmax,ymax\n{line}\n")
    with pytest.raises(FileError, match=told):
        load_boxes(tmp_path / "boxes.csv", ("0.png",), (64, 56))


class TellsOneBall:
    """Tells one ball at the same place in every image, and knows no pose."""

    def __init__(self, dataset):
        self.camera = dataset.camera

    def look(self, frame, t_s=None, odometry=None):
        """Look."""
        ball = SimpleNamespace(x_m=0.3, y_m=0.0, u_px=40.0, v_px=30.0)
        return SimpleNamespace(pose=NotLocated("not asked"), balls=(ball,), obstacles=(), camera=self.camera)

    def forget(self):
        """Forget."""


def test_a_run_scores_the_boxes_and_shows_misses(folder: Path, tmp_path: Path):
    lines = ("0.png,ball,35,25,45,35", "0.png,ball,5,5,12,12", "1.png,parking,5,5,12,12")
    (folder / "boxes.csv").write_text("image,kind,xmin,ymin,xmax,ymax\n" + "\n".join(lines) + "\n")
    summary = evaluate(load_dataset(folder), tmp_path / "out", make_vision=TellsOneBall)
    figures = json.loads((tmp_path / "out" / "summary.json").read_text())["detections"]["ball"]
    assert (figures["boxes"], figures["found"], figures["reported"]) == (2, 1, 5)
    assert (figures["recall"], figures["precision"]) == (0.5, 0.2)
    assert set(summary.detections or {}) == {"ball"}
    assert "boxes of these kinds are not scored, for no view tells them: parking" in summary.notes
    assert summary.report is not None
    page = summary.report.read_text()
    assert page.count("ball, missed</figcaption>") == 1
    assert page.count("ball, false</figcaption>") == 4


@pytest.fixture
def boxed(folder: Path) -> Dataset:
    """Return a dataset of five images, of which two have boxes."""
    lines = ("0.png,ball,35,25,45,35", "0.png,ball,5,5,12,12", "3.png,ball,5,5,12,12")
    (folder / "boxes.csv").write_text("image,kind,xmin,ymin,xmax,ymax\n" + "\n".join(lines) + "\n")
    return load_dataset(folder)


def test_detections_of_an_interrupted_run_are_kept(boxed: Dataset, tmp_path: Path):
    looks = iter(range(5))

    class Interrupted(TellsOneBall):
        def look(self, frame, t_s=None, odometry=None):
            if next(looks) == 3:
                raise KeyboardInterrupt
            return super().look(frame, t_s, odometry)

    with pytest.raises(KeyboardInterrupt, match="3 of 5 images are done"):
        evaluate(boxed, tmp_path / "out", make_vision=Interrupted)
    resumed = evaluate(boxed, tmp_path / "out", make_vision=TellsOneBall, resume=True)
    assert_same_detections(resumed, evaluate(boxed, tmp_path / "whole", make_vision=TellsOneBall))


def assert_same_detections(a: Summary, b: Summary):
    assert [len(row.detections) for row in a.rows] == [2, 1, 1, 2, 1]
    assert [row.detections for row in a.rows] == [row.detections for row in b.rows]
    assert a.detections == b.detections
    assert a.report.read_text().count("<figcaption>") == b.report.read_text().count("<figcaption>")


def test_boxes_of_images_that_landmarks_locate_are_said_not_to_be_scored(folder: Path, tmp_path: Path):
    some = np.array([0])
    sizes, places = np.array([0.05]), np.array([[1.0, 0.5, 0.4]])
    landmarks = LandmarkMap(
        places, np.eye(3)[None] * 1e-4, np.ones(1), some, some, some, some,
        np.zeros((1, 128), np.uint8), sizes, sizes, sizes, np.zeros((2, 3)), np.zeros((2, 3, 3)),
    )  # fmt: skip
    save_map(landmarks, tmp_path / "map.npz")
    save_camera(replace(CAMERA, size_px=(64, 56), center_px=(31.5, 27.5)), folder / "camera.toml")
    (folder / "boxes.csv").write_text("image,kind,xmin,ymin,xmax,ymax\n0.png,ball,35,25,45,35\n")
    assert load_dataset(folder).boxes is not None
    dataset = load_dataset(folder, landmark_map=tmp_path / "map.npz")
    assert dataset.boxes is None
    assert "boxes.csv is not scored: method 'landmarks' tells neither balls nor obstacles" in dataset.notes


def test_crops_of_things_at_a_pictures_corner_are_pictures():
    from robocup_vision.evaluation.overlays import error_crops

    frame = np.zeros((56, 64, 3), dtype=np.uint8)
    found = match_boxes(view(), [Box("ball", 0, 0, 3, 3), Box("ball", 63.5, 55.5, 64, 56)], FIELD)
    assert len(error_crops("0.png", frame, found)) == 2
