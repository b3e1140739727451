"""The hall: rays meet what stands there, near things hide far ones, light scales, posters move, paths are as said."""

import math

import cv2
import numpy as np
import pytest

from field_models.errors import ArgumentError
from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.rendering.hall.hall import Hall, HallCamera, HallLight, loop_path, make_hall
from sim2d.rendering.hall.solids import Panel
from sim2d.rendering.hall.textures import bundled_pictures

CAMERA = PinholeCamera((40, 30), (35.0, 35.0), (19.5, 14.5), 0.5, pan_rad=0.1, tilt_rad=0.05, roll_rad=0.02)
FLAT = HallLight(ambient=1.0, lamps=())


def plain(*levels):
    return tuple(np.full((16, 16, 3), level, dtype=np.uint8) for level in levels)


def facing(x_m: float, half_m: float, texture: int) -> Panel:
    """Make a square across the x axis that faces the origin."""
    return Panel((x_m, half_m, 0.5 - half_m), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0), (2 * half_m, 2 * half_m), texture)


def test_shading_is_texture_times_light():
    rng = np.random.default_rng(0)
    texture = rng.integers(0, 255, (32, 32, 3), dtype=np.uint8)
    hall = Hall((facing(1.0, 0.8, 0),), (texture,))
    level = PinholeCamera((64, 64), (40.0, 40.0), (31.5, 31.5), 0.5, tilt_rad=0.0)
    light = HallLight(level=0.5, ambient=0.6, lamps=((0.0, 0.0, 1.0, 0.4),))
    image = HallCamera(level, 1).render(hall, Pose2(0.0, 0.0, 0.0), light)
    # each pixel by hand: where it meets the panel, the texel there, and the lamp's angle and distance
    v, u = np.mgrid[:64, :64]
    y, z = -(u - 31.5) / 40, 0.5 - (v - 31.5) / 40
    x_px = np.clip((0.8 - y) / 1.6 * 32 - 0.5, 0, 30.999)
    y_px = np.clip((1 - (z - 0.5 + 0.8) / 1.6) * 32 - 0.5, 0, 30.999)
    color = cv2.remap(texture.astype(np.float32), x_px.astype(np.float32), y_px.astype(np.float32), cv2.INTER_LINEAR)
    squared = 1 + y**2 + (z - 1) ** 2
    gain = 0.5 * (0.6 + 0.4 / np.sqrt(squared) / squared)
    inside = (np.abs(y) < 0.79) & (np.abs(z - 0.5) < 0.79)
    np.testing.assert_allclose(image[inside], (color * gain[..., None])[inside], atol=1.5)
    assert (image[~inside & (np.abs(y) > 0.81)] == 0).all()


def test_near_things_hide_far_ones_and_backs_are_not_seen():
    hall = Hall((facing(3.0, 4.0, 0), facing(1.0, 0.2, 1)), plain(50, 200))
    level = PinholeCamera((40, 30), (35.0, 35.0), (19.5, 14.5), 0.5, tilt_rad=0.0)
    image = HallCamera(level).render(hall, Pose2(0.0, 0.0, 0.0), FLAT)
    assert image[15, 20] == pytest.approx([200] * 3, abs=1)
    assert image[2, 2] == pytest.approx([50] * 3, abs=1)
    behind = HallCamera(level).render(hall, Pose2(5.0, 0.0, math.pi), FLAT)
    assert (behind == 0).all()


@pytest.fixture(scope="module")
def hall():
    return make_hall(4)


def test_light_scales_the_picture(hall):
    pose = Pose2(0.5, 0.5, 1.0)
    camera = HallCamera(CAMERA, 1)
    bright, dim = (camera.render(hall, pose, HallLight(level=level)) for level in (1.0, 0.5))
    np.testing.assert_allclose(dim, bright / 2, rtol=1e-4, atol=1e-3)
    assert bright.std() > 5


def test_far_textures_are_smoothed():
    board = np.indices((512, 512)).sum(axis=0) % 2 * 255
    hall = Hall((facing(8.0, 1.0, 0),), (np.repeat(board[..., None], 3, axis=2).astype(np.uint8),))
    level = PinholeCamera((40, 30), (35.0, 35.0), (19.5, 14.5), 0.5, tilt_rad=0.0)
    image = HallCamera(level, 1).render(hall, Pose2(0.0, 0.0, 0.0), FLAT)
    assert image[15, 20] == pytest.approx([127.5] * 3, abs=3)


@pytest.mark.slow
def test_the_same_seed_makes_the_same_hall(hall):
    """Only this finds a hall that its seed does not repeat."""
    assert hall.panels == make_hall(4).panels
    assert hall.panels != make_hall(5).panels


def test_posters_move_along_their_wall_or_are_covered(hall):
    changed = hall.rearranged(0.3, np.random.default_rng(0))
    pairs = [(a, b) for a, b in zip(hall.panels, changed.panels, strict=True) if a != b]
    assert len(pairs) == math.ceil(0.3 * 44)
    for before, after in pairs:
        assert before.is_poster
        if before.texture == after.texture:
            shift = np.subtract(after.origin_m, before.origin_m)
            assert 0.25 <= abs(shift @ before.along) <= 0.8
            assert np.linalg.norm(shift) == pytest.approx(abs(shift @ before.along))
        else:
            assert after.origin_m == before.origin_m
    with pytest.raises(ArgumentError, match="fraction must be"):
        hall.rearranged(1.5, np.random.default_rng(0))


def test_paths_are_as_long_and_as_far_aside_as_said():
    path, aside = loop_path(2000), loop_path(2000, shift_m=0.2)
    places = np.array([p.array[:2] for p in path])
    assert np.hypot(*np.diff(places, axis=0).T).sum() == pytest.approx(10.0, rel=2e-3)
    for pose, other in list(zip(path, aside, strict=True))[::100]:
        assert math.hypot(pose.x_m - other.x_m, pose.y_m - other.y_m) == pytest.approx(0.2)
        assert math.hypot(other.x_m, other.y_m) > math.hypot(pose.x_m, pose.y_m)
    ahead = np.diff(places, axis=0)
    heading = np.array([p.theta_rad for p in path])[:-1]
    turned = np.arctan2(ahead[:, 1], ahead[:, 0]) - heading
    assert np.abs(np.remainder(turned + math.pi, math.tau) - math.pi).max() < 0.01


def test_wrong_arguments_are_named():
    with pytest.raises(ArgumentError, match="supersample"):
        HallCamera(CAMERA, 0)
    with pytest.raises(ArgumentError, match="light must not be negative"):
        HallLight(level=-1.0)
    folded = PinholeCamera((40, 30), (10.0, 10.0), (19.5, 14.5), 0.5, distortion=(-0.9, 0.0, 0.0, 0.0), tilt_rad=0.0)
    with pytest.raises(ArgumentError, match="distortion"):
        HallCamera(folded)


def test_pictures_are_small_colour_images():
    for picture in bundled_pictures():
        assert picture.ndim == 3
        assert max(picture.shape[:2]) <= 512
