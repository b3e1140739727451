"""Forward cameras' quick frames against the ray caster's: where they differ, and by how much."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from field_models import COLOR_NAMES, load_field
from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.camera.pinhole import camera_rotation
from robocup_vision.geometry import Pose2
from sim2d.rendering.backdrop import Backdrop
from sim2d.rendering.fast.forward import EyeInField, ForwardFrames
from sim2d.rendering.pinhole import COARSE, render_pinhole
from sim2d.rendering.scene import BOX_COLORS, Ball, Box, Light, Robot, Room, Scene, Shadow
from sim2d.sensors.match_camera import MATCH_LIGHT, MATCH_ROOM, MATCH_SENSOR

NOISE = MATCH_SENSOR.noise_sigma
CLEAN = replace(MATCH_SENSOR, noise_sigma=0.0)
LENS = (-0.12, 0.03, 0.001, -0.001)


def camera(size=(208, 160), focal=192.0, height_m=0.185, distortion=()):
    center = ((size[0] - 1) / 2, (size[1] - 1) / 2)
    return PinholeCamera(size, (focal, focal), center, height_m, distortion, tilt_rad=-0.2)


def scene_of(name, rng, *, room=MATCH_ROOM, boxes=(), light=MATCH_LIGHT):
    field = load_field(name)
    half = np.array([field.length_m, field.width_m]) * 0.45
    places = rng.uniform(-half, half, (8, 2)).tolist()
    robots = tuple(Robot(*place, 0.12, 0.25) for place in places[1:])
    ball = Ball(*places[0], field.ball_radius_m, COLOR_NAMES[field.ball_color])
    return Scene(field, boxes, robots, ball, light, room, 0.0 if field.is_bounded else 0.5)


def both(scene, lens, eye, backdrop=None, turn_rad=0.0):
    """Return the quick frame and the ray caster's, both through the sensor, without noise."""
    quick = ForwardFrames(scene, lens, CLEAN, backdrop=backdrop).draw(scene.robots, scene.ball, eye)
    blurred = cv2.GaussianBlur(quick.astype(np.float32), (0, 0), CLEAN.blur_px, borderType=cv2.BORDER_REPLICATE)
    held = replace(lens, height_m=eye.height_m, pan_rad=0.0, tilt_rad=eye.tilt_rad, roll_rad=eye.roll_rad)
    place = Pose2(eye.x_m, eye.y_m, eye.heading_rad)
    slow = render_pinhole(held, scene, place, backdrop=backdrop, supersample=COARSE, turn_rad=turn_rad)
    return np.rint(blurred).astype(int), CLEAN.expose(slow, np.random.default_rng(0)).astype(int)


def looks(scene, count, rng, height_m):
    """Return eyes anywhere on the field but in a robot, with nod and roll."""
    half = np.array([scene.field.length_m, scene.field.width_m]) * 0.42
    eyes = []
    while len(eyes) < count:
        x, y = rng.uniform(-half, half).tolist()
        if all(math.hypot(r.x_m - x, r.y_m - y) > r.radius_m + 0.1 for r in scene.robots):
            tilt, roll = -0.2 + rng.normal(0, 0.05), rng.normal(0, 0.05)
            eyes.append(EyeInField(x, y, height_m + rng.normal(0, 0.005), rng.uniform(-3.1, 3.1), tilt, roll))
    return eyes


CASES = {
    "posts, bars and beacons": ("four_legged_2007", camera(), MATCH_ROOM),
    "people and furniture around": ("four_legged_2007", camera(), Room(seed=7, distance_m=1.2, bystanders=12)),
    "a lens that distorts": ("spl_2020", camera(focal=200.0, height_m=0.46, distortion=LENS), MATCH_ROOM),
    "walls and goals' recesses": ("ssl_2001", camera(), MATCH_ROOM),
    "walls and goals of panels": ("ssl_division_b", camera(size=(200, 150)), MATCH_ROOM),
}


@pytest.mark.parametrize("case", CASES)
def test_a_frame_is_that_of_the_ray_caster_within_the_sensors_noise(case):
    name, lens, room = CASES[case]
    rng = np.random.default_rng(41)
    scene = scene_of(name, rng, room=room)
    for eye in looks(scene, 3, rng, lens.height_m):
        quick, slow = both(scene, lens, eye)
        difference = np.abs(quick - slow).max(axis=2)
        assert np.median(difference) <= 1
        assert difference.mean() < 0.08 * NOISE
        # beyond the noise only where an edge crosses a pixel: four rays there, or an average over the pixel
        assert (difference > NOISE).mean() < 0.01
        around = np.ones((5, 5), dtype=np.uint8)
        contrast = cv2.dilate(slow.astype(np.uint8), around) - cv2.erode(slow.astype(np.uint8), around)
        assert difference[contrast.max(axis=2) < 1.5 * NOISE].max() <= NOISE


