"""Labels of other programs become the boxes that they mean; what is wrong in them has one clear line."""

import json

import cv2
import numpy as np
import pytest

from field_models import FileError
from robocup_vision import cli
from robocup_vision.evaluation.box_import import read_coco, read_torso_21, read_yolo
from robocup_vision.evaluation.boxes import Box, load_boxes

TORSO = """
images:
  130-16_02_2018__11_16_34_0000_upper.png:
    annotations:
    - blurred: true
      concealed: false
      in_image: true
      type: robot
      vector:
      - - 42 # x value
        - 26 # y value
      - - 81
        - 98
    - in_image: true
      type: goalpost
      vector: [[10, 5], [14, 5], [15, 90], [11, 90]]
    - in_image: false
      type: ball
    - in_image: true
      type: L-Intersection
      vector:
      - - 7
        - 8
    height: 108
    metadata:
      fov: 42
      tags: ["natural_light"]
    width: 192
  empty.jpg:
    width: 192
    height: 108
    annotations: []
"""


def coco(bbox=(10, 20, 30, 40), width=100):
    return {
        "images": [{"id": 7, "file_name": "train/a.png", "width": width, "height": 80}],
        "categories": [{"id": 1, "name": "Ball"}],
        "annotations": [{"id": 3, "image_id": 7, "category_id": 1, "bbox": list(bbox)}],
    }


def written(path, values):
    path.write_text(json.dumps(values))
    return path


@pytest.fixture
def yolo(tmp_path):
    (tmp_path / "labels").mkdir()
    (tmp_path / "images").mkdir()
    cv2.imwrite(str(tmp_path / "images" / "a.png"), np.zeros((80, 100, 3), np.uint8))
    (tmp_path / "classes.txt").write_text("robot\nball\n")
    (tmp_path / "labels" / "a.txt").write_text("1 0.5 0.5 0.2 0.25\n")
    return tmp_path


def test_yolo(yolo):
    assert read_yolo(yolo / "labels", yolo / "images").boxes == {"a.png": [Box("ball", 40.0, 30.0, 60.0, 50.0)]}


def test_coco(tmp_path):
    path = written(tmp_path / "labels.json", coco())
    assert read_coco(path).boxes == {"a.png": [Box("ball", 10.0, 20.0, 40.0, 60.0)]}


def test_torso_21(tmp_path):
    (tmp_path / "annotations.yaml").write_text(TORSO)
    imported = read_torso_21(tmp_path)
    assert imported.left_out == 1
    assert imported.boxes == {
        "130-16_02_2018__11_16_34_0000_upper.png": [Box("robot", 42, 26, 81, 98), Box("goalpost", 10, 5, 15, 90)],
        "empty.jpg": [],
    }


def test_the_command_writes_what_evaluate_reads(yolo, capsys):
    out = yolo / "boxes.csv"
    line = ["import-boxes", "yolo", str(yolo / "labels"), "--images", str(yolo / "images"), "--out", str(out)]
    assert cli.main(line) == 0
    assert capsys.readouterr().out == f"{out}: 1 boxes in 1 images: 1 ball\n"
    assert load_boxes(out, ("a.png",), (100, 80)) == {"a.png": (Box("ball", 40.0, 30.0, 60.0, 50.0),)}


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "1 0.5 0.5 1.2 0.2",
            r"a.txt: line 1: a box must lie in the picture of 100x80, got \[-10.0, 32.0, 110.0, 48.0\]",
        ),
        ("5 0.5 0.5 0.2 0.2", "a.txt: line 1: class has no name, there are 2, got 5"),
        ("1 0.5 0.5 0.2", "a.txt: line 1: must be class, x, y, width, height"),
        ("ball 0.5 0.5 0.2 0.2", "a.txt: line 1: must be class, x, y, width, height"),
    ],
)
def test_wrong_yolo_labels(yolo, text, told):
    (yolo / "labels" / "a.txt").write_text(text)
    with pytest.raises(FileError, match=told):
        read_yolo(yolo / "labels", yolo / "images")


def test_yolo_needs_names_and_images(yolo):
    (yolo / "labels" / "b.txt").write_text("")
    with pytest.raises(FileError, match=r"b.txt: has no image of its name"):
        read_yolo(yolo / "labels", yolo / "images")
    (yolo / "classes.txt").unlink()
    with pytest.raises(FileError, match="give the file of the classes' names by --names"):
        read_yolo(yolo / "labels", yolo / "images")


@pytest.mark.parametrize(
    ("values", "told"),
    [
        (coco(bbox=(90, 20, 30, 40)), r"annotation 3: a box must lie in the picture of 100x80"),
        (coco(bbox=(90, 20)), "annotation 3: must have image_id, category_id of the lists, and bbox of 4 numbers"),
        (coco(width="wide"), "annotation 3: must have image_id"),
        (coco() | {"images": []}, "annotation 3: must have image_id"),
        (coco() | {"categories": [{"id": 1}]}, "key 'categories': an entry has no name"),
        ([], "key 'images': must be a list, as COCO has it"),
    ],
)
def test_wrong_coco_labels(tmp_path, values, told):
    with pytest.raises(FileError, match=told):
        read_coco(written(tmp_path / "labels.json", values))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (TORSO.replace("- - 81", "- - 810"), "line 5: a box must lie in the picture of 192x108"),
        (TORSO.replace("width: 192", ""), "line 5: its image has no width and height"),
        ("a: 1\n", "names no images, as TORSO-21's annotations do"),
    ],
)
def test_wrong_torso_21_labels(tmp_path, text, told):
    (tmp_path / "annotations.yaml").write_text(text)
    with pytest.raises(FileError, match=told):
        read_torso_21(tmp_path)
