"""camera.toml: strict reading, checks that report file, key and value, and writing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, Union

import msgspec
import numpy as np

from field_models.errors import ArgumentError, FileError
from field_models.toml_file import StrictStruct, convert, read_toml, refuse_other_kind
from robocup_vision.camera.bounds import problem_of
from robocup_vision.camera.fisheye import FisheyeCamera, Projection
from robocup_vision.camera.floor_range import FloorRange, Hyperboloid, Table, Tangent
from robocup_vision.camera.omni import BOUNDED_KEYS as OMNI_KEYS
from robocup_vision.camera.omni import OmniCamera
from robocup_vision.camera.pinhole import BOUNDED_KEYS as PINHOLE_KEYS
from robocup_vision.camera.pinhole import DISTORTION_LENGTHS, PinholeCamera
from robocup_vision.files.text_files import toml_lines, write_lines

Camera: TypeAlias = Union[OmniCamera, PinholeCamera]  # noqa: UP007  (evaluated, on 3.10 too)
Positive = Annotated[float, msgspec.Meta(gt=0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0)]
# the greatest size of sensors; the tables of a greater one would exhaust the memory
Pixels = Annotated[int, msgspec.Meta(gt=0, le=16384)]

# inverse ranges below this (floor farther than 1000 km) count as above the horizon
NEAREST_HORIZON_PER_M = 1e-6
# extreme values give infinite or undefined numbers, which the checks report
_refusing_extremes = np.errstate(over="ignore", divide="ignore", invalid="ignore")


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
    mirrored: bool = OmniCamera.mirrored
    heading_rad: float = OmniCamera.heading_rad
    offset_m: tuple[float, float] = OmniCamera.offset_m
    tilt_rad: tuple[float, float] = OmniCamera.tilt_rad
    viewpoint_height_m: Positive | None = None


class _ForwardFile(StrictStruct):
    format: Literal[1]
    size_px: tuple[Pixels, Pixels]
    focal_px: tuple[Positive, Positive]
    center_px: tuple[float, float]
    height_m: Positive
    distortion: tuple[float, ...] = ()
    offset_m: tuple[float, float] = PinholeCamera.offset_m
    pan_rad: float | None = None
    tilt_rad: float | None = None
    roll_rad: float | None = None
    height_std_m: NotNegative = PinholeCamera.height_std_m
    focal_std_px: NotNegative = PinholeCamera.focal_std_px
    roll_std_rad: NotNegative | None = None
    tilt_std_rad: NotNegative | None = None
    pan_std_rad: NotNegative = PinholeCamera.pan_std_rad
    readout_s: NotNegative = PinholeCamera.readout_s


class _PinholeFile(_ForwardFile, kw_only=True):
    model: Literal["pinhole"]


class _FisheyeFile(_ForwardFile, kw_only=True):
    model: Literal["fisheye"]
    projection: Projection = FisheyeCamera.projection
    usable_radius_px: tuple[NotNegative, Positive] | None = None


@_refusing_extremes
def load_camera(path: str | Path) -> Camera:
    """Load and check a camera file, ``camera.toml``.

    Raises
    ------
    FileError
        If the file is missing, a key is missing, unknown or of the wrong type, a mirror's floor range is not strictly
        increasing over the usable radii, or pixel -> floor -> pixel (pinhole: pixel -> ray -> pixel) is not the
        identity over the image.
    """
    raw = read_toml(path)
    model = raw.get("model", ...)
    if model is ...:
        refuse_other_kind(path, raw, _PinholeFile)
        raise FileError(path, "is missing", key="model")
    if model == "omni":
        mirror = convert(path, raw, _OmniFile)
        _check_bounds(path, mirror, OMNI_KEYS)
        omni = _build_omni(path, mirror)
        _check_omni(path, omni)
        return omni
    if model not in ("pinhole", "fisheye"):
        raise FileError(path, "must be 'omni', 'pinhole' or 'fisheye'", key="model", value=model)
    lens = convert(path, raw, _PinholeFile) if model == "pinhole" else convert(path, raw, _FisheyeFile)
    _check_bounds(path, lens, PINHOLE_KEYS)
    camera = _build_fisheye(path, lens) if isinstance(lens, _FisheyeFile) else _build_pinhole(path, lens)
    check_pinhole(path, camera)
    return camera


def _check_bounds(path: str | Path, described: _OmniFile | _ForwardFile, keys: tuple[str, ...]) -> None:
    for key in keys:
        value = getattr(described, key)
        problem = problem_of(key, value)
        if problem is not None:
            value = list(value) if isinstance(value, tuple) else value
            raise FileError(path, problem.what, key=key, value=value, hint=problem.hint)


def _build_omni(path: str | Path, f: _OmniFile) -> OmniCamera:
    curve: FloorRange
    if isinstance(f.floor_range, _HyperboloidFile):
        curve = Hyperboloid(**_keys_of(f.floor_range))
    elif isinstance(f.floor_range, _TangentFile):
        curve = Tangent(**_keys_of(f.floor_range))
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
    return OmniCamera(**_keys_of(f) | {"floor_range": curve})


def _check_omni(path: str | Path, camera: OmniCamera) -> None:
    inner, outer = camera.usable_radius_px
    if inner >= outer:
        raise FileError(path, "must be inner < outer", key="usable_radius_px", value=[inner, outer])
    _check_center(path, camera)
    radii = np.linspace(inner, outer, 256)
    q = camera.floor_range.inverse_range_per_m(radii)
    if q[0] == np.inf:
        raise FileError(path, f"is no length at the usable radius of {inner:g} px", key="floor_range", value=0.0)
    if not q[0] > NEAREST_HORIZON_PER_M:
        raise FileError(path, "shows no floor at its inner end", key="usable_radius_px", value=[inner, outer])
    defined = np.isfinite(q)
    if not np.all(np.diff(q[defined]) < 0):
        raise FileError(path, "is not strictly increasing over usable_radius_px", key="floor_range")
    # a table may end within the usable radii, and other curves may pass the horizon: only floor pixels are checked
    bearings = np.linspace(0.0, 2 * np.pi, 72, endpoint=False)
    pixels = camera.polar_to_pixel(bearings[:, None], radii[None, defined & (q > NEAREST_HORIZON_PER_M)]).reshape(-1, 2)
    floor = camera.pixel_to_floor(pixels)
    seen = np.isfinite(floor).all(axis=1)
    if not seen.any():
        raise FileError(path, "shows no floor between usable_radius_px", key="floor_range")
    error = np.linalg.norm(camera.floor_to_pixel(floor[seen]) - pixels[seen], axis=1)
    worst = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
    if not error[worst] < 1e-3:
        u, v = pixels[seen][worst]
        raise FileError(
            path,
            f"pixel ({u:.1f}, {v:.1f}) maps to the floor and back {error[worst]:.3g} px away",
            key="floor_range",
        )


def _check_center(path: str | Path, camera: Camera) -> None:
    width, height = camera.size_px
    if not (0 <= camera.center_px[0] < width and 0 <= camera.center_px[1] < height):
        raise FileError(path, f"lies outside the {width}x{height} image", key="center_px", value=list(camera.center_px))


def _build_pinhole(path: str | Path, f: _ForwardFile) -> PinholeCamera:
    if len(f.distortion) not in DISTORTION_LENGTHS:
        raise FileError(path, "must have 0, 4, 5 or 8 coefficients", key="distortion", value=list(f.distortion))
    return PinholeCamera(**_keys_of(f))


def _build_fisheye(path: str | Path, f: _FisheyeFile) -> FisheyeCamera:
    try:
        camera = FisheyeCamera(**_keys_of(f))
        widest_rad = camera.widest_rad
    except ArgumentError as error:
        raise FileError(path, str(error)) from None
    if f.usable_radius_px is not None and not widest_rad < np.pi:
        raise FileError(
            path, "reaches beyond what the projection shows", key="usable_radius_px", value=f.usable_radius_px
        )
    return camera


def _keys_of(f: StrictStruct) -> dict[str, Any]:
    return {key: getattr(f, key) for key in f.__struct_fields__ if key not in ("format", "model")}


@_refusing_extremes
def check_pinhole(path: str | Path, camera: PinholeCamera) -> None:
    """Check that pixels of a pinhole camera are recovered from their rays.

    Raises
    ------
    FileError
        If they are not, or the optical axis lies outside the image; it reports the camera's file.
    """
    _check_center(path, camera)
    width, height = camera.size_px
    u, v = np.meshgrid(np.linspace(0, width - 1, 41), np.linspace(0, height - 1, 31))
    pixels = np.stack([u.ravel(), v.ravel()], axis=-1)
    rays = camera.pixel_to_camera_ray(pixels)
    if isinstance(camera, FisheyeCamera):
        # pixels outside the circle of a fisheye show nothing
        shown = np.isfinite(rays).all(axis=1)
        if not shown.any():
            raise FileError(path, "shows nothing of the image", key="usable_radius_px", value=camera.usable_radius_px)
        pixels, rays = pixels[shown], rays[shown]
    error = np.linalg.norm(camera.camera_ray_to_pixel(rays) - pixels, axis=1)
    worst = int(np.argmax(np.where(np.isfinite(error), error, np.inf)))
    if not error[worst] < 1e-3:
        u_worst, v_worst = pixels[worst]
        where = f"pixel ({u_worst:.1f}, {v_worst:.1f})"
        what = f"{where} maps to a ray and back {error[worst]:.3g} px away"
        if not np.isfinite(error[worst]):
            folds = "folds back within the picture: this lens " if camera.distortion else ""
            what = f"{folds}shows nothing at {where}"
        key = "distortion" if camera.distortion else "focal_px"
        raise FileError(path, what, key=key, value=list(getattr(camera, key)))


def save_camera(camera: Camera, path: str | Path) -> None:
    """Write a camera file from which `load_camera` reads the same camera.

    Raises
    ------
    FileError
        If the file cannot be written.
    ArgumentError
        If camera files do not support the kind of floor range.
    """
    write_lines(path, _omni_lines(camera) if isinstance(camera, OmniCamera) else _pinhole_lines(camera))


def _pinhole_lines(camera: PinholeCamera) -> list[str]:
    model = _FisheyeFile if isinstance(camera, FisheyeCamera) else _PinholeFile
    values = _values(camera, model)
    for key in ("pan_std_rad", "readout_s"):
        values[key] = values[key] or None
    return toml_lines({"format": 1, "model": "fisheye" if model is _FisheyeFile else "pinhole", **values})


def _omni_lines(camera: OmniCamera) -> list[str]:
    curve = camera.floor_range
    if isinstance(curve, Hyperboloid):
        described = {"kind": "hyperboloid", **_values(curve, _HyperboloidFile)}
    elif isinstance(curve, Tangent):
        described = {"kind": "tangent", **_values(curve, _TangentFile)}
    elif isinstance(curve, Table):
        pairs = {"radius_px": curve.table_radius_px.tolist(), "range_m": curve.table_range_m.tolist()}
        described = {"kind": "table", **pairs}
    else:
        raise ArgumentError(f"a camera file cannot hold a floor range of type {type(curve).__name__}")
    lines = toml_lines({"format": 1, "model": "omni", **_values(camera, _OmniFile)})
    return [*lines, "", "[floor_range]", *toml_lines(described)]


def _values(value: object, described: type[StrictStruct]) -> dict[str, Any]:
    """Return what a file says of a camera or curve."""
    keys = (key for key in described.__struct_fields__ if key not in ("format", "model", "floor_range"))
    return {key: getattr(value, key) for key in keys}
