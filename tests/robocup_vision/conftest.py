"""Pictures for tests: a painter that shares no code with the simulator (no walls), and a dozen rendered frames."""

import numpy as np
import pytest

from field_models import load_field
from robocup_vision.camera import OmniCamera, Tangent
from robocup_vision.localization.line_map import LineMap
from sim2d.rendering.cameras import sekimori_camera
from sim2d.rendering.random_scenes import CONDITIONS, sample

CARPET_BGR, PAINT_BGR, HALL_BGR = np.array([(50, 130, 45), (225, 230, 225), (90, 100, 110)])


@pytest.fixture(scope="session")
def mirror_camera():
    return OmniCamera((320, 240), (160.3, 118.6), (20.0, 110.0), Tangent(2.1456, 0.0114))


@pytest.fixture(scope="session")
def paint_field():
    # with each field, which keeps its identity its own
    maps = {}

    def painted(camera, field, pose, rows, margin_m):
        """Fractions of carpet and of paint of each pixel of some rows."""
        width, fine = camera.size_px[0], 3
        v, u = (np.mgrid[: len(rows) * fine, : width * fine] + 0.5) / fine - 0.5
        floor = camera.pixel_to_floor(np.stack([u, v + rows[0]], axis=-1)).reshape(-1, 2)
        points = pose.transform(np.nan_to_num(floor, nan=1e3)).reshape(len(rows), fine, width, fine, 2)
        on_carpet = (np.abs(points) <= (field.length_m / 2 + margin_m, field.width_m / 2 + margin_m)).all(axis=-1)
        if id(field) not in maps:
            maps[id(field)] = field, LineMap(field)
        line_map, half_m = maps[id(field)][1], field.line_width_m / 2
        # only pixels whose middle is as near to a line as to their own corners may show paint
        middle = points[:, fine // 2, :, fine // 2]
        reach_m = np.sqrt(((points - middle[:, None, :, None]) ** 2).sum(axis=-1).max(axis=(1, 3)))
        near = on_carpet.any(axis=(1, 3))
        near[near] = line_map.nearest(middle[near]).distance_m <= half_m + reach_m[near]
        on_paint = on_carpet & near[:, None, :, None]
        on_paint[on_paint] = line_map.nearest(points[on_paint]).distance_m <= half_m
        return on_carpet.mean(axis=(1, 3)), on_paint.mean(axis=(1, 3))

    def paint(camera, field, pose, *, margin_m=0.3, gain=1.0, noise=0.0, rng=None):
        # a few rows at a time stay in the processor's cache
        strips = np.array_split(np.arange(camera.size_px[1]), camera.size_px[1] // 12)
        parts = zip(*(painted(camera, field, pose, rows, margin_m) for rows in strips), strict=True)
        carpet, paint = (np.concatenate(part)[..., None] for part in parts)
        image = gain * ((1.0 - carpet) * HALL_BGR + (carpet - paint) * CARPET_BGR + paint * PAINT_BGR)
        if noise:
            image = image + rng.normal(0.0, noise, image.shape)
        return np.clip(np.round(image), 0, 255).astype(np.uint8)

    return paint


@pytest.fixture(scope="session")
def ssl_field():
    return load_field("ssl_2001")


@pytest.fixture(scope="session")
def paper_camera():
    return sekimori_camera()


@pytest.fixture(scope="session")
def nominal_samples(ssl_field, paper_camera):
    """Twelve rendered frames with their truth; nobody may write to them."""
    samples = list(sample(ssl_field, paper_camera, CONDITIONS["nominal"], seed=31, count=12, supersample=2))
    for one in samples:
        one.frame.flags.writeable = False
    return samples
