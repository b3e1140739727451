"""Markings in pictures with known truth: lines, crossings, circles and posts, without a pose and with."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import FrameError
from robocup_vision.camera import FisheyeCamera, OmniCamera, PinholeCamera, Tangent
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.perception.markings import correlated_errors
from robocup_vision.perception.markings.field_features import FieldFeatures
from robocup_vision.perception.markings.finder import MarkingFinder, MarkingSource
from robocup_vision.perception.markings.marking import Markings
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera

NEGATIVES = Path(__file__).resolve().parents[5] / "shared" / "real" / "negatives"
AHEAD = PinholeCamera(
    (320, 240),
    (260.0, 260.0),
    (159.5, 119.5),
    0.5,
    pan_rad=0.0,
    tilt_rad=-0.35,
    roll_rad=0.0,
    height_std_m=0.003,
    roll_std_rad=0.008,
)
FISHEYE = FisheyeCamera(
    (320, 240),
    (110.0, 110.0),
    (159.5, 119.5),
    0.6,
    pan_rad=0.0,
    tilt_rad=-0.6,
    roll_rad=0.0,
    height_std_m=0.003,
    roll_std_rad=0.008,
    projection="equidistant",
)
MIRROR = OmniCamera((320, 240), (160.3, 118.6), (20.0, 110.0), Tangent(2.1456, 0.0114))
SETUPS = {
    "standard platform, ahead": ("spl_2020", AHEAD),
    "humanoid, ahead": ("humanoid_kid_2025", AHEAD),
    "four-legged, ahead": ("four_legged_2007", replace(AHEAD, height_m=0.25, height_std_m=0.002)),
    "middle size, fisheye": ("msl_18x12", replace(FISHEYE, height_m=0.75)),
    "middle size, mirror": ("msl_6x4", MIRROR),
    "small size, mirror": ("ssl_2001", sekimori_camera()),
}


def places(field):
    """Return poses before what is worth looking at, on all sides of it."""
    x, y = field.length_m / 2, field.width_m / 2
    for to_x, to_y in ((x, y), (0.0, y), (0.0, 0.0), (x, 0.3 * y)):
        away = 0.35 * field.width_m
        turn = math.atan2(-to_y, -to_x or 1.0) + 0.35
        at = to_x + away * math.cos(turn), to_y + away * math.sin(turn)
        yield Pose2(*at, math.atan2(to_y - at[1], to_x - at[0]) + 0.1)


def held(camera, rng):
    """Return a forward camera off by what it states."""
    if not isinstance(camera, PinholeCamera):
        return camera
    tilt, roll = rng.standard_normal(2) * camera.sway_std_rad
    return camera.with_orientation(0.0, camera.tilt_rad + tilt, roll)


def line_errors(segment, pose, lines):
    """Squared errors, in standard deviations, of a segment as each line that it may lie on."""
    squared = []
    middle = (np.array(segment.start_m) + segment.end_m) / 2
    for ends in lines.reshape(-1, 2, 2):
        start, end = pose.inverse().transform(ends)
        way = (end - start) / np.hypot(*(end - start))
        if not -0.1 <= (middle - start) @ way <= np.hypot(*(end - start)) + 0.1:
            continue
        turn = math.remainder(math.atan2(-way[0], way[1]) - segment.angle_rad, math.pi)
        normal = np.array([math.cos(segment.angle_rad + turn), math.sin(segment.angle_rad + turn)])
        error = np.array([turn, normal @ start - segment.distance_m])
        squared.append(error @ np.linalg.solve(segment.covariance, error))
    return squared


def place_errors(spot, pose, places_m):
    """Squared errors, in standard deviations, of a spot as each of some places of the field."""
    error = pose.inverse().transform(places_m) - (spot.x_m, spot.y_m)
    return np.einsum("ni,ij,nj->n", error, np.linalg.inv(spot.covariance), error)


@pytest.fixture(scope="module")
def seen(paint_field):
    """Pictures of every set-up: field, camera as its file says, pose, picture, and the markings found alone."""
    shots = {}
    for name, (field_name, camera) in SETUPS.items():
        field, rng = load_field(field_name), np.random.default_rng(7)
        finder, shots[name] = MarkingFinder(field), []
        for pose in places(field):
            frame = paint_field(held(camera, rng), field, pose, noise=3.0, rng=rng)
            shots[name].append((field, camera, pose, frame, finder.find(frame, camera)))
    return shots


@pytest.mark.parametrize("name", SETUPS)
def test_segments_lie_on_lines_of_the_field(seen, name):
    told = [(one, pose, field) for field, _, pose, _, markings in seen[name] for one in markings.segments]
    assert len(told) >= 5
    right = [min(line_errors(one, pose, field.lines), default=math.inf) < 14.0 for one, pose, field in told]
    assert np.mean(right) >= 0.9


@pytest.mark.parametrize("name", SETUPS)
def test_crossings_are_those_of_the_field_and_of_their_kind(seen, name):
    for field, _, pose, _, markings in seen[name]:
        features = FieldFeatures(field)
        for one in markings.crossings:
            errors = place_errors(one, pose, features.crossings_m)
            best = int(np.argmin(errors))
            assert errors[best] < 25.0
            assert one.kind in (None, features.kinds[best])


def test_crossings_of_every_setup_with_corners_are_found(seen):
    for name in SETUPS:
        if name != "small size, mirror":
            assert any(markings.crossings for *_, markings in seen[name])


def test_the_centre_circle_is_found(seen):
    for name in SETUPS:
        found = [(one, pose) for *_, pose, _, markings in seen[name] for one in markings.circles]
        assert found
        for one, pose in found:
            arcs = seen[name][0][0].arcs
            assert min(place_errors(one, pose, arcs[np.isclose(arcs[:, 2], one.radius_m), :2])) < 25.0


@pytest.mark.parametrize("name", SETUPS)
def test_a_pose_names_what_is_found_and_moves_nothing(seen, name):
    for field, camera, pose, frame, alone in seen[name]:
        estimate = PoseEstimate(pose, np.diag([1e-4, 1e-4, 1e-4]), 1.0, 0.0)
        named = MarkingFinder(field).find(frame, camera, estimate)
        assert [one.start_m for one in named.segments] == [one.start_m for one in alone.segments]
        lines = {tuple(line) for line in field.lines.tolist()}
        features = FieldFeatures(field)
        assert {one.feature_m for one in named.segments} <= lines | {None}
        kinds = dict(zip(map(tuple, features.crossings_m.tolist()), features.kinds, strict=True))
        for one in named.crossings:
            assert one.feature_m is not None
            assert one.kind == kinds[one.feature_m]
        for one in named.circles:
            assert one.feature_m in {tuple(arc[:2]) for arc in field.arcs.tolist()}
        assert sum(one.feature_m is None for one in named.segments) <= 1


def test_half_a_turn_about_the_centre_changes_names_alone(seen):
    for field, camera, pose, frame, _ in seen["standard platform, ahead"]:
        estimate = PoseEstimate(pose, np.diag([1e-4, 1e-4, 1e-4]), 1.0, 0.0)
        finder = MarkingFinder(field)
        one, other = finder.find(frame, camera, estimate), finder.find(frame, camera, estimate.half_turn())
        for mine, turned in zip(one.crossings, other.crossings, strict=True):
            assert (mine.x_m, mine.y_m, mine.kind) == (turned.x_m, turned.y_m, turned.kind)
            np.testing.assert_allclose(mine.feature_m, -np.array(turned.feature_m), atol=1e-9)


def test_a_turned_head_turns_the_markings(seen):
    field, camera, _, frame, ahead = seen["standard platform, ahead"][0]
    turned = MarkingFinder(field).find(frame, camera.with_orientation(0.7, camera.tilt_rad, camera.roll_rad))
    assert len(turned.crossings) == len(ahead.crossings) > 0
    for one, other in zip(ahead.crossings, turned.crossings, strict=True):
        np.testing.assert_allclose(
            Pose2(0.0, 0.0, 0.7).transform((one.x_m, one.y_m)), (other.x_m, other.y_m), atol=1e-6
        )
        assert one.kind == other.kind


def test_noise_widens_what_points_tell(paint_field, monkeypatch):
    field, rng = load_field("spl_2020"), np.random.default_rng(3)
    camera = replace(AHEAD, height_std_m=0.0, roll_std_rad=0.0)
    monkeypatch.setattr(correlated_errors, "_BIAS_PX", 0.0)
    finder = MarkingFinder(field)
    stds = []
    for noise in (1.0, 12.0):
        frame = paint_field(camera, field, Pose2(3.0, 1.5, 0.5), noise=noise, rng=rng)
        stds.append(min(math.sqrt(one.covariance[0, 0]) for one in finder.find(frame, camera).segments))
    assert stds[1] > 1.05 * stds[0]


@pytest.mark.parametrize("change", [{"roll_std_rad": 0.03}, {"height_std_m": 0.05}])
def test_a_camera_that_is_known_less_well_tells_less(seen, change):
    field, camera, _, frame, before = seen["standard platform, ahead"][0]
    after = MarkingFinder(field).find(frame, replace(camera, **change))
    for one, other in zip(before.crossings[:1], after.crossings[:1], strict=True):
        assert np.linalg.eigvalsh(other.covariance - one.covariance)[1] > 1e-5


def test_segments_keep_what_they_promise(seen):
    for name in SETUPS:
        for *_, markings in seen[name]:
            for one in markings.segments:
                normal = np.array([math.cos(one.angle_rad), math.sin(one.angle_rad)])
                for end in (one.start_m, one.end_m):
                    assert normal @ end == pytest.approx(one.distance_m, abs=1e-6)
                assert one.distance_m >= 0.0
                assert (normal[1], -normal[0]) @ (np.array(one.end_m) - one.start_m) == pytest.approx(-one.length_m)
                assert np.linalg.eigvalsh(one.covariance)[0] > 0
                assert not one.covariance.flags.writeable


@pytest.mark.parametrize("camera", [AHEAD, FISHEYE, MIRROR])
def test_nothing_is_told_where_nothing_is_painted(camera):
    width, height = camera.size_px
    rng = np.random.default_rng(1)
    carpet = np.clip(rng.normal((50, 130, 45), 3.0, (height, width, 3)), 0, 255).astype(np.uint8)
    noise = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    finder = MarkingFinder(load_field("spl_2020"))
    for frame in (carpet, noise, np.zeros_like(carpet), np.full_like(carpet, 255)):
        assert not finder.find(frame, camera)


@pytest.mark.skipif(not NEGATIVES.is_dir(), reason="the photographs are not here")
def test_photographs_of_other_things_have_next_to_no_crossings():
    paths = sorted(NEGATIVES.glob("**/*.jpg"))[::4]
    finder = MarkingFinder(load_field("spl_2020"))
    told = 0
    for path in paths:
        image = cv2.resize(cv2.imread(str(path)), AHEAD.size_px, interpolation=cv2.INTER_AREA)
        told += len(finder.find(image, AHEAD).crossings)
    assert told <= 0.2 * len(paths)


def goal_picture(field, camera, pose):
    """Draw white posts with a bar on the carpet, from their sides, which shows nothing of the library's."""
    width, height = camera.size_px
    frame = np.full((height, width, 3), (90, 100, 110), dtype=np.uint8)
    v = np.arange(height)[:, None]
    horizon = camera.center_px[1] + camera.focal_px[1] * math.tan(camera.tilt_rad)
    frame[np.broadcast_to(v > horizon + 4, (height, width))] = (50, 130, 45)
    inverse = pose.inverse()
    for goal in field.goals:
        for y in (goal.width_m / 2, -goal.width_m / 2):
            x_m, y_m = inverse.transform((goal.line_x_m, y))
            if x_m < 0.5:
                continue
            away = math.hypot(x_m, y_m)
            side = goal.post_radius_m * np.array([-y_m, x_m]) / away
            corners = [(x_m + k * side[0], y_m + k * side[1], z) for z in (0.0, goal.height_m) for k in (1, -1)]
            u = camera.point_to_pixel(np.array(corners))
            cv2.fillPoly(frame, [np.rint(u[[0, 1, 3, 2]]).astype(np.int32)], (235, 235, 235), cv2.LINE_AA)
    return frame


