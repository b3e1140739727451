"""A head that nods: joints tell how the camera is held in each frame, and the frame is looked at accordingly."""

import dataclasses
import math

import numpy as np
import pytest
from dataset_folders import write_dataset

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision import Mounting, NotLocated, Pose2, PoseEstimate, Vision
from robocup_vision.calibration.online import OnlineCalibration
from robocup_vision.camera import PinholeCamera
from robocup_vision.evaluation.dataset import load_dataset
from robocup_vision.evaluation.run import evaluate
from robocup_vision.live.sources.folder import FolderSource
from robocup_vision.live.sources.source import SourceOptions
from robocup_vision.localization.distinct import pose_offset
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.pinhole import render_pinhole
from sim2d.rendering.scene import Room, Scene
from sim2d.rendering.sensor import Sensor

FIELD = load_field("humanoid_kid_2025")
STD_RAD = math.radians(0.5)
CAMERA = PinholeCamera(
    (320, 240), (228.5, 228.5), (159.5, 119.5), 0.45, pan_rad=0.0, tilt_rad=math.radians(-15.0), roll_rad=0.0,
    roll_std_rad=math.radians(1.4),
)  # fmt: skip
START = Pose2(1.2, -0.8, 0.35)
# a nod between neighbouring frames is far more than a body sways
NODS_RAD = [math.radians(-20.0 + 20.0 * math.sin(1.1 * step)) for step in range(6)]
STEP = Pose2(0.03, 0.0, 0.02)


@pytest.fixture(scope="module")
def walk():
    """Return frames of a walk with their told mounting and the true pose."""
    rng, robot, frames = np.random.default_rng(8), START, []
    for index, nod in enumerate(NODS_RAD):
        robot = robot.compose(STEP) if index else robot
        error = rng.normal(0.0, STD_RAD, 2)
        height = 0.45 + 0.02 * math.cos(1.1 * index)
        held = dataclasses.replace(CAMERA, tilt_rad=nod + error[0], roll_rad=float(error[1]), height_m=height)
        light = render_pinhole(held, Scene(FIELD, room=Room(seed=2), carpet_margin_m=0.2), robot, supersample=2)
        told = Mounting(tilt_rad=nod, roll_rad=0.0, height_m=height, tilt_std_rad=STD_RAD, roll_std_rad=STD_RAD)
        frames.append((Sensor(noise_sigma=3.0, blur_px=0.6).expose(light, rng), told, robot))
    return frames


def test_a_nodding_head_is_found_and_followed_where_its_tilt_is_told(walk):
    vision = Vision(FIELD, CAMERA)
    for index, (frame, told, robot) in enumerate(walk):
        view = vision.look(frame, index / 30, STEP if index else None, mounting=told)
        assert isinstance(view.pose, PoseEstimate)
        nearer = min((view.pose, view.pose.half_turn()), key=lambda one: one.pose.error_to(robot)[0])
        off_m, off_rad = nearer.pose.error_to(robot)
        assert off_m < 0.08
        assert off_rad < math.radians(1.0)
        # chi-square with 3 degrees of freedom: one in ten thousand is larger
        off = pose_offset(nearer.pose, robot)
        assert off @ np.linalg.solve(nearer.covariance, off) < 21.1
        # the frame tells the tilt better than the joints did
        assert view.camera.tilt_rad == pytest.approx(told.tilt_rad, abs=4 * STD_RAD)
        assert view.camera.height_m == pytest.approx(told.height_m, abs=0.03)


def test_it_is_lost_where_nobody_tells(walk):
    vision = Vision(FIELD, CAMERA)
    views = [
        vision.look(frame, index / 30, STEP if index else None, START if index == 0 else None)
        for index, (frame, _, _) in enumerate(walk)
    ]
    assert sum(isinstance(view.pose, NotLocated) for view in views) >= len(walk) // 2


@pytest.mark.parametrize(("number", "prior"), [(0, None), (3, START)])
def test_a_told_mounting_is_worth_as_much_as_a_camera_file_that_says_it(walk, number, prior):
    frame, told, _ = walk[number]
    file = dataclasses.replace(CAMERA, **told.known)
    one = Vision(FIELD, CAMERA).look(frame, prior=prior, mounting=told)
    other = Vision(FIELD, file).look(frame, prior=prior)
    assert isinstance(one.pose, PoseEstimate)
    assert isinstance(other.pose, PoseEstimate)
    assert one.pose.pose.error_to(other.pose.pose) == pytest.approx((0.0, 0.0), abs=1e-9)
    np.testing.assert_allclose(one.pose.covariance, other.pose.covariance, rtol=1e-9)
    assert one.camera.tilt_rad == other.camera.tilt_rad
    # the floor's tables are those of a step of the tilt near by
    assert np.median(np.abs(one.free_space.range_m / other.free_space.range_m - 1.0)) < 0.05


