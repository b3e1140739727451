"""Laws of the published hull fit, on floors painted without the renderer."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import cameras, numbers

from benchmarks.mirror.paper_table1 import PRINTED, errors, pictures
from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision import Vision
from robocup_vision.camera import Hyperboloid, OmniCamera
from robocup_vision.geometry import Pose2
from robocup_vision.localization.baselines.floor_hull import HullFitter, polygon_moments
from robocup_vision.perception.color_table import build_color_table, learn_colors
from robocup_vision.perception.polar_view import PolarView

FIELD = load_field("ssl_2001")
CAMERA = OmniCamera((256, 220), (127.5, 109.5), (26.0, 112.0), Hyperboloid(10120.0, 20.54, 229800.0))
CARPET_BGR, WALL_BGR = (50, 130, 45), (225, 230, 225)
# what one pixel is worth on the floor at the field's far walls, metres
FAR_PIXEL_M = 0.15


def project(camera: OmniCamera, pose: Pose2, field=FIELD) -> np.ndarray:
    """Paint the floor as it is seen without obstacles, noise or blur, (H, W) uint8."""
    width, height = camera.size_px
    v, u = np.mgrid[:height, :width]
    floor_m = camera.pixel_to_floor(np.stack([u, v], axis=-1))
    radius = np.hypot(u - camera.center_px[0], v - camera.center_px[1])
    inner, outer = camera.usable_radius_px
    seen = field.contains(pose.transform(np.nan_to_num(floor_m, nan=1e3))) & (radius >= inner) & (radius <= outer)
    return seen.astype(np.uint8)


def sees_all_walls(camera: OmniCamera, pose: Pose2) -> bool:
    """Whether every wall's foot lies well inside the view, and no pixel there is worth more than `FAR_PIXEL_M`."""
    low, high = FIELD.walls[:, None, :2], FIELD.walls[:, None, 2:]
    feet_m = pose.inverse().transform((low + (high - low) * np.linspace(0, 1, 9)[:, None]).reshape(-1, 2))
    feet_px = camera.floor_to_pixel(feet_m)
    if not np.isfinite(feet_px).all():
        return False
    delta = feet_px - camera.center_px
    radius = np.hypot(*delta.T)
    onwards_m = camera.pixel_to_floor(feet_px + delta / radius[:, None])
    inside = (feet_px > 3).all() and (feet_px < np.array(camera.size_px) - 4).all()
    inner, outer = camera.usable_radius_px
    near = np.hypot(*(onwards_m - feet_m).T) <= FAR_PIXEL_M
    return bool(inside and near.all() and radius.min() > inner and radius.max() < outer - 3)


def poses_inside() -> st.SearchStrategy[Pose2]:
    return st.builds(Pose2, numbers(-1.2, 1.2), numbers(-0.65, 0.65), numbers(-math.pi, math.pi))


@settings(max_examples=10)
@given(pose=poses_inside())
def test_a_clean_floor_gives_the_pose_up_to_a_half_turn(pose: Pose2) -> None:
    estimate = HullFitter(FIELD, CAMERA).locate_floor(project(CAMERA, pose))
    assert estimate
    position_m, heading_rad = estimate.pose.error_to(pose, symmetric=True)
    assert position_m < 0.02
    assert heading_rad < math.radians(0.5)
    assert estimate.candidates == (estimate.pose, estimate.pose.half_turn())
    assert estimate.inlier_ratio > 0.8
    assert estimate.residual_px < 0.6
    assert np.all(np.linalg.eigvalsh(estimate.covariance) > 0)


@pytest.mark.slow
@given(camera=cameras(), pose=poses_inside())
def test_any_mirror_camera(camera: OmniCamera, pose: Pose2) -> None:
    """Only this finds a fit that holds for the paper's mirror alone."""
    assume(sees_all_walls(camera, pose))
    estimate = HullFitter(FIELD, camera).locate_floor(project(camera, pose))
    assert estimate
    position_m, heading_rad = estimate.pose.error_to(pose, symmetric=True)
    assert position_m < 0.5 * FAR_PIXEL_M
    assert heading_rad < math.radians(3)


