"""Hypothesis strategies that several test files share: poses, covariances, built-in fields, cameras of every model."""

import math
from typing import Any

import numpy as np
from hypothesis import strategies as st

from field_models import field_names, load_field
from robocup_vision.camera import FisheyeCamera, FloorRange, Hyperboloid, OmniCamera, PinholeCamera, Table, Tangent
from robocup_vision.geometry import Pose2

PAPER_MIRROR = Hyperboloid(10120.0, 20.54, 229800.0)
PAPER_HORIZON_PX = math.sqrt((10120.0 / 20.54) ** 2 - 229800.0)


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False)


def poses(reach_m: float = 6.0) -> st.SearchStrategy[Pose2]:
    return st.builds(Pose2, numbers(-reach_m, reach_m), numbers(-reach_m, reach_m), numbers(-7.0, 7.0))


@st.composite
def covariances(draw: st.DrawFn) -> np.ndarray:
    factor = np.array(draw(st.lists(numbers(-1.0, 1.0), min_size=9, max_size=9))).reshape(3, 3)
    return factor @ factor.T + 1e-6 * np.eye(3)


def built_in_fields() -> st.SearchStrategy:
    return st.sampled_from(field_names()).map(load_field)


@st.composite
def curves(draw: st.DrawFn, scale: float = 1.0) -> FloorRange:
    """Draw a floor range for `scale` times 256x220 pixels, where floor is seen from 26 to 112 px * scale."""
    kind = draw(st.sampled_from(["hyperboloid", "tangent", "table"]))
    if kind == "hyperboloid":
        return Hyperboloid(PAPER_MIRROR.A_px_per_m * scale, PAPER_MIRROR.B_per_m, PAPER_MIRROR.C_px2 * scale**2)
    tangent = Tangent(draw(numbers(0.3, 3.0)), draw(numbers(0.005, 0.0138)) / scale)
    if kind == "tangent":
        return tangent
    radius = np.linspace(26.0, 112.0, draw(st.integers(2, 40))) * scale
    return Table(radius, 1.0 / tangent.inverse_range_per_m(radius))


@st.composite
def cameras(draw: st.DrawFn, *, level: bool = False) -> OmniCamera:
    scale = draw(st.sampled_from([1.0, 2.5]))
    tilt = (0.0, 0.0) if level else (draw(numbers(-0.1, 0.1)), draw(numbers(-0.1, 0.1)))
    return OmniCamera(
        size_px=(round(256 * scale), round(220 * scale)),
        center_px=(127.5 * scale + draw(numbers(-5, 5)), 109.5 * scale + draw(numbers(-5, 5))),
        usable_radius_px=(26.0 * scale, 112.0 * scale),
        floor_range=draw(curves(scale)),
        mirrored=draw(st.booleans()),
        heading_rad=draw(numbers(-4.0, 4.0)),
        offset_m=(draw(numbers(-0.2, 0.2)), draw(numbers(-0.2, 0.2))),
        tilt_rad=tilt,
        viewpoint_height_m=draw(numbers(0.1, 1.0)),
    )


# barrel, pincushion, a rational wide angle, and one with much tangential distortion
LENSES = [
    (),
    (-0.30, 0.10, 0.001, -0.002),
    (0.15, -0.05, 0.0, 0.0, 0.01),
    (0.4, 0.1, 0.001, 0.001, 0.01, 0.7, 0.2, 0.02),
    (-0.05, 0.0, 0.02, -0.02),
]


@st.composite
def pinholes(draw: st.DrawFn) -> PinholeCamera:
    return PinholeCamera(
        size_px=(640, 480),
        focal_px=(draw(numbers(400, 900)), draw(numbers(400, 900))),
        center_px=(draw(numbers(300, 340)), draw(numbers(220, 260))),
        height_m=draw(numbers(0.05, 1.5)),
        distortion=draw(st.sampled_from(LENSES)),
        offset_m=(draw(numbers(-0.2, 0.2)), draw(numbers(-0.2, 0.2))),
        pan_rad=draw(st.none() | numbers(-3.0, 3.0)),
        tilt_rad=draw(numbers(-1.2, 0.6)),
        roll_rad=draw(st.none() | numbers(-0.5, 0.5)),
        roll_std_rad=draw(st.none() | numbers(0.0, 0.5)),
    )


KANNALA_BRANDT = (-0.0216, -0.0029, 0.001, -0.0002)
FISHEYES = {
    "equidistant": ("equidistant", (), None),
    "equisolid": ("equisolid", (), None),
    "kannala_brandt": ("kannala_brandt", KANNALA_BRANDT, None),
    "all zero": ("kannala_brandt", (), None),
    "beyond 180 degrees": ("equidistant", (), (0.0, 310.0)),
}


def fisheye(name: str = "kannala_brandt", **changes: Any) -> FisheyeCamera:
    projection, distortion, circle = FISHEYES[name]
    values = {"tilt_rad": -0.3, "roll_rad": 0.02, "pan_rad": 0.4, "offset_m": (0.1, -0.05)} | changes
    return FisheyeCamera(
        (640, 600),
        (180.0, 181.0),
        (321.0, 302.0),
        0.5,
        distortion,
        projection=projection,
        usable_radius_px=circle,
        **values,
    )


def fisheyes() -> st.SearchStrategy[FisheyeCamera]:
    return st.builds(fisheye, st.sampled_from(list(FISHEYES)), tilt_rad=numbers(-1.4, 0.6))


def all_cameras() -> st.SearchStrategy[OmniCamera | PinholeCamera]:
    return cameras() | pinholes() | fisheyes()
