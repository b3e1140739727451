"""The compiled look-up of views in a frustum against every view of the map, one by one."""

import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from robocup_vision.camera import PinholeCamera
from robocup_vision.kernels.landmarks.index import FloorPlan, InView, views_in_frustum
from robocup_vision.landmarks.index import pinhole_view
from robocup_vision.landmarks.pose_fit import project, to_camera

REACH_M, VIEW_REACH_RAD, CELL_M = 4.0, 0.4, 0.5
COLUMNS = (16, 12)


def floor_plan(rng, count):
    corner = np.array([-4.0, -3.0, 0.0])
    positions = rng.uniform(corner, (4.0, 3.0, 2.0), (count, 3))
    cell = ((positions - corner) / CELL_M).astype(np.int64)
    column = cell[:, 1] * COLUMNS[0] + cell[:, 0]
    order = np.argsort(column, kind="stable")
    starts = np.searchsorted(column[order], np.arange(COLUMNS[0] * COLUMNS[1] + 1))
    return FloorPlan(positions[order], rng.uniform(-math.pi, math.pi, count), starts, COLUMNS, corner, CELL_M)


@settings(deadline=None, max_examples=40)
@given(st.integers(0, 2**32 - 1), st.floats(-0.9, 0.9))
def test_views_in_the_frustum_are_those_of_a_plain_loop(seed, tilt_rad):
    rng = np.random.default_rng(seed)
    camera = PinholeCamera(
        (320, 240), (277.0, 270.0), (159.5, 119.5), 0.6, offset_m=(0.05, -0.03), pan_rad=0.3, tilt_rad=tilt_rad
    )
    plan = floor_plan(rng, 2000)
    pose = rng.uniform((-3, -2, -3), (3, 2, 3))
    out = InView(np.empty(2000, dtype=np.int64), np.empty((2000, 2)), np.empty(2000))
    count = views_in_frustum(pinhole_view(camera), camera.size_px, pose, plan, REACH_M, VIEW_REACH_RAD, out)

    points = to_camera(camera, pose, plan.positions_m)
    pixels = project(camera, points)
    c, s = math.cos(pose[2]), math.sin(pose[2])
    eye = pose[:2] + np.array([[c, -s], [s, c]]) @ camera.viewpoint_m[:2]
    sight = np.arctan2(plan.positions_m[:, 1] - eye[1], plan.positions_m[:, 0] - eye[0])
    off = np.abs(np.remainder(sight - plan.bearings_rad + math.pi, math.tau) - math.pi)
    with np.errstate(invalid="ignore"):
        inside = (pixels >= 0).all(axis=1) & (pixels <= np.array(camera.size_px) - 1).all(axis=1)
    near = np.hypot(*(plan.positions_m[:, :2] - eye).T) <= REACH_M
    expected = np.flatnonzero(
        inside & near & (points[:, 0] >= 0.1) & (points[:, 0] <= REACH_M) & (off <= VIEW_REACH_RAD)
    )
    found = out.number[:count]
    # the floor plan reaches a column farther than the distance on the floor that the plain loop asks for
    np.testing.assert_array_equal(np.sort(found[near[found]]), expected)
    np.testing.assert_allclose(out.pixels[:count], pixels[found], atol=1e-9)
    np.testing.assert_allclose(out.depth_m[:count], points[found, 0], atol=1e-12)