@pytest.mark.parametrize(
    "change",
    [
        {"mirrored": True},
        {"heading_rad": 2.0},
        {"offset_m": (0.1, -0.05)},
        {"tilt_rad": (0.01, -0.02)},
        {"center_px": (129.0, 107.0)},
    ],
)
def test_each_way_a_camera_may_differ(change: dict) -> None:
    camera, pose = dataclasses.replace(CAMERA, **change), Pose2(0.4, -0.2, 0.7)
    estimate = HullFitter(FIELD, camera).locate_floor(project(camera, pose))
    assert estimate
    position_m, heading_rad = estimate.pose.error_to(pose, symmetric=True)
    assert position_m < 0.03
    assert heading_rad < math.radians(1)
    # the same picture read with the wrong camera is somewhere else, or nowhere
    wrong = HullFitter(FIELD, CAMERA).locate_floor(project(camera, pose))
    assert not wrong or sum(wrong.pose.error_to(pose, symmetric=True)) > 2 * (position_m + heading_rad)


def test_a_field_that_is_longer_across_is_fitted_as_well() -> None:
    turned = dataclasses.replace(FIELD, floor_polygon=FIELD.floor_polygon[:, ::-1][::-1] * 0.9, goals=())
    pose = Pose2(0.2, 0.5, -2.0)
    estimate = HullFitter(turned, CAMERA).locate_floor(project(CAMERA, pose, turned))
    assert estimate
    assert estimate.pose.error_to(pose, symmetric=True)[0] < 0.03


def test_obstacles_at_the_walls_cost_little() -> None:
    pose = Pose2(0.3, 0.1, 0.5)
    floor = project(CAMERA, pose)
    delta = np.moveaxis(np.mgrid[:220, :256][::-1], 0, -1) - CAMERA.center_px
    bearing, radius = np.arctan2(-delta[..., 1], delta[..., 0]), np.hypot(delta[..., 0], delta[..., 1])
    floor[(np.abs(bearing - 1.0) < 0.25) & (radius > 60)] = 0
    floor[(np.abs(bearing + 2.0) < 0.15) & (radius > 50)] = 0
    estimate = HullFitter(FIELD, CAMERA).locate_floor(floor)
    assert estimate
    assert estimate.pose.error_to(pose, symmetric=True)[0] < 0.08


@given(
    half_x=numbers(0.5, 4.0),
    half_y=numbers(0.5, 4.0),
    pose=st.builds(Pose2, numbers(-3, 3), numbers(-3, 3), numbers(-3, 3)),
)
def test_moments_of_a_rectangle(half_x: float, half_y: float, pose: Pose2) -> None:
    corners = pose.transform(np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (half_x, half_y))
    for order in (corners, corners[::-1]):
        moments = polygon_moments(order)
        assert moments is not None
        np.testing.assert_allclose(moments.frame.array[:2], pose.array[:2], atol=1e-9)
        assert moments.elongation == pytest.approx(max(half_x / half_y, half_y / half_x), rel=1e-6)
        if abs(half_x - half_y) > 0.05:
            long_axis = pose.theta_rad + (0 if half_x > half_y else math.pi / 2)
            assert abs(math.sin(moments.frame.theta_rad - long_axis)) < 1e-6


@pytest.fixture(scope="module")
def frame_and_pose() -> tuple[np.ndarray, Pose2]:
    pose = Pose2(-0.5, 0.2, 2.4)
    seen = project(CAMERA, pose)[..., None] > 0
    frame = np.where(seen, np.array(CARPET_BGR), np.array(WALL_BGR)).astype(np.float64)
    v, u = np.mgrid[:220, :256]
    points = pose.transform(np.nan_to_num(CAMERA.pixel_to_floor(np.stack([u, v], axis=-1)), nan=1e3))
    frame[(np.abs(points[..., 0]) < 0.01) & seen[..., 0]] = WALL_BGR
    # something green beyond the walls
    frame[104:112, 232:237] = CARPET_BGR
    frame += np.random.default_rng(5).normal(0, 3, frame.shape)
    return np.clip(frame, 0, 255).astype(np.uint8), pose


