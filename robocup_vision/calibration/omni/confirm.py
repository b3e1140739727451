"""Asks of each frame of a calibration whether a robot that plays would find itself where the fit puts it.

Lines among clutter can be fitted by a wrong camera, with the robot in a wrong place. A look asks more of a frame than
the fit does: lines that should be in plain sight, and next to no points on the carpet beside lines.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

from field_models.field import Field
from robocup_vision.arrays import UInt8Array
from robocup_vision.calibration.omni.fit import Fit
from robocup_vision.calibration.omni.settings import OmniCalibrationSettings
from robocup_vision.calibration.omni.sightings import Observer, Sighting
from robocup_vision.geometry import Pose2


def confirmed(
    field: Field,
    frames: Sequence[UInt8Array],
    fit: Fit,
    sightings: Sequence[Sighting],
    mask: UInt8Array | None = None,
    settings: OmniCalibrationSettings = OmniCalibrationSettings(),
) -> tuple[list[Sighting], dict[int, str]]:
    """Look at the frames of a fit by its camera.

    Parameters
    ----------
    field : Field
        The pitch.
    frames : sequence of (H, W, 3) uint8
        All frames, of which the sightings' indices speak.
    fit : Fit
        Camera, and the pose of each sighting.
    sightings : sequence of Sighting
        What was fitted.
    mask : (H, W) uint8, optional
        Pixels where it is not zero are not used.
    settings : OmniCalibrationSettings, optional
        Its `max_confirmed_radii` and `points` are used.

    Returns
    -------
    list of Sighting
        Those in whose frames the robot finds itself where the fit puts it, with the fit's poses.
    dict of int to str
        Why each other frame, by its index, is none of them.
    """
    observer = Observer(field, fit.model.written(fit.vector), mask, locate=True, settings=settings.points)
    max_m = settings.max_confirmed_radii * field.robot_radius_m
    kept, notes = [], {}
    for sighting, array in zip(sightings, fit.poses, strict=True):
        pose = Pose2(*array.tolist())
        seen = observer.look(sighting.index, frames[sighting.index]).pose
        if seen is None:
            notes[sighting.index] = "by the camera found, the robot does not find itself in it"
        elif seen.error_to(pose, symmetric=not field.halves_differ)[0] > max_m:
            notes[sighting.index] = "by the camera found, the robot is somewhere else"
        else:
            kept.append(dataclasses.replace(sighting, pose=pose))
    return kept, notes
