"""Every example of the page on file formats is read by the project's readers, and its tables name every key."""

import csv
import dataclasses
import io
import json

import cv2
import numpy as np
import pytest
from pages import DOCS, example_files, key_tables, text_of

from field_models import catalog, load_field
from field_models.errors import FileError
from robocup_vision import load_camera, load_colors
from robocup_vision.camera import files as camera_files
from robocup_vision.camera import rig as rig_file
from robocup_vision.camera import save_camera
from robocup_vision.camera.pinhole import MOUNTING_NAMES
from robocup_vision.evaluation import boxes, dataset, result_files
from robocup_vision.evaluation.detections import KindFigures
from robocup_vision.files.csv_table import read_csv
from robocup_vision.landmarks.mapping import run_files
from robocup_vision.localization import evidence as pose_evidence
from robocup_vision.localization.model_edges import weights
from robocup_vision.mapping import sensor_model
from robocup_vision.perception import color_table
from robocup_vision.planning.gaze import goal_evidence
from sim2d.match.run import MatchPlan
from sim2d.match.tournament import RoundRobin, tournament_json
from sim2d.players.built_in import BuiltInPlayer
from sim2d.report.match_figures import MatchFigures, match_json
from sim2d.report.robot_figures import FaultFigures, RobotFigures

PAGE = DOCS / "file_formats.md"
FILES = example_files(PAGE)
KEYS = key_tables(PAGE)
CAMERAS = [name for name in FILES if name.startswith("camera.toml")]


def keys_of(struct):
    return set(struct.__struct_fields__)


def names_of(value):
    return {field.name for field in dataclasses.fields(value)}


MATCH = match_json("ssl_2001", 2, 1, MatchFigures(60.0, (1, 0), ((3.0, 1),), (0.5, 0.5), (), ()))
ROBOT = {field.name: 0.0 for field in dataclasses.fields(RobotFigures)}
PAIR = RoundRobin(MatchPlan(), (("one", BuiltInPlayer), ("two", BuiltInPlayer)), 2)
TABLE = PAIR.table_json([{**MATCH, "robots": []}] * 2)
EXPECTED = {
    "dataset.toml": keys_of(dataset._DatasetFile),
    "truth.csv": {"image", "x_m", "y_m", "theta_rad"},
    "frames.csv": {"image", "t_s", "dx_m", "dy_m", "dtheta_rad", *MOUNTING_NAMES},
    "boxes.csv": set(boxes.COLUMNS),
    "camera.toml omni": keys_of(camera_files._OmniFile),
    "camera.toml hyperboloid": keys_of(camera_files._HyperboloidFile),
    "camera.toml tangent": keys_of(camera_files._TangentFile),
    "camera.toml table": keys_of(camera_files._TableFile),
    "camera.toml pinhole": keys_of(camera_files._PinholeFile),
    "camera.toml fisheye": keys_of(camera_files._FisheyeFile),
    "rig.toml": keys_of(rig_file._RigFile),
    "colors.toml": keys_of(color_table._ColorsFile),
    "colors.toml floor": keys_of(color_table._FloorFile),
    "colors.toml paint": keys_of(color_table._PaintFile),
    "field file": keys_of(catalog._FieldFile),
    "field file boundary": keys_of(catalog._Boundary),
    "field file goal": keys_of(catalog._Goal),
    "field file net": keys_of(catalog._Net),
    "field file area": keys_of(catalog._Area),
    "field file arc": keys_of(catalog._PenaltyArc),
    "field file mark": keys_of(catalog._PenaltyMark),
    "field file beacon": keys_of(catalog._Beacon),
    "results.csv": set(result_files.RESULT_COLUMNS),
    "steering.csv": set(result_files.STEERING_COLUMNS),
    "summary.json": set(result_files.SUMMARY_KEYS),
    "summary.json detections": names_of(KindFigures),
    "match.json": set(MATCH),
    "match.json robots": names_of(RobotFigures),
    "match.json faults": names_of(FaultFigures),
    "tournament.json totals": set(tournament_json(MatchPlan(), [{**MATCH, "robots": [ROBOT]}])["totals"]),
    "table.json table": set(TABLE["table"][0]),
    "run.toml": keys_of(run_files._RunFile),
    "sensors.toml": keys_of(sensor_model._SensorFile),
    "sensors.toml sensor": keys_of(sensor_model._Sensor),
    "goal evidence": keys_of(goal_evidence._EvidenceFile),
    "evidence.toml": keys_of(pose_evidence._EvidenceFile),
    "evidence.toml cue": keys_of(pose_evidence._Cue),
    "edge evidence": keys_of(weights._EvidenceFile),
    "edge evidence weights": keys_of(weights._Weights),
}


@pytest.fixture
def write(tmp_path):
    """Write an example into a folder, under its name without what stands in brackets."""

    def write(name):
        path = tmp_path / name.split(" (")[0]
        path.write_text(FILES[name], encoding="utf-8")
        return path

    return write


