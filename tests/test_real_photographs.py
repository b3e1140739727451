"""Photographs from robots, where the folder beside the project has them: poses, line residuals, a field file."""

import csv
import math
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from robocup_vision.calibration.forward.calibrate import calibrate_forward
from robocup_vision.calibration.forward.starts import KnownOfCamera
from robocup_vision.camera import load_camera
from robocup_vision.estimates import PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.line_map import LineMap
from robocup_vision.vision import Vision

REAL = Path(__file__).resolve().parents[2] / "shared" / "real"
DATA = Path(__file__).parent / "data"
# drawn about each given pose of a forward camera
PRIORS = 6
needs_photographs = pytest.mark.skipif(not REAL.is_dir(), reason="the photographs are not here")


def look(folder, image):
    camera = load_camera(REAL / folder / "camera.toml")
    frame = cv2.imread(str(REAL / folder / "images" / image), cv2.IMREAD_COLOR)
    return camera, Vision(load_field("msl_6x4"), camera, method="field").look(frame)


@needs_photographs
def test_the_first_robot_is_located_by_the_lines():
    camera, view = look("omni_msl_6x4", "a_center.png")
    assert view.pose
    distance, angle = view.pose.pose.error_to(Pose2(0.102, 0.048, math.radians(-1.5)), symmetric=True)
    assert distance < 0.03
    assert math.degrees(angle) < 1.0
    with (REAL / "omni_msl_6x4" / "line_points_a_center.csv").open() as file:
        rows = [[float(v) for v in list(row.values())[:2]] for row in csv.DictReader(file)]
    floor = camera.pixel_to_floor(np.array(rows))
    residual = LineMap(load_field("msl_6x4")).nearest(view.pose.pose.transform(floor)).distance_m
    assert len(residual) > 3000
    assert np.median(residual) <= 0.02
    assert np.percentile(residual, 90) <= 0.05


@needs_photographs
def test_the_second_robot_is_located_near_the_centre():
    _, view = look("omni_msl_6x4_b", "b_center.png")
    assert view.pose
    assert math.hypot(view.pose.pose.x_m, view.pose.pose.y_m) < 0.4
    assert view.pose.inlier_ratio > 0.6


@needs_photographs
@pytest.mark.parametrize("folder", ["omni_msl_6x4", "omni_msl_6x4_b"])
def test_free_floor_around_a_real_robot(folder):
    _, view = look(folder, "a_center.png" if folder == "omni_msl_6x4" else "b_center.png")
    # both stand in the middle of an empty field
    assert np.median(view.free_space.range_m) > 1.0


def test_the_onboard_field_file_has_the_numbers_it_was_given():
    field = load_field(Path(__file__).parent / "data" / "onboard_ssl_field.toml")
    assert (field.length_m, field.width_m) == (7.8, 5.4)
    assert field.boundary == "boards"
    assert field.wall_color == "black"
    np.testing.assert_allclose(np.abs(field.floor_polygon).max(axis=0), (4.2, 3.0))
    for goal, side in zip(field.goals, (1, -1), strict=True):
        assert (goal.width_m, goal.height_m, goal.line_x_m) == (1.0, 0.155, side * 3.9)
    corners = field.lines.reshape(-1, 2)
    for corner in ((3.9, 0.9), (3.0, 0.9), (3.0, -0.9), (-3.0, 0.9)):  # penalty areas 0.9 deep, 1.8 wide
        assert np.hypot(*(corners - corner).T).min() < 1e-9


