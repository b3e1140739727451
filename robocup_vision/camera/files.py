"""camera.toml: strict reading, load-time checks that name file, key and value, and writing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Union

import msgspec
import numpy as np

from field_models.errors import ArgumentError, FileError
from field_models.toml_file import StrictStruct, convert, read_toml
from robocup_vision.camera.floor_range import FloorRange, Hyperboloid, Table, Tangent
from robocup_vision.camera.omni import OmniCamera

Positive = Annotated[float, msgspec.Meta(gt=0)]
Pixels = Annotated[int, msgspec.Meta(gt=0)]

# inverse ranges below this (floor a thousand km away) count as horizon
NEAREST_HORIZON_PER_M = 1e-6


class _HyperboloidFile(StrictStruct, tag_field="kind", tag="hyperboloid"):
    A_px_per_m: Positive
    B_per_m: Positive
    C_px2: Positive


class _TangentFile(StrictStruct, tag_field="kind", tag="tangent"):
    a_m: Positive
    b_per_px: Positive


class _TableFile(StrictStruct, tag_field="kind", tag="table"):
    radius_px: Annotated[tuple[Positive, ...], msgspec.Meta(min_length=2)]
    range_m: Annotated[tuple[Positive, ...], msgspec.Meta(min_length=2)]


class _OmniFile(StrictStruct):
    format: Literal[1]
    model: Literal["omni"]
    size_px: tuple[Pixels, Pixels]
    center_px: tuple[float, float]
    usable_radius_px: tuple[Positive, Positive]
    floor_range: Union[_HyperboloidFile, _TangentFile, _TableFile]  # noqa: UP007  (msgspec on 3.10)
    mirrored: bool = False
    heading_rad: float = 0.0
    offset_m: tuple[float, float] = (0.0, 0.0)
    tilt_rad: tuple[float, float] = (0.0, 0.0)
    viewpoint_height_m: Positive | None = None


def load_camera(path: str | Path) -> OmniCamera:
    """Load and check a camera file.

    Parameters
    ----------
    path : str or Path
        A ``camera.toml``.

    Raises
    ------
    FileError
        If the file is missing, a key is missing, unknown or of the wrong type, the floor range is not strictly
        increasing over the usable radii, or pixel -> floor -> pixel does not come back over the image.
    """
    raw = read_toml(path)
    model = raw.get("model", ...)
    if model is ...:
        raise FileError(path, "is missing", key="model")
    if model != "omni":
        raise FileError(path, "must be 'omni'", key="model", value=model)
    description = convert(path, raw, _OmniFile)
    camera = _build(path, description)
    _check(path, camera)
    return camera


def _build(path: str | Path, f: _OmniFile) -> OmniCamera:
    curve: FloorRange
    if isinstance(f.floor_range, _HyperboloidFile):
        curve = Hyperboloid(f.floor_range.A_px_per_m, f.floor_range.B_per_m, f.floor_range.C_px2)
    elif isinstance(f.floor_range, _TangentFile):
        curve = Tangent(f.floor_range.a_m, f.floor_range.b_per_px)
    else:
        if len(f.floor_range.radius_px) != len(f.floor_range.range_m):
            raise FileError(
                path,
                f"must have as many entries as radius_px ({len(f.floor_range.radius_px)})",
                key="floor_range.range_m",
                value=len(f.floor_range.range_m),
            )
        for key, values in (("radius_px", f.floor_range.radius_px), ("range_m", f.floor_range.range_m)):
            falls = np.flatnonzero(np.diff(values) <= 0)
            if len(falls):
                raise FileError(
                    path,
                    "must be strictly increasing",
                    key=f"floor_range.{key}[{falls[0] + 1}]",
                    value=values[falls[0] + 1],
                )
        curve = Table(np.array(f.floor_range.radius_px), np.array(f.floor_range.range_m))
    if any(f.tilt_rad) and f.viewpoint_height_m is None and curve.implied_height_m is None:
        raise FileError(path, "is needed when tilt_rad is not zero", key="viewpoint_height_m")
    if max(abs(t) for t in f.tilt_rad) > 0.3:
        raise FileError(path, "must be small (at most 0.3 rad)", key="tilt_rad", value=list(f.tilt_rad))
    return OmniCamera(
        size_px=f.size_px,
        center_px=f.center_px,
        usable_radius_px=f.usable_radius_px,
        floor_range=curve,
        mirrored=f.mirrored,
        heading_rad=f.heading_rad,
        offset_m=f.offset_m,
        tilt_rad=f.tilt_rad,
        viewpoint_height_m=f.viewpoint_height_m,
    )


def _check(path: str | Path, camera: OmniCamera) -> None:
    inner, outer = camera.usable_radius_px
    if inner >= outer:
        raise FileError(path, "must be inner < outer", key="usable_radius_px", value=[inner, outer])
    width, height = camera.size_px
    if not (0 <= camera.center_px[0] < width and 0 <= camera.center_px[1] < height):
        raise FileError(path, f"lies outside the {width}x{height} image", key="center_px", value=list(camera.center_px))
    radii = np.linspace(inner, outer, 256)
    q = camera.floor_range.inverse_range_per_m(radii)
    if not NEAREST_HORIZON_PER_M < q[0] < np.inf:
        raise FileError(path, "shows no floor at its inner end", key="usable_radius_px", value=[inner, outer])
    defined = np.isfinite(q)
    if not np.all(np.diff(q[defined]) < 0):
        raise FileError(path, "is not strictly increasing over usable_radius_px", key="floor_range")
    # a table may end before the usable radius does, other curves may pass the horizon: only the floor must come back
    bearings = np.linspace(0.0, 2 * np.pi, 72, endpoint=False)
    pixels = camera.polar_to_pixel(bearings[:, None], radii[None, defined & (q > NEAREST_HORIZON_PER_M)]).reshape(-1, 2)
    floor = camera.pixel_to_floor(pixels)
    seen = np.isfinite(floor).all(axis=1)
    error = np.linalg.norm(camera.floor_to_pixel(floor[seen]) - pixels[seen], axis=1)
    worst = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
    if not error[worst] < 1e-3:
        u, v = pixels[seen][worst]
        raise FileError(
            path,
            f"pixel ({u:.1f}, {v:.1f}) maps to the floor and back {error[worst]:.3g} px away",
            key="floor_range",
        )


def save_camera(camera: OmniCamera, path: str | Path) -> None:
    """Write a camera file that `load_camera` reads back to the same camera.

    Raises
    ------
    FileError
        If the file cannot be written.
    ArgumentError
        If the floor range is of a kind that camera files do not have.
    """
    lines = ["format = 1", 'model = "omni"']
    lines += [
        f"size_px = {[int(v) for v in camera.size_px]}",
        f"center_px = {[float(v) for v in camera.center_px]}",
        f"usable_radius_px = {[float(v) for v in camera.usable_radius_px]}",
        f"mirrored = {str(camera.mirrored).lower()}",
        f"heading_rad = {float(camera.heading_rad)}",
        f"offset_m = {[float(v) for v in camera.offset_m]}",
        f"tilt_rad = {[float(v) for v in camera.tilt_rad]}",
    ]
    if camera.viewpoint_height_m is not None:
        lines.append(f"viewpoint_height_m = {float(camera.viewpoint_height_m)}")
    lines += ["", "[floor_range]"]
    curve = camera.floor_range
    if isinstance(curve, Hyperboloid):
        lines += ['kind = "hyperboloid"', f"A_px_per_m = {float(curve.A_px_per_m)}"]
        lines += [f"B_per_m = {float(curve.B_per_m)}", f"C_px2 = {float(curve.C_px2)}"]
    elif isinstance(curve, Tangent):
        lines += ['kind = "tangent"', f"a_m = {float(curve.a_m)}", f"b_per_px = {float(curve.b_per_px)}"]
    elif isinstance(curve, Table):
        lines += ['kind = "table"', f"radius_px = {curve.table_radius_px.tolist()}"]
        lines.append(f"range_m = {curve.table_range_m.tolist()}")
    else:
        raise ArgumentError(f"a camera file cannot hold a floor range of type {type(curve).__name__}")
    try:
        Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise FileError(path, f"cannot be written ({error.strerror or error})") from None
