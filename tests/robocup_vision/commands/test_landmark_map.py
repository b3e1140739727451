"""render-hall, map build, show and locate, and evaluate by landmarks: each does its part, errors are one line."""

import json
from pathlib import Path

import pytest

from robocup_vision import cli
from robocup_vision.landmarks.landmark_map import save_map
from sim2d.commands import render_hall as hall_command


@pytest.fixture(scope="module")
def hall_folder(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("hall")
    options = ["--count", "3", "--second", "2", "--turns", "0.02", "--seed", "7"]
    assert cli.main(["render-hall", *options, str(folder / "out")]) == 0
    return folder / "out"


@pytest.mark.slow
def test_from_the_run_to_a_report(hall_folder, tmp_path, capsys):
    """Only this finds commands that cannot read what the command before them wrote."""
    map_file = str(hall_folder / "map.npz")
    assert cli.main(["map", "build", str(hall_folder / "run"), "--out", map_file]) == 0
    assert "from 3 of 3 moments" in capsys.readouterr().out

    assert cli.main(["map", "show", map_file, "--picture", str(tmp_path / "map.png")]) == 0
    assert "seen where expected" in capsys.readouterr().out
    assert (tmp_path / "map.png").exists()

    images = sorted(str(p) for p in (hall_folder / "dataset" / "images").iterdir())
    camera = str(hall_folder / "dataset" / "camera.toml")
    picture = ["--picture", str(tmp_path / "located.png")]
    assert cli.main(["map", "locate", map_file, *images, "--camera", camera, "--limit-ms", "1000", *picture]) == 0
    assert "2/2 located" in capsys.readouterr().out

    assert cli.main(["evaluate", str(hall_folder / "dataset"), "--out", str(tmp_path / "report")]) == 0
    summary = json.loads((tmp_path / "report" / "summary.json").read_text())
    assert summary["located"] == 2
    assert summary["median_error_m"] < 0.03
    # a plain folder of images with --map
    options = ["--field", hall_command.FIELD, "--camera", camera, "--map", map_file]
    assert cli.main(["evaluate", str(Path(images[0]).parent), *options, "--out", str(tmp_path / "plain")]) == 0
    assert json.loads((tmp_path / "plain" / "summary.json").read_text())["located"] == 2


def error_line(capsys) -> str:
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


@pytest.mark.slow
def test_errors_are_one_line(hall_folder, short_run, tmp_path, capsys):
    """Only this finds a damaged run or map that ends a command with a traceback."""
    capsys.readouterr()
    run = tmp_path / "run"
    run.mkdir()
    assert cli.main(["map", "build", str(run)]) == 2
    assert "run.toml: does not exist" in error_line(capsys)
    toml = 'format = 1\ncamera = "camera.toml"\nstart = [0, 0, 0]\n'
    (run / "run.toml").write_text(toml)
    (run / "camera.toml").write_text((hall_folder / "run" / "camera.toml").read_text())
    assert cli.main(["map", "build", str(run)]) == 2
    assert "right: is not a folder of images" in error_line(capsys)
    for part in ("right", "left", "top"):
        (run / part).mkdir()
        (run / part / "0.png").write_bytes(b"")
    (run / "top" / "1.png").write_bytes(b"")
    assert cli.main(["map", "build", str(run)]) == 2
    assert "must hold the same images as right/, differs in, got '1.png'" in error_line(capsys)
    (run / "top" / "1.png").unlink()
    assert cli.main(["map", "build", str(run)]) == 2
    assert "0.png" in error_line(capsys)
    assert cli.main(["map", "show", str(run / "run.toml")]) == 2
    assert "no landmark map" in error_line(capsys)

    save_map(short_run.landmarks, tmp_path / "map.npz")
    dataset, camera = str(hall_folder / "dataset"), str(run / "camera.toml")
    assert cli.main(["map", "locate", str(tmp_path / "map.npz"), "x.png", "--camera", camera, "--limit-ms", "0"]) == 2
    assert "--limit-ms must be positive" in error_line(capsys)
    assert cli.main(["evaluate", dataset, "--map", str(tmp_path / "absent.npz"), "--out", str(tmp_path / "o")]) == 2
    assert "absent.npz: does not exist" in error_line(capsys)
    images = str(hall_folder / "dataset" / "images")
    plain = ["evaluate", images, "--field", hall_command.FIELD, "--camera", camera, "--method", "landmarks"]
    assert cli.main(plain) == 2
    assert "key 'map': is needed by method 'landmarks'" in error_line(capsys)
    untilted = "\n".join(line for line in Path(camera).read_text().splitlines() if "tilt" not in line)
    (tmp_path / "loose.toml").write_text(untilted)
    plain[5] = str(tmp_path / "loose.toml")
    assert cli.main(plain) == 2
    assert "needs a pinhole camera of known tilt_rad" in error_line(capsys)


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [("--turns", "0", "--turns must be positive"), ("--moved", "2", "fraction must be within 0 to 1")],
)
def test_render_hall_refuses(tmp_path, capsys, option, value, message):
    assert cli.main(["render-hall", option, value, str(tmp_path / "out")]) == 2
    assert message in error_line(capsys)


def test_render_hall_overwrites_nothing(tmp_path, capsys):
    (tmp_path / "precious").write_text("")
    assert cli.main(["render-hall", "--count", "1", "--second", "1", str(tmp_path)]) == 2
    assert "is not an empty folder" in error_line(capsys)
