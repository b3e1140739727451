"""The outline fit: exact outlines give exact poses from anywhere, poor ones a reason."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from strategies import numbers

from field_models import load_field
from robocup_vision import Vision
from robocup_vision.estimates import NotLocated, PoseEstimate
from robocup_vision.geometry import Pose2
from robocup_vision.localization.floor import OutlineFitter, OutlineSettings
from robocup_vision.localization.outline_model import OutlineCameraSettings
from robocup_vision.perception.polar_view import PolarView
from sim2d.match.setups import CAMERAS
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, sample
from sim2d.rendering.scene import Scene

FIELD, CAMERA = load_field("ssl_2001"), sekimori_camera()
VIEW = PolarView(CAMERA)
FITTER = OutlineFitter(FIELD, CAMERA, VIEW)
BARE = Scene(FIELD)
places = st.builds(Pose2, numbers(-1.25, 1.25), numbers(-0.65, 0.65), numbers(-3.1, 3.1))


def floor_columns(radius, view=VIEW):
    """Return each bearing's outermost floor sample: at its edge, or right at the robot where something hides it."""
    at_edge = np.searchsorted(view.radius_px, np.nan_to_num(radius, nan=-1.0)) - 1
    return np.clip(at_edge, 0, len(view.radius_px) - 1).astype(np.int64)


def locate(radius, prior=None, fitter=FITTER):
    return fitter.locate(radius, floor_columns(radius, fitter.view), prior)[:2]


def outline(pose, rng=None, noise_px=0.0, hidden=0.0):
    """Image radius of the walls' feet, as the scene's own geometry has them, not the localiser's."""
    range_m = BARE.free_range_m(pose, VIEW.bearing_rad)
    radius = CAMERA.floor_range.radius_px(1.0 / range_m)
    if rng is not None:
        radius = radius + rng.normal(0, noise_px, len(radius))
        first, length = rng.integers(0, len(radius)), int(hidden * len(radius))
        radius[(first + np.arange(length)) % len(radius)] = np.nan
    return radius


@given(places, st.integers(0, 2**32 - 1))
# once taken for a place a metre along the field, with a centimetre of play
@example(Pose2(-1.0, -0.6259765625, 0.0), 113)
def test_an_outline_gives_its_pose_without_any_prior(pose, seed):
    rng = np.random.default_rng(seed)
    estimate, walls = locate(outline(pose, rng, 0.15, 0.2))
    assert isinstance(estimate, PoseEstimate)
    distance, angle = estimate.pose.error_to(pose, symmetric=True)
    assert distance < 0.02
    assert angle < math.radians(1.5)
    assert estimate.candidates == (estimate.pose, estimate.pose.half_turn())
    assert (np.linalg.eigvalsh(estimate.covariance) > 0).all()
    exact = outline(pose)
    assert np.median(np.abs(walls - exact)) < 0.5


@given(places, st.integers(0, 2**32 - 1))
def test_a_prior_leads_to_the_same_pose(pose, seed):
    radius = outline(pose, np.random.default_rng(seed), 0.15)
    near = Pose2(pose.x_m + 0.01, pose.y_m - 0.01, pose.theta_rad + 0.02)
    cold, warm = (locate(radius, prior)[0] for prior in (None, near))
    assert sum(warm.pose.error_to(cold.pose, symmetric=True)) < 0.01
    # a prior in the other half keeps its half
    other = locate(radius, near.half_turn())[0]
    assert sum(other.pose.error_to(warm.pose.half_turn())) < 0.01


@given(places, st.integers(0, 2**32 - 1))
def test_boxes_nearer_than_the_walls_do_not_move_the_pose(pose, seed):
    rng = np.random.default_rng(seed)
    radius = outline(pose, rng, 0.15)
    for _ in range(4):
        first, length = rng.integers(0, len(radius)), rng.integers(4, 12)
        where = (first + np.arange(length)) % len(radius)
        radius[where] = np.minimum(radius[where], rng.uniform(40.0, 80.0))
    estimate, _ = locate(radius)
    assume(bool(estimate))
    distance, angle = estimate.pose.error_to(pose, symmetric=True)
    assert distance < 0.03
    assert angle < math.radians(2)


@given(places)
def test_the_first_guess_is_a_start(pose):
    assume(abs(pose.x_m) < 1.0)
    guess = FITTER.first_guess(outline(pose))
    distance, angle = guess.error_to(pose, symmetric=True)
    assert distance < 0.35
    assert angle < 0.5


def test_what_cannot_be_located_is_reported():
    count = len(VIEW.bearing_rad)
    nothing = np.full(count, np.nan)
    few = nothing.copy()
    few[:2] = 60.0
    for radius, reason in (
        (nothing, f"the floor's edge is seen in only 0 of {count} directions"),
        (few, f"the floor's edge is seen in only 2 of {count} directions"),
    ):
        estimate, walls = locate(radius)
        assert isinstance(estimate, NotLocated)
        assert estimate.reason == reason
        assert np.isnan(walls).all()
    assert FITTER.first_guess(few[:] * np.nan) is None


@pytest.mark.parametrize(
    "radius",
    [
        np.full(len(VIEW.bearing_rad), 40.0),
        np.full(len(VIEW.bearing_rad), 1e-6),
        np.full(len(VIEW.bearing_rad), 1e6),
        np.random.default_rng(0).uniform(27.0, 111.0, len(VIEW.bearing_rad)),
        np.where(np.arange(len(VIEW.bearing_rad)) < 40, 105.0, np.nan),
    ],
    ids=["circle", "dot", "far", "noise", "one side"],
)
def test_outlines_of_nothing_are_not_located(radius):
    for prior in (None, Pose2(0.1, 0.2, 0.3), Pose2(math.nan, 0.0, 0.0), Pose2(1e9, 0.0, 0.0)):
        estimate, walls = locate(radius, prior)
        assert isinstance(estimate, NotLocated)
        assert len(estimate.reason) > 10
        assert np.isnan(walls).all()