@pytest.mark.parametrize("turn", [0.15, -0.08])
def test_a_rolling_shutter_is_that_of_the_ray_caster(turn):
    rng = np.random.default_rng(43)
    lens = camera(distortion=LENS if turn < 0 else ())
    scene = scene_of("four_legged_2007", rng)
    eye = looks(scene, 1, rng, lens.height_m)[0]
    # about the upright axis, in the camera's own axes
    about = camera_rotation(eye.heading_rad, eye.tilt_rad, eye.roll_rad)[2] * turn
    quick, slow = both(scene, lens, eye._replace(turn_rad=tuple(about.tolist())), turn_rad=turn)
    still, _ = both(scene, lens, eye)
    difference = np.abs(quick - slow).max(axis=2)
    assert difference.mean() < 0.1 * NOISE
    assert (difference > NOISE).mean() < 0.02
    assert np.abs(still - slow).max(axis=2).mean() > 3 * difference.mean()


def test_halls_with_people_lamps_and_boxes_are_drawn():
    rng = np.random.default_rng(5)
    boxes = (Box(0.9, 0.2, 0.4, color_bgr=BOX_COLORS["red"]), Box(0.8, -0.4, 1.0, height_m=0.4))
    scene = scene_of("four_legged_2007", rng, boxes=boxes)
    lens = camera(size=(320, 240), focal=300.0)
    quick, slow = both(scene, lens, EyeInField(-0.3, 0.1, 0.2, 0.1, 0.1, -0.05), Backdrop("hall", 3))
    assert slow.max() > 250  # a lamp or a window
    difference = np.abs(quick - slow).max(axis=2)
    assert difference.mean() < 0.35 * NOISE
    assert (difference > 2 * NOISE).mean() < 0.02


def test_a_post_thinner_than_a_pixel_is_not_lost():
    field = load_field("four_legged_2007")
    scene = Scene(field, robots=(Robot(2.0, 0.0, 0.012, 0.4),), light=MATCH_LIGHT, room=MATCH_ROOM)
    lens = camera(size=(104, 80), focal=60.0)
    eye = EyeInField(0.0, 0.0, 0.185, 0.004, 0.0, 0.06)
    quick, slow = both(scene, lens, eye)
    bare, slow_bare = both(replace(scene, robots=()), lens, eye)
    assert (bare - quick).sum() == pytest.approx((slow_bare - slow).sum(), rel=0.15)
    assert (slow_bare - slow).max() > NOISE


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"light": Light(texture=0.1)}, "without texture"),
        ({"light": Light(shadow=Shadow(0.0))}, "without texture, shadow"),
    ],
)
def test_what_a_match_is_not_drawn_with_is_refused(wrong, message):
    with pytest.raises(ArgumentError, match=message):
        ForwardFrames(Scene(load_field("ssl_2001"), **wrong), camera(), CLEAN)


def test_a_lens_that_leaves_part_of_the_image_dark_is_refused():
    with pytest.raises(ArgumentError, match="without rays"):
        ForwardFrames(Scene(load_field("ssl_2001")), camera(focal=60.0, distortion=(-0.5, 0.0, 0.0, 0.0)), CLEAN)


def test_a_ball_and_its_shade_on_the_floor_are_those_of_the_ray_caster():
    scene = replace(scene_of("four_legged_2007", np.random.default_rng(8)), robots=(), ball=None)
    ball = Ball(0.7, 0.05, scene.field.ball_radius_m, COLOR_NAMES[scene.field.ball_color])
    eye, lens = EyeInField(0.0, 0.0, 0.3, 0.0, -0.35, 0.0), camera(height_m=0.3)
    quick, slow = both(replace(scene, ball=ball), lens, eye)
    by_ball = np.abs(slow - both(scene, lens, eye)[1]).max(axis=2)
    difference = np.abs(quick - slow).max(axis=2)
    assert difference[(by_ball > 6) & (by_ball <= 40)].mean() < 1.0  # the shade
    assert difference[by_ball > 40].mean() < 1.0


def test_a_balls_patches_are_those_of_the_ray_caster():
    rng = np.random.default_rng(8)
    scene = scene_of("spl_2020", rng)
    color, dark = COLOR_NAMES["white"], COLOR_NAMES["black"]
    plain = Ball(0.7, 0.05, 0.05, color)
    # the ray caster turns the ball in axes of the eye, which are here the field's
    eye = EyeInField(0.0, 0.0, 0.46, 0.0, -0.4, 0.0)
    lens = camera(height_m=0.46)
    for turn in ((0.0, 0.0, 0.0), (0.3, -1.0, 0.5), (2.1, 0.4, -2.8)):
        ball = replace(plain, patches_bgr=dark, turn_rad=turn)
        quick, slow = both(replace(scene, robots=(), ball=ball), lens, eye)
        without, _ = both(replace(scene, robots=(), ball=plain), lens, eye)
        is_dark = np.abs(slow - without).max(axis=2) > 60
        assert np.count_nonzero(is_dark) > 40
        assert np.abs(quick - slow)[is_dark].mean() < 8.0