def test_goal_posts_stand_where_they_are():
    field = load_field("spl_2020")
    camera = PinholeCamera(
        (640, 480), (500.0, 500.0), (319.5, 239.5), 0.46, pan_rad=0.0, tilt_rad=-0.2, roll_rad=0.0, roll_std_rad=0.003
    )
    features, found = FieldFeatures(field), 0
    for pose in (Pose2(2.0, 0.3, 0.0), Pose2(2.8, -0.5, 0.3), Pose2(-2.0, 0.2, math.pi)):
        frame = goal_picture(field, camera, pose)
        estimate = PoseEstimate(pose, np.diag([1e-4, 1e-4, 1e-4]), 1.0, 0.0)
        posts = MarkingFinder(field).find(frame, camera, estimate).posts
        found += len(posts)
        for post in posts:
            errors = place_errors(post, pose, features.posts_m)
            assert errors.min() < 9.0
            assert post.feature_m == tuple(features.posts_m[int(np.argmin(errors))])
        assert MarkingFinder(load_field("msl_6x4")).find(frame, camera).posts == ()
    assert found >= 5


def test_a_view_has_markings_only_where_the_tilt_is_known(paint_field):
    field, rng = load_field("spl_2020"), np.random.default_rng(2)
    frame = paint_field(AHEAD, field, Pose2(3.0, 1.5, 0.5), noise=2.0, rng=rng)
    view = Vision(field, AHEAD).look(frame)
    assert view.markings.segments
    assert view.markings is view.markings
    unknown = Vision(field, replace(AHEAD, tilt_rad=None, roll_rad=None, roll_std_rad=None)).look(np.zeros_like(frame))
    assert unknown.markings == Markings()
    assert not Vision(field, AHEAD).look(None).markings


