"""A dataset is what its files say, and each way they can be wrong has one clear line."""

import pickle
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from wrong_files import problem_of

from field_models import ArgumentError, FileError, FrameError, RobocupVisionError
from robocup_vision.evaluation.dataset import Truth, load_dataset
from robocup_vision.geometry import Pose2
from robocup_vision.localization.methods import choose_method, method_names

FRAMES = "image,t_s,dx_m,dy_m,dtheta_rad\n0.png,10,,,\n" + "".join(
    f"{i}.png,{10 + i},0.1,0,0.01\n" for i in range(1, 5)
)

PINHOLE = """format = 1
model = "pinhole"
size_px = [64, 56]
focal_px = [60, 60]
center_px = [31.5, 27.5]
height_m = 0.4
"""


def add(folder: Path, line: str) -> None:
    with (folder / "dataset.toml").open("a") as stream:
        stream.write(line + "\n")


def test_a_folder_with_a_description(folder: Path) -> None:
    dataset = load_dataset(folder)
    assert dataset.name == "set"
    assert dataset.image_names == tuple(f"{i}.png" for i in range(5))
    assert dataset.field.name == "ssl_2001"
    assert dataset.camera.size_px == (64, 56)
    assert (dataset.method, dataset.symmetry, dataset.mask, dataset.times) == ("field", "point", None, None)
    assert dataset.truth["0.png"] == Truth(-0.01, -0.08, 0.0)
    assert dataset.truth["4.png"].theta_rad is None
    assert load_dataset(folder / "dataset.toml").image_names == dataset.image_names
    frames = list(dataset.read_frames())
    assert all(isinstance(frame, np.ndarray) and frame.shape == (56, 64, 3) for frame in frames)
    assert np.array_equal(frames[3], dataset.read_frame(3))


def test_a_dataset_survives_the_way_to_a_worker(folder: Path) -> None:
    dataset = load_dataset(folder)
    copy = pickle.loads(pickle.dumps(dataset))
    assert copy.image_names == dataset.image_names
    assert np.array_equal(copy.read_frame(0), dataset.read_frame(0))


def test_arguments_go_before_the_file(folder: Path, tmp_path: Path) -> None:
    dataset = load_dataset(folder, field="ssl_division_b", method="field")
    assert dataset.field.name == "ssl_division_b"
    other = (folder / "camera.toml").read_text().replace("[31.5, 27.5]", "[30.5, 27.5]")
    (tmp_path / "other.toml").write_text(other)
    assert load_dataset(folder, camera=tmp_path / "other.toml").camera.center_px == (30.5, 27.5)


def test_a_field_file_beside_the_description(folder: Path) -> None:
    import field_models

    source = Path(field_models.__file__).parent / "fields" / "ssl_division_a.toml"
    (folder / "ours.toml").write_text(source.read_text().replace('"ssl_division_a"', '"ours"'))
    text = (folder / "dataset.toml").read_text()
    (folder / "dataset.toml").write_text(text.replace('"ssl_2001"', '"ours.toml"'))
    assert load_dataset(folder).field.name == "ours"


def test_a_plain_folder(folder: Path) -> None:
    images = folder / "images"
    for name in ("10.JPG", "b.bmp", "c.jpeg"):
        cv2.imwrite(str(images / name), np.zeros((56, 64, 3), dtype=np.uint8))
    (images / "notes.txt").write_text("not an image")
    (images / "._0.png").write_bytes(b"what macOS leaves behind")
    dataset = load_dataset(images, field="ssl_2001", camera=folder / "camera.toml", method="floor")
    assert dataset.image_names == ("0.png", "1.png", "10.JPG", "2.png", "3.png", "4.png", "b.bmp", "c.jpeg")
    assert (dataset.name, dataset.truth, dataset.method) == ("images", {}, "floor")


@pytest.mark.parametrize("given", [{}, {"field": "ssl_2001"}, {"camera": "camera.toml"}])
def test_a_plain_folder_needs_field_and_camera(folder: Path, given: dict[str, str]) -> None:
    missing = "camera" if "field" in given else "field"
    with pytest.raises(ArgumentError, match=f"images: has no dataset.toml, so --{missing} must be given"):
        load_dataset(folder / "images", **given)


