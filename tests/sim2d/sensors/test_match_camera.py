"""Frames of a match against the ray caster, their light, noise and blur, and the turn of a rolling ball."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from field_models import load_field
from field_models.errors import ArgumentError
from robocup_vision import Vision
from robocup_vision.camera import OmniCamera, PinholeCamera, Tangent
from robocup_vision.geometry import Pose2
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.mirror import MirrorRenderer
from sim2d.rendering.scene import BOX_COLORS, Box
from sim2d.robot_link import RobotLimits
from sim2d.sensors.match_camera import MATCH_LIGHT, MATCH_SENSOR, MatchCamera, RollingBall, ShutterSettings
from sim2d.world.state import BallState, RobotState, WorldState

LIMITS = RobotLimits()
CLEAN = replace(MATCH_SENSOR, noise_sigma=0.0)
SEKIMORI = sekimori_camera()
HIGH = OmniCamera(
    size_px=(320, 240), center_px=(161.0, 118.5), usable_radius_px=(20.0, 118.0), floor_range=Tangent(0.9, 0.0125),
    mirrored=True, heading_rad=0.7, offset_m=(0.03, -0.02), tilt_rad=(0.01, -0.02), viewpoint_height_m=0.7,
)  # fmt: skip


def world_state(robots, ball=(0.3, 0.1), pan=0.0):
    """Return a state of robots at poses, those of even index on side +1."""
    states = (RobotState(k, 1 - 2 * (k % 2), k // 2, Pose2(*r), (0.0, 0.0), 0.0, pan) for k, r in enumerate(robots))
    return WorldState(0.0, tuple(states), BallState(*ball), (0, 0), "play", 1, ())


def random_state(field, rng, count=4):
    high = field.floor_polygon.max(axis=0) - 0.3
    places = []
    while len(places) <= count:
        place = rng.uniform(-high, high)
        if all(np.hypot(*(place - other)) > 0.25 for other in places):
            places.append(place)
    return world_state([(*place, rng.uniform(-3, 3)) for place in places[1:]], tuple(places[0]))


@pytest.mark.parametrize(
    ("name", "camera"),
    [("ssl_2001", SEKIMORI), pytest.param("ssl_division_b", HIGH, marks=pytest.mark.slow), ("four_legged_2007", HIGH)],
)
def test_frames_are_those_of_the_ray_caster(name, camera):
    """Boards around the carpet, the slow case, alone find lines of the fast frames that end elsewhere."""
    field = load_field(name)
    boxes = (Box(0.5, 0.4, 0.3, color_bgr=BOX_COLORS["red"]), Box(-0.5, -0.3, 0.9, height_m=0.05))
    eye = MatchCamera(field, camera, LIMITS, np.random.default_rng(0), boxes=boxes, sensor=CLEAN)
    caster = MirrorRenderer(camera, 3)
    u, v = np.meshgrid(np.arange(camera.size_px[0]), np.arange(camera.size_px[1]))
    radius = np.hypot(u - camera.center_px[0], v - camera.center_px[1])
    rim = (radius > camera.usable_radius_px[0] + 3) & (radius < camera.usable_radius_px[1] - 2)
    rng = np.random.default_rng(8)
    for _ in range(4):
        state = random_state(field, rng)
        quick = eye.render(state, 1)
        slow = CLEAN.expose(caster.render(eye.scene(state, 1), state.robots[1].pose), rng)
        difference = np.abs(quick.astype(int) - slow).max(axis=2)
        low = rim & (cv2.erode(rim.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0)
        assert difference[radius < camera.usable_radius_px[0] - 3].max() <= 3  # its own body
        assert np.median(difference[low]) <= 1
        # edges across the bearing are not averaged, and the room behind is drawn in stripes
        on_floor = low & (slow[..., 1] > 1.5 * slow[..., 0]) & (slow[..., 1] > 1.5 * slow[..., 2])
        assert (difference[on_floor] > 12).mean() < 0.02
        assert difference[on_floor].mean() < 1.2


@pytest.mark.parametrize("place", [(0.25, 0.1), (0.3, -0.1)])
def test_a_ball_in_a_mirror_is_that_of_the_ray_caster(place):
    eye = MatchCamera(load_field("ssl_2001"), SEKIMORI, LIMITS, np.random.default_rng(0), sensor=CLEAN)
    caster, quick, slow = MirrorRenderer(SEKIMORI, 4), [], []
    for ball in (place, (1.2, 0.6)):
        state = world_state([(0.0, 0.0, 0.0)], ball)
        quick.append(eye.render(state, 0).astype(int))
        light = caster.render(eye.scene(state, 0), state.robots[0].pose)
        slow.append(CLEAN.expose(light, np.random.default_rng(0)).astype(int))
    by_ball = np.abs(slow[0] - slow[1]).max(axis=2) > 20
    assert by_ball.sum() > 50
    assert np.abs(quick[0] - slow[0])[by_ball].mean() < 4.0


@pytest.mark.slow
def test_a_place_is_distinguished_from_them_as_well_as_from_the_ray_casters():
    """Only this finds fast frames that make poses worse, or better, than exact ones."""
    field = load_field("ssl_2001")
    eye = MatchCamera(field, SEKIMORI, LIMITS, np.random.default_rng(0))
    caster = MirrorRenderer(SEKIMORI, 3)
    rng = np.random.default_rng(19)
    errors = {"quick": [], "slow": []}
    visions = {name: Vision(field, SEKIMORI) for name in errors}
    for _ in range(25):
        state = random_state(field, rng)
        truth = state.robots[0].pose
        frames = {
            "quick": eye.render(state, 0),
            "slow": MATCH_SENSOR.expose(caster.render(eye.scene(state, 0), truth), rng),
        }
        for name, frame in frames.items():
            view = visions[name].look(frame)
            assert view.pose
            errors[name].append(view.pose.pose.error_to(truth))
    quick, slow = (np.array(errors[name]) for name in ("quick", "slow"))
    assert (quick[:, 0] < 0.05).all()
    assert (quick[:, 1] < math.radians(3)).all()
    assert np.median(quick[:, 0]) < 1.5 * np.median(slow[:, 0])


def test_a_robot_does_not_see_itself_but_the_others():
    field = load_field("ssl_2001")
    eye = MatchCamera(field, SEKIMORI, LIMITS, np.random.default_rng(0), sensor=CLEAN)
    alone = eye.render(world_state([(0.0, 0.0, 0.0)]), 0)
    two = world_state([(0.0, 0.0, 0.0), (0.4, 0.0, 1.0)])
    assert (eye.render(two, 0) != alone).any()
    dark = (eye.render(two, 0).max(axis=2) < 60) & (alone.max(axis=2) > 60)
    v, u = np.argwhere(dark).mean(axis=0)
    assert v == pytest.approx(109.5, abs=2)
    assert 165 < u < 225  # straight ahead is to the right


def test_noise_is_repeated_by_a_seed_and_new_in_every_frame():
    field, state = load_field("ssl_2001"), world_state([(0.2, 0.1, 0.4)])
    eyes = [MatchCamera(field, SEKIMORI, LIMITS, np.random.default_rng(6)) for _ in range(2)]
    first, again = (eye.render(state, 0) for eye in eyes)
    second = eyes[0].render(state, 0)
    assert (first == again).all()
    bare = MatchCamera(field, SEKIMORI, LIMITS, np.random.default_rng(6), sensor=CLEAN).render(state, 0)
    middling = (bare > 40) & (bare < 215)
    noise = [(frame.astype(float) - bare)[middling] for frame in (first, second)]
    assert noise[0].std() == pytest.approx(MATCH_SENSOR.noise_sigma, rel=0.03)
    assert abs(noise[0].mean()) < 0.2
    assert abs(np.corrcoef(*noise)[0, 1]) < 0.05
    with pytest.raises(ValueError, match="read-only"):
        first[0, 0, 0] = 0


def test_a_head_that_pans_sees_what_a_turned_robot_sees():
    field = load_field("four_legged_2007")
    camera = PinholeCamera(
        size_px=(104, 80), focal_px=(100.0, 100.0), center_px=(51.5, 39.5), height_m=0.2, tilt_rad=-0.1
    )
    eye = MatchCamera(field, camera, LIMITS, np.random.default_rng(0), sensor=CLEAN)
    panned = eye.render(world_state([(0.5, 0.2, 0.3)], pan=0.4), 0)
    turned = eye.render(world_state([(0.5, 0.2, 0.7)]), 0)
    assert panned.shape == (80, 104, 3)
    assert np.abs(panned.astype(int) - turned).max() <= 1
    assert np.abs(panned.astype(int) - eye.render(world_state([(0.5, 0.2, 0.3)]), 0)).max() > 50


def test_a_wide_blur_is_drawn_too():
    field, state = load_field("ssl_2001"), world_state([(0.2, 0.1, 0.4)])
    frames = [
        MatchCamera(field, SEKIMORI, LIMITS, np.random.default_rng(0), sensor=replace(CLEAN, blur_px=blur)).render(
            state, 0
        )
        for blur in (0.0, 0.7, 1.5)
    ]
    rough = [float(np.abs(np.diff(frame.astype(int), axis=1)).mean()) for frame in frames]
    assert rough[0] > rough[1] > rough[2]


def test_what_a_match_is_not_drawn_with_is_refused():
    def camera(sensor):
        return MatchCamera(load_field("ssl_2001"), SEKIMORI, LIMITS, np.random.default_rng(0), sensor=sensor)

    with pytest.raises(ArgumentError, match="a match is drawn without compression"):
        camera(replace(CLEAN, jpeg_quality=80))
    with pytest.raises(ArgumentError, match="a match is drawn without texture"):
        camera(CLEAN).set_light(replace(MATCH_LIGHT, texture=0.1))


def test_a_head_that_pans_blurs_upright_edges_and_slants_them():
    field, rng = load_field("four_legged_2007"), np.random.default_rng(0)
    lens = PinholeCamera((104, 80), (100.0, 100.0), (51.5, 39.5), 0.2, tilt_rad=0.0)
    post = [(2.0, 0.0, 0.0)]
    states = [
        replace(world_state([(0.0, 0.3, 0.0), *post], ball=(-1.0, 1.0), pan=-0.1 - 0.1 * k), t_s=k / 30) for k in (0, 1)
    ]
    still, moving = (
        MatchCamera(field, lens, LIMITS, rng, sensor=CLEAN, shutter=shutter)
        for shutter in (None, ShutterSettings(exposure_s=0.01, readout_s=0.02))
    )
    first = moving.render(states[0], 0)
    assert (first == still.render(states[0], 0)).all()  # nothing is known of how it turned
    sharp, blurred = still.render(states[1], 0).astype(float), moving.render(states[1], 0).astype(float)

    def slant_px(frame):
        """Pixels by which the room's upright edges shift from the upper rows to those at the horizon."""
        upper, lower = (np.abs(np.diff(frame[rows].sum(axis=(0, 2)))) for rows in (slice(4, 10), slice(28, 34)))
        lags = range(-9, 10)
        return lags[int(np.argmax([np.corrcoef(upper, np.roll(lower, lag))[0, 1] for lag in lags]))]

    assert np.abs(np.diff(blurred[4:34], axis=1)).max() < 0.7 * np.abs(np.diff(sharp[4:34], axis=1)).max()
    # 0.06 rad while 80 rows are read: 1.8 pixels on 24 rows
    assert abs(slant_px(blurred) - slant_px(sharp)) in (1, 2, 3)
    # a robot that is carried elsewhere does not blur
    away = replace(world_state([(0.0, 0.3, 0.0), *post], ball=(-1.0, 1.0), pan=1.2), t_s=2 / 30)
    assert (moving.render(away, 0) == still.render(away, 0)).all()


RADIUS_M = 0.05


def roll(*places):
    """Return the turn of a ball that has been at these places."""
    ball = RollingBall(RADIUS_M)
    turns = [ball.turn_rad(BallState(x_m, y_m, 0.0, 0.0)) for x_m, y_m in places]
    return turns[-1]


def test_a_ball_that_lies_still_does_not_turn():
    assert roll((0.3, 0.4), (0.3, 0.4)) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("way_m", [0.02, -0.05])
def test_it_turns_by_the_way_over_its_radius(way_m):
    # ahead about y, to the left about -x
    assert roll((0.0, 0.0), (way_m, 0.0)) == pytest.approx((0.0, way_m / RADIUS_M, 0.0))
    assert roll((0.0, 0.0), (0.0, way_m)) == pytest.approx((-way_m / RADIUS_M, 0.0, 0.0))


def test_after_a_whole_turn_it_looks_as_before():
    around_m = math.tau * RADIUS_M
    places = [(around_m * k / 50 * 0.6, around_m * k / 50 * 0.8) for k in range(51)]
    assert roll(*places) == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)