def test_a_frame_written_to_since_is_told(paint_field):
    field, rng = load_field("spl_2020"), np.random.default_rng(2)
    frame = paint_field(AHEAD, field, Pose2(3.0, 1.5, 0.5), noise=2.0, rng=rng)
    view = Vision(field, AHEAD).look(frame)
    kept = view.of_frame(frame.copy())
    frame[...] = 0
    with pytest.raises(FrameError, match="written to since"):
        _ = view.markings
    assert kept.markings.segments
    source = kept.marking_source
    assert isinstance(source, MarkingSource)
    assert source.find(NotLocated("?")).segments


def test_a_field_knows_its_crossings():
    features = FieldFeatures(load_field("spl_2020"))
    kinds = dict(zip(map(tuple, features.crossings_m.tolist()), features.kinds, strict=True))
    assert len(kinds) == 22
    assert {place for place, kind in kinds.items() if kind == "L"} >= {(4.5, 3.0), (3.9, 1.1), (-2.85, 2.0)}
    assert kinds[0.0, 3.0] == kinds[4.5, 1.1] == kinds[-4.5, -2.0] == "T"
    assert len(features.posts_m) == 4


def test_markings_move_as_the_robot_does(seen):
    _, _, pose, _, markings = seen["standard platform, ahead"][0]
    robot = Pose2(2.5, -1.0, 2.0)
    moved = markings.moved(robot)
    assert markings.moved(Pose2(0.0, 0.0, 0.0)) is markings
    back = moved.moved(robot.inverse())
    lines = load_field("spl_2020").lines
    for one, other, again in zip(markings.segments, moved.segments, back.segments, strict=True):
        assert other.distance_m >= 0.0
        assert min(line_errors(other, pose.compose(robot), lines)) == pytest.approx(
            min(line_errors(one, pose, lines)), rel=0.05
        )
        assert (again.angle_rad, again.distance_m) == pytest.approx((one.angle_rad, one.distance_m))
        np.testing.assert_allclose(again.covariance, one.covariance, atol=1e-9)
    for one, other in zip(markings.crossings, moved.crossings, strict=True):
        np.testing.assert_allclose(robot.transform((other.x_m, other.y_m)), (one.x_m, one.y_m), atol=1e-9)
        assert np.linalg.det(other.covariance) == pytest.approx(np.linalg.det(one.covariance))