def test_a_video(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 56))
    for level in (40, 120, 200):
        writer.write(np.full((56, 64, 3), level, dtype=np.uint8))
    writer.release()
    dataset = load_dataset(path, field="ssl_2001", camera=folder / "camera.toml")
    assert (dataset.name, dataset.is_video) == ("drive", True)
    assert dataset.image_names == ("frame_000000", "frame_000001", "frame_000002")
    levels = [float(np.mean(frame)) for frame in dataset.read_frames()]
    assert levels == pytest.approx([40, 120, 200], abs=3)
    with pytest.raises(ArgumentError, match="read in order"):
        dataset.read_frame(0)

    larger = (folder / "camera.toml").read_text().replace("[64, 56]", "[80, 56]")
    (folder / "camera.toml").write_text(larger)
    frames = list(load_dataset(path, field="ssl_2001", camera=folder / "camera.toml").read_frames())
    assert [str(frame) for frame in frames][:1] == ["frame_000000: is 64x56, the camera file says 80x56"]
    path.write_bytes(path.read_bytes()[:600])
    frames = list(dataset.read_frames())
    assert len(frames) == 3
    assert isinstance(frames[-1], FrameError)


def test_a_video_that_is_cut_off_is_reported(folder: Path, tmp_path: Path) -> None:
    path = tmp_path / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (64, 56))
    for frame in np.random.default_rng(2).integers(0, 255, (20, 56, 64, 3), dtype=np.uint8):
        writer.write(frame)
    writer.release()
    assert load_dataset(path, field="ssl_2001", camera=folder / "camera.toml").notes == ()
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    dataset = load_dataset(path, field="ssl_2001", camera=folder / "camera.toml")
    assert 0 < len(dataset.image_names) < 20
    assert dataset.notes == (
        f"drive.avi: {len(dataset.image_names)} frames can be decoded, its header announces 20: is it cut off?",
    )


def test_a_sequence(folder: Path) -> None:
    add(folder, 'frames = "frames.csv"')
    (folder / "frames.csv").write_text(FRAMES)
    times = load_dataset(folder).times
    assert times is not None
    assert (times["0.png"].t_s, times["0.png"].odometry) == (10.0, None)
    assert times["1.png"].odometry == Pose2(0.1, 0.0, 0.01)
    (folder / "frames.csv").write_text("".join(line.rsplit(",", 3)[0] + "\n" for line in FRAMES.splitlines()))
    times = load_dataset(folder).times
    assert times is not None
    assert times["1.png"].odometry is None


def test_a_mask(folder: Path) -> None:
    mask = np.zeros((56, 64), dtype=np.uint8)
    mask[:9] = 3
    cv2.imwrite(str(folder / "images" / "mask.png"), mask)
    add(folder, 'mask = "images/mask.png"')
    dataset = load_dataset(folder)
    assert dataset.mask is not None
    assert np.array_equal(dataset.mask != 0, mask != 0)
    assert "mask.png" not in dataset.image_names


@pytest.mark.parametrize(
    ("mask", "problem"),
    [
        (np.ones((56, 60), dtype=np.uint8), r"mask must be as large as the camera's images \(64x56\), got '60x56'"),
        (np.zeros((56, 64), dtype=np.uint8), "mask has no non-zero pixel"),
        (np.ones((56, 64), dtype=np.uint8), "mask hides every pixel"),
        (None, r"mask\.png: cannot be read \(No such file"),
    ],
)
def test_masks_that_cannot_be_meant(folder: Path, mask: np.ndarray | None, problem: str) -> None:
    if mask is not None:
        cv2.imwrite(str(folder / "mask.png"), mask)
    add(folder, 'mask = "mask.png"')
    with pytest.raises(RobocupVisionError, match=problem):
        load_dataset(folder)


