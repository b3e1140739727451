"""The command parses, calls and prints: each use with its exit status, and errors in exactly one line."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from dataset_folders import SMALL_CAMERA
from PIL import Image

from field_models import field_names
from robocup_vision import cli
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.evaluation import run
from robocup_vision.geometry import Pose2


class BrightnessVision:
    """Says a pose wherever it is bright."""

    def look(self, frame: np.ndarray, t_s: float | None = None, odometry: Pose2 | None = None) -> Any:  # noqa: D102
        if frame.mean() < 50:
            self.pose: PoseEstimate | NotLocated = NotLocated("too dark")
        else:
            self.pose = PoseEstimate(Pose2(0.1, 0.2, 0.3), np.eye(3) * 1e-4, 0.9, 0.5)
        return self

    def forget(self) -> None:  # noqa: D102
        pass


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(run, "make_default_vision", lambda dataset: BrightnessVision())
    monkeypatch.setitem(run.evaluate.__kwdefaults__, "draw_overlay", lambda view, frame, vision: frame)
    monkeypatch.chdir(tmp_path)
    images = tmp_path / "drive"
    images.mkdir()
    for index, level in enumerate((0, 90, 120)):
        cv2.imwrite(str(images / f"{index}.png"), np.full((56, 64, 3), level, dtype=np.uint8))
    (tmp_path / "camera.toml").write_text(SMALL_CAMERA)
    (tmp_path / "field.toml").write_text((files("field_models") / "fields" / "ssl_2001.toml").read_text())
    return images


def evaluate(*arguments: str) -> int:
    return cli.main(["evaluate", "drive", "--field", "ssl_2001", "--camera", "camera.toml", *arguments])


def test_evaluate_prints_a_table(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evaluate() == 0
    out, err = capsys.readouterr()
    assert err == ""
    lines = [line.split("  ", 2)[1:] for line in out.splitlines()[1:]]
    table = {label.strip(): value.strip() for label, value in ((line[0], line[1]) for line in lines)}
    assert table["located"] == "2/3"
    assert table["within 5 cm / 3 deg"] == "-"
    assert table["report"] == "out/drive/report.html"
    assert table["method"] == "field"
    assert list(table) == [
        "method", "located", "within 5 cm / 3 deg", "within 10 cm / 5 deg", "median position error",
        "median heading error", "median time per frame", "report",
    ]  # fmt: skip
    assert sorted(path.name for path in Path("out/drive").iterdir()) == [
        "report.html", "results.csv", "summary.json", "trajectory.tum",
    ]  # fmt: skip


@pytest.mark.parametrize("kind", ["png", "jpg"])
def test_an_unreadable_image_is_one_line_and_status_2(
    folder: Path, capfd: pytest.CaptureFixture[str], kind: str
) -> None:
    noise = np.random.default_rng(5).integers(0, 255, (56, 64, 3), dtype=np.uint8)
    data = cv2.imencode(f".{kind}", noise)[1].tobytes()
    (folder / f"torn.{kind}").write_bytes(data[: len(data) // 2])
    assert evaluate("--out", "here") == 2
    err = capfd.readouterr().err
    assert re.fullmatch(
        rf"robocup-vision evaluate: 1 of 4 images failed, the first: torn\.{kind}: "
        rf"is a truncated or damaged {'PNG' if kind == 'png' else 'JPEG'} \(.*\)\n",
        err,
    )
    assert len(Path("here/results.csv").read_text().splitlines()) == 5


GIVEN = "evaluate drive --field ssl_2001 --camera"


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("evaluate nowhere", " evaluate: nowhere: does not exist"),
        ("evaluate drive", " evaluate: drive: has no dataset.toml, so --field must be given"),
        ("evaluate camera.toml", " evaluate: camera.toml: is a camera file, must be a dataset file"),
        ("live nothing_here --port 0", " live: nothing_here: does not exist"),
        ("evaluate drive --jobs many", " evaluate: argument --jobs: must be a whole number, got 'many' (see robocup-v"),
        ("--versoin", ": unknown option --versoin; did you mean '--version'? (see"),
        ("evalute drive", ": argument COMMAND: 'evalute' is unknown; did you mean 'evaluate'? (see"),
        ("evaluate drive --metod=edges", " evaluate: unknown option --metod=edges; did you mean '--method'? (see robo"),
        ("evaluate --xyzzy", " evaluate: unknown option --xyzzy (see robocup-vision evaluate --help"),
        ("fields spl", " fields: unknown argument spl (see robocup-vision fields --help)"),
        ("calibrate forwrad drive", " calibrate: argument KIND: 'forwrad' is unknown; did you mean 'forward'? (see"),
        (
            "evaluate drive --field spl_2002 --camera camera.toml",
            f" evaluate: field 'spl_2002' is neither a .toml file nor one of: {', '.join(field_names())};"
            " did you mean 'spl_2020'?",
        ),
        (
            f"{GIVEN} camra.toml",
            " evaluate: camra.toml: cannot be read (No such file or directory); did you mean 'camera.toml'?",
        ),
        (
            "evaluate drive --field camera.toml --camera field.toml",
            " evaluate: camera.toml: is a camera file, must be a field file: are the two swapped?",
        ),
        (f"{GIVEN} field.toml", " evaluate: field.toml: is a field file, must be a camera file: are the two swapped?"),
        (
            f"{GIVEN} camera.toml --method egdes",
            " evaluate: method must be one of field, floor, hull, edges, goal, angles, landmarks, got 'egdes';"
            " did you mean 'edges'?",
        ),
        (
            "evaluate . --field ssl_2001 --camera camera.toml",
            " evaluate: .: no images found in this folder (png, jpg, jpeg, bmp, webp, tif, tiff);"
            " there are some in drive",
        ),
        ("", ": the following arguments are required: COMMAND (see robocup-vision --help)"),
    ],
)
def test_mistakes_are_one_line(folder: Path, refused: Callable[..., str], words: str, line: str) -> None:
    assert refused(*words.split()).startswith(f"robocup-vision{line}")


def test_a_folder_with_images_in_it_is_taken(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder.rename("images")
    Path("drive").mkdir()
    Path("images").rename("drive/images")
    assert evaluate() == 0
    assert capsys.readouterr().out.startswith("drive\n")


@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        ("robocup-vision eval", {"evaluate"}),
        ("robocup-vision evaluate --met", {"--method"}),
        ("robocup-vision evaluate --field spl", {"spl_2020"}),
        ("robocup-vision evaluate --field f", {"field.toml", "four_legged_2005", "four_legged_2007"}),
    ],
)
def test_a_shell_completes_commands_options_and_fields(folder: Path, typed: str, offered: set[str]) -> None:
    pytest.importorskip("argcomplete")
    asked = {"_ARGCOMPLETE": "1", "_ARGCOMPLETE_STDOUT_FILENAME": "offered", "_ARGCOMPLETE_IFS": "\n"}
    line = {"COMP_LINE": typed, "COMP_POINT": str(len(typed)), "COMP_TYPE": "9"}
    code = "from robocup_vision import cli; cli.main()"
    subprocess.run([sys.executable, "-c", code], env={**os.environ, **asked, **line}, check=True)
    assert {word.strip() for word in Path("offered").read_text().splitlines()} == offered


def test_notes_are_printed(folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run.report, "find_spec", lambda name: None)
    assert evaluate() == 0
    out = capsys.readouterr().out
    assert "note: no report.html: matplotlib and jinja2 not installed" in out
    assert "report                 out/drive\n" in out


def test_an_interrupt_is_130(folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(BrightnessVision, "look", interrupt)
    assert evaluate() == 130
    assert capsys.readouterr().err == (
        "robocup-vision evaluate: interrupted: 0 of 3 images are done and kept in out/drive/results.csv; "
        "--resume goes on\n"
    )


def test_fields_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["fields"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["name", *field_names()]
    assert next(line for line in lines if line.startswith("ssl_2001")).split()[1:3] == ["2.74", "1.525"]


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(["--version"])
    assert stop.value.code == 0
    assert capsys.readouterr().out == f"robocup-vision {version('robocup-vision')}\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is full")
def test_output_that_nobody_takes_ends_in_at_most_one_line() -> None:
    command = [sys.executable, "-m", "robocup_vision.cli", "fields"]
    reader, writer = os.pipe()
    os.close(reader)
    with open(writer, "wb") as closed, Path("/dev/full").open("wb") as full:
        unread = subprocess.run(command, stdout=closed, stderr=subprocess.PIPE, check=False)
        unwritten = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (unread.returncode, unread.stderr) == (141, b"")
    assert unwritten.returncode == 2
    assert unwritten.stderr == "robocup-vision fields: output cannot be written: No space left on device\n"


@pytest.mark.skipif(sys.platform != "linux", reason="names that are no text are of Linux")
def test_an_image_whose_name_is_no_text_is_scored(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (folder / "2.png").rename(folder / os.fsdecode(b"2\xfc.png"))
    assert evaluate("--out", "out") == 0
    rows = Path("out/results.csv").read_text(encoding="utf-8").splitlines()
    assert rows[3].startswith(r"2\udcfc.png,located,0.1,0.2,0.3,")
    assert r"2\udcfc.png" in Path("out/report.html").read_text(encoding="utf-8")


def test_pictures_that_are_left_out_and_turned_are_said(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    exif = Image.Exif()
    exif[0x0112] = 6
    Image.open(folder / "2.png").save(folder / "3.jpg", exif=exif)
    (folder / "4.heic").write_bytes(b"")
    assert evaluate("--out", "out") == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == "drive: 1 of 5 left out"
    assert "note: 1 pictures of kinds that are not read are left out, the first: 4.heic" in out
    assert "note: 3.jpg has the EXIF orientation 6, which is not applied: pixels are taken as stored" in out
    assert '"left_out": 1,' in Path("out/summary.json").read_text()
