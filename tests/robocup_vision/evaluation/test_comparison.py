"""Two evaluations side by side: figures, what became of each image, and what is wrong with the files."""

import json
import re

import cv2
import numpy as np
import pytest

from field_models.errors import ArgumentError, FileError
from robocup_vision import cli
from robocup_vision.evaluation.comparison import compare, load_evaluation, render_comparison
from robocup_vision.evaluation.result_files import RESULT_COLUMNS, SUMMARY_KEYS


def evaluation(folder, rows, **figures):
    """Write the files of an evaluation; a row is image, status, and what else is not empty."""
    folder.mkdir()
    lines = [",".join(RESULT_COLUMNS)]
    for image, status, cells in rows:
        known = {"image": image, "status": status, **cells}
        lines.append(",".join(str(known.get(column, "")) for column in RESULT_COLUMNS))
    (folder / "results.csv").write_text("\n".join(lines) + "\n")
    summary = {**dict.fromkeys(SUMMARY_KEYS), "method": "edges", "images": len(rows), "left_out": 0, **figures}
    (folder / "summary.json").write_text(json.dumps(summary))
    return folder


GOOD, FAR, TURNED = (
    {"error_m": 0.01, "error_rad": 0.01},
    {"error_m": 3.0, "error_rad": 0.1},
    {"error_m": 0.0, "error_rad": 2.0},
)
DARK = {"reason": "too dark"}


@pytest.fixture
def folders(tmp_path):
    first = [
        ("a", "located", GOOD),
        ("b", "located", GOOD),
        ("c", "not_located", DARK),
        ("d", "located", FAR),
        ("e", "located", GOOD),
        ("f", "unreadable", {}),
    ]
    second = [
        ("a", "located", GOOD),
        ("b", "located", TURNED),
        ("c", "located", GOOD),
        ("d", "not_located", DARK),
        ("e", "not_located", DARK),
        ("g", "located", GOOD),
    ]
    return (
        evaluation(tmp_path / "before", first, located=4, median_error_m=0.0123, median_ms=2.0),
        evaluation(tmp_path / "after", second, located=4, median_error_m=0.0100, median_ms=2.5),
    )


@pytest.fixture
def compared(folders):
    return compare(*map(load_evaluation, folders))


def test_images_that_changed_are_named_with_the_worse_ones_first(compared):
    told = [(one.image, one.before.outcome, one.after.outcome) for one in compared.changes]
    assert told == [
        ("b", "located", "wrong"),
        ("e", "located", "refused"),
        ("c", "refused", "located"),
        ("d", "wrong", "refused"),
    ]
    assert compared.shared == ("a", "b", "c", "d", "e")
    assert compared.left_alone == (1, 1)
    assert compared.count("located", "located") == 1
    assert compared.count("wrong", "refused") == 1


def test_without_truth_no_pose_is_wrong(tmp_path):
    one = load_evaluation(evaluation(tmp_path / "one", [("a", "located", {}), ("b", "not_located", DARK)]))
    same = compare(one, one)
    assert same.changes == ()
    assert [one.images[name].outcome for name in "ab"] == ["located", "refused"]
    page = render_comparison(same)
    assert "There is no truth" in page
    assert "data:image" not in page


def test_the_page_has_both_figures_and_their_difference(compared):
    page = render_comparison(compared)
    cells = dict(re.findall(r'<tr><td class="text">(.+?)</td>(<td>.*?)</tr>', page))
    assert cells["Median position error"] == "<td>12.3 mm</td><td>10.0 mm</td><td>−2.3 mm</td>"
    assert cells["Median time per frame"] == "<td>2.00 ms</td><td>2.50 ms</td><td>+0.50 ms</td>"
    assert cells["Located"] == "<td>4</td><td>4</td><td>0</td>"
    assert cells["RMS error in heading"] == "<td>–</td><td>–</td><td>–</td>"
    assert "1 images are in" in page
    assert "too dark" in page


def test_the_command_prints_what_changed_and_writes_the_page_with_pictures(folders, tmp_path, capsys):
    images = tmp_path / "images"
    images.mkdir()
    for name in "abcdefg":
        (images / name).write_bytes(cv2.imencode(".png", np.full((30, 40, 3), 90, np.uint8))[1].tobytes())
    out = tmp_path / "out"
    assert cli.main(["compare", *map(str, folders), "--images", str(images), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    assert "b: located -> wrong" in told
    assert re.search(r"Median position error +12.3 mm +10.0 mm +-2.3 mm", told)
    page = (out / "comparison.html").read_text(encoding="utf-8")
    assert page.count("data:image/jpeg;base64") == 4


def test_a_folder_with_files_of_others_is_refused(folders, tmp_path, capsys):
    out = tmp_path / "out"
    out.mkdir()
    (out / "notes.txt").write_text("mine")
    assert cli.main(["compare", *map(str, folders), "--out", str(out)]) == 2
    assert "notes.txt" in capsys.readouterr().err
    assert cli.main(["compare", *map(str, folders), "--out", str(out), "--force"]) == 0
    assert (out / "notes.txt").read_text() == "mine"


def test_what_is_no_evaluation_is_named(tmp_path):
    with pytest.raises(FileError, match="is not a folder"):
        load_evaluation(tmp_path / "none")
    with pytest.raises(FileError, match=r"summary.json: cannot be read .*has `evaluate` written it"):
        load_evaluation(tmp_path)
    folder = evaluation(tmp_path / "bad", [("a", "lost", {})])
    with pytest.raises(FileError, match=r"results.csv: line 2: status must be located, not_located or unreadable"):
        load_evaluation(folder)
    (folder / "summary.json").write_text('{"method": "edges"}')
    with pytest.raises(FileError, match="has no images, located"):
        load_evaluation(folder)
    (folder / "summary.json").write_text("{")
    with pytest.raises(FileError, match="is not valid JSON"):
        load_evaluation(folder)


def test_evaluations_of_other_images_are_not_compared(tmp_path):
    one = load_evaluation(evaluation(tmp_path / "one", [("a", "located", GOOD)]))
    other = load_evaluation(evaluation(tmp_path / "other", [("b", "located", GOOD)]))
    with pytest.raises(ArgumentError, match="have no image in common"):
        compare(one, other)