HEADER = "image,x_m,y_m,theta_rad\n"


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "is empty, must begin with the line 'image,x_m,y_m,theta_rad'"),
        ("image,x_m,y_m\n", "line 1: column 'theta_rad' is missing, got 'image,x_m,y_m'"),
        ("image;x_m;y_m;theta_rad\n", "line 1: column 'image' is missing"),
        ("image,x_m,x_m,y_m,theta_rad\n", "line 1: column 'x_m' is named twice"),
        (HEADER + "absent.png,0,0,0\n", "line 2: names an image that is not there, got 'absent.png'"),
        (HEADER + "0.png,0,0,0\n\n0.png,1,0,0\n", "line 4: image already listed in line 2, got '0.png'"),
        (HEADER + "0.png,here,0,0\n", "line 2: x_m must be a finite number, got 'here'"),
        (HEADER + "0.png,0,nan,0\n", "line 2: y_m must be a finite number, got 'nan'"),
        (HEADER + "0.png,0,0,inf\n", "line 2: theta_rad must be a finite number, got 'inf'"),
        (HEADER + "0.png,,0,0\n", "line 2: x_m must be a finite number, got ''"),
        (HEADER + "0.png,0,0\n", "line 2: must have 4 entries, got 3"),
    ],
)
def test_wrong_truth(folder: Path, text: str, problem: str) -> None:
    (folder / "truth.csv").write_text(text)
    with pytest.raises(RobocupVisionError) as caught:
        load_dataset(folder)
    assert str(caught.value).startswith(f"{folder / 'truth.csv'}: {problem}")
    assert "\n" not in str(caught.value)


def test_truth_of_a_spreadsheet(folder: Path) -> None:
    (folder / "truth.csv").write_bytes(("\ufeff" + HEADER + "1.png, 0.5,0,\n").replace("\n", "\r\n").encode())
    assert load_dataset(folder).truth == {"1.png": Truth(0.5, 0.0, None)}
    (folder / "truth.csv").write_bytes(b"image,\xff\n")
    with pytest.raises(RobocupVisionError, match="is not UTF-8 text"):
        load_dataset(folder)