@pytest.mark.parametrize("pose", [Pose2(-0.5, 0.2, 2.4), Pose2(0.7, -0.3, 0.4)])
def test_the_floor_is_seen_to_its_edge_and_no_farther(pose: Pose2) -> None:
    # each pixel shows the mean of 5 x 5 rays
    steps = np.linspace(-0.4, 0.4, 5)
    v, u = np.mgrid[:220, :256]
    share = np.zeros((220, 256))
    for du in steps:
        for dv in steps:
            floor_m = CAMERA.pixel_to_floor(np.stack([u + du, v + dv], axis=-1))
            share += FIELD.contains(pose.transform(np.nan_to_num(floor_m, nan=1e3))) / 25
    frame = share[..., None] * CARPET_BGR + (1 - share[..., None]) * WALL_BGR
    frame += np.random.default_rng(7).normal(0, 3, frame.shape)
    frame = np.clip(frame, 0, 255).astype(np.uint8)
    view = PolarView(CAMERA)
    colors = learn_colors(view.sample(frame), view.valid, FIELD)
    assert colors is not None
    floor = HullFitter(FIELD, CAMERA).floor_mask(frame, build_color_table(colors))
    seen = (np.hypot(u - 127.5, v - 109.5) >= 26) & (np.hypot(u - 127.5, v - 109.5) <= 112)
    edge_px = np.count_nonzero((share > 0.02) & (share < 0.98) & seen)
    # the centres of the outermost pixels, of which the hull is made, lie on the edge: half a pixel of each is beyond it
    assert 0.2 < (floor[seen].sum() - share[seen].sum()) / edge_px < 0.7


@pytest.mark.slow
def test_as_good_as_printed_at_the_papers_places() -> None:
    """Only this finds a baseline that is worse than its paper, which would flatter all others."""
    vision = Vision(FIELD, CAMERA, method="hull")
    for place, (_, printed) in enumerate(PRINTED):
        found = errors(vision, list(pictures(place, 4, seed=5)))
        assert len(found) == 4
        assert np.all(np.sqrt(np.mean(found**2, axis=0)) <= printed)


def test_vision_locates_a_frame_across_the_centre_line_by_its_name(frame_and_pose) -> None:
    frame, pose = frame_and_pose
    view = Vision(FIELD, CAMERA, method="hull").look(frame)
    assert view.pose
    assert view.pose.pose.error_to(pose, symmetric=True)[0] < 0.05
    dark = Vision(FIELD, CAMERA, method="hull").look(np.full_like(frame, 90))
    assert not dark.pose


def test_masked_pixels_are_no_floor_and_no_edge(frame_and_pose) -> None:
    _, pose = frame_and_pose
    mask = np.zeros((220, 256), dtype=np.uint8)
    mask[:, 80:86] = 1
    floor = project(CAMERA, pose)
    assert floor[:, :80].any()
    floor[mask > 0] = 0
    # what lies behind the strut is hidden too, so that the floor seems to end at the strut
    floor[:, :80] = 0
    with_mask = HullFitter(FIELD, CAMERA, mask).locate_floor(floor)
    without = HullFitter(FIELD, CAMERA).locate_floor(floor)
    assert with_mask
    better = sum(with_mask.pose.error_to(pose, symmetric=True))
    assert not without or better < sum(without.pose.error_to(pose, symmetric=True))


def blank() -> np.ndarray:
    return np.zeros((220, 256), dtype=np.uint8)


def row(*, with_pixel: bool) -> np.ndarray:
    floor = blank()
    floor[100, 50:200] = 1
    floor[101, 60] = with_pixel
    return floor


def disc() -> np.ndarray:
    v, u = np.mgrid[:220, :256]
    return (np.hypot(u - 127.5, v - 109.5) < 60).astype(np.uint8)


def one_wall() -> np.ndarray:
    # floor on one side only, the view's end on all others
    v, u = np.mgrid[:220, :256]
    return ((np.hypot(u - 127.5, v - 109.5) <= 112) & (v > 100)).astype(np.uint8)


@pytest.mark.parametrize(
    ("make", "reason"),
    [
        (blank, "the floor in view encloses no area"),
        (lambda: np.ones((220, 256), dtype=np.uint8), "floor"),
        (disc, "floor's hull"),
        (one_wall, "floor's hull"),
        (lambda: row(with_pixel=False), ""),
        (lambda: row(with_pixel=True), ""),
    ],
)
def test_what_is_no_field_is_not_located(make, reason: str) -> None:
    result = HullFitter(FIELD, CAMERA).locate_floor(make())
    assert not result
    assert reason in result.reason


def test_bad_arguments() -> None:
    with pytest.raises(ArgumentError, match="method 'hull' needs walls or boards, but the floor of 'spl_2020' is not"):
        HullFitter(load_field("spl_2020"), CAMERA)
    with pytest.raises(ArgumentError, match=r"mask must be \(220, 256\), got \(220, 255\)"):
        HullFitter(FIELD, CAMERA, np.zeros((220, 255), dtype=np.uint8))
    square = dataclasses.replace(FIELD, floor_polygon=np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float))
    with pytest.raises(ArgumentError, match="needs a floor that is longer than wide, 'ssl_2001' is square"):
        HullFitter(square, CAMERA)
