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


@pytest.mark.slow
def test_errors_are_one_line(hall_folder, short_run, tmp_path, refused):
    """Only this finds a damaged run or map that ends a command with a traceback."""
    run = tmp_path / "run"
    run.mkdir()
    assert "run.toml: does not exist" in refused("map", "build", str(run))
    toml = 'format = 1\ncamera = "camera.toml"\nstart = [0, 0, 0]\n'
    (run / "run.toml").write_text(toml)
    (run / "camera.toml").write_text((hall_folder / "run" / "camera.toml").read_text())
    assert "right: is not a folder of images" in refused("map", "build", str(run))
    for part in ("right", "left", "top"):
        (run / part).mkdir()
        (run / part / "0.png").write_bytes(b"")
    (run / "top" / "1.png").write_bytes(b"")
    assert "must hold the same images as right/, differs in, got '1.png'" in refused("map", "build", str(run))
    (run / "top" / "1.png").unlink()
    assert "0.png" in refused("map", "build", str(run))
    assert "no landmark map" in refused("map", "show", str(run / "run.toml"))

    save_map(short_run.landmarks, tmp_path / "map.npz")
    dataset, camera = str(hall_folder / "dataset"), str(run / "camera.toml")
    assert "--limit-ms must be positive" in refused(
        "map", "locate", tmp_path / "map.npz", "x.png", "--camera", camera, "--limit-ms", "0"
    )
    assert "absent.npz: does not exist" in refused(
        "evaluate", dataset, "--map", tmp_path / "absent.npz", "--out", tmp_path / "o"
    )
    images = str(hall_folder / "dataset" / "images")
    plain = ["evaluate", images, "--field", hall_command.FIELD, "--camera", camera, "--method", "landmarks"]
    assert "key 'map': is needed by method 'landmarks'" in refused(*plain)
    untilted = "\n".join(line for line in Path(camera).read_text().splitlines() if "tilt" not in line)
    (tmp_path / "loose.toml").write_text(untilted)
    plain[5] = str(tmp_path / "loose.toml")
    assert "needs a pinhole camera of known tilt_rad" in refused(*plain)


def test_render_hall_overwrites_nothing(tmp_path, refused):
    (tmp_path / "precious").write_text("")
    assert "is not an empty folder" in refused("render-hall", "--count", "1", "--second", "1", str(tmp_path))
