"""Ray casting of textured rectangles against plain NumPy: what each ray meets first, and its light."""

import math

import numpy as np

from robocup_vision.camera import PinholeCamera
from robocup_vision.geometry import Pose2
from sim2d.kernels.panels import PanelHits, Panels, Pyramids, RayFan, first_panel, shade_panels
from sim2d.rendering.hall.hall import HallCamera, make_hall

CAMERA = PinholeCamera((40, 30), (35.0, 35.0), (19.5, 14.5), 0.5, pan_rad=0.1, tilt_rad=0.05, roll_rad=0.02)


def test_rays_meet_what_geometry_says():
    hall = make_hall(3, posters=8, furniture=5, crates=2)
    pose = Pose2(0.7, -0.4, 2.0)
    pixels = np.stack(np.meshgrid(np.arange(40.0), np.arange(30.0)), axis=-1)
    along = CAMERA.pixel_to_camera_ray(pixels)
    directions = ((along / along[..., :1]) @ CAMERA.camera_to_robot.T).astype(np.float32)[:, :, None]
    origin, ax, up, size, _ = panels = hall.arrays
    eye = np.array([pose.x_m, pose.y_m, CAMERA.height_m])
    depth, met = np.empty((30, 40, 1), np.float32), np.empty((30, 40, 1), np.int16)
    window = np.tile([0, 30, 0, 40], (len(origin), 1))
    c, s = math.cos(pose.theta_rad), math.sin(pose.theta_rad)
    rays = RayFan(directions, c, s, eye, 0.01)
    first_panel(rays, panels, window, PanelHits(depth, met))

    world = directions[:, :, 0].astype(np.float64) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
    normal = np.cross(ax, up)
    facing_rays = world @ normal.T
    with np.errstate(divide="ignore", invalid="ignore"):
        t = ((origin - eye) * normal).sum(axis=1) / facing_rays
        hit = eye + t[..., None] * world[:, :, None] - origin
        a, b = (hit * ax).sum(axis=-1), (hit * up).sum(axis=-1)
        inside = (facing_rays < 0) & (t > 0) & (a >= 0) & (a <= size[:, 0]) & (b >= 0) & (b <= size[:, 1])
    t = np.where(inside, t, np.inf)
    np.testing.assert_allclose(depth[..., 0], t.min(axis=-1), rtol=1e-4)
    assert (met[..., 0] == t.argmin(axis=-1)).mean() > 0.995
    assert len(np.unique(met)) > 5
    # the windows leave nothing out
    camera = HallCamera(CAMERA, 1)
    windows = camera._windows(panels, pose)
    near_depth = np.empty_like(depth)
    first_panel(rays, panels, windows, PanelHits(near_depth, met))
    np.testing.assert_array_equal(near_depth, depth)


def plain_color(texels, level, a, b):
    """Return the texture's colour at (a, b) of its width and height, bilinear between texels, on one level."""
    first, rows, columns = level
    picture = texels[first : first + rows * columns].reshape(rows, columns, 3).astype(float)
    x, y = np.clip(a * columns - 0.5, 0, columns - 1.001), np.clip(b * rows - 0.5, 0, rows - 1.001)
    i, j = int(y), int(x)
    below, right = min(i + 1, rows - 1), min(j + 1, columns - 1)
    fy, fx = y - i, x - j
    top = (1 - fx) * picture[i, j] + fx * picture[i, right]
    return (1 - fy) * top + fy * ((1 - fx) * picture[below, j] + fx * picture[below, right])


def test_shading_agrees_with_plain_code():
    """Each ray by itself: the texture at two scales, under ambient light and two lamps."""
    hall = make_hall(3, posters=8, furniture=5, crates=2)
    eye, ray_rad, ambient = np.array([0.2, -0.3, 0.5]), 0.02, 0.6
    rng = np.random.default_rng(2)
    directions = np.concatenate([np.ones((12, 16, 2, 1)), rng.uniform(-0.5, 0.5, (12, 16, 2, 2))], axis=3)
    rays = RayFan(directions.astype(np.float32), math.cos(0.4), math.sin(0.4), eye, ray_rad)
    lamps = np.array([[0.0, 0.0, 2.0, 0.8], [1.0, -1.0, 1.5, 0.3]])
    panels, pyramids = hall.arrays, hall.pyramids
    hits = PanelHits(np.empty((12, 16, 2), np.float32), np.empty((12, 16, 2), np.int16))
    first_panel(rays, panels, np.tile([0, 12, 0, 16], (len(panels.origin), 1)), hits)
    image = np.empty((12, 16, 3), np.float32)
    shade_panels(rays, panels, pyramids, ambient, lamps, hits, image)

    turn = np.array([[rays.cos, -rays.sin, 0], [rays.sin, rays.cos, 0], [0, 0, 1]])
    expected = np.zeros((12, 16, 3))
    for r, c, k in np.argwhere(hits.met >= 0):
        p, ray = hits.met[r, c, k], turn @ rays.directions[r, c, k].astype(float)
        there = eye + float(hits.depth[r, c, k]) * ray
        along, up = panels.along[p], panels.up[p]
        normal = np.cross(along, up)
        a, b = np.array([along, up]) @ (there - panels.origin[p]) / panels.size[p]
        # how much of the panel a ray covers, and at which scale a texel is as large
        facing = -normal @ ray / np.linalg.norm(ray)
        patch_m = np.linalg.norm(there - eye) * ray_rad / math.sqrt(max(facing, 0.02))
        levels = pyramids.levels[panels.texture[p]]
        per_m = math.sqrt(levels[0, 1] * levels[0, 2] / np.prod(panels.size[p]))
        level = np.clip(math.log2(max(patch_m * per_m, 1e-6)), 0, len(levels) - 1)
        low = min(int(level), len(levels) - 2)
        color = sum(
            weight * plain_color(pyramids.texels, levels[scale], a, 1 - b)
            for scale, weight in ((low, 1 - (level - low)), (low + 1, level - low))
        )
        light = ambient
        for *lamp, strength in lamps:
            way = np.array(lamp) - there
            light += strength * max(normal @ way / np.linalg.norm(way), 0.0) / max(way @ way, 0.25)
        expected[r, c] += light * color / 2
    assert len(np.unique(hits.met)) > 3
    np.testing.assert_allclose(image, expected, rtol=1e-3, atol=0.05)


def test_empty_rays_stay_black():
    image = np.full((1, 1, 3), 7.0, dtype=np.float32)
    nothing = np.empty((0, 3))
    rays = RayFan(np.ones((1, 1, 1, 3), np.float32), 1.0, 0.0, np.zeros(3), 0.01)
    panels = Panels(nothing, nothing, nothing, np.empty((0, 2)), np.empty(0, np.int64))
    pyramids = Pyramids(np.zeros((1, 3), np.uint8), np.ones((1, 2, 3), np.int64))
    hits = PanelHits(np.full((1, 1, 1), np.inf, np.float32), np.full((1, 1, 1), -1, np.int16))
    shade_panels(rays, panels, pyramids, 1.0, np.empty((0, 4)), hits, image)
    assert (image == 0).all()