@pytest.mark.parametrize(
    ("camera", "method", "column", "problem"),
    [
        ("tilt_rad = -0.2", "edges", "tilt_rad", "line 2: a mounting's tilt_rad must lie between -pi/2 and pi/2"),
        ("tilt_rad = -0.2", "edges", "height", "line 1: column 'height' is unknown"),
        ("tilt_rad = -0.2", "goal", "height_m", "key 'height_m': is for method 'edges' and a camera file with tilt_"),
        ("", "goal", "roll_rad", "key 'roll_rad': is for method 'edges' and a camera file with tilt_rad"),
        (None, "floor", "pan_rad", "tells how a head holds the camera, which a mirror camera does not take"),
    ],
)
def test_a_mounting_that_cannot_be_used_is_refused(folder: Path, camera: str | None, method, column, problem) -> None:
    add(folder, 'frames = "frames.csv"')
    text = (folder / "dataset.toml").read_text()
    (folder / "dataset.toml").write_text(re.sub(r'method = "\w+"\n', "", text) + f'method = "{method}"\n')
    if camera is not None:
        (folder / "camera.toml").write_text(f"{PINHOLE}{camera}\n")
    value = 2.0 if "pi/2" in problem else 0.3
    lines = [f"{line},{value}" if number else f"{line},{column}" for number, line in enumerate(FRAMES.splitlines())]
    (folder / "frames.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(FileError) as caught:
        load_dataset(folder)
    assert str(caught.value).startswith(f"{folder / 'frames.csv'}: {problem}")


@pytest.mark.parametrize("method", ["edges", "field"])
def test_methods_by_edges_take_a_mounting(folder: Path, method: str) -> None:
    add(folder, 'frames = "frames.csv"')
    text = (folder / "dataset.toml").read_text()
    (folder / "dataset.toml").write_text(re.sub(r'method = "\w+"\n', "", text) + f'method = "{method}"\n')
    (folder / "camera.toml").write_text(f"{PINHOLE}tilt_rad = -0.2\n")
    lines = [f"{line},0.3" if number else f"{line},height_m" for number, line in enumerate(FRAMES.splitlines())]
    (folder / "frames.csv").write_text("\n".join(lines) + "\n")
    times = load_dataset(folder).times
    assert times is not None
    assert {time.mounting.height_m for time in times.values() if time.mounting is not None} == {0.3}


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ("image,t_s,", "image,time,", "line 1: column 't_s' is missing"),
        (",dy_m", "", "line 1: column 'dy_m' is missing beside 'dx_m'"),
        (",dtheta_rad", ",dtheta_rad,v", "line 1: column 'v' is unknown"),
        ("4.png", "5.png", "line 6: names an image that is not there, got '5.png'"),
        ("4.png,14,0.1,0,0.01\n", "", "must name every image, does not name, got '4.png'"),
        ("3.png,13,", "3.png,12,", "line 5: t_s must be later than in the image before (12.0), got 12.0"),
        ("3.png,13,0.1,", "3.png,13,,", "line 5: dx_m must be a finite number, got ''"),
    ],
)
def test_wrong_frames(folder: Path, old: str, new: str, problem: str) -> None:
    add(folder, 'frames = "frames.csv"')
    found = problem_of(lambda path: load_dataset(path.parent), folder / "frames.csv", FRAMES, old, new)
    assert found.startswith(problem)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('camera = "camera.toml"\n', "", "key 'camera': is missing"),
        ("symmetry", "symetry", "key 'symetry': is unknown, got 'point'"),
        ("symmetry", 'pose_of = ""\nsymmetry', "key 'pose_of': must be one of robot, camera, got ''"),
        ("symmetry", "pose_of = 1\nsymmetry", "key 'pose_of': expected `str`, got `int`"),
        ('"point"', '"mirror"', "key 'symmetry': must be one of none, point, got 'mirror'"),
        ("format = 1", "format = 2", "key 'format': is not a value that this version reads: must be 1, got 2"),
        ('"ssl_2001"', "5", "key 'field': expected `str`, got `int`, got 5"),
        (
            "format = 1",
            'format = 1\nmethod = "magic"',
            "key 'method': must be one of field, floor, hull, edges, goal, angles, landmarks, got 'magic'",
        ),
        ('images = "images"', 'images = "pictures"', "key 'images': does not exist, got 'pictures'"),
        ('images = "images"', 'images = "empty"', "key 'images': no images found in this folder (png"),
        ('images = "images"', 'images = "images/0.png"', "key 'images': is a single image"),
        ('images = "images"', 'images = "truth.csv"', "key 'images': is neither a folder of images nor a video"),
        ('"ssl_2001"', '"spl_2020"\nmethod = "floor"', "key 'method': needs a floor that ends at walls or boards"),
    ],
)
def test_wrong_description(folder: Path, old: str, new: str, problem: str) -> None:
    (folder / "empty").mkdir()
    path = folder / "dataset.toml"
    found = problem_of(lambda path: load_dataset(path.parent), path, path.read_text(), old, new)
    assert found.startswith(problem)


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('"camera.toml"', '"lost.toml"', r"lost\.toml: cannot be read \(No such file"),
        ('"truth.csv"', '"lost.csv"', r"lost\.csv: cannot be read \(No such file"),
        ('"ssl_2001"', '"ssl_1999"', "field 'ssl_1999' is neither a .toml file nor one of"),
    ],
)
def test_files_that_are_not_there(folder: Path, old: str, new: str, problem: str) -> None:
    (folder / "dataset.toml").write_text((folder / "dataset.toml").read_text().replace(old, new))
    with pytest.raises(RobocupVisionError, match=problem):
        load_dataset(folder)


def test_paths_and_arguments_that_are_nothing(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(RobocupVisionError, match="nowhere: does not exist"):
        load_dataset(tmp_path / "nowhere")
    with pytest.raises(ArgumentError, match=f"method must be one of {', '.join(method_names())}, got 'magic'"):
        load_dataset(folder, method="magic")
    (tmp_path / "bare").mkdir()
    with pytest.raises(RobocupVisionError, match="no images found"):
        load_dataset(tmp_path / "bare", field="ssl_2001", camera=folder / "camera.toml")


@pytest.mark.parametrize(
    ("lines", "method"), [("tilt_rad = -0.3\nroll_rad = 0.0\npan_rad = 0.0\n", "edges"), ("", "goal")]
)
def test_without_a_method_it_is_the_one_that_vision_takes(
    folder: Path, tmp_path: Path, lines: str, method: str
) -> None:
    camera = tmp_path / "head.toml"
    camera.write_text(PINHOLE + lines)
    dataset = load_dataset(folder / "images", field="spl_2020", camera=camera)
    assert dataset.method == choose_method(dataset.camera).name == method
