"""Calibrations by ROS, OpenCV and Kalibr become camera files, which show points where OpenCV does."""

import cv2
import numpy as np
import pytest

from field_models.errors import FileError
from robocup_vision import cli, load_camera
from robocup_vision.camera import FisheyeCamera, PinholeCamera
from robocup_vision.camera.foreign_files import read_kalibr, read_opencv, read_ros

K = np.array([[457.5, 0.0, 321.5], [0.0, 459.0, 238.0], [0.0, 0.0, 1.0]])
D = [-0.11, 0.03, 0.001, -0.0005, 0.002]
# as camera_calibration of ROS writes it
ROS = """image_width: 640
image_height: 480
camera_name: head
camera_matrix:
  rows: 3
  cols: 3
  data: [457.5,   0. , 321.5,
           0. , 459. , 238. ,
           0. ,   0. ,   1. ]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.11, 0.03, 0.001, -0.0005, 0.002]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0., 0., 1., 0., 0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: [450., 0., 321.5, 0., 0., 452., 238., 0., 0., 0., 1., 0.]
"""
# as `ros2 topic echo` prints a message
ECHO = """header:
  stamp:
    sec: 1
    nanosec: 5
  frame_id: camera
height: 480
width: 640
distortion_model: plumb_bob
d:
- -0.11
- 0.03
- 0.001
- -0.0005
- 0.002
k:
- 457.5
- 0.0
- 321.5
- 0.0
- 459.0
- 238.0
- 0.0
- 0.0
- 1.0
binning_x: 0
binning_y: 0
---
"""
KALIBR = """cam0:
  T_cam_imu:
  - [0.0, -1.0, 0.0, -0.02]
  - [1.0, 0.0, 0.0, -0.06]
  - [0.0, 0.0, 1.0, 0.01]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: []
  camera_model: pinhole
  distortion_coeffs: [-0.11, 0.03, 0.001, -0.0005]
  distortion_model: radtan
  intrinsics: [457.5, 459.0, 321.5, 238.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
"""


@pytest.fixture
def write(tmp_path):
    """Write a text to a file."""

    def write(text, name="head.yaml"):
        (tmp_path / name).write_text(text)
        return tmp_path / name

    return write


def opencv_file(path, **values):
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    for name, value in values.items():
        storage.write(name, value)
    storage.release()
    return path


def test_points_are_shown_where_opencv_shows_them(write, tmp_path):
    own = opencv_file(
        tmp_path / "cv.yaml", image_width=640, image_height=480, camera_matrix=K, distortion_coefficients=np.array([D])
    )
    points = np.array([[0.3, -0.2, 2.0], [-0.9, 0.5, 2.5], [0.0, 0.8, 1.5]])
    for calibration, lens in (
        (read_ros(write(ROS)), D),
        (read_ros(write(ECHO)), D),
        (read_opencv(own), D),
        (read_kalibr(write(KALIBR)), D[:4]),
    ):
        assert calibration.size_px == (640, 480)
        camera = PinholeCamera(
            calibration.size_px, calibration.focal_px, calibration.center_px, 0.4, distortion=calibration.distortion
        )
        shown = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, np.array(lens))[0].reshape(-1, 2)
        # right, down, ahead are -y, -z, x
        np.testing.assert_allclose(camera.camera_ray_to_pixel(points[:, [2, 0, 1]] * (1, -1, -1)), shown, atol=1e-9)


def test_a_lens_without_distortion_has_none(write):
    assert read_ros(write(ROS.replace("[-0.11, 0.03, 0.001, -0.0005, 0.002]", "[0., 0., 0., 0., 0.]"))).distortion == ()
    wide = ROS.replace("plumb_bob", "rational_polynomial").replace("0.002]", "0.002, 0.01, 0., 0.02]")
    assert read_ros(write(wide)).distortion == (*D, 0.01, 0.0, 0.02)


