"""The overlay: whatever a view says can be drawn, over any frame, without changing it."""

import dataclasses

import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera, Table
from robocup_vision.estimates import EdgePoints, EdgeState, NotLocated
from robocup_vision.geometry import Pose2
from robocup_vision.overlay import (
    BALL_COLOR,
    BOUNDARY_COLOR,
    EDGE_COLORS,
    FIELD_COLOR,
    FREE_COLOR,
    LINE_POINT_COLOR,
    MARKING_COLOR,
    draw,
)
from robocup_vision.vision import Vision
from sim2d.rendering.cameras import sekimori_camera


@pytest.fixture(scope="module")
def vision(ssl_field, paper_camera):
    return Vision(ssl_field, paper_camera)


def fraction_of(picture, color):
    return float((np.abs(picture.astype(int) - color).max(axis=-1) <= 12).mean())


def test_everything_seen_is_drawn_over_an_enlarged_copy(vision, nominal_samples):
    one = next(s for s in nominal_samples if s.scene.ball is not None)
    vision.forget()
    view = vision.look(one.frame)
    assert view.pose
    picture = draw(view, one.frame, vision)
    assert picture.shape == (660, 768, 3)
    assert picture.dtype == np.uint8
    for color in (FIELD_COLOR, BOUNDARY_COLOR, FREE_COLOR):
        assert fraction_of(picture, color) > 3e-4
    assert fraction_of(picture, (255, 255, 255)) > 2e-5  # text; how bold depends on OpenCV's version  # the text
    assert (fraction_of(picture, BALL_COLOR) > 0) == (view.ball is not None)
    assert not np.shares_memory(picture, one.frame)


def test_the_field_lies_where_the_pose_puts_it(vision, nominal_samples):
    vision.forget()
    view = vision.look(nominal_samples[0].frame)
    elsewhere = dataclasses.replace(view.pose, pose=Pose2(0.0, 0.0, 0.0), candidates=())
    here, there = (
        draw(dataclasses.replace(view, pose=pose), np.zeros((220, 256, 3), np.uint8), vision)
        for pose in (view.pose, elsewhere)
    )
    assert fraction_of(np.abs(here.astype(int) - there), (0, 0, 0)) < 0.999
    nowhere = draw(dataclasses.replace(view, pose=NotLocated("too dark")), nominal_samples[0].frame, vision)
    assert fraction_of(nowhere, FIELD_COLOR) < 1e-4


def test_a_blind_view_is_drawn_with_its_reason(vision):
    frame = np.zeros((220, 256, 3), dtype=np.uint8)
    vision.forget()
    view = vision.look(frame)
    assert isinstance(view.pose, NotLocated)
    picture = draw(view, frame, vision)
    assert fraction_of(picture, (255, 255, 255)) > 2e-5  # text; how bold depends on OpenCV's version


def test_a_large_frame_keeps_its_size_and_is_not_drawn_into(ssl_field):
    vision = Vision(ssl_field, sekimori_camera(640, 480))
    frame = np.full((480, 640, 3), (50, 130, 45), dtype=np.uint8)
    kept = frame.copy()
    picture = draw(vision.look(frame), frame, vision)
    assert picture.shape == frame.shape
    np.testing.assert_array_equal(frame, kept)
    assert (picture != frame).any()


def test_a_carpet_field_shows_its_lines_and_arcs(mirror_camera, paint_field):
    field = load_field("msl_6x4")
    vision = Vision(field, mirror_camera)
    frame = paint_field(mirror_camera, field, Pose2(0.4, 0.3, 1.0))
    view = vision.look(frame)
    assert view.pose
    picture = draw(view, frame, vision)
    assert fraction_of(picture, FIELD_COLOR) > 1e-4
    assert fraction_of(picture, LINE_POINT_COLOR) > 1e-4