def test_one_wall_alone_does_not_fix_the_pose():
    pose = Pose2(0.0, 0.0, 0.0)
    radius = outline(pose)
    bearing = (VIEW.bearing_rad + math.pi) % math.tau - math.pi
    radius[np.abs(bearing - math.pi / 2) > 0.8] = np.nan
    estimate, _ = locate(radius, pose)
    assert isinstance(estimate, NotLocated)
    assert "does not fix the pose" in estimate.reason or "equally well" in estimate.reason


@pytest.mark.parametrize("name", ["ssl_division_a", "ssl_division_b"])
def test_other_fields(name):
    field = load_field(name)
    camera = sekimori_camera(640, 480)
    view = PolarView(camera)
    pose = Pose2(field.length_m / 2 - 1.1, 1.0 - field.width_m / 2, 0.6)
    range_m = Scene(field).free_range_m(pose, view.bearing_rad)
    radius = camera.floor_range.radius_px(1.0 / range_m)
    estimate, _ = locate(radius, fitter=OutlineFitter(field, camera, view))
    assert estimate.pose.error_to(pose, symmetric=True)[0] < 0.05


def off_outline(pose, rng):
    """Outline of a camera whose centre is 0.7 px from where its file puts it, about that."""
    range_m = BARE.free_range_m(pose, VIEW.bearing_rad)
    radius = CAMERA.floor_range.radius_px(1.0 / range_m)
    u = radius * np.cos(VIEW.bearing_rad) + 0.5
    v = radius * np.sin(VIEW.bearing_rad) - 0.5
    around = np.arctan2(v, u)
    order = np.argsort(around)
    seen = np.interp(VIEW.bearing_rad, around[order], np.hypot(u, v)[order], period=math.tau)
    return seen + rng.normal(0, 0.1, len(seen))


def test_a_centre_that_is_off_costs_less_where_the_outline_tells_it():
    rng = np.random.default_rng(3)
    trusting = OutlineFitter(FIELD, CAMERA, VIEW, OutlineSettings(camera=OutlineCameraSettings(min_gain=math.inf)))
    errors, nees = [], []
    for _ in range(20):
        pose = Pose2(*rng.uniform((-1.0, -0.5, -3.1), (1.0, 0.5, 3.1)).tolist())
        radius = off_outline(pose, rng)
        found = [locate(radius, fitter=fitter)[0] for fitter in (trusting, FITTER)]
        nearest = [min(one.candidates, key=lambda c, truth=pose: c.error_to(truth)[0]) for one in found]
        errors.append([one.error_to(pose)[0] for one in nearest])
        off = [one.array - pose.array for one in nearest]
        nees.append([e @ np.linalg.solve(one.covariance, e) for e, one in zip(off, found, strict=True)])
    by_file, corrected = np.median(errors, axis=0)
    assert corrected < 0.6 * by_file
    assert np.median(nees, axis=0)[1] < 8.0 < np.median(nees, axis=0)[0]
    # a lean explains some of it, where there is a prior
    leaning = [locate(radius, pose, fitter)[0].pose.error_to(pose)[0] for fitter in (trusting, FITTER)]
    assert leaning[1] <= leaning[0]


def test_a_camera_that_is_off_is_corrected_where_much_of_the_outline_is_hidden():
    pose, rng = Pose2(0.3, -0.1, 0.5), np.random.default_rng(4)
    radius = off_outline(pose, rng)
    # two fifths of the bearings end at something nearer
    radius[: int(0.4 * len(radius))] -= rng.uniform(6.0, 20.0, int(0.4 * len(radius)))
    assert locate(radius, pose)[0].pose.error_to(pose)[0] < 0.01


@pytest.mark.parametrize(("field_name", "seed", "index"), [("ssl_division_b", 92, 28), ("ssl_division_a", 93, 39)])
def test_a_place_that_slides_along_a_wall_rules_out_a_turned_one(field_name, seed, index):
    """In a crowd near a wall, with no end of the field in view: the places at the shorter wall look much alike."""
    field, camera = load_field(field_name), CAMERAS["ssl_mirror"]()
    (crowd,) = sample(field, camera, CONDITIONS["crowd"], seed, 1, indices=[index], supersample=2)
    found = Vision(field, camera).look(crowd.frame).pose
    if found:
        distance, angle = found.pose.error_to(crowd.pose, symmetric=True)
        assert distance < 0.1
        assert angle < math.radians(1.0)


def test_a_prior_included_in_the_pose_is_not_in_the_measurement():
    field, camera = load_field("ssl_division_b"), CAMERAS["ssl_mirror"]()
    (crowd,) = sample(field, camera, CONDITIONS["crowd"], 5, 1, indices=[3], supersample=2)
    prior = PoseEstimate(crowd.pose, np.diag([0.03, 0.03, 0.03]) ** 2, 1.0, 0.0)
    view = Vision(field, camera).look(crowd.frame, prior=prior)
    assert view.pose.std[:2].max() < 0.031
    assert view.measurement.std[:2].max() > 0.1
    assert view.measurement.candidates == (view.measurement.pose, view.measurement.pose.half_turn())
    distance, _ = view.measurement.pose.error_to(crowd.pose)
    assert distance < 3 * view.measurement.std[:2].max()
