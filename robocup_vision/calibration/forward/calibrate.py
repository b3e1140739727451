"""Calibration of a forward camera, pinhole or fisheye, from pictures of a field.

All visible edges are used first (`calibrate_by_edges`), on any field, if the tilt is the same in all pictures. Pictures
of a goal and the lines around it are used if that fails, or if goals show the half of the field and the start's tilt
is unknown, because a neck may have turned the camera (`calibrate_by_goals`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from field_models.errors import FrameError
from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.forward.by_edges import calibrate_by_edges
from robocup_vision.calibration.forward.by_goals import calibrate_by_goals
from robocup_vision.calibration.forward.joint_fit import JointFit
from robocup_vision.calibration.forward.starts import KnownOfCamera, circle_of, dark_rim, starts_of
from robocup_vision.calibration.forward_parameters import CENTER, HEIGHT, LENS, LINE_WIDTH, LOG_FOCAL, ROLL, TILT
from robocup_vision.calibration.not_calibrated import NotCalibrated
from robocup_vision.calibration.starts import StartTrials
from robocup_vision.camera.fisheye import FisheyeCamera
from robocup_vision.camera.pinhole import PinholeCamera
from robocup_vision.geometry import Pose2

# standard deviation of the logarithm of the lines' width, that of a tape measure
_SAME_WIDTH = 0.03
# greatest standard deviations of a result: relative focal length, height
_MAX_FOCAL_STD, _MAX_HEIGHT_STD_M = 0.03, 0.03


@dataclass(frozen=True)
class ForwardFrame:
    """One picture in use: its index in the sequence, and its own tilt and roll (radians)."""

    index: int
    name: str
    tilt_rad: float
    roll_rad: float


@dataclass(frozen=True)
class ForwardCalibration:
    """A calibrated forward camera with its uncertainty.

    Parameters
    ----------
    camera : PinholeCamera
        Camera with its standard deviations; tilt and roll are None if they differ between the pictures.
    std : mapping of str to float
        Standard deviations of ``focal_px``, ``height_m``, ``center_u_px``, ``center_v_px``; of ``tilt_rad`` and
        ``roll_rad`` if they are the same in all pictures; of the distortion's coefficients ``k1`` and ``k2`` if they
        were fitted.
    correlation : float
        Correlation of focal length and height.
    frames : tuple of ForwardFrame
        Pictures in use.
    notes : tuple of str
        Messages for the user.
    residual_px : float
        Root mean square of the edges' residuals.
    line_width_m : float or None
        Width of the painted lines by the pictures; None if too few are near enough to show both edges.
    """

    camera: PinholeCamera
    std: Mapping[str, float]
    correlation: float
    frames: tuple[ForwardFrame, ...]
    notes: tuple[str, ...]
    residual_px: float
    line_width_m: float | None = None


def calibrate_forward(
    field: Field,
    images: Sequence[np.ndarray],
    start: PinholeCamera | KnownOfCamera | None = None,
    *,
    names: Sequence[str] | None = None,
    poses: Mapping[str, Pose2] | None = None,
    max_frames: int = 24,
    trials: StartTrials | None = None,
) -> ForwardCalibration | NotCalibrated:
    """Calibrate a forward camera from pictures of a field, taken anywhere.

    Parameters
    ----------
    field : Field
        A field, with goals of posts and a bar if a neck turns the camera between the pictures.
    images : sequence of (H, W, 3) uint8
        BGR, all of one size. Each is read when it is needed.
    start : PinholeCamera or KnownOfCamera, optional
        A camera within about 18 % in focal length and 15 % in height, with a tilt within 3 degrees or unknown; or rough
        knowledge of one, in which trial values replace unknown ones. By default an unknown pinhole camera.
    poses : mapping of str to Pose2, optional
        Approximate camera poses (0.4 m, 9 degrees), by image.
    max_frames : int
        Greatest number of pictures in use; they are evenly spread.
    trials : StartTrials, optional
        Evaluates the starts, with workers or after an interruption.

    Raises
    ------
    ArgumentError
        If the field has no goals of posts and a bar, and they are needed.
    """
    trials, start = trials or StartTrials(), start or KnownOfCamera()
    count = len(images)
    called = list(names) if names is not None else [str(index) for index in range(count)]
    frames: dict[int, UInt8Array] = {}
    notes: tuple[str, ...] = ()
    for index in (int(i) for i in np.unique(np.linspace(0, count - 1, min(count, max_frames)).round())):
        try:
            frames[index] = images[index]
        except FrameError as error:
            notes = (*notes, f"{error}: left out")
    if not frames:
        return NotCalibrated("none of the images can be read", notes)
    prior = {index: poses[called[index]] for index in frames if poses and called[index] in poses}
    is_tilt_known = start.tilt_rad is not None
    results: list[ForwardCalibration | NotCalibrated] = []
    # if goals show the half, the localisers need a pose to determine the tilt
    is_fisheye = isinstance(start, FisheyeCamera) or (isinstance(start, KnownOfCamera) and start.model == "fisheye")
    if is_tilt_known or is_fisheye or not field.shows_half:
        rim = dark_rim(list(frames.values())) if is_fisheye else None
        height, width = next(iter(frames.values())).shape[:2]
        edges = calibrate_by_edges(field, frames, starts_of((width, height), start), prior, trials)
        by_edges = _result(edges, field, len(frames), called, rim, notes)
        # few pictures agree if the tilt differs between them
        if is_fisheye or (by_edges and 2 * len(by_edges.frames) >= len(frames)):
            return by_edges
        if not any(goal.kind == "posts" for goal in field.goals):
            return by_edges
        results.append(by_edges)
    goals = calibrate_by_goals(field, frames, start, prior, trials)
    by_goals = _result(goals, field, len(frames), called, None, notes)
    if isinstance(by_goals, NotCalibrated) and by_goals.reason.startswith("no goal") and not poses:
        tilted = "" if is_tilt_known else " a start with its tilt_rad (--start), or"
        reason = f"{by_goals.reason}; without a goal{tilted} rough poses of the images (--poses) may do"
        by_goals = NotCalibrated(reason, by_goals.notes)
    results.append(by_goals)
    good = [result for result in results if isinstance(result, ForwardCalibration)]
    return max(good, key=lambda result: len(result.frames)) if good else results[-1]


def _result(
    found: JointFit | NotCalibrated,
    field: Field,
    count: int,
    called: Sequence[str],
    rim: tuple[float, float, float] | None,
    notes: tuple[str, ...],
) -> ForwardCalibration | NotCalibrated:
    """Return a calibration with notes for the user, or the reason for its refusal."""
    if isinstance(found, NotCalibrated):
        return NotCalibrated(found.reason, notes)
    std, camera, used = np.sqrt(np.diag(found.covariance)), found.camera, found.unknowns
    for what, one, most, size in (
        ("focal length", std[LOG_FOCAL], _MAX_FOCAL_STD, f"{100 * std[LOG_FOCAL]:.0f} %"),
        ("height", std[HEIGHT], _MAX_HEIGHT_STD_M, f"{std[HEIGHT]:.3f} m"),
    ):
        if one > most:
            return NotCalibrated(f"{len(used)} usable images leave the {what} uncertain by {size}", notes)
    if len(used) < count:
        why = "show too little of the field or fit the others badly"
        notes = (*notes, f"{count - len(used)} of {count} images {why}: left out")
    if len(used) == 1:
        notes = (*notes, "one image cannot be checked against others: use several")
    log_width = float(found.vector[LINE_WIDTH])
    is_width_known = float(std[LINE_WIDTH]) < _SAME_WIDTH
    width_m = field.line_width_m * math.exp(log_width)
    if is_width_known and abs(log_width) > max(_SAME_WIDTH, 3 * float(std[LINE_WIDTH])):
        notes = (*notes, f"lines are {width_m:.3f} m wide by the images, {field.line_width_m:g} m in the field file")
    center_u, center_v = std[CENTER].tolist()
    named = {
        "focal_px": float(std[LOG_FOCAL]) * camera.focal_px[0],
        "height_m": float(std[HEIGHT]),
        "tilt_rad": float(std[TILT]),
        "roll_rad": float(std[ROLL]),
        "center_u_px": center_u,
        "center_v_px": center_v,
        **{f"k{place}": one for place, one in enumerate(std[LENS:].tolist(), 1)},
    }
    if camera.tilt_rad is None:
        del named["tilt_rad"], named["roll_rad"]
        notes = (*notes, "the tilt differs between the images, or there is only one image: the tilt is left unknown")
    camera = replace(camera, height_std_m=max(named["height_m"], 1e-4), focal_std_px=named["focal_px"])
    if isinstance(camera, FisheyeCamera) and rim is not None:
        camera = replace(camera, usable_radius_px=circle_of(rim, camera.center_px))
    tilts = {index: held[3:5].tolist() for index, held in used.items()}
    return ForwardCalibration(
        camera,
        named,
        float(found.covariance[HEIGHT, LOG_FOCAL] / (std[HEIGHT] * std[LOG_FOCAL])),
        tuple(ForwardFrame(index, called[index], tilt, roll) for index, (tilt, roll) in tilts.items()),
        notes,
        found.rms_px,
        width_m if is_width_known else None,
    )