def test_a_table_that_ends_within_the_free_floor_is_drawn(ssl_field, paper_camera):
    radius = np.linspace(26.0, 60.0, 40)
    table = Table(radius, 1 / paper_camera.floor_range.inverse_range_per_m(radius))
    camera = dataclasses.replace(paper_camera, floor_range=table, offset_m=(0.5, 0.0), viewpoint_height_m=0.205)
    vision = Vision(ssl_field, camera)
    frame = np.full((220, 256, 3), (50, 130, 45), dtype=np.uint8)
    assert draw(vision.look(frame), frame, vision).shape == (660, 768, 3)


def test_predicted_edges_show_whether_they_were_found(vision, nominal_samples):
    vision.forget()
    view = vision.look(nominal_samples[0].frame)
    points = EdgePoints(np.array([[20.0, 20.0], [60.0, 20.0], [100.0, 20.0], [140.0, 20.0]]), np.array(list(EdgeState)))
    picture = draw(dataclasses.replace(view, edge_points=points), np.zeros((220, 256, 3), np.uint8), vision)
    without = draw(view, np.zeros((220, 256, 3), np.uint8), vision)
    for (u, v), state in zip(points.pixels.astype(int) * 3 + 1, EdgeState, strict=True):
        shown = tuple(int(c) for c in picture[v, u])
        assert shown == EDGE_COLORS.get(state, tuple(without[v, u]))
    with pytest.raises(ValueError, match="read-only"):
        points.state[0] = 1


def test_an_image_that_is_handed_over_is_drawn_on(vision, nominal_samples):
    frame = nominal_samples[0].frame
    vision.forget()
    view = vision.look(frame)
    picture = frame.copy()
    assert draw(view, frame, vision, picture) is picture
    assert (picture != frame).mean() > 0.1
    twice = np.zeros((440, 512, 3), dtype=np.uint8)
    assert draw(view, frame, vision, out=twice) is twice
    assert fraction_of(twice, FIELD_COLOR) > 0


def test_rgb_frames_are_drawn_as_they_look(ssl_field, paper_camera, nominal_samples):
    frame = nominal_samples[0].frame
    pictures = []
    for channels, given in (("bgr", frame), ("rgb", np.ascontiguousarray(frame[..., ::-1]))):
        vision = Vision(ssl_field, paper_camera, channels=channels)
        pictures.append(draw(vision.look(given), given, vision))
    np.testing.assert_array_equal(*pictures)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"view": "frame"}, "draw takes a view, its frame and the Vision that looked, got ndarray, ndarray, Vision"),
        ({"vision": None}, "got View, ndarray, NoneType"),
        ({"frame": None}, r"the frame to draw must be \(220, 256, 3\) uint8, got NoneType"),
        ({"frame": np.zeros((480, 640, 3), np.uint8)}, r"must be \(220, 256, 3\) uint8, got \(480, 640, 3\)"),
        ({"out": np.zeros((300, 300, 3), np.uint8)}, r"out must be a whole number times \(220, 256, 3\), got"),
        ({"out": np.zeros((220, 256), np.uint8)}, r"out must be a \(s H, s W, 3\) uint8 array"),
        ({"out": np.zeros((220, 512, 3), np.uint8)[:, ::2]}, "out must be writeable and contiguous"),
    ],
)
def test_what_cannot_be_drawn_is_named(vision, nominal_samples, changes, message):
    frame = nominal_samples[0].frame
    given = {"view": vision.look(frame), "frame": frame, "vision": vision, **changes}
    given["view"] = frame if isinstance(given["view"], str) else given["view"]
    with pytest.raises(ArgumentError, match=message):
        draw(**given)


def test_markings_are_drawn_where_they_are_wanted(paint_field):
    camera = PinholeCamera((320, 240), (260.0, 260.0), (159.5, 119.5), 0.5, pan_rad=0.0, tilt_rad=-0.35, roll_rad=0.0)
    field = load_field("spl_2020")
    frame = paint_field(camera, field, Pose2(3.0, 1.5, 0.5))
    vision = Vision(field, camera)
    view = vision.look(frame)
    plain, marked = draw(view, frame, vision), draw(view, frame, vision, markings=True)
    assert (marked != plain).any()
    assert (marked == MARKING_COLOR).all(axis=2).sum() > 100
    assert not (plain == MARKING_COLOR).all(axis=2).any()
