"""Hypothesis strategies that several test files share: poses, covariances, built-in fields, mirror cameras."""

import math

import numpy as np
from hypothesis import strategies as st

from field_models import field_names, load_field
from robocup_vision.camera import FloorRange, Hyperboloid, OmniCamera, Table, Tangent
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