def test_one_of_several_cameras_is_chosen(write):
    path = write(KALIBR + KALIBR.replace("cam0", "cam1").replace("457.5", "500.0"))
    assert read_kalibr(path, name="cam1").focal_px == (500.0, 459.0)
    with pytest.raises(FileError, match="holds several cameras, choose one by --name: cam0, cam1"):
        read_kalibr(path)
    with pytest.raises(FileError, match=r"has no such camera, only cam0, cam1.*, got 'cam3'"):
        read_kalibr(path, name="cam3")


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        (read_ros, ROS.replace("plumb_bob", "thin_prism"), "key 'distortion_model': is a lens model"),
        (read_kalibr, KALIBR.replace("radtan", "fov"), "key 'cam0.distortion_model': is a lens model"),
        (read_ros, ROS.replace("plumb_bob", "equidistant"), "a fisheye model has 4 coefficients"),
        (read_kalibr, KALIBR.replace(": pinhole", ": omni"), "key 'cam0.camera_model': is a lens model that"),
        (read_ros, KALIBR, "key 'camera_matrix': is no ROS camera_info (read it by from-kalibr)"),
        (read_kalibr, ROS, "is no camchain of Kalibr: no camera in it has intrinsics (read it by from-ros)"),
        (read_opencv, KALIBR, "key 'camera_matrix': is no calibration of OpenCV (read it by from-kalibr)"),
        (read_ros, ROS.replace("457.5", "0.0"), "has no focal length: the camera is not calibrated"),
        (read_ros, ROS.replace("457.5,   0. ", "457.5,   0.7"), "has a skew, which a camera file cannot hold, got 0.7"),
        (read_ros, ROS.replace("457.5,", "", 1), "key 'camera_matrix': must be 9 numbers"),
        (read_ros, ROS.replace("image_width", "breadth"), "does not say how large the images are: give --size"),
        (read_ros, ECHO.replace("binning_x: 0", "binning_x: 2"), "key 'binning_x': images that are binned need"),
        (read_ros, ROS.replace("0.002]", "0.002, 0, 0, 0, 0.1]"), "has coefficients beyond the first 8"),
        (read_ros, "just words", "is not YAML"),
        (read_ros, ROS.replace("]", "", 1), "is not YAML (line "),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_one_line(write, read, text, message):
    path = write(text)
    with pytest.raises(FileError) as caught:
        read(path)
    assert str(caught.value).startswith(f"{path}: {message}")
    assert "\n" not in str(caught.value)


def test_fisheyes_of_all_three_become_fisheye_cameras(write, tmp_path):
    own = opencv_file(
        tmp_path / "cv.yaml",
        image_width=640,
        image_height=480,
        camera_matrix=K,
        distortion_coefficients=np.array(D[:4]),
        fisheye_model=1,
    )
    ros = ROS.replace("plumb_bob", "equidistant").replace(", 0.002]", "]")
    points = np.array([[0.3, -0.2, 2.0], [-0.9, 0.5, 0.5], [0.0, 0.8, 0.2]])
    shown = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), K, np.array(D[:4]))[0].reshape(-1, 2)
    for command, path in (
        ("from-ros", write(ros)),
        ("from-kalibr", write(KALIBR.replace("radtan", "equidistant"), "k.yaml")),
        ("from-opencv", own),
    ):
        out = tmp_path / "camera.toml"
        assert cli.main(["camera", command, str(path), "--height", "0.4", "--tilt", "-15deg", "--out", str(out)]) == 0
        camera = load_camera(out)
        assert isinstance(camera, FisheyeCamera)
        np.testing.assert_allclose(camera.camera_ray_to_pixel(points[:, [2, 0, 1]] * (1, -1, -1)), shown, atol=1e-6)


def test_the_command_writes_a_camera_file(write, tmp_path, capsys):
    out = tmp_path / "camera.toml"
    words = ["camera", "from-ros", str(write(ROS)), "--height", "0.45", "--tilt", "-15deg", "--pan", "0.1"]
    assert cli.main([*words, "--offset", "0.05", "-0.01", "--out", str(out)]) == 0
    camera = load_camera(out)
    assert camera.tilt_rad == pytest.approx(np.radians(-15.0))
    assert (camera.pan_rad, camera.roll_rad, camera.height_m) == (0.1, None, 0.45)
    assert camera.offset_m == (0.05, -0.01)
    assert capsys.readouterr().out.startswith(f"{out}: 640x480, focal length 457.5, 459.0")
    path = opencv_file(tmp_path / "cv.yaml", K=K, D=np.array(D))
    words = ["camera", "from-opencv", str(path), "--height", "0.4", "--out", str(out)]
    assert cli.main(words) == 2
    assert "give --size, such as 640x480" in capsys.readouterr().err
    assert cli.main([*words, "--size", "640x480"]) == 0
    assert "its tilt is left open" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--height", "0.4", "--tilt", "-15"], "--tilt: -15 is more than a turn of radians: -15deg?"),
        (["--height", "0.4", "--tilt", "down"], "--tilt: must be an angle, such as -0.26 or -15deg, got 'down'"),
        (["--height", "0.4", "--tilt", "-100deg"], "the camera's tilt_rad must lie between -pi/2 and pi/2"),
        (["--height", "0.4", "--size", "640"], "--size: must be width and height in pixels, such as 640x480"),
        (["--height", "-1"], "the camera's height_m must be positive, got -1.0"),
        ([], "--height"),
    ],
)  # fmt: skip
def test_options_that_are_wrong_are_named(write, tmp_path, refused, words, message):
    assert message in refused("camera", "from-ros", write(ROS), "--out", tmp_path / "c.toml", *words)
    assert not (tmp_path / "c.toml").exists()