@pytest.mark.parametrize("name", EXPECTED)
def test_tables_name_every_key(name):
    assert len(KEYS[name]) == len(set(KEYS[name]))
    assert set(KEYS[name]) == EXPECTED[name]


def test_every_table_and_example_is_tested():
    read = {
        "dataset.toml",
        "truth.csv",
        "frames.csv",
        "boxes.csv",
        "rig.toml",
        "colors.toml",
        "field.toml",
        "run.toml",
        "sensors.toml",
    }
    written = {"results.csv", "steering.csv", "summary.json", "trajectory.tum"}
    assert set(KEYS) == set(EXPECTED)
    assert set(FILES) == {*CAMERAS, *read, *written}


@pytest.mark.parametrize("name", CAMERAS)
def test_cameras_are_loaded_and_written_again(name, write, tmp_path):
    camera = load_camera(write(name))
    save_camera(camera, tmp_path / "again.toml")
    again = load_camera(tmp_path / "again.toml")
    assert again.size_px == camera.size_px
    assert again.offset_m == camera.offset_m


def test_a_rig_is_loaded(write, tmp_path):
    path = write("rig.toml")
    example = FILES["camera.toml (fisheye)"]
    (tmp_path / "cam0.toml").write_text(example, encoding="utf-8")
    (tmp_path / "cam1.toml").write_text(example.replace("pan_rad = 0.0", "pan_rad = 1.57"), encoding="utf-8")
    rig = rig_file.load_rig(path)
    assert (rig.names, rig.latency_s) == (("cam0", "cam1"), (0.0, 0.012))


def test_an_error_names_file_key_and_value(tmp_path):
    (example,) = [line for line in text_of(PAGE).splitlines() if line.startswith("camera.toml: key")]
    path = tmp_path / "camera.toml"
    path.write_text(FILES["camera.toml (pinhole)"].replace("height_m = 0.35", "height_m = -0.2"), encoding="utf-8")
    with pytest.raises(FileError) as caught:
        load_camera(path)
    assert str(caught.value).replace(str(path), path.name) == example


def test_colors_are_loaded(write):
    colors = load_colors(write("colors.toml"))
    assert colors.floor.level == 92.0
    assert colors.ball.red_ratio == 2.2


def test_the_field_is_loaded(write):
    field = load_field(write("field.toml"))
    assert field.name == "school_lab"
    assert len(field.goals) == 2
    assert len(field.beacons) == 1
    assert len(field.arcs) == 1 + 2 + 4


def test_the_dataset_is_loaded(write, tmp_path):
    write("camera.toml (hyperboloid)")
    for name in ("dataset.toml", "truth.csv", "frames.csv", "boxes.csv", "colors.toml"):
        write(name)
    (tmp_path / "images").mkdir()
    blank = np.zeros((220, 256, 3), dtype=np.uint8)
    for name in ("0000.png", "0001.png"):
        cv2.imwrite(str(tmp_path / "images" / name), blank)
    mask = np.zeros((220, 256), dtype=np.uint8)
    mask[:20] = 255
    cv2.imwrite(str(tmp_path / "mask.png"), mask)
    loaded = dataset.load_dataset(tmp_path)
    assert loaded.method == "field"
    assert loaded.symmetry == "point"
    assert loaded.truth["0001.png"].theta_rad is None
    assert loaded.times["0000.png"].odometry is None
    assert loaded.times["0001.png"].odometry.x_m == 0.011
    assert [box.kind for box in loaded.boxes_of(0)] == ["ball", "robot"]
    assert loaded.boxes_of(1) == ()


def test_the_run_is_loaded(write, tmp_path):
    write("camera.toml (pinhole)")
    write("frames.csv")
    for part in run_files.CAMERAS:
        (tmp_path / part).mkdir()
        for name in ("0000.png", "0001.png"):
            (tmp_path / part / name).touch()
    run = run_files.load_run(write("run.toml").parent)
    assert run.names == ("0000.png", "0001.png")
    assert set(run.odometry) == {"0001.png"}


def test_sensors_are_loaded(write):
    assert sensor_model.load_sensors(write("sensors.toml"))["floor"].reach_m == 1.11


def test_results_have_their_columns(write):
    rows = read_csv(write("results.csv"), result_files.RESULT_COLUMNS)
    assert [row.entries["status"] for row in rows] == ["located", "not_located", "unreadable"]
    assert tuple(next(csv.reader(io.StringIO(FILES["results.csv"])))) == result_files.RESULT_COLUMNS


def test_the_summary_has_its_keys():
    summary = json.loads(FILES["summary.json"])
    assert tuple(summary) == result_files.SUMMARY_KEYS
    assert all(set(one) == names_of(KindFigures) for one in summary["detections"].values())


def test_the_trajectory_has_eight_numbers_a_line():
    assert all(len([float(entry) for entry in line.split()]) == 8 for line in FILES["trajectory.tum"].splitlines())
