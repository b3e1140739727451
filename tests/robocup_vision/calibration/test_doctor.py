"""Each slip that is put into a right set-up is named, with how many pictures it explains."""

import math
import re
from dataclasses import replace

import cv2
import numpy as np
import pytest
from dataset_folders import write_dataset
from forward_pictures import render

from field_models import load_field
from robocup_vision.camera import FisheyeCamera, PinholeCamera, save_camera
from robocup_vision.cli import main
from robocup_vision.geometry import Pose2

TILT_RAD = math.radians(-15.0)
FORWARD = PinholeCamera(
    (320, 240), (228.0, 228.0), (159.5, 119.5), 0.45, pan_rad=0.0, tilt_rad=TILT_RAD, roll_rad=0.0, roll_std_rad=0.01
)
PLACES = (Pose2(1.2, 0.6, -0.15), Pose2(-2.5, 1.5, 2.7), Pose2(0.5, -1.5, 1.9), Pose2(2.0, -1.0, 2.4))


@pytest.fixture(scope="module")
def spl_frames():
    return render(load_field("spl_2020"), FORWARD, PLACES, 3, margin_m=0.3)


@pytest.fixture
def told(tmp_path, capsys):
    """Write a dataset of frames, and return what the command prints of it and its status."""

    def check(frames, camera=FORWARD, field="spl_2020", **known):
        write_dataset(tmp_path, frames, camera, field, **{"method": "edges", "symmetry": "point", **known})
        status = main(["check", str(tmp_path)])
        return status, [line.strip() for line in capsys.readouterr().out.splitlines() if "WRONG" in line]

    return check


TRUTH = [(pose.x_m, pose.y_m, pose.theta_rad) for pose in PLACES]


def test_nothing_is_wrong_with_a_right_set_up(told, spl_frames):
    assert told(spl_frames, truth=TRUTH) == (0, [])


SLIPS = {
    "tilt": (
        {"camera": replace(FORWARD, tilt_rad=-TILT_RAD)},
        "tilt: with tilt -15 instead of +15 degrees 4 of 4 pictures are located (0 of 4 as it is): tilt_rad = -0.2618",
    ),
    "upside down": (
        {"change": lambda frame: frame[::-1, ::-1]},
        "pictures: with the pictures turned by 180 degrees 4 of 4 pictures are located (0 of 4 as it is)",
    ),
    "turned": (
        {"change": np.rot90},
        "pictures: with the pictures turned by 90 degrees to the right 4 of 4 pictures are located (0 of 4 as it is)",
    ),
    "lens of half size": (
        {"camera": replace(FORWARD, focal_px=(114.0, 114.0), center_px=(79.5, 59.5))},
        "lens: with focal length and centre taken as those of pictures of half the size 4 of 4 pictures are located",
    ),
    "lens of another model": (
        {"camera": FisheyeCamera((320, 240), (228.0, 228.0), (159.5, 119.5), 0.45, tilt_rad=TILT_RAD), "truth": TRUTH},
        re.compile(r"lens: with a pinhole lens instead of a fisheye 4 of 4 pictures agree with the truth "),
    ),
    "distortion of another model": (
        {"camera": replace(FORWARD, distortion=(-0.6, 0.3, 0.0, 0.0)), "truth": TRUTH},
        re.compile(r"lens: with distortion = \[\] in the camera file 4 of 4 pictures agree with the truth "),
    ),
    "focal length": (
        {"camera": replace(FORWARD, focal_px=(200.0, 200.0)), "truth": TRUTH},
        re.compile(r"focal length: with a focal length of 2[23]\d instead of 200 pixels 4 of 4 pictures agree "),
    ),
    "height": (
        {"camera": replace(FORWARD, height_m=0.37), "truth": TRUTH},
        re.compile(r"height: with a height of 0\.4[2-4]\d instead of 0\.370 m 4 of 4 pictures agree "),
    ),
    "height that is fitted in most frames": (
        {"camera": replace(FORWARD, height_m=0.39), "truth": TRUTH},
        re.compile(r"lens: by 3 images .* the height 0\.45\d \+- 0\.00\d m, .*; not so height_m of the camera file"),
    ),
    "another field": (
        {"field": "msl_18x12"},
        "field: with field 'spl_2020' instead of 'msl_18x12' 4 of 4 pictures are located (0 of 4 as it is)",
    ),
    "truth in millimetres and degrees": (
        {"truth": [(1e3 * x, 1e3 * y, math.degrees(theta)) for x, y, theta in TRUTH]},
        "truth: with truth.csv read as lengths in millimetres and headings in degrees 4 of 4 pictures agree with the "
        "truth (0 of 4 as it is)",
    ),
}


