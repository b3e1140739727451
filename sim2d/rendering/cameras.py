"""Cameras by name or file, for rendering before a camera is calibrated."""

from __future__ import annotations

import re
from pathlib import Path

from field_models.errors import ArgumentError
from field_models.near_names import did_you_mean
from robocup_vision.camera import Camera, Hyperboloid, OmniCamera, load_camera

_MAX_PX = 9999


def sekimori_camera(width: int = 256, height: int = 220) -> OmniCamera:
    """Return the mirror camera of Sekimori et al. 2001 (eq. 26, 256 x 220), scaled to an image size by its height."""
    scale = height / 220
    return OmniCamera(
        size_px=(width, height),
        center_px=((width - 1) / 2, (height - 1) / 2),
        usable_radius_px=(26.0 * scale, 112.0 * scale),
        floor_range=Hyperboloid(A_px_per_m=10.12e3 * scale, B_per_m=20.54, C_px2=2.298e5 * scale**2),
    )


def camera_by_name(name_or_path: str | Path) -> Camera:
    """Return ``sekimori``, ``sekimori:WIDTHxHEIGHT`` or the camera of a ``camera.toml``.

    Raises
    ------
    ArgumentError
        If it is neither a file nor a known name, or the size is invalid.
    FileError
        If the camera file is missing or not valid.
    """
    name = str(name_or_path)
    if name == "sekimori":
        return sekimori_camera()
    if name.startswith("sekimori:"):
        size = re.fullmatch(r"sekimori:([1-9]\d+)x([1-9]\d+)", name)
        if size is None:
            raise ArgumentError(f"camera '{name}' is not of the form sekimori:WIDTHxHEIGHT, e.g. sekimori:640x480")
        width, height = int(size[1]), int(size[2])
        if max(width, height) > _MAX_PX:
            raise ArgumentError(f"camera '{name}' has too large images: at most {_MAX_PX}x{_MAX_PX} pixels")
        return sekimori_camera(width, height)
    if not name.endswith(".toml") and not Path(name).exists():
        hint = did_you_mean(name.partition(":")[0], ["sekimori"])
        raise ArgumentError(f"camera '{name}' is neither a .toml file nor sekimori[:WIDTHxHEIGHT]{hint}")
    return load_camera(name_or_path)