@pytest.mark.slow
@needs_photographs
def test_floor_lines_and_pose_of_a_forward_camera():
    """Only this finds floor, lines or refined priors that real pictures of a field belie."""
    folder = REAL / "onboard_ssl"
    camera = load_camera(folder / "camera.toml")
    vision = Vision(load_field(Path(__file__).parent / "data" / "onboard_ssl_field.toml"), camera)
    width, height = camera.size_px
    v, u = np.mgrid[:height, :width]
    floor = camera.pixel_to_floor(np.stack([u, v], axis=-1))
    rng = np.random.default_rng(3)
    overlaps, before, after = [], [], []
    with (folder / "truth.csv").open() as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        truth = Pose2(*(float(row[key]) for key in ("x_m", "y_m", "theta_rad")))
        frame = cv2.imread(str(folder / "images" / row["image"]))
        for _ in range(PRIORS):
            turn, side = rng.uniform(0, math.tau), rng.choice([-1.0, 1.0])
            start = Pose2(
                truth.x_m + 0.1 * math.cos(turn),
                truth.y_m + 0.1 * math.sin(turn),
                truth.theta_rad + side * math.radians(5),
            )
            prior = PoseEstimate(start, np.diag([0.1, 0.1, math.radians(5)]) ** 2, 1.0, 0.0)
            vision.forget()
            view = vision.look(frame, prior=prior)
            if view.pose:
                before.append(start.error_to(truth))
                after.append(view.pose.pose.error_to(truth))
        edge = view.boundary_px[np.isfinite(view.boundary_px).all(axis=1)]
        edge = edge[np.argsort(edge[:, 0])]
        seen = v >= np.interp(np.arange(width), edge[:, 0], edge[:, 1])
        there = np.abs(truth.transform(np.nan_to_num(floor, nan=99.0).reshape(-1, 2))).reshape(height, width, 2)
        carpet = (there[..., 0] <= 4.2) & (there[..., 1] <= 3.0)
        overlaps.append((seen & carpet).sum() / (seen | carpet).sum())
    assert min(overlaps) > 0.92
    assert np.mean(overlaps) > 0.95
    # a frame that hardly tells more than its prior is refused
    assert len(after) >= 0.85 * PRIORS * len(rows)
    # the given poses are those of another moment where the robot moves: in one picture by 5 degrees
    assert (np.mean(after, axis=0) <= np.mean(before, axis=0)).all()
    assert max(away_m for away_m, _ in after) < 0.25


def fisheye_photographs(start):
    paths = sorted((REAL / "msl_fisheye" / "images").glob(f"{start}*"))
    assert paths
    return [cv2.imread(str(path)) for path in paths]


@needs_photographs
@pytest.mark.slow
def test_a_lens_by_photographs_of_which_some_are_placed_wrongly():
    """Only this finds a lens that wrongly placed photographs draw along: by it, poses known otherwise are not found."""
    field, start = load_field(DATA / "msl_2022_field.toml"), "20220716"
    found = calibrate_forward(field, fisheye_photographs(start), KnownOfCamera("fisheye", height_m=0.77, tilt_rad=0.0))
    assert found
    assert found.camera.focal_px[0] == pytest.approx(338.0, abs=5.0)
    vision = Vision(field, found.camera)
    with (REAL / "msl_fisheye" / "poses.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["image"].startswith(start)]
    for row in rows:
        known = Pose2(*(float(row[key]) for key in ("x_m", "y_m", "theta_rad")))
        prior = PoseEstimate(known.compose(Pose2(0.1, -0.1, 0.03)), np.diag([0.15, 0.15, 0.05]) ** 2, 1.0, 0.0)
        vision.forget()
        pose = vision.look(cv2.imread(str(REAL / "msl_fisheye" / "images" / row["image"])), prior=prior).pose
        assert pose
        # the known poses are good to 10 cm
        assert pose.pose.error_to(known)[0] < 0.1


@needs_photographs
@pytest.mark.parametrize("start", ["20250208_r4_cam0", "20250717_r4_cam0", "20260503_r3_cam0"])
def test_what_looks_like_a_goal_gives_no_pose_against_the_lines(start):
    """Each shows something white and upright; the poses that it would give put lines on bare carpet."""
    camera = load_camera(DATA / "msl_fisheye_camera.toml")
    (frame,) = fisheye_photographs(start)
    assert not Vision(load_field(DATA / "msl_fisheye_field.toml"), camera).look(frame).pose


@needs_photographs
def test_a_ball_is_found_though_a_yellow_goal_is_the_brightest_thing_in_view():
    camera = load_camera(DATA / "omni_junior_camera.toml")
    vision = Vision(load_field(DATA / "omni_junior_field.toml"), camera)
    view = vision.look(cv2.imread(str(REAL / "omni_junior" / "images" / "frame9.jpg")))
    ball_m = camera.pixel_to_floor(np.array([553.0, 509.0]))
    assert len(view.balls) == 1
    assert math.hypot(view.balls[0].x_m - ball_m[0], view.balls[0].y_m - ball_m[1]) < 0.05