@pytest.mark.parametrize(
    "slip", [slip if slip in ("tilt", "upside down") else pytest.param(slip, marks=pytest.mark.slow) for slip in SLIPS]
)
def test_a_slip_is_named_with_how_many_pictures_it_explains(slip, told, spl_frames):
    """Each case alone finds its slip in camera, field or pictures that is explained by another, or not at all."""
    what, line = SLIPS[slip]
    frames = [what.get("change", np.asarray)(frame) for frame in spl_frames]
    status, wrong = told(frames, **{key: value for key, value in what.items() if key != "change"})
    assert status == 1
    named = line if isinstance(line, re.Pattern) else re.compile(re.escape(line))
    assert any(named.match(found.removeprefix("WRONG    ")) for found in wrong)


def test_a_lens_that_no_robot_has_is_told_without_a_look(told, spl_frames):
    status, wrong = told(spl_frames[:1], replace(FORWARD, focal_px=(9000.0, 9000.0)))
    assert status == 1
    assert wrong == [
        "WRONG    camera: no robot has this lens: with a focal length of 9000 pixels pictures 320 pixels wide show "
        "2.04 degrees"
    ]


@pytest.mark.slow
def test_swapped_goals_are_named_by_truth(told):
    """Only this finds goals' colours swapped in a field file that pass for a wrong camera."""
    field = load_field("four_legged_2007")
    camera = replace(FORWARD, height_m=0.185, tilt_rad=math.radians(-10.0))
    poses = (Pose2(-0.5, -0.2, 3.0), Pose2(0.3, 0.4, 2.9), Pose2(0.2, -0.3, 0.2), Pose2(-0.4, 0.5, -0.3))
    frames = render(field, camera, poses, 4, margin_m=0.2)
    truth = [(-pose.x_m, -pose.y_m, pose.theta_rad + math.pi) for pose in poses]
    status, wrong = told(frames, camera, "four_legged_2007", truth=truth, symmetry="none")
    assert status == 1
    assert wrong == [
        "WRONG    field: with the goals' colours swapped in the field file 4 of 4 pictures agree with the truth "
        "(0 of 4 as it is)"
    ]


@pytest.mark.slow
def test_odometry_tells_pictures_that_are_flipped(told):
    """Only this finds flipped pictures that pass where a field is its own mirror image and nobody knows the truth."""
    step, poses = Pose2(0.02, 0.0, math.radians(8.0)), [PLACES[0]]
    for _ in range(5):
        poses.append(poses[-1].compose(step))
    frames = render(load_field("spl_2020"), FORWARD, poses, 5, margin_m=0.3)
    assert told([frame[:, ::-1] for frame in frames], motions=[None, *[step] * 5]) == (
        1,
        [
            "WRONG    pictures: with the pictures flipped left to right 6 of 6 pictures agree with the odometry "
            "(2 of 6 as it is): does the driver mirror them?"
        ],
    )


@pytest.mark.slow
def test_truth_that_nothing_explains_is_wrong(told, spl_frames):
    """Only this finds truth of other pictures that is explained by a slip."""
    status, wrong = told(spl_frames, truth=[TRUTH[1], TRUTH[2], TRUTH[3], TRUTH[0]])
    assert status == 1
    assert wrong == [
        "WRONG    truth: 0 of 4 located pictures agree with the truth, and none of the slips tried explains that"
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "named"),
    [
        (0.85, r"curve: floor ranges differ from those of the images by up to 1[67]\.\d %"),
        (
            0.75,
            r"range: with floor ranges 1\.\d+ times those of the camera file [34] of 4 pictures are located \(0 of 4 ",
        ),
    ],
    ids=["some pictures are located", "none is located"],
)
def test_a_mirror_whose_ranges_are_off_is_named(tmp_path, nominal_samples, paper_camera, capsys, ratio, named):
    """Only this finds a mirror's wrong ranges that pass where walls alone show them, or mirroring judged by nothing."""
    curve = paper_camera.floor_range
    other = replace(curve, A_px_per_m=curve.A_px_per_m / ratio, B_per_m=curve.B_per_m / ratio)
    for number, one in enumerate(nominal_samples[:4]):
        cv2.imwrite(str(tmp_path / f"{number}.png"), one.frame)
    save_camera(replace(paper_camera, floor_range=other), tmp_path / "camera.toml")
    assert main(["check", str(tmp_path), "--field", "ssl_2001", "--camera", str(tmp_path / "camera.toml")]) == 1
    printed = capsys.readouterr().out
    assert re.search(named + ".*: robocup-vision calibrate omni --start CAMERA", printed)
    assert ("unknown  mirrored: a field looks the same in a mirror" in printed) == (ratio == 0.85)


@pytest.mark.slow
def test_a_focal_length_with_which_every_picture_is_located_is_corrected(told, spl_frames):
    """Only this finds a lens a little off that passes because every picture is located."""
    status, wrong = told(spl_frames, replace(FORWARD, focal_px=(235.0, 235.0)))
    assert status == 1
    named = re.match(
        r"WRONG    lens: by [34] images the focal length is (\S+) \+- (\S+) px, .*; not so focal_px", wrong[0]
    )
    assert named is not None
    assert abs(float(named[1]) - FORWARD.focal_px[0]) < 3 * float(named[2])