def test_how_well_the_tilt_is_known_counts(walk):
    frame, told, robot = walk[0]
    wrong = told.tilt_rad + math.radians(1.0)
    fitted = []
    for std_rad in (math.radians(0.02), math.radians(1.0)):
        sure = dataclasses.replace(told, tilt_rad=wrong, tilt_std_rad=std_rad)
        fitted.append(Vision(FIELD, CAMERA).look(frame, prior=robot, mounting=sure).camera.tilt_rad)
    assert fitted[0] == pytest.approx(wrong, abs=math.radians(0.1))
    assert abs(fitted[1] - told.tilt_rad) < abs(fitted[1] - wrong)


def test_the_pans_error_is_the_headings(walk):
    frame, told, robot = walk[0]
    covariances = []
    for std_rad in (0.0, 0.03):
        told = dataclasses.replace(told, pan_rad=0.0, pan_std_rad=std_rad)
        view = Vision(FIELD, CAMERA).look(frame, prior=robot, mounting=told)
        assert isinstance(view.pose, PoseEstimate)
        covariances.append(view.measurement.covariance)
    assert covariances[1][2, 2] - covariances[0][2, 2] == pytest.approx(0.03**2, rel=0.01)


def told_rows(walk):
    names = ("tilt_rad", "roll_rad", "height_m", "tilt_std_rad", "roll_std_rad")
    yield ",".join(("image", "t_s", "dx_m", "dy_m", "dtheta_rad", *names))
    for index, (_, told, _) in enumerate(walk):
        step = STEP.array.tolist() if index else ["", "", ""]
        values = [getattr(told, name) for name in names]
        yield ",".join(map(str, (f"{index}.png", index / 30, *step, *values)))


def test_a_folder_of_images_tells_it_in_frames_csv(walk, tmp_path):
    frames = [frame for frame, _, _ in walk]
    write_dataset(tmp_path, frames, CAMERA, FIELD.name, frames="frames.csv", method="edges")
    (tmp_path / "frames.csv").write_text("\n".join(told_rows(walk)) + "\n")
    dataset = load_dataset(tmp_path)
    assert [dataset.times[f"{index}.png"].mounting for index in range(len(walk))] == [told for _, told, _ in walk]
    summary = evaluate(dataset, tmp_path / "out")
    vision = Vision(FIELD, CAMERA)
    for index, (row, (frame, told, _)) in enumerate(zip(summary.rows, walk, strict=True)):
        view = vision.look(frame, index / 30, STEP if index else None, mounting=told)
        assert row.estimate is not None
        assert row.estimate.pose == view.pose.pose
    source = FolderSource(tmp_path, SourceOptions())
    assert [source.read(0.0)[0].mounting for _ in walk] == [told for _, told, _ in walk]


def test_a_recording_holds_it(walk, tmp_path):
    pytest.importorskip("rosbags")
    from robocup_vision.recording import Recorder, Recording
    from robocup_vision.recording.bags.bag_dataset import load_bag
    from robocup_vision.recording.loops import Changes
    from robocup_vision.recording.replay import Differences, replay

    path = tmp_path / "run.mcap"
    with Recorder(path, Vision(FIELD, CAMERA)) as recorder:
        for index, (frame, told, _) in enumerate(walk):
            if index == 1:
                recorder.look(frame, index / 30, STEP, pan_rad=0.02, mounting=told)
            else:
                recorder.look(frame, index / 30, STEP if index else None, mounting=told)
    expected = [told for _, told, _ in walk]
    expected[1] = dataclasses.replace(expected[1], pan_rad=0.02)
    assert [frame.mounting for frame in Recording(path).frames()] == expected
    assert [time.mounting for time in load_bag(path).times.values()] == expected
    differences = Differences()
    for call in replay(Recording(path), Changes()):
        differences.add(call)
    assert (differences.calls, differences.same) == (len(walk), len(walk))


def test_what_takes_no_mounting_says_so(walk):
    frame, told, _ = walk[0]
    with pytest.raises(ArgumentError, match="the pan is given twice"):
        Vision(FIELD, CAMERA).look(frame, pan_rad=0.1, mounting=Mounting(pan_rad=0.1))
    with pytest.raises(ArgumentError, match="method 'goal' takes no mounting but the pan"):
        Vision(FIELD, CAMERA, method="goal").look(frame, mounting=told)
    open_tilt = dataclasses.replace(CAMERA, tilt_rad=None, roll_rad=None)
    with pytest.raises(ArgumentError, match="method 'goal' takes no mounting but the pan"):
        Vision(FIELD, open_tilt).look(frame, mounting=told)
    with pytest.raises(ArgumentError, match="a mirror camera has no pan"):
        Vision("ssl_2001", sekimori_camera()).look(np.zeros((220, 256, 3), np.uint8), mounting=told)
    with pytest.raises(ArgumentError, match=r"mounting must be a Mounting\(tilt_rad=..., ...\), got float"):
        Vision(FIELD, CAMERA).look(frame, mounting=-0.3)
    online = OnlineCalibration(FIELD, CAMERA)
    with pytest.raises(ArgumentError, match="online refines how the camera is held at rest"):
        Vision(FIELD, CAMERA, online=online).look(frame, mounting=told)
